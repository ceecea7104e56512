"""What a mesh must be before rays and walks make sense: triangles with area, normals outward, the size of a head."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lutgen.errors import InputError
from lutgen.head import mesh
from lutgen.head.mesh import Mesh

HEAD_MM = (100.0, 600.0)
"""Heights of heads and busts; scattering has a scale in mm, so another size is most likely a wrong unit."""


def mended(shape: Mesh) -> tuple[Mesh, tuple[str, ...]]:
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
