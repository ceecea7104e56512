"""Every way to fill a 16 x 8 x 16 color LUT: how long it takes, and how far it is from adding-doubling at 5 nm.

Methods that share work between nodes make the whole LUT. Methods that take one skin at a time make the nodes of a
few cells, are judged on skins in those cells alone, and their time is scaled to all nodes: such runs have `share` < 1.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from lutgen import color
from lutgen import device as ocl
from lutgen.charts.document.spectra import as_mixed
from lutgen.charts.drawing import silent
from lutgen.charts.stability.error_maps import mixed_layer
from lutgen.skin import chromophores, tissue
from lutgen.solvers import adding_doubling, dipole, direct, exact_totals, multipole, path_table, profiles
from lutgen.tables import bake, expand
from lutgen.tables import wavelengths as quadrature
from lutgen.tables.recipe import Recipe

RECIPE = Recipe()
GRID = RECIPE.color
SKINS = 1000
SKINS_PER_CELL = 40
WAVELENGTHS = RECIPE.wavelengths


@dataclass(frozen=True)
class Run:
    """One LUT made once: seconds of a whole one, what share of it was made, and its ΔE00 at random skins."""

    method: str
    photons: int
    seed: int
    seconds: float
    share: float
    profiles: bool
    skins: int
    delta_e00_p95: float
    delta_e00_max: float


@dataclass(frozen=True)
class Jury:
    """Nodes to make (flat indices, their chromophores [3, N]), and skins [3, S] with their true Lab [S, 3]."""

    nodes: np.ndarray
    chromophores: np.ndarray
    skins: np.ndarray
    lab: np.ndarray

    @property
    def share(self) -> float:
        """Share of the LUT's nodes."""
        return len(self.nodes) / int(np.prod(GRID.shape))


def jury(cells: int = 0, seed: int = 1) -> Jury:
    """1,000 random skins and all nodes; or `cells` random cells, their corners and 40 random skins in each.

    Both draw melanin and hemoglobin log-uniform: a cell with the chance that a random skin has to lie in it.
    """
    skins = np.array(bake.random_skins(GRID, cells or SKINS, seed))
    nodes = np.arange(np.prod(GRID.shape))
    if cells:
        skins, nodes = _within_cells(skins, np.random.default_rng(seed))
    nm, weights = color.xyz_weights(5)
    exact = _spectra(skins, nm)
    values = np.array([v.ravel()[nodes] for v in GRID.nodes()])
    return Jury(nodes, values, skins, color.lab(exact @ weights))


def _spectra(skins: np.ndarray, wavelength_nm: np.ndarray) -> np.ndarray:
    """Exact diffuse reflectance [S, K] of skins [3, S]."""
    melanin, eumelanin, hemoglobin = skins
    exact = exact_totals.exact_totals(RECIPE.skin)
    return exact_totals.spectra(exact, wavelength_nm, melanin, eumelanin, hemoglobin, RECIPE.skin.oxygenation)


