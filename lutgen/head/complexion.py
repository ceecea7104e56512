"""What skin is like where: pigment, blood, gloss and fine bumps at places on the built-in head's face."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lutgen.head import hair, sculpt


def _noise(p: np.ndarray, seed: int) -> np.ndarray:
    """Smooth noise in 0 to 1 at points [..., 3], one cell per unit."""
    table = np.random.default_rng(seed).random(4096).astype("f4")
    flat = np.asarray(p, "f4").reshape(-1, 3)
    noise = np.empty(len(flat), "f4")
    for start in range(0, len(flat), 1 << 16):  # parts that stay in the processor's cache
        part = flat[start : start + (1 << 16)]
        cell = np.floor(part)
        x, y, z = (part - cell).T
        x, y, z = (w * w * (3 - 2 * w) for w in (x, y, z))
        keys = (cell.astype(np.int64) + np.arange(2)[:, None, None]) * [73856093, 19349663, 83492791]
        near = [[keys[i, :, 0] ^ keys[j, :, 1] for j in (0, 1)] for i in (0, 1)]
        corners = [[[table[(near[i][j] ^ keys[k, :, 2]) & 4095] for k in (0, 1)] for j in (0, 1)] for i in (0, 1)]
        rows = [[a + (b - a) * z for a, b in pair] for pair in corners]
        low, high = (a + (b - a) * y for a, b in rows)
        noise[start : start + (1 << 16)] = low + (high - low) * x
    return noise.reshape(p.shape[:-1])


def _mottled(p: np.ndarray, octaves: int, seed: int) -> np.ndarray:
    """Noise of several scales around 0."""
    total = np.zeros(p.shape[:-1], "f4")
    for k in range(octaves):
        total += 0.5**k * (_noise(p * 2**k, seed + k) - 0.5)
    return total


def _smooth(low: float, high: float, x: np.ndarray) -> np.ndarray:
    t = np.clip((x - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def _within(p: np.ndarray, low, high, far: float, distance: Callable) -> np.ndarray:
    """A distance function of x, y, z at positions in a box (of |x|, y, z); `far` elsewhere, where it is not asked."""
    q = np.stack([np.abs(p[..., 0]), p[..., 1], p[..., 2]], axis=-1)
    inside = np.all((q > low) & (q < high), axis=-1)
    distances = np.full(p.shape[:-1], far, "f4")
    if inside.any():
        distances[inside] = distance(tuple(q[inside].astype("f4").T))
    return distances


FLUSHED = (
    (1.5, (42, -30, 60), 14), (1.3, (0, -37, 106), 10), (1.1, (13, -41, 94), 6), (0.6, (0, -92, 88), 13),
    (0.8, (31, -12, 74), 8), (-0.12, (0, 50, 78), 24), (0.7, (18, -4, 76), 5), (0.5, (26, -52, 82), 9),
)  # fmt: skip
"""Where more blood runs (share more, place and radius in mm): cheeks, tip and wings of the nose, chin, lids, brow."""
MOLES = ((0.8, (34, -57, 78)), (0.8, (-22, -28, 88)), (0.7, (-46, 2, 58)), (0.6, (12, 42, 84)), (0.9, (-47, -62, 42)))
"""Radius and place in mm."""


def pigments(p: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Ratios of melanin and hemoglobin, and how much of a lip it is, at positions [..., 3]."""
    x, y, z = np.abs(p[..., 0]), p[..., 1], p[..., 2]
    wobble = _mottled(p / 3.5, 3, 9)
    red = _within(p, (0, -80, 60), (34, -52, 110), 9.0, lambda q: np.minimum(*sculpt.lips(q)))
    lip = _smooth(2.0, 0.7, red + 1.0 * wobble) * (z > 60)
    in_ear = _smooth(3, -1, _within(p, (55, -45, -50), (110, 40, 10), 9.0, sculpt.ear))
    eye = _spot(p, (31, -4, 74), 12)

    hemoglobin = 1 + 0.8 * in_ear + sum(gain * _spot(p, center, size) for gain, center, size in FLUSHED)
    hemoglobin *= 1 + 0.45 * _mottled(p / 12, 3, 3) + 0.45 * _mottled(p / 3.4, 3, 5) + 0.2 * _mottled(p / 0.9, 2, 6)
    hemoglobin *= 1 + 3.4 * lip * (1 + 0.5 * _mottled(p / 1.6, 2, 7))
    melanin = 1 + 0.4 * _mottled(p / 18, 3, 21) + 0.3 * _mottled(p / 2.6, 3, 23) + 0.25 * eye
    melanin -= 0.1 * lip + 0.12 * _spot(p, (38, -28, 62), 16)
    where = np.clip(_spot(p, (26, -20, 76), 18) + _spot(p, (0, -14, 95), 13) + 0.3 * _spot(p, (0, 40, 80), 30), 0, 1)
    melanin *= 1 + 0.9 * _freckles(p, where + 0.04)
    for radius, center in MOLES:
        melanin *= 1 + 2.2 * _smooth(
            1.25, 0.6, np.linalg.norm((p - center) * [1, 1, 0.6], axis=-1) / radius + 0.5 * wobble
        )

    hairs = hair.cover(p)
    melanin *= 1 + 17 * hairs**1.35  # color falls steeply with the first melanin: half a hair is no orange one
    hemoglobin *= 1 + 0.4 * hairs
    parting = np.interp(x, *np.array(sculpt.MOUTH_MM).T[:2])
    inside = np.exp(-(((y - parting) / 0.8) ** 2)) * _smooth(27, 23, x) * (z > 70)
    melanin, hemoglobin = melanin * (1 + 0.5 * inside), hemoglobin * (1 + 1.2 * inside)
    nostril = _smooth(1.15, 0.75, np.linalg.norm((np.stack([x, y, z], -1) - (6.4, -40.5, 94.5)) / (4, 6.5, 7), axis=-1))
    melanin *= 1 + 9 * nostril * (y < -38)  # hairs and depth: no light comes back out
    return np.clip(melanin, 0.35, 20), np.clip(hemoglobin, 0.4, 7), lip


