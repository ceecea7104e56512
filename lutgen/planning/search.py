"""The search for recipes that hold a scene's tolerances, and the choice of the least among them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from lutgen.planning import prediction
from lutgen.planning.judge import LEEWAY, PHOTONS, SPACINGS, Judge, axis_of, middles, resized
from lutgen.planning.needs import Needs
from lutgen.skin import chromophores
from lutgen.tables import wavelengths
from lutgen.tables.axes import Grid
from lutgen.tables.recipe import RINGS, Recipe

COLOR_MARGIN = 0.97
"""Share of the tolerance that predicted colors may take: another 1,500 skins differ by so much in their percentile."""
PROFILE_MARGIN = 0.95
"""Share of the tolerance that profiles may take at most: other skins, and the noise of what they are compared with."""
RING_SHARE = 1 / 3
"""Share of the profile's tolerance that rings alone may take."""
NEGLIGIBLE = 0.1
MOST_NODES = 64


def candidates(judged: Judge) -> Iterator[Recipe]:
    """Recipes that hold: per rule the least color table, and profile tables from coarse with many photons to fine."""
    needs, yielded, fewer = judged.needs, 0, ""
    for rule in wavelengths.NAMES:
        if yielded and (rule.endswith("nm") or _negligible(judged, fewer)):
            return  # regular rules cost a multiple of the fitted ones
        fewer = rule
        color = least_color(judged, rule)
        if color is None:
            continue
        base = Recipe(wavelengths=rule, totals="anchored", color=color)
        base = replace(base, skin=replace(base.skin, oxygenation=sum(needs.oxygenation) / 2))
        if not judged.with_profile:
            yielded += 1
            yield replace(base, photons=PHOTONS[0], rings=RINGS[0], profile=fixed(needs))
            continue
        rings = enough_rings(judged)
        of_rule = list(profiled(judged, base, rings))
        if of_rule and max(slack(judged, recipe) for recipe in of_rule) <= LEEWAY and rings < RINGS[-1]:
            of_rule += profiled(judged, base, 2 * rings)  # what rings no longer err by frees photons and nodes
        yielded += len(of_rule)
        yield from of_rule
        if of_rule and all(judged.rungs(recipe).get("wavelengths", np.inf) <= LEEWAY for recipe in of_rule):
            return  # fewer wavelengths do, so more are never the least


def _negligible(judged: Judge, rule: str) -> bool:
    """Whether a rule errs so little that more wavelengths are never the least."""
    off = judged.colors.quadrature(rule) / judged.needs.tolerance
    if judged.with_profile:
        off = max(off, judged.profiles.quadrature(rule) / judged.needs.ee_tolerance)
    return off < NEGLIGIBLE


def chosen(judged: Judge, allowed: list[Recipe]) -> Recipe:
    """The cheapest of those with no rung down that may hold; where there is none, the one that comes nearest."""
    least = [recipe for recipe in allowed if slack(judged, recipe) > LEEWAY]
    return min(least, key=judged.cost) if least else max(allowed, key=lambda recipe: slack(judged, recipe))


def slack(judged: Judge, recipe: Recipe) -> float:
    """The share of the tolerance that the best rung down is likely to take: above 1 it does not hold."""
    return min(judged.rungs(recipe).values(), default=np.inf)


def fits(judged: Judge, recipe: Recipe) -> bool:
    """Whether a recipe stays within the bytes and seconds allowed."""
    spent, size = judged.cost(recipe)
    most = judged.needs.seconds, judged.needs.bytes
    return (most[0] is None or spent <= most[0]) and (most[1] is None or size <= most[1])


def fixed(needs: Needs) -> Grid:
    """A grid of one node, in the middle of the scene."""
    return Grid(**{axis: axis_of(axis, (middle,) * 2, 1, "linear") for axis, middle in middles(needs).items()})


def least_color(judged: Judge, rule: str) -> Grid | None:
    """The color table with the fewest nodes whose predicted error leaves its margin, or None where none does."""
    limit = COLOR_MARGIN * judged.needs.tolerance
    if judged.colors.quadrature(rule) > limit:
        return None

    def error(grid: Grid) -> float:
        """The systematic error of a grid."""
        return judged.colors.error(rule, grid)

    grid = _spaced(judged.coarsest_color, error)
    while error(grid) > limit:
        grid = _finer(grid, error)
        if grid is None:
            return None
    return _pruned(grid, lambda coarser: error(coarser) <= limit)


