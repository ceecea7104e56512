"""Choose the few wavelengths that stand for a spectrum; needs scipy (extra `color`) and OpenCL.

Run as `python -m lutgen.tables.make_wavelengths`.

For 6, 8 and 12 wavelengths on a 2 nm lattice, the rows of the blood table: one set of wavelengths for both color
pipelines, so that one trace serves both, and per pipeline the non-negative XYZ weights that carry model spectra to
the XYZ of their 5 nm sum with the least squared color difference. The squared CIEDE2000 of a small error is a
quadratic form of its XYZ, so every candidate set is one small non-negative least-squares problem out of the same
normal equations. Profiles take part: light that left within a radius must integrate well too.

Seeded, so a device writes the same file again; another device rounds its traces differently, which may move the last
digits of the weights.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.optimize import nnls

from lutgen import color
from lutgen.skin import chromophores
from lutgen.skin.tissue import Tissue, scattering
from lutgen.solvers import exact_totals, path_table, profiles
from lutgen.solvers.paths import PathTable, chebyshev, interpolation_matrix

STARTS = {6: 40, 8: 40, 12: 20}
LATTICE_NM = np.arange(390.0, 731.0, 2.0)
REFERENCE_NM = color.xyz_weights(5)[0]
EVERY_NM = np.union1d(LATTICE_NM, REFERENCE_NM)
BASE = Tissue()
# What the fit looks at: tissues, how many skins of each, and their share of the sum of squares. The default leads.
SPECTRA = {
    "default": (BASE, 1500, 5.0),
    "oxygenation": (BASE, 800, 0.3),
    "epidermis .06": (replace(BASE, epidermis_mm=0.06), 400, 0.1),
    "epidermis .25": (replace(BASE, epidermis_mm=0.25), 400, 0.1),
    "bashkatov": (replace(BASE, scattering="bashkatov"), 400, 0.1),
    "jacques": (replace(BASE, scattering="jacques"), 400, 0.1),
    "saidi": (replace(BASE, scattering="saidi"), 400, 0.1),
}
WHITE_SHARE, PROFILE_SHARE = 0.1, 1.0
ENERGY_AS_COLOR = 20.0
"""Encircled energy wrong by 1 counts as this color difference: shares .01 and .2 are both about what can be seen."""
REWEIGHTINGS = 1
PROFILES = 50
HELD_OUT, HELD_OUT_PROFILES = 4000, 200
RADIUS_EDGES_MM = profiles.ring_edges()
FIT_RINGS = np.flatnonzero(RADIUS_EDGES_MM[1:] >= profiles.COMPARED_FROM_MM)[:40:4]
TRACE_WAVELENGTHS, PHOTONS = 10, 2**20


@dataclass(frozen=True)
class Rows:
    """Spectra on the lattice [S, L], the XYZ they shall give [S, 3], the metric of an error [S, 3, 3], weights [S]."""

    spectra: np.ndarray
    xyz: np.ndarray
    metric: np.ndarray
    weight: np.ndarray

    def error(self, chosen: list[int], weights: np.ndarray) -> np.ndarray:
        """Color difference [S], to first order, of the spectra integrated at the chosen lattice points."""
        apart = self.spectra[:, chosen] @ weights - self.xyz
        return np.sqrt(np.einsum("si,sij,sj->s", apart, self.metric, apart))

    def normal_equations(self) -> tuple[np.ndarray, np.ndarray, float]:
        """Matrix [3, L, 3, L], right side [3, L] and constant of the weighted sum of squares of all lattice weights."""
        metric, L = self.metric * self.weight[:, None, None], self.spectra.shape[1]
        matrix = np.empty((3, L, 3, L))
        for i in range(3):
            for j in range(3):
                matrix[i, :, j] = self.spectra.T @ (metric[:, i, j, None] * self.spectra)
        side = np.einsum("sij,sj->is", metric, self.xyz) @ self.spectra
        return matrix, side, float(np.einsum("si,sij,sj", self.xyz, metric, self.xyz))


def random_skins(count: int, rng: np.random.Generator, wide: bool = False) -> tuple[np.ndarray, ...]:
    """Melanin, eumelanin, hemoglobin and oxygenation [S]; oxygenation .7, or `wide`: half near .7, half anywhere."""
    ranges = chromophores.MELANIN, chromophores.HEMOGLOBIN
    melanin, hemoglobin = (low * (high / low) ** rng.uniform(0, 1, count) for low, high in ranges)
    near = np.clip(rng.normal(0.7, 0.15, count), 0, 1)
    oxygenation = np.where(np.arange(count) % 2, near, rng.uniform(0, 1, count)) if wide else np.full(count, 0.7)
    return melanin, rng.uniform(*chromophores.EUMELANIN, count), hemoglobin, oxygenation


def corners() -> tuple[np.ndarray, ...]:
    """The twelve extreme skins at the default oxygenation, as `random_skins` gives them; the last has most of all."""
    pigments = np.meshgrid(chromophores.MELANIN, (0.0, 0.5, 1.0), chromophores.HEMOGLOBIN, indexing="ij")
    return *(values.ravel() for values in pigments), np.full(12, 0.7)


def with_corners(skins: tuple[np.ndarray, ...]) -> tuple[np.ndarray, ...]:
    """Both, the corners last."""
    return tuple(np.concatenate(pair) for pair in zip(skins, corners(), strict=True))


def color_metric(xyz: np.ndarray) -> np.ndarray:
    """Quadratic forms [S, 3, 3] that give the squared CIEDE2000 of small changes of XYZ [S, 3]."""
    step = 1e-5
    scale = np.maximum(xyz, 1e-3)

    def squared(direction: np.ndarray) -> np.ndarray:
        """Squared difference [S] per squared relative step."""
        ends = (color.lab(xyz + sign * step * direction * scale) for sign in (1, -1))
        return (color.delta_e00(*ends) / (2 * step)) ** 2

    axes = np.eye(3)
    metric = np.empty((len(xyz), 3, 3))
    for i in range(3):
        metric[:, i, i] = squared(axes[i])
        for j in range(i):
            metric[:, i, j] = squared(axes[i] + axes[j]) - metric[:, i, i] - metric[:, j, j]
            metric[:, i, j] = metric[:, j, i] = metric[:, i, j] / 2
    return metric / scale[:, :, None] / scale[:, None, :]


def color_rows(spectra: dict[str, np.ndarray], pipeline: str) -> dict[str, Rows]:
    """One set of rows per entry of SPECTRA, and the perfect white, of spectra [S, all wavelengths]."""
    shares = {name: share for name, (_, _, share) in SPECTRA.items()} | {"white": WHITE_SHARE}
    rows = {}
    for name, values in (spectra | {"white": np.ones((1, len(EVERY_NM)))}).items():
        xyz = values[:, index_of(REFERENCE_NM)] @ color.xyz_weights(5, pipeline)[1]
        weight = np.full(len(xyz), shares[name] / len(xyz))
        rows[name] = Rows(values[:, index_of(LATTICE_NM)], xyz, color_metric(xyz), weight)
    return rows


def index_of(wavelength_nm: np.ndarray) -> np.ndarray:
    """Where these wavelengths stand in EVERY_NM."""
    return np.searchsorted(EVERY_NM, wavelength_nm)


def trace(seed: int) -> PathTable:
    """Paths at all wavelengths of EVERY_NM, default setting, from a trace at few.

    Scattering is smooth in wavelength, so ten Chebyshev wavelengths that each cover every absorption stand for all;
    the noise of the spectra is smooth as well, and cancels where two sums over the same paths are compared.
    """
    nm = chebyshev(*chromophores.WAVELENGTH_NM, TRACE_WAVELENGTHS)
    ends = [f(EVERY_NM) for f in (chromophores.epidermis_range, chromophores.dermis_range)]
    epidermis, dermis = ((np.full(len(nm), low.min()), np.full(len(nm), high.max())) for low, high in ends)
    mu_s, g = scattering(BASE, nm)
    nu = np.minimum(epidermis[0], dermis[0])
    medium = path_table.Medium(nm, mu_s, g, nu, BASE.epidermis_mm, BASE.refractive_index)
    table = path_table.trace(medium, epidermis, dermis, RADIUS_EDGES_MM, PHOTONS, seed)
    every = np.zeros((len(EVERY_NM), 1))
    return replace(
        table, wavelength_nm=EVERY_NM, nu_per_mm=nu[0] + every[:, 0],
        mu_epidermis=table.mu_epidermis[0] + every, mu_dermis=table.mu_dermis[0] + every,
        energy=np.tensordot(interpolation_matrix(nm, EVERY_NM), table.energy, axes=1),
    )  # fmt: skip


def ring_spectra(table: PathTable, skins: tuple[np.ndarray, ...]) -> np.ndarray:
    """Energy [S, rings, all wavelengths] of skins."""
    melanin, eumelanin, hemoglobin, oxygenation = skins
    column = EVERY_NM[:, None]
    mu = chromophores.epidermis(column, melanin, eumelanin), chromophores.dermis(column, hemoglobin, oxygenation)
    return table.evaluate(*mu).transpose(2, 1, 0)


def profile_rows(rings: np.ndarray, pipeline: str) -> Rows:
    """Spectra of the light within ten radii, wrong by its share of each ACEScg channel's total."""
    inside = np.cumsum(rings, axis=1)
    reference = color.xyz_weights(5, pipeline)[1]
    total = inside[:, -1, index_of(REFERENCE_NM)] @ reference @ color.ACESCG_FROM_XYZ.T
    root = ENERGY_AS_COLOR * color.ACESCG_FROM_XYZ / total[:, :, None]
    within = inside[:, FIT_RINGS]
    metric = np.broadcast_to((root.transpose(0, 2, 1) @ root)[:, None], (*within.shape[:2], 3, 3)).reshape(-1, 3, 3)
    within = within.reshape(-1, len(EVERY_NM))
    weight = np.full(len(within), PROFILE_SHARE / len(within))
    return Rows(within[:, index_of(LATTICE_NM)], within[:, index_of(REFERENCE_NM)] @ reference, metric, weight)


