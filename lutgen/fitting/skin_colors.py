"""The colors of skin at one eumelanin ratio as a surface over melanin and hemoglobin, and its point nearest a color.

*Computation*: the color LUT at that eumelanin is bilinear within a cell, in XYZ relative to white. *Metric*: CIELAB
whose lightness, chroma and hue are divided as CIEDE2000 does halfway to the wanted color, so that what is nearest is
nearest to the eye. *Lookup*: a coarse table over CIELAB says where to start, then damped Gauss-Newton steps; the
derivatives are exact within a cell. Single precision, channels first, chunks on every core: NumPy lets go of its lock.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lutgen import color
from lutgen.tables.axes import Axis
from lutgen.tables.lut_set import LutSet

CHUNK = 1 << 15
_RELATIVE = (color.XYZ_FROM_SRGB / (color.XYZ_FROM_SRGB @ np.ones(3))[:, None]).astype("f4")
_DELTA = 6 / 29
_STARTS, _ACROSS, _MARGIN = 16, 24, 12.0
"""Nodes along each axis of the starting points; cells along each side of their table; CIELAB units beyond the skins."""
_HOLD = 1.5
"""Color difference that leaving what a texel is held to by a whole axis counts as."""
_REACH = (2.0, 2.0, 2.0, 1.0, 0.5, 0.2, 0.1, 0.05, 0.02)
"""Most nodes that each step may go: where cells meet in a crease, steps would jump across it forever."""
NEAR = (1.0, 0.3, 0.1)
"""The same from positions that are almost right."""
_DAMPING, _STILL = np.float32(1e-3), 2e-3


def relative(linear_srgb: np.ndarray) -> np.ndarray:
    """XYZ [3, N] over that of white, of linear sRGB [N, 3]."""
    r, g, b = np.asarray(linear_srgb, "f4").T
    return np.stack([k[0] * r + k[1] * g + k[2] * b for k in _RELATIVE])


def roots(xyz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """CIELAB's compressed XYZ [3, N] and its derivative."""
    root = np.cbrt(np.maximum(xyz, np.float32(1e-12)))
    bright = xyz > _DELTA**3
    return (np.where(bright, root, xyz * np.float32(1 / (3 * _DELTA**2)) + np.float32(4 / 29)),
            np.where(bright, np.float32(1 / 3) / (root * root), np.float32(1 / (3 * _DELTA**2))))  # fmt: skip


def opponent(root: np.ndarray) -> np.ndarray:
    """L* + 16, a*, b* [3, N] of compressed XYZ: no difference shows the 16."""
    x, y, z = root
    return np.stack([np.float32(116) * y, np.float32(500) * (x - y), np.float32(200) * (y - z)])


def coded(linear_srgb: np.ndarray) -> np.ndarray:
    """L* + 16, a*, b* [3, N] of linear sRGB [N, 3]."""
    return opponent(roots(relative(linear_srgb))[0])


def metric(wanted: np.ndarray) -> np.ndarray:
    """What turns a small CIELAB difference at each color [3, N] into one of lightness, chroma and hue, [5, N].

    Lightness counts [0]; chroma [1] a + [2] b; hue [3] b - [4] a (CIEDE2000's weights, its rotation left out, which
    only blue colors have).
    """
    lightness, a, b = wanted[0] - np.float32(66), wanted[1], wanted[2]
    seventh = np.hypot(a, b) ** 7
    stretch = np.float32(1.5) - np.float32(0.5) * np.sqrt(seventh / (seventh + np.float32(25.0**7)))
    a = a * stretch
    chroma = np.maximum(np.hypot(a, b), np.float32(1e-3))
    hue = np.arctan2(b, a)
    weight = np.float32(1)
    for share, times, turn in ((-0.17, 1, -30), (0.24, 2, 0), (0.32, 3, 6), (-0.2, 4, -63)):
        weight = weight + np.float32(share) * np.cos(np.float32(times) * hue + np.float32(np.radians(turn)))
    s_l = 1 + np.float32(0.015) * lightness**2 / np.sqrt(20 + lightness**2)
    by_chroma = 1 / (chroma * (1 + np.float32(0.045) * chroma))
    by_hue = 1 / (chroma * (1 + np.float32(0.015) * chroma * weight))
    return np.stack([1 / s_l, by_chroma * a * stretch, by_chroma * b, by_hue * a, by_hue * b * stretch])


