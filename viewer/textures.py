"""A LUT set as textures: color by chromophores, and what a gather needs of the profiles.

An OpenGL 3-D texture has three axes, a profile table four: slices of eumelanin lie one after the other along the
third, and the shader mixes two of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np

from lutgen.solvers import burley, profiles
from lutgen.tables import shader_axes
from lutgen.tables.lut_set import LutSet

from . import gl

QUANTILES, RADII = 64, 64
RADIUS_MM = (0.005, 20.0)
"""Radii, evenly spaced in logarithm, at which encircled energy is tabled."""


@dataclass(frozen=True)
class LutTextures:
    """`color` [eumelanin, hemoglobin, melanin]: ACEScg. `rings`: over quantile, melanin, (eumelanin, hemoglobin):
    radius in mm and encircled energy there. `encircled`: over log radius likewise: energy and the node's r99 in mm.
    `functions`: GLSL of their coordinates."""

    color: moderngl.Texture3D
    rings: moderngl.Texture3D
    encircled: moderngl.Texture3D
    functions: str

    @property
    def bytes(self) -> int:
        """Memory of the three textures."""
        return sum(16 * t.width * t.height * t.depth for t in (self.color, self.rings, self.encircled))


def quantiles() -> np.ndarray:
    """Quantiles [64] of the widest channel at which radii are tabled: denser toward the tail, 1 - (1 - s)^2."""
    s = (np.arange(QUANTILES)) / (QUANTILES - 1)
    return np.minimum(1 - (1 - s) ** 2, 0.9995)


def tables(luts: LutSet) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Color [N_e, N_h, N_m, 4], rings [N_e N_h, N_m, 64, 4] and encircled energy [N_e N_h, N_m, 64, 4] of a set."""
    color = np.concatenate([luts.color_lut.acescg, np.ones((*luts.color_lut.grid.shape, 1))], axis=-1)
    lut = luts.profile_lut
    P = _encircled(lut.shape)
    return color.transpose(1, 0, 2, 3), *_profile_tables(P, lut.radius_edges_mm, lut.grid.shape)


def burley_tables(luts: LutSet, skin: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    """The same tables where one Burley shape, fitted to one skin, stands for every tone: what engines ship."""
    lut = luts.profile_lut
    d, _ = burley.fit(luts.profile(*skin).energy, lut.radius_edges_mm)
    shape = np.diff(burley.encircled(lut.radius_edges_mm[:, None], d), axis=0)
    P = _encircled(np.broadcast_to(shape / shape.sum(axis=0), lut.shape.shape))
    return _profile_tables(P, lut.radius_edges_mm, lut.grid.shape)


def _encircled(shape: np.ndarray) -> np.ndarray:
    """Encircled energy at the edges [N, B + 1, 3] of shapes [..., B, 3]."""
    flat = np.cumsum(shape.reshape(-1, *shape.shape[-2:]), axis=1)
    return np.concatenate([np.zeros_like(flat[:, :1]), flat / flat[:, -1:]], axis=1)


def _profile_tables(P: np.ndarray, edges: np.ndarray, shape: tuple[int, int, int]):
    r90 = profiles.inverse(P.transpose(0, 2, 1), edges, np.array([0.9]))[..., 0]
    widest = np.take_along_axis(P, r90.argmax(axis=1)[:, None, None], axis=2)[:, :, 0]
    radius = profiles.inverse(widest, edges, quantiles())
    rings = np.concatenate([radius[..., None], _at(P, edges, radius)], axis=-1)
    radii = np.geomspace(*RADIUS_MM, RADII)
    shared = _weights(edges, radii) @ P  # all nodes have the same edges: one product
    r99 = profiles.inverse(widest, edges, np.array([0.99]))
    within = np.concatenate([shared, np.broadcast_to(r99[:, None], (*shared.shape[:2], 1))], axis=-1)
    return tuple(_sliced(table.reshape(*shape, *table.shape[1:])) for table in (rings, within))


def _sliced(table: np.ndarray) -> np.ndarray:
    """[N_h, N_e, N_m, Q, 4] as [N_e N_h, N_m, Q, 4]."""
    h, e, m, q, c = table.shape
    return table.transpose(1, 0, 2, 3, 4).reshape(e * h, m, q, c)


def _weights(edges: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Matrix [R, B + 1] that reads values at radii between edges, linearly."""
    ring = np.clip(np.searchsorted(edges, radii, side="right") - 1, 0, len(edges) - 2)
    along = np.clip((radii - edges[ring]) / np.diff(edges)[ring], 0, 1)
    matrix = np.zeros((len(radii), len(edges)))
    rows = np.arange(len(radii))
    matrix[rows, ring], matrix[rows, ring + 1] = 1 - along, along
    return matrix


def _at(P: np.ndarray, edges: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Encircled energy [N, Q, 3] of P [N, B + 1, 3] at radii [N, Q] of each node's own."""
    ring = np.clip(np.searchsorted(edges, radius, side="right") - 1, 0, len(edges) - 2)
    along = ((radius - edges[ring]) / np.diff(edges)[ring])[..., None]
    low, high = (np.take_along_axis(P, (ring + i)[..., None], axis=1) for i in (0, 1))
    return low + along * (high - low)


def upload(luts: LutSet) -> LutTextures:
    """Textures of a set."""
    color, rings, within = tables(luts)
    return LutTextures(gl.volume(color), gl.volume(rings), gl.volume(within), functions(luts))


def functions(luts: LutSet) -> str:
    """GLSL that finds the textures' coordinates of a skin."""
    low, high = np.log(RADIUS_MM)
    return "\n".join([
        shader_axes.grid_functions(luts.color_lut.grid, "color"),
        shader_axes.grid_functions(luts.profile_lut.grid, "profile"),
        f"const float QUANTILE_COUNT = {QUANTILES}.0, RADIUS_COUNT = {RADII}.0;",
        f"const float LOG_RADIUS_LOW = {low:.9g}, LOG_RADIUS_SPAN = {high - low:.9g};",
    ])  # fmt: skip


def rewrite(textures: LutTextures, color: np.ndarray | None, rings: np.ndarray, within: np.ndarray) -> None:
    """Put new values into a set's textures, of the same sizes."""
    pairs = ((textures.color, color), (textures.rings, rings), (textures.encircled, within))
    for texture, values in pairs:
        if values is not None:
            texture.write(np.ascontiguousarray(values, "f4").tobytes())