def normal_equations(rows: dict[str, Rows]) -> tuple[np.ndarray, np.ndarray, float]:
    """The sum of all rows' normal equations."""
    matrix, side, constant = zip(*(part.normal_equations() for part in rows.values()), strict=True)
    return sum(matrix), sum(side), sum(constant)  # type: ignore[return-value]


def solve(equations: tuple[np.ndarray, np.ndarray, float], chosen: list[int]) -> tuple[np.ndarray, float]:
    """Best non-negative XYZ weights [K, 3] at the chosen lattice points, and the sum of squares they leave."""
    matrix, side, constant = equations
    K = len(chosen)
    matrix = matrix[:, chosen][:, :, :, chosen].reshape(3 * K, 3 * K)
    side = side[:, chosen].ravel()
    # Neighboring wavelengths make the matrix singular to rounding.
    root = np.linalg.cholesky(matrix + np.eye(3 * K) * (1e-12 * np.trace(matrix) / (3 * K)))
    x, _ = nnls(root.T, np.linalg.solve(root, side), maxiter=1000)
    return x.reshape(3, K).T, float(x @ matrix @ x - 2 * side @ x) + constant


def exchange(equations: list, chosen: list[int], rng: np.random.Generator) -> tuple[float, list[int]]:
    """Move one wavelength at a time to its best place until none moves; the sum of squares and the lattice points."""

    def left(points: list[int]) -> float:
        """Sum of squares of both pipelines."""
        return sum(solve(pipeline, points)[1] for pipeline in equations)

    best, moved = left(chosen), True
    while moved:
        moved = False
        for point in rng.permutation(chosen):
            rest = [other for other in chosen if other != point]
            places = [sorted([*rest, place]) for place in range(len(LATTICE_NM)) if place not in rest]
            value, places = min((left(place), place) for place in places)
            if value < best * (1 - 1e-6):
                best, chosen, moved = value, places, True
    return best, chosen


