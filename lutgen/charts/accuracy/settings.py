"""What each setting costs in accuracy: wavelengths, LUT axes, half floats; each measured apart from the others.

Nothing but the setting errs in what is compared: colors are exact totals everywhere, and both sides of a profile
comparison read the same traced paths, so that their noise cancels (what is left of it is measured and drawn).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

import lutgen
from lutgen import color
from lutgen.charts import drawing
from lutgen.charts.drawing import DASHES, GRAY, HUES, INK, inches
from lutgen.planning import stored_paths
from lutgen.solvers import exact_totals, profiles
from lutgen.solvers.paths import PathTable
from lutgen.tables import bake, expand
from lutgen.tables.axes import Grid, default_grid
from lutgen.tables.recipe import Recipe

TISSUE = Recipe().skin
"""The setting of every chart here: the default recipe's."""
*RULES, REFERENCE = _ALL = ("6", "8", "12", "10nm", "5nm")
TRACE_WAVELENGTHS, TRACE_SEEDS, PHOTONS = 10, (0, 1), {False: 2**20, True: 2**17}
SKINS_SEED, SKINS, PROFILES = 1, {False: 1000, True: 300}, {False: 200, True: 50}
CUBE_ROOT, POWER = "cube root", "cube root, e^0.6"
SPACINGS = {"linear": ("linear", "linear"), "log": ("log", "linear"),
            CUBE_ROOT: ("cbrt", "linear"), POWER: ("cbrt", "power:0.6")}  # fmt: skip
"""Spacings of melanin and hemoglobin, and of eumelanin."""
COLOR_SIZES = ((8, 4, 8), (12, 6, 12), (16, 8, 16), (24, 12, 16), (32, 16, 16), (48, 16, 32))
PROFILE_SIZES = ((6, 3, 4), (8, 4, 8), (12, 4, 8), (16, 4, 8), (24, 6, 12), (32, 8, 16))
"""Nodes of melanin, eumelanin and hemoglobin."""
STORED = {"float": np.float32, "half": np.float16}
FAR_SHARE, HALF_NORMAL, HALF_MAX = 1e-3, 2.0**-14, 65_504.0
_EDGES = profiles.ring_edges()
_TABLES = (
    "Nodes: melanin × eumelanin × hemoglobin. Spacing of melanin and hemoglobin as named; of eumelanin linear, or even "
    "in e^0.6 (crosses).\nFilled: float. Hollow, dotted: the cube-root tables as half."
)


def settings(folder: Path, quick: bool = False) -> str:
    """Draw the charts `wavelengths`, `axes`, `profile-axes`; main figures in a line. `quick`: fewer photons, skins."""
    exact = exact_paths()
    return "; ".join((wavelengths(folder, exact, quick), color_axes(folder, exact, quick), profile_axes(folder, quick)))


def grid(size: tuple[int, int, int], spacing: str, eumelanin: str) -> Grid:
    """The grid over the whole range with that many nodes of melanin, eumelanin, hemoglobin, and those spacings."""
    axes = default_grid(*size)
    melanin, hemoglobin = (replace(axis, spacing=spacing) for axis in (axes.melanin, axes.hemoglobin))
    return Grid(melanin, replace(axes.eumelanin, spacing=eumelanin), hemoglobin)


def exact_paths() -> PathTable:
    """The exact totals as a path table of one ring, at ten Chebyshev wavelengths."""
    exact = exact_totals.exact_totals(TISSUE)
    nu, ring = np.zeros(exact_totals.WAVELENGTHS), np.array([0, np.inf])
    mu_e, mu_d = (np.tile(root**3, (len(nu), 1)) for root in (exact.root_epidermis, exact.root_dermis))
    return PathTable(exact.wavelength_nm, nu, ring, mu_e, mu_d, exact.table[:, None], 0, 1.0)


def traced_paths(photons: int, seed: int) -> PathTable:
    """A trace at ten Chebyshev wavelengths, each covering the absorption of all from 380 to 780 nm."""
    return bake.paths_at_every_wavelength(photons, _EDGES, seed, TISSUE, count=TRACE_WAVELENGTHS)


def acescg(table: PathTable, weights: np.ndarray, skins) -> np.ndarray:
    """ACEScg energy [P, 3, B] of skins (chromophore arrays [P]), from paths at K wavelengths of weights [K, 3]."""
    mu = expand.coefficients(table.wavelength_nm, _absorbers(table), *skins)
    return np.einsum("kbp,kc->pcb", table.evaluate(*mu), weights, optimize=True)


