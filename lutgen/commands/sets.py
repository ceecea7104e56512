"""LUT sets: bake, info, check, export."""

from __future__ import annotations

import platform
import time
from argparse import Namespace
from dataclasses import asdict, replace
from pathlib import Path

from lutgen.commands import Outcome
from lutgen.commands.progress import Progress
from lutgen.files import folders
from lutgen.tables import recipe as recipes
from lutgen.tables import storage


def seconds_since_start() -> float:
    """Seconds since this process started, imports included; 0 where the system does not say."""
    try:
        ticks = int(Path("/proc/self/stat").read_text().rsplit(")", 1)[1].split()[19])
        import os

        return time.clock_gettime(time.CLOCK_BOOTTIME) - ticks / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, AttributeError):
        return 0.0


def bake(options: Namespace) -> Outcome:
    """`lutgen bake`: recipe and options to a folder."""
    from lutgen.tables import bake as baking

    imports = seconds_since_start()
    base = recipes.quality(options.quality)
    recipe = recipes.load(options.recipe, base) if options.recipe else base
    changes = {key: getattr(options, key) for key in ("photons", "wavelengths", "seed")}
    recipe = replace(recipe, **{key: value for key, value in changes.items() if value is not None})
    out = folders.check_target(options.out, options.force)
    with Progress(quiet=options.json) as progress:
        luts = baking.bake(recipe, device=options.device, progress=progress)
        progress("write", None)
        written = time.perf_counter()
        luts.manifest["seconds"] = {"imports": round(imports, 4), **luts.manifest["seconds"]}
        notes = {"host": f"{platform.system()} {platform.machine()}", "baked_at": time.strftime("%Y-%m-%dT%H:%M:%S%z")}
        storage.save(luts, out, options.force, notes)
    seconds = luts.manifest["seconds"] | {
        "write": round(time.perf_counter() - written, 4), "total": round(seconds_since_start(), 4),
    }  # fmt: skip
    error, trace = luts.manifest["error"], luts.manifest["trace"]
    result = {"out": str(out.absolute()), "recipe": recipe.as_dict(), "device": trace["device"], "error": error,
              "seconds": seconds}  # fmt: skip
    text = (
        f"{out.absolute()}\n"
        f"color: ΔE00 max {error['color']['delta_e00_max']:.3f}, p95 {error['color']['delta_e00_p95']:.3f} "
        f"({error['color']['skins']} random skins against {error['color']['compared_with']})\n"
        f"profiles: EE difference max {error['profile']['ee_difference_max']:.4f} between nodes "
        f"({error['profile']['skins']} random skins)\n"
        f"{trace['events'] / 1e6:.0f} M scattering events on {trace['device']}; "
        + ", ".join(f"{name} {value:.2f} s" for name, value in seconds.items())
    )
    return result, text, 0


def info(options: Namespace) -> Outcome:
    """`lutgen info`: the manifest, in words."""
    folder = Path(options.dir)
    luts = storage.load(folder)
    facts = luts.manifest
    lines = [f"{folder.absolute()}: LUT set of lutgen {facts['lutgen']}, {facts['recipe']['totals']} totals"]
    for name, grid in (("color", luts.color_lut.grid), ("profile", luts.profile_lut.grid)):
        axes = (grid.melanin, grid.eumelanin, grid.hemoglobin)
        lines.append(
            f"{name}: " + ", ".join(f"{a.name} {a.low:g} to {a.high:g} ({a.count}, {a.spacing})" for a in axes)
        )
    nm = ", ".join(f"{w:g}" for w in facts["quadrature"]["wavelength_nm"])
    rings = len(luts.paths.radius_edges_mm) - 1
    lines.append(f"profiles: {rings} rings to {luts.paths.radius_edges_mm[-1]:g} mm")
    lines.append(f"skin: {', '.join(f'{key} {value}' for key, value in facts['recipe']['skin'].items())}")
    lines.append(f"wavelengths: {nm} nm; {facts['trace']['photons_per_wavelength']} photons each, "
                 f"seed {facts['trace']['seed']}, on {facts['trace']['device']}")  # fmt: skip
    if facts["error"]:
        found = facts["error"]["color"]
        lines.append(
            f"color: ΔE00 max {found['delta_e00_max']:.3f}, p95 {found['delta_e00_p95']:.3f} "
            f"against {found['compared_with']}"
        )
    else:
        lines.append("color: expanded from stored paths, its error not measured")
    sizes = {name: (folder / name).stat().st_size for name in storage.EXR_FILES}
    lines += [f"{name}: {size / 1000:.0f} kB" for name, size in sizes.items()]
    return facts | {"bytes": sizes}, "\n".join(lines), 0


def check(options: Namespace) -> Outcome:
    """`lutgen check`: every law that a LUT set must obey."""
    from lutgen.tables import check as checking

    findings = checking.check(Path(options.dir))
    good = all(finding.passed for finding in findings)
    text = "\n".join(f"{'ok  ' if f.passed else 'FAIL'}  {f.name}: {f.detail}" for f in findings)
    return {"passed": good, "findings": [asdict(f) for f in findings]}, text, 0 if good else 2


def export(options: Namespace) -> Outcome:
    """`lutgen export`: a folder per engine, and the error that each adds."""
    import lutgen
    from lutgen import exports

    targets = exports.targets_of(options.to)
    luts = lutgen.load(options.dir)
    with Progress(quiet=options.json) as progress:
        errors = exports.export(luts, targets, options.out, options.size, options.force, progress)
    out = str(Path(options.out).absolute())
    text = "\n".join([out, *(f"{name}: {said}" for name, (said, _) in errors.items())])
    return {"out": out, "targets": list(targets), "error": {name: one for name, (_, one) in errors.items()}}, text, 0
