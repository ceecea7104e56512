"""The built-in head: sculpted and unwrapped by the project itself, kept in a cache after the first run."""

from __future__ import annotations

import numpy as np

from lutgen import cache, sculpt
from lutgen.mesh import Mesh

SCALE = 1.45
"""Grid spacing: about 28,000 vertices; features narrower than 1.3 cells would turn to beads."""
_FLOOR_MM, _HEIGHT_MM, _AXIS_MM = -205.0, 340.0, -20.0


def builtin() -> Mesh:
    """The head, from the cache where it is there.

    Millimetres, origin between the ears, +z the face, +y up; cylindrical texture coordinates, their seam at the back.
    """
    made = cache.kept("head", ("head", "sculpt"), _make)
    return Mesh(made["positions"], made["normals"], made["uv"], made["triangles"], {}, (), "built-in")


def _make() -> dict[str, np.ndarray]:
    positions, normals, triangles, *_ = sculpt.build(SCALE)
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
    }  # fmt: skip
