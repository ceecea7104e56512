"""The built-in head: sculpted, unwrapped and painted by the project itself, kept in a cache after the first run."""

from __future__ import annotations

import contextlib
import hashlib
import os
from importlib.resources import files
from pathlib import Path

import numpy as np

from lutgen import sculpt
from lutgen.mesh import Mesh

MAP_SIZE = 1024
SCALE = 1.45
"""Grid spacing: about 28,000 vertices; features narrower than 1.3 cells would turn to beads."""
_FLOOR_MM, _HEIGHT_MM, _AXIS_MM = -205.0, 340.0, -20.0
_RAYS = 40


def builtin() -> Mesh:
    """The head, from the cache where it is there.

    Millimetres, origin between the ears, +z the face, +y up; cylindrical texture coordinates, their seam at the back.
    """
    kept = _cached("head", _make)
    return Mesh(kept["positions"], kept["normals"], kept["uv"], kept["triangles"], {}, (), "built-in")


def paint(shape: Mesh) -> dict[str, np.ndarray]:
    """The built-in head's maps [1024, 1024, channels], first row lowest: `chromophores`, `surface`, `normal`.

    As `lutgen.maps.Maps` holds them. Painted by position on the skin, so that no seam shows.
    """
    kept = _cached("maps", lambda: _paint(shape))
    return {name: kept[name] for name in ("chromophores", "surface", "normal")}


def cache_folder() -> Path:
    """Where made things are kept: LUTGEN_CACHE, else the user's cache folder."""
    given = os.environ.get("LUTGEN_CACHE")
    base = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA") or Path.home() / ".cache"
    return Path(given) if given else Path(base) / "lutgen"


def _cached(name: str, make) -> dict[str, np.ndarray]:
    """Arrays that `make` gives, kept under the hash of the sources; a cache that fails costs only time."""
    text = "".join((files("lutgen") / f"{module}.py").read_text() for module in ("head", "sculpt"))
    path = cache_folder() / f"{name}-{hashlib.sha256(text.encode()).hexdigest()[:16]}.npz"
    with contextlib.suppress(Exception), np.load(path) as kept:  # any damage: make it again
        return {key: kept[key] for key in kept.files}
    made = make()
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        with partial.open("wb") as file:
            np.savez(file, **made)
        partial.replace(path)
    return made


def _make() -> dict[str, np.ndarray]:
    positions, normals, triangles, values, lines = sculpt.build(SCALE)
    open_sky, thickness = _surroundings(positions, normals, values, lines)
    u = 0.5 + np.arctan2(positions[:, 0], positions[:, 2] - _AXIS_MM) / (2 * np.pi)
    around = u[triangles]
    wraps = np.flatnonzero(around.max(axis=1) - around.min(axis=1) > 0.5)
    again = np.unique(triangles[wraps][around[wraps] < 0.5])  # corners right of the seam, doubled on its left
    number = np.arange(len(positions))
    number[again] = len(positions) + np.arange(len(again))
    right = around[wraps] < 0.5
    triangles[wraps] = np.where(right, number[triangles[wraps]], triangles[wraps])
    whole = np.concatenate([np.arange(len(positions)), again])
    u = np.concatenate([u, u[again] + 1])
    margin = 0.03  # u runs a little beyond 0 to 1 at the seam
    u = np.clip((u + margin) / (1 + 2 * margin), 0, 1)  # beyond only around the pole at the crown
    v = (positions[whole, 1] - _FLOOR_MM) / _HEIGHT_MM
    return {
        "positions": positions[whole].astype("f4"), "normals": normals[whole].astype("f4"),
        "uv": np.stack([u, v], axis=1).astype("f4"), "triangles": triangles.astype("i4"),
        "open": open_sky[whole].astype("f4"), "thickness": thickness[whole].astype("f4"),
    }  # fmt: skip


def _surroundings(positions, normals, values, lines) -> tuple[np.ndarray, np.ndarray]:
    """Share of the sky that each vertex sees, cosine-weighted, and the thickness under it in mm."""
    i = np.arange(_RAYS) + 0.5
    turn, height = i * 2.39996323, np.sqrt(1 - i / _RAYS)  # cosine-weighted around +z
    ways = np.stack([np.sqrt(i / _RAYS) * np.cos(turn), np.sqrt(i / _RAYS) * np.sin(turn), height], axis=1)
    n = normals
    t = np.cross(np.where(np.abs(n[:, :1]) < 0.9, [[1.0, 0, 0]], [[0, 1.0, 0]]), n)
    t /= np.linalg.norm(t, axis=1, keepdims=True)
    b = np.cross(n, t)
    seen, thick = np.zeros(len(n)), np.zeros(len(n))
    for way in ways:
        d = way[0] * t + way[1] * b + way[2] * n
        free = np.ones(len(n), bool)
        for s in np.geomspace(1.5, 90, 10):
            free &= _at(values, lines, positions + 0.8 * n + s * d) > 0
        seen += free / _RAYS
    few = ways[:8] * [0.5, 0.5, 1]
    for way in few:
        d = -(way[0] * t + way[1] * b + way[2] * n)
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        depth = np.full(len(n), 32.0)
        for s in np.arange(31.0, 0.6, -1.0):
            depth = np.where(_at(values, lines, positions + s * d) > 0, s, depth)
        thick += depth / len(few)
    return seen, thick


