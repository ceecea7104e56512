"""A plan put to the test: its recipe baked with several seeds, and what the bakes err by beside what was predicted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from lutgen import color
from lutgen import device as ocl
from lutgen.planning import prediction, stored_paths
from lutgen.planning.needs import Needs
from lutgen.planning.prediction import BAKES, p95
from lutgen.solvers import exact_totals, profiles
from lutgen.solvers.paths import PathTable
from lutgen.tables import bake, expand, wavelengths
from lutgen.tables.lut_set import LutSet
from lutgen.tables.recipe import Recipe

COLOR_SKINS, PROFILE_SKINS, SKINS_SEED = 2000, 200, 7
REFERENCE_SEED, REFERENCE_RINGS = 2000, 128
LEAST_REFERENCE, MOST_REFERENCE, REFERENCE_PER_PHOTON = 2**20, 2**24, 8

Progress = Callable[[str, object], None]


@dataclass(frozen=True)
class Measured:
    """What bakes of one recipe err by, seed by seed: 95th percentiles (`color` ΔE00, `profile` EE) and the largest."""

    color: list[float]
    color_max: float
    profile: list[float]
    profile_max: float
    parts: dict[str, dict[str, float]]
    """Each part alone, of the first bake; a profile's noise of the worst."""
    trace_seconds: float

    def holds(self, needs: Needs) -> bool:
        """Whether every bake stays within the tolerances."""
        return max(self.color) <= needs.tolerance and max(self.profile) <= needs.ee_tolerance


@dataclass(frozen=True)
class Truth:
    """Random skins of a scene with their exact colors and well-traced profiles, and what bakes of it share.

    `lab` [O, P, 3], `encircled` [O, Q, 3, R] at `radius_mm` [R], per oxygenation; `traced`: what they were read from.
    """

    needs: Needs
    traced: PathTable
    exact: exact_totals.ExactTotals
    color_skins: tuple[np.ndarray, np.ndarray, np.ndarray]
    profile_skins: tuple[np.ndarray, np.ndarray, np.ndarray]
    lab: np.ndarray
    radius_mm: np.ndarray
    encircled: np.ndarray


def reference(photons: int, device: str | None = None) -> PathTable:
    """A trace of the default skin that knows nothing of the stored paths, fine in radius."""
    edges = profiles.ring_edges(REFERENCE_RINGS, stored_paths.FIRST_MM, stored_paths.LAST_MM)
    return bake.paths_at_every_wavelength(photons, edges, REFERENCE_SEED, Recipe().skin, ocl.choose(device))


def reference_photons(recipe: Recipe) -> int:
    """Photons per wavelength of a reference for a recipe: eight times its own, within bounds."""
    return int(np.clip(REFERENCE_PER_PHOTON * recipe.photons, LEAST_REFERENCE, MOST_REFERENCE))


def truth(needs: Needs, recipe: Recipe, traced: PathTable) -> Truth:
    """Skins drawn within a recipe's axes, as a bake draws them, and what is right about them."""
    exact = exact_totals.exact_totals(Recipe().skin)
    skins = bake.random_skins(recipe.color, COLOR_SKINS, SKINS_SEED)
    few = bake.random_skins(recipe.color, PROFILE_SKINS, SKINS_SEED + 1)
    nm, weights = color.xyz_weights(5)
    lab = [color.lab(exact_totals.spectra(exact, nm, *skins, o) @ weights) for o in needs.oxygenations]
    far = traced.radius_edges_mm
    radius_mm = np.concatenate([[needs.from_mm], far[far > needs.from_mm]])
    right = Truth(needs, traced, exact, skins, few, np.array(lab), radius_mm, np.empty(0))
    return replace(right, encircled=_traced(right, stored_paths.TRUTH))


def _traced(right: Truth, rule: str) -> np.ndarray:
    """Encircled energy [O, Q, 3, R] of the reference at a rule's wavelengths."""
    table, weights = stored_paths.at_rule(right.traced, rule)
    within = stored_paths.within(table.radius_edges_mm, right.radius_mm).T
    own = [_own(table, weights, right.profile_skins, o) for o in right.needs.oxygenations]
    return np.array([profiles.encircled(energy) @ within for energy in own])


def _own(table: PathTable, weights: np.ndarray, skins, oxygenation: float) -> np.ndarray:
    """ACEScg energy [P, 3, B] of skins from paths, none below 0."""
    nm = table.wavelength_nm
    mu = expand.coefficients(nm, expand.absorbers(nm, oxygenation), *skins)
    return np.maximum(np.einsum("kbp,kc->pcb", table.evaluate(*mu), weights, optimize=True), 0)


