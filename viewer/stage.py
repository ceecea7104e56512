"""A stage: everything on the GPU that a picture of a head is drawn from, and the targets that it is drawn into."""

from __future__ import annotations

from dataclasses import dataclass, field

import moderngl
import numpy as np

from lutgen.errors import InputError
from lutgen.head import pores
from lutgen.scene import environment, surface
from lutgen.scene import light as lighting
from lutgen.tables.lut_set import LutSet

from . import gl, light, lut_sides
from .measure import clock

SHADOW_SIZE = 1024
SAMPLES = 2
"""Pixels shaded along x and y for one shown."""
LAYERS = "entering", "facing", "skin", "reflected", "detail"
"""What the surface pass writes, by attachment (viewer/shaders/surface.frag.glsl)."""
REFLECTED = LAYERS.index("reflected")
_MAPS = ("normal", "chromophores", "surface", "detail")
_PLAIN = {"normal": (0.5, 0.5, 1.0, 1.0), "chromophores": (1.0, 1.0, 1.0, 1.0), "surface": (1.0, 1.0, 1.0, 1.0),
          "detail": (1.0, 1.0, 1.0, 1.0)}  # fmt: skip
"""What stands for a map that is not given: no bumps, the sliders' skin, no occlusion, too thick for light."""


@dataclass
class Stage:
    """Everything on the GPU: programs, head, maps, LUT sets by `Look.split`, targets of one size."""

    size: tuple[int, int]
    sides: dict[str, lut_sides.Side]
    surface: moderngl.Program
    shadow: moderngl.Program
    compose: gl.Pass
    head: moderngl.VertexArray
    head_shadow: moderngl.VertexArray
    buffers: tuple
    center_mm: np.ndarray
    radius_mm: float
    maps: dict
    irradiance: np.ndarray
    environment_map: moderngl.Texture | None
    lobe_table: moderngl.Texture
    timer: clock.Clock
    targets: dict = field(default_factory=dict)
    oxygenation: float | None = None
    full_contrast_melanin: float = 0.0292
    cast: np.ndarray | None = None

    @property
    def refractive_index(self) -> float:
        """Of the skin that the stage's LUT set was traced in; the surface of another set's half is this one too."""
        return float(self.sides["none"].luts.manifest["trace"]["n"])

    @property
    def milliseconds(self) -> dict[str, float]:
        """What the last `draw` took by pass: shadow, surface, scattering, composition (viewer/measure/clock.py)."""
        return clock.milliseconds(self.timer)


def upload(
    mesh, maps: dict[str, np.ndarray], luts: LutSet, size: tuple[int, int], other: LutSet | None = None
) -> Stage:
    """Upload a head (positions_mm, normals, uv, triangles), its maps [rows, columns, channels], a LUT set, another."""
    context = gl.context()
    texts = light.texts(luts.manifest["trace"]["n"])
    program = context.program(gl.splice("surface.vert.glsl"), gl.splice("surface.frag.glsl", texts))
    shadow = context.program(gl.splice("shadow.vert.glsl"), gl.splice("shadow.frag.glsl"))
    uv = mesh.uv if mesh.uv is not None else np.zeros((len(mesh.positions_mm), 2))
    vertices = np.concatenate([mesh.positions_mm, mesh.normals, uv], axis=1).astype("f4")
    buffer = context.buffer(vertices.tobytes())
    indices = context.buffer(np.ascontiguousarray(mesh.triangles, "i4").tobytes())
    head = context.vertex_array(program, [(buffer, "3f 3f 2f", "position", "normal", "uv")], indices)
    cast = context.vertex_array(shadow, [(buffer, "3f 20x", "position")], indices)
    center = (mesh.positions_mm.max(axis=0) + mesh.positions_mm.min(axis=0)) / 2
    shown = {name: lut_sides.upload(set_) for name, set_ in (("none", luts), ("set", other)) if set_ is not None}
    stage = Stage(
        size, shown, program, shadow, gl.full_screen("compose.frag.glsl"), head, cast, (buffer, indices), center,
        float(np.linalg.norm(mesh.positions_mm - center, axis=1).max()),
        {name: _map(maps.get(name), _PLAIN[name]) for name in _MAPS} | {"pores": gl.image(pores.texture(), 1.0)},
        lighting.studio_irradiance(), None, gl.table(surface.ggx_energy()), clock.open_clock(),
    )  # fmt: skip
    resize(stage, size)
    return stage


def side(stage: Stage, split: str) -> lut_sides.Side:
    """What shades a side of a split view; InputError where another LUT set is asked for and none was given."""
    if split == "burley" and split not in stage.sides:
        stage.sides[split] = lut_sides.one_burley(stage.sides["none"])
    if split == "set" and split not in stage.sides:
        raise InputError("split = set: there is no other LUT set; give one with --compare DIR")
    return stage.sides["none" if split == "scattering" else split]


def _map(values: np.ndarray | None, plain: tuple[float, ...]) -> moderngl.Texture:
    """A map's texture; one plain texel where there is none."""
    return gl.image(np.array([[plain]], "f4") if values is None else values)


def set_environment(stage: Stage, radiance: np.ndarray | None) -> None:
    """Exchange the light from all around: radiance [rows, 2 rows, 3] as of `environment.read`; None: the studio."""
    if stage.environment_map is not None:
        gl.free(stage.environment_map)
    stage.environment_map, stage.irradiance = None, lighting.studio_irradiance()
    if radiance is not None:
        ways, angles = environment.directions(len(radiance))
        stage.irradiance = lighting.irradiance_sh(ways.reshape(-1, 3), radiance.reshape(-1, 3), angles.ravel())
        stage.environment_map = gl.levels(environment.blurred(radiance))


def resize(stage: Stage, size: tuple[int, int]) -> None:
    """Make the targets of a frame of that size in pixels."""
    gl.free(*stage.targets.values())
    context, large = gl.context(), (size[0] * SAMPLES, size[1] * SAMPLES)
    layers = {name: gl.texture(large, 4, "f4" if name in ("entering", "skin") else "f2") for name in LAYERS}
    depth = context.depth_renderbuffer(large)
    cast = context.depth_texture((SHADOW_SIZE, SHADOW_SIZE))
    cast.compare_func = ""
    cast.repeat_x = cast.repeat_y = False
    scattered, pixels = gl.texture(large, 4, "f4"), gl.texture(size, 4, "f1")
    stage.targets = layers | {
        "depth": depth, "cast": cast, "scattered": scattered, "pixels": pixels,
        "surface_buffer": context.framebuffer(list(layers.values()), depth),
        "shadow_buffer": context.framebuffer(depth_attachment=cast),
        "scattered_buffer": context.framebuffer([scattered]), "pixel_buffer": context.framebuffer([pixels]),
    }  # fmt: skip
    stage.size, stage.cast = size, None


def release(stage: Stage) -> None:
    """Free everything that the stage holds on the GPU."""
    clock.release(stage.timer)
    lut_sides.release(stage.sides)
    compose = stage.compose
    gl.free(
        *stage.targets.values(), *stage.maps.values(), stage.lobe_table, stage.head, stage.head_shadow, stage.surface,
        stage.shadow, *stage.buffers, compose.array, compose.program, compose.corners,
        *([] if stage.environment_map is None else [stage.environment_map]),
    )  # fmt: skip