def enough_rings(judged: Judge) -> int:
    """The fewest rings that take but a share of the profile's tolerance."""
    most = RING_SHARE * judged.needs.ee_tolerance
    return next((n for n in RINGS if judged.profiles.rings(n) <= most), RINGS[-1])


def profiled(judged: Judge, base: Recipe, rings: int) -> Iterator[Recipe]:
    """Recipes that hold the profile's tolerance, from the coarsest table that does with many photons to finer ones."""
    needs, rule = judged.needs, base.wavelengths

    def error(grid: Grid) -> float:
        """The systematic error of a grid."""
        return prediction.largest(judged.profiles.systematic(rule, rings, grid))

    grid = _spaced(judged.coarsest_profile, error)
    before, photons = np.inf, PHOTONS[1]
    while True:
        if error(grid) < PROFILE_MARGIN * needs.ee_tolerance:
            recipe = least_photons(judged, replace(base, rings=rings, profile=grid), photons)
            if recipe is not None:
                yield recipe
                photons = recipe.photons
                # Finer tables save photons, until a rung down holds too: go on only for what is still too slow.
                spent, rungs = judged.cost(recipe)[0], judged.rungs(recipe)
                held = [name for name, share in rungs.items() if share <= LEEWAY]
                if held and "photons" not in held and (spent >= before or spent <= (needs.seconds or np.inf)):
                    return
                before = spent
        grid = _finer(grid, error)
        if grid is None:
            return


def least_photons(judged: Judge, recipe: Recipe, most: int = PHOTONS[1]) -> Recipe | None:
    """The recipe with the fewest photons, up to `most`, with which its profiles hold in eight bakes, or None."""
    off = judged.profiles.systematic(recipe.wavelengths, recipe.rings, recipe.profile)

    def holds(octave: float) -> bool:
        """Whether profiles of 2 ** octave photons keep their tolerance."""
        spread = judged.profiles.with_noise(off, recipe.wavelengths, 2**octave)
        return spread.certain <= PROFILE_MARGIN * judged.needs.ee_tolerance

    least, high = np.log2(PHOTONS[0]), np.log2(most)
    if not holds(high):
        return None if most == PHOTONS[1] else least_photons(judged, recipe)
    while high > least and holds(low := max(high - 2, least)):
        high = low
    low = max(high - 2, least)
    while high - low > 1 / 32:
        middle = (low + high) / 2
        low, high = (low, middle) if holds(middle) else (middle, high)
    return replace(recipe, photons=int(np.ceil(2**high)))


def _finer(grid: Grid, error: Callable[[Grid], float]) -> Grid | None:
    """The grid with one node more, where that lowers the error most, in that axis's best spacing; None at the end."""
    counts = {axis: getattr(grid, axis).count for axis in chromophores.NAMES}
    finer = {axis: resized(grid, axis, n + 1) for axis, n in counts.items() if 1 < n < MOST_NODES}
    if not finer:
        return None
    axis = min(finer, key=lambda axis: error(finer[axis]))
    return min(_respaced(finer[axis], axis), key=error)


def _spaced(grid: Grid, error: Callable[[Grid], float]) -> Grid:
    """The grid in the spacings that err least, axis by axis."""
    for axis in chromophores.NAMES:
        grid = min(_respaced(grid, axis), key=error)
    return grid


def _respaced(grid: Grid, axis: str) -> Iterator[Grid]:
    """The grid, then with the other spacings of an axis."""
    yield grid
    if getattr(grid, axis).count > 1:
        for spacing in SPACINGS[axis]:
            if spacing != getattr(grid, axis).spacing:
                yield replace(grid, **{axis: replace(getattr(grid, axis), spacing=spacing)})


def _pruned(grid: Grid, holds: Callable[[Grid], bool]) -> Grid:
    """The grid without nodes that it can spare, one by one, whatever the spacing of their axis."""
    for axis in chromophores.NAMES:
        while (count := getattr(grid, axis).count) > 2:
            fewer = _respaced(resized(grid, axis, count - 1), axis)
            coarser = next((smaller for smaller in fewer if holds(smaller)), None)
            if coarser is None:
                break
            grid = coarser
    return grid
