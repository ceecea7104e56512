"""What skin is like where: pigment, blood, gloss and fine bumps at places on the built-in head's face."""

from __future__ import annotations

import numpy as np

from lutgen import sculpt


def _noise(p: np.ndarray, seed: int) -> np.ndarray:
    """Smooth noise in 0 to 1 at points [..., 3], one cell per unit."""
    table = np.random.default_rng(seed).random(4096).astype("f4")
    cell = np.floor(p).astype(np.int64)
    w = (p - cell).astype("f4")
    w = w * w * (3 - 2 * w)
    found = np.zeros(p.shape[:-1], "f4")
    for corner in np.ndindex(2, 2, 2):
        at = cell + corner
        hashed = (at[..., 0] * 73856093 ^ at[..., 1] * 19349663 ^ at[..., 2] * 83492791) & 4095
        found += table[hashed] * np.prod([w[..., k] if c else 1 - w[..., k] for k, c in enumerate(corner)], axis=0)
    return found


def _mottled(p: np.ndarray, octaves: int, seed: int) -> np.ndarray:
    """Noise of several scales around 0."""
    return np.sum([0.5**k * (_noise(p * 2**k, seed + k) - 0.5) for k in range(octaves)], axis=0)


def _smooth(low: float, high: float, x: np.ndarray) -> np.ndarray:
    t = np.clip((x - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


FLUSHED = (
    (1.0, (38, -28, 62), 15), (1.1, (0, -36, 108), 10), (0.8, (13, -40, 95), 7), (0.5, (0, -94, 88), 13),
    (0.7, (31, -10, 74), 10), (0.3, (0, 45, 75), 22),
)  # fmt: skip
"""Where more blood runs (share more, place and radius in mm): cheeks, tip and wings of the nose, chin, lids, brow."""


def pigments(p: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Ratios of melanin and hemoglobin, and how much of a lip it is, at positions [..., 3]."""
    x, y, z = np.abs(p[..., 0]), p[..., 1], p[..., 2]

    flat = tuple(v.ravel() for v in (x, y, z))
    wobble = 1.4 * _mottled(p / 3, 3, 9)
    red = np.minimum(*sculpt.lips(flat)).reshape(x.shape)
    lip = _smooth(1.6, 0.2, red + 0.6 * wobble) * (z > 60)
    in_ear = _smooth(3, -1, sculpt.ear(flat).reshape(x.shape))
    hemoglobin = 1 + 0.9 * in_ear + sum(gain * _spot(p, at, size) for gain, at, size in FLUSHED)
    hemoglobin *= (1 + 0.5 * _mottled(p / 11, 4, 3) + 0.35 * _mottled(p / 3, 3, 5)) * (1 + 2.6 * lip)
    melanin = 1 + 0.55 * _mottled(p / 16, 4, 21) + 0.3 * _mottled(p / 2.2, 3, 23) + 0.3 * _spot(p, (30, 0, 72), 13)
    melanin += 0.25 * lip - 0.12 * _spot(p, (38, -28, 62), 16)
    melanin *= 1 + 1.1 * _freckles(p) * np.clip(_spot(p, (24, -20, 78), 20) + _spot(p, (0, -15, 95), 14), 0, 1)
    melanin *= 1 + 5.0 * _brows(p, wobble)
    lid = np.interp(x, [17, 23, 31, 39, 46], [-5.6, -8.4, -9.4, -8.0, -4.2])
    lashes = _smooth(15, 19, x) * _smooth(48, 44, x) * (z > 55)
    melanin *= 1 + 3 * np.exp(-(((y - lid) / 0.7) ** 2)) * lashes
    parting = np.interp(x, *np.array(sculpt.MOUTH_MM).T[:2])
    inside = np.exp(-(((y - parting) / 0.9) ** 2)) * _smooth(27, 24, x) * (z > 70)
    return np.clip(melanin * (1 + 0.8 * inside), 0.35, 12), np.clip(hemoglobin * (1 + 1.5 * inside), 0.4, 7), lip


def _spot(p: np.ndarray, center, radius_mm: float) -> np.ndarray:
    """A soft spot around a place and its mirror image."""
    off = np.abs(p[..., 0]) - center[0], p[..., 1] - center[1], p[..., 2] - center[2]
    return np.exp(-sum(v**2 for v in off) / (2 * radius_mm**2))


def _freckles(p: np.ndarray) -> np.ndarray:
    """Dots of two sizes scattered over the skin."""
    found = np.zeros(p.shape[:-1])
    for size, seed in ((2.6, 31), (1.5, 37)):
        cell = np.floor(p / size)
        hashed = (cell.astype(np.int64) @ np.array([73856093, 19349663, 83492791])) & 4095
        drawn = np.random.default_rng(seed).random((4096, 4))[hashed]
        apart = np.linalg.norm(p / size - cell - (0.3 + 0.4 * drawn[..., :3]), axis=-1)
        found += _smooth(0.3, 0.12, apart) * (drawn[..., 3] > 0.72)
    return found


def _brows(p: np.ndarray, wobble: np.ndarray) -> np.ndarray:
    """Short strokes along the brows, 0 to 1."""
    x, y, z = np.abs(p[..., 0]), p[..., 1], p[..., 2]
    center = np.interp(x, [7, 20, 36, 50], [15.5, 19.5, 21, 13])
    width = np.interp(x, [6, 12, 36, 51], [2.2, 3.6, 2.8, 0.8])
    within = _smooth(1.5, 0.3, np.abs(y - center + 0.8 * wobble) / width) * _smooth(6, 10, x) * _smooth(52, 46, x)
    lean = np.radians(np.interp(x, [7, 18, 36, 50], [80, 48, 20, -12]))
    along, across = x * np.cos(lean) + y * np.sin(lean), -x * np.sin(lean) + y * np.cos(lean)
    side = 7 * np.sign(p[..., 0])
    strokes = [
        _noise(np.stack([along / a, across / b, side], axis=-1), s) for a, b, s in ((4.5, 0.8, 41), (3, 0.6, 43))
    ]
    return within * (z > 35) * (0.12 + 0.88 * np.maximum(*(_smooth(0.5, 0.8, s) for s in strokes)))


def gloss(p: np.ndarray, lip: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ratios of roughness and specular at positions [..., 3]."""
    x, y, z = np.abs(p[..., 0]), p[..., 1], p[..., 2]
    oily = np.exp(-((x / 22) ** 2 + ((y + 5) / 45) ** 2)) * (z > 60)
    return (1 - 0.12 * oily - 0.2 * lip) * (1 + 0.25 * _mottled(p / 4, 2, 51)), 1 + 0.3 * lip


def bumps(p: np.ndarray, lip: np.ndarray) -> np.ndarray:
    """Tangent normals, 8 bit, of pores, fine creases and the lips' furrows, as bumps of the texture's own texels."""
    height = 0.10 * np.minimum(_noise(p / 0.85, 61), 0.45) + 0.05 * _noise(p / 0.5, 63)
    height += 0.10 * _mottled(p / [0.7, 2.2, 0.7], 2, 67) + 0.08 * _mottled(p / 3, 2, 71)
    furrows = _noise(np.stack([p[..., 0] / 0.9, p[..., 1] / 6, p[..., 2] / 6], axis=-1), 73)
    height = height * (1 - lip) + 0.35 * lip * furrows
    texel = [np.linalg.norm(np.gradient(p, axis=k), axis=-1) for k in (1, 0)]
    slope = [np.gradient(height, axis=k) / np.clip(t, 0.15, 2.0) for k, t in zip((1, 0), texel, strict=True)]
    n = np.stack([-slope[0], -slope[1], np.ones_like(height)], axis=-1)
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    return np.round(255 * (0.5 * n + 0.5)).astype("u1")
