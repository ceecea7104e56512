"""The error of a bake before it is baked: worked out from exact totals and stored paths, not read from a table.

Color (totals anchored, so free of noise) errs by its wavelengths and by interpolation between nodes: both follow from
exact totals. Profiles err by wavelengths, nodes, rings and noise: the first three follow from the stored paths, and of
the noise of a trace the paths hold every covariance, so that it can be drawn without tracing.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lutgen import color
from lutgen.planning import stored_paths
from lutgen.planning.needs import Needs, panel
from lutgen.skin import chromophores
from lutgen.skin.tissue import specular
from lutgen.solvers import exact_totals, profiles
from lutgen.tables import expand, wavelengths
from lutgen.tables.axes import Grid

PERCENTILE = 95
BAKES = 8
"""A tolerance holds where it holds in each of so many bakes that differ in their seed."""
COLOR_SKINS, PROFILE_SKINS, DRAWS, SEED = 1500, 96, 512, 0
FARTHEST = 3
"""Draws whose mean stands for the quantile .98^(1/8) = .9975: of 512 the largest three lie about there."""


def p95(errors: np.ndarray) -> float:
    """The statistic that tolerances are about: the 95th percentile of all values."""
    return float(np.percentile(errors, PERCENTILE))


@dataclass(frozen=True)
class Colors:
    """Color errors of LUTs for a scene, 95th percentile of ΔE00 over its skins, at the worst of its oxygenations."""

    needs: Needs
    exact: exact_totals.ExactTotals

    @cached_property
    def skins(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Melanin, eumelanin, hemoglobin [P]."""
        return panel(self.needs, COLOR_SKINS)

    @cached_property
    def truth(self) -> list[np.ndarray]:
        """Lab [P, 3] from spectra every 5 nm, per oxygenation."""
        nm, weights = color.xyz_weights(5)
        return [
            color.lab(exact_totals.spectra(self.exact, nm, *self.skins, oxygenation) @ weights)
            for oxygenation in self.needs.oxygenations
        ]

    def quadrature(self, rule: str) -> float:
        """Error of a rule's wavelengths alone."""
        chosen = wavelengths.load(rule)
        xyz = [
            exact_totals.spectra(self.exact, chosen.wavelength_nm, *self.skins, oxygenation) @ chosen.xyz_weights
            for oxygenation in self.needs.oxygenations
        ]
        return self._worst(xyz, self.truth)

    def error(self, rule: str, grid: Grid) -> float:
        """Error of a LUT of exact colors: wavelengths and interpolation."""
        cells = self.cells(rule, grid)
        return self._worst([grid.interpolate(values, *self.skins) for values in cells], self.truth)

    def interpolation(self, rule: str, grid: Grid) -> float:
        """Error of interpolation alone: against the same wavelengths at the skins themselves."""
        chosen = wavelengths.load(rule)
        truth = [
            color.lab(
                exact_totals.spectra(self.exact, chosen.wavelength_nm, *self.skins, oxygenation) @ chosen.xyz_weights
            )
            for oxygenation in self.needs.oxygenations
        ]
        return self._worst([grid.interpolate(values, *self.skins) for values in self.cells(rule, grid)], truth)

    def noise(self, rule: str, photons: int) -> float:
        """What totals that are not anchored would err by, by a draw of the noise of each skin and wavelength."""
        chosen, rng = wavelengths.load(rule), np.random.default_rng(SEED)
        nm, noisy_xyz, right = chosen.wavelength_nm, [], []
        nu = np.minimum(chromophores.epidermis_range(nm)[0], chromophores.dermis_range(nm)[0])[:, None]
        entry = 1 - specular(self.exact.tissue.refractive_index)
        for oxygenation in self.needs.oxygenations:
            mu = expand.coefficients(nm, expand.absorbers(nm, oxygenation), *self.skins)
            R, doubled = self.exact(nm, *mu), self.exact(nm, *(2 * v - nu for v in mu))
            sigma = np.sqrt(np.maximum(entry * doubled - R**2, 0) / photons)
            noisy_xyz.append((R + sigma * rng.standard_normal(R.shape)).T @ chosen.xyz_weights)
            right.append(color.lab(R.T @ chosen.xyz_weights))
        return self._worst(noisy_xyz, right)

    def cells(self, rule: str, grid: Grid) -> list[np.ndarray]:
        """Exact XYZ [N_h, N_e, N_m, 3] of every node, per oxygenation."""
        chosen = wavelengths.load(rule)
        nm = chosen.wavelength_nm[:, None]
        m, e = np.meshgrid(grid.melanin.values, grid.eumelanin.values)
        mu_e = chromophores.epidermis(nm, m.ravel(), e.ravel())
        xyz = []
        for oxygenation in self.needs.oxygenations:
            mu_d = chromophores.dermis(nm, grid.hemoglobin.values, oxygenation)
            R = self.exact.grid(chosen.wavelength_nm, mu_e, mu_d)
            xyz.append(np.einsum("ked,kc->dec", R, chosen.xyz_weights).reshape(*grid.shape, 3))
        return xyz

    def _worst(self, xyz: list[np.ndarray], truth: list[np.ndarray]) -> float:
        return max(p95(color.delta_e00(color.lab(v), lab)) for v, lab in zip(xyz, truth, strict=True))


