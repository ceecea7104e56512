"""What lies around each vertex of a head: how much of the sky it sees, and how thick the flesh under it is.

The surface is sampled densely and projected along many axes onto orthographic grids of about a millimeter. Per cell the
outermost sample says what is in the way of light, and the first sample of a face turned away says where light that
entered would come out. Samples need neither a closed mesh nor clean topology, so heads with holes do as well.
"""

from __future__ import annotations

import numpy as np

AXES = 64
"""Axes of projection; each is looked along both ways."""
THICKEST_MM = 32.0
_CELL_MM, _CELLS = 1.0, 700
_CONE = 0.8


def around(positions_mm: np.ndarray, normals: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cosine-weighted share of open sky [V] in 0 to 1 and thickness in mm [V] in 0 to 32 of a mesh's vertices.

    Positions [V, 3] in mm, unit normals [V, 3], triangles [T, 3] counterclockwise from outside. Thickness is taken
    across the part: the way inward to the next face that looks away, times its cosine, averaged over a cone of 37
    degrees; 32 stands for thicker, and for where no such face is found. Small heads are seen in cells of 1 mm, what
    is larger than 0.7 m in 700 cells.
    """
    p, n = positions_mm.T.astype("f8"), normals.astype("f8")
    cell = max(_CELL_MM, float(np.linalg.norm(np.ptp(p, axis=1))) / _CELLS)
    samples, facing = sampled(positions_mm.astype("f8"), triangles, 0.9 * cell)
    raised = p + cell * n.T
    seen, sky, deep, cone = (np.zeros(len(n)) for _ in range(4))
    for axis in _hemisphere(AXES):
        frame = np.stack([*_across(axis), axis])
        cloud, vertices, lifted = frame @ samples, frame @ p, frame @ raised
        low = np.minimum(cloud.min(axis=1), lifted.min(axis=1))[:2, None] - 2 * cell
        shape = tuple(int(k) + 3 for k in (np.maximum(cloud.max(axis=1), lifted.max(axis=1))[:2] - low[:, 0]) / cell)
        place = _cells(cloud, low, cell, shape)
        for sign in (1.0, -1.0):
            cosine = sign * (n @ axis)
            near = np.flatnonzero(cosine > 0)
            free = _free(
                place,
                sign * cloud[2],
                sign * lifted[2, near],
                lifted[:, near],
                cosine[near],
                low,
                cell,
                shape,
            )
            seen[near] += cosine[near] * free
            sky[near] += cosine[near]
            near = np.flatnonzero(cosine > _CONE)
            away = np.flatnonzero(sign * (axis @ facing) < 0)
            way = _way_in(
                place[away],
                sign * cloud[2, away],
                _cells(vertices[:, near], low, cell, shape),
                sign * vertices[2, near],
            )
            deep[near] += cosine[near] * np.minimum(way * cosine[near], THICKEST_MM)
            cone[near] += cosine[near]
    return seen / np.maximum(sky, 1e-9), np.where(cone > 0, deep / np.maximum(cone, 1e-9), THICKEST_MM)


def _hemisphere(count: int) -> np.ndarray:
    """Axes [count, 3], evenly spread over half of all directions."""
    i = np.arange(count) + 0.5
    y, turn = 1 - i / count, i * 2.39996323
    r = np.sqrt(1 - y * y)
    return np.stack([r * np.cos(turn), y, r * np.sin(turn)], axis=1)


def _across(axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    side = np.cross(axis, [1.0, 0, 0] if abs(axis[0]) < 0.9 else [0, 1.0, 0])
    side /= np.linalg.norm(side)
    return side, np.cross(axis, side)


def sampled(p: np.ndarray, triangles: np.ndarray, spacing: float) -> tuple[np.ndarray, ...]:
    """Points [3, S] on the triangles, about `spacing` apart or closer, and the normal of the face of each [3, S]."""
    corners = p[triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    opposite = np.linalg.norm(np.roll(corners, -1, axis=1) - np.roll(corners, 1, axis=1), axis=2).argmax(axis=1)
    order = (opposite[:, None] + np.arange(3)) % 3  # the corner across from the longest edge first
    first, second, third = np.take_along_axis(corners, order[..., None], axis=1).transpose(1, 0, 2)
    sides = np.stack([second - first, third - first])
    counts = np.unique(np.ceil(1.2 ** np.arange(50))).astype(int)  # few, so that triangles go in groups
    parts = np.searchsorted(counts, np.linalg.norm(sides, axis=2) / spacing)
    points, facing = [], []
    for i, j in np.unique(np.minimum(parts, len(counts) - 1).T, axis=0):
        group = np.flatnonzero((parts[0] == i) & (parts[1] == j))
        a, b = (v.ravel() for v in np.meshgrid(*((np.arange(int(counts[k])) + 0.5) / counts[k] for k in (i, j))))
        within = a + b < 1 + 1e-9
        steps = a[within, None] * sides[0, group, None] + b[within, None] * sides[1, group, None]
        points.append((first[group, None] + steps).reshape(-1, 3))
        facing.append(np.repeat(normal[group], within.sum(), axis=0))
    return tuple(np.ascontiguousarray(np.concatenate(part).T) for part in (points, facing))


def _cells(projected: np.ndarray, low: np.ndarray, cell: float, shape: tuple[int, ...]) -> np.ndarray:
    """Number [N] of the cell that projected points [3, N] fall into."""
    i, j = ((projected[:2] - low) / cell).astype(int)
    return i * shape[1] + j


def _free(place, height, over, projected, cosine, low, cell: float, shape) -> np.ndarray:
    """How free the view outward is, 0 to 1, from points lifted off the surface: four cells, linearly mixed.

    A tilted surface rises within its cell, so what is to count as in the way must rise more.
    """
    top = np.full(shape[0] * shape[1], -np.inf)
    np.maximum.at(top, place, height)
    slack = cell * (0.3 + 1.2 * np.minimum(np.sqrt(1 - np.minimum(cosine, 1) ** 2) / np.maximum(cosine, 1e-3), 6))
    corner = (projected[:2] - low) / cell - 0.5
    first = corner.astype(int)
    along = corner - first
    free = np.zeros(projected.shape[1])
    for i, j in np.ndindex(2, 2):
        weight = np.abs(1 - i - along[0]) * np.abs(1 - j - along[1])
        free += weight * (top[(first[0] + i) * shape[1] + first[1] + j] <= over + slack)
    return free


def _way_in(place, height, cells, over) -> np.ndarray:
    """Distance [N] from points at heights `over` down to the next sample below in their cell; inf without one."""
    if not len(place):
        return np.full(len(cells), np.inf)
    lowest = min(height.min(), over.min() if len(over) else 0)
    span = max(height.max(), over.max() if len(over) else 0) - lowest + 2.0
    keys = np.sort(place * span + (height - lowest))  # cell by cell, from the lowest up
    wanted = cells * span + (over - lowest) - 0.2
    below = np.searchsorted(keys, wanted) - 1
    key = keys[np.maximum(below, 0)]
    inside = (below >= 0) & (key >= cells * span - 0.5)
    return np.where(inside, wanted + 0.2 - key, np.inf)