def _absorbers(paths: PathTable) -> expand.Absorbers:
    return expand.absorbers(paths.wavelength_nm, TISSUE.oxygenation)


def _skins(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return bake.random_skins(Recipe().color, count, SKINS_SEED)


def _difference(rgb_1: np.ndarray, rgb_2: np.ndarray) -> np.ndarray:
    return color.delta_e00(*(color.lab(color.from_acescg(rgb, "xyz")) for rgb in (rgb_1, rgb_2)))


def _errors(kind: str, errors: np.ndarray) -> dict[str, float]:
    return {f"{kind}_p95": float(np.percentile(errors, 95)), f"{kind}_max": float(errors.max())}


def profile_errors(photons: int, skins) -> tuple[np.ndarray, np.ndarray]:
    """EE differences [R, P] of the RULES to every 5 nm, and their noise [R, P]; the largest of the ACEScg channels.

    Both sums of a difference read the same paths: traced apart, every wavelength would have noise of its own, and
    rules would differ by that. The difference is the mean of those of two traces; half of what these two differ by is
    its noise.
    """
    apart = []
    for paths in (traced_paths(photons, seed) for seed in TRACE_SEEDS):
        shapes = (np.maximum(acescg(*stored_paths.at_rule(paths, rule), skins), 0) for rule in _ALL)
        *within, reference = map(profiles.encircled, shapes)
        apart.append((np.array(within) - reference)[..., _EDGES >= profiles.COMPARED_FROM_MM])
    first, second = apart
    return np.abs(first + second).max(axis=(-1, -2)) / 2, np.abs(first - second).max(axis=(-1, -2)) / 2


def wavelengths(folder: Path, exact: PathTable, quick: bool = False) -> str:
    """The chart `wavelengths`: color and profile error of each quadrature rule; its main figures in words."""
    off, noise = profile_errors(PHOTONS[quick], _skins(PROFILES[quick]))
    tables = {rule: stored_paths.at_rule(exact, rule) for rule in _ALL}
    *colors, truth = (acescg(*table, _skins(SKINS[quick]))[..., 0] for table in tables.values())
    K = [len(tables[rule][1]) for rule in RULES]
    rows = [
        {"rule": rule, "wavelengths": K[i]} | _errors("delta_e00", _difference(colors[i], truth))
        | _errors("ee_difference", off[i]) | _errors("ee_noise", noise[i])
        for i, rule in enumerate(RULES)
    ]  # fmt: skip
    notes = (
        f"Each rule against every 5 nm (81 wavelengths). Color: exact spectra of {SKINS[quick]} random skins. Profile: "
        f"{PROFILES[quick]} skins, largest difference of\nencircled energy at 0.01 mm and more in any ACEScg channel; "
        f"both sums read the same paths, {PHOTONS[quick]} photons at each of {TRACE_WAVELENGTHS}\nwavelengths, "
        "interpolated in wavelength. Mean of two traces; noise: half of what they differ by. p95, max: over the skins."
    )
    title = "12 fitted wavelengths do the work of a regular grid of 41"
    with drawing.figure(folder, "wavelengths", rows, (11.8, 5.0), title, notes) as drawn:
        panels = ("delta_e00", "color difference ΔE00", (1e-3, 0.3)), ("ee_difference", "EE difference", (1e-6, 0.02))
        for i, (kind, label, ends) in enumerate(panels):
            axes = inches(drawn, 0.9 + 5.8 * i, 1.3, 3.5, 3.1)
            axes.set(xscale="log", xlim=(5, 46), xlabel="wavelengths traced")
            axes.set_xticks(K, [str(count) for count in K])
            _decades(axes, label, ends)
            for rules, words, hue in ((slice(3), "fitted", HUES[0]), (slice(3, None), "every 10 nm", HUES[1])):
                labels = []
                for which, dash, fill in (("p95", DASHES[0], hue), ("max", DASHES[1], "white")):
                    y = [row[f"{kind}_{which}"] for row in rows[rules]]
                    axes.plot(K[rules], y, color=hue, linestyle=dash, marker="o", markerfacecolor=fill)
                    labels.append((y[-1], f"{words}, {which}", hue))
                if (kind, words) == ("ee_difference", "every 10 nm"):
                    axes.plot(K, noise.max(axis=1), color=GRAY, linestyle=DASHES[2], linewidth=1.1)
                    labels.append((noise[3].max(), "noise, max", GRAY))
                drawing.label_ends(axes, K[rules][-1], labels, 0.13 + 0.12 * i)
    told = (f"{r['wavelengths']} ΔE00 {r['delta_e00_p95']:.2g} EE {r['ee_difference_p95']:.2g}" for r in rows)
    return f"wavelengths (p95) {', '.join(told)}"


def _decades(axes, label: str, ends: tuple[float, float]) -> None:
    """A logarithmic y axis with ticks and rules at powers of ten, and no other ticks."""
    powers = range(int(np.ceil(np.log10(ends[0]))), int(np.floor(np.log10(ends[1]))) + 1)
    axes.set(yscale="log", ylim=ends, ylabel=label)
    axes.set_yticks([10.0**n for n in powers], [f"{10.0**n:g}" if n > -5 else f"1e{n}" for n in powers])
    axes.minorticks_off()
    axes.grid(axis="y")


def table_rows(sizes: tuple, skins, kind: str, cells: Callable, errors: Callable) -> list[dict]:
    """A row per spacing, size and number format: bytes of the table cells(grid), errors(its values at skins)."""
    rows = []
    for name, spacings in SPACINGS.items():
        for size in sizes:
            nodes = grid(size, *spacings)
            exact = cells(nodes)
            for stored, number in STORED.items():
                kept = exact.astype(number)
                between = nodes.interpolate(kept.astype(float), *skins)
                row = {"part": "table", "spacing": name, "nodes": "×".join(map(str, size)), "stored": stored}
                rows.append(row | {"bytes": kept.nbytes} | _errors(kind, errors(between)))
    return rows


def _by_bytes(drawn, rows: list[dict], kind: str, label: str, ends: tuple[float, float]) -> None:
    """Panels of p95 and maximum against bytes: a line per spacing, and the cube root's as half with its nodes."""
    smallest, largest = (f(row["bytes"] for row in rows) for f in (min, max))
    for i, which in enumerate(("p95", "max")):
        axes, labels = inches(drawn, 0.9 + 5.6 * i, 1.6, 3.6, 3.3), []
        axes.set(xscale="log", xlabel="bytes of the table in memory", title=("95th percentile", "maximum")[i])
        axes.set_xticks([1e3, 1e4, 1e5, 1e6], ["1 kB", "10 kB", "100 kB", "1 MB"])
        axes.set_xlim(smallest / 3.5, largest * 1.3)
        _decades(axes, "" if i else label, ends)
        for name, hue in zip(SPACINGS, (*HUES[:3], INK), strict=True):
            floats, halves = ([r for r in rows if (r["spacing"], r["stored"]) == (name, s)] for s in STORED)
            x, y = [row["bytes"] for row in floats], [row[f"{kind}_{which}"] for row in floats]
            axes.plot(x, y, "x" if name == POWER else "o-", color=hue, markersize=5, zorder=3)
            labels.append((y[-1], name, hue))
            if name == CUBE_ROOT:
                x, y = [row["bytes"] for row in halves], [row[f"{kind}_{which}"] for row in halves]
                axes.plot(x, y, "o", color=hue, linestyle=DASHES[2], linewidth=1.1, markerfacecolor="white")
                for size, error, row in zip(x, y, halves, strict=True):
                    axes.text(size / 1.13, error / 1.1, row["nodes"], color=hue, size=8, ha="right", va="top")
        drawing.label_ends(axes, largest, labels, 0.14)


def color_axes(folder: Path, exact: PathTable, quick: bool = False) -> str:
    """The chart `axes`: color error by spacing, node counts and bytes of a table; its main figures in words."""
    skins, (table, weights) = _skins(SKINS[quick]), stored_paths.at_rule(exact, REFERENCE)
    truth = acescg(table, weights, skins)[..., 0]
    rows = table_rows(
        COLOR_SIZES, skins, "delta_e00",
        lambda nodes: expand.color_cells(table, nodes, _absorbers(table), weights),
        lambda colors: _difference(colors, truth),
    )  # fmt: skip
    notes = (
        f"Exact ACEScg colors interpolated between nodes, against exact colors of {SKINS[quick]} random skins "
        f"(log-uniform melanin and hemoglobin).\n{_TABLES}"
    )
    title = "Color tables: cube-root axes err least at every size"
    with drawing.figure(folder, "axes", rows, (11.8, 5.6), title, notes) as drawn:
        _by_bytes(drawn, rows, "delta_e00", "color difference ΔE00", (0.012, 14))
    shown = [row for row in rows if (row["spacing"], row["nodes"]) == (CUBE_ROOT, "16×8×16")]
    return "16×8×16 colors ΔE00 " + ", ".join(f"{row['delta_e00_p95']:.3f} in {row['stored']}" for row in shown)


def roundings(shapes: np.ndarray) -> dict[str, np.ndarray]:
    """Normalized shapes [..., B] again, after each way of keeping them as half floats."""
    area = np.pi * np.diff(_EDGES**2)
    kept = (np.minimum(v, HALF_MAX).astype(np.float16) for v in (shapes, profiles.encircled(shapes), shapes / area))
    rings, within, density = (values.astype(float) for values in kept)
    return {
        "ring energies": rings,
        "ring energies, < 6e-5 flushed to 0": np.where(rings < HALF_NORMAL, 0, rings),
        "encircled energy": np.diff(within),
        "R(r) per mm², 65504 at most": density * area,
    }


def far_errors(shapes: np.ndarray, rounded: np.ndarray) -> np.ndarray:
    """Relative error [...] of the light beyond the last ring edge that a thousandth of the light [..., B] passes."""
    shares = [np.cumsum(s[..., ::-1], axis=-1)[..., ::-1] / s.sum(-1, keepdims=True) for s in (shapes, rounded)]
    last = (shares[0] >= FAR_SHARE).sum(axis=-1, keepdims=True) - 1
    beyond, kept = (np.take_along_axis(share, last, axis=-1)[..., 0] for share in shares)
    return np.abs(kept / beyond - 1)


def profile_rows(quick: bool = False) -> list[dict]:
    """Rows of the chart `profile-axes`: tables by spacing, size and format, then what rounding alone costs.

    Tables are expanded from the default set's stored paths and compared with these paths between nodes, as a bake
    measures itself: every skin and ACEScg channel counts. Rounded are the profiles of the set's own nodes.
    """
    luts, skins = lutgen.load(), _skins(PROFILES[quick])
    truth = np.maximum(acescg(luts.paths, luts.weights, skins), 0)
    rows = table_rows(
        PROFILE_SIZES, skins, "ee_difference",
        lambda nodes: expand.profile_cells(luts.paths, nodes, _absorbers(luts.paths), luts.weights)[0],
        lambda shapes: profiles.ee_difference(truth, shapes.swapaxes(1, 2), _EDGES),
    )  # fmt: skip
    shapes = luts.profile_lut.shape.astype(float).swapaxes(-1, -2)
    nodes = "×".join(map(str, luts.profile_lut.grid.shape[::-1]))
    for stored, kept in roundings(shapes).items():
        row = {"part": "rounding", "spacing": CUBE_ROOT, "nodes": nodes, "stored": stored, "bytes": 2 * shapes.size}
        row |= _errors("ee_difference", profiles.ee_difference(shapes, kept, _EDGES))
        rows.append(row | _errors("far_error", far_errors(shapes, kept)))
    return rows


def profile_axes(folder: Path, quick: bool = False) -> str:
    """The chart `profile-axes`: profile error by bytes of the table, and what half floats cost; figures in words."""
    rows = profile_rows(quick)
    tables, rounding = ([row for row in rows if row["part"] == kind] for kind in ("table", "rounding"))
    notes = (
        f"Top: shapes of 64 rings × RGB interpolated between nodes against the paths they come from, {PROFILES[quick]} "
        f"random skins. EE: encircled energy at 0.01 mm and more.\n{_TABLES}\nBottom: the default set's profiles as "
        "half, kept in four ways; 95th percentile filled, maximum hollow."
    )
    title = "Profile tables: nodes matter, half floats of ring energies do not"
    with drawing.figure(folder, "profile-axes", rows, (11.8, 8.1), title, notes) as drawn:
        _by_bytes(drawn, tables, "ee_difference", "EE difference", (3e-4, 0.15))
        labels = {"ee_difference": "EE difference by rounding", "far_error": "error of the farthest 0.1 % of the light"}
        for i, (kind, label) in enumerate(labels.items()):
            axes = inches(drawn, 2.9 + 4.4 * i, 5.75, 3.8, 1.6)
            p95, most = ([row[f"{kind}_{which}"] for row in rounding] for which in ("p95", "max"))
            axes.plot([p95, most], [range(4)] * 2, color=HUES[2])
            axes.plot(p95, range(4), "o", most, range(4), "o", color=HUES[2])
            axes.lines[-1].set_markerfacecolor("white")
            axes.set(xscale="log", ylim=(3.5, -0.5), xlabel=label)
            axes.set_yticks(range(4), [""] * 4 if i else [row["stored"] for row in rounding])
            axes.minorticks_off()
            axes.grid(axis="x")
    lost = (f"{row['ee_difference_max']:.1g} as {row['stored']}" for row in rounding)
    return f"half profiles err by EE {', '.join(lost)}"
