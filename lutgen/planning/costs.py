"""What a recipe costs: seconds of its bake, bytes of its tables, and the viewer's tiers by error; as measured."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np

from lutgen.tables.recipe import Recipe

PATH_NODES = 16 * 16
"""Absorption nodes of a stored path table, per wavelength and ring."""


@dataclass(frozen=True)
class Tier:
    """A tier of the viewer: its name, taps at most, and EE difference by millimetres per pixel, ascending."""

    name: str
    taps: int
    ee_difference: tuple[tuple[float, float], ...]

    def error(self, mm_per_pixel: float) -> tuple[float, float]:
        """The nearest scale that was measured, and the EE difference there."""
        return min(self.ee_difference, key=lambda pair: abs(np.log(pair[0] / mm_per_pixel)))

    def holds(self, mm_per_pixel: float, tolerance: float) -> bool:
        """Whether the tier was within a tolerance at this scale or at a finer one, which asks more of it."""
        scales = [pair[0] for pair in self.ee_difference]
        return any(error <= tolerance for mm, error in self.ee_difference if mm <= max(mm_per_pixel, min(scales)))


@cache
def _file() -> tuple[dict[str, tuple[float, float]], dict[str, float], tuple[Tier, ...], str]:
    """Trace (fixed, per photon) by rule, the rest's coefficients, tiers from cheap to dear, and the header."""
    lines = (files("lutgen.planning") / "plan.csv").read_text(encoding="utf-8").splitlines()
    trace, rest, costs_of_tier = {}, {}, {}
    for line in lines:
        if line.startswith("#"):
            continue
        kind, name, *cells = line.split(",")
        if kind == "trace":
            trace[name] = float(cells[0]), float(cells[1])
        elif kind == "rest":
            rest[name] = float(cells[0])
        else:
            costs_of_tier.setdefault((name, int(cells[0])), []).append((float(cells[1]), float(cells[2])))
    tiers = tuple(Tier(name, taps, tuple(values)) for (name, taps), values in costs_of_tier.items())
    return trace, rest, tiers, lines[0].removeprefix("# ")


def measured_with() -> str:
    """Version, device and seed that the figures come from."""
    return _file()[3]


def tiers() -> tuple[Tier, ...]:
    """The viewer's tiers that scatter, from cheap to dear."""
    return _file()[2]


def seconds(recipe: Recipe) -> dict[str, float]:
    """Seconds of `lutgen bake` from process start to files on disk, kernels built before: its trace and the rest."""
    trace, rest, _, _ = _file()
    fixed, per_photon = trace[recipe.wavelengths]
    color, profile = (int(np.prod(grid.shape)) for grid in (recipe.color, recipe.profile))
    other = (
        rest["start"]
        + rest["color node"] * color
        + profile * (rest["profile node"] + rest["ring of a node"] * recipe.rings)
    )
    return {"trace": fixed + per_photon * recipe.photons, "rest": other}


def total_seconds(recipe: Recipe) -> float:
    """The sum of `seconds`."""
    return sum(seconds(recipe).values())


def table_bytes(recipe: Recipe, wavelengths: int, expanded: bool) -> dict[str, int]:
    """Bytes as floats of color and profile tables, and of the paths where the set is expanded at run time."""
    color, profile = (int(np.prod(grid.shape)) for grid in (recipe.color, recipe.profile))
    paths = wavelengths * recipe.rings * PATH_NODES * 4 if expanded else 0
    return {"color": 12 * color, "profile": 12 * recipe.rings * profile, "paths": paths}
