"""What a mesh must be before rays and walks make sense.

Rays need triangles with area, normals outward, the size of a head; walks inside a closed surface: corners welded, a cut
neck capped, anything else refused.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lutgen.errors import InputError
from lutgen.head import mesh
from lutgen.head.mesh import Mesh

HEAD_MM = (100.0, 600.0)
"""Heights of heads and busts; scattering has a scale in mm, so another size is most likely a wrong unit."""
_WELD_MM = 1e-3
_BASE = 0.1
"""Share of the height, from the bottom, in which an open edge is where a neck or a bust was cut."""


def outward(shape: Mesh) -> tuple[Mesh, tuple[str, ...]]:
    """The mesh without degenerate triangles and with normals outward, and what was done or is odd, in words.

    Triangles run counterclockwise seen from outside where the volume that they enclose is positive (an open bust's
    counts from its middle); a mesh that runs the other way is turned around. InputError where no triangle has area.
    """
    notes = []
    corners = shape.positions_mm.astype(float)[shape.triangles]
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    longest = np.square(corners - np.roll(corners, 1, axis=1)).sum(axis=2).max(axis=1)
    good = np.linalg.norm(sides, axis=1) > 1e-7 * longest
    if not good.any():
        raise InputError("mesh: no triangle has an area; export it anew")
    if not good.all():
        shape = replace(shape, triangles=shape.triangles[good])
        notes.append(f"{(~good).sum()} of {len(good)} triangles have no area: left out")
        corners, sides = corners[good], sides[good]
    middle = (corners.min(axis=(0, 1)) + corners.max(axis=(0, 1))) / 2
    outward = ((corners.mean(axis=1) - middle) * sides).sum(axis=1)
    if outward.sum() < -1e-3 * np.abs(outward).sum():
        triangles = np.ascontiguousarray(shape.triangles[:, ::-1])
        shape = replace(shape, triangles=triangles, normals=mesh.normals(shape.positions_mm, triangles))
        notes.append("triangles ran clockwise, so normals pointed inward: turned around")
    height = float(np.ptp(corners[..., 1]))
    if not HEAD_MM[0] <= height <= HEAD_MM[1]:
        notes.append(
            f"the head is {height:.4g} mm high; heads are {HEAD_MM[0]:g} to {HEAD_MM[1]:g}, and light spreads in "
            "millimetres: check --mm-per-unit"
        )
    return shape, tuple(notes)


def surface(positions_mm: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, tuple[str, ...]]:
    """Positions [V, 3], triangles [T, 3] of the closed surface and notes of what was mended.

    Corners within 0.001 mm are one (files double them along seams); triangles without area are dropped; a hole whose
    rim lies in the lowest tenth of the height is a cut neck, and gets a fan. Raises InputError for other holes and
    for triangles that face each other or inward.
    """
    _, first, number = np.unique(np.round(positions_mm / _WELD_MM), axis=0, return_index=True, return_inverse=True)
    positions, corners = np.asarray(positions_mm, float)[first], number.ravel()[triangles]
    a, b, c = corners.T
    whole = (a != b) & (b != c) & (c != a)
    corners, notes = corners[whole], []
    if not len(corners):
        raise InputError("mesh: all its triangles are degenerate; export it anew")
    if not whole.all():
        notes.append(f"mesh: {np.sum(~whole)} degenerate triangles were dropped")
    rims = _rims(_open_edges(corners, len(positions)))
    floor, height = positions[:, 1].min(), np.ptp(positions[:, 1])
    holes = [rim for rim in rims if np.any(positions[rim[:, 0], 1] > floor + _BASE * height)]
    if holes:
        wide = max(float(np.ptp(positions[rim[:, 0]], axis=0).max()) for rim in holes)
        count = f"{len(holes)} hole{'s' * (len(holes) > 1)}, {sum(map(len, holes))} open edges"
        raise InputError(
            f"mesh: {count}, the largest {wide:.1f} mm wide: a walk inside needs a closed mesh; close them in your "
            "editor, or use --walk flat"
        )
    for rim in rims:
        positions = np.concatenate([positions, positions[rim[:, 0]].mean(axis=0, keepdims=True)])
        middle = np.full(len(rim), len(positions) - 1)
        corners = np.concatenate([corners, np.stack([rim[:, 1], rim[:, 0], middle], axis=1)])
        notes.append(f"mesh: open at the bottom, {len(rim)} edges: closed with a flat cap")
    volume = np.einsum("ti,ti->", positions[corners[:, 0]], np.cross(*positions[corners[:, 1:]].swapaxes(0, 1))) / 6
    if volume <= 0:
        raise InputError("mesh: its triangles face inward; flip its normals in your editor, or use --walk flat")
    return positions.astype("f4"), corners.astype("i4"), tuple(notes)


def _open_edges(corners: np.ndarray, count: int) -> np.ndarray:
    """Directed edges [E, 2] without one that runs back; InputError where neighbors face opposite ways."""
    edges = corners[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).astype(np.int64)
    forth, back = edges @ [count, 1], edges @ [1, count]
    unmatched = edges[~np.isin(forth, back)]
    keys, number = np.unique(forth, return_counts=True)
    returns = dict(zip(*np.unique(back, return_counts=True), strict=True))
    turned = sum(1 for key, n in zip(keys[number > 1], number[number > 1], strict=True) if n > returns.get(key, 0))
    if turned:
        raise InputError(
            f"mesh: at {turned} edges both triangles face opposite ways; recalculate its normals in your editor, "
            "or use --walk flat"
        )
    return unmatched


def _rims(edges: np.ndarray) -> list[np.ndarray]:
    """Open edges [E, 2] by the hole they surround."""
    label = {int(v): int(v) for v in edges.ravel()}

    def root(v: int) -> int:
        """The vertex that stands for all that v is joined to."""
        while label[v] != v:
            label[v] = label[label[v]]
            v = label[v]
        return v

    for a, b in edges:
        label[root(int(a))] = root(int(b))
    of = np.array([root(int(a)) for a in edges[:, 0]], int)
    return [edges[of == one] for one in np.unique(of)]
