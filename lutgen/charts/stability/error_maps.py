"""Maps of each method's error against exact solutions: over skin, and of diffusion over its own parameters."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType

import numpy as np

from lutgen.charts import drawing
from lutgen.charts.document.comparisons import told
from lutgen.charts.document.spectra import as_mixed
from lutgen.errors import InputError
from lutgen.skin import chromophores
from lutgen.skin.tissue import REFRACTIVE_INDEX, Layer, Skin, layers, preset
from lutgen.solvers import adding_doubling, dipole, direct, exact_totals, multipole, path_table
from lutgen.tables import bake
from lutgen.tables.axes import Axis

MIDDLE = preset("intermediate")
"""The skin of the maps, but for what their axes change."""
PARAMETERS = {"melanin": (chromophores.MELANIN, 1000), "hemoglobin": (chromophores.HEMOGLOBIN, 2000)}
"""What the maps run over: its range, and the number that Monte Carlo seeds are counted from."""
TRUTH_NODES = 24
"""Nodes of adding-doubling as truth: 3e-10 from 64 nodes on skin, while the default 16 are 7e-8 off."""
MIXED_DEPTH_MM = 0.24
"""Depth over which a skin is averaged to make one layer of it."""
# Measured: p95 of ΔE00 of the one layer's exact color to the skin's (epidermis 0.1 mm), 3 times 1,000 skins: least at
# .24, 10.05; 12.7 at .15, 10.4 at .20, 10.1 at .22 and .25, 10.7 at .30. Even the best one layer is far from skin.
SIGMAS, CHANCE = 4.0, 6.3e-5
"""Promised of Monte Carlo, in standard errors, and the share of cells beyond it by chance."""
NODES_TOLERANCE, TABLE_TOLERANCE = 1e-6, 1e-5
"""Promised of adding-doubling at its default nodes and of the table of exact totals, in shares of incident light."""
DIPOLE_EE, MULTIPOLE_EE = 0.15, 0.20
"""Promised of diffusion's profiles from one mean free path on: difference of encircled energy."""
N, G, UPPER, LOWER, SLAB = REFRACTIVE_INDEX, 0.75, 0.97, 0.96, 1.5
"""Held fixed in maps of diffusion: index, g, reduced albedo of the slab and below, thickness in mean free paths."""

Stack = list[Layer]


@dataclass(frozen=True)
class ErrorMap:
    """Error of a method [Y, X] in the cells between the nodes of two axes, at their centers.

    `error`: relative, signed (of profiles: difference of encircled energy). `beyond`: cells farther off than `promise`
    says; for mixed absorption, which promises its own closed form, farther from the truth than 4 σ. `refused`: cells
    that it answers only if unsafe. `z`: how far an estimate is from what is promised, in standard errors. `note`: more.
    """

    name: str
    promise: str
    x: Axis
    y: Axis
    error: np.ndarray
    beyond: np.ndarray
    refused: np.ndarray
    z: np.ndarray | None = None
    note: str = ""


def mixed_layer(skin: Skin, nm: float) -> Layer:
    """One semi-infinite layer to stand for a skin at a wavelength in nm: its mean over the top MIXED_DEPTH_MM.

    >>> upper, lower = layers(MIDDLE, 550)
    >>> lower.mu_a_per_mm < mixed_layer(MIDDLE, 550).mu_a_per_mm < upper.mu_a_per_mm
    True
    """
    upper, lower = layers(skin, nm)
    share = min(upper.thickness_mm / MIXED_DEPTH_MM, 1.0)
    mean = {n: share * getattr(upper, n) + (1 - share) * getattr(lower, n) for n in ("mu_a_per_mm", "mu_s_per_mm")}
    return replace(lower, **mean)


def exact(rows: list[list[Stack]], nodes: int = adding_doubling.NODES) -> np.ndarray:
    """Diffuse reflectance [X, Y] by adding-doubling of stacks of one or two layers, the last of them semi-infinite.

    A row has one thickness and index, a stack one g. Where a row scatters alike, no layer of it is solved twice.
    """
    names = ((0, "mu_a_per_mm"), (-1, "mu_a_per_mm"), (0, "mu_s_per_mm"), (0, "g"), (-1, "mu_s_per_mm"))
    exact_rows = []
    for row in rows:
        top, two = row[0][0], len(row[0]) == 2
        upper, lower, *optics = np.array([[getattr(stack[i], name) for stack in row] for i, name in names])
        (E, e), (D, d) = (np.unique(mu, return_inverse=True) for mu in (upper * two, lower))
        if np.ptp(optics, axis=1).any():
            E, D, e, d, k = upper[:, None], lower[:, None], 0, 0, np.arange(len(row))
        else:
            E, D, k, optics = E[None], D[None], 0, [values[:1] for values in optics]
        mu_s, g, below = optics
        mm = top.thickness_mm if two else 0.0
        exact_rows.append(adding_doubling.two_layer_grid(mm, E, D, mu_s, g, top.n, below, nodes)[k, e, d])
    return np.array(exact_rows)


