"""The window: a head that turns under the mouse and changes skin as the sliders move."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import glfw
import moderngl
import numpy as np
from imgui_bundle import imgui

from lutgen.errors import InputError, MachineError
from lutgen.scene import look as looks
from lutgen.scene.look import Look
from lutgen.skin.tissue import PRESETS

from .. import app, gl, passes
from ..stage import Stage, release, resize
from . import imgui_draw, panel, picking

KEYS = {
    glfw.KEY_BACKSPACE: imgui.Key.backspace, glfw.KEY_DELETE: imgui.Key.delete, glfw.KEY_ENTER: imgui.Key.enter,
    glfw.KEY_LEFT: imgui.Key.left_arrow, glfw.KEY_RIGHT: imgui.Key.right_arrow, glfw.KEY_HOME: imgui.Key.home,
    glfw.KEY_END: imgui.Key.end, glfw.KEY_TAB: imgui.Key.tab, glfw.KEY_ESCAPE: imgui.Key.escape,
    glfw.KEY_A: imgui.Key.a, glfw.KEY_LEFT_CONTROL: imgui.Key.mod_ctrl, glfw.KEY_LEFT_SHIFT: imgui.Key.mod_shift,
}  # fmt: skip
"""Keys that a text field needs."""
AWAKE = 4
"""Frames that the panel takes to settle after an event."""


@dataclass
class State:
    """What the window knows between frames."""

    look: Look
    start: Look
    stage: Stage
    notes: tuple[str, ...]
    panel: panel.Panel = field(default_factory=panel.Panel)
    mouse: tuple[float, float] = (0.0, 0.0)
    dragging: bool = False
    drawn: Look | None = None
    frames: int = 0
    awake: int = AWAKE


def run(
    opened: Callable[[tuple[int, int]], Stage], look: Look, size: tuple[int, int], notes: tuple[str, ...] = ()
) -> Look:
    """Open a window whose picture has that size, until it is closed; the look at its end.

    `opened` makes the stage of a size in pixels. Raises MachineError where there is no display or no OpenGL 3.3.
    """
    window = _open((size[0] + panel.WIDTH, size[1]))
    try:
        try:
            gl.adopt(moderngl.create_context(require=330))
        except Exception as error:  # moderngl raises plain Exception
            raise MachineError(f"no OpenGL 3.3 ({' '.join(str(error).split())}); {gl.INSTALL_HINT}") from error
        state = State(look, look, opened(size), notes)
        drawer, copy = imgui_draw.open_overlay(), gl.full_screen("copy.frag.glsl")
        _listen(window, state)
        since = time.perf_counter()
        while not glfw.window_should_close(window):
            waiting = state.awake or state.drawn != state.look or state.frames < passes.frames(state.look)
            glfw.poll_events() if waiting else glfw.wait_events_timeout(0.5)
            now = time.perf_counter()
            _frame(window, state, drawer, copy, now - since)
            since = now
            glfw.swap_buffers(window)
        imgui_draw.close(drawer)
        release(state.stage)
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
        (glfw.SCALE_TO_MONITOR, True),
    ):  # fmt: skip
        glfw.window_hint(hint, value)
    window = glfw.create_window(*size, "lutgen", None, None)
    if not window:
        glfw.terminate()
        raise MachineError(f"no window with OpenGL 3.3 ({'; '.join(failures)}); {gl.INSTALL_HINT}")
    glfw.make_context_current(window)
    glfw.swap_interval(1)
    return window


def _scale(window) -> tuple[float, float]:
    """Pixels per unit of the panel, and panel units per unit of the window: a monitor of many dots has large units."""
    scale = max(glfw.get_window_content_scale(window)[0], 1.0)
    return scale, glfw.get_framebuffer_size(window)[0] / max(glfw.get_window_size(window)[0], 1) / scale


def _frame(window, state: State, drawer: imgui_draw.Overlay, copy: gl.Pass, seconds: float) -> None:
    """Lay out the panel, draw the head if anything changed, and show both."""
    pixels, scale = glfw.get_framebuffer_size(window), _scale(window)[0]
    left = round(panel.WIDTH * scale)
    size = pixels[0] - left, pixels[1]
    if min(size) < 16:
        return
    imgui_draw.begin((pixels[0] / scale, pixels[1] / scale), scale, seconds)
    picked = None
    if state.panel.picking and state.drawn:
        x, y = state.mouse
        picked = picking.pick(state.stage, state.drawn, int(x * scale - left), int(y * scale))
    before = state.look
    state.look = panel.build(state.panel, state.look, state.stage, state.notes, pixels[1] / scale, picked,
                             lambda path: app.write(passes.pixels(state.stage), path))  # fmt: skip
    state.awake = AWAKE if state.look != before else max(state.awake - 1, 0)
    if state.stage.size != size:
        resize(state.stage, size)
        state.drawn = None
    if state.drawn != state.look:
        try:
            passes.require(state.stage, state.look)
        except InputError as error:
            if state.drawn is None and state.look == state.start:
                raise
            state.panel.said, state.look = str(error), state.drawn or state.start
        state.drawn, state.frames = state.look, 0
    if state.frames < passes.frames(state.look):
        passes.draw(state.stage, state.look, state.frames)
        state.frames += 1
    screen = gl.context().screen
    screen.use()
    screen.viewport = (left, 0, *size)
    gl.context().enable_only(moderngl.NOTHING)
    gl.bind(copy.program, frame=state.stage.targets["pixels"])
    copy.array.render()
    imgui_draw.render(drawer, screen, scale)


def _listen(window, state: State) -> None:
    """Hand the mouse and keyboard to the panel, or else to the camera."""
    io = imgui.get_io()

    def held(*keys: int) -> bool:
        return any(glfw.get_key(window, key) == glfw.PRESS for key in keys)

    def moved(_, x: float, y: float) -> None:
        state.awake = AWAKE
        x, y = (v * _scale(window)[1] for v in (x, y))
        io.add_mouse_pos_event(x, y)
        dx, dy = x - state.mouse[0], y - state.mouse[1]
        state.mouse = x, y
        if not state.dragging:
            return
        left, right = (glfw.get_mouse_button(window, b) for b in (glfw.MOUSE_BUTTON_LEFT, glfw.MOUSE_BUTTON_RIGHT))
        if right or (left and held(glfw.KEY_LEFT_SHIFT, glfw.KEY_RIGHT_SHIFT)):
            state.look = panned(state.look, dx, dy, state.stage.size[1] / _scale(window)[0])
        elif left and held(glfw.KEY_LEFT_CONTROL, glfw.KEY_RIGHT_CONTROL):
            state.look = relit(state.look, dx, dy)
        elif left:
            state.look = turned(state.look, dx, dy)

    def pressed(_, button: int, action: int, modifiers: int) -> None:
        state.awake = AWAKE
        if button < 3:
            io.add_mouse_button_event(button, action == glfw.PRESS)
            state.dragging = action == glfw.PRESS and state.mouse[0] >= panel.WIDTH

    def scrolled(_, dx: float, dy: float) -> None:
        state.awake = AWAKE
        io.add_mouse_wheel_event(dx, dy)
        if state.mouse[0] >= panel.WIDTH:
            state.look = zoomed(state.look, dy)

    def typed(_, code: int) -> None:
        state.awake = AWAKE
        io.add_input_character(code)
        if not io.want_text_input:
            shortcut(state, chr(code).lower())

    def key(_, code: int, scan: int, action: int, modifiers: int) -> None:
        state.awake = AWAKE
        if code == glfw.KEY_ESCAPE and action == glfw.PRESS and not io.want_text_input:
            glfw.set_window_should_close(window, True)
        if code in KEYS:
            io.add_key_event(KEYS[code], action != glfw.RELEASE)

    def woken(*_) -> None:
        state.awake = AWAKE

    glfw.set_cursor_pos_callback(window, moved)
    glfw.set_mouse_button_callback(window, pressed)
    glfw.set_scroll_callback(window, scrolled)
    glfw.set_char_callback(window, typed)
    glfw.set_key_callback(window, key)
    glfw.set_framebuffer_size_callback(window, woken)
    glfw.set_window_refresh_callback(window, woken)


def _around(degrees: float) -> float:
    return (degrees + 180) % 360 - 180


def turned(look: Look, dx: float, dy: float) -> Look:
    """The look after a drag of so many pixels, the head following the mouse."""
    return replace(
        look, azimuth=_around(look.azimuth - 0.4 * dx), elevation=float(np.clip(look.elevation + 0.4 * dy, -89, 89))
    )


def relit(look: Look, dx: float, dy: float) -> Look:
    """The look after its light was dragged."""
    elevation = float(np.clip(look.light_elevation - 0.4 * dy, -90, 90))
    return replace(look, light_azimuth=_around(look.light_azimuth + 0.4 * dx), light_elevation=elevation)


def panned(look: Look, dx: float, dy: float, height: float) -> Look:
    """The look after its target moved with the mouse in the picture's plane."""
    view = looks.camera(look, 16, 16).view
    mm = 2 * look.distance_mm * np.tan(np.radians(look.field_of_view) / 2) / height
    target = np.array(look.target_mm) - mm * (dx * view[0, :3] - dy * view[1, :3])
    return replace(look, target_mm=tuple(float(v) for v in np.clip(target, -1000, 1000)))


def zoomed(look: Look, steps: float) -> Look:
    """The look after the wheel came so many steps nearer."""
    return replace(look, distance_mm=float(np.clip(look.distance_mm * 0.9**steps, *looks.RANGES["distance_mm"])))


def shortcut(state: State, letter: str) -> None:
    """What a key does; `panel.SHORTCUTS` lists them."""
    look = state.look
    if letter in ("1", "2", "3", "4", "5"):
        state.look = replace(look, tier=looks.TIERS[int(letter) - 1])
    elif letter == "s":
        order = panel.splits(state.stage)
        state.look = replace(look, split=order[(order.index(look.split) + 1) % len(order)])
    elif letter == "p":
        names, now = list(PRESETS), [(s.melanin, s.eumelanin, s.hemoglobin) for s in PRESETS.values()]
        here = look.melanin, look.eumelanin, look.hemoglobin
        state.look = looks.of_preset(names[(now.index(here) + 1) % len(names) if here in now else 0], look)
    elif letter == "k":
        state.panel.picking = not state.panel.picking
    elif letter == "r":
        state.look = state.start
    elif letter == "?":
        state.panel.shortcuts = not state.panel.shortcuts
