"""Brows and lashes as single hairs, painted on the skin of the built-in head: how much of it they cover."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from lutgen.head import sculpt

BROW_HAIRS, LASHES = 340, 80
BROW_MM = ((7, 16.0), (20, 19.5), (36, 20.6), (50, 13.5))
"""Middle of a brow in x and y."""
_STEPS = 5


def cover(p: np.ndarray) -> np.ndarray:
    """Share of the skin that brows and lashes hide, 0 to 1, at positions [..., 3]; left and right grow differently."""
    hidden = np.zeros(p.shape[:-1], "f4")
    for side in (-1, 1):
        x, y = side * p[..., 0], p[..., 1]
        near = (x > 2) & (x < 58) & (y > -20) & (y < 34) & (p[..., 2] > 35)
        if near.any():
            places = np.stack([x[near], y[near]], axis=-1).astype("f4")
            strands = [_brow(np.random.default_rng(41 + side)), _lashes(np.random.default_rng(51 + side))]
            bare = np.prod([_bare(places, *several) for several in strands], axis=0)
            hidden[near] = 1 - bare * (1 - 0.16 * _shade(places)) * (1 - _margin(places))
    return hidden


def _bare(places: np.ndarray, lines: np.ndarray, radius_mm: np.ndarray, strength: np.ndarray) -> np.ndarray:
    """Skin left free at places [N, 2] by hairs along lines [H, steps, 2] that thin out toward their tips."""
    free = np.ones(len(places), "f4")
    order = np.argsort(places[:, 0])
    sorted_x = places[order, 0]
    for line, radius, strong in zip(lines.astype("f4"), radius_mm, strength, strict=True):
        low, high = line[:, 0].min() - 0.5, line[:, 0].max() + 0.5
        nearby = order[np.searchsorted(sorted_x, low) : np.searchsorted(sorted_x, high)]
        nearby = nearby[np.abs(places[nearby, 1] - line[:, 1].mean()) < 0.6 + np.ptp(line[:, 1])]
        q, least, along = places[nearby], np.full(len(nearby), 9.0, "f4"), np.zeros(len(nearby), "f4")
        for k, (a, b) in enumerate(pairwise(line)):
            t = np.clip((q - a) @ (b - a) / ((b - a) @ (b - a) + 1e-9), 0, 1)
            apart = np.hypot(*(q - a - t[:, None] * (b - a)).T)
            nearer = apart < least
            least, along = np.where(nearer, apart, least), np.where(nearer, k + t, along)
        width = radius * (1 - 0.75 * along / (len(line) - 1))
        free[nearby] *= 1 - strong * np.clip((width + 0.09 - least) / 0.18, 0, 1)  # an edge as soft as a texel
    return free


def _curved(root: np.ndarray, way: np.ndarray, length: np.ndarray, bend: np.ndarray) -> np.ndarray:
    """Lines [H, steps, 2] from roots [H, 2] that start at angles `way` and turn by `bend`, radians, over a length."""
    t = (np.arange(_STEPS) + 0.5) / _STEPS
    angle = way[:, None] + bend[:, None] * t
    step = (length / _STEPS)[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return np.concatenate([root[:, None], root[:, None] + np.cumsum(step, axis=1)], axis=1)


def _brow(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Hairs rise steeply near the nose, lie down along the arch, and meet from above and below."""
    x = 7 + 43 * rng.random(BROW_HAIRS) ** 0.9
    height = np.interp(x, [6, 11, 20, 36, 51], [1.6, 2.9, 2.9, 2.1, 0.6])
    off = np.clip(rng.normal(0, 0.5, BROW_HAIRS), -1.1, 1.1)
    root = np.stack([x, np.interp(x, *np.array(BROW_MM).T) + off * height - 0.8], axis=-1)
    lean = np.interp(x, [7, 13, 24, 36, 50], [80, 52, 26, 6, -26]) - 16 * off + rng.normal(0, 9, BROW_HAIRS)
    length = np.interp(x, [7, 14, 36, 50], [5.0, 7.5, 7.0, 4.5]) * (0.7 + 0.5 * rng.random(BROW_HAIRS))
    bend = -np.radians(np.interp(x, [7, 20, 50], [24, 26, 14]) + rng.normal(0, 8, BROW_HAIRS))
    edge = np.interp(x, [7, 12, 44, 50], [0.45, 1, 1, 0.6])
    return (
        _curved(root, np.radians(lean), length, bend), 0.08 + 0.05 * rng.random(BROW_HAIRS),
        edge * (0.22 + 0.4 * rng.random(BROW_HAIRS)),
    )  # fmt: skip


def _lashes(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lashes of closed lids lie on the skin below, fanned out, longest toward the outer corner, in loose clumps."""
    x = np.sort(19 + 27 * rng.random(LASHES))
    root = np.stack([x, np.interp(x, *np.array(sculpt.SLIT_MM).T[:2]) + 0.2], axis=-1)
    clump = np.interp(x, np.linspace(18, 47, 22), rng.normal(0, 9, 22))
    way = np.radians(np.interp(x, [18, 30, 47], [-112, -88, -42]) + clump + rng.normal(0, 4, LASHES))
    length = np.interp(x, [18, 26, 40, 47], [1.6, 2.9, 4.4, 3.6]) * (0.65 + 0.4 * rng.random(LASHES))
    bend = np.radians(np.interp(x, [18, 30, 47], [-14, 10, 40]))
    return _curved(root, way, length, bend), np.full(LASHES, 0.075), 0.35 + 0.35 * rng.random(LASHES)


def _shade(places: np.ndarray) -> np.ndarray:
    """Hairs too fine to be drawn under the brow's."""
    x, y = places.T
    height = np.interp(x, [6, 12, 20, 36, 51], [1.8, 3.6, 3.6, 2.6, 0.8])
    off = (y - np.interp(x, *np.array(BROW_MM).T) - 0.3) / height
    return np.exp(-(off**2)) * np.interp(x, [5, 11, 42, 52], [0, 1, 1, 0])


def _margin(places: np.ndarray) -> np.ndarray:
    """The row of lash roots along the lid's edge."""
    x, y = places.T
    apart = y - np.interp(x, *np.array(sculpt.SLIT_MM).T[:2])
    return 0.45 * np.exp(-((apart / 0.45) ** 2)) * np.interp(x, [16, 20, 44, 48], [0, 1, 1, 0])