def _spot(p: np.ndarray, center, radius_mm: float) -> np.ndarray:
    """A soft spot around a place and its mirror image."""
    off = np.abs(p[..., 0]) - center[0], p[..., 1] - center[1], p[..., 2] - center[2]
    return np.exp(-sum(v**2 for v in off) / (2 * radius_mm**2))


def _freckles(p: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Round soft dots of several sizes and strengths, in a share of the places where one may be."""
    darkness = np.zeros(p.shape[:-1], "f4")
    for size, seed in ((3.6, 31), (2.1, 37), (1.4, 39)):
        cell = np.floor(p / size)
        hashed = (cell.astype(np.int64) @ np.array([73856093, 19349663, 83492791])) & 4095
        place, chance, strength = np.split(np.random.default_rng(seed).random((4096, 5))[hashed], [3, 4], axis=-1)
        apart = np.linalg.norm(p / size - cell - (0.32 + 0.36 * place), axis=-1)
        radius = 0.14 + 0.18 * strength[..., 0]
        darkness += _smooth(1, 0.2, apart / radius) * (0.25 + 0.75 * strength[..., 0]) * (chance[..., 0] < 0.55 * share)
    return darkness


def gloss(p: np.ndarray, lip: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ratios of roughness and specular at positions [..., 3]."""
    oily = np.clip(_spot(p, (0, 30, 82), 26) + _spot(p, (0, -28, 98), 15) + 0.6 * _spot(p, (0, -92, 90), 12), 0, 1)
    dry = np.clip(_spot(p, (44, -34, 55), 20) + _spot(p, (31, -1, 75), 9) + 0.5 * _smooth(60, 20, p[..., 2]), 0, 1)
    patchy = 1 + 0.2 * _mottled(p / 6, 3, 51) + 0.16 * _mottled(p / 1.3, 2, 53)
    share = (1 + 0.15 * oily - 0.28 * dry - 0.1 * lip) * (1 + 0.2 * _mottled(p / 2.2, 3, 57))
    return (1 - 0.10 * oily + 0.12 * dry - 0.04 * lip) * patchy, share


def porous(p: np.ndarray, lip: np.ndarray) -> np.ndarray:
    """Depth of the pores' tile at positions [..., 3], 0 to 1: deepest on nose and cheeks, least on lids and lips."""
    much = (
        0.58 + 0.42 * _spot(p, (0, -34, 100), 15) + 0.35 * _spot(p, (22, -32, 80), 15) + 0.2 * _spot(p, (0, 30, 80), 30)
    )
    much += 0.25 * _spot(p, (0, -94, 88), 14) + 0.25 * _mottled(p / 9, 2, 77)
    much *= 0.55 + 0.45 * _smooth(20, 60, p[..., 2]) * _smooth(110, 60, p[..., 1])  # back and crown are smoother
    return np.clip(much * (1 - 0.6 * _spot(p, (31, -3, 74), 11)) * (1 - 0.75 * lip), 0, 1)


def bumps(p: np.ndarray, lip: np.ndarray, skin_mm: np.ndarray) -> np.ndarray:
    """Tangent normals and the pores' depth, 8 bit [rows, columns, 4], of bumps in the texture's own texels.

    Creases, the lips' furrows and unevenness of a millimetre and more: what is finer is the pores' tile. `skin_mm`
    [..., 3] is where the texels lie on the head itself, `p` on the built-in head.
    """
    height = 0.10 * _mottled(p / 5, 2, 71) + 0.035 * _mottled(p / 1.6, 2, 73) + _wrinkles(p)
    bent = p + 1.2 * np.stack([_mottled(p / 4, 2, seed) for seed in (81, 82, 83)], axis=-1)
    furrows = np.abs(_noise(bent * [1 / 1.5, 1 / 9, 1 / 9], 85) - 0.5) + 0.5 * np.abs(
        _noise(bent * [1.3, 0.2, 0.2], 86) - 0.5
    )
    height = height * (1 - lip) + lip * (0.42 * np.minimum(furrows, 0.3) + 0.06 * _mottled(p / 1.2, 2, 87))
    texel = [np.linalg.norm(np.gradient(skin_mm, axis=k), axis=-1) for k in (1, 0)]
    slope = [np.gradient(height, axis=k) / np.clip(t, 0.1, 2.0) for k, t in zip((1, 0), texel, strict=True)]
    n = np.stack([-slope[0], -slope[1], np.ones_like(height)], axis=-1)
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    return np.round(255 * np.concatenate([0.5 * n + 0.5, porous(p, lip)[..., None]], axis=-1)).astype("u1")


def _wrinkles(p: np.ndarray) -> np.ndarray:
    """Fine lines, mm: across the forehead, around the eyes' corners, below the lids."""
    x, y = np.abs(p[..., 0]), p[..., 1]
    bend = 2.5 * _mottled(p / 14, 2, 91)
    forehead = np.exp(-np.abs(np.sin((y + bend + 0.002 * x * x) * np.pi / 11)) / 0.10)
    height = -0.05 * forehead * _spot(p, (0, 46, 80), 22) * (0.5 + _mottled(p / 12, 2, 93))
    angle = np.degrees(np.arctan2(y + 4, np.maximum(x - 42, 0.1)))
    rays = np.exp(-np.abs(np.sin((angle + 6 * bend) * np.pi / 17)) / 0.16)
    height -= 0.06 * rays * np.exp(-(((np.hypot(x - 42, y + 4) - 12) / 5) ** 2)) * (x > 43) * (p[..., 2] > 20)
    below = np.exp(-np.abs(np.sin((y + 0.012 * (x - 31) ** 2 + 0.35 * bend) * np.pi / 2.1)) / 0.25)
    height -= 0.035 * below * _spot(p, (31, -15, 76), 6.5)
    lid = np.exp(-np.abs(np.sin((y + 0.02 * (x - 31) ** 2 + 0.3 * bend) * np.pi / 1.6)) / 0.3)
    return height - 0.02 * lid * _spot(p, (31, 1, 76), 6)