def verify(
    needs: Needs, recipe: Recipe, right: Truth, with_profile: bool = True, bakes: int = BAKES,
    stop: bool = False, progress: Progress = lambda stage, tally: None, device: str | None = None,
) -> Measured:  # fmt: skip
    """Bake a recipe with so many seeds, its own first, and measure each; `stop` at the first that does not hold."""
    colors, shapes, noise, first, seconds = [], [], [], None, 0.0
    at_rule = _traced(right, recipe.wavelengths)
    for seed in range(recipe.seed, recipe.seed + bakes):
        progress(f"bake with seed {seed}", None)
        luts = bake.bake(replace(recipe, seed=seed), device=device, exact=right.exact)
        sets = [luts if o == luts.oxygenation else luts.expand(oxygenation=o) for o in needs.oxygenations]
        if first is None:
            first, seconds = sets, luts.manifest["seconds"]["trace"]
        colors.append(np.array([_color_errors(lut_set, right, o) for o, lut_set in enumerate(sets)]))
        shapes.append(np.array([_profile_errors(lut_set, right, o, with_profile) for o, lut_set in enumerate(sets)]))
        if stop and (_worst(colors[-1]) > needs.tolerance or _worst(shapes[-1]) > needs.ee_tolerance):
            break
        noise.append(prediction.largest(np.array([_smooth(lut_set, right) for lut_set in sets]) - at_rule))
    assert first
    parts = {"color": _color_parts(first, right, recipe)}
    if with_profile:
        apart = {"quadrature": prediction.largest(at_rule - right.encircled)}
        parts["profile"] = apart | _profile_parts(first, right) | {"noise": max(noise, default=np.nan)}
    return Measured(
        [_worst(errors) for errors in colors], float(np.max(colors)),
        [_worst(errors) for errors in shapes], float(np.max(shapes)),
        parts, seconds,
    )  # fmt: skip


def _worst(errors: np.ndarray) -> float:
    """The statistic of errors [O, P]: the 95th percentile at the worst oxygenation."""
    return max(p95(values) for values in errors)


def _color_errors(luts: LutSet, right: Truth, o: int) -> np.ndarray:
    """ΔE00 [P] of a set's colors."""
    return color.delta_e00(color.lab(luts.color(*right.color_skins, space="xyz")), right.lab[o])


def _told(P: np.ndarray, edges: np.ndarray, radius_mm: np.ndarray) -> np.ndarray:
    """Encircled energy [..., R] of what is known at ring edges [..., B + 1], each ring spread evenly in radius."""
    ring = np.clip(np.searchsorted(edges, radius_mm, side="right") - 1, 0, len(edges) - 2)
    along = np.clip((radius_mm - edges[ring]) / np.diff(edges)[ring], 0, 1)
    return (1 - along) * P[..., ring] + along * P[..., ring + 1]


def _between(luts: LutSet, skins) -> np.ndarray:
    """Encircled energy [P, 3, B + 1] of a set's own profiles, interpolated between its nodes."""
    lut = luts.profile_lut
    return profiles.encircled(lut.grid.interpolate(lut.shape, *skins).swapaxes(1, 2))


def _profile_errors(luts: LutSet, right: Truth, o: int, with_profile: bool) -> np.ndarray:
    """EE differences [P * 3] of a set's profiles, or of none."""
    if not with_profile:
        return 1 - right.encircled[o][..., 0].ravel()
    told = _told(_between(luts, right.profile_skins), luts.profile_lut.radius_edges_mm, right.radius_mm)
    return np.abs(told - right.encircled[o]).max(axis=-1).ravel()


def _color_parts(sets: list[LutSet], right: Truth, recipe: Recipe) -> dict[str, float]:
    """Errors of wavelengths, of interpolation and of noise, each alone, of the first bake."""
    rule, errors = wavelengths.load(recipe.wavelengths), {"quadrature": [], "interpolation": [], "noise": []}
    for o, luts in enumerate(sets):
        oxygenation = right.needs.oxygenations[o]
        nm, grid = rule.wavelength_nm, recipe.color
        own = color.lab(exact_totals.spectra(right.exact, nm, *right.color_skins, oxygenation) @ rule.xyz_weights)
        melanin, eumelanin, hemoglobin = (v.ravel() for v in grid.nodes())
        cells = exact_totals.spectra(right.exact, nm, melanin, eumelanin, hemoglobin, oxygenation) @ rule.xyz_weights
        between = color.lab(grid.interpolate(cells.reshape(*grid.shape, 3), *right.color_skins))
        read = color.lab(luts.color(*right.color_skins, space="xyz"))
        for name, pair in (("quadrature", (own, right.lab[o])), ("interpolation", (between, own)),
                           ("noise", (read, between))):  # fmt: skip
            errors[name].append(p95(color.delta_e00(*pair)))
    return {name: max(values) for name, values in errors.items()}


def _smooth(luts: LutSet, right: Truth) -> np.ndarray:
    """Encircled energy [Q, 3, R] of a set's own paths at the skins themselves."""
    own = profiles.encircled(_own(luts.paths, luts.weights, right.profile_skins, luts.oxygenation))
    return own @ stored_paths.within(luts.paths.radius_edges_mm, right.radius_mm).T


def _profile_parts(sets: list[LutSet], right: Truth) -> dict[str, float]:
    """EE differences of nodes and of rings, each alone, against the bake's own paths."""
    nodes, rings = [], []
    for luts in sets:
        edges = luts.paths.radius_edges_mm
        own = profiles.encircled(_own(luts.paths, luts.weights, right.profile_skins, luts.oxygenation))
        smooth = stored_paths.within(edges, right.radius_mm).T
        nodes.append((_between(luts, right.profile_skins) - own) @ smooth)
        rings.append(_told(own, edges, right.radius_mm) - own @ smooth)
    return {"interpolation": prediction.largest(np.array(nodes)), "rings": prediction.largest(np.array(rings))}
