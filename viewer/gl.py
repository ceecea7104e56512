"""OpenGL without a window: one context per process, shaders spliced from files, passes over the whole screen."""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import moderngl
import numpy as np

from lutgen.errors import MachineError

INSTALL_HINT = "on Debian or Ubuntu: apt-get install -y libegl1 libgl1-mesa-dri"
ANISOTROPY = 2.0
_CONTEXTS: list[moderngl.Context] = []
_DEFAULT: list[moderngl.Framebuffer] = []


def context() -> moderngl.Context:
    """The process's OpenGL context, made without a window at the first call; MachineError where there is no OpenGL."""
    if not _CONTEXTS:
        try:
            backend = {"backend": "egl"} if sys.platform.startswith("linux") else {}  # elsewhere the system's own
            _CONTEXTS.append(moderngl.create_context(standalone=True, require=330, **backend))
        except Exception as error:  # moderngl and its loaders raise plain Exception
            raise MachineError(f"no OpenGL 3.3 ({' '.join(str(error).split())}); {INSTALL_HINT}") from error
    return _CONTEXTS[0]


def adopt(windowed: moderngl.Context) -> None:
    """Make a window's context the process's own; a second one would silently read zeros from the first."""
    if _CONTEXTS and _CONTEXTS[0] is not windowed:
        raise MachineError("an OpenGL context exists already; open the window first")
    _CONTEXTS[:] = [windowed]


@cache
def text(name: str) -> str:
    """The text of a file of viewer/shaders."""
    return (files("lutgen.viewer") / "shaders" / name).read_text()


def splice(name: str, texts: dict[str, str] | None = None) -> str:
    """A shader with its `#include "…"` lines replaced by files, or by `texts` of their names."""

    def included(match: re.Match) -> str:
        other = match.group(1)
        return texts[other] if texts and other in texts else splice(other, texts)

    return re.sub(r'^#include "([^"]+)"$', included, text(name), flags=re.MULTILINE)


@dataclass(frozen=True)
class Pass:
    """A program that draws over the whole target."""

    program: moderngl.Program
    array: moderngl.VertexArray
    corners: moderngl.Buffer


def full_screen(fragment: str, texts: dict[str, str] | None = None) -> Pass:
    """A pass of one fragment shader; `screen` in it runs over 0 to 1."""
    gl = context()
    program = gl.program(vertex_shader=splice("screen.vert.glsl"), fragment_shader=splice(fragment, texts))
    corners = gl.buffer(np.array([-1, -1, 3, -1, -1, 3], "f4").tobytes())
    return Pass(program, gl.vertex_array(program, [(corners, "2f", "corner")]), corners)


def put(program: moderngl.Program, **values) -> None:
    """Set uniforms; a matrix [n, n] is given as rows. What the compiler removed is passed over."""
    for name, value in values.items():
        if name not in program:
            continue
        uniform = program[name]
        if isinstance(value, np.ndarray) and value.ndim == 2 and value.shape[0] == value.shape[1]:
            uniform.write(np.ascontiguousarray(value.T, "f4").tobytes())
        elif isinstance(value, np.ndarray):
            uniform.write(np.ascontiguousarray(value, "f4").tobytes())
        else:
            uniform.value = value


def bind(program: moderngl.Program, **textures) -> None:
    """Bind textures to the samplers of those names."""
    for unit, (name, texture) in enumerate(textures.items()):
        texture.use(unit)
        if name in program:
            program[name].value = unit


def texture(size: tuple[int, int], components: int = 4, kind: str = "f2", data: bytes | None = None):
    """A 2-D texture read texel by texel, its edges held."""
    texture = context().texture(size, components, data, dtype=kind, alignment=1)
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    texture.repeat_x = texture.repeat_y = False
    return texture


def levels(pictures: list[np.ndarray]):
    """A texture whose mip levels are given [rows, columns, 3], each half the size of the one before; wraps along x."""
    texture = context().texture(pictures[0].shape[1::-1], 3, dtype="f2")
    texture.build_mipmaps(0, len(pictures) - 1)
    for level, picture in enumerate(pictures):
        texture.write(np.minimum(picture, 65504).astype("f2").tobytes(), level=level, alignment=1)
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    texture.repeat_x, texture.repeat_y = True, False
    return texture


def table(values: np.ndarray) -> moderngl.Texture:
    """A float texture of an array [rows, columns, channels], read linearly between texel centers."""
    table = texture(values.shape[1::-1], values.shape[2], "f4", np.ascontiguousarray(values, "f4").tobytes())
    table.filter = (moderngl.LINEAR, moderngl.LINEAR)
    return table


def image(values: np.ndarray, anisotropy: float = ANISOTROPY) -> moderngl.Texture:
    """A filtered texture of an array [rows, columns, channels], 0 to 1 in 8 bits or floats."""
    if values.ndim == 2:
        values = values[..., None]
    kind = "f1" if values.dtype == np.uint8 else "f2"
    data = np.ascontiguousarray(values if kind == "f1" else values.astype("f2"))
    texture = context().texture(data.shape[1::-1], data.shape[2], data.tobytes(), alignment=1, dtype=kind)
    return filtered(texture, anisotropy)


def filtered(texture: moderngl.Texture, anisotropy: float = ANISOTROPY) -> moderngl.Texture:
    """A texture read with mip levels, and sharp where it is seen aslant."""
    texture.build_mipmaps()
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    texture.anisotropy = anisotropy
    return texture


def volume(values: np.ndarray):
    """A 3-D float texture of an array [depth, height, width, 4], read linearly between texel centers."""
    depth, height, width, components = values.shape
    volume = context().texture3d(
        (width, height, depth), components, np.ascontiguousarray(values, "f4").tobytes(), dtype="f4"
    )
    volume.filter = (moderngl.LINEAR, moderngl.LINEAR)
    volume.repeat_x = volume.repeat_y = volume.repeat_z = False
    return volume


def read(target: moderngl.Framebuffer, attachment: int = 0, kind: str = "f4", components: int = 4) -> np.ndarray:
    """Pixels [height, width, components] of a framebuffer, first row lowest."""
    width, height = target.size
    raw = target.read(components=components, attachment=attachment, dtype=kind, alignment=1)
    return np.frombuffer(raw, {"f4": "f4", "f1": "u1", "f2": "f2"}[kind]).reshape(height, width, components)


def free(*things) -> None:
    """Release OpenGL objects; a framebuffer in use is left first, for the next one would find it gone."""
    if not _DEFAULT:
        _DEFAULT.append(context().detect_framebuffer(0))
    _DEFAULT[0].use()
    for thing in things:
        thing.release()


def check() -> None:
    """Raise MachineError where OpenGL has an error pending."""
    error = context().error
    if error != "GL_NO_ERROR":
        raise MachineError(f"OpenGL: {error}")
