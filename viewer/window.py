"""The window: a head that turns under the mouse and changes skin as the sliders move."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import glfw
import moderngl
import numpy as np
from imgui_bundle import imgui

from lutgen import scene
from lutgen.errors import MachineError
from lutgen.lutset import LutSet
from lutgen.maps import Maps
from lutgen.mesh import Mesh
from lutgen.scene import Look
from lutgen.tissue import PRESETS

from . import app, gl, panel, passes


@dataclass
class State:
    """What the window knows between frames."""

    look: Look
    start: Look
    stage: passes.Stage
    panel: panel.Panel
    notes: tuple[str, ...]
    mouse: tuple[float, float] = (0.0, 0.0)
    drawn: Look | None = None


def run(luts: LutSet, shape: Mesh, given: Maps, look: Look, size: tuple[int, int]) -> Look:
    """Open the window until it is closed; the look at its end. Raises MachineError where there is no display."""
    window = _open(size)
    try:
        gl.adopt(moderngl.create_context())
        pixels = glfw.get_framebuffer_size(window)
        notes = tuple(n for n in (*shape.notes, shape.attribution) if n)
        state = State(look, look, app.open_stage(luts, shape, given, pixels), panel.open_panel(), notes)
        copy = gl.full_screen("copy.frag.glsl")
        _listen(window, state)
        while not glfw.window_should_close(window):
            glfw.poll_events()
            _frame(window, state, copy)
            glfw.swap_buffers(window)
        panel.close(state.panel)
        passes.release(state.stage)
        gl.free(copy.array, copy.program, copy.corners)
        gl.check()
        return state.look
    finally:
        glfw.terminate()


def _open(size: tuple[int, int]):
    failures = []
    glfw.set_error_callback(lambda code, words: failures.append(words.decode() if isinstance(words, bytes) else words))
    if not glfw.init():
        raise MachineError(f"no display for a window ({'; '.join(failures)}); --screenshot FILE needs none")
    for hint, value in (
        (glfw.CONTEXT_VERSION_MAJOR, 3), (glfw.CONTEXT_VERSION_MINOR, 3),
        (glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE), (glfw.OPENGL_FORWARD_COMPAT, True),
    ):  # fmt: skip
        glfw.window_hint(hint, value)
    window = glfw.create_window(*size, "lutgen", None, None)
    if not window:
        glfw.terminate()
        raise MachineError(f"no OpenGL 3.3 window ({'; '.join(failures)}); {gl.INSTALL_HINT}")
    glfw.make_context_current(window)
    glfw.swap_interval(1)
    return window


def _frame(window, state: State, copy: gl.Pass) -> None:
    """Lay out the panel, draw the head if anything changed, and show both."""
    size, pixels = glfw.get_window_size(window), glfw.get_framebuffer_size(window)
    if min(*size, *pixels) < 16:
        return
    io = imgui.get_io()
    io.display_size = size
    io.delta_time = 1 / 60
    imgui.new_frame()
    state.look = panel.build(state.panel, state.look, state.stage, state.notes, size[1])
    if state.stage.size != pixels:
        passes.resize(state.stage, pixels)
        state.drawn = None
    if state.drawn != state.look:
        since = time.perf_counter()
        passes.draw(state.stage, state.look)
        gl.context().finish()
        state.panel.milliseconds = 1000 * (time.perf_counter() - since)
        state.drawn = state.look
    screen = gl.context().screen
    screen.use()
    screen.viewport = (0, 0, *pixels)
    gl.context().enable_only(moderngl.NOTHING)
    state.stage.targets["pixels"].use(0)
    copy.array.render()
    panel.render(state.panel, screen, pixels[0] / size[0])


def _listen(window, state: State) -> None:
    """Hand the mouse and keyboard to the panel, or else to the camera."""

    def moved(_, x: float, y: float) -> None:
        imgui.get_io().add_mouse_pos_event(x, y)
        dx, dy = x - state.mouse[0], y - state.mouse[1]
        state.mouse = x, y
        if imgui.get_io().want_capture_mouse:
            return
        held = [glfw.get_mouse_button(window, b) for b in (glfw.MOUSE_BUTTON_LEFT, glfw.MOUSE_BUTTON_RIGHT)]
        shift = glfw.get_key(window, glfw.KEY_LEFT_SHIFT) == glfw.PRESS
        if held[1] or (held[0] and shift):
            state.look = panned(state.look, dx, dy, glfw.get_window_size(window)[1])
        elif held[0]:
            state.look = turned(state.look, dx, dy)

    def pressed(_, button: int, action: int, modifiers: int) -> None:
        if button < 3:
            imgui.get_io().add_mouse_button_event(button, action == glfw.PRESS)

    def scrolled(_, dx: float, dy: float) -> None:
        imgui.get_io().add_mouse_wheel_event(dx, dy)
        if not imgui.get_io().want_capture_mouse:
            low, high = scene.RANGES["distance_mm"]
            state.look = replace(state.look, distance_mm=min(max(state.look.distance_mm * 0.9**dy, low), high))

    def typed(_, code: int) -> None:
        imgui.get_io().add_input_character(code)
        if not imgui.get_io().want_capture_keyboard:
            shortcut(state, chr(code).lower())

    def key(_, code: int, scan: int, action: int, modifiers: int) -> None:
        if code == glfw.KEY_ESCAPE and action == glfw.PRESS:
            glfw.set_window_should_close(window, True)
        if code == glfw.KEY_BACKSPACE:
            imgui.get_io().add_key_event(imgui.Key.backspace, action != glfw.RELEASE)

    glfw.set_cursor_pos_callback(window, moved)
    glfw.set_mouse_button_callback(window, pressed)
    glfw.set_scroll_callback(window, scrolled)
    glfw.set_char_callback(window, typed)
    glfw.set_key_callback(window, key)


def turned(look: Look, dx: float, dy: float) -> Look:
    """The look after a drag of so many pixels, the head following the mouse."""
    azimuth = (look.azimuth - 0.4 * dx + 180) % 360 - 180
    return replace(look, azimuth=azimuth, elevation=float(np.clip(look.elevation + 0.4 * dy, -89, 89)))


def panned(look: Look, dx: float, dy: float, height: int) -> Look:
    """The look after its target moved with the mouse in the picture's plane."""
    view = scene.camera(look, 16, 16).view
    mm = 2 * look.distance_mm * np.tan(np.radians(look.field_of_view) / 2) / height
    target = np.array(look.target_mm) - mm * (dx * view[0, :3] - dy * view[1, :3])
    return replace(look, target_mm=tuple(float(v) for v in np.clip(target, -1000, 1000)))


def shortcut(state: State, letter: str) -> None:
    """What a key does; `panel.SHORTCUTS` lists them."""
    if letter in "12345":
        state.look = replace(state.look, tier=scene.TIERS[int(letter) - 1])
    elif letter == "s":
        order = ("none", "scattering", "burley")
        split = order[(order.index(state.look.split) + 1) % 3] if state.look.split in order else "none"
        state.look = replace(state.look, split=split)
    elif letter == "p":
        names = list(PRESETS)
        now = [(s.melanin, s.hemoglobin) for s in PRESETS.values()]
        here = (state.look.melanin, state.look.hemoglobin)
        state.look = scene.of_preset(names[(now.index(here) + 1) % len(names) if here in now else 0], state.look)
    elif letter == "r":
        state.look = state.start
    elif letter == "?":
        state.panel.shortcuts = not state.panel.shortcuts
