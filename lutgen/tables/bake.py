"""The bake: recipe in, LUT set out. Choose wavelengths, trace once each, expand the grids, measure, describe."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable
from dataclasses import replace
from importlib.metadata import version
from importlib.resources import files

import numpy as np

from lutgen import color
from lutgen import device as ocl
from lutgen.skin import chromophores
from lutgen.skin.tissue import Tissue, require_one_scatterer, scattering
from lutgen.solvers import exact_totals, path_table, profiles
from lutgen.solvers.paths import PathTable, chebyshev
from lutgen.tables import expand, wavelengths
from lutgen.tables.lut_set import ColorLut, LutSet, ProfileLut
from lutgen.tables.recipe import coerce
from lutgen.tables.storage import MEANING, grid_entry

CHECKED_SKINS = 1000
CHECKED_PROFILES = 50

Progress = Callable[[str, path_table.Tally | None], None]


def bake(
    recipe=None, *, device: str | None = None, progress: Progress | None = None, blocks_per_launch: int | None = None,
    exact: exact_totals.ExactTotals | None = None,
) -> LutSet:  # fmt: skip
    """Bake a LUT set from a Recipe, nested values, a TOML path or a quality name (default: standard).

    `device` picks the OpenCL device, `progress` is told each stage and each launch. Photons are traced in fixed
    blocks: `blocks_per_launch` changes the launches, never the result. `exact` are the exact totals of the recipe's
    tissue, where a caller has them already. Raises InputError and MachineError.

    >>> import lutgen
    >>> luts = lutgen.bake({"photons": 2048, "wavelengths": "6"})
    >>> luts.color(0.02, 0.7, 0.01).shape
    (3,)
    """
    recipe = coerce(recipe)
    clock = _Clock(progress or (lambda stage, tally: None))
    rule = wavelengths.load(recipe.wavelengths, recipe.pipeline)
    chosen = ocl.choose(device)

    clock.stage("trace")
    nm, edges = rule.wavelength_nm, profiles.ring_edges(recipe.rings)
    medium, reach = skin_medium(recipe.skin, nm)
    paths = path_table.trace(
        medium, *reach, edges, recipe.photons, recipe.seed, chosen, blocks_per_launch, clock.launched
    )

    clock.stage("exact totals")
    exact = exact or exact_totals.exact_totals(recipe.skin)
    if recipe.totals == "anchored":
        paths = paths.anchored(exact.grid(nm, paths.mu_epidermis, paths.mu_dermis))

    clock.stage("expand")
    weights = expand.rgb_weights(rule.xyz_weights)
    absorb = expand.absorbers(nm, recipe.skin.oxygenation)
    color_lut = ColorLut(recipe.color, expand.color_cells(paths.totals(), recipe.color, absorb, weights))
    shape, clamped = expand.profile_cells(paths, recipe.profile, absorb, weights)
    profile_lut = ProfileLut(recipe.profile, edges, shape, clamped)

    clock.stage("measure")
    manifest = _describe(recipe, rule, chosen, medium, clock, np.asarray(clamped))
    luts = LutSet(color_lut, profile_lut, paths, manifest)
    manifest["error"] = measure(luts, exact)
    clock.end()
    manifest["seconds"] = clock.seconds
    return luts


def skin_medium(tissue: Tissue, wavelength_nm: np.ndarray):
    """What to trace at wavelengths [K], and the absorption ranges (epidermis, dermis) that every allowed skin spans.

    The life rate nu is the least absorption of any allowed skin, over all chromophores and oxygenations.
    """
    require_one_scatterer(tissue)
    mu_s, g = scattering(tissue, wavelength_nm)
    reach = chromophores.epidermis_range(wavelength_nm), chromophores.dermis_range(wavelength_nm)
    nu = np.minimum(reach[0][0], reach[1][0])
    medium = path_table.Medium(wavelength_nm, mu_s, g, nu, tissue.epidermis_mm, tissue.refractive_index)
    return medium, reach


def paths_at_every_wavelength(
    photons: int, radius_edges_mm: np.ndarray, seed: int, tissue: Tissue, device: ocl.Device | None = None,
    count: int = 10,
) -> PathTable:  # fmt: skip
    """Paths at `count` Chebyshev wavelengths that share absorption nodes, each covering all from 380 to 780 nm.

    Scattering is smooth in wavelength, so few stand for all: interpolated in it they serve every rule, with one noise.
    """
    (low, high), every = chromophores.WAVELENGTH_NM, np.arange(380.0, 781.0)
    spans = chromophores.epidermis_range(every), chromophores.dermis_range(every)
    ends_e, ends_d = ((np.full(count, least.min()), np.full(count, most.max())) for least, most in spans)
    medium, _ = skin_medium(tissue, chebyshev(low, high, count))
    medium = replace(medium, nu_per_mm=np.minimum(ends_e[0], ends_d[0]))
    nodes = 2 * path_table.NODES_E, path_table.NODES_D  # melanin at 380 nm to none at 780: totals err by 3e-7
    return path_table.trace(medium, ends_e, ends_d, radius_edges_mm, photons, seed, device, nodes=nodes)


def random_skins(grid, count: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Chromophores [count] within a grid's axes: log-uniform melanin and hemoglobin, uniform eumelanin."""
    rng = np.random.default_rng(seed)
    melanin, hemoglobin = (
        np.exp(rng.uniform(np.log(axis.low), np.log(axis.high), count)) for axis in (grid.melanin, grid.hemoglobin)
    )
    return melanin, rng.uniform(grid.eumelanin.low, grid.eumelanin.high, count), hemoglobin


