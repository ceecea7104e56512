"""The passes of a frame: shadow, surface, scattering, composition; from a head, its maps and a LUT set to pixels."""

from __future__ import annotations

from collections.abc import Iterable

import moderngl
import numpy as np

from lutgen import color
from lutgen.errors import in_range
from lutgen.files import texture_maps
from lutgen.head import pores
from lutgen.scene import environment, surface
from lutgen.scene import light as lighting
from lutgen.scene import look as looks
from lutgen.scene.look import Look

from . import gl, lut_sides
from .measure import clock
from .stage import REFLECTED, SAMPLES, Stage, side

TAPS = {"off": 0, "low": 8, "medium": 16, "high": 64, "reference": 64}
REFERENCE_FRAMES = 16


def set_oxygenation(stage: Stage, oxygenation: float) -> None:
    """Expand the LUTs from their stored paths to another oxygenation and upload them."""
    if oxygenation == stage.oxygenation:
        return
    for name in ("none", "set"):
        if name in stage.sides:
            lut_sides.expand(stage.sides[name], oxygenation)
    stage.oxygenation = oxygenation


def require(stage: Stage, look: Look) -> None:
    """Raise InputError where the stage cannot show a look: chromophores outside the LUTs' axes, no LUT set to split."""
    for name in {"none", look.split} & {"none", "set"}:
        grid = side(stage, name).luts.color_lut.grid
        for axis in grid.axes:
            in_range(axis.name, getattr(look, axis.name), axis.low, axis.high)


def frames(look: Look) -> int:
    """How many frames are added up for a look: 16 at tier `reference`, each with other taps; else one."""
    return REFERENCE_FRAMES if look.tier == "reference" else 1


def draw(stage: Stage, look: Look, frame: int | None = None) -> None:
    """Draw a look into the stage's pixels; a split view draws its right half as `look.split` says.

    All its frames, or one more of them: `frame` 0 starts anew, a later one adds to what is there.
    """
    require(stage, look)
    camera = looks.camera(look, *stage.size)
    clock.start(stage.timer)
    if not frame:
        set_oxygenation(stage, look.oxygenation)
        with clock.timed(stage.timer, "shadow"):
            cast_shadow(stage, look)
        with clock.timed(stage.timer, "surface"):
            draw_surface(stage, look, camera, stage.surface, stage.head, stage.targets["surface_buffer"])
    with clock.timed(stage.timer, "scattering"):
        _halves(stage, look, camera, range(frames(look)) if frame is None else (frame,))
    with clock.timed(stage.timer, "composition"):
        compose(stage, "scattered", "reflected", 2.0**look.exposure)
    gl.check()


