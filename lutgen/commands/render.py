"""A head by Monte Carlo: the truth that the viewer is compared with.

The OpenEXR file grows better while it runs; the same command goes on where it stopped before.
"""

from __future__ import annotations

import contextlib
import hashlib
import signal
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterator
from dataclasses import asdict
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path

import numpy as np

from lutgen import render
from lutgen.commands import Outcome, device_options, progress, scene_options
from lutgen.errors import InputError, whole
from lutgen.files import folders
from lutgen.files.texture_maps import Maps
from lutgen.render import goal as goals
from lutgen.scene import subject
from lutgen.scene.look import Look
from lutgen.solvers.paths import SEEDS

EXAMPLES = (
    "lutgen render --preset dark --spp 64 --size 320x320 --out dark.exr --png dark.png",
    "lutgen render my-luts --walk mesh --time 10m --out head.exr",
    "lutgen render --noise 1 --device 0 --seed 7 --out head.exr",
)
SIZE = "512x512"
INTERRUPTED = 130
_BACK_FACES = 0.01
"""Share of back faces among what the camera sees, above which a line says so."""
_NOT_SEEN = ("tier", "split", "transmission", "exposure")
"""Values of a look that a render does not depend on."""


def arguments(parser: ArgumentParser) -> None:
    """Add the scene, how light walks in it, when to stop, and the picture."""
    scene_options.arguments(parser, SIZE)
    parser.add_argument(
        "--walk", choices=render.WALKS, default="flat",
        help="flat: as if the skin were flat where light enters; flat-full: the same without its tables; "
        "mesh: inside the head, which must be closed (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--spp", type=int,
        help=f"samples a pixel, {goals.SAMPLES[0]} to {goals.SAMPLES[1]} (default: {goals.DEFAULT_SAMPLES} where "
        "neither time nor noise is given)",
    )  # fmt: skip
    seconds, noise = "{:g} to {:g}".format(*goals.SECONDS), "{:g} to {:g}".format(*goals.NOISE)
    parser.add_argument(
        "--time", metavar="60s", help=f"stop after so long: 60s, 5m, 1h; {seconds} s (default: --spp's samples)"
    )
    parser.add_argument(
        "--noise", type=float,
        help=f"stop where a pixel's noise is this ΔE00 on average, {noise} (default: --spp's samples)",
    )  # fmt: skip
    parser.add_argument("--out", required=True, metavar="FILE.exr", help="picture to write, or to go on with")
    parser.add_argument("--png", metavar="FILE", help="also as the viewer would show it (default: none)")
    parser.add_argument(
        "--seed", type=int, default=0,
        help="of the random streams, {} to {} (default: %(default)s)".format(*SEEDS),
    )  # fmt: skip
    parser.add_argument("--force", action="store_true", help="replace a picture of other options")
    device_options.arguments(parser)
    progress.arguments(parser)


def run(options: Namespace) -> Outcome:
    """Sample until --spp, --time or --noise, go on where the same command stopped before."""
    from lutgen import device as ocl
    from lutgen.head import mend
    from lutgen.render import device_scene, film, flat_walk, progressive

    start = time.perf_counter()
    goal = goals.goal_of(options.spp, options.time, options.noise)
    seed, size = whole("seed", options.seed, *SEEDS), subject.size_of(options.size or SIZE)
    look, out = scene_options.look_of(options), folders.check_file("out", options.out, ".exr")
    if options.png is not None:
        folders.check_file("png", options.png, ".png")
    device = ocl.choose(options.device)
    scene = scene_options.scene_of(options, look)
    head, mends = mend.outward(scene.head)
    luts, notes = scene.luts, (*scene.notes, *mends)
    recipe = {
        "lutgen": version("lutgen"), "walk": options.walk, "size": list(size), "seed": seed, "kernels": _kernels(),
        "look": {name: value for name, value in asdict(look).items() if name not in _NOT_SEEN},
        "luts": {name: luts.manifest[name] for name in ("trace", "recipe", "extra_absorbers_per_mm")},
        "head": _hash(head.positions_mm, head.normals, head.uv, head.triangles), "maps": _hash_of(scene.maps),
        "environment": "studio" if scene.surroundings is None else _hash(scene.surroundings),
    }  # fmt: skip
    before = None if options.force or not out.exists() else _resumed(film.read(out), recipe, out)
    seconds = {"head": time.perf_counter() - start}
    with progress.Progress(options) as tell, _interruptible() as stopped:
        with _timed(seconds, "tree"):
            stage = device_scene.open_scene(device, luts, head, scene.maps, look, size, scene.surroundings, seed)
        tell("exits", None)
        with _timed(seconds, "exits"):
            walk = flat_walk.WALKS[options.walk](stage, seed)
        notes = (*notes, *walk.facts.get("notes", ()))
        facts = {"recipe": recipe, "walk": walk.facts, "notes": list(notes), "device": device.name}
        picture = film.empty(size, walk.group, facts) if before is None else before

        def save(picture: film.Film, noise: float) -> None:
            """Write what there is so far."""
            film.write(picture, out)
            if options.png:
                _write_png(picture, look, options.png)

        tell("render", None)
        picture, tally, noise = progressive.render(stage, walk, picture, goal, save, stopped, tell, look.exposure)
        interrupted = stopped()
    seconds |= {"sample": tally.seconds.get("sample", 0.0), "write": tally.seconds.get("write", 0.0)}
    result = {
        "out": options.out, "samples": picture.samples, "noise_delta_e00": noise if np.isfinite(noise) else None,
        "walk": walk.facts, "rays": tally.rays, "rays_per_s": tally.rays / max(seconds["sample"], 1e-9),
        "events": walk.events, "events_per_s": walk.events / max(walk.seconds.get("walk", 0.0), 1e-9),
        "counts": tally.counts, "seconds": seconds, "stages": walk.seconds, "notes": list(notes),
        "interrupted": interrupted,
    }  # fmt: skip
    return result, _text(result, bool(picture.mask.any())), INTERRUPTED if interrupted else 0


