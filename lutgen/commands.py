"""What each command does: options in; a JSON-ready result, the same as text, and an exit status out."""

from __future__ import annotations

import platform
import time
from argparse import Namespace
from collections.abc import Callable
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

from lutgen import color, config, folders, manifest
from lutgen.errors import InputError, MachineError, cannot_write
from lutgen.progress import Progress

Outcome = tuple[dict, str, int]


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
    from lutgen import baking

    imports = seconds_since_start()
    base = config.quality(options.quality)
    recipe = config.load(options.recipe, base) if options.recipe else base
    changes = {key: getattr(options, key) for key in ("photons", "wavelengths", "seed")}
    recipe = replace(recipe, **{key: value for key, value in changes.items() if value is not None})
    out = folders.check_target(options.out, options.force)
    with Progress(quiet=options.json) as progress:
        luts = baking.bake(recipe, device=options.device, progress=progress)
        progress("write", None)
        written = time.perf_counter()
        luts.manifest["seconds"] = {"imports": round(imports, 4), **luts.manifest["seconds"]}
        notes = {"host": f"{platform.system()} {platform.machine()}", "baked_at": time.strftime("%Y-%m-%dT%H:%M:%S%z")}
        manifest.save(luts, out, options.force, notes)
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


def swatch(options: Namespace) -> Outcome:
    """`lutgen swatch`: one skin's spectrum and color."""
    from lutgen import device as ocl
    from lutgen import solvers
    from lutgen.tissue import Skin, preset

    fields = ("melanin", "eumelanin", "hemoglobin", "oxygenation", "epidermis_mm", "scattering", "reading",
              "saidi_a_per_mm", "saidi_b_nm4_per_mm")  # fmt: skip
    given = {name: getattr(options, name) for name in fields if getattr(options, name) is not None}
    if options.preset is None and "melanin" not in given:
        raise InputError("swatch: --preset or --melanin is needed; for example `lutgen swatch --preset light`")
    base = preset(options.preset) if options.preset is not None else Skin(0.0195, 0.7, 0.0088)
    skin = replace(base, **given)
    if skin.scattering != "saidi" and {"saidi_a_per_mm", "saidi_b_nm4_per_mm"} & set(given):
        raise InputError(f"saidi_*: scattering is {skin.scattering}, which has no such values; add --scattering saidi")
    extra: dict = {"photons": options.photons, "seed": options.seed}
    if options.device is not None:
        ocl.choose(options.device)
    if options.method in ("path-table", "direct"):
        extra["device"] = options.device
    reflectance, sigma = solvers.spectrum_with_error(skin, None, options.method, **extra)
    xyz = color.spectrum_to_xyz(reflectance, options.pipeline)
    srgb = color.from_xyz(xyz, "srgb", options.pipeline)
    result = {
        "skin": asdict(skin), "method": options.method, "pipeline": options.pipeline,
        "wavelength_nm": color.tables()["wavelength_nm"].tolist(), "reflectance": reflectance.tolist(),
        "std_error": sigma.tolist(), "xyz": xyz.tolist(), "linear_srgb": srgb.tolist(),
        "lab": color.lab(xyz).tolist(), "srgb_hex": color.hex_code(srgb),
    }  # fmt: skip
    lightness, a, b = result["lab"]
    text = (
        f"{result['srgb_hex']}  L* {lightness:.2f}  a* {a:.2f}  b* {b:.2f}  "
        f"linear sRGB {srgb[0]:.4f} {srgb[1]:.4f} {srgb[2]:.4f}"
    )
    if options.png is not None:
        from lutgen import preview

        try:
            preview.draw_swatch(skin, result).save(options.png, format="PNG")
        except OSError as error:
            raise cannot_write("png", options.png, error) from error
    return result, text, 0


def info(options: Namespace) -> Outcome:
    """`lutgen info`: the manifest, in words."""
    folder = Path(options.dir)
    luts = manifest.load(folder)
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
    sizes = {name: (folder / name).stat().st_size for name in manifest.EXR_FILES}
    lines += [f"{name}: {size / 1000:.0f} kB" for name, size in sizes.items()]
    return facts | {"bytes": sizes}, "\n".join(lines), 0


