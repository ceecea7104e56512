"""Does `lutgen plan` keep its word? Random scenes, planned, baked, compared: `python tests/planning/bench_plan.py`.

Three counts: plans whose recipe holds its tolerances when it is verified (eight bakes, a reference of its own); scenes
whose predicted errors lie within a factor 2 of the measured ones; scenes where no rung down the ladder holds as well.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict, dataclass

import numpy as np

from lutgen.planning import judge, prediction, verify
from lutgen.planning.needs import VARIABLE, Needs, scene
from lutgen.planning.plan import Plan, least
from lutgen.skin import chromophores
from lutgen.skin.chromophores import EUMELANIN, HEMOGLOBIN, MELANIN
from lutgen.skin.tissue import PRESETS
from lutgen.solvers.paths import PathTable

SEED, SCENES, REFERENCE_PHOTONS = 6, 20, 2**24
HEAD = (
    "| tones | varies | ΔE00 | EE | mm | K, photons, color, profile | s | ΔE00 predicted, measured | EE predicted, "
    "measured | holds | within 2 × | rungs down that hold |"
)


@dataclass(frozen=True)
class Row:
    """One scene: what was asked, planned, predicted and measured, and which rungs down held."""

    tones: str
    vary: str
    tolerance: float
    ee_tolerance: float
    mm_per_pixel: float
    recipe: str
    seconds: float
    color: tuple[float, float]
    profile: tuple[float, float]
    holds: bool
    within_2: bool
    rungs: int
    held_below: tuple[str, ...]


def random_scene(rng: np.random.Generator) -> tuple[str, str, Needs]:
    """Tones, what varies, and the needs: tolerances, scale, tones and what varies at random."""
    kind = rng.choice(["all", "presets", "ranges"], p=[0.2, 0.3, 0.5])
    vary = [name for name, chance in zip(VARIABLE, (0.8, 0.4, 0.7, 0.3), strict=True) if rng.uniform() < chance]
    vary = vary or ["melanin"]
    names = rng.choice(list(PRESETS), 2, replace=False)
    ranges = []
    for name, (low, high) in (("melanin", MELANIN), ("eumelanin", EUMELANIN), ("hemoglobin", HEMOGLOBIN)):
        at = sorted(rng.uniform(0, 1, 2))
        span = [low + u * (high - low) if name == "eumelanin" else low * (high / low) ** u for u in at]
        ranges.append(f"{name}={span[0]:.4g}:{span[1]:.4g}" if name in vary else f"{name}={span[0]:.4g}")
    if kind == "presets":
        skins = [PRESETS[name] for name in names]
        tones = ",".join(names)
        for name in chromophores.NAMES:
            values = sorted(getattr(skin, name) for skin in skins)
            if name not in vary and values[0] < values[1]:
                vary.append(name)
    else:
        tones = "all" if kind == "all" else ",".join(ranges)
    tolerance, energy, scale = (
        float(f"{low * (high / low) ** rng.uniform():.3g}") for low, high in ((0.15, 2), (0.005, 0.05), (0.02, 1))
    )
    limits = {"tolerance": tolerance, "ee_tolerance": energy, "mm_per_pixel": scale}
    return tones, ",".join(vary), scene(tones, ",".join(vary), **limits)


def put_to_the_test(tones: str, vary: str, needs: Needs, reference: PathTable, bakes: int = prediction.BAKES) -> Row:
    """Plan a scene, bake the plan and its rungs down, and compare."""
    plan = least(needs)
    right = verify.truth(needs, plan.recipe, reference)
    measured = verify.verify(needs, plan.recipe, right, plan.profile, bakes)
    color, profile = max(measured.color), max(measured.profile)
    pairs = (plan.color_error["total"], color), (plan.profile_error["total"], profile)
    rungs = dict(judge.ladder(plan.recipe, plan.profile))
    held = tuple(
        name
        for name, lower in rungs.items()
        if verify.verify(needs, lower, right, plan.profile, bakes, stop=True).holds(needs)
    )
    return Row(
        tones, vary, needs.tolerance, needs.ee_tolerance, needs.mm_per_pixel, _recipe(plan), plan.cost[0],
        pairs[0], pairs[1], measured.holds(needs), all(0.5 <= p / m <= 2 for p, m in pairs), len(rungs), held,
    )  # fmt: skip


def _recipe(plan: Plan) -> str:
    recipe = plan.recipe
    color, profile = ("×".join(map(str, grid.shape[::-1])) for grid in (recipe.color, recipe.profile))
    shape = f"{profile} of {recipe.rings} rings" if plan.profile else "none"
    return f"K {recipe.wavelengths}, {recipe.photons:,}, {color}, {shape}"


def rows(scenes: int, photons: int, bakes: int = prediction.BAKES, seed: int = SEED):
    """Rows one by one."""
    rng, reference = np.random.default_rng(seed), verify.reference(photons)
    for _ in range(scenes):
        yield put_to_the_test(*random_scene(rng), reference, bakes)


def line(row: Row) -> str:
    """A row of the table."""
    return (
        f"| {row.tones} | {row.vary} | {row.tolerance:g} | {row.ee_tolerance:g} | {row.mm_per_pixel:g} | "
        f"{row.recipe} | {row.seconds:.2f} | {row.color[0]:.3g} {row.color[1]:.3g} | "
        f"{row.profile[0]:.2g} {row.profile[1]:.2g} | "
        f"{'yes' if row.holds else 'NO'} | {'yes' if row.within_2 else 'NO'} | "
        f"{', '.join(row.held_below) or 'none'} of {row.rungs} |"
    )


def main() -> None:
    """Print the table and the counts; exit status 1 where they fall short."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=SCENES)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--photons", type=int, default=REFERENCE_PHOTONS, help="of the reference, per wavelength")
    parser.add_argument("--json", metavar="FILE", help="rows to write")
    options = parser.parse_args()
    print(f"{HEAD}\n|" + "---|" * 12)
    found = []
    for row in rows(options.scenes, options.photons, seed=options.seed):
        found.append(row)
        print(line(row), flush=True)
    holds, near = sum(row.holds for row in found), sum(row.within_2 for row in found)
    least = sum(not row.held_below for row in found)
    print(f"\nof {len(found)} scenes (seed {options.seed}): {holds} hold, {near} are within a factor 2 of predicted, "
          f"{least} have no rung down that holds")  # fmt: skip
    if options.json:
        with open(options.json, "w") as file:
            json.dump([asdict(row) for row in found], file, indent=1)
    share = len(found) / 20
    sys.exit(0 if holds >= 20 * share and near >= 18 * share and least >= 15 * share else 1)


if __name__ == "__main__":
    main()
