"""The least model that a scene needs: plan."""

from __future__ import annotations

import os
import secrets
from argparse import Namespace
from dataclasses import asdict
from pathlib import Path

from lutgen.commands import Outcome
from lutgen.commands.progress import Progress
from lutgen.errors import InputError, cannot_write
from lutgen.planning import costs
from lutgen.planning.needs import Needs, scene
from lutgen.planning.plan import Plan, least
from lutgen.tables import recipe as recipes

STATISTIC = (
    "95th percentile over random skins of the scene (log-uniform melanin and hemoglobin); profiles: over ACEScg "
    "channels too, the largest of eight bakes with different seeds; the worst of three oxygenations where they vary"
)


def plan(options: Namespace) -> Outcome:
    """`lutgen plan`: needs in; a recipe, its predicted error and cost out."""
    limits = {key: getattr(options, key) for key in ("tolerance", "ee_tolerance", "mm_per_pixel", "bytes", "seconds")}
    needs = scene(options.tones, options.vary, **limits)
    if options.write is not None:
        _check(options.write, options.force)
    with Progress(quiet=options.json) as progress:
        progress("plan", None)
        found = least(needs)
        measured = _verified(found, progress, options.device) if options.verify else None
    result = _result(found) | ({} if measured is None else {"measured": measured})
    lines = _lines(found) + (_compared(found, measured) if measured else [])
    lines += [f"why {line}" for line in found.why] if options.explain else []
    if options.write is not None:
        _write(options.write, _toml(found))
        result["written"] = str(Path(options.write).absolute())
        lines.append(f"written: {result['written']}; bake it with `lutgen bake {options.write}`")
    return result, "\n".join(lines), 2 if measured and not measured["holds"] else 0


def _result(found: Plan) -> dict:
    return {
        "needs": found.needs.as_dict(), "statistic": STATISTIC, "method": "path-table",
        "recipe": found.recipe.as_dict(), "profile": found.profile, "viewer": asdict(found.viewer),
        "predicted": {
            "color": found.color_error, "profile": found.profile_error, "seconds": found.seconds, "bytes": found.bytes,
        },
        "why": list(found.why), "measured_with": costs.measured_with(),
    }  # fmt: skip


def _axes(grid) -> str:
    axes = grid.melanin, grid.eumelanin, grid.hemoglobin
    return ", ".join(
        f"{a.name} {a.low:.4g}" + (f" to {a.high:.4g} ({a.count}, {a.spacing})" if a.count > 1 else "") for a in axes
    )


def _parts(error: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:.2g}" for name, value in error.items() if name not in ("total", "at most"))


def _lines(found: Plan) -> list[str]:
    needs, recipe = found.needs, found.recipe
    lines = [
        f"trace: {recipe.wavelengths} wavelengths × {recipe.photons:,} photons, {recipe.totals} totals",
        f"color table: {_axes(recipe.color)}",
        f"profile table: {_axes(recipe.profile)}; {recipe.rings} rings"
        if found.profile
        else "profile table: none needed (the recipe holds the one node that a bake takes): let the viewer not scatter",
        _viewer(found),
        f"predicted color: ΔE00 {found.color_error['total']:.3g} of {needs.tolerance:g} ({_parts(found.color_error)})",
        f"predicted profile: EE {found.profile_error['total']:.2g}, at most {found.profile_error['at most']:.2g} of "
        f"{needs.ee_tolerance:.2g} from {needs.from_mm:.2g} mm on ({_parts(found.profile_error)})",
        f"bake: {found.cost[0]:.2f} s ({', '.join(f'{name} {value:.2f}' for name, value in found.seconds.items())}); "
        f"tables: {found.cost[1] / 1000:.1f} kB "
        f"({', '.join(f'{name} {value / 1000:.1f}' for name, value in found.bytes.items() if value)})",
    ]  # fmt: skip
    if "oxygenation" in needs.varying:
        low, high = needs.oxygenation
        lines.insert(1, f"oxygenation: {low:g} to {high:g}, expanded at run time from the stored paths")
    return lines