def devices(options: Namespace) -> Outcome:
    """`lutgen devices`: what OpenCL offers, best first."""
    from lutgen import device as ocl

    found = ocl.devices()
    if not found:
        raise MachineError(f"no OpenCL device; {ocl.INSTALL_HINT}")
    rows = [
        {"index": i, "name": d.name, "platform": d.platform, "kind": d.kind, "lanes": d.lanes}
        for i, d in enumerate(found)
    ]
    text = "\n".join(f"{r['index']}  {r['kind']}  {r['platform']}: {r['name']}  ({r['lanes']} lanes)" for r in rows)
    return {"devices": rows}, text, 0


def check(options: Namespace) -> Outcome:
    """`lutgen check`: every law that a LUT set must obey."""
    from lutgen import checking

    findings = checking.check(Path(options.dir))
    good = all(finding.passed for finding in findings)
    text = "\n".join(f"{'ok  ' if f.passed else 'FAIL'}  {f.name}: {f.detail}" for f in findings)
    return {"passed": good, "findings": [asdict(f) for f in findings]}, text, 0 if good else 2


def bench(options: Namespace) -> Outcome:
    """`lutgen bench`: events per second, lanes against one lane, and a bake by stage; or the viewer's frames."""
    if options.viewer:
        from lutgen import showing

        return showing.bench(options)
    if options.size is not None:
        raise InputError(f"size = {options.size}: only frames have a size; add --viewer")
    from lutgen import benchmark

    result = benchmark.run(options.device)
    trace, baked = result["trace"], result["bake"]
    text = (
        f"trace on {trace['device']}: {trace['events_per_s'] / 1e9:.2f} G events/s, "
        f"{trace['photons_per_s'] / 1e6:.2f} M photons/s, {trace['lanes']} lanes are {trace['ratio_w1']:.1f} × one; "
        f"{100 * trace['peak_share']:.0f} % of the measured multiply-add peak\n"
        + "\n".join(
            f"{quality}: {run['seconds']['total']:.2f} s, ΔE00 max {run['error']['color']['delta_e00_max']:.3f}, "
            f"p95 {run['error']['color']['delta_e00_p95']:.3f}; "
            + ", ".join(f"{name} {value:.2f}" for name, value in run["seconds"].items() if name != "total")
            for quality, run in baked.items()
        )
        + f"\nexpansion to another oxygenation: {1000 * result['expand_s']:.1f} ms"
    )
    return result, text, 0


def figures(options: Namespace) -> Outcome:
    """`lutgen figures`: the source document's results, and what they are compared with, as charts and tables."""
    from lutgen.charts import figures as charts

    return _drawn(options, charts.draw)


def chart(options: Namespace) -> Outcome:
    """`lutgen chart`: speed against accuracy."""
    from lutgen.charts import chart as charts

    return _drawn(options, partial(charts.draw, quick=options.quick))


def stability(options: Namespace) -> Outcome:
    """`lutgen stability`: error maps, bias and the failure list."""
    from lutgen.charts import stability as charts

    return _drawn(options, partial(charts.draw, quick=options.quick))


def _drawn(options: Namespace, draw: Callable[..., dict[str, str]]) -> Outcome:
    out = Path(options.out)
    with Progress(quiet=options.json) as progress:
        shown = draw(out, progress=progress)
    text = f"{out.absolute()}\n" + "\n".join(f"{name}: {words}" for name, words in shown.items())
    return {"out": str(out.absolute()), "charts": shown}, text, 0


def view(options: Namespace) -> Outcome:
    """`lutgen view`: a head in a window, or one picture of it."""
    from lutgen import showing

    return showing.view(options)


def sheet(options: Namespace) -> Outcome:
    """`lutgen sheet`: every preset on a head."""
    from lutgen import showing

    return showing.sheet(options)


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
