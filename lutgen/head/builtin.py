"""The built-in head: sculpted and unwrapped by the project itself, kept in a cache after the first run."""

from __future__ import annotations

import numpy as np

from lutgen.files import cache
from lutgen.head import sculpt
from lutgen.head.mesh import Mesh

SCALE = 1.45
"""Grid spacing: about 28,000 vertices; features narrower than 1.3 cells would turn to beads."""
_FLOOR_MM, _HEIGHT_MM, _AXIS_MM = -205.0, 340.0, -20.0
_FRONT = 0.5
"""How much closer texels lie in front, and wider at the back, than on a plain cylinder."""


def builtin() -> Mesh:
    """The head, from the cache where it is there.

    Millimetres, origin between the ears, +z the face, +y up; cylindrical texture coordinates, their seam at the back.
    """
    arrays = cache.load_or_make("head", ("head/builtin", "head/sculpt"), _make)
    return Mesh(arrays["positions"], arrays["normals"], arrays["uv"], arrays["triangles"], {}, (), "built-in")


def _make() -> dict[str, np.ndarray]:
    positions, normals, triangles, *_ = sculpt.build(SCALE)
    turn = np.arctan2(positions[:, 0], positions[:, 2] - _AXIS_MM)
    u = 0.5 + (turn + _FRONT * np.sin(turn)) / (2 * np.pi)
    around = u[triangles]
    wraps = np.flatnonzero(around.max(axis=1) - around.min(axis=1) > 0.5)
    doubled = np.unique(triangles[wraps][around[wraps] < 0.5])  # corners right of the seam, doubled on its left
    number = np.arange(len(positions))
    number[doubled] = len(positions) + np.arange(len(doubled))
    right = around[wraps] < 0.5
    triangles[wraps] = np.where(right, number[triangles[wraps]], triangles[wraps])
    source = np.concatenate([np.arange(len(positions)), doubled])
    u = np.concatenate([u, u[doubled] + 1])
    margin = 0.03  # u runs a little beyond 0 to 1 at the seam
    u = np.clip((u + margin) / (1 + 2 * margin), 0, 1)  # beyond only around the pole at the crown
    v = (positions[source, 1] - _FLOOR_MM) / _HEIGHT_MM
    u, v = unfolded(np.stack([u, v], axis=1), triangles, positions[source, 1] < 90).T
    return {
        "positions": positions[source].astype("f4"), "normals": normals[source].astype("f4"),
        "uv": np.stack([u, v], axis=1).astype("f4"), "triangles": triangles.astype("i4"),
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
        pairs = edges[moved[edges[:, 0]]]
        for _ in range(250):
            middle = [np.bincount(pairs[:, 0], uv[pairs[:, 1], k], len(uv))[moved] for k in (0, 1)]
            uv[moved] = np.stack(middle, axis=1) / count[moved, None]
    return uv
