"""Draws what Dear ImGui has laid out, with moderngl: one program, and the textures that ImGui asks for."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, field

import moderngl
import numpy as np
from imgui_bundle import imgui

from .. import gl


@dataclass
class Overlay:
    """The program, and ImGui's textures by their OpenGL name."""

    program: moderngl.Program
    textures: dict[int, moderngl.Texture] = field(default_factory=dict)


def open_overlay() -> Overlay:
    """ImGui's context and the program that draws it; `close` ends both."""
    imgui.create_context()
    io = imgui.get_io()
    io.backend_flags |= imgui.BackendFlags_.renderer_has_textures
    io.set_ini_filename("")  # leave no file in the user's folder
    return Overlay(gl.context().program(gl.splice("panel.vert.glsl"), gl.splice("panel.frag.glsl")))


def close(overlay: Overlay) -> None:
    """Free what the overlay holds."""
    gl.free(overlay.program, *overlay.textures.values())
    overlay.textures.clear()
    imgui.destroy_context()


def begin(size: tuple[float, float], scale: float, seconds: float) -> None:
    """Start a frame of a window of that size in its own units, `scale` pixels each, so long after the last."""
    io = imgui.get_io()
    io.display_size = size
    io.display_framebuffer_scale = (scale, scale)
    io.delta_time = max(seconds, 1e-4)
    imgui.new_frame()


def render(overlay: Overlay, target: moderngl.Framebuffer, scale: float) -> None:
    """Draw the frame into a target."""
    imgui.render()
    data = imgui.get_draw_data()
    for texture in imgui.get_platform_io().textures:
        _texture(overlay, texture)
    context = gl.context()
    target.use()
    target.viewport = (0, 0, *target.size)
    context.enable_only(moderngl.BLEND)
    context.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
    gl.put(overlay.program, size=(target.width / scale, target.height / scale), glyphs=0)
    for drawn in data.cmd_lists:
        vertices, indices = _buffer(drawn.vtx_buffer, imgui.VERTEX_SIZE), _buffer(drawn.idx_buffer, imgui.INDEX_SIZE)
        content = [(vertices, "2f 2f 4f1", "position", "uv", "color")]
        array = context.vertex_array(overlay.program, content, indices, index_element_size=imgui.INDEX_SIZE)
        for command in drawn.cmd_buffer:
            left, top, right, bottom = (v * scale for v in command.clip_rect)
            target.scissor = int(left), int(target.height - bottom), int(right - left), int(bottom - top)
            overlay.textures[command.get_tex_id()].use(0)
            array.render(moderngl.TRIANGLES, command.elem_count, first=command.idx_offset)
        for thing in (array, vertices, indices):
            thing.release()
    target.scissor = None


def _buffer(held, size: int) -> moderngl.Buffer:
    raw = ctypes.string_at(held.data_address(), held.size() * size)
    return gl.context().buffer(raw or b"\0")


def _texture(overlay: Overlay, wanted) -> None:
    """Make, change or free one of ImGui's textures, as it asks."""
    status = imgui.ImTextureStatus
    if wanted.status in (status.want_create, status.want_updates):
        old = overlay.textures.pop(wanted.get_tex_id(), None)
        if old is not None:
            old.release()
        pixels = np.asarray(wanted.get_pixels_array(), "u1").tobytes()
        texture = gl.context().texture((wanted.width, wanted.height), 4, pixels)
        overlay.textures[texture.glo] = texture
        wanted.set_tex_id(texture.glo)
        wanted.set_status(status.ok)
    elif wanted.status == status.want_destroy:
        overlay.textures.pop(wanted.get_tex_id()).release()
        wanted.set_tex_id(0)
        wanted.set_status(status.destroyed)
