"""What `lutgen view` and `lutgen sheet` do: options in, a picture out."""

from __future__ import annotations

import importlib
from argparse import Namespace
from dataclasses import asdict, replace
from pathlib import Path
from types import ModuleType

import numpy as np

import lutgen
from lutgen import manifest, scene
from lutgen.errors import InputError, MachineError, cannot_write, one_of
from lutgen.scene import Look

Outcome = tuple[dict, str, int]
SHEET_SIZE = "480x480"
PICTURE_SIZE = "1280x720"


def _viewer(module: str) -> ModuleType:
    """A module of the viewer, which needs packages that a bake does not."""
    try:
        return importlib.import_module(f"lutgen.viewer.{module}")
    except ImportError as error:
        if (error.name or "").startswith("lutgen"):
            raise
        raise MachineError(f'the viewer needs {error.name}, which is missing: pip install "lutgen[view]"') from error


def look_of(options: Namespace) -> Look:
    """The look that --look, --preset and --set give, in that order."""
    look = scene.load(Path(options.look)) if options.look else Look()
    if options.preset is not None:
        look = scene.of_preset(options.preset, look)
    values = {}
    for text in options.set:
        name, equals, value = text.partition("=")
        if not equals:
            raise InputError(f"--set {text}: NAME=VALUE is needed, for example melanin=0.05")
        values[name.strip().replace("-", "_")] = value.strip()
    return scene.changed(look, values)


def _stage(options: Namespace, look: Look, size: str):
    """The viewer's app, the stage that the options describe, and what is to be said about its head."""
    app, passes = _viewer("app"), _viewer("passes")
    pixels = app.size_of(options.size or size)
    luts = lutgen.load() if options.dir is None else manifest.load(Path(options.dir))
    one_of("albedo", options.albedo, app.ALBEDO)
    around = app.surroundings_of(options.environment, options.normalize_environment)
    shape, given = app.model(options.mesh, options.mm_per_unit, options.maps, options.flip_v)
    if options.albedo == "invert":
        given, more = app.inverted(luts, given, look.eumelanin)
        shape = replace(shape, notes=(*shape.notes, *more))
    stage = app.open_stage(luts, shape, given, pixels)
    passes.set_environment(stage, around)
    return app, stage, [*shape.notes, *([shape.attribution] if shape.attribution not in ("built-in", "") else [])]


def _write(pixels: np.ndarray, path: str) -> None:
    from PIL import Image

    try:
        Image.fromarray(pixels).save(path)
    except ValueError as error:
        raise InputError(f"{path}: the name of a picture is needed, for example out.png ({error})") from error
    except OSError as error:
        raise cannot_write("picture", path, error) from error


def view(options: Namespace) -> Outcome:
    """Draw one picture."""
    look = look_of(options)
    app, stage, said = _stage(options, look, PICTURE_SIZE)
    _write(app.picture(stage, look), options.screenshot)
    text = "\n".join([f"{options.screenshot}: {stage.size[0]} x {stage.size[1]}", *said])
    return {"screenshot": options.screenshot, "size": list(stage.size), "look": asdict(look), "notes": said}, text, 0


def sheet(options: Namespace) -> Outcome:
    """Draw every preset beside the others."""
    look = look_of(options)
    app, stage, said = _stage(options, look, SHEET_SIZE)
    pixels = app.sheet(stage, look)
    _write(pixels, options.out)
    text = "\n".join([f"{options.out}: {pixels.shape[1]} x {pixels.shape[0]}, {len(scene.PRESETS)} presets", *said])
    return {"sheet": options.out, "presets": list(scene.PRESETS), "notes": said}, text, 0