def _halves(stage: Stage, look: Look, camera: looks.Camera, added: Iterable[int]) -> None:
    width, height = (n * SAMPLES for n in stage.size)
    halves = [(0, width)] if look.split == "none" else [(0, width // 2), (width // 2, width)]
    for k, (left, right) in enumerate(halves):
        for frame in added:
            _scatter(stage, look, camera, look.split if k else "none", (left, 0, right - left, height), frame)


def _light_clip(stage: Stage, look: Look) -> np.ndarray:
    """Orthographic clip space that the light sees the whole head in."""
    way, radius = looks.light_direction(look), stage.radius_mm
    box = np.diag([1 / radius, 1 / radius, -1 / (1.5 * radius), 1.0])
    box[2, 3] = -4 / 3
    return box @ looks.look_at(stage.center_mm + 2 * radius * way, stage.center_mm)


def cast_shadow(stage: Stage, look: Look) -> None:
    """The depth of the head as the light sees it, drawn again where the light has moved since (`stage.cast`)."""
    clip = _light_clip(stage, look)
    if stage.cast is not None and np.array_equal(stage.cast, clip):
        return
    stage.cast = clip
    buffer = stage.targets["shadow_buffer"]
    buffer.use()
    buffer.clear(depth=1.0)
    gl.context().enable_only(moderngl.DEPTH_TEST)
    gl.put(stage.shadow, light_clip=clip)
    stage.head_shadow.render()


def skin_of(stage: Stage, look: Look) -> dict:
    """Uniforms that say what the look's skin is, and how far the maps change it."""
    grid = stage.sides["none"].luts.color_lut.grid
    axes = grid.axes[::-1]
    return {
        "chromophores": (look.melanin, look.eumelanin, look.hemoglobin),
        "contrast": texture_maps.contrast(stage.full_contrast_melanin, look.melanin),
        "chromophores_low": tuple(a.low for a in axes), "chromophores_high": tuple(a.high for a in axes),
    }  # fmt: skip


def from_skin(stage: Stage, look: Look) -> np.ndarray:
    """Irradiance [3] where nothing is seen but open skin of the look's color, lit as skin is on the mean.

    On the mean over all normals a surface has a quarter of the sun's irradiance and all directions' mean of the
    surroundings'.
    """
    luts = stage.sides["none"].shown
    color = luts.color(look.melanin, look.eumelanin, look.hemoglobin, space="acescg")
    return color * (look.light * lighting.SUN / 4 + look.environment * 0.282095 * stage.irradiance[0])


def draw_surface(
    stage: Stage, look: Look, camera: looks.Camera, program: moderngl.Program, seen: moderngl.VertexArray,
    buffer: moderngl.Framebuffer, **more: moderngl.Texture,
) -> None:  # fmt: skip
    """Draw the head with a surface program into its buffer; `more` textures are its own."""
    buffer.use()
    buffer.clear(0.0, 0.0, 0.0, 0.0)
    gl.context().enable_only(moderngl.DEPTH_TEST)
    gl.context().depth_func = "<="
    clip = camera.projection @ camera.view
    gl.put(stage.shadow, light_clip=clip)
    stage.head_shadow.render()  # depth alone first: then no pixel is shaded twice
    around = stage.environment_map
    gl.bind(program, normal_map=stage.maps["normal"], chromophore_map=stage.maps["chromophores"],
            surface_map=stage.maps["surface"], detail_map=stage.maps["detail"], pore_map=stage.maps["pores"],
            shadow_map=stage.targets["cast"], environment_map=stage.lobe_table if around is None else around,
            lobe_table=stage.lobe_table, **more)  # fmt: skip
    gl.put(
        program, view=camera.view, clip=clip, light_clip=_light_clip(stage, look),
        shadow_offset_mm=0.6, light_range_mm=3 * stage.radius_mm, pore_side_mm=pores.SIDE_MM,
        light_direction=looks.light_direction(look), light_color=look.light * lighting.SUN, eye=camera.eye_mm,
        roughness=look.roughness, specular=look.specular, bumps=look.bumps, entry=look.entry,
        transmission=look.transmission, light_radius=np.tan(np.radians(look.light_size)) * 0.06, shadow_bias=0.0016,
        environment_entry=surface.entry_of_the_sky(stage.refractive_index), environment=look.environment,
        irradiance_sh=stage.irradiance,
        environment_levels=0 if around is None else environment.LEVELS,
        environment_turn=tuple(f(np.radians(look.environment_azimuth)) for f in (np.cos, np.sin)),
        from_skin=from_skin(stage, look), **skin_of(stage, look),
    )  # fmt: skip
    seen.render()


def _scatter(
    stage: Stage, look: Look, camera: looks.Camera, split: str, scissor: tuple[int, int, int, int], frame: int
) -> None:
    shown, targets, buffer = side(stage, split), stage.targets, stage.targets["scattered_buffer"]
    program, tables = shown.gather.program, shown.textures
    context = gl.context()
    context.enable_only(moderngl.BLEND if frame else moderngl.NOTHING)
    context.blend_func = moderngl.ONE, moderngl.ONE
    buffer.use()
    buffer.scissor = scissor
    gl.bind(program, entering=targets["entering"], facing=targets["facing"], skin=targets["skin"],
            behind=targets["reflected"], detail=targets["detail"], lut_color=tables.color, lut_rings=tables.rings,
            lut_encircled=tables.encircled)  # fmt: skip
    gl.put(program, focal=camera.focal_pixels * SAMPLES, center=tuple(n * SAMPLES / 2 for n in stage.size),
           taps=0 if split == "scattering" else TAPS[look.tier], sun=tuple(look.light * lighting.SUN / np.pi),
           frame=frame)  # fmt: skip
    shown.gather.array.render()
    buffer.scissor = None


def compose(stage: Stage, scattered: str, reflected: str, exposure: float) -> None:
    """The sum of two of the stage's targets as display colors."""
    program, buffer = stage.compose.program, stage.targets["pixel_buffer"]
    gl.context().enable_only(moderngl.NOTHING)
    buffer.use()
    gl.bind(program, scattered=stage.targets[scattered], reflected_light=stage.targets[reflected])
    gl.put(program, srgb_from_acescg=color.from_acescg(np.eye(3), "srgb").T, luminance=tuple(color.LUMINANCE),
           exposure=exposure, samples=SAMPLES)  # fmt: skip
    stage.compose.array.render()


def pixels(stage: Stage) -> np.ndarray:
    """The frame as 8-bit sRGB [height, width, 3], first row on top."""
    return gl.read(stage.targets["pixel_buffer"], kind="f1", components=3)[::-1]


def radiance(stage: Stage) -> tuple[np.ndarray, np.ndarray]:
    """The frame before exposure and tone curve: ACEScg [height, width, 3] and share of skin, first row on top.

    Scattered and reflected light of a pixel's samples averaged; a sample beside the head counts as black.
    """
    scattered = gl.read(stage.targets["scattered_buffer"]).astype("f8")
    mirrored = gl.read(stage.targets["surface_buffer"], attachment=REFLECTED, kind="f2").astype("f8")
    frames = scattered[..., 3:]
    light = np.where(frames > 0, scattered[..., :3] / np.maximum(frames, 1) + mirrored[..., :3], 0.0)
    whole = np.concatenate([light, frames > 0], axis=-1)
    width, height = stage.size
    whole = whole.reshape(height, SAMPLES, width, SAMPLES, 4).mean(axis=(1, 3))[::-1]
    return whole[..., :3], whole[..., 3]
