"""A plan in figures and words: what its parts err by, why each choice is the least, what less money would buy."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lutgen.errors import InputError, summary
from lutgen.planning import costs, judge, search
from lutgen.planning.judge import Judge
from lutgen.planning.needs import EE_TOLERANCE, TOLERANCE, Needs
from lutgen.tables import wavelengths
from lutgen.tables.axes import Grid
from lutgen.tables.recipe import Recipe


@dataclass(frozen=True)
class Viewer:
    """What the viewer needs: taps at most, the tier that has them, its EE difference, at which measured scale, and
    whether that is within the tolerance (else it is the best tier)."""

    taps: int
    tier: str
    ee_difference: float
    at_mm_per_pixel: float
    holds: bool


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

    __repr__ = summary

    @property
    def cost(self) -> tuple[float, int]:
        """What is least: seconds, then bytes."""
        return sum(self.seconds.values()), sum(self.bytes.values())


def least(needs: Needs) -> Plan:
    """The least recipe that holds; InputError where none does, or none for so few bytes or seconds.

    >>> from lutgen.planning.needs import scene
    >>> least(scene("light", tolerance=1.0)).recipe.color.shape
    (1, 1, 1)
    """
    judged = judge.judge(needs)
    holding = list(search.candidates(judged))
    if not holding:
        raise InputError(
            f"tolerance = {needs.tolerance:g} ΔE00, ee_tolerance = {needs.ee_tolerance:.3g}: no recipe holds them over "
            f"these tones with up to {judge.PHOTONS[1]} photons and {search.MOST_NODES} nodes an axis; ask for less"
        )
    allowed = [recipe for recipe in holding if search.fits(judged, recipe)]
    if not allowed:
        raise unaffordable(judged, [judged.cost(recipe) for recipe in holding])
    return explained(judged, search.chosen(judged, allowed))


def explained(judged: Judge, recipe: Recipe) -> Plan:
    """The plan of a recipe."""
    needs, K = judged.needs, len(wavelengths.load(recipe.wavelengths).wavelength_nm)
    return Plan(
        needs, recipe, judged.with_profile, viewer(judged), color_error(judged, recipe), profile_error(judged, recipe),
        costs.seconds(recipe), costs.table_bytes(recipe, K, "oxygenation" in needs.varying), why(judged, recipe),
    )  # fmt: skip


def viewer(judged: Judge) -> Viewer:
    """The cheapest tier within the profile's tolerance at the scene's scale, with the taps that its footprint takes."""
    needs = judged.needs
    if not judged.with_profile:
        return Viewer(0, "off", judged.profiles.unscattered(), needs.mm_per_pixel, True)
    tiers = costs.tiers()
    tier = next((tier for tier in tiers if tier.holds(needs.mm_per_pixel, needs.ee_tolerance)), tiers[-1])
    footprint = judged.profiles.reach_mm() / needs.mm_per_pixel  # as gather.frag.glsl takes its taps
    taps = int(np.clip(np.ceil(4 * footprint), 8, tier.taps))
    scale, error = tier.error(needs.mm_per_pixel)
    return Viewer(taps, tier.name, error, scale, tier.holds(needs.mm_per_pixel, needs.ee_tolerance))


def color_error(judged: Judge, recipe: Recipe) -> dict[str, float]:
    """ΔE00 of each part alone and of all together."""
    colors, rule = judged.colors, recipe.wavelengths
    return {
        "quadrature": colors.quadrature(rule),
        "interpolation": colors.interpolation(rule, recipe.color),
        "noise": 0.0,
        "total": colors.error(rule, recipe.color),
    }


def profile_error(judged: Judge, recipe: Recipe) -> dict[str, float]:
    """EE differences of each part alone, and of all together as likely and at most."""
    if not judged.with_profile:
        unscattered = judged.profiles.unscattered()
        return {"no profile": unscattered, "total": unscattered, "at most": unscattered}
    profiles, rule = judged.profiles, recipe.wavelengths
    total = judged.profile(recipe)
    nothing = np.zeros((1, 1, 1, 1))
    return {
        "quadrature": profiles.quadrature(rule), "interpolation": profiles.interpolation(rule, recipe.profile),
        "rings": profiles.rings(recipe.rings), "noise": profiles.with_noise(nothing, rule, recipe.photons).likely,
        "total": total.likely, "at most": total.certain,
    }  # fmt: skip


def why(judged: Judge, recipe: Recipe) -> tuple[str, ...]:
    """Five lines: totals, wavelengths, photons, color table, profile table."""
    needs, rungs = judged.needs, judge.ladder(recipe, judged.with_profile)
    lower = {name: _would(judged, rung) for name, rung in rungs}
    alone = judged.colors.noise(recipe.wavelengths, recipe.photons)
    lines = [
        "totals: anchored, for a bake computes exact totals anyway to check itself, and with them color has no noise; "
        f"without, noise alone would be ΔE00 {alone:.2g}"
    ]
    fewer = wavelengths.NAMES[max(wavelengths.NAMES.index(recipe.wavelengths) - 1, 0)]
    lines.append(
        f"wavelengths: {recipe.wavelengths}; " + (f"with {fewer}: {lower['wavelengths']}" if "wavelengths" in lower
        else "there is no rule with fewer")
    )  # fmt: skip
    photons = f"with a quarter: {lower['photons']}" if "photons" in lower else "as few as a trace takes"
    lines.append(f"photons: {recipe.photons:,}; {photons}")
    for table in ("color", "profile"):
        if table == "profile" and not judged.with_profile:
            lines.append(
                f"profile: none; {needs.from_mm:.3g} mm, a pixel's own disc, takes in all but "
                f"{judged.profiles.unscattered():.2g} of the light, so let the viewer not scatter (tier=off)"
            )
            continue
        fewer = [f"{name.split()[1]} {text}" for name, text in lower.items() if name.startswith(f"{table} ")]
        text = f"{table}: {nodes(getattr(recipe, table))}; " + (
            f"with 3/4 of an axis: {', '.join(fewer)}" if fewer else "an axis that varies has 2 nodes at least"
        )
        if table == "profile":
            text += f"; {recipe.rings} rings err by EE {judged.profiles.rings(recipe.rings):.2g}"
            text += f", half of them by {judged.profiles.rings(recipe.rings // 2):.2g}" if recipe.rings > 8 else ""
        lines.append(text)
    return tuple(lines)


def _would(judged: Judge, recipe: Recipe) -> str:
    """What a rung down would err by: of color and profile that which is too much, else both."""
    needs, delta_e00 = judged.needs, judged.color(recipe)
    parts = [(f"ΔE00 {_apart(delta_e00, needs.tolerance, 3)} of {needs.tolerance:g}", delta_e00 / needs.tolerance)]
    if judged.with_profile:
        likely = judged.profile(recipe).likely
        shown = _apart(likely, needs.ee_tolerance, 2)
        parts.append((f"EE {shown} of {needs.ee_tolerance:.2g}", likely / needs.ee_tolerance))
    return " and ".join([text for text, share in parts if share > 1] or [text for text, _ in parts])


def _apart(value: float, limit: float, digits: int) -> str:
    """A value with so many digits, or as many more as tell it from the limit."""
    return next((text for more in range(4) if float(text := f"{value:.{digits + more}g}") != limit), f"{value:g}")


def nodes(grid: Grid) -> str:
    """A grid's node counts: melanin, eumelanin, hemoglobin."""
    return " × ".join(str(axis.count) for axis in grid.axes[::-1])


