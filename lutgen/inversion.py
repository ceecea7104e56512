"""Painted color to pigment: which melanin and hemoglobin a color LUT would need for each texel of an albedo.

*Balance*: where the albedo's median is no color of skin, one gain per channel puts it onto the nearest one; paint is
seldom white-balanced, and the mean skin tells both exposure and tint. *Solution*: in CIELAB, from the nearest of a
coarse table of skins by damped Gauss-Newton steps; the interpolated LUT's own derivatives are exact within a cell.
*Blotches*: dark skin hardly shows its blood, so noise would become blotches. The albedo's low frequencies are
therefore solved first, and each texel is held to that solution as strongly as the color alone says little. What is
left in the low frequencies is mostly baked light; ratio maps keep only a share of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lutgen import color, maps
from lutgen.errors import InputError, in_range, numbers
from lutgen.lutset import LutSet

BALANCED = 2.0
"""Color difference up to which a median counts as skin already and nothing is balanced."""
LOW_KEPT = (0.2, 0.55)
"""Share of the low frequencies of log melanin and log hemoglobin that ratio maps keep."""
RATIO = (0.1, 8.0)
_HOLD = 2.0
"""Color difference that leaving the low frequencies by a whole axis counts as."""
_STEPS, _DAMPING, _CHUNK, _COARSE = 8, 1e-3, 1 << 16, 16
_UNPAINTED = 1e-3
_CELLS = 32
"""Cells along each side of what is called low frequencies; with fewer, patches of baked light show on dark skin."""


@dataclass(frozen=True)
class Inversion:
    """`melanin` and `hemoglobin` [R, C], the color difference that is left [R, C] (CIE 1976), `painted` [R, C]: what is
    no background. `gain` [3]: what the linear sRGB albedo was multiplied with. `eumelanin`: as given or fitted."""

    melanin: np.ndarray
    hemoglobin: np.ndarray
    residual: np.ndarray
    painted: np.ndarray
    gain: np.ndarray
    eumelanin: float

    @property
    def skin(self) -> tuple[float, float, float]:
        """Median melanin, the eumelanin, median hemoglobin: what a slider must stand at to show the painted tone."""
        melanin, hemoglobin = (float(np.median(v[self.painted])) for v in (self.melanin, self.hemoglobin))
        return melanin, self.eumelanin, hemoglobin


def invert(luts: LutSet, albedo, eumelanin: float | None = None, balance: bool = True) -> Inversion:
    """Melanin and hemoglobin of an albedo [R, C, 3] in linear sRGB; black texels are background.

    Without `eumelanin` that of the LUT's nodes is taken which leaves least. Raises InputError for another shape, NaN,
    negative values, or an albedo that is black throughout.

    >>> import lutgen
    >>> luts = lutgen.load()
    >>> found = invert(luts, luts.color(np.full((4, 4), 0.05), 0.7, 0.02), eumelanin=0.7)
    >>> [round(v, 3) for v in found.skin]
    [0.05, 0.7, 0.02]
    """
    albedo = numbers("albedo", albedo)
    if albedo.ndim != 3 or albedo.shape[-1] != 3 or not albedo.size:
        raise InputError(f"albedo has shape {albedo.shape}: rows, columns and R, G, B are needed")
    if not np.all(np.isfinite(albedo)) or albedo.min() < 0:
        raise InputError("albedo holds NaN, infinite or negative values; mend it")
    painted = albedo.sum(axis=-1) > 3 * _UNPAINTED
    if not painted.any():
        raise InputError("albedo is black throughout: there is no skin to invert")
    axis = luts.color_lut.grid.eumelanin
    if eumelanin is not None:
        ratios_of_pigment = [in_range("eumelanin", eumelanin, axis.low, axis.high)]
    else:
        ratios_of_pigment = list(axis.values)
    some = albedo[painted][:: max(1, int(painted.sum()) // 4096)]
    fits = []
    for e in ratios_of_pigment:
        gain, moved = _balance(luts, some, e) if balance else (np.ones(3), 0.0)
        left = _solved(_slice(luts, e), _lab(some * gain))[1]
        fits.append((moved + float(np.median(left)), float(e), gain))
    _, e, gain = min(fits, key=lambda fit: fit[0])
    table = _slice(luts, e)
    low = _low(albedo * gain, painted)
    held = _solved(table, _lab(low.reshape(-1, 3)))[0].reshape(*low.shape[:2], 2)
    size = painted.shape
    hold = np.stack([maps.resized(held[..., k], *size)[painted] for k in (0, 1)], axis=1)
    at, left = _solved(table, _lab(albedo[painted] * gain), hold)
    middle = np.median(at, axis=0)
    found = [np.full(size, value) for value in (*middle, 0.0)]
    for values, inside in zip(found, (*at.T, left), strict=True):
        values[painted] = inside
    grid = luts.color_lut.grid
    melanin, hemoglobin = (_value(a, v) for a, v in zip((grid.melanin, grid.hemoglobin), found, strict=False))
    return Inversion(melanin, hemoglobin, found[2], painted, gain, e)


def ratios(found: Inversion, low_kept: tuple[float, float] = LOW_KEPT) -> np.ndarray:
    """Ratio maps [R, C, 3] of melanin, eumelanin (1) and hemoglobin as `lutgen.maps.Maps.chromophores` holds them.

    Median 1 each, so that the sliders set the tone; background is 1.
    """
    layers = []
    for values, kept in zip((found.melanin, found.hemoglobin), low_kept, strict=True):
        log = np.log(values)
        low = _low(log[..., None], found.painted)[..., 0]
        log = log - (1 - kept) * maps.resized(low, *log.shape)
        ratio = np.exp(log - np.median(log[found.painted]))
        layers.append(np.where(found.painted, np.clip(ratio, *RATIO), 1.0))
    return np.stack([layers[0], np.ones_like(layers[0]), layers[1]], axis=-1)


def _balance(luts: LutSet, colors: np.ndarray, eumelanin: float) -> tuple[np.ndarray, float]:
    """Gain [3] that puts the median of colors [N, 3] onto a color of skin, and by how much it moves it."""
    middle = np.median(colors, axis=0)
    at, left = _solved(_slice(luts, eumelanin), _lab(middle[None]))
    if left[0] <= BALANCED:
        return np.ones(3), 0.0
    grid = luts.color_lut.grid
    melanin, hemoglobin = (_value(a, v) for a, v in zip((grid.melanin, grid.hemoglobin), at.T, strict=True))
    return luts.color(melanin, eumelanin, hemoglobin)[0] / np.maximum(middle, 1e-4), float(left[0])


def _value(axis, position: np.ndarray) -> np.ndarray:
    """The value at a node position with fraction: the inverse of `Axis.position`."""
    if axis.count == 1:
        return np.full(position.shape, axis.low)
    p, share = axis.exponent, position / (axis.count - 1)
    if p == 0:
        return np.clip(axis.low * (axis.high / axis.low) ** share, axis.low, axis.high)
    return np.clip((axis.low**p + share * (axis.high**p - axis.low**p)) ** (1 / p), axis.low, axis.high)


def _slice(luts: LutSet, eumelanin: float) -> np.ndarray:
    """XYZ [N_h, N_m, 3] relative to white of the LUT's nodes at one eumelanin."""
    grid = luts.color_lut.grid
    xyz = luts.color(grid.melanin.values, eumelanin, grid.hemoglobin.values[:, None], space="srgb")
    return _relative(xyz)


