"""The least model that a scene needs: the cheapest recipe, by predicted seconds, then bytes, that holds its tolerances.

A tolerance holds where the 95th percentile of the error of random skins of the scene stays within it, for profiles in
each of eight bakes with different seeds. Least means that no recipe one rung down holds as well: next fewer
wavelengths, a quarter of the photons, or three quarters of the nodes of one axis.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from lutgen import costs, prediction, quadrature
from lutgen.axes import Axis, Grid
from lutgen.config import RINGS, Recipe
from lutgen.errors import InputError
from lutgen.needs import Needs
from lutgen.prediction import Colors, Profiles

AXES = ("melanin", "eumelanin", "hemoglobin")
COLOR_MARGIN = 0.97
"""Share of the tolerance that predicted colors may take: another 1,500 skins differ by so much in their percentile."""
LEEWAY = 1.05
"""A rung down counts as holding up to this times the tolerance."""
RING_SHARE = 1 / 3
"""Share of the profile's tolerance that rings alone may take."""
PHOTONS = 2048, 2**28
SPACINGS = {"melanin": ("linear", "cbrt", "log"), "hemoglobin": ("linear", "cbrt", "log"),
            "eumelanin": ("linear", "power:0.6")}  # fmt: skip
_MOST_NODES, _PLAIN = 64, "8"


@dataclass(frozen=True)
class Viewer:
    """What the viewer needs: taps at most, the tier that has them, and its EE difference at the scene's scale."""

    taps: int
    tier: str
    ee_difference: float


@dataclass(frozen=True)
class Plan:
    """A recipe for needs, what it is predicted to err by and to cost, and why each choice is the least."""

    needs: Needs
    recipe: Recipe
    profile: bool
    viewer: Viewer
    color_error: dict[str, float]
    profile_error: dict[str, float]
    seconds: dict[str, float]
    bytes: dict[str, int]
    why: tuple[str, ...]

    @property
    def cost(self) -> tuple[float, int]:
        """What is least: seconds, then bytes."""
        return sum(self.seconds.values()), sum(self.bytes.values())


@dataclass(frozen=True)
class Judge:
    """Predicts errors of recipes for one scene."""

    needs: Needs
    colors: Colors
    profiles: Profiles
    with_profile: bool

    @cached_property
    def coarsest_color(self) -> Grid:
        """The color table that others are refined from."""
        return coarsest(self.needs, lambda alone, grid: Colors(alone, self.colors.exact).interpolation(_PLAIN, grid))

    @cached_property
    def coarsest_profile(self) -> Grid:
        """The profile table that others are refined from."""
        return coarsest(self.needs, lambda alone, grid: Profiles(alone).interpolation(_PLAIN, grid))

    def color(self, recipe: Recipe) -> float:
        """Color error, 95th percentile of ΔE00."""
        return self.colors.error(recipe.wavelengths, recipe.color)

    def profile(self, recipe: Recipe) -> prediction.Spread:
        """Profile error, 95th percentile of EE differences, over seeds."""
        off = self.profiles.systematic(recipe.wavelengths, recipe.rings, recipe.profile)
        return self.profiles.with_noise(off, recipe.wavelengths, recipe.photons)

    def share(self, recipe: Recipe) -> float:
        """What a recipe is likely to err by, over the tolerance: of color or profile, whichever is more."""
        found = self.color(recipe) / self.needs.tolerance
        if found > 2 or not self.with_profile:
            return found
        return max(found, self.profile(recipe).likely / self.needs.ee_tolerance)

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
        K = len(quadrature.load(recipe.wavelengths).wavelength_nm)
        spent = costs.table_bytes(recipe, K, "oxygenation" in self.needs.varying)
        return costs.total_seconds(recipe), sum(spent.values())


def judge(needs: Needs, skin=None) -> Judge:
    """What judges recipes for a scene."""
    profiles = Profiles(needs)
    exact = prediction.exact_totals(skin or Recipe().skin)
    return Judge(needs, Colors(needs, exact), profiles, profiles.unscattered() > needs.ee_tolerance)