def measure(luts: LutSet, exact: exact_totals.ExactTotals, seed: int = 1) -> dict:
    """The set's own error: color against adding-doubling at 5 nm, profiles against the path table between nodes."""
    skins = random_skins(luts.color_lut.grid, CHECKED_SKINS, seed)
    nm, xyz_weights = color.xyz_weights(5, luts.pipeline)
    truth = exact_totals.spectra(exact, nm, *skins, luts.oxygenation) @ xyz_weights
    difference = color.delta_e00(color.lab(luts.color(*skins, space="xyz")), color.lab(truth))
    sigma = luts.color_std_error(*skins)
    melanin, eumelanin, hemoglobin = random_skins(luts.profile_lut.grid, CHECKED_PROFILES, seed)
    mu = expand.coefficients(luts.paths.wavelength_nm, luts.absorbers, melanin, eumelanin, hemoglobin)
    energy = np.einsum("kbp,kc->pcb", luts.paths.evaluate(*mu), luts.weights)
    shape = luts.profile_lut.grid.interpolate(luts.profile_lut.shape, melanin, eumelanin, hemoglobin)
    between = profiles.ee_difference(np.maximum(energy, 0), shape.swapaxes(1, 2), luts.paths.radius_edges_mm)
    return {
        "color": {
            "compared_with": "adding-doubling at 5 nm",
            "skins": CHECKED_SKINS,
            "delta_e00_max": float(difference.max()),
            "delta_e00_p95": float(np.percentile(difference, 95)),
            "delta_e00_mean": float(difference.mean()),
            "largest_std_error_acescg": float(sigma.max()),
        },
        "profile": {
            "compared_with": "its own path table between nodes",
            "skins": CHECKED_PROFILES,
            "ee_difference_max": float(between.max()),
            "ee_difference_p95": float(np.percentile(between, 95)),
        },
    }


class _Clock:
    """Times stages and passes them on to the progress callback."""

    def __init__(self, tell: Progress):
        self.tell, self.seconds, self.tally = tell, {}, path_table.Tally()
        self._name, self._since = "", 0.0

    def stage(self, name: str) -> None:
        """End the running stage and begin the next."""
        self.end()
        self._name, self._since = name, time.perf_counter()
        self.tell(name, None)

    def end(self) -> None:
        """Put down the seconds of the running stage."""
        if self._name:
            self.seconds[self._name] = round(time.perf_counter() - self._since, 4)

    def launched(self, tally: path_table.Tally) -> None:
        """Pass on what a launch has done."""
        self.tally = tally
        self.tell(self._name, tally)


def _describe(recipe, rule, chosen: ocl.Device, medium, clock: _Clock, clamped: np.ndarray) -> dict:
    """The manifest without its error and files: everything the numbers depend on, and what they mean."""
    return {
        "lutgen": version("lutgen"),
        "recipe": recipe.as_dict(),
        "meaning": MEANING,
        "color_grid": grid_entry(recipe.color),
        "profile_grid": grid_entry(recipe.profile),
        "quadrature": {
            "name": rule.name,
            "wavelength_nm": rule.wavelength_nm.tolist(),
            "xyz_weights": rule.xyz_weights.tolist(),
        },
        "trace": {
            "photons_per_wavelength": recipe.photons,
            "seed": recipe.seed,
            "events": clock.tally.events,
            "nu_per_mm": medium.nu_per_mm.tolist(),
            "mu_s_per_mm": medium.mu_s_per_mm.tolist(),
            "g": medium.g.tolist(),
            "n": medium.n,
            "device": chosen.name,
            "platform": chosen.platform,
            "lanes": chosen.lanes,
            "kernel": path_table.kernel_hash(chosen),
        },
        "optical_data": {
            name: hashlib.sha256((files(f"lutgen{room}") / f"{name}.csv").read_bytes()).hexdigest()[:16]
            for room, name in ((".skin", "hemoglobin_prahl_1998"), ("", "color_tables"), (".tables", "quadrature"))
        },
        "extra_absorbers_per_mm": {},
        "largest_clamped_share": float(clamped.max()),
    }
