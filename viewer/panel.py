"""The sliders beside the face, by Dear ImGui, and a small renderer for what it draws."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, field, replace
from pathlib import Path

import moderngl
import numpy as np
from imgui_bundle import imgui

from lutgen import scene
from lutgen.errors import InputError, MachineError
from lutgen.scene import Look
from lutgen.tissue import PRESETS

from . import gl
from .passes import TAPS, Stage

WIDTH = 300
SLIDERS = (
    ("melanin", "%.4f"), ("eumelanin", "%.2f"), ("hemoglobin", "%.4f"), ("oxygenation", "%.2f"), (None, ""),
    ("light", "%.2f"), ("light_azimuth", "%.0f"), ("light_elevation", "%.0f"), ("light_size", "%.1f"),
    ("environment", "%.2f"), (None, ""), ("roughness", "%.2f"), ("specular", "%.2f"), ("bumps", "%.2f"),
    ("transmission", "%.2f"), ("exposure", "%.2f"),
)  # fmt: skip
"""Values of a look that have a slider, and how each is shown."""
SHORTCUTS = (
    "left drag: turn", "right drag or shift: move", "wheel: nearer, farther", "1 to 5: scattering tier",
    "S: split view", "P: next preset", "R: start again", "?: this list", "Esc: close",
)  # fmt: skip


@dataclass
class Panel:
    """ImGui's renderer on the GPU, and what the panel itself remembers."""

    program: moderngl.Program
    textures: dict[int, moderngl.Texture] = field(default_factory=dict)
    path: str = "look.toml"
    said: str = ""
    shortcuts: bool = False
    milliseconds: float = 0.0


def open_panel() -> Panel:
    """ImGui's context and the program that draws it."""
    imgui.create_context()
    io = imgui.get_io()
    io.backend_flags |= imgui.BackendFlags_.renderer_has_textures | imgui.BackendFlags_.renderer_has_vtx_offset
    io.set_ini_filename("")
    program = gl.context().program(gl.splice("panel.vert.glsl"), gl.splice("panel.frag.glsl"))
    return Panel(program)


def close(panel: Panel) -> None:
    """Free what the panel holds."""
    gl.free(panel.program, *panel.textures.values())
    panel.textures.clear()
    imgui.destroy_context()


def build(panel: Panel, look: Look, stage: Stage, notes: tuple[str, ...], height: float) -> Look:
    """Lay out the panel of one frame; the look as the user has changed it."""
    imgui.set_next_window_pos((0, 0))
    imgui.set_next_window_size((WIDTH, height))
    flags = imgui.WindowFlags_.no_resize | imgui.WindowFlags_.no_move | imgui.WindowFlags_.no_collapse
    imgui.begin("lutgen", None, flags)
    look = _presets(look)
    imgui.push_item_width(150)
    for name, shown in SLIDERS:
        if name is None:
            imgui.separator()
            continue
        low, high = scene.RANGES[name]
        kind = imgui.SliderFlags_.logarithmic if name in ("melanin", "hemoglobin") else imgui.SliderFlags_.none
        moved, value = imgui.slider_float(name.replace("_", " "), getattr(look, name), low, high, shown, kind)
        if moved:
            look = replace(look, **{name: min(max(value, low), high)})
    imgui.separator()
    for name, allowed in (("tier", scene.TIERS), ("split", ("none", "scattering", "burley"))):
        moved, k = imgui.combo(name, allowed.index(getattr(look, name)), list(allowed))
        if moved:
            look = replace(look, **{name: allowed[k]})
    look = _file(panel, look)
    imgui.pop_item_width()
    imgui.separator()
    imgui.text(f"{panel.milliseconds:.1f} ms a frame, {TAPS[look.tier]} taps at most")
    imgui.text(f"LUT textures {stage.uploaded.bytes / 1e6:.2f} MB")
    for note in notes:
        imgui.text_wrapped(note)
    if panel.shortcuts:
        imgui.separator()
        for line in SHORTCUTS:
            imgui.text(line)
    else:
        imgui.text("? lists the shortcuts")
    imgui.end()
    return look


def _presets(look: Look) -> Look:
    for i, name in enumerate(PRESETS):
        if i % 3:
            imgui.same_line()
        if imgui.small_button(name):
            look = scene.of_preset(name, look)
    return look


def _file(panel: Panel, look: Look) -> Look:
    _, panel.path = imgui.input_text("file", panel.path)
    save = imgui.small_button("save look")
    imgui.same_line()
    load = imgui.small_button("load look")
    try:
        if save:
            scene.save(look, Path(panel.path))
            panel.said = f"saved {panel.path}"
        if load:
            look, panel.said = scene.load(Path(panel.path)), f"loaded {panel.path}"
    except (InputError, MachineError) as error:
        panel.said = str(error)
    if panel.said:
        imgui.text_wrapped(panel.said)
    return look


def render(panel: Panel, target: moderngl.Framebuffer, scale: float) -> None:
    """Draw what ImGui has laid out into a target; `scale` is target pixels per window unit."""
    imgui.render()
    data = imgui.get_draw_data()
    for texture in imgui.get_platform_io().textures:
        _texture(panel, texture)
    context = gl.context()
    target.use()
    context.enable_only(moderngl.BLEND)
    context.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
    gl.put(panel.program, size=(target.width / scale, target.height / scale), glyphs=0)
    for drawn in data.cmd_lists:
        vertices = _buffer(drawn.vtx_buffer, 20)
        indices = _buffer(drawn.idx_buffer, 2)
        array = context.vertex_array(
            panel.program, [(vertices, "2f 2f 4f1", "position", "uv", "color")], indices, index_element_size=2
        )
        for command in drawn.cmd_buffer:
            left, top, right, bottom = (v * scale for v in command.clip_rect)
            target.scissor = int(left), int(target.height - bottom), int(right - left), int(bottom - top)
            panel.textures[command.get_tex_id()].use(0)
            array.render(moderngl.TRIANGLES, command.elem_count, first=command.idx_offset)
        for thing in (array, vertices, indices):
            thing.release()
    target.scissor = None


def _buffer(held, size: int) -> moderngl.Buffer:
    raw = ctypes.string_at(held.data_address(), held.size() * size)
    return gl.context().buffer(raw or b"\0")


def _texture(panel: Panel, wanted) -> None:
    """Make, change or free one of ImGui's textures, as it asks."""
    status = imgui.ImTextureStatus
    if wanted.status in (status.want_create, status.want_updates):
        old = panel.textures.pop(wanted.get_tex_id(), None)
        if old is not None:
            old.release()
        pixels = np.asarray(wanted.get_pixels_array(), "u1").tobytes()
        made = gl.context().texture((wanted.width, wanted.height), 4, pixels)
        panel.textures[made.glo] = made
        wanted.set_tex_id(made.glo)
        wanted.set_status(status.ok)
    elif wanted.status == status.want_destroy:
        panel.textures.pop(wanted.get_tex_id()).release()
        wanted.set_tex_id(0)
        wanted.set_status(status.destroyed)
