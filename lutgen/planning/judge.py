"""What judges recipes for a scene: predicted errors and costs, and the rungs below a recipe."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from lutgen.planning import costs, prediction
from lutgen.planning.needs import Needs
from lutgen.planning.prediction import Colors, Profiles
from lutgen.skin import chromophores
from lutgen.solvers import exact_totals
from lutgen.tables import wavelengths
from lutgen.tables.axes import Axis, Grid
from lutgen.tables.recipe import Recipe

LEEWAY = 1.1
"""A rung down counts as holding up to this times the tolerance: eight bakes differ so much from another eight."""
PHOTONS = 256, 2**28
"""The fewest and the most that a plan asks for: below 64 totals cannot be anchored."""
SPACINGS = {"melanin": ("linear", "cbrt", "log"), "hemoglobin": ("linear", "cbrt", "log"),
            "eumelanin": ("linear", "power:0.6")}  # fmt: skip
_PLAIN = "8"


@dataclass(frozen=True)
class Judge:
    """Predicts errors of recipes for one scene; the coarsest tables are what others are refined from."""

    needs: Needs
    colors: Colors
    profiles: Profiles
    with_profile: bool
    coarsest_color: Grid
    coarsest_profile: Grid

    def asked(self, needs: Needs) -> Judge:
        """The same scene asked with other tolerances, bytes or seconds: what has been worked out about it stays."""
        return replace(self, needs=needs, with_profile=self.profiles.unscattered() > needs.ee_tolerance)

    def color(self, recipe: Recipe) -> float:
        """Color error, 95th percentile of ΔE00."""
        return self.colors.error(recipe.wavelengths, recipe.color)

    def profile(self, recipe: Recipe) -> prediction.Spread:
        """Profile error, 95th percentile of EE differences, over seeds."""
        off = self.profiles.systematic(recipe.wavelengths, recipe.rings, recipe.profile)
        return self.profiles.with_noise(off, recipe.wavelengths, recipe.photons)

    def share(self, recipe: Recipe) -> float:
        """What a recipe is likely to err by, over the tolerance: of color or profile, whichever is more."""
        color_share = self.color(recipe) / self.needs.tolerance
        if color_share > 2 or not self.with_profile:
            return color_share
        return max(color_share, self.profile(recipe).likely / self.needs.ee_tolerance)

    def rungs(self, recipe: Recipe) -> dict[str, float]:
        """The share that each rung down is likely to take of the tolerance: above 1 for all of the least recipe."""
        if recipe not in self._rungs:
            self._rungs[recipe] = {name: self.share(lower) for name, lower in ladder(recipe, self.with_profile)}
        return self._rungs[recipe]

    @cached_property
    def _rungs(self) -> dict[Recipe, dict[str, float]]:
        return {}

    def cost(self, recipe: Recipe) -> tuple[float, int]:
        """Seconds, then bytes."""
        K = len(wavelengths.load(recipe.wavelengths).wavelength_nm)
        spent = costs.table_bytes(recipe, K, "oxygenation" in self.needs.varying)
        return costs.total_seconds(recipe), sum(spent.values())


def judge(needs: Needs) -> Judge:
    """What judges recipes for a scene."""
    colors, profiles = Colors(needs, exact_totals.exact_totals(Recipe().skin)), Profiles(needs)
    coarse_color = coarsest(needs, lambda alone, grid: Colors(alone, colors.exact).interpolation(_PLAIN, grid))
    coarse_profile = coarsest(needs, lambda alone, grid: Profiles(alone).interpolation(_PLAIN, grid))
    with_profile = profiles.unscattered() > needs.ee_tolerance
    return Judge(needs, colors, profiles, with_profile, coarse_color, coarse_profile)


def ladder(recipe: Recipe, with_profile: bool = True) -> Iterator[tuple[str, Recipe]]:
    """Recipes one rung down: next fewer wavelengths, photons / 4, 3/4 of an axis's nodes (one that varies keeps 2)."""
    place = wavelengths.NAMES.index(recipe.wavelengths)
    if place:
        yield "wavelengths", replace(recipe, wavelengths=wavelengths.NAMES[place - 1])
    if recipe.photons > PHOTONS[0]:
        yield "photons", replace(recipe, photons=recipe.photons // 4)
    for table in ("color", "profile") if with_profile else ("color",):
        grid = getattr(recipe, table)
        for axis in chromophores.NAMES:
            count = getattr(grid, axis).count
            if count > 2:
                yield f"{table} {axis}", replace(recipe, **{table: resized(grid, axis, count * 3 // 4)})


def resized(grid: Grid, axis: str, count: int) -> Grid:
    """A grid with another number of nodes along one axis."""
    return replace(grid, **{axis: replace(getattr(grid, axis), count=count)})


def coarsest(needs: Needs, error: Callable[[Needs, Grid], float]) -> Grid:
    """Two nodes along each axis that varies, with the spacing that errs least along it alone with four nodes."""
    center, chosen = middles(needs), {}
    for axis in chromophores.NAMES:
        span = getattr(needs, axis)
        if span[0] == span[1]:
            chosen[axis] = axis_of(axis, span, 1, "linear")
            continue
        others = {other: (value,) * 2 for other, value in center.items() if other != axis}
        alone = replace(needs, **others)
        grid = {other: axis_of(other, span, 1, "linear") for other, span in others.items()}
        errors = {
            spacing: error(alone, Grid(**grid, **{axis: axis_of(axis, span, 4, spacing)})) for spacing in SPACINGS[axis]
        }
        chosen[axis] = axis_of(axis, span, 2, min(errors, key=errors.__getitem__))
    return Grid(**chosen)


def middles(needs: Needs) -> dict[str, float]:
    """The middle of each axis, in the spacing that random skins are drawn with."""
    return {
        axis: float(np.mean(span) if axis == "eumelanin" else np.sqrt(span[0] * span[1]))
        for axis, span in ((axis, getattr(needs, axis)) for axis in chromophores.NAMES)
    }


def axis_of(name: str, span: tuple[float, ...], count: int, spacing: str) -> Axis:
    """An axis of a chromophore."""
    return Axis(name, "1", span[0], span[-1], count, spacing)