def _at(values: np.ndarray, lines, points: np.ndarray) -> np.ndarray:
    """Sampled distances read linearly at points [N, 3]; outside the grid it is open."""
    place = [np.interp(points[:, k], lines[k], np.arange(len(lines[k]))) for k in range(3)]
    low = [np.minimum(p.astype(int), s - 2) for p, s in zip(place, values.shape, strict=True)]
    along = [p - k for p, k in zip(place, low, strict=True)]
    found = np.zeros(len(points))
    for i, j, k in np.ndindex(2, 2, 2):
        weight = np.prod([a if c else 1 - a for a, c in zip(along, (i, j, k), strict=True)], axis=0)
        found += weight * values[low[0] + i, low[1] + j, low[2] + k]
    return np.where(points[:, 1] > 123, 10.0, found)


def _in_texture(shape: Mesh, values: np.ndarray, size: int) -> np.ndarray:
    """Vertex values [V, C] drawn into texture space [size, size, C]; texels outside are filled from their neighbors."""
    assert shape.uv is not None
    corners = shape.uv[shape.triangles] * size  # [T, 3, 2]
    extent = (corners.max(axis=1) - corners.min(axis=1)).max(axis=1)
    out = np.full((size, size, values.shape[1]), np.nan, "f4")
    for low, high in ((0, 4), (4, 8), (8, 16), (16, 40), (40, 1e9)):
        group = np.flatnonzero((extent >= low) & (extent < high))
        steps = int(2 * min(high, 160)) + 1
        w = np.array([(i, j) for i in range(steps + 1) for j in range(steps + 1 - i)]) / steps
        w = np.concatenate([w, 1 - w.sum(axis=1, keepdims=True)], axis=1)
        for part in np.array_split(group, max(1, len(group) * len(w) // 2_000_000)):
            if not len(part):
                continue
            at = np.clip((w @ corners[part]).astype(int), 0, size - 1).reshape(-1, 2)
            out[at[:, 1], at[:, 0]] = (w @ values[shape.triangles[part]]).reshape(len(at), -1)
    return _filled(out)


def _filled(picture: np.ndarray) -> np.ndarray:
    """Empty texels take the nearest value, row by row outward from what is there, then column by column."""
    for axis in (1, 0):
        rows = picture if axis else picture.transpose(1, 0, 2)
        good = ~np.isnan(rows[..., 0])
        index = np.arange(rows.shape[1])
        before = np.maximum.accumulate(np.where(good, index, -1), axis=1)
        after = np.minimum.accumulate(np.where(good, index, 10**9)[:, ::-1], axis=1)[:, ::-1]
        nearest = np.where((before >= 0) & ((index - before <= after - index) | (after > 10**8)), before, after)
        known = good.any(axis=1)
        rows[known] = rows[np.flatnonzero(known)[:, None], nearest[known]]
    return picture


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


def _paint(shape: Mesh) -> dict[str, np.ndarray]:
    kept = _cached("head", _make)
    drawn = _in_texture(shape, np.concatenate([shape.positions_mm, kept["open"][:, None], kept["thickness"][:, None]],
                                              axis=1).astype("f4"), MAP_SIZE)  # fmt: skip
    p, seen, thick = drawn[..., :3], drawn[..., 3], drawn[..., 4]
    melanin, hemoglobin, lip = _pigments(p)
    plain = np.ones_like(melanin)
    x, y, z = (np.abs(p[..., 0]), p[..., 1], p[..., 2])
    oily = np.exp(-((x / 22) ** 2 + ((y + 5) / 45) ** 2)) * (z > 60)
    roughness = (1 - 0.12 * oily - 0.2 * lip) * (1 + 0.25 * _mottled(p / 4, 2, 51))
    surface = np.stack([roughness, 1 + 0.3 * lip, seen, np.clip(thick / 32, 0, 1)], axis=-1)
    return {
        "chromophores": np.stack([melanin, plain, hemoglobin], axis=-1).astype("f4"),
        "surface": surface.astype("f4"), "normal": _pores(p, lip),
    }  # fmt: skip


FLUSHED = (
    (1.0, (38, -28, 62), 15), (1.1, (0, -36, 108), 10), (0.8, (13, -40, 95), 7), (0.5, (0, -94, 88), 13),
    (0.7, (31, -10, 74), 10), (0.3, (0, 45, 75), 22),
)  # fmt: skip
"""Where more blood runs (share more, place and radius in mm): cheeks, tip and wings of the nose, chin, lids, brow."""


def _pigments(p: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
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


def _pores(p: np.ndarray, lip: np.ndarray) -> np.ndarray:
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
