"""Texture maps of any head with texture coordinates, painted by place on the skin so that no seam shows.

Pigment, blood and gloss are painted where the head's points lie in the built-in head's frame (lutgen.placing), pores
and wrinkles by place on the head itself, for they are as large on any head. Where no face is found, skin is painted as
on the back of a head: mottled, without lips and freckles.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from lutgen import cache, complexion, placing, surroundings
from lutgen.mesh import Mesh

MAP_SIZE = 2048
_MODULES = ("painting", "placing", "surroundings", "complexion", "hair", "sculpt", "head")
_NO_FACE_MM = np.array([0.0, 1000.0, -1000.0])


def paint(shape: Mesh) -> dict[str, Any]:
    """A head's maps [2048, 2048, channels], first row lowest: `chromophores`, `surface`, `normal`.

    As `lutgen.maps.Maps` holds them; kept in the cache. Without texture coordinates none are made.
    """
    made = _painted(shape)
    return {name: made[name] for name in ("chromophores", "surface", "normal") if name in made}


def notes(shape: Mesh) -> tuple[str, ...]:
    """What could not be painted on a head, for its user."""
    lack = "" if shape.uv is None else _lack(shape)
    if lack:
        return (f"texture coordinates {lack}: pores, freckles, occlusion and thickness are left out; unwrap the mesh",)
    made = _painted(shape)
    if "face" in made and not made["face"]:
        return (
            "no face found (+y up, +z forward, nose foremost on the midline): lips, flush and freckles are left out",
        )
    return ()


def _painted(shape: Mesh) -> dict[str, np.ndarray]:
    if shape.uv is None or _lack(shape):
        return {}
    own = shape.attribution == "built-in"
    parts = shape.positions_mm, shape.normals, shape.uv, shape.triangles
    return cache.kept("maps", _MODULES, lambda: _paint(shape, own), *parts, np.array(own))


def _lack(shape: Mesh) -> str:
    """Why a head's texture coordinates cannot be painted by: palettes collapse them, tiles repeat them."""
    assert shape.uv is not None
    extent = np.ptp(shape.uv[shape.triangles].astype("f8"), axis=1)
    covered = float(extent.prod(axis=1).sum()) / 2
    if not covered > 1e-6:
        return "have no area"
    return f"cover the texture {covered:.0f} times" if covered > 32 or extent.max() > 4 else ""


def _paint(shape: Mesh, own: bool) -> dict[str, np.ndarray]:
    seen, thick = surroundings.around(shape.positions_mm, shape.normals, shape.triangles)
    drawn = _in_texture(shape, np.column_stack([shape.positions_mm, seen, thick]).astype("f4"), MAP_SIZE)
    p, seen, thick = drawn[..., :3], drawn[..., 3], drawn[..., 4]
    fit = None if own else placing.place(shape)
    there = p if own else fit.into(p).astype("f4") if fit is not None else p + _NO_FACE_MM.astype("f4")
    melanin, hemoglobin, lip = complexion.pigments(there)
    plain = np.ones_like(melanin)
    surface = np.stack([*complexion.gloss(there, lip), seen, thick / surroundings.THICKEST_MM], axis=-1)
    return {
        "chromophores": np.stack([melanin, plain, hemoglobin], axis=-1).astype("f2"),
        "surface": surface.astype("f2"), "normal": complexion.bumps(there, lip, p),
        "face": np.array(own or fit is not None),
    }  # fmt: skip


def _in_texture(shape: Mesh, values: np.ndarray, size: int) -> np.ndarray:
    """Vertex values [V, C] drawn into texture space [size, size, C]; texels outside are filled from their neighbors.

    Coordinates beyond 0 to 1 wrap around, as the texture does.
    """
    assert shape.uv is not None
    corners = shape.uv[shape.triangles].astype("f8") * size  # [T, 3, 2]
    corners -= size * np.floor(corners.min(axis=1, keepdims=True) / size)
    wraps = corners.max(axis=1) > size * (1 + 1e-6)
    extent = (corners.max(axis=1) - corners.min(axis=1)).max(axis=1)
    out = np.full((size, size, values.shape[1]), np.nan, "f4")
    for low, high in ((0, 4), (4, 8), (8, 16), (16, 40), (40, 160), (160, 640), (640, 1e9)):
        group = np.flatnonzero((extent >= low) & (extent < high))
        steps = int(2 * min(high, 4 * size)) + 1
        w = np.array([(i, j) for i in range(steps + 1) for j in range(steps + 1 - i)]) / steps
        w = np.concatenate([w, 1 - w.sum(axis=1, keepdims=True)], axis=1)
        for part in np.array_split(group, max(1, len(group) * len(w) // 2_000_000)):
            if not len(part):
                continue
            at = np.floor(w @ corners[part]).astype(int)
            at = np.where(wraps[part][:, None], at % size, np.clip(at, 0, size - 1)).reshape(-1, 2)
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
