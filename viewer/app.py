"""A head, its maps and a LUT set to pictures, without a window."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from lutgen import color, head, maps, mesh, painting, scene
from lutgen.errors import InputError, cannot_write
from lutgen.lutset import LutSet
from lutgen.maps import Maps
from lutgen.mesh import Mesh
from lutgen.scene import Look

from . import passes

SIZE = (1280, 720)
MAX_SIDE = 4096


def size_of(text: str) -> tuple[int, int]:
    """Width and height of `640x360`."""
    parts = text.lower().split("x")
    if len(parts) != 2 or not all(part.isdigit() for part in parts):
        raise InputError(f"size = {text!r}: width x height is needed, for example 640x360")
    width, height = (int(part) for part in parts)
    if not (16 <= width <= MAX_SIDE and 16 <= height <= MAX_SIDE):
        raise InputError(f"size = {text}: allowed is 16 to {MAX_SIDE} each way")
    return width, height


def model(name: str | None, mm_per_unit: float | None, folder: str | None) -> tuple[Mesh, Maps]:
    """The head and its maps: built-in without a name; maps from a folder, else painted where the head can be."""
    if name is None:
        shape = head.builtin()
        given = Maps(**painting.paint(shape)) if folder is None else maps.load(Path(folder))
        return shape, given
    shape = mesh.scan(name) if name in mesh.SCANS else mesh.load(Path(name), mm_per_unit)
    found = Maps(normal=_texture(shape, "normal"), albedo=_linear(_texture(shape, "albedo")))
    if folder is not None:
        more = maps.load(Path(folder))
        found = replace(found, **{k: v for k, v in vars(more).items() if v is not None})
    return shape, found


def _texture(shape: Mesh, name: str) -> np.ndarray | None:
    picture = shape.textures.get(name)
    return None if picture is None else np.ascontiguousarray(picture[..., :3])


def _linear(srgb: np.ndarray | None) -> np.ndarray | None:
    if srgb is None:
        return None
    v = srgb / 255.0
    return np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)


def detail(albedo: np.ndarray, coverage: float = 1e-3) -> np.ndarray:
    """What a painted albedo adds to a plain skin: its ratio to its own median, ACEScg [rows, columns, 3].

    Multiplied with the color of any skin it is `LutSet.recolor` with the painted skin's own mean as base: the detail
    stays, the tone is the sliders'.
    """
    acescg = np.maximum(color.from_xyz(albedo @ np.linalg.inv(color.SRGB_FROM_XYZ).T, "acescg"), 1e-4)
    painted = acescg.sum(axis=-1) > coverage * 3
    return np.clip(acescg / np.median(acescg[painted], axis=0), 0.05, 8)


def textures_of(given: Maps) -> dict[str, np.ndarray]:
    """The maps as the passes take them, four channels where they filter them together."""
    found = {"normal": given.normal, "chromophores": given.chromophores, "surface": given.surface}
    if given.albedo is not None:
        found["detail"] = detail(given.albedo)
    return {name: _shrunk(values) for name, values in found.items() if values is not None}


def _shrunk(values: np.ndarray, most: int = 4096) -> np.ndarray:
    step = -(-max(values.shape[:2]) // most)
    return np.ascontiguousarray(values[::step, ::step])


def open_stage(
    luts: LutSet, shape: Mesh, given: Maps, size: tuple[int, int], other: LutSet | None = None
) -> passes.Stage:
    """The stage of a head, its maps, a LUT set and maybe another to compare it with."""
    return passes.open_stage(shape, textures_of(given), luts, size, other)


def picture(stage: passes.Stage, look: Look) -> np.ndarray:
    """One frame as 8-bit sRGB [height, width, 3], first row on top."""
    passes.draw(stage, look)
    return passes.pixels(stage)


def sheet(stage: passes.Stage, look: Look, columns: int = 3, progress: Callable = lambda name: None) -> np.ndarray:
    """Every preset beside the others, [rows x height, columns x width, 3], each with its name."""
    from PIL import Image, ImageDraw

    looks = scene.sheet_looks(look)
    width, height = stage.size
    rows = -(-len(looks) // columns)
    whole = Image.new("RGB", (columns * width, rows * height))
    for i, (name, one) in enumerate(looks.items()):
        progress(name)
        frame = Image.fromarray(picture(stage, one))
        ImageDraw.Draw(frame).text((10, height - 20), name, fill=(220, 220, 220))
        whole.paste(frame, (i % columns * width, i // columns * height))
    return np.asarray(whole)


def write(pixels: np.ndarray, path: Path | str) -> None:
    """Write a picture in the format that its name says."""
    from PIL import Image

    try:
        Image.fromarray(np.ascontiguousarray(pixels)).save(path)
    except ValueError as error:
        raise InputError(f"{path}: the name of a picture is needed, for example out.png ({error})") from error
    except OSError as error:
        raise cannot_write("picture", path, error) from error
