"""Relief of the skin too fine for a head's maps: a small tile of pores, lines and bumps that repeats without a seam.

It is laid on any mesh from three sides, in millimetres, so it needs no texture coordinates. Sizes follow what is
published of adult faces: pores 0.2 to 0.5 mm wide about 1 mm apart (Flament et al. 2015), lines 0.3 to 0.8 mm apart
and tens of um deep (Hashimoto 1974).
"""

from __future__ import annotations

from functools import cache

import numpy as np

SIDE_MM, TEXELS = 24.0, 512
PORE_APART_MM, PORE_RADIUS_MM, PORE_DEPTH_MM = 1.15, (0.11, 0.24), (0.03, 0.09)
LINES_MM = ((1.6, 0.22, 0.020), (0.75, 0.14, 0.011))
"""Nets of fine lines: distance between them, width and depth."""
BUMPS_MM = ((3.2, 0.016), (1.5, 0.011), (0.6, 0.004))
"""Soft bumps: wavelength and root mean square height."""


def height_mm(seed: int = 5) -> tuple[np.ndarray, np.ndarray]:
    """Height in mm [512, 512] of a tile of 24 mm, mean 0, and of its pores alone (0 and below)."""
    rng = np.random.default_rng(seed)
    pores = _pores(rng)
    fine = sum(_bumps(rng, *bump) for bump in BUMPS_MM) + sum(_lines(rng, *net) for net in LINES_MM)
    whole = fine + pores
    return whole - whole.mean(), pores


@cache
def texture() -> np.ndarray:
    """What a shader reads of the tile [512, 512, 4]: slopes along x and y, their squares' sum, openness of a pore.

    Averaged over an area, the first two give its mean slope and with the third the variance that became invisible
    (Olano & Baker 2010), which a shader adds to the roughness.
    """
    height, pores = height_mm()
    step = 2 * SIDE_MM / TEXELS
    x, y = ((np.roll(height, -1, axis) - np.roll(height, 1, axis)) / step for axis in (1, 0))
    return np.stack([x, y, x * x + y * y, 1 + np.maximum(pores / PORE_DEPTH_MM[1], -1)], axis=-1).astype("f4")


def _scattered(rng: np.random.Generator, apart_mm: float) -> np.ndarray:
    """Places in mm [n, n, 2], one in each cell of an even grid over the tile."""
    n = round(SIDE_MM / apart_mm)
    grid = np.stack(np.meshgrid(np.arange(n), np.arange(n), indexing="ij"), axis=-1)
    return (grid + 0.5 + 0.8 * (rng.random((n, n, 2)) - 0.5)) * SIDE_MM / n


def _pores(rng: np.random.Generator) -> np.ndarray:
    """Round dents, each a little longer one way, the wide ones the deep ones."""
    places = _scattered(rng, PORE_APART_MM).reshape(-1, 2)
    size = rng.random(len(places)) ** 1.5
    radius, depth = (low + (high - low) * size for low, high in (PORE_RADIUS_MM, PORE_DEPTH_MM))
    turn, long = rng.random(len(places)) * np.pi, 1 + 0.5 * rng.random(len(places))
    texel = SIDE_MM / TEXELS
    near = np.stack(np.meshgrid(*2 * [np.arange(-16, 17)], indexing="ij"), axis=-1)
    index = np.floor(places / texel).astype(int)[:, None, None] + near
    x, y = np.moveaxis((index + 0.5) * texel - places[:, None, None], -1, 0)
    c, s = (f(turn)[:, None, None] for f in (np.cos, np.sin))
    along, across = (c * x + s * y) / long[:, None, None], c * y - s * x
    dent = -depth[:, None, None] * np.exp(-(((along**2 + across**2) / radius[:, None, None] ** 2) ** 1.5))
    out = np.zeros((TEXELS, TEXELS))
    np.minimum.at(out, tuple(np.moveaxis(index % TEXELS, -1, 0)), dent)
    return out


def _lines(rng: np.random.Generator, apart_mm: float, width_mm: float, depth_mm: float) -> np.ndarray:
    """Grooves between the cells of a net: the two nearest places are as far there (Worley 1996); bent a little."""
    places = _scattered(rng, apart_mm)
    n = len(places)
    line = (np.arange(TEXELS) + 0.5) * SIDE_MM / TEXELS
    bent = np.stack(np.meshgrid(line, line, indexing="ij"), -1) + np.stack([_bumps(rng, 1.2, 0.09) for _ in "xy"], -1)
    cell = np.floor(line / SIDE_MM * n).astype(int)
    distances = []
    for i, j in np.ndindex(5, 5):
        row, column = cell + i - 2, cell + j - 2
        around = places[row[:, None] % n, column[None] % n]
        shift = SIDE_MM * np.stack(np.broadcast_arrays((row // n)[:, None], (column // n)[None]), axis=-1)
        distances.append(np.hypot(*np.moveaxis(around + shift - bent, -1, 0)))
    first, second = np.partition(np.array(distances), 1, axis=0)[:2]
    grooves = -depth_mm * np.exp(-(((second - first) / width_mm) ** 2))
    return np.roll(grooves, rng.integers(0, TEXELS, 2), axis=(0, 1))  # else the nets' cells would end at one line


def _bumps(rng: np.random.Generator, wavelength_mm: float, rms_mm: float) -> np.ndarray:
    """Smooth noise around one wavelength."""
    turns = np.hypot(np.fft.fftfreq(TEXELS)[:, None], np.fft.rfftfreq(TEXELS)) * TEXELS / SIDE_MM * wavelength_mm
    band = np.where(turns > 0, np.exp(-((np.log(np.maximum(turns, 1e-9)) / 0.45) ** 2)), 0)
    noise = np.fft.irfft2(np.fft.rfft2(rng.standard_normal((TEXELS, TEXELS))) * band, (TEXELS, TEXELS))
    return noise * rms_mm / noise.std()
