"""What `lutgen render` does: a head by Monte Carlo into an OpenEXR file that grows better while it runs."""

from __future__ import annotations

import contextlib
import hashlib
import signal
import time
from argparse import Namespace
from collections.abc import Callable, Iterator
from dataclasses import asdict
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path

import numpy as np

from lutgen.commands import Outcome
from lutgen.commands.pictures import look_of, shown_of
from lutgen.commands.progress import Progress
from lutgen.errors import InputError, one_of, whole
from lutgen.files import folders
from lutgen.files.texture_maps import Maps
from lutgen.scene import subject
from lutgen.scene.look import Look
from lutgen.solvers.paths import SEEDS

SIZE = "512x512"
INTERRUPTED = 130
_ODD = 0.01
"""Share of back faces that is said."""
_NOT_SEEN = ("tier", "split", "transmission", "exposure")
"""Values of a look that a render does not depend on."""


def render(options: Namespace) -> Outcome:
    """`lutgen render`: sample until --spp, --time or --noise, go on where the same command stopped before."""
    from lutgen import device as ocl
    from lutgen.head import soundness
    from lutgen.render import device_scene, film, flat_walk, progressive

    since = time.perf_counter()
    goal = progressive.goal_of(options.spp, options.time, options.noise)
    one_of("walk", options.walk, tuple(flat_walk.WALKS))
    seed, size = whole("seed", options.seed, *SEEDS), subject.size_of(options.size or SIZE)
    look, out = look_of(options), folders.check_file("out", options.out, ".exr")
    if options.png is not None:
        folders.check_file("png", options.png, ".png")
    device = ocl.choose(options.device)
    luts, shape, given, around, notes = shown_of(options, look)
    shape, more = soundness.mended(shape)
    notes = (*notes, *more)
    recipe = {
        "lutgen": version("lutgen"), "walk": options.walk, "size": list(size), "seed": seed, "kernels": _kernels(),
        "look": {name: value for name, value in asdict(look).items() if name not in _NOT_SEEN},
        "luts": {name: luts.manifest[name] for name in ("trace", "recipe", "extra_absorbers_per_mm")},
        "head": _hash(shape.positions_mm, shape.normals, shape.uv, shape.triangles), "maps": _hash_of(given),
        "environment": "studio" if around is None else _hash(around),
    }  # fmt: skip
    before = None if options.force or not out.exists() else _same(film.read(out), recipe, out)
    seconds = {"head": time.perf_counter() - since}
    with Progress(quiet=options.json) as progress, _interruptible() as stopped:
        opened = _timed(seconds, "tree", lambda: device_scene.open_stage(
            device, luts, shape, given, look, size, around, seed))  # fmt: skip
        walk = _timed(seconds, "exits", lambda: flat_walk.WALKS[options.walk](opened, seed))
        notes = (*notes, *walk.facts.get("notes", ()))
        facts = {"recipe": recipe, "walk": walk.facts, "notes": list(notes), "device": device.name}
        start = film.empty(size, walk.group, facts) if before is None else before

        def save(made: film.Picture, noise: float) -> None:
            """Write what there is so far."""
            film.write(made, out)
            if options.png:
                _write_png(made, look, options.png)

        progress("render", None)
        made, tally, noise = progressive.render(
            opened, walk, start, goal, save, stopped, progress, look.exposure
        )  # fmt: skip
        interrupted = stopped()
    return _report(options, made, tally, noise, walk, seconds, notes, interrupted)