def ladder(recipe: Recipe, with_profile: bool = True) -> Iterator[tuple[str, Recipe]]:
    """Recipes one rung down: next fewer wavelengths, photons / 4, 3/4 of an axis's nodes (one that varies keeps 2)."""
    place = quadrature.NAMES.index(recipe.wavelengths)
    if place:
        yield "wavelengths", replace(recipe, wavelengths=quadrature.NAMES[place - 1])
    if recipe.photons > PHOTONS[0]:
        yield "photons", replace(recipe, photons=max(recipe.photons // 4, PHOTONS[0]))
    for table in ("color", "profile") if with_profile else ("color",):
        grid = getattr(recipe, table)
        for axis in AXES:
            count = getattr(grid, axis).count
            if count > 2:
                yield f"{table} {axis}", replace(recipe, **{table: resized(grid, axis, count * 3 // 4)})


def resized(grid: Grid, axis: str, count: int) -> Grid:
    """A grid with another number of nodes along one axis."""
    return replace(grid, **{axis: replace(getattr(grid, axis), count=count)})


def plan(needs: Needs) -> Plan:
    """The cheapest recipe that holds; InputError where none does, or none for so few bytes or seconds.

    >>> from lutgen.needs import scene
    >>> plan(scene("light", tolerance=1.0)).recipe.color.shape
    (1, 1, 1)
    """
    from lutgen import explaining

    judged = judge(needs)
    found = list(candidates(judged))
    if not found:
        raise InputError(
            f"tolerance = {needs.tolerance:g} ΔE00, ee_tolerance = {needs.ee_tolerance:g}: no recipe holds them over "
            f"these tones with up to {PHOTONS[1]} photons and {_MOST_NODES} nodes an axis; ask for less"
        )
    allowed = [recipe for recipe in found if fits(judged, recipe)]
    if not allowed:
        raise InputError(explaining.unaffordable(needs, [judged.cost(recipe) for recipe in found]))
    return explaining.explained(judged, chosen(judged, allowed))


def chosen(judged: Judge, allowed: list[Recipe]) -> Recipe:
    """The cheapest of those with no rung down that may hold; where there is none, the one that comes nearest."""

    def slack(recipe: Recipe) -> float:
        return min(judged.rungs(recipe).values(), default=np.inf)

    least = [recipe for recipe in allowed if slack(recipe) > LEEWAY]
    return min(least, key=judged.cost) if least else max(allowed, key=slack)


def fits(judged: Judge, recipe: Recipe) -> bool:
    """Whether a recipe stays within the bytes and seconds allowed."""
    spent, size = judged.cost(recipe)
    most = judged.needs.seconds, judged.needs.bytes
    return (most[0] is None or spent <= most[0]) and (most[1] is None or size <= most[1])


def candidates(judged: Judge) -> Iterator[Recipe]:
    """Recipes that hold: per rule the least color table, and profile tables from coarse with many photons to fine."""
    needs, found = judged.needs, 0
    for rule in quadrature.NAMES:
        if found and rule.endswith("nm"):
            return  # they cost a multiple of the fitted rules
        color = least_color(judged, rule)
        if color is None:
            continue
        base = Recipe(wavelengths=rule, totals="anchored", color=color)
        base = replace(base, skin=replace(base.skin, oxygenation=sum(needs.oxygenation) / 2))
        if not judged.with_profile:
            found += 1
            yield replace(base, photons=PHOTONS[0], rings=RINGS[0], profile=fixed(needs))
            continue
        spared = []
        for recipe in profiled(judged, base):
            found += 1
            spared.append(judged.rungs(recipe).get("wavelengths", np.inf) <= LEEWAY)
            yield recipe
        if spared and all(spared):
            return  # fewer wavelengths do, so more are never the least


def fixed(needs: Needs) -> Grid:
    """A grid of one node, in the middle of the scene."""
    return Grid(**{axis: _axis(axis, (middle,) * 2, 1, "linear") for axis, middle in _middles(needs).items()})


def _middles(needs: Needs) -> dict[str, float]:
    return {
        axis: float(np.mean(span) if axis == "eumelanin" else np.sqrt(span[0] * span[1]))
        for axis, span in ((axis, getattr(needs, axis)) for axis in AXES)
    }


def _axis(name: str, span: tuple[float, float], count: int, spacing: str) -> Axis:
    return Axis(name, "1", *span, count, spacing)


def least_color(judged: Judge, rule: str) -> Grid | None:
    """The color table with the fewest nodes whose predicted error leaves its margin, or None where none does."""
    needs, limit = judged.needs, COLOR_MARGIN * judged.needs.tolerance
    if judged.colors.quadrature(rule) > limit:
        return None

    def error(grid: Grid) -> float:
        return judged.colors.error(rule, grid)

    grid = judged.coarsest_color
    while error(grid) > limit:
        finer = list(_finer(grid))
        if not finer:
            return None
        grid = min(finer, key=error)
    return _pruned(grid, lambda coarser: error(coarser) <= limit)


def profiled(judged: Judge, base: Recipe) -> Iterator[Recipe]:
    """Recipes that hold the profile's tolerance, from the coarsest table that does with many photons to finer ones."""
    needs, rule = judged.needs, base.wavelengths
    rings = next((n for n in RINGS if judged.profiles.rings(n) <= RING_SHARE * needs.ee_tolerance), RINGS[-1])

    def error(grid: Grid) -> float:
        return prediction.largest(judged.profiles.systematic(rule, rings, grid))

    grid = judged.coarsest_profile
    before = np.inf
    while True:
        if error(grid) < needs.ee_tolerance:
            recipe = least_photons(judged, replace(base, rings=rings, profile=grid))
            if recipe is not None:
                yield recipe
                # Finer tables save photons, until a rung down holds too: go on only for what is still too slow.
                spent, rungs = judged.cost(recipe)[0], judged.rungs(recipe)
                held = [name for name, share in rungs.items() if share <= LEEWAY]
                if held and "photons" not in held and (spent >= before or spent <= (needs.seconds or np.inf)):
                    return
                before = spent
        finer = list(_finer(grid))
        if not finer:
            return
        grid = min(finer, key=error)


def least_photons(judged: Judge, recipe: Recipe) -> Recipe | None:
    """The recipe with the fewest photons with which its profiles hold in eight bakes, or None where none do."""
    off = judged.profiles.systematic(recipe.wavelengths, recipe.rings, recipe.profile)

    def holds(photons: float) -> bool:
        found = judged.profiles.with_noise(off, recipe.wavelengths, photons)
        return found.certain <= judged.needs.ee_tolerance

    if not holds(PHOTONS[1]):
        return None
    low, high = np.log2(PHOTONS)
    while high - low > 1 / 32:
        middle = (low + high) / 2
        low, high = (low, middle) if holds(2**middle) else (middle, high)
    return replace(recipe, photons=int(np.ceil(2**high)))


def coarsest(needs: Needs, error: Callable[[Needs, Grid], float]) -> Grid:
    """Two nodes along each axis that varies, with the spacing that errs least along it alone with four nodes."""
    middles, chosen = _middles(needs), {}
    for axis in AXES:
        span = getattr(needs, axis)
        if span[0] == span[1]:
            chosen[axis] = _axis(axis, span, 1, "linear")
            continue
        others = {other: (value,) * 2 for other, value in middles.items() if other != axis}
        alone = replace(needs, **others)
        grid = {other: _axis(other, span, 1, "linear") for other, span in others.items()}
        errors = {
            spacing: error(alone, Grid(**grid, **{axis: _axis(axis, span, 4, spacing)})) for spacing in SPACINGS[axis]
        }
        chosen[axis] = _axis(axis, span, 2, min(errors, key=errors.__getitem__))
    return Grid(**chosen)


def _finer(grid: Grid) -> Iterator[Grid]:
    """The grid with a node more along each axis that varies."""
    for axis in AXES:
        if 1 < (count := getattr(grid, axis).count) < _MOST_NODES:
            yield resized(grid, axis, count + 1)


def _pruned(grid: Grid, holds: Callable[[Grid], bool]) -> Grid:
    """The grid without nodes that it can spare, one by one, whatever the spacing of their axis."""
    for axis in AXES:
        while (count := getattr(grid, axis).count) > 2:
            fewer = resized(grid, axis, count - 1)
            spaced = (
                replace(fewer, **{axis: replace(getattr(fewer, axis), spacing=name)}) for name in SPACINGS[axis]
            )
            coarser = next((one for one in (fewer, *spaced) if holds(one)), None)
            if coarser is None:
                break
            grid = coarser
    return grid
