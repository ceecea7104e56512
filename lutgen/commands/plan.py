"""The least model that a scene needs, its predicted error and cost."""

from __future__ import annotations

import os
from argparse import ArgumentParser, Namespace
from dataclasses import asdict
from pathlib import Path

from lutgen.commands import Outcome, device_options, progress
from lutgen.errors import InputError
from lutgen.files import folders
from lutgen.planning import needs as scenes
from lutgen.planning.needs import Needs
from lutgen.planning.plan import Plan
from lutgen.tables import recipe as recipes

EXAMPLES = (
    "lutgen plan --tones light,dark --explain",
    "lutgen plan --tones melanin=0.01:0.1 --vary melanin,oxygenation --tolerance 1 --write recipe.toml",
    "lutgen plan --tones maps --mm-per-pixel 0.1 --seconds 5 --verify --device 0",
)
STATISTIC = (
    "95th percentile over random skins of the scene (log-uniform melanin and hemoglobin); profiles: over ACEScg "
    "channels too, the largest of eight bakes with different seeds; the worst of three oxygenations where they vary"
)


def arguments(parser: ArgumentParser) -> None:
    """Add the scene, what may be spent on it, and where the recipe goes."""
    tolerance, energy, pixel, seconds = (
        "{:g} to {:g}".format(*limits)
        for limits in (scenes.TOLERANCE, scenes.EE_TOLERANCE, scenes.MM_PER_PIXEL, scenes.SECONDS)
    )
    parser.add_argument(
        "--tolerance", type=float, default=0.5,
        help=f"ΔE00 of colors, 95th percentile, {tolerance} (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--ee-tolerance", type=float, help=f"EE difference of profiles, {energy} (default: a 20th of --tolerance)"
    )
    parser.add_argument(
        "--tones", default="all",
        help="all, PRESET, melanin=LOW:HIGH, a map or a folder of maps, separated by commas (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--vary", metavar="NAME[,NAME...]",
        help=f"what varies at run time, of {', '.join(scenes.VARIABLE)} (default: what has a range in the tones)",
    )  # fmt: skip
    parser.add_argument(
        "--mm-per-pixel", type=float, default=0.2,
        help=f"how near the skin is seen: millimetres per pixel, {pixel} (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--bytes", type=int,
        help="what the tables may take in bytes, {} to {} (default: any number)".format(*scenes.BYTES),
    )  # fmt: skip
    parser.add_argument(
        "--seconds", type=float, help=f"what the bake may take in seconds, {seconds} (default: any number)"
    )
    parser.add_argument(
        "--write", metavar="FILE", help="recipe to write, which `lutgen bake FILE` takes (default: none)"
    )
    parser.add_argument("--force", action="store_true", help="replace an existing recipe")
    parser.add_argument("--verify", action="store_true", help="bake it and set measured beside predicted errors")
    parser.add_argument("--explain", action="store_true", help="say in five lines why each choice is the least")
    device_options.arguments(parser)
    progress.arguments(parser)


def run(options: Namespace) -> Outcome:
    """Needs in; a recipe, its predicted error and cost out."""
    from lutgen.planning.plan import least

    limits = {key: getattr(options, key) for key in ("tolerance", "ee_tolerance", "mm_per_pixel", "bytes", "seconds")}
    needs = scenes.scene(options.tones, options.vary, **limits)
    if options.write is not None:
        _check(options.write, options.force)
    plan = least(needs)
    measured = _verified(plan, options) if options.verify else None
    result = _result(plan) | ({} if measured is None else {"measured": measured})
    lines = _lines(plan) + (_compared(plan, measured) if measured else [])
    lines += [f"why {line}" for line in plan.why] if options.explain else []
    if options.write is not None:
        with folders.whole_file("write", options.write) as partial:
            partial.write_text(_toml(plan), encoding="utf-8")
        result["written"] = str(Path(options.write).absolute())
        lines.append(f"written: {result['written']}; bake it with `lutgen bake {options.write}`")
    return result, "\n".join(lines), 2 if measured and not measured["holds"] else 0


def _result(plan: Plan) -> dict:
    from lutgen.planning import costs

    return {
        "needs": plan.needs.as_dict(), "statistic": STATISTIC, "method": "path-table",
        "recipe": plan.recipe.as_dict(), "profile": plan.profile, "viewer": asdict(plan.viewer),
        "predicted": {
            "color": plan.color_error, "profile": plan.profile_error, "seconds": plan.seconds, "bytes": plan.bytes,
        },
        "why": list(plan.why), "measured_with": costs.measured_with(),
    }  # fmt: skip


def _axes(grid) -> str:
    return ", ".join(
        f"{a.name} {a.low:.4g}" + (f" to {a.high:.4g} ({a.count}, {a.spacing})" if a.count > 1 else "")
        for a in reversed(grid.axes)
    )


def _parts(error: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:.2g}" for name, value in error.items() if name not in ("total", "at most"))