@dataclass(frozen=True)
class Spread:
    """An error over bakes that differ in their seed: what the largest of eight is likely to be, and surely less than.

    `usual`: the median of one bake; `likely`: the median of the largest of eight; `certain`: what that stays below in
    98 of 100 cases.
    """

    usual: float
    likely: float
    certain: float


def spread(errors: np.ndarray) -> Spread:
    """The spread of an error drawn for many bakes [draws]."""
    ordered = np.sort(errors)
    usual, likely = np.quantile(ordered, [0.5, 0.5 ** (1 / BAKES)])
    return Spread(float(usual), float(likely), float(np.exp(np.log(ordered[-FARTHEST:]).mean())))


@dataclass(frozen=True)
class Profiles:
    """EE differences of LUTs for a scene, 95th percentile over its skins and ACEScg channels, worst oxygenation.

    Compared at `radius_mm` [R]: from a pixel's own disc (0.01 mm at least) outward.
    """

    needs: Needs

    @cached_property
    def skins(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Melanin, eumelanin, hemoglobin [P]."""
        return panel(self.needs, PROFILE_SKINS if len(self.needs.oxygenations) == 1 else PROFILE_SKINS // 2)

    @cached_property
    def radius_mm(self) -> np.ndarray:
        """Where encircled energy is compared, mm."""
        far = stored_paths.edges()
        return np.concatenate([[self.needs.from_mm], far[far > self.needs.from_mm]])

    @cached_property
    def truth(self) -> np.ndarray:
        """Encircled energy [O, P, 3, R] of the skins, every 5 nm, per oxygenation."""
        return self._seen(self._own(stored_paths.TRUTH)[0])

    def reach_mm(self) -> float:
        """Radius within which 99 % of the widest channel's light leaves, of the skin where it is widest."""
        P = self._own(stored_paths.TRUTH)[0]
        return float(profiles.inverse(P.reshape(-1, P.shape[-1]), stored_paths.edges(), np.array([0.99])).max())

    def unscattered(self) -> float:
        """Error of no profile at all: the share that leaves outside a pixel's own disc."""
        return max(p95(1 - values[..., 0]) for values in self.truth)

    def systematic(self, rule: str, rings: int, grid: Grid | None = None) -> np.ndarray:
        """What a LUT without noise is off [O, P, 3, R]; without a grid: at the skins themselves."""
        P = self._own(rule)[0] if grid is None else self._between(rule, grid)
        return self._seen(P, rings) - self.truth

    def quadrature(self, rule: str) -> float:
        """Error of a rule's wavelengths alone."""
        return largest(self._seen(self._own(rule)[0]) - self.truth)

    def rings(self, count: int) -> float:
        """Error of that many rings alone."""
        return largest(self._seen(self._own(stored_paths.TRUTH)[0], count) - self.truth)

    def interpolation(self, rule: str, grid: Grid) -> float:
        """Error of nodes alone, against the same wavelengths at the skins themselves."""
        return largest(self._seen(self._between(rule, grid) - self._own(rule)[0]))

    def with_noise(self, systematic: np.ndarray, rule: str, photons: float) -> Spread:
        """Error of a LUT with that systematic part from a trace of that many photons per wavelength."""
        off = self._unit_noise(rule) * np.float32(photons**-0.5) + systematic.astype("f4")
        sup = np.abs(off, out=off).max(axis=-1).reshape(*off.shape[:2], -1)
        return spread(np.percentile(sup, PERCENTILE, axis=-1).max(axis=-1))

    @cached_property
    def _cache(self) -> dict:
        return {}

    def _seen(self, P: np.ndarray, rings: int | None = None) -> np.ndarray:
        """Encircled energy at the radii, as the stored paths or a LUT of that many rings tell it."""
        if ("seen", rings) not in self._cache:
            radii = self.radius_mm
            matrix = (
                stored_paths.within(stored_paths.edges(), radii)
                if rings is None
                else stored_paths.in_rings(radii, rings)
            )
            self._cache["seen", rings] = matrix.T
        return P @ self._cache["seen", rings]

    def _own(self, rule: str) -> tuple[np.ndarray, np.ndarray]:
        """Encircled energy [O, P, 3, B + 1] at the skins themselves, and total ACEScg [O, P, 3]."""
        if ("own", rule) not in self._cache:
            table, weights = stored_paths.stored(rule)
            ring_energy = []
            for oxygenation in self.needs.oxygenations:
                absorb = expand.absorbers(table.wavelength_nm, oxygenation)
                mu = expand.coefficients(table.wavelength_nm, absorb, *self.skins)
                ring_energy.append(np.einsum("kbp,kc->pcb", table.evaluate(*mu), weights, optimize=True))
            energy = np.maximum(ring_energy, 0)
            self._cache["own", rule] = profiles.encircled(energy), energy.sum(axis=-1)
        return self._cache["own", rule]

    def _between(self, rule: str, grid: Grid) -> np.ndarray:
        """Encircled energy [O, P, 3, B + 1] interpolated between a grid's nodes."""
        if ("between", rule, grid) not in self._cache:
            table, weights = stored_paths.stored(rule)
            shapes = []
            for oxygenation in self.needs.oxygenations:
                absorb = expand.absorbers(table.wavelength_nm, oxygenation)
                shape, _ = expand.profile_cells(table, grid, absorb, weights)
                shapes.append(grid.interpolate(shape, *self.skins).swapaxes(1, 2))
            self._cache["between", rule, grid] = profiles.encircled(np.array(shapes))
        return self._cache["between", rule, grid]

    def _unit_noise(self, rule: str) -> np.ndarray:
        """Noise [draws, O, P, 3, R] of encircled energy with one photon per wavelength."""
        if ("noise", rule) not in self._cache:
            table, weights = stored_paths.stored(rule)
            nm, totals_ = table.wavelength_nm, self._own(rule)[1]
            nu = np.minimum(chromophores.epidermis_range(nm)[0], chromophores.dermis_range(nm)[0])
            mu = [
                expand.coefficients(nm, expand.absorbers(nm, oxygenation), *self.skins)
                for oxygenation in self.needs.oxygenations
            ]
            spans = [_widened(np.concatenate([pair[layer] for pair in mu], axis=1)) for layer in (0, 1)]
            drawn, roots = stored_paths.noise(table, nu, (spans[0], spans[1]), DRAWS, SEED)
            at_radii = np.einsum(
                "rb,skbij->srkij",
                stored_paths.within(stored_paths.edges(), self.radius_mm)[:, 1:],
                drawn,
                optimize=True,
            )
            S, R = at_radii.shape[:2]
            flat = at_radii.reshape(S * R, -1).astype("f4")
            unit_noise = np.empty((S, len(mu), len(self.skins[0]), 3, R), "f4")
            for o, pair in enumerate(mu):
                to_e, to_d = (
                    stored_paths.interpolation_matrix(root, np.cbrt(v)) for root, v in zip(roots, pair, strict=True)
                )
                weight = np.einsum("kpi,kpj,kc,pc->kijpc", to_e, to_d, weights, 1 / totals_[o], optimize=True)
                values = flat @ weight.reshape(flat.shape[1], -1).astype("f4")
                unit_noise[:, o] = values.reshape(S, R, -1, 3).transpose(0, 2, 3, 1)
            self._cache["noise", rule] = unit_noise
        return self._cache["noise", rule]


def largest(off: np.ndarray) -> float:
    """95th percentile of the EE difference of encircled energies that are off by [O, P, 3, R], worst oxygenation."""
    return max(p95(np.abs(values).max(axis=-1)) for values in off)


def _widened(mu: np.ndarray) -> np.ndarray:
    """Least and greatest [2, K] of absorptions [K, P], a little apart where they are one."""
    low, high = mu.min(axis=1), mu.max(axis=1)
    return np.array([low, np.maximum(high, low * (1 + 1e-6))])
