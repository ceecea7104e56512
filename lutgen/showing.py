"""What `lutgen view` and `lutgen sheet` do: options in, a window or a picture out."""

from __future__ import annotations

import importlib
from argparse import Namespace
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from types import ModuleType

import lutgen
from lutgen import manifest, scene
from lutgen.errors import InputError, MachineError, one_of
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


def _opener(options: Namespace, app: ModuleType, look: Look) -> tuple[Callable, tuple[str, ...]]:
    """What opens the stage that the options describe at a size in pixels, and what is to be said about its head."""
    luts = lutgen.load() if options.dir is None else manifest.load(Path(options.dir))
    other = None if options.compare is None else manifest.load(Path(options.compare))
    one_of("albedo", options.albedo, app.ALBEDO)
    around = app.surroundings_of(options.environment, options.normalize_environment)
    shape, given = app.model(options.mesh, options.mm_per_unit, options.maps, options.flip_v)
    more = ()
    if options.albedo == "invert":
        given, more = app.inverted(luts, given, look.eumelanin)
    credit = () if shape.attribution in ("", "built-in") else (shape.attribution,)
    return partial(app.open_stage, luts, shape, given, other=other, around=around), (*shape.notes, *more, *credit)


def view(options: Namespace) -> Outcome:
    """Open a window, or draw one picture."""
    look, app = look_of(options), _viewer("app")
    size = app.size_of(options.size or PICTURE_SIZE)
    opened, notes = _opener(options, app, look)
    if options.screenshot is None:
        look = _viewer("window").run(opened, look, size, notes)
        return {"look": asdict(look), "notes": list(notes)}, "\n".join(notes) or "closed", 0
    app.write(app.picture(opened(size), look), options.screenshot)
    said = {"screenshot": options.screenshot, "size": list(size), "look": asdict(look), "notes": list(notes)}
    return said, "\n".join([f"{options.screenshot}: {size[0]} x {size[1]}", *notes]), 0


def sheet(options: Namespace) -> Outcome:
    """Draw every preset beside the others."""
    look, app = look_of(options), _viewer("app")
    size = app.size_of(options.size or SHEET_SIZE)
    opened, notes = _opener(options, app, look)
    pixels = app.sheet(opened(size), look)
    app.write(pixels, options.out)
    said = {"sheet": options.out, "presets": list(scene.PRESETS), "notes": list(notes)}
    shown = f"{options.out}: {pixels.shape[1]} x {pixels.shape[0]}, {len(scene.PRESETS)} presets"
    return said, "\n".join([shown, *notes]), 0
