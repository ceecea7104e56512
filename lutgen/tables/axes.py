"""The axes of a LUT: value to texture coordinate and back, and the order of its cells.

A parameter x in [low, high] is warped to t in [0, 1] by the axis spacing; node i lies at t = i / (count - 1);
its texture coordinate is u = (t (count - 1) + 0.5) / count, the center of texel i.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lutgen.errors import InputError, in_range, shown, whole
from lutgen.skin import chromophores

MAX_COUNT = 256


@dataclass(frozen=True)
class Axis:
    """One LUT axis; `spacing` is linear, cbrt, power:p (nodes even in x**p) or log; count 1 is a fixed parameter.

    >>> axis = Axis("melanin", "1", 0.001, 0.5, 16, "cbrt")
    >>> round(float(axis.values[1]), 6), round(float(axis.coordinate(0.5)), 5)
    (0.003128, 0.96875)
    """

    name: str
    unit: str
    low: float
    high: float
    count: int
    spacing: str = "linear"

    def __post_init__(self):
        low, high = chromophores.RANGES.get(self.name, (-1e300, 1e300))
        object.__setattr__(self, "count", whole(f"{self.name} axis: count", self.count, 1, MAX_COUNT))
        object.__setattr__(self, "low", in_range(f"{self.name} axis: low", self.low, low, high))
        object.__setattr__(self, "high", in_range(f"{self.name} axis: high", self.high, low, high))
        if self.low > self.high:
            raise InputError(f"{self.name} axis: low = {self.low:g} is above high = {self.high:g}; swap them")
        if (self.count == 1) != (self.low == self.high):
            raise InputError(
                f"{self.name} axis: count = {self.count} with low = {self.low:g} and high = {self.high:g}: "
                "a fixed parameter has count 1 and low = high, any other axis at least 2 nodes and low < high"
            )
        if self.spacing == "log" and self.low <= 0:
            raise InputError(f"{self.name} axis: low = {self.low:g}: log spacing needs a low above 0")
        if self.exponent < 1 and self.low < 0:
            raise InputError(f"{self.name} axis: low = {self.low:g}: {self.spacing} spacing needs a low of 0 or more")

    @property
    def exponent(self) -> float:
        """The power under which nodes are even: 1 for linear, 1/3 for cbrt, p for power:p, 0 for log."""
        named = {"linear": 1.0, "cbrt": 1 / 3, "log": 0.0}
        if isinstance(self.spacing, str) and self.spacing in named:
            return named[self.spacing]
        kind, _, power = str(self.spacing).partition(":")
        try:
            value = float(power)
        except ValueError:
            value = np.nan
        if kind != "power" or not 0 < value <= 1:
            allowed = "linear, cbrt, log, power:p with 0 < p <= 1"
            raise InputError(f"{self.name} axis: spacing = {shown(self.spacing)}: allowed is {allowed}")
        return value

    def _evened(self, value):
        """What nodes are even in: log, cube root or power of a value."""
        p = self.exponent
        return np.log(value) if p == 0 else np.cbrt(value) if self.spacing == "cbrt" else np.asarray(value, float) ** p

    @property
    def ends(self) -> tuple[float, float]:
        """(a, b), what nodes are even in at `low` and at `high`: t = (value ** exponent - a) / (b - a), or of log."""
        return float(self._evened(self.low)), float(self._evened(self.high))

    def warp(self, value) -> np.ndarray:
        """t in [0, 1] of a value, clamped to the axis; 0 for a fixed parameter."""
        if self.count == 1:
            return np.zeros_like(np.asarray(value, float))
        a, b = self.ends
        return (self._evened(np.clip(np.asarray(value, float), self.low, self.high)) - a) / (b - a)

    def unwarp(self, t) -> np.ndarray:
        """The value at t in [0, 1], the inverse of `warp`; single precision stays single."""
        if self.count == 1:
            return np.full(np.shape(t), self.low)
        p, (a, b) = self.exponent, self.ends
        even = a + t * (b - a)
        value = np.exp(even) if p == 0 else even * even * even if self.spacing == "cbrt" else even ** (1 / p)
        return np.clip(value, self.low, self.high)

    @property
    def values(self) -> np.ndarray:
        """Parameter value at each node, from low to high."""
        values = self.unwarp(np.linspace(0, 1, self.count))
        values[0], values[-1] = self.low, self.high
        return values

    def position(self, value) -> np.ndarray:
        """Node index, with fraction, of a value; clamped to [0, count - 1], 0 for a fixed parameter."""
        return self.warp(value) * (self.count - 1)

    def value(self, position) -> np.ndarray:
        """The value at a node index with fraction: the inverse of `position`."""
        return self.unwarp(position / max(self.count - 1, 1))

    def coordinate(self, value) -> np.ndarray:
        """Texture coordinate u in (0, 1) of a value; 0.5 for a fixed parameter."""
        return (self.position(value) + 0.5) / self.count


@dataclass(frozen=True)
class Grid:
    """Three axes; arrays over it are ordered [hemoglobin, eumelanin, melanin, ...].

    As an image: melanin runs along x within a tile, tiles along eumelanin, hemoglobin along y, first row lowest.

    >>> grid = default_grid(16, 8, 16)
    >>> grid.shape
    (16, 8, 16)
    """

    melanin: Axis
    eumelanin: Axis
    hemoglobin: Axis

    def __repr__(self) -> str:
        return f"Grid({', '.join(f'{axis.count} {axis.name} {axis.low:g} to {axis.high:g}' for axis in self.axes)})"

    def __post_init__(self):
        for name in chromophores.NAMES:
            if getattr(self, name).name != name:
                raise InputError(f"{name} = the {getattr(self, name).name} axis: a grid takes each axis by its name")

    @property
    def axes(self) -> tuple[Axis, Axis, Axis]:
        """The axes as arrays are ordered: (hemoglobin, eumelanin, melanin)."""
        return self.hemoglobin, self.eumelanin, self.melanin

    @property
    def shape(self) -> tuple[int, int, int]:
        """Node counts as arrays are ordered: (hemoglobin, eumelanin, melanin)."""
        hemoglobin, eumelanin, melanin = self.axes
        return hemoglobin.count, eumelanin.count, melanin.count

    def nodes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Melanin, eumelanin and hemoglobin of every node, each [N_h, N_e, N_m]."""
        h, e, m = np.meshgrid(*(axis.values for axis in self.axes), indexing="ij")
        return m, e, h

    def interpolate(self, cells: np.ndarray, melanin, eumelanin, hemoglobin) -> np.ndarray:
        """Trilinear interpolation of cells [N_h, N_e, N_m, ...] at broadcast parameter values, clamped to the grid."""
        values = hemoglobin, eumelanin, melanin
        positions = np.broadcast_arrays(*(axis.position(v) for axis, v in zip(self.axes, values, strict=True)))
        corners = []
        for position, count in zip(positions, self.shape, strict=True):
            low = np.minimum(position.astype(int), max(count - 2, 0))
            corners.append(((low, 1 - (position - low)), (np.minimum(low + 1, count - 1), position - low)))
        tail = (...,) + (None,) * (cells.ndim - 3)
        out = np.zeros(positions[0].shape + cells.shape[3:])
        for ih, wh in corners[0]:
            for ie, we in corners[1]:
                for im, wm in corners[2]:
                    out += (wh * we * wm)[tail] * cells[ih, ie, im]
        return out


def default_grid(melanin: int, eumelanin: int, hemoglobin: int) -> Grid:
    """The grid over the whole allowed range with that many nodes, cbrt-spaced in melanin and hemoglobin."""
    return Grid(
        Axis("melanin", "1", *chromophores.MELANIN, melanin, "cbrt"),
        Axis("eumelanin", "1", *chromophores.EUMELANIN, eumelanin, "linear"),
        Axis("hemoglobin", "1", *chromophores.HEMOGLOBIN, hemoglobin, "cbrt"),
    )
