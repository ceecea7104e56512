"""Measure what `lutgen plan` predicts from; needs scipy (extra `color`), OpenCL, and OpenGL with `view`.

Run as `python -m lutgen.planning.make_stored_paths`.

Writes beside this script: plan.exr, paths of the default skin with many photons, from which errors are worked out;
plan.csv, seconds of a bake's stages, fitted to bakes of many sizes, and errors of the viewer's tiers by scale.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
from scipy.optimize import nnls

import lutgen
from lutgen import device as ocl
from lutgen.files import exr
from lutgen.planning import stored_paths
from lutgen.scene import viewer
from lutgen.tables import bake, wavelengths
from lutgen.tables import recipe as recipe_files
from lutgen.tables.axes import default_grid
from lutgen.tables.recipe import Recipe

WAVELENGTHS, PHOTONS, SEED = 10, 2**22, 1000
SCALES_MM = (0.05, 0.1, 0.2, 0.5, 1.0)
TIERS = (("low", 8, 1), ("medium", 16, 1), ("high", 64, 1), ("reference", 64, 16))
"""Name, taps and frames added up."""
SIZES = (
    ((2, 2, 2), (2, 2, 2), 8), ((2, 2, 2), (2, 2, 2), 256), ((32, 16, 32), (2, 2, 2), 8), ((8, 4, 8), (8, 4, 8), 16),
    ((2, 2, 2), (16, 4, 16), 64), ((16, 8, 16), (24, 8, 16), 32), ((2, 2, 2), (12, 4, 8), 256),
    ((32, 16, 32), (4, 2, 3), 128),
)  # fmt: skip
"""Nodes of color and profile tables, and rings."""
CHILD = """
import json, time
from lutgen.tables import bake, recipe, storage
began = {}
def progress(stage, tally):
    if tally is None:
        began[stage] = time.process_time()
luts = bake.bake(recipe.load("recipe.toml"), progress=progress)
storage.save(luts, "set", True)
trace = began["exact totals"] - began["trace"]
print(json.dumps({"trace": trace, "rest": time.process_time() - trace}))
"""


def recipes() -> Iterator[Recipe]:
    """Bakes of many sizes: what each stage's time is fitted to."""
    for rule, most in (("6", 2**20), ("8", 2**20), ("12", 2**19), ("10nm", 2**17), ("5nm", 2**16)):
        for photons in (most // 64, most // 8, most):
            yield Recipe(wavelengths=rule, photons=photons)
    for color, profile, rings in SIZES:
        for rule in ("6", "12"):
            tables = default_grid(*color), default_grid(*profile)
            yield Recipe(photons=16_384, wavelengths=rule, rings=rings, color=tables[0], profile=tables[1])


def timed(recipe: Recipe, folder: Path) -> dict[str, float]:
    """CPU seconds of a trace, and of all the rest of a process from its start to files on disk; the least of three.

    CPU time, for another's work on the machine hardly changes it; kernels are built before.
    """
    (folder / "recipe.toml").write_text(recipe_files.toml(replace(recipe, totals="anchored")))
    command = [sys.executable, "-c", CHILD]
    runs = [json.loads(subprocess.run(command, cwd=folder, capture_output=True, check=True).stdout) for _ in range(3)]
    return {stage: min(run[stage] for run in runs) for stage in runs[0]}


def costs(cores: int) -> Iterator[str]:
    """Lines of seconds: a trace by rule (fixed, per photon), and all the rest (fixed, per node, per ring of a node).

    A trace keeps all cores busy, so its wall time is its CPU time over their number; the rest runs on one.
    """
    with tempfile.TemporaryDirectory() as name:
        seconds = {recipe: timed(recipe, Path(name)) for recipe in recipes()}
    for rule in wavelengths.NAMES:
        of_rule = [(r.photons, run["trace"] / cores) for r, run in seconds.items() if r.wavelengths == rule]
        photons, trace = np.array(of_rule).T
        # Relative errors count, so that short traces are met as well as long ones.
        (fixed, each), _ = nnls(np.stack([1 / trace, photons / trace], axis=1), np.ones(len(trace)))
        off = np.abs((fixed + each * photons) / trace - 1).max()
        yield f"trace,{rule},{fixed:.4g},{each:.4g}"
        yield f"# off by {100 * off:.0f} % at most over {len(trace)} bakes"
    color, profile, rings = np.array([
        (np.prod(r.color.shape), np.prod(r.profile.shape), r.rings) for r in seconds
    ]).T  # fmt: skip
    rest = np.array([run["rest"] for run in seconds.values()])
    columns = {"start": color * 0 + 1, "color node": color, "profile node": profile, "ring of a node": profile * rings}
    coefficients, _ = nnls(np.stack([v / rest for v in columns.values()], axis=1), np.ones(len(rest)))
    for column, value in zip(columns, coefficients, strict=True):
        yield f"rest,{column},{value:.4g}"
    predicted = np.stack(list(columns.values()), axis=1) @ coefficients
    yield f"# off by {100 * np.abs(predicted / rest - 1).max():.0f} % at most over {len(rest)} bakes"


def tiers() -> Iterator[str]:
    """Lines of the viewer's EE differences: the worst of six tones, of all channels and of 16 places of a disc."""
    gl, laws = viewer.viewer("gl"), viewer.viewer("measure.scattering_laws")
    plane = laws.open_plane(lutgen.load())
    try:
        for name, taps, frames in TIERS:
            for scale in SCALES_MM:
                places = laws.PLACES[:: 4 if frames > 1 else 1]
                worst = max(laws.searchlight(plane, tone, scale, taps, frames, places) for tone in laws.TONES)
                yield f"tier,{name},{taps},{scale},{worst:.4f}"
    finally:
        laws.release(plane)
        gl.check()


def main() -> None:
    """Write plan.exr and plan.csv."""
    here, device, cores = Path(__file__).parent, ocl.choose(), os.cpu_count() or 1
    facts = {"lutgen": version("lutgen"), "device": device.name, "seed": SEED}
    traced = bake.paths_at_every_wavelength(PHOTONS, stored_paths.edges(), SEED, Recipe().skin, device, WAVELENGTHS)
    exr.write(here / "plan.exr", [stored_paths.part(traced, facts)])
    lines = [
        f"# What `lutgen plan` predicts from, by lutgen.planning.make_stored_paths: lutgen {facts['lutgen']}, "
        f"{device.name} ({device.platform}), seed {SEED} of plan.exr ({PHOTONS} photons at each of "
        f"{WAVELENGTHS} wavelengths).",
        "# trace: rule, seconds fixed, per photon of each wavelength; rest: seconds of a process without its trace.",
        f"# Seconds: from CPU time, a trace's over {cores} cores.",
        "# tier: name, taps, mm per pixel, EE difference of a disc of 6 pixels.",
        *costs(cores), *tiers(),
    ]  # fmt: skip
    (here / "plan.csv").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
