"""What every export starts from: a LUT set resampled to a cube, points to measure errors at, presets in millimetres."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from lutgen import color
from lutgen.errors import whole
from lutgen.skin.tissue import PRESETS
from lutgen.solvers import burley
from lutgen.tables import expand
from lutgen.tables.axes import Grid
from lutgen.tables.lut_set import LutSet

SIZES = (2, 256)
POINTS = 1000
MEANING = (
    "A value is the share of light along the normal that leaves diffusely, entry transmission included, gloss not:",
    "so multiply irradiance by T(theta)/T(0) with your own Fresnel, never by 1 - F a second time.",
)
"""What a color means, in two lines of every README."""
MADE = "manifest.json says how the set was made and how far it is from an exact solver."


@dataclass(frozen=True)
class Report:
    """What an export says of itself: ten lines for its README, and the error that it adds (plain values)."""

    readme: tuple[str, ...]
    error: dict


@dataclass(frozen=True)
class Preset:
    """A preset that the LUTs cover, in linear Rec. 709 as engines calculate: its skin, its color [3], its profile as
    normalized rings [B, 3] with edges [B + 1] in mm, the share of each channel that was negative and set to 0 [3], and
    the d in mm of the Burley shape closest to it [3] with the EE difference of that fit [3], the index of refraction of
    its surface and the share of light along the normal that enters there, which the color contains."""

    name: str
    skin: tuple[float, float, float]
    linear_srgb: np.ndarray
    rings: np.ndarray
    edges_mm: np.ndarray
    clamped_share: np.ndarray
    burley_d_mm: np.ndarray
    burley_difference: np.ndarray
    refractive_index: float
    entry: float


@dataclass(frozen=True)
class Source:
    """A LUT set, and how many nodes along each axis an export that must be cubic has."""

    luts: LutSet
    size: int

    def __post_init__(self):
        object.__setattr__(self, "size", whole("size", self.size, *SIZES))

    @property
    def refractive_index(self) -> float:
        """Index of refraction of the skin."""
        return self.luts.tissue.refractive_index

    @property
    def entry(self) -> float:
        """Share of light along the normal that enters the skin; every color contains it."""
        return self.luts.paths.entry

    @property
    def grid(self) -> Grid:
        """The set's own grid of colors."""
        return self.luts.color_lut.grid

    @cached_property
    def cubic(self) -> Grid:
        """The same ranges and warps with `size` nodes along each axis that varies."""
        axes = {axis.name: axis for axis in self.grid.axes}
        return Grid(**{n: a if a.count == 1 else replace(a, count=self.size) for n, a in axes.items()})

    def colors(self, space: str) -> np.ndarray:
        """Color at each node of the cube [size, size, size, 3]: hemoglobin, eumelanin, melanin; linear, unclipped."""
        cells = self.luts.color(*self.cubic.nodes(), space=space)
        return np.broadcast_to(cells, (self.size, self.size, self.size, 3))

    def own_colors(self, space: str) -> np.ndarray:
        """Color at each node of the set's own grid [N_h, N_e, N_m, 3]."""
        return color.from_acescg(self.luts.color_lut.acescg, space, self.luts.pipeline)

    @cached_property
    def skins(self) -> np.ndarray:
        """1,000 random skins [1000, 3] (melanin, eumelanin, hemoglobin), even in the axes' warps; fixed seed."""
        t = np.random.default_rng(0).random((POINTS, 3))
        return np.stack([axis.unwarp(t[:, k]) for k, axis in enumerate(self.grid.axes[::-1])], axis=1)

    def coordinates(self, skins: np.ndarray) -> np.ndarray:
        """Warped coordinates in 0 to 1 [N, 3] of skins [N, 3]: what a cube's input R, G, B are."""
        return np.stack([axis.warp(skins[:, k]) for k, axis in enumerate(self.grid.axes[::-1])], axis=1)

    def color_error(self, grid: Grid, cells: np.ndarray, space: str = "srgb") -> dict:
        """What a reader of cells [N_h, N_e, N_m, 3] over a grid gets at the random skins against the set's colors."""
        read = grid.interpolate(cells.astype(float), *self.skins.T)
        return difference(read, self.luts.color(*self.skins.T, space=space))

    @cached_property
    def presets(self) -> list[Preset]:
        """The presets that the LUTs cover."""
        presets = []
        for name, skin in PRESETS.items():
            if all(axis.low <= getattr(skin, axis.name) <= axis.high for axis in self.grid.axes):
                point = skin.melanin, skin.eumelanin, skin.hemoglobin
                profile = self.luts.profile(*point, space="srgb")
                rings, clamped = expand.normalized(profile.energy)
                edges = profile.radius_edges_mm
                fit = burley.fit(rings, edges)
                surface = self.refractive_index, self.entry
                presets.append(Preset(name, point, self.luts.color(*point), rings, edges, clamped, *fit, *surface))
        return presets


def nested_size(luts: LutSet) -> int:
    """Nodes of a cube among which the finest axis' own nodes are: resampling then adds a tenth of what 32 would.

    >>> import lutgen
    >>> nested_size(lutgen.load())
    31
    """
    most = max(luts.color_lut.grid.shape)
    return next((n for n in (2 * most - 1, most) if SIZES[0] <= n <= 64), max(most, SIZES[0]))


def difference(values: np.ndarray, expected: np.ndarray) -> dict:
    """Largest and mean absolute difference of two arrays, as plain values."""
    off = np.abs(np.asarray(values, float) - expected)
    return {"largest": float(off.max()), "mean": float(off.mean())}
