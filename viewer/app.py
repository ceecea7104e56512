"""A head, its maps and a LUT set to pictures, without a window."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

import numpy as np

from lutgen.errors import InputError, cannot_write
from lutgen.files import exr, folders
from lutgen.files.texture_maps import Maps
from lutgen.head.mesh import Mesh
from lutgen.scene import look as looks
from lutgen.scene import subject
from lutgen.scene.look import Look
from lutgen.tables.lut_set import LutSet

from . import passes
from .stage import Stage, set_environment, upload

SIZE = (1280, 720)


def open_stage(
    luts: LutSet, shape: Mesh, maps: Maps, size: tuple[int, int], other: LutSet | None = None,
    around: np.ndarray | None = None,
) -> Stage:  # fmt: skip
    """The stage of a head, its maps, a LUT set, maybe another to compare it with, and light from all around."""
    stage = upload(shape, subject.textures_of(maps), luts, size, other)
    stage.full_contrast_melanin = maps.full_contrast_melanin
    set_environment(stage, around)
    return stage


def picture(stage: Stage, look: Look) -> np.ndarray:
    """One frame as 8-bit sRGB [height, width, 3], first row on top."""
    passes.draw(stage, look)
    return passes.pixels(stage)


def screenshot(stage: Stage, look: Look, path: Path | str) -> None:
    """Draw a look and write it: to an EXR as radiance, before exposure and tone curve, else as the display shows it."""
    if Path(path).suffix.lower() != ".exr":
        return write(picture(stage, look), path)
    passes.draw(stage, look)
    light, skin = passes.radiance(stage)
    channels = exr.rgb(light.astype("f4")) | {"mask": skin.astype("f4")}
    with folders.whole_file("picture", path) as partial:
        exr.write(partial, [exr.Part("view", channels, {"look": asdict(look), "size": list(stage.size)})])


def sheet(stage: Stage, look: Look, columns: int = 3, progress: Callable = lambda name: None) -> np.ndarray:
    """Every preset beside the others, [rows x height, columns x width, 3], each with its name."""
    from PIL import Image, ImageDraw

    sheet_looks = looks.sheet_looks(look)
    width, height = stage.size
    rows = -(-len(sheet_looks) // columns)
    whole = Image.new("RGB", (columns * width, rows * height))
    for i, (name, preset) in enumerate(sheet_looks.items()):
        progress(name)
        frame = Image.fromarray(picture(stage, preset))
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