def centers(axis: Axis) -> np.ndarray:
    """Centers of the cells between the nodes of an axis, in its spacing."""
    edges = axis.values
    return np.sqrt(edges[1:] * edges[:-1]) if axis.spacing == "log" else (edges[1:] + edges[:-1]) / 2


def _stacks(x: Axis, y: Axis, of: Callable[[float, float], Stack]) -> list[list[Stack]]:
    """Stacks [X][Y] at the centers of cells."""
    return [[of(float(a), float(b)) for b in centers(y)] for a in centers(x)]


def _skin(y: Axis, value: float, epidermis_mm: float = MIDDLE.epidermis_mm) -> Skin:
    return replace(MIDDLE, epidermis_mm=epidermis_mm, **{y.name: value})


def _refuses(solver: ModuleType, stack: Stack, *radii: np.ndarray) -> bool:
    """Whether a method refuses to give the reflectance of a stack, or its profile at radii."""
    try:
        (solver.profile if radii else solver.reflectance)(stack, *radii)
    except InputError:
        return True
    return False


def method_errors(parameter: str, quick: bool, progress: Callable) -> list[ErrorMap]:
    """Each method's error of diffuse reflectance over wavelength and `melanin` or `hemoglobin`."""
    reach, seed = PARAMETERS[parameter]
    nm = chromophores.WAVELENGTH_NM
    many, few = (
        (Axis("wavelength", "nm", *nm, m + 1), Axis(parameter, "volume fraction", *reach, n + 1, "log"))
        for m, n in (((12, 8), (6, 4)) if quick else ((32, 20), (16, 10)))
    )
    maps: list[ErrorMap] = []
    for stage, more in (
        ("tables", _tables(*many, 32_768 if quick else 131_072, seed)),
        ("walks", _walks(*few, 8192 if quick else 32_768, seed)),
        ("diffusion", _diffusion(*many)),
    ):
        progress(f"error-{parameter}: {stage}", None)
        maps += more
    return maps


def _answered(name: str, promise: str, x: Axis, y: Axis, estimate, truth, least, z=None) -> ErrorMap:
    """The map of a method that refuses nothing, from [X, Y]: beyond is what errs by more than `least`."""
    beyond = (abs(estimate - truth) > least).T
    return ErrorMap(name, promise, x, y, (estimate / truth - 1).T, beyond, np.zeros_like(beyond), z)


def _tables(x: Axis, y: Axis, photons: int, seed: int) -> Iterator[ErrorMap]:
    """Adding-doubling at its default nodes, the table of exact totals, and the path table, a trace per wavelength."""
    stacks, nm = _stacks(x, y, lambda nm, v: layers(_skin(y, v), nm)), centers(x)
    mu = [np.array([[stack[i].mu_a_per_mm for stack in row] for row in stacks]) for i in (0, 1)]
    truth, of = exact(stacks, TRUTH_NODES), "of the incident light"
    name = f"adding-doubling, {adding_doubling.NODES} nodes"
    yield _answered(name, f"1e-6 {of}", x, y, exact(stacks), truth, NODES_TOLERANCE)
    tabled = exact_totals.exact_totals(MIDDLE.tissue)(nm, *mu)
    yield _answered("table of exact totals", f"1e-5 {of}", x, y, tabled, truth, TABLE_TOLERANCE)
    medium, reach = bake.skin_medium(MIDDLE.tissue, nm)
    paths = path_table.trace(medium, *reach, np.array([0.0, 30.0]), photons, seed)
    mean, sigma = paths.evaluate(*mu)[:, 0], paths.std_error(*mu)[:, 0]
    promise = f"{SIGMAS:g} σ ({photons:,} photons, one trace a column)"
    yield _answered("path-table", promise, x, y, mean, truth, SIGMAS * sigma, ((mean - truth) / sigma).T)