def _report(options, made, tally, noise: float, walk, seconds: dict, notes: tuple, interrupted: bool) -> Outcome:
    seconds |= {"sample": tally.seconds.get("sample", 0.0), "write": tally.seconds.get("write", 0.0)}
    sampled, walked = max(seconds["sample"], 1e-9), max(walk.seconds.get("walk", 0.0), 1e-9)
    counts, probes = tally.counts, max(tally.counts.get("PROBES", 0), 1)
    result = {
        "out": options.out, "samples": made.samples, "noise_delta_e00": noise if np.isfinite(noise) else None,
        "walk": walk.facts, "rays": tally.rays, "rays_per_s": tally.rays / sampled,
        "events": walk.events, "events_per_s": walk.events / walked, "counts": counts, "seconds": seconds,
        "stages": walk.seconds, "notes": list(notes), "interrupted": interrupted,
    }  # fmt: skip
    whole_time = sum(seconds.values())
    shares = ", ".join(f"{name} {100 * value / whole_time:.0f} %" for name, value in seconds.items())
    inner = ", ".join(f"{name} {value:.2f} s" for name, value in walk.seconds.items())
    kinds = ", ".join(
        f"{name} {100 * counts.get(key, 0) / max(tally.rays, 1):.0f} %"
        for name, key in (("camera", "CAMERA_RAYS"), ("exit", "PROBES"), ("sun", "SUN_RAYS"), ("sky", "SKY_RAYS"))
    )
    said = "unknown from so few" if not np.isfinite(noise) else f"ΔE00 {noise:.2f} a pixel"
    lines = [
        f"{options.out}: {made.samples} samples, noise {said}"
        + (" (interrupted; the same command goes on)" if interrupted else ""),
        f"{tally.rays / 1e6:.1f} M rays, {tally.rays / sampled / 1e6:.2f} M/s ({kinds}); "
        f"{walk.events / 1e9:.2f} G events, {walk.events / walked / 1e6:.0f} M/s",
        f"{whole_time:.1f} s: {shares}; stages: {inner}",
        f"exits without a surface {100 * counts.get('MISSES', 0) / probes:.2g} %, on one that faces away "
        f"{100 * counts.get('REJECTED', 0) / probes:.2g} %: lit where they entered",
    ]
    photons = walk.facts.get("photons", {})
    if photons.get("lost") or photons.get("unfinished"):
        lines.append(
            f"of {photons['entered']} walks {photons['lost']} were lost at folds of the mesh, {photons['unfinished']} "
            "given up for their length"
        )
    if counts.get("BACKS", 0) > _ODD * counts.get("HITS", 0):
        lines.append(
            f"{100 * counts['BACKS'] / counts['HITS']:.2g} % of what the camera sees are back faces: triangles run "
            "both ways round, or the mesh is open; unify its normals in your editor"
        )
    if counts.get("BROKEN"):
        lines.append(f"{counts['BROKEN']} samples were not finite and were left out")
    if not made.mask.any():
        lines.append("no head is in the picture: change distance_mm or target_mm")
    return result, "\n".join([*lines, *notes]), INTERRUPTED if interrupted else 0


def _timed(seconds: dict, name: str, act: Callable):
    since = time.perf_counter()
    done = act()
    seconds[name] = time.perf_counter() - since
    return done


@contextlib.contextmanager
def _interruptible() -> Iterator[Callable[[], bool]]:
    """Whether Ctrl-C was pressed inside: once to end after the running launch, twice to end at once."""
    pressed = []

    def press(number, frame) -> None:
        """Remember the first Ctrl-C."""
        if pressed:
            raise KeyboardInterrupt
        pressed.append(number)

    try:
        old = signal.signal(signal.SIGINT, press)
    except ValueError:  # not in the main thread
        yield lambda: False
        return
    try:
        yield lambda: bool(pressed)
    finally:
        signal.signal(signal.SIGINT, old)


def _kernels() -> str:
    """A mark of the kernels' text, on which every sample depends."""
    texts = [path.read_text() for path in sorted(Path(str(files("lutgen.kernels"))).rglob("*.cl"))]
    return hashlib.sha256("".join(texts).encode()).hexdigest()[:16]


def _hash(*arrays: np.ndarray | None) -> str:
    mark = hashlib.sha256()
    for array in arrays:
        mark.update(b"none" if array is None else f"{array.shape}{array.dtype}".encode() + array.tobytes())
    return mark.hexdigest()[:16]


def _hash_of(given: Maps) -> str:
    marks = _hash(given.chromophores, given.surface, given.normal, given.albedo)
    return f"{marks} {given.full_contrast_melanin:g}"


def _same(before, recipe: dict, out: Path):
    """The picture to go on with; InputError that names what differs where it was made of something else."""
    found, wanted = _flat(before.facts.get("recipe", {})), _flat(recipe)
    differ = [
        f"{name} {_short(found.get(name))}, now {_short(value)}"
        for name, value in wanted.items()
        if found.get(name) != value
    ]
    if differ:
        raise InputError(
            f"out = {out}: was rendered with other options ({'; '.join(differ[:3])}); give another --out, or --force "
            "to replace it"
        )
    return before


def _flat(values: dict) -> dict:
    """A recipe as plain values by dotted names, tuples as lists as JSON has them."""
    out = {}
    for name, value in values.items():
        if isinstance(value, dict):
            out |= {f"{name}.{key}": one for key, one in _flat(value).items()}
        else:
            out[name] = list(value) if isinstance(value, tuple) else value
    return out


def _short(value: object) -> str:
    text = str(value)
    return text if len(text) <= 24 else text[:21] + "..."


def _write_png(made, look: Look, name: str) -> None:
    from PIL import Image

    from lutgen.scene import display

    with folders.whole_file("png", name) as partial:
        Image.fromarray(display.picture(made.rgb, made.mask, look.exposure)).save(partial, format="PNG")