def reweighted(rows: dict[str, Rows], chosen: list[int], weights: np.ndarray) -> dict[str, Rows]:
    """The rows with more weight where the error is large, each set's share kept: nears the least maximum (Lawson)."""
    changed = dict(rows)
    for name in set(SPECTRA) - {"default"}:
        error = rows[name].error(chosen, weights)
        weight = rows[name].weight * (1 + (error / np.sqrt(np.mean(error**2))) ** 2 / 2)
        changed[name] = replace(rows[name], weight=weight * rows[name].weight.sum() / weight.sum())
    return changed


def choose(rows: dict[str, dict[str, Rows]], K: int) -> tuple[list[int], list[np.ndarray]]:
    """K lattice points and their XYZ weights [K, 3] per pipeline: the best of many exchanges, then reweighted."""
    equations = [normal_equations(part) for part in rows.values()]
    rng = np.random.default_rng(K)
    optima = []
    for _ in range(STARTS[K]):
        # One start wavelength in each of K equal parts of 400 to 700 nm.
        nm = 400 + 300 / K * (np.arange(K) + rng.uniform(0, 1, K))
        start = np.unique(np.rint((nm - LATTICE_NM[0]) / 2).astype(int))
        if len(start) == K:
            optima.append(exchange(equations, start.tolist(), rng))
    _, chosen = min(optima)
    for _ in range(REWEIGHTINGS):
        weights = [solve(part, chosen)[0] for part in equations]
        rows = {p: reweighted(part, chosen, w) for (p, part), w in zip(rows.items(), weights, strict=True)}
        equations = [normal_equations(part) for part in rows.values()]
        _, chosen = exchange(equations, chosen, rng)
    return chosen, [solve(part, chosen)[0] for part in equations]


