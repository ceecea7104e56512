"""Light from all around as a picture: read, checked, brought to ACEScg, blurred for rough mirrors.

Equirectangular, first row on top: the middle column lies behind the head (-z), columns to its right toward +x, the
head's left. Values are radiance in linear Rec. 709, as pictures of surroundings come.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lutgen import color
from lutgen.errors import InputError
from lutgen.files import images

SUFFIXES = (".exr", *images.RADIANCE)
MOST = 1e9
"""Radiance of a texel at most; a sun in an unclipped picture is about 1e5 times its sky."""
ROWS = 256
"""Rows of the sharpest level, 512 columns wide."""
LEVELS = 8
"""Levels, each half as high as the one before; the last stands for roughness 1."""
_CONVOLVED, _SOURCE_ROWS = 3, 64


def read(path: Path) -> np.ndarray:
    """Radiance [rows, 2 rows, 3] in linear ACEScg of an equirectangular .exr or .hdr, first row on top.

    Raises InputError for a file that is missing or broken, not twice as wide as high, or holds NaN, infinite, negative
    or absurdly large values.
    """
    path = Path(path)
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"environment = {path}: allowed is studio, none or a file ending in {', '.join(SUFFIXES)}")
    image = images.read(path, "environment", finite=False, radiance=True)
    if image.part is not None and not set("RGB") <= set(image.part.channels):
        channels = ", ".join(image.part.channels)
        raise InputError(f"environment {path}: has channels {channels}; R, G and B are needed")
    radiance = image.values.astype(float)
    rows, columns = radiance.shape[:2]
    if columns != 2 * rows:
        raise InputError(f"environment {path}: is {columns} x {rows}; a picture of all around is twice as wide as high")
    if not np.all(np.isfinite(radiance)):
        raise InputError(f"environment {path}: holds NaN or infinite values; mend it")
    if radiance.min() < 0:
        raise InputError(f"environment {path}: holds negative values, down to {radiance.min():g}; mend it")
    if radiance.max() > MOST:
        most = f"{radiance.max():g}; allowed is 0 to {MOST:g}"
        raise InputError(f"environment {path}: holds a radiance of {most}; scale it down")
    return np.maximum(color.to_acescg(radiance), 0.0)


def directions(rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Unit direction [rows, 2 rows, 3] of each texel and its solid angle [rows, 2 rows]; they sum to 4 pi."""
    down = np.pi * (np.arange(rows) + 0.5) / rows
    around = np.pi * (np.arange(2 * rows) + 0.5) / rows - np.pi
    sine = np.sin(down)[:, None]
    ways = np.stack(
        [sine * np.sin(around), np.repeat(np.cos(down)[:, None], 2 * rows, axis=1), -sine * np.cos(around)], axis=-1
    )
    edges = np.cos(np.pi * np.arange(rows + 1) / rows)
    return ways, np.repeat((edges[:-1] - edges[1:])[:, None] * np.pi / rows, 2 * rows, axis=1)


def mean_radiance(radiance: np.ndarray) -> float:
    """Mean over all directions and channels: what even light of the same irradiance all around would have."""
    _, angle = directions(len(radiance))
    return float((radiance.mean(axis=-1) * angle).sum() / (4 * np.pi))


def blurred(radiance: np.ndarray) -> list[np.ndarray]:
    """The picture in 8 levels [256, 512, 3] ... [2, 4, 3], level k as a mirror of roughness (k / 7)^2 sees it.

    From level 3 on with the GGX lobe of a mirror seen head-on (Karis 2013), weighted by solid angle, so that even
    light stays even; before that each texel is the mean of what it covers.
    """
    levels = [resampled(radiance, ROWS >> k) for k in range(_CONVOLVED)]
    source, angle = directions(_SOURCE_ROWS)
    flat = source.reshape(-1, 3)
    light = resampled(radiance, _SOURCE_ROWS).reshape(-1, 3)
    for k in range(_CONVOLVED, LEVELS):
        ways = directions(ROWS >> k)[0]
        alpha2 = (k / (LEVELS - 1)) ** 8  # alpha is the roughness squared, the roughness (k / 7)^2
        rows = []
        for row in ways:
            cosine = np.clip(row @ flat.T, -1, 1)
            half2 = (1 + cosine) / 2  # squared cosine between the mirror's normal and the half vector
            lobe = np.maximum(cosine, 0) * angle.ravel() / (half2 * (alpha2 - 1) + 1) ** 2
            rows.append(lobe @ light / lobe.sum(axis=1, keepdims=True))
        levels.append(np.stack(rows))
    return levels


def resampled(radiance: np.ndarray, rows: int) -> np.ndarray:
    """Means [rows, 2 rows, 3] of what each texel covers, by solid angle."""
    _, angle = directions(len(radiance))
    down = _shares(len(radiance), rows) * angle[:, 0]
    across = _shares(2 * len(radiance), 2 * rows)
    down /= down.sum(axis=1, keepdims=True)
    across /= across.sum(axis=1, keepdims=True)
    return np.stack([down @ radiance[..., c] @ across.T for c in range(3)], axis=-1)


def _shares(count: int, wanted: int) -> np.ndarray:
    """How much of each of `count` cells [wanted, count] each of `wanted` covers."""
    own, new = np.linspace(0, 1, count + 1), np.linspace(0, 1, wanted + 1)
    overlap = np.minimum(own[1:], new[1:, None]) - np.maximum(own[:-1], new[:-1, None])
    return np.maximum(overlap, 0)
