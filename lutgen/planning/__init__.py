"""The least model that a scene needs: `lutgen plan`.

A tolerance holds where the 95th percentile of the error of random skins of the scene stays within it: CIEDE2000 for
colors, EE differences of all ACEScg channels for profiles, these in each of eight bakes with different seeds. Least
means that no recipe one rung down holds as well: next fewer wavelengths, a quarter of the photons, or three quarters of
the nodes of one axis. Of the least recipes it is the one whose bake takes the fewest seconds, then bytes.
"""

from __future__ import annotations

from lutgen.errors import InputError
from lutgen.planning import explaining, judging, search
from lutgen.planning.explaining import Plan
from lutgen.planning.needs import Needs


def plan(needs: Needs) -> Plan:
    """The least recipe that holds; InputError where none does, or none for so few bytes or seconds.

    >>> from lutgen.planning.needs import scene
    >>> plan(scene("light", tolerance=1.0)).recipe.color.shape
    (1, 1, 1)
    """
    judged = judging.judge(needs)
    found = list(search.candidates(judged))
    if not found:
        raise InputError(
            f"tolerance = {needs.tolerance:g} ΔE00, ee_tolerance = {needs.ee_tolerance:.3g}: no recipe holds them over "
            f"these tones with up to {judging.PHOTONS[1]} photons and {search.MOST_NODES} nodes an axis; ask for less"
        )
    allowed = [recipe for recipe in found if search.fits(judged, recipe)]
    if not allowed:
        raise explaining.unaffordable(judged, [judged.cost(recipe) for recipe in found])
    return explaining.explained(judged, search.chosen(judged, allowed))