def _relative(linear_srgb: np.ndarray) -> np.ndarray:
    return (linear_srgb @ np.linalg.inv(color.SRGB_FROM_XYZ).T) / (np.ones(3) @ np.linalg.inv(color.SRGB_FROM_XYZ).T)


_LAB_FROM_ROOTS = np.array([[0.0, 116.0, 0.0], [500.0, -500.0, 0.0], [0.0, 200.0, -200.0]])


def _roots(relative: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """CIELAB's compressed XYZ and its derivative."""
    delta = 6 / 29
    root = np.cbrt(np.maximum(relative, 1e-12))
    bright = relative > delta**3
    return (np.where(bright, root, relative / (3 * delta**2) + 4 / 29),
            np.where(bright, 1 / (3 * root * root), 1 / (3 * delta**2)))  # fmt: skip


def _lab(linear_srgb: np.ndarray) -> np.ndarray:
    """L*, a*, b* of linear sRGB [N, 3], L* without its offset of 16, which no difference shows."""
    return _roots(_relative(linear_srgb))[0] @ _LAB_FROM_ROOTS.T


def _solved(table: np.ndarray, wanted: np.ndarray, hold: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Node positions in melanin and hemoglobin [N, 2] whose colors are nearest to `wanted` [N, 3], what is left [N].

    `hold` [N, 2]: positions to stay near where colors say little.
    """
    coarse = np.stack(
        np.meshgrid(*(np.linspace(0, n - 1, _COARSE) for n in table.shape[1::-1]), indexing="ij"), axis=-1
    )
    coarse = coarse.reshape(-1, 2)
    known = _roots(_read(table, coarse)[0])[0] @ _LAB_FROM_ROOTS.T
    known = known.astype("f4")
    squares = (known**2).sum(axis=1)
    at, left = np.empty((len(wanted), 2)), np.empty(len(wanted))
    for first in range(0, len(wanted), _CHUNK):
        part = slice(first, first + _CHUNK)
        seed = coarse[(squares - 2 * (wanted[part].astype("f4") @ known.T)).argmin(axis=1)]
        at[part], left[part] = _refined(table, wanted[part], seed, None if hold is None else hold[part])
    return at, left


def _read(table: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Interpolated values [N, 3] at node positions (melanin, hemoglobin) [N, 2] and their slopes along both."""
    sizes = np.array(table.shape[1::-1])
    low = np.minimum(at.astype(int), np.maximum(sizes - 2, 0))
    high = np.minimum(low + 1, sizes - 1)
    m, h = (at - low).T[..., None]
    (a, b), (c, d) = [[table[j[:, 1], i[:, 0]] for i in (low, high)] for j in (low, high)]
    below, above = a + m * (b - a), c + m * (d - c)
    return below + h * (above - below), (1 - h) * (b - a) + h * (d - c), above - below


def _refined(table, wanted, at, hold) -> tuple[np.ndarray, np.ndarray]:
    """Damped Gauss-Newton steps from seeds, of at most two nodes each, until none moves."""
    most = np.array(table.shape[1::-1]) - 1.0
    pull = (_HOLD / np.maximum(most, 1)) ** 2 if hold is not None else np.zeros(2)
    hold = at if hold is None else hold
    for _ in range(_STEPS):
        relative, *slopes = _read(table, at)
        roots, rate = _roots(relative)
        off = wanted - roots @ _LAB_FROM_ROOTS.T
        jm, jh = ((rate * slope) @ _LAB_FROM_ROOTS.T for slope in slopes)
        toward = np.stack([np.einsum("nc,nc->n", j, off) for j in (jm, jh)], axis=1) + pull * (hold - at)
        stuck = ((at <= 0) & (toward < 0)) | ((at >= most) & (toward > 0))  # at an axis's end only the other one moves
        gm, gh = np.where(stuck, 0.0, toward).T
        mm, mh, hh = (np.einsum("nc,nc->n", *pair) for pair in ((jm, jm), (jm, jh), (jh, jh)))
        mh = np.where(stuck.any(axis=1), 0.0, mh)
        mm, hh = (mm + pull[0]) * (1 + _DAMPING) + 1e-9, (hh + pull[1]) * (1 + _DAMPING) + 1e-9
        step = np.stack([hh * gm - mh * gh, mm * gh - mh * gm], axis=1) / (mm * hh - mh * mh)[:, None]
        new = np.clip(at + np.clip(step, -2, 2), 0, most)
        moved, at = np.abs(new - at).max(), new
        if moved < 1e-3:
            break
    left = wanted - _roots(_read(table, at)[0])[0] @ _LAB_FROM_ROOTS.T
    return at, np.linalg.norm(left, axis=1)


def _low(values: np.ndarray, painted: np.ndarray) -> np.ndarray:
    """Low frequencies [32, 32, channels] of a picture [R, C, channels]: means of what is painted, else of all."""
    rows, columns = (min(n, _CELLS) for n in painted.shape)
    down, across = (np.arange(n) * k // n for n, k in zip(painted.shape, (rows, columns), strict=True))
    cell = (down[:, None] * columns + across)[painted]
    count = np.bincount(cell, minlength=rows * columns)
    inside = values[painted]
    sums = np.stack([np.bincount(cell, v, rows * columns) for v in inside.T], axis=1)
    whole = np.where(count[:, None] > 0, sums / np.maximum(count, 1)[:, None], inside.mean(axis=0))
    return whole.reshape(rows, columns, -1)