def _within_cells(picked: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    skins, corners = [], set()
    for skin in picked.T:
        inside, spans = [], []
        for axis, value in zip(GRID.axes[::-1], skin, strict=True):
            low = min(int(axis.position(value)), axis.count - 2)
            bounds = axis.values[low : low + 2]
            log = axis.name != "eumelanin"
            first, last = np.log(bounds) if log else bounds
            drawn = rng.uniform(first, last, SKINS_PER_CELL)
            inside.append(np.exp(drawn) if log else drawn)
            spans.append((low, low + 1))
        skins.append(inside)
        m, e, h = np.meshgrid(*spans, indexing="ij")
        corners.update(np.ravel_multi_index((h.ravel(), e.ravel(), m.ravel()), GRID.shape).tolist())
    return np.concatenate(skins, axis=1), np.array(sorted(corners))


def judge(acescg: np.ndarray, panel: Jury) -> tuple[float, float]:
    """ΔE00, p95 and largest, of a LUT's colors [N, 3] at a jury's nodes, interpolated at its skins."""
    cells = np.zeros((*GRID.shape, 3))
    cells.reshape(-1, 3)[panel.nodes] = acescg
    lab = color.lab(color.from_acescg(GRID.interpolate(cells, *panel.skins), "xyz"))
    apart = color.delta_e00(lab, panel.lab)
    return float(np.percentile(apart, 95)), float(apart.max())


def _run(method: str, make: Callable[[], np.ndarray], panel: Jury, photons=0, seed=0, has_profiles=False) -> Run:
    start = time.perf_counter()
    acescg = make()
    seconds = (time.perf_counter() - start) / panel.share
    p95, largest = judge(acescg, panel)
    return Run(method, photons, seed, seconds, panel.share, has_profiles, panel.skins.shape[1], p95, largest)


def rule_weights(rule: quadrature.Quadrature) -> np.ndarray:
    """ACEScg weights [K, 3] of a quadrature rule."""
    return expand.rgb_weights(rule.xyz_weights)


def walked(photons: int, seed: int, wavelengths: str = WAVELENGTHS, anchored: bool = False) -> np.ndarray:
    """Colors of all nodes from one trace per wavelength, its profiles expanded too; totals exact if `anchored`."""
    rule = quadrature.load(wavelengths)
    medium, reach = bake.skin_medium(RECIPE.skin, rule.wavelength_nm)
    paths = path_table.trace(medium, *reach, profiles.ring_edges(), photons, seed)
    if anchored:
        exact = exact_totals.exact_totals(RECIPE.skin)
        paths = paths.anchored(exact.grid(rule.wavelength_nm, paths.mu_epidermis, paths.mu_dermis))
    absorb = expand.absorbers(rule.wavelength_nm, RECIPE.skin.oxygenation)
    expand.profile_cells(paths, RECIPE.profile, absorb, rule_weights(rule))
    return expand.color_cells(paths.totals(), GRID, absorb, rule_weights(rule)).reshape(-1, 3)


def factored(wavelengths: str, streams: int = adding_doubling.NODES) -> np.ndarray:
    """Colors of all nodes by adding-doubling, each epidermis and dermis solved once per wavelength."""
    rule = quadrature.load(wavelengths)
    nm = rule.wavelength_nm
    m, e = np.meshgrid(GRID.melanin.values, GRID.eumelanin.values)
    mu_e = chromophores.epidermis(nm[:, None], m.ravel(), e.ravel())
    mu_d = chromophores.dermis(nm[:, None], GRID.hemoglobin.values, RECIPE.skin.oxygenation)
    scattering = tissue.scattering(RECIPE.skin, nm)
    R = adding_doubling.two_layer_grid(
        RECIPE.skin.epidermis_mm, mu_e, mu_d, *scattering, RECIPE.skin.refractive_index, nodes=streams
    )
    return np.einsum("ked,kc->dec", R, rule_weights(rule)).reshape(-1, 3)


def tabled(wavelengths: str) -> np.ndarray:
    """Colors of all nodes from the table of exact totals that a bake checks itself with."""
    rule = quadrature.load(wavelengths)
    return _spectra(np.array([v.ravel() for v in GRID.nodes()]), rule.wavelength_nm) @ rule_weights(rule)


def one_by_one(solve: Callable[[tissue.Skin, float], float], panel: Jury) -> np.ndarray:
    """Colors [N, 3] of a jury's nodes, each skin and each wavelength on its own."""
    rule = quadrature.load(WAVELENGTHS)
    skins = [tissue.skin_of(tissue.Chromophores(*values), RECIPE.skin) for values in panel.chromophores.T]
    R = np.array([[solve(skin, float(nm)) for nm in rule.wavelength_nm] for skin in skins])
    return R @ rule_weights(rule)


def _stacked(skin: tissue.Skin, nm: float) -> float:
    return adding_doubling.reflectance(tissue.layers(skin, nm)).diffuse


def _mixed(skin: tissue.Skin, nm: float) -> float:
    return adding_doubling.reflectance(as_mixed(tissue.layers(skin, nm))).diffuse


def _one_layer(skin: tissue.Skin, nm: float) -> float:
    return dipole.reflectance([mixed_layer(skin, nm)], unsafe=True).diffuse


def _two_layers(skin: tissue.Skin, nm: float) -> float:
    return multipole.reflectance(tissue.layers(skin, nm), unsafe=True).diffuse


def _drawn(skin: tissue.Skin, nm: float, absorption: str, photons: int, seeds: Iterator[int]) -> float:
    layers = tissue.layers(skin, nm)
    return direct.shares(layers, photons, next(seeds), absorption=absorption).diffuse


def runs(quick: bool, progress: Callable = silent) -> list[Run]:
    """Every method at every setting; Monte Carlo over photons and seeds."""
    ocl.choose()
    everything, some = jury(), jury(4 if quick else 10)
    seeds = range(3 if quick else 5)
    done = []
    for k, powers in (("8", range(10, 18 if quick else 23, 2)), ("6", range(12, 17 if quick else 21, 2))):
        progress(f"path table, {k} wavelengths", None)
        walked(2048, 0, k)  # builds the kernels
        for photons in (2**p for p in powers):
            name = f"path table, {k} wavelengths"
            done += [_run(name, partial(walked, photons, s, k), everything, photons, s, True) for s in seeds]
    progress("anchored, adding-doubling", None)
    done.append(_run("path table, anchored", partial(walked, 65_536, 0, "8", True), everything, 65_536, 0, True))
    for wavelengths in ("8",) if quick else ("8", "5nm"):
        rule = "8 wavelengths" if wavelengths == "8" else "every 5 nm"
        done.append(_run(f"adding-doubling, factored, {rule}", partial(factored, wavelengths), everything))
    done.append(_run("exact totals table, every 5 nm", partial(tabled, "5nm"), everything))
    done.append(_run("adding-doubling, node by node", partial(one_by_one, _stacked, some), some))
    for method, solve in (("dipole", _one_layer), ("multipole", _two_layers)):
        progress(method, None)
        panel = some if quick else everything
        done.append(_run(method, partial(one_by_one, solve, panel), panel))
    for absorption in direct.ABSORPTION:
        progress(f"direct, {absorption}", None)
        direct.shares(tissue.layers(tissue.preset("light"), 550.0), 512, absorption=absorption)
        for photons in (2**p for p in range(6, 12 if quick else 15, 2)):
            for seed in seeds:
                count = iter(range(seed * 10**6, (seed + 1) * 10**6))  # no two nodes share their random numbers
                solve = partial(_drawn, absorption=absorption, photons=photons, seeds=count)
                done.append(_run(f"direct, {absorption}", partial(one_by_one, solve, some), some, photons, seed))
    return done


def floors(quick: bool) -> dict[str, tuple[float, float]]:
    """ΔE00 (p95, largest) at which Monte Carlo curves end however many photons: what else errs, computed exactly."""
    everything, some = jury(), jury(4 if quick else 10)
    ends = {"interpolation between nodes": judge(tabled("5nm"), everything)}
    for name in ("6", "8"):
        rule = quadrature.load(name)
        lab = color.lab(_spectra(everything.skins, rule.wavelength_nm) @ rule.xyz_weights)
        apart = color.delta_e00(lab, everything.lab)
        ends[f"quadrature of {name} wavelengths"] = float(np.percentile(apart, 95)), float(apart.max())
    ends["bias of mixed absorption"] = judge(one_by_one(_mixed, some), some)
    return ends


def pareto(points: list[tuple[float, float]]) -> list[int]:
    """Indices of the points (seconds, error) that no other beats in both, by rising seconds.

    >>> pareto([(1.0, 3.0), (2.0, 4.0), (3.0, 1.0)])
    [0, 2]
    """
    front: list[int] = []
    for i in sorted(range(len(points)), key=lambda i: points[i]):
        if not front or points[i][1] < points[front[-1]][1]:
            front.append(i)
    return front
