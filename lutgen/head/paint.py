"""Texture maps of any head with texture coordinates, painted by place on the skin so that no seam shows.

Pigment, blood and gloss are painted where the head's points lie in the built-in head's frame (face.py), pores and
wrinkles by place on the head itself, for they are as large on any head. Where no face is found, skin is painted as on
the back of a head: mottled, without lips and freckles.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from lutgen.files import cache
from lutgen.head import complexion, face, occlusion
from lutgen.head.mesh import Mesh

MAP_SIZE = 2048
_MODULES = tuple(
    f"head/{name}" for name in ("paint", "face", "landmarks", "occlusion", "complexion", "hair", "sculpt", "builtin")
)
_NO_FACE_MM = np.array([0.0, 1000.0, -1000.0])


def paint(shape: Mesh) -> dict[str, Any]:
    """A head's maps [2048, 2048, channels], first row lowest: `chromophores`, `surface`, `normal`.

    As `texture_maps.Maps` holds them; kept in the cache. Without texture coordinates none are made.
    """
    maps = _painted(shape)
    return {name: maps[name] for name in ("chromophores", "surface", "normal") if name in maps}


def notes(shape: Mesh) -> tuple[str, ...]:
    """What could not be painted on a head, for its user."""
    lack = "" if shape.uv is None else _lack(shape)
    if lack:
        return (f"texture coordinates {lack}: freckles, occlusion and thickness are left out; unwrap the mesh",)
    maps = _painted(shape)
    if "face" in maps and not maps["face"]:
        return (
            "no face found (+y up, +z forward, nose foremost on the midline): lips, flush and freckles are left out",
        )
    return ()


def origin_mm(shape: Mesh) -> np.ndarray:
    """The point [3] of a head that lies between its ears; the mesh's own origin where no face was found."""
    return _painted(shape).get("origin", np.zeros(3))


def _painted(shape: Mesh) -> dict[str, np.ndarray]:
    if shape.uv is None or _lack(shape):
        return {}
    own = shape.attribution == "built-in"
    parts = shape.positions_mm, shape.normals, shape.uv, shape.triangles
    return cache.load_or_make("maps", _MODULES, lambda: _paint(shape, own), *parts, np.array(own))


def _lack(shape: Mesh) -> str:
    """Why a head's texture coordinates cannot be painted by: palettes collapse them, tiles repeat them."""
    assert shape.uv is not None
    extent = np.ptp(shape.uv[shape.triangles].astype("f8"), axis=1)
    covered = float(extent.prod(axis=1).sum()) / 2
    if not covered > 1e-6:
        return "have no area"
    return f"cover the texture {covered:.0f} times" if covered > 32 or extent.max() > 4 else ""


def _paint(shape: Mesh, own: bool) -> dict[str, np.ndarray]:
    seen, thick = occlusion.around(shape.positions_mm, shape.normals, shape.triangles)
    drawn = _in_texture(shape, np.column_stack([shape.positions_mm, seen, thick]).astype("f4"), MAP_SIZE)
    p, seen, thick = drawn[..., :3], drawn[..., 3], drawn[..., 4]
    fit = None if own else face.place(shape)
    there = p if own else fit.into(p).astype("f4") if fit is not None else p + _NO_FACE_MM.astype("f4")
    melanin, hemoglobin, lip = complexion.pigments(there)
    plain = np.ones_like(melanin)
    surface = np.stack([*complexion.gloss(there, lip), seen, thick / occlusion.THICKEST_MM], axis=-1)
    return {
        "chromophores": np.stack([melanin, plain, hemoglobin], axis=-1).astype("f2"),
        "surface": surface.astype("f2"), "normal": complexion.bumps(there, lip, p),
        "face": np.array(own or fit is not None), "origin": np.zeros(3) if fit is None else fit.origin_mm,
    }  # fmt: skip


def _in_texture(shape: Mesh, values: np.ndarray, size: int) -> np.ndarray:
    """Vertex values [V, C] at the texel centers [size, size, C]; texels outside are filled from their neighbors.

    Coordinates beyond 0 to 1 wrap around, as the texture does.
    """
    assert shape.uv is not None
    corners = shape.uv[shape.triangles].astype("f8") * size  # [T, 3, 2]
    corners -= size * np.floor(corners.min(axis=1, keepdims=True) / size)
    first = np.floor(corners.min(axis=1)).astype(int)
    side = (np.ceil(corners.max(axis=1)).astype(int) - first).max(axis=1)
    a, b, c = np.moveaxis(corners, 1, 0)
    turns = np.linalg.inv(np.where(_flat(a, b, c)[:, None, None], np.eye(2), np.stack([b - a, c - a], axis=-1)))
    picture = np.full((size, size, values.shape[1]), np.nan, "f4")
    for low, high in pairwise([0, *2 ** np.arange(1, 16)]):  # boxes of like sizes together
        group = np.flatnonzero((side > low) & (side <= high) & ~_flat(a, b, c))
        if not len(group):
            continue
        steps = np.stack(np.meshgrid(np.arange(high), np.arange(high)), axis=-1).reshape(-1, 2)
        for part in np.array_split(group, max(1, len(group) * len(steps) // 500_000)):
            texel = first[part][:, None] + steps
            along = (texel + 0.5 - a[part][:, None]) @ turns[part].transpose(0, 2, 1)
            w = np.concatenate([1 - along.sum(axis=-1, keepdims=True), along], axis=-1)
            k, inside = np.nonzero((w >= -1e-9).all(axis=-1))
            texels = texel[k, inside] % size
            corner = values[shape.triangles[part[k]]]
            picture[texels[:, 1], texels[:, 0]] = np.einsum("nk,nkc->nc", w[k, inside].astype("f4"), corner)
    return _filled(picture)


def _flat(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Whether triangles [T] have no area in the texture, corners [T, 2] in texels."""
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    return np.abs(ux * vy - uy * vx) < 1e-9


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
