"""The same head as a game without lutgen draws it: its skin a color texture, no LUT, no scattering.

What `lutgen bench --viewer` divides by. One pass shades the head with the viewer's own lights, shadow, bumps and
specular (surface.frag.glsl with PLAIN_ALBEDO) into one target; the composition is the viewer's.
"""

from __future__ import annotations

from dataclasses import dataclass

import moderngl

from lutgen.scene import look as looks
from lutgen.scene.look import Look

from .. import gl, light, passes
from ..stage import Stage
from . import clock


@dataclass(frozen=True)
class Plain:
    """The program and its color texture; head, maps, lights and the targets are a stage's."""

    program: moderngl.Program
    head: moderngl.VertexArray
    albedo: moderngl.Texture
    target: moderngl.Framebuffer


def open_plain(stage: Stage, look: Look) -> Plain:
    """The color of a look's skin in a texture, and the program that reads it."""
    context = gl.context()
    texts = light.texts(stage.refractive_index)
    texts["constants.glsl"] = "#define PLAIN_ALBEDO\n" + texts["constants.glsl"]
    program = context.program(gl.splice("surface.vert.glsl"), gl.splice("surface.frag.glsl", texts))
    vertices, indices = stage.buffers
    head = context.vertex_array(program, [(vertices, "3f 3f 2f", "position", "normal", "uv")], indices)
    target = context.framebuffer([stage.targets["reflected"]], stage.targets["depth"])
    return Plain(program, head, _bake(stage, look), target)


def _bake(stage: Stage, look: Look) -> moderngl.Texture:
    """The LUT's color at each texel of the largest map, 8 bits, filtered as the maps are."""
    passes.set_oxygenation(stage, look.oxygenation)
    tables = stage.sides["none"].textures
    maps = {name: stage.maps[name] for name in ("chromophores", "detail")}
    size = tuple(max(texture.size[k] for texture in maps.values()) for k in (0, 1))
    baking = gl.full_screen("albedo.frag.glsl", {"functions.glsl": tables.functions})
    albedo = gl.texture(size, 4, "f1")
    target = gl.context().framebuffer([albedo])
    sharp = {name: texture.anisotropy for name, texture in maps.items()}
    for texture in maps.values():
        texture.anisotropy = 1.0  # llvmpipe's filter for slanted views blurs straight ones too
    target.use()
    gl.context().enable_only(moderngl.NOTHING)
    gl.bind(baking.program, chromophore_map=maps["chromophores"], detail_map=maps["detail"],
            lut_color=tables.color)  # fmt: skip
    gl.put(baking.program, **passes.skin_of(stage, look))
    baking.array.render()
    for name, texture in maps.items():
        texture.anisotropy = sharp[name]
    gl.free(target, baking.array, baking.program, baking.corners)
    return gl.filtered(albedo)


def draw(stage: Stage, plain: Plain, look: Look) -> None:
    """Draw one frame into the stage's pixels, on its clock; the stage keeps the size that it had."""
    clock.start(stage.timer)
    with clock.timed(stage.timer, "shadow"):
        passes.cast_shadow(stage, look)
    with clock.timed(stage.timer, "surface"):
        passes.draw_surface(stage, look, looks.camera(look, *stage.size), plain.program, plain.head, plain.target,
                            albedo_map=plain.albedo)  # fmt: skip
    with clock.timed(stage.timer, "composition"):
        passes.compose(stage, "reflected", "reflected", 2.0 ** (look.exposure - 1))  # one target, added to itself
    gl.check()


def release(plain: Plain) -> None:
    """Free what is not the stage's."""
    gl.free(plain.target, plain.head, plain.program, plain.albedo)