def _walks(x: Axis, y: Axis, photons: int, seed: int) -> Iterator[ErrorMap]:
    """`direct` with each absorption, a walk and a seed of its own for each cell."""
    stacks = _stacks(x, y, lambda nm, v: layers(_skin(y, v), nm))
    bright = [[as_mixed(stack) for stack in row] for row in stacks]
    truth, closed = exact(stacks, TRUTH_NODES), exact(bright, TRUTH_NODES)
    flat = [stack for row in stacks for stack in row]
    for absorption in direct.ABSORPTION:
        walks = [direct.shares(stack, photons, seed + k, absorption=absorption) for k, stack in enumerate(flat)]
        seed += len(flat)
        mean, sigma = np.array([(w.diffuse, w.diffuse_error) for w in walks]).T.reshape(2, *truth.shape)
        promise, promised = f"{SIGMAS:g} σ ({photons:,} photons a cell)", truth
        if absorption == "mixed":
            promise, promised = f"closed form, {promise}", closed
        z = ((mean - promised) / sigma).T
        yield _answered(f"direct ({absorption})", promise, x, y, mean, truth, SIGMAS * sigma, z)


def _diffusion(x: Axis, y: Axis) -> Iterator[ErrorMap]:
    """Dipole, of the skin mixed to one layer, and multipole, at two thicknesses of the epidermis."""
    of = f"skin mixed over {MIXED_DEPTH_MM:g} mm"
    yield _asked(dipole, f"dipole, {of}", x, y, lambda nm, v: [mixed_layer(_skin(y, v), nm)])
    for mm in (MIDDLE.epidermis_mm, 0.25):
        of = f"epidermis {mm:g} mm"
        yield _asked(multipole, f"multipole, {of}", x, y, lambda nm, v, mm=mm: layers(_skin(y, v, mm), nm))


def _asked(solver: ModuleType, name: str, x: Axis, y: Axis, of: Callable[[float, float], Stack]) -> ErrorMap:
    """The map of a diffusion method's total, made to answer where it refuses."""
    stacks = _stacks(x, y, of)
    diffuse = np.array([[solver.reflectance(stack, unsafe=True).diffuse for stack in row] for row in stacks])
    error = (diffuse / exact(stacks) - 1).T
    refused = np.array([[_refuses(solver, stack) for stack in row] for row in stacks]).T
    promise = f"{100 * dipole.TOLERANCE:g} % of the total, where it answers"
    return ErrorMap(name, promise, x, y, error, abs(error) > dipole.TOLERANCE, refused)


def diffusion_errors(quick: bool, progress: Callable) -> list[ErrorMap]:
    """Dipole's and multipole's errors over their own parameters: of two totals and of the profile each."""
    progress("diffusion-domain: totals", None)
    fine, photons = (1, 8192) if quick else (2, 65_536)
    albedo, upper, lower = (
        Axis(f"reduced albedo{of}", "1", 0.7, 1, 15 * fine + 1) for of in ("", " of the slab", " below the slab")
    )
    g, n = Axis("anisotropy g", "1", -0.5, 1, 15 * fine + 1), Axis("refractive index n", "1", 1, 2, 10 * fine + 1)
    thick = Axis("thickness of the slab", "mean free paths", 0.25, 8, 10 * fine + 1, "log")
    radius = Axis("radius", "mean free paths", 0.1, 10, 10 * fine + 1, "log")
    totals = [
        _asked(dipole, f"dipole, n {N:g}", g, albedo, lambda g, a: [_layer(a, g=g)]),
        _asked(dipole, f"dipole, g {G:g}", n, albedo, lambda n, a: [_layer(a, n=n)]),
        _asked(multipole, f"multipole, {LOWER:g} below", thick, upper, lambda t, a: [_layer(a, t), _layer(LOWER)]),
        _asked(multipole, f"multipole, slab of {UPPER:g}", thick, lower, lambda t, a: [_layer(UPPER, t), _layer(a)]),
    ]
    progress("diffusion-domain: profiles", None)
    shared = radius, photons
    return [
        *totals[:2],
        _ringed(dipole, "dipole's profile", DIPOLE_EE, albedo, *shared, lambda a: [_layer(a)]),
        *totals[2:],
        _ringed(multipole, f"multipole's profile, {SLAB:g} free paths over {LOWER:g}", MULTIPOLE_EE, upper, *shared,
                lambda a: [_layer(a, SLAB), _layer(LOWER)]),
    ]  # fmt: skip


def _layer(albedo: float, thickness_mm: float = np.inf, n: float = N, g: float = G) -> Layer:
    """A layer of that reduced albedo with a reduced mean free path of 1 mm."""
    return Layer(thickness_mm, 1 - albedo, albedo / (1 - g), g, n)