def lines(
    chosen: dict[str, tuple[np.ndarray, dict[str, np.ndarray]]], held: dict[str, np.ndarray], rings: np.ndarray
) -> Iterator[str]:
    """Lines of the file: errors on held-out spectra and rings of every rule, then the weights of the chosen ones.

    `chosen` holds, per rule, the wavelengths [K] and per pipeline the XYZ weights [K, 3].
    """
    yield "# Wavelengths and non-negative XYZ weights under D65 that stand for a spectrum of skin every 5 nm."
    yield "# By lutgen.tables.make_wavelengths. Errors against the 5 nm sum, p95 and max: CIEDE2000 of random skins per"
    yield f"# setting ({HELD_OUT} each), difference of encircled energy ({HELD_OUT_PROFILES} skins, beyond .01 mm)."
    regular = {f"{step}nm": {p: color.xyz_weights(step, p) for p in color.PIPELINES} for step in (10, 5)}
    few = {name: {p: (nm, w) for p, w in weights.items()} for name, (nm, weights) in chosen.items()}
    for name, rule in (few | regular).items():
        for pipeline, (nm, weights) in rule.items():
            reference = color.xyz_weights(5, pipeline)[1]
            for setting, spectra in held.items():
                pair = (spectra[:, index_of(nm)] @ weights, spectra[:, index_of(REFERENCE_NM)] @ reference)
                yield f"# color,{name},{pipeline},{setting},{_worst(color.delta_e00(*map(color.lab, pair)))}"
            energy = rings[:, :, index_of(nm)] @ weights, rings[:, :, index_of(REFERENCE_NM)] @ reference
            yield f"# profile,{name},{pipeline},default,{_worst(energy_difference(*energy))}"
    yield ",".join(["rule", "wavelength_nm", *(f"{p}_{axis}" for p in color.PIPELINES for axis in "xyz")])
    for name, (nm, weights) in chosen.items():
        for row in np.column_stack([nm, *weights.values()]):
            yield ",".join([name, *(f"{value:.9g}" for value in row)])


def energy_difference(xyz_1: np.ndarray, xyz_2: np.ndarray) -> np.ndarray:
    """EE difference [S] of two profiles [S, rings, 3], the largest of the ACEScg channels."""
    rgb_1, rgb_2 = (np.moveaxis(xyz @ color.ACESCG_FROM_XYZ.T, -1, 1) for xyz in (xyz_1, xyz_2))
    return profiles.ee_difference(rgb_1, rgb_2, RADIUS_EDGES_MM).max(axis=-1)


def _worst(errors: np.ndarray) -> str:
    return f"{np.percentile(errors, 95):.4g},{errors.max():.4g}"


def main() -> None:
    """Write quadrature.csv beside this script."""
    rng = np.random.default_rng(0)
    fitted, held = {}, {}
    for name, (tissue, count, _) in SPECTRA.items():
        exact, wide = exact_totals.exact_totals(tissue), name != "default"
        fitted[name] = exact_totals.spectra(exact, EVERY_NM, *with_corners(random_skins(count, rng, wide)))
        held[name] = exact_totals.spectra(exact, EVERY_NM, *random_skins(HELD_OUT, rng, wide))
    rings = ring_spectra(trace(seed=0), with_corners(random_skins(PROFILES, rng)))
    held_rings = ring_spectra(trace(seed=1), random_skins(HELD_OUT_PROFILES, rng))
    rows = {p: color_rows(fitted, p) | {"profile": profile_rows(rings, p)} for p in color.PIPELINES}
    chosen = {}
    for K in STARTS:
        points, weights = choose(rows, K)
        chosen[str(K)] = LATTICE_NM[points], dict(zip(color.PIPELINES, weights, strict=True))
    text = "\n".join(lines(chosen, held, held_rings)) + "\n"
    (Path(__file__).parent / "quadrature.csv").write_text(text)


if __name__ == "__main__":
    main()
