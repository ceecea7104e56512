"""Texture maps of a head, painted by place on the skin so that no seam shows."""

from __future__ import annotations

import numpy as np

from lutgen import complexion, head
from lutgen.mesh import Mesh

MAP_SIZE = 2048


def paint(shape: Mesh) -> dict[str, np.ndarray]:
    """The built-in head's maps [2048, 2048, channels], first row lowest: `chromophores`, `surface`, `normal`.

    As `lutgen.maps.Maps` holds them.
    """
    kept = head.cached("maps", lambda: _paint(shape))
    return {name: kept[name] for name in ("chromophores", "surface", "normal")}


def _paint(shape: Mesh) -> dict[str, np.ndarray]:
    kept = head.made()
    drawn = _in_texture(shape, np.concatenate([shape.positions_mm, kept["open"][:, None], kept["thickness"][:, None]],
                                              axis=1).astype("f4"), MAP_SIZE)  # fmt: skip
    p, seen, thick = drawn[..., :3], drawn[..., 3], drawn[..., 4]
    melanin, hemoglobin, lip = complexion.pigments(p)
    plain = np.ones_like(melanin)
    surface = np.stack([*complexion.gloss(p, lip), seen, np.clip(thick / 32, 0, 1)], axis=-1)
    return {
        "chromophores": np.stack([melanin, plain, hemoglobin], axis=-1).astype("f4"),
        "surface": surface.astype("f4"), "normal": complexion.bumps(p, lip),
    }  # fmt: skip


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
