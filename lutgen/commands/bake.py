"""Bake a LUT set into a folder."""

from __future__ import annotations

import os
import platform
import time
from argparse import ArgumentParser, Namespace
from dataclasses import replace
from pathlib import Path

from lutgen.commands import Outcome, device_options, progress
from lutgen.files import folders
from lutgen.solvers.paths import PHOTONS, SEEDS
from lutgen.tables import recipe as recipes
from lutgen.tables import storage, wavelengths

EXAMPLES = (
    "lutgen bake --quality draft --out my-luts",
    "lutgen bake luts/bake.toml --photons 200000 --wavelengths 12 --out my-luts --force",
)
DEFAULT_OUT = "lutgen-luts"


def arguments(parser: ArgumentParser) -> None:
    """Add the recipe, what changes it, and where the set goes."""
    parser.add_argument("recipe", nargs="?", help="TOML file; see luts/bake.toml (default: the quality as it is)")
    parser.add_argument("--out", default=DEFAULT_OUT, metavar="DIR", help="folder to make (default: %(default)s)")
    parser.add_argument(
        "--quality", choices=recipes.QUALITIES, default="standard",
        help="what the recipe starts from (default: %(default)s)",
    )  # fmt: skip
    usual = ", ".join(f"{quality} {recipe.photons}" for quality, recipe in recipes.QUALITIES.items())
    parser.add_argument(
        "--photons", type=int,
        help=f"photons per wavelength, {PHOTONS[0]} to {PHOTONS[1]} (default: the recipe's; {usual})",
    )  # fmt: skip
    usual = ", ".join(f"{quality} {recipe.wavelengths}" for quality, recipe in recipes.QUALITIES.items())
    parser.add_argument(
        "--wavelengths", choices=wavelengths.NAMES,
        help=f"so many, chosen for skin, or one every so many nm (default: the recipe's; {usual})",
    )  # fmt: skip
    parser.add_argument(
        "--seed", type=int, help=f"seed of the random streams, {SEEDS[0]} to {SEEDS[1]} (default: the recipe's, 0)"
    )
    parser.add_argument("--force", action="store_true", help="replace an existing LUT set")
    device_options.arguments(parser)
    progress.arguments(parser)


def run(options: Namespace) -> Outcome:
    """Recipe and options to a folder."""
    from lutgen.tables import bake

    imports = seconds_since_start()
    base = recipes.quality(options.quality)
    recipe = recipes.load(options.recipe, base) if options.recipe else base
    changes = {key: getattr(options, key) for key in ("photons", "wavelengths", "seed")}
    recipe = replace(recipe, **{key: value for key, value in changes.items() if value is not None})
    out = folders.check_target(options.out, options.force)
    with progress.Progress(options) as tell:
        luts = bake.bake(recipe, device=options.device, progress=tell)
        tell("write", None)
        write_start = time.perf_counter()
        luts.manifest["seconds"] = {"imports": round(imports, 4), **luts.manifest["seconds"]}
        notes = {"host": f"{platform.system()} {platform.machine()}", "baked_at": time.strftime("%Y-%m-%dT%H:%M:%S%z")}
        storage.save(luts, out, options.force, notes)
    seconds = luts.manifest["seconds"] | {
        "write": round(time.perf_counter() - write_start, 4), "total": round(seconds_since_start(), 4),
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


def seconds_since_start() -> float:
    """Seconds since this process started, imports included; 0 where the system does not say."""
    try:
        ticks = int(Path("/proc/self/stat").read_text().rsplit(")", 1)[1].split()[19])
        return time.clock_gettime(time.CLOCK_BOOTTIME) - ticks / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, AttributeError):
        return 0.0
