"""What `lutgen view`, `sheet` and `bench --viewer` do: options in, a window, a picture or its cost out."""

from __future__ import annotations

import contextlib
from argparse import Namespace
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from types import ModuleType

import lutgen
from lutgen import extras, manifest, scene
from lutgen.errors import InputError
from lutgen.lutset import LutSet
from lutgen.maps import Maps
from lutgen.mesh import Mesh
from lutgen.scene import Look

Outcome = tuple[dict, str, int]
SHEET_SIZE = "480x480"
PICTURE_SIZE = "1280x720"
TIMED_SIZE = "640x360"


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


@contextlib.contextmanager
def _stage(one: Scene, app: ModuleType, size: tuple[int, int]) -> Iterator:
    """The stage of a scene, freed in the end."""
    stage = app.open_stage(one.luts, one.shape, one.given, size, one.other)
    try:
        yield stage
    finally:
        extras.viewer("passes").release(stage)


def view(options: Namespace) -> Outcome:
    """Open a window, or draw one picture."""
    look, app = look_of(options), extras.viewer("app")
    size = app.size_of(options.size or PICTURE_SIZE)
    one = _scene(options, app)
    if options.screenshot is None:
        look = extras.viewer("window").run(one.luts, one.shape, one.given, look, size, one.other, one.said)
        said = {"look": asdict(look), "notes": list(one.said)}
        return said, "\n".join(one.said) or "closed", 0
    with _stage(one, app, size) as stage:
        app.write(app.picture(stage, look), options.screenshot)
    said = {"screenshot": options.screenshot, "size": list(size), "look": asdict(look), "notes": list(one.said)}
    return said, "\n".join([f"{options.screenshot}: {size[0]} x {size[1]}", *one.said]), 0


def sheet(options: Namespace) -> Outcome:
    """Draw every preset beside the others."""
    look, app = look_of(options), extras.viewer("app")
    size = app.size_of(options.size or SHEET_SIZE)
    one = _scene(options, app)
    with _stage(one, app, size) as stage:
        pixels = app.sheet(stage, look)
    app.write(pixels, options.out)
    said = {"sheet": options.out, "presets": list(scene.PRESETS), "notes": list(one.said)}
    shown = f"{options.out}: {pixels.shape[1]} x {pixels.shape[0]}, {len(scene.PRESETS)} presets"
    return said, "\n".join([shown, *one.said]), 0


def bench(options: Namespace) -> Outcome:
    """Time the built-in head: milliseconds by pass and tier, and over the same head without LUT and scattering."""
    app, timing = extras.viewer("app"), extras.viewer("timing")
    size = app.size_of(options.size or TIMED_SIZE)
    result = timing.report(lutgen.load(), *app.model(None, None, None), size)
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
