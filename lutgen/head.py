"""The built-in head: sculpted and unwrapped by the project itself, kept in a cache after the first run."""

from __future__ import annotations

import contextlib
import hashlib
import os
from importlib.resources import files
from pathlib import Path

import numpy as np

from lutgen import sculpt
from lutgen.mesh import Mesh

SCALE = 1.45
"""Grid spacing: about 28,000 vertices; features narrower than 1.3 cells would turn to beads."""
_FLOOR_MM, _HEIGHT_MM, _AXIS_MM = -205.0, 340.0, -20.0
_FRONT = 0.5
"""How much closer texels lie in front, and wider at the back, than on a plain cylinder."""
_RAYS = 40


def builtin() -> Mesh:
    """The head, from the cache where it is there.

    Millimetres, origin between the ears, +z the face, +y up; cylindrical texture coordinates, their seam at the back.
    """
    kept = made()
    return Mesh(kept["positions"], kept["normals"], kept["uv"], kept["triangles"], {}, (), "built-in")


def made() -> dict[str, np.ndarray]:
    """What the head is made of, vertex by vertex: positions, normals, uv, triangles, open sky and thickness in mm."""
    return cached("head", _make)


def cache_folder() -> Path:
    """Where made things are kept: LUTGEN_CACHE, else the user's cache folder."""
    given = os.environ.get("LUTGEN_CACHE")
    base = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA") or Path.home() / ".cache"
    return Path(given) if given else Path(base) / "lutgen"


def cached(name: str, make) -> dict[str, np.ndarray]:
    """Arrays that `make` gives, kept under the hash of the sources; a cache that fails costs only time."""
    text = "".join(
        (files("lutgen") / f"{module}.py").read_text()
        for module in ("head", "sculpt", "painting", "complexion", "hair")
    )
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
    turn = np.arctan2(positions[:, 0], positions[:, 2] - _AXIS_MM)
    u = 0.5 + (turn + _FRONT * np.sin(turn)) / (2 * np.pi)
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
    u, v = unfolded(np.stack([u, v], axis=1), triangles, positions[whole, 1] < 90).T
    return {
        "positions": positions[whole].astype("f4"), "normals": normals[whole].astype("f4"),
        "uv": np.stack([u, v], axis=1).astype("f4"), "triangles": triangles.astype("i4"),
        "open": open_sky[whole].astype("f4"), "thickness": thickness[whole].astype("f4"),
    }  # fmt: skip


def unfolded(uv: np.ndarray, triangles: np.ndarray, movable: np.ndarray, rounds: int = 8) -> np.ndarray:
    """Texture coordinates [V, 2] in which no movable triangle [T, 3] lies upside down on others, as behind an ear.

    Around those that do, each vertex moves to the middle of its neighbors (Tutte 1963), wider in every round.
    """
    uv = uv.copy()
    edges = np.unique(np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
    edges = np.concatenate([edges, edges[:, ::-1]])
    count = np.bincount(edges[:, 0], minlength=len(uv))
    moved = np.zeros(len(uv), bool)
    for _ in range(rounds):
        a, b, c = (uv[triangles[:, k]] for k in range(3))
        area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
        folded = (area <= 0) & movable[triangles].all(axis=1)
        if not folded.any():
            break
        moved[triangles[folded]] = True
        for _ in range(2):
            moved[edges[moved[edges[:, 0]], 1]] = True
        moved &= movable
        some = edges[moved[edges[:, 0]]]
        for _ in range(250):
            middle = [np.bincount(some[:, 0], uv[some[:, 1], k], len(uv))[moved] for k in (0, 1)]
            uv[moved] = np.stack(middle, axis=1) / count[moved, None]
    return uv


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
