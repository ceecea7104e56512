"""What `lutgen view`, `sheet` and `bench --viewer` do: options in, a window, a picture or its cost out."""

from __future__ import annotations

import contextlib
from argparse import Namespace
from collections.abc import Callable, Iterator
from dataclasses import asdict
from functools import partial
from pathlib import Path
from types import ModuleType

import numpy as np

import lutgen
from lutgen.commands import Outcome
from lutgen.errors import InputError, one_of
from lutgen.files.texture_maps import Maps
from lutgen.head.mesh import Mesh
from lutgen.scene import look as looks
from lutgen.scene import subject, viewer
from lutgen.scene.look import Look
from lutgen.tables import storage
from lutgen.tables.lut_set import LutSet

SHEET_SIZE = "480x480"
PICTURE_SIZE = "1280x720"
TIMED_SIZE = "640x360"


def look_of(options: Namespace) -> Look:
    """The look that --look, --preset and --set give, in that order."""
    look = looks.load(Path(options.look)) if options.look else Look()
    if options.preset is not None:
        look = looks.of_preset(options.preset, look)
    values = {}
    for text in options.set:
        name, equals, value = text.partition("=")
        if not equals:
            raise InputError(f"--set {text}: NAME=VALUE is needed, for example melanin=0.05")
        values[name.strip().replace("-", "_")] = value.strip()
    return looks.changed(look, values)


def shown_of(options: Namespace, look: Look) -> tuple[LutSet, Mesh, Maps, np.ndarray | None, tuple[str, ...]]:
    """What the options describe: LUT set, head, maps, light from all around, and what is to be said about the head."""
    luts = lutgen.load() if options.dir is None else storage.load(Path(options.dir))
    one_of("albedo", options.albedo, subject.ALBEDO)
    around = subject.surroundings_of(options.environment, options.normalize_environment)
    shape, given = subject.model(options.mesh, options.mm_per_unit, options.maps, options.flip_v)
    more = ()
    if options.albedo == "invert":
        given, more = subject.inverted(luts, given, look.eumelanin)
    credit = () if shape.attribution in ("", "built-in") else (shape.attribution,)
    return luts, shape, given, around, (*shape.notes, *more, *credit)


def _opener(options: Namespace, app: ModuleType, look: Look) -> tuple[Callable, tuple[str, ...]]:
    """What opens the stage that the options describe at a size in pixels, and what is to be said about its head."""
    other = None if options.compare is None else storage.load(Path(options.compare))
    luts, shape, given, around, notes = shown_of(options, look)
    return partial(app.open_stage, luts, shape, given, other=other, around=around), notes


@contextlib.contextmanager
def _stage(opened: Callable, size: tuple[int, int]) -> Iterator:
    """A stage of a size in pixels, freed in the end."""
    stage = opened(size)
    try:
        yield stage
    finally:
        viewer.viewer("stage").release(stage)


def view(options: Namespace) -> Outcome:
    """Open a window, or draw one picture."""
    look, app = look_of(options), viewer.viewer("app")
    size = subject.size_of(options.size or PICTURE_SIZE)
    opened, notes = _opener(options, app, look)
    if options.screenshot is None:
        look = viewer.viewer("window.window").run(opened, look, size, notes)
        return {"look": asdict(look), "notes": list(notes)}, "\n".join(notes) or "closed", 0
    with _stage(opened, size) as stage:
        app.screenshot(stage, look, options.screenshot)
    said = {"screenshot": options.screenshot, "size": list(size), "look": asdict(look), "notes": list(notes)}
    return said, "\n".join([f"{options.screenshot}: {size[0]} x {size[1]}", *notes]), 0


def sheet(options: Namespace) -> Outcome:
    """Draw every preset beside the others."""
    look, app = look_of(options), viewer.viewer("app")
    size = subject.size_of(options.size or SHEET_SIZE)
    opened, notes = _opener(options, app, look)
    with _stage(opened, size) as stage:
        pixels = app.sheet(stage, look)
    app.write(pixels, options.out)
    said = {"sheet": options.out, "presets": list(looks.PRESETS), "notes": list(notes)}
    shown = f"{options.out}: {pixels.shape[1]} x {pixels.shape[0]}, {len(looks.PRESETS)} presets"
    return said, "\n".join([shown, *notes]), 0


def bench(options: Namespace) -> Outcome:
    """Time the built-in head: milliseconds by pass and tier, and over the same head without LUT and scattering."""
    timing = viewer.viewer("measure.timing")
    size = subject.size_of(options.size or TIMED_SIZE)
    result = timing.report(lutgen.load(), *subject.model(None, None, None), size)
    return result, _table(result), 0


def _table(result: dict) -> str:
    """The figures of `bench` as text."""
    width, height = result["size"]
    passes = list(next(iter(result["tiers"].values()))["milliseconds"])
    lines = [
        f"{result['renderer']}, {width} x {height}, medians of {result['rounds']} rounds in turn, milliseconds",
        f"{'':10}{'taps':>8}" + "".join(f"{name:>13}" for name in (*passes, "frame")) + f"{'over plain':>13}",
    ]
    for cost in (result["plain"], *result["tiers"].values()):
        taps = f"{cost['frames']} x {cost['taps']}" if cost["frames"] > 1 else f"{cost['taps']}"
        times = [cost["milliseconds"].get(name) for name in passes] + [cost["total"]]
        cells = "".join(f"{'-':>13}" if ms is None else f"{ms:13.1f}" for ms in times)
        lines.append(f"{cost['name']:10}{taps:>8}{cells}{cost['ratio']:13.2f}")
    lines.append(
        f"plain: the same head with a color texture, no LUT, no scattering; another oxygenation reaches the GPU in "
        f"{result['oxygenation_ms']:.1f} ms; LUT textures {result['lut_bytes'] / 1e6:.2f} MB"
    )
    return "\n".join(lines)