def seen(weights: np.ndarray, difference: np.ndarray) -> np.ndarray:
    """Differences of lightness, chroma and hue [3, N] of CIELAB differences [3, N] under `metric`."""
    lightness, a, b = difference
    return np.stack([weights[0] * lightness, weights[1] * a + weights[2] * b, weights[3] * b - weights[4] * a])


def in_chunks(function: Callable[[slice], None], count: int) -> None:
    """Call a function with slices of `count`, on as many threads as there are cores."""
    parts = [slice(first, min(first + CHUNK, count)) for first in range(0, count, CHUNK)]
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if cores == 1 or len(parts) < 2:
        for part in parts:
            function(part)
        return
    with ThreadPoolExecutor(cores) as threads:
        for _ in threads.map(function, parts):
            pass


@dataclass(frozen=True)
class Surface:
    """Colors of skin at one eumelanin over node positions in melanin and hemoglobin.

    `cells` [cells, 12]: XYZ of the corner, its change along melanin, along hemoglobin, along both; melanin fastest.
    """

    eumelanin: float
    melanin: Axis
    hemoglobin: Axis
    cells: np.ndarray

    @property
    def most(self) -> tuple[float, float]:
        """Last node of either axis."""
        return self.melanin.count - 1.0, self.hemoglobin.count - 1.0

    def read(self, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """XYZ over white [3, N] at positions [2, N], and its slopes along melanin and along hemoglobin."""
        across, down = (max(int(n), 1) for n in self.most)
        i, j = (np.minimum(p.astype("i4"), n - 1) for p, n in zip(nodes, (across, down), strict=True))
        corner, m_slope, h_slope, twist = self.cells[j * across + i].T.reshape(4, 3, -1)
        m, h = nodes[0] - i, nodes[1] - j
        along_m = m_slope + h * twist
        return corner + m * along_m + h * h_slope, along_m, h_slope + m * twist

    def coded(self, nodes: np.ndarray) -> np.ndarray:
        """L* + 16, a*, b* [3, N] at positions [2, N]."""
        return opponent(roots(self.read(nodes)[0])[0])

    def values(self, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Melanin and hemoglobin at positions [2, ...]."""
        return self.melanin.value(nodes[0]), self.hemoglobin.value(nodes[1])

    @cached_property
    def _starts(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Lowest corner [3] and cells per unit [3] of a table over CIELAB, and each cell's nearest skin [2, ..]."""
        grid = np.meshgrid(*(np.linspace(0, n, _STARTS, dtype="f4") for n in self.most), indexing="ij")
        nodes = np.stack([g.ravel() for g in grid])
        known = self.coded(nodes)
        low, high = known.min(axis=1) - np.float32(_MARGIN), known.max(axis=1) + np.float32(_MARGIN)
        cell = (np.indices((_ACROSS,) * 3, "f4").reshape(3, -1) + np.float32(0.5)) / np.float32(_ACROSS)
        centers = low[:, None] + cell * (high - low)[:, None]
        nearest = ((known**2).sum(axis=0) - 2 * centers.T @ known).argmin(axis=1)
        return low, _ACROSS / (high - low), nodes[:, nearest]

    def start(self, wanted: np.ndarray) -> np.ndarray:
        """Positions [2, N] to start from toward colors [3, N]."""
        low, scale, nodes = self._starts
        cell = np.zeros(wanted.shape[1], "i4")
        for values, first, per_unit in zip(wanted, low, scale, strict=True):
            cell = cell * _ACROSS + np.clip((values - first) * per_unit, 0, _ACROSS - 1).astype("i4")
        return nodes[:, cell]


def of(luts: LutSet, eumelanin: float) -> Surface:
    """The surface of a LUT set at one eumelanin."""
    grid = luts.color_lut.grid
    srgb = luts.color(grid.melanin.values, eumelanin, grid.hemoglobin.values[:, None])
    xyz = relative(srgb.reshape(-1, 3)).T.reshape(*srgb.shape)
    for axis in (0, 1):  # a fixed parameter is a cell without slope
        xyz = np.repeat(xyz, 2, axis=axis) if xyz.shape[axis] == 1 else xyz
    a, b, c, d = xyz[:-1, :-1], xyz[:-1, 1:], xyz[1:, :-1], xyz[1:, 1:]
    cells = np.concatenate([a, b - a, c - a, d - b - c + a], axis=-1).reshape(-1, 12)
    return Surface(float(eumelanin), grid.melanin, grid.hemoglobin, np.ascontiguousarray(cells, "f4"))


def nearest(surface: Surface, wanted: np.ndarray, hold: np.ndarray | None = None) -> np.ndarray:
    """Node positions in melanin and hemoglobin [2, N] whose colors are nearest to `wanted` [3, N].

    `hold` [2, N]: positions to stay near where colors say little.
    """
    nodes = np.empty((2, wanted.shape[1]), "f4")

    def _solve(part: slice) -> None:
        nodes[:, part] = refined(
            surface, wanted[:, part], surface.start(wanted[:, part]), None if hold is None else hold[:, part]
        )

    in_chunks(_solve, wanted.shape[1])
    return nodes


def refined(
    surface: Surface, wanted: np.ndarray, nodes: np.ndarray, hold: np.ndarray | None = None, reach=_REACH
) -> np.ndarray:
    """Damped Gauss-Newton steps from positions [2, N] until none moves; what has settled is left alone."""
    weights = metric((wanted + surface.coded(nodes)) / 2)
    pull = [np.float32((_HOLD / max(n, 1)) ** 2 if hold is not None else 0) for n in surface.most]
    hold = nodes if hold is None else hold
    out, moving = nodes, None
    for most in reach:
        new = _step(surface, wanted, weights, nodes, hold, pull, np.float32(most))
        far = np.abs(new - nodes).max(axis=0) > _STILL
        if moving is None:
            out = new
        else:
            out[:, moving] = new
        nodes = new
        if not far.any():
            break
        if far.mean() < 0.7:
            moving = np.flatnonzero(far) if moving is None else moving[far]
            wanted, weights, nodes, hold = (v[:, far] for v in (wanted, weights, nodes, hold))
    return out


def _step(surface, wanted, weights, nodes, hold, pull, reach) -> np.ndarray:
    xyz, *slopes = surface.read(nodes)
    root, rate = roots(xyz)
    off = seen(weights, wanted - opponent(root))
    jm, jh = (seen(weights, opponent(rate * slope)) for slope in slopes)
    toward = [_dot(j, off) + p * (to - now) for j, p, to, now in zip((jm, jh), pull, hold, nodes, strict=True)]
    stuck = [((p <= 0) & (t < 0)) | ((p >= n) & (t > 0)) for p, t, n in zip(nodes, toward, surface.most, strict=True)]
    gm, gh = (np.where(s, np.float32(0), t) for s, t in zip(stuck, toward, strict=True))
    mh = np.where(stuck[0] | stuck[1], np.float32(0), _dot(jm, jh))  # at an axis's end only the other one moves
    mm, hh = ((_dot(j, j) + p) * (1 + _DAMPING) + np.float32(1e-9) for j, p in zip((jm, jh), pull, strict=True))
    scale = 1 / (mm * hh - mh * mh)
    steps = (hh * gm - mh * gh) * scale, (mm * gh - mh * gm) * scale
    return np.stack(
        [np.clip(p + np.clip(s, -reach, reach), 0, n) for p, s, n in zip(nodes, steps, surface.most, strict=True)]
    )


def _dot(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