def _ringed(solver: ModuleType, name: str, tolerance: float, y: Axis, x: Axis, photons: int, of) -> ErrorMap:
    """The map of a diffusion method's encircled energy against that of `direct`."""
    stacks, radii = [of(float(a)) for a in centers(y)], centers(x)
    edges = np.array([0.0, *radii, np.inf])
    walked = [direct.profile(stack, edges, photons, seed).encircled() for seed, stack in enumerate(stacks, 3000)]
    within = [solver.profile(stack, edges, unsafe=True).encircled() for stack in stacks]
    error = (np.array(within) - walked)[:, 1:-1]
    refused = np.array([[_refuses(solver, stack, np.array([0.0, r, np.inf])) for r in radii] for stack in stacks])
    promise = f"{tolerance:g} of encircled energy, where it answers"
    near = 100 * np.sum(within, axis=0)[1] / np.sum(walked, axis=0)[1]
    note = f"; {near:.0f} % of the light within {radii[0]:.2g}"
    return ErrorMap(name, promise, x, y, error, abs(error) > tolerance, refused, note=note)


def outcome(error_map: ErrorMap) -> str:
    """What a map promises and shows, in words."""
    beyond, z = error_map.beyond, error_map.z
    cells, farther, silent = beyond.size, int(beyond.sum()), int((beyond & ~error_map.refused).sum())
    if z is None:
        words = "" if not farther else f", {silent} not refused" if silent else ", all refused"
        return f"promised: {error_map.promise}\nfarther off: {farther} of {cells} cells{words}{error_map.note}"
    far = int((abs(z) > SIGMAS).sum())
    words = f"promised: {error_map.promise}\nlargest |z| {abs(z).max():.1f}, {far} of {cells} cells farther"
    return f"{words} (by chance {CHANCE * cells:.2g})" if far == farther else f"{words}; off the truth: {farther}"


def _draw(folder: Path, name: str, title: str, notes: str, maps: list[ErrorMap], ends, label: str) -> str:
    """Draw maps as NAME.svg and NAME.png, write their cells as NAME.csv, and return what they show in a line."""
    silent = {m.name: int((m.beyond & ~m.refused).sum()) for m in maps}
    unsaid = "; ".join(f"{method} in {count} cells" for method, count in silent.items() if count) or "none"
    notes += "\nThick outline: farther off than promised. Hatched: refused; drawn is what unsafe=True gives. "
    notes += f"Outlined but not refused: {unsaid}."
    panels = [drawing.HeatMap(m.name, outcome(m), m.x, m.y, abs(m.error), m.beyond, m.refused) for m in maps]
    rows = [
        {"method": m.name, "x": m.x.name, "x_value": float(x), "y": m.y.name, "y_value": float(y),
         "error": float(m.error[j, i]), "z": "" if m.z is None else float(m.z[j, i]),
         "beyond": int(m.beyond[j, i]), "refused": int(m.refused[j, i])}
        for m in maps for j, y in enumerate(centers(m.y)) for i, x in enumerate(centers(m.x))
    ]  # fmt: skip
    with drawing.figure(folder, name, rows, (13.4, 4.2 + 3.1 * ((len(maps) - 1) // 3)), title, notes) as drawn:
        drawing.heat_maps(drawn, panels, 1.75, ends, label)
    beyond = sum(row["beyond"] for row in rows)
    return f"{name}: {beyond} of {len(rows)} cells farther off than promised, not refused of them: {unsaid}"


def methods(folder: Path, quick: bool, progress: Callable) -> str:
    """Draw `error-melanin` and `error-hemoglobin`: every method's error over skin and wavelength."""
    shown = []
    for parameter in PARAMETERS:
        maps = method_errors(parameter, quick, progress)
        notes = (
            f"Against adding-doubling ({TRUTH_NODES} nodes; for diffusion {adding_doubling.NODES}). If not said: "
            f"{told(MIDDLE, ', ')}, epidermis {MIDDLE.epidermis_mm:g} mm.\nWhat direct (mixed) promises is its own "
            f"biased closed form: it is outlined where it is farther than {SIGMAS:g} σ from the truth."
        )
        title = f"Error of every method over wavelength and {parameter}"
        shown.append(_draw(folder, f"error-{parameter}", title, notes, maps, (1e-9, 1.0), "|relative error|"))
    return "; ".join(shown)


def diffusion(folder: Path, quick: bool, progress: Callable) -> str:
    """Draw `diffusion-domain`: errors of dipole and multipole over their own parameters, and what they refuse."""
    maps = diffusion_errors(quick, progress)
    notes = (
        "Left and middle: totals against adding-doubling. Right: encircled energy against direct, and what share of "
        "direct's light a profile has within the least radius.\n"
        f"Index {N:g} and g {G:g} unless an axis says otherwise; numbers in the multipole's titles are reduced albedos."
    )
    label = "|relative error| of a total, |difference| of encircled energy"
    return _draw(folder, "diffusion-domain", "Where diffusion can be trusted", notes, maps, (1e-3, 1.0), label)