def _text(result: dict, seen: bool) -> str:
    """The figures in lines; `seen`: some of the head is in the picture."""
    seconds, counts, rays = result["seconds"], result["counts"], result["rays"]
    total, probes, noise = sum(seconds.values()), max(counts.get("PROBES", 0), 1), result["noise_delta_e00"]
    shares = ", ".join(f"{name} {100 * value / total:.0f} %" for name, value in seconds.items())
    stages = ", ".join(f"{name} {value:.2f} s" for name, value in result["stages"].items())
    kinds = ", ".join(
        f"{name} {100 * counts.get(key, 0) / max(rays, 1):.0f} %"
        for name, key in (("camera", "CAMERA_RAYS"), ("exit", "PROBES"), ("sun", "SUN_RAYS"), ("sky", "SKY_RAYS"))
    )
    lines = [
        f"{result['out']}: {result['samples']} samples, noise "
        + ("unknown from so few" if noise is None else f"ΔE00 {noise:.2f} a pixel")
        + (" (interrupted; the same command goes on)" if result["interrupted"] else ""),
        f"{rays / 1e6:.1f} M rays, {result['rays_per_s'] / 1e6:.2f} M/s ({kinds}); "
        f"{result['events'] / 1e9:.2f} G events, {result['events_per_s'] / 1e6:.0f} M/s",
        f"{total:.1f} s: {shares}; stages: {stages}",
        f"exits without a surface {100 * counts.get('MISSES', 0) / probes:.2g} %, on one that faces away "
        f"{100 * counts.get('REJECTED', 0) / probes:.2g} %: lit where they entered",
    ]
    photons = result["walk"].get("photons", {})
    if photons.get("lost") or photons.get("unfinished"):
        lines.append(
            f"of {photons['entered']} walks {photons['lost']} were lost at folds of the mesh, {photons['unfinished']} "
            "given up for their length"
        )
    if counts.get("BACKS", 0) > _BACK_FACES * counts.get("HITS", 0):
        lines.append(
            f"{100 * counts['BACKS'] / counts['HITS']:.2g} % of what the camera sees are back faces: triangles run "
            "both ways round, or the mesh is open; unify its normals in your editor"
        )
    if counts.get("BROKEN"):
        lines.append(f"{counts['BROKEN']} samples were not finite and were left out")
    if not seen:
        lines.append("no head is in the picture: change distance_mm or target_mm")
    return "\n".join([*lines, *result["notes"]])


@contextlib.contextmanager
def _timed(seconds: dict[str, float], stage: str) -> Iterator[None]:
    """Put down a stage's seconds."""
    start = time.perf_counter()
    yield
    seconds[stage] = time.perf_counter() - start


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


def _hash_of(maps: Maps) -> str:
    mark = _hash(maps.chromophores, maps.surface, maps.normal, maps.albedo)
    return f"{mark} {maps.full_contrast_melanin:g}"


def _resumed(before, recipe: dict, out: Path):
    """The picture to go on with; InputError that names what differs where it is of something else."""
    earlier = _flat(before.facts.get("recipe", {}))
    differ = [
        f"{name} {_short(earlier.get(name))}, now {_short(value)}"
        for name, value in _flat(recipe).items()
        if earlier.get(name) != value
    ]
    if differ:
        raise InputError(
            f"out = {out}: was rendered with other options ({'; '.join(differ[:3])}); give another --out, or --force "
            "to replace it"
        )
    return before


def _flat(values: dict) -> dict:
    """A recipe as plain values by dotted names, tuples as lists as JSON has them."""
    flat = {}
    for name, value in values.items():
        if isinstance(value, dict):
            flat |= {f"{name}.{key}": inner for key, inner in _flat(value).items()}
        else:
            flat[name] = list(value) if isinstance(value, tuple) else value
    return flat


def _short(value: object) -> str:
    text = str(value)
    return text if len(text) <= 24 else text[:21] + "..."


def _write_png(picture, look: Look, name: str) -> None:
    from PIL import Image

    from lutgen.scene import display

    with folders.whole_file("png", name) as partial:
        Image.fromarray(display.picture(picture.rgb, picture.mask, look.exposure)).save(partial, format="PNG")