def _lines(plan: Plan) -> list[str]:
    needs, recipe = plan.needs, plan.recipe
    lines = [
        f"trace: {recipe.wavelengths} wavelengths × {recipe.photons:,} photons, {recipe.totals} totals",
        f"color table: {_axes(recipe.color)}",
        f"profile table: {_axes(recipe.profile)}; {recipe.rings} rings"
        if plan.profile
        else "profile table: none needed (the recipe holds the one node that a bake takes): let the viewer not scatter",
        _viewer(plan),
        f"predicted color: ΔE00 {plan.color_error['total']:.3g} of {needs.tolerance:g} ({_parts(plan.color_error)})",
        f"predicted profile: EE {plan.profile_error['total']:.2g}, at most {plan.profile_error['at most']:.2g} of "
        f"{needs.ee_tolerance:.2g} from {needs.from_mm:.2g} mm on ({_parts(plan.profile_error)})",
        f"bake: {plan.cost[0]:.2f} s ({', '.join(f'{name} {value:.2f}' for name, value in plan.seconds.items())}); "
        f"tables: {plan.cost[1] / 1000:.1f} kB "
        f"({', '.join(f'{name} {value / 1000:.1f}' for name, value in plan.bytes.items() if value)})",
    ]  # fmt: skip
    if "oxygenation" in needs.varying:
        low, high = needs.oxygenation
        lines.insert(1, f"oxygenation: {low:g} to {high:g}, expanded at run time from the stored paths")
    return lines


def _viewer(plan: Plan) -> str:
    """The viewer's line."""
    needs, viewer = plan.needs, plan.viewer
    line = f"viewer: tier {viewer.tier}"
    if viewer.taps:
        line += f", {viewer.taps} taps; EE {viewer.ee_difference:.2g} under a disc of 6 pixels"
        if needs.mm_per_pixel < viewer.at_mm_per_pixel / 2:
            line += f" at {viewer.at_mm_per_pixel:g} mm per pixel, the finest that was measured"
        if not viewer.holds:
            line += f": no tier is within {needs.ee_tolerance:.2g}"
    return line


def _verified(plan: Plan, options: Namespace) -> dict:
    """The recipe baked with eight seeds, and what it errs by."""
    from lutgen.planning import verify

    needs, recipe = plan.needs, plan.recipe
    photons = verify.reference_photons(recipe)
    with progress.Progress(options) as tell:
        tell("reference", None)
        truth = verify.truth(needs, recipe, verify.reference(photons, options.device))
        measured = verify.verify(needs, recipe, truth, plan.profile, progress=tell, device=options.device)
    return asdict(measured) | {
        "holds": measured.holds(needs), "seeds": [recipe.seed + k for k in range(len(measured.color))],
        "reference_photons": photons, "reference_seed": verify.REFERENCE_SEED, "skins_seed": verify.SKINS_SEED,
    }  # fmt: skip


def _compared(plan: Plan, measured: dict) -> list[str]:
    def both(error: dict[str, float], parts: dict[str, float]) -> str:
        """Measured parts, the predicted in brackets."""
        return ", ".join(f"{name} {value:.2g} ({error[name]:.2g})" for name, value in parts.items() if name in error)

    color, profile = plan.color_error, plan.profile_error
    parts = {k: both(e, measured["parts"].get(k, {})) for k, e in (("color", color), ("profile", profile))}
    lines = [
        f"measured (predicted) color: ΔE00 {max(measured['color']):.3g} ({color['total']:.3g}), largest "
        f"{measured['color_max']:.2g}; {parts['color']}",
        f"measured (predicted) profile: EE {max(measured['profile']):.2g} ({profile['total']:.2g}), "
        f"{min(measured['profile']):.2g} in the best bake, largest {measured['profile_max']:.2g}"
        + (f"; {parts['profile']}" if parts["profile"] else ""),
        f"trace: {measured['trace_seconds']:.2f} s ({plan.seconds['trace']:.2f})",
    ]  # fmt: skip
    held = "holds" if measured["holds"] else "does NOT hold"
    seeds = measured["seeds"]
    return [*lines, f"{held} its tolerances in {len(seeds)} bakes, seeds {seeds[0]} to {seeds[-1]}"]


def _toml(plan: Plan) -> str:
    needs: Needs = plan.needs
    facts = ", ".join(f"{name} {value}" for name, value in needs.as_dict().items() if value is not None)
    return (
        f"# By `lutgen plan` for: {facts}.\n"
        f"# Predicted: color ΔE00 {plan.color_error['total']:.3g}, profile EE {plan.profile_error['total']:.2g}, at "
        f"most {plan.profile_error['at most']:.2g}; bake {plan.cost[0]:.2f} s.\n"
        f"# {STATISTIC}.\n"
        + ("" if plan.profile else "# No profile is needed: let the viewer not scatter (tier=off).\n")
        + recipes.toml(plan.recipe)
    )


def _check(name: str, force: bool) -> None:
    """InputError, before any work, where a recipe cannot go to that file."""
    path = Path(name)
    if not name or path.is_dir():
        raise InputError(f"write = {name!r}: a file name is needed")
    if path.exists() and not force:
        raise InputError(f"write = {name}: exists; give another file, or --force to replace it")
    if not path.parent.is_dir():
        raise InputError(f"write = {name}: there is no folder {path.parent}; make it first")
    if not os.access(path.parent, os.W_OK | os.X_OK):
        raise InputError(f"write = {name}: folder {path.parent} cannot be written; choose another")
