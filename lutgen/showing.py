"""What `lutgen view` and `lutgen sheet` do: options in, a window or a picture out."""

from __future__ import annotations

import importlib
from argparse import Namespace
from dataclasses import asdict, dataclass
from pathlib import Path
from types import ModuleType

import lutgen
from lutgen import manifest, scene
from lutgen.errors import InputError, MachineError
from lutgen.lutset import LutSet
from lutgen.maps import Maps
from lutgen.mesh import Mesh
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


@dataclass(frozen=True)
class Scene:
    """What the options describe: LUT sets, a head, its maps, and what is to be said about it."""

    luts: LutSet
    other: LutSet | None
    shape: Mesh
    given: Maps
    said: tuple[str, ...]


def _scene(options: Namespace, app: ModuleType) -> Scene:
    luts = lutgen.load() if options.dir is None else manifest.load(Path(options.dir))
    other = None if options.compare is None else manifest.load(Path(options.compare))
    shape, given = app.model(options.mesh, options.mm_per_unit, options.maps)
    credit = () if shape.attribution in ("", "built-in") else (shape.attribution,)
    return Scene(luts, other, shape, given, (*shape.notes, *credit))


def view(options: Namespace) -> Outcome:
    """Open a window, or draw one picture."""
    look, app = look_of(options), _viewer("app")
    size = app.size_of(options.size or PICTURE_SIZE)
    one = _scene(options, app)
    if options.screenshot is None:
        look = _viewer("window").run(one.luts, one.shape, one.given, look, size, one.other, one.said)
        said = {"look": asdict(look), "notes": list(one.said)}
        return said, "\n".join(one.said) or "closed", 0
    app.write(app.picture(app.open_stage(one.luts, one.shape, one.given, size, one.other), look), options.screenshot)
    said = {"screenshot": options.screenshot, "size": list(size), "look": asdict(look), "notes": list(one.said)}
    return said, "\n".join([f"{options.screenshot}: {size[0]} x {size[1]}", *one.said]), 0


def sheet(options: Namespace) -> Outcome:
    """Draw every preset beside the others."""
    look, app = look_of(options), _viewer("app")
    size = app.size_of(options.size or SHEET_SIZE)
    one = _scene(options, app)
    pixels = app.sheet(app.open_stage(one.luts, one.shape, one.given, size, one.other), look)
    app.write(pixels, options.out)
    said = {"sheet": options.out, "presets": list(scene.PRESETS), "notes": list(one.said)}
    shown = f"{options.out}: {pixels.shape[1]} x {pixels.shape[0]}, {len(scene.PRESETS)} presets"
    return said, "\n".join([shown, *one.said]), 0