def unaffordable(judged: Judge, seconds_bytes: list[tuple[float, int]]) -> InputError:
    """What to raise where no recipe is within the bytes and seconds allowed: it says which tolerances are."""
    needs = judged.needs
    spent = min(seconds for seconds, _ in seconds_bytes), min(size for _, size in seconds_bytes)
    over = [
        f"{name} = {most:g}: {needs.tolerance:g} ΔE00 with EE {needs.ee_tolerance:.2g} takes {least}"
        for name, most, need, least in (
            ("seconds", needs.seconds, spent[0], f"{spent[0]:.2f} s at least"),
            ("bytes", needs.bytes, spent[1], f"{spent[1]} bytes at least"),
        )
        if most is not None and need > most
    ] or [f"seconds = {needs.seconds:g} with bytes = {needs.bytes}: no recipe keeps both"]
    scale = _had(judged)
    if scale is None:
        return InputError(f"{'; '.join(over)}; no tolerance can be had for so little")
    had = _scaled(needs, scale)
    return InputError(
        f"{'; '.join(over)}; what can be had is --tolerance {had.tolerance:.3g} --ee-tolerance {had.ee_tolerance:.2g}"
    )


def _scaled(needs: Needs, scale: float) -> Needs:
    """Both tolerances times a factor, rounded up to what the message prints, within what is allowed."""
    color, energy = needs.tolerance * scale, needs.ee_tolerance * scale
    color, energy = min(_rounded_up(color, 3), TOLERANCE[1]), min(_rounded_up(energy, 2), EE_TOLERANCE[1])
    return replace(needs, tolerance=color, ee_tolerance=energy)


def _rounded_up(value: float, digits: int) -> float:
    step = 10.0 ** (np.floor(np.log10(value)) - digits + 1)
    return float(f"{np.ceil(value / step - 1e-9) * step:.{digits}g}")


def _had(judged: Judge) -> float | None:
    """The least factor on both tolerances, to 5 %, that some recipe fits, or None."""

    def fits(scale: float) -> bool:
        """Whether any recipe keeps both tolerances times a factor."""
        asked = judged.asked(_scaled(judged.needs, scale))
        return any(search.fits(asked, recipe) for recipe in search.candidates(asked))

    needs = judged.needs
    low, high = 1.0, max(TOLERANCE[1] / needs.tolerance, EE_TOLERANCE[1] / needs.ee_tolerance)
    if not fits(high):
        return None
    while high / low > 1.05:
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if fits(middle) else (middle, high)
    return high