def _viewer(found: Plan) -> str:
    """The viewer's line."""
    needs, viewer = found.needs, found.viewer
    line = f"viewer: tier {viewer.tier}"
    if viewer.taps:
        line += f", {viewer.taps} taps; EE {viewer.ee_difference:.2g} under a disc of 6 pixels"
        if needs.mm_per_pixel < viewer.at_mm_per_pixel / 2:
            line += f" at {viewer.at_mm_per_pixel:g} mm per pixel, the finest that was measured"
        if not viewer.holds:
            line += f": no tier is within {needs.ee_tolerance:.2g}"
    return line


def _verified(found: Plan, progress: Progress, device: str | None) -> dict:
    """The recipe baked with eight seeds, and what it errs by."""
    from lutgen.planning import verify

    needs, recipe = found.needs, found.recipe
    progress("reference", None)
    photons = verify.reference_photons(recipe)
    right = verify.truth(needs, recipe, verify.reference(photons, device))
    measured = verify.verify(needs, recipe, right, found.profile, progress=progress, device=device)
    return asdict(measured) | {
        "holds": measured.holds(needs), "seeds": [recipe.seed + k for k in range(len(measured.color))],
        "reference_photons": photons, "reference_seed": verify.REFERENCE_SEED, "skins_seed": verify.SKINS_SEED,
    }  # fmt: skip


def _compared(found: Plan, measured: dict) -> list[str]:
    def both(error: dict[str, float], parts: dict[str, float]) -> str:
        """Measured parts, the predicted in brackets."""
        return ", ".join(f"{name} {value:.2g} ({error[name]:.2g})" for name, value in parts.items() if name in error)

    color, profile = found.color_error, found.profile_error
    parts = {k: both(e, measured["parts"].get(k, {})) for k, e in (("color", color), ("profile", profile))}
    lines = [
        f"measured (predicted) color: ΔE00 {max(measured['color']):.3g} ({color['total']:.3g}), largest "
        f"{measured['color_max']:.2g}; {parts['color']}",
        f"measured (predicted) profile: EE {max(measured['profile']):.2g} ({profile['total']:.2g}), "
        f"{min(measured['profile']):.2g} in the best bake, largest {measured['profile_max']:.2g}"
        + (f"; {parts['profile']}" if parts["profile"] else ""),
        f"trace: {measured['trace_seconds']:.2f} s ({found.seconds['trace']:.2f})",
    ]  # fmt: skip
    held = "holds" if measured["holds"] else "does NOT hold"
    seeds = measured["seeds"]
    return [*lines, f"{held} its tolerances in {len(seeds)} bakes, seeds {seeds[0]} to {seeds[-1]}"]


def _toml(found: Plan) -> str:
    needs: Needs = found.needs
    facts = ", ".join(f"{name} {value}" for name, value in needs.as_dict().items() if value is not None)
    return (
        f"# By `lutgen plan` for: {facts}.\n"
        f"# Predicted: color ΔE00 {found.color_error['total']:.3g}, profile EE {found.profile_error['total']:.2g}, at "
        f"most {found.profile_error['at most']:.2g}; bake {found.cost[0]:.2f} s.\n"
        f"# {STATISTIC}.\n"
        + ("" if found.profile else "# No profile is needed: let the viewer not scatter (tier=off).\n")
        + recipes.toml(found.recipe)
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


def _write(name: str, text: str) -> None:
    """Write a file that is there whole or not at all."""
    path = Path(os.path.realpath(name))
    partial = path.with_name(f".{path.name[:100]}.partial-{secrets.token_hex(4)}")
    try:
        partial.write_text(text, encoding="utf-8")
        partial.replace(path)
    except OSError as error:
        raise cannot_write("write", name, error) from error
    finally:
        partial.unlink(missing_ok=True)
