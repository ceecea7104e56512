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
from lutgen.tables.axes import Axis
from lutgen.tables.lut_set import LutSet

from . import gl

TAIL = Axis("tail", "1", 0.0, 1.0, 64, "power:0.5")
"""Share of the widest channel's light beyond a ring, where radii are tabled: denser toward 0, the tail."""
LEAST_TAIL = 0.0005
"""Of the last radius: all light is within none that is finite."""
RADIUS_MM = Axis("radius_mm", "mm", 0.005, 20.0, 64, "log")
"""Radii at which encircled energy is tabled."""


@dataclass(frozen=True)
class LutTextures:
    """`color` [hemoglobin, eumelanin, melanin]: ACEScg. `rings`: over the tail, melanin, (eumelanin, hemoglobin):
    radius in mm and encircled energy there. `encircled`: over the radius likewise: energy and the node's r99 in mm.
    `functions`: GLSL of their coordinates."""

    color: moderngl.Texture3D
    rings: moderngl.Texture3D
    encircled: moderngl.Texture3D
    functions: str

    @property
    def bytes(self) -> int:
        """Memory of the three textures."""
        return sum(16 * t.width * t.height * t.depth for t in (self.color, self.rings, self.encircled))


def tables(luts: LutSet) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Color [N_h, N_e, N_m, 4], rings [N_e N_h, N_m, 64, 4] and encircled energy [N_e N_h, N_m, 64, 4] of a set."""
    color = np.concatenate([luts.color_lut.acescg, np.ones((*luts.color_lut.grid.shape, 1))], axis=-1)
    lut = luts.profile_lut
    return color, *_profile_tables(lut.shape, lut.radius_edges_mm)


def burley_tables(luts: LutSet, skin: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    """The same tables where one Burley shape, fitted to one skin, stands for every tone: what engines ship."""
    lut = luts.profile_lut
    d, _ = burley.fit(luts.profile(*skin).energy, lut.radius_edges_mm)
    shape = np.diff(burley.encircled(lut.radius_edges_mm[:, None], d), axis=0)
    return _profile_tables(np.broadcast_to(shape / shape.sum(axis=0), lut.shape.shape), lut.radius_edges_mm)


def _profile_tables(shape: np.ndarray, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rings and encircled energy, each [N_e N_h, N_m, 64, 4], of normalized shapes [N_h, N_e, N_m, B, 3]."""
    flat = shape.reshape(-1, *shape.shape[3:])
    taps = profiles.taps(flat, edges, np.append(np.minimum(1 - TAIL.values, 1 - LEAST_TAIL), 0.99))
    rings, r99 = taps[:, :-1], taps[:, -1:, :1]
    P = np.moveaxis(profiles.encircled(np.moveaxis(flat, 1, -1)), 1, -1)
    shared = _weights(edges, RADIUS_MM.values) @ P  # all nodes have the same edges: one product
    within = np.concatenate([shared, np.broadcast_to(r99, (*shared.shape[:2], 1))], axis=-1)
    return _sliced(rings, shape.shape[:3]), _sliced(within, shape.shape[:3])


def _sliced(table: np.ndarray, grid: tuple[int, ...]) -> np.ndarray:
    """Rows of nodes [N_h N_e N_m, Q, 4] as [N_e N_h, N_m, Q, 4]."""
    N_h, N_e, N_m = grid
    return table.reshape(N_h, N_e, N_m, -1, 4).transpose(1, 0, 2, 3, 4).reshape(N_e * N_h, N_m, -1, 4)


def _weights(edges: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Matrix [R, B + 1] that reads values at radii between edges, linearly."""
    ring = np.clip(np.searchsorted(edges, radii, side="right") - 1, 0, len(edges) - 2)
    along = np.clip((radii - edges[ring]) / np.diff(edges)[ring], 0, 1)
    matrix = np.zeros((len(radii), len(edges)))
    rows = np.arange(len(radii))
    matrix[rows, ring], matrix[rows, ring + 1] = 1 - along, along
    return matrix


def upload(luts: LutSet) -> LutTextures:
    """Textures of a set."""
    color, rings, within = tables(luts)
    return LutTextures(gl.volume(color), gl.volume(rings), gl.volume(within), functions(luts))


def functions(luts: LutSet) -> str:
    """GLSL that finds the textures' coordinates of a skin."""
    return "\n".join([
        shader_axes.grid_functions(luts.color_lut.grid, "color"),
        shader_axes.grid_functions(luts.profile_lut.grid, "profile"),
        shader_axes.axis_function(TAIL, "ring"),
        shader_axes.axis_function(RADIUS_MM, "encircled"),
        f"const float LEAST_RADIUS_MM = {RADIUS_MM.low:.9g};",
    ])  # fmt: skip


def rewrite(textures: LutTextures, color: np.ndarray | None, rings: np.ndarray, within: np.ndarray) -> None:
    """Put new values into a set's textures, of the same sizes."""
    pairs = ((textures.color, color), (textures.rings, rings), (textures.encircled, within))
    for texture, values in pairs:
        if values is not None:
            texture.write(np.ascontiguousarray(values, "f4").tobytes())
