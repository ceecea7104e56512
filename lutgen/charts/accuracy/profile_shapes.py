"""Profile shapes: how far each method's profile and each fitted shape is from a converged one, and at what cost.

The truth is a path table traced twice with many photons, read at each tone. A contender answers with encircled
energy per channel at the ring edges, and its cost is the time of that answer from what it is given (the layers) or
keeps (a LUT, a d per channel, a table of rings). Fitting, baking and building kernels are not part of it.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import lutgen
from lutgen import device as ocl
from lutgen.charts import drawing
from lutgen.charts.document.spectra import percent, shades, spectra
from lutgen.charts.drawing import DASHES, GRAY, HUES, INK, inches, leader, note, write
from lutgen.charts.stability.error_maps import MIXED_DEPTH_MM, mixed_layer
from lutgen.skin import chromophores
from lutgen.skin.tissue import PRESETS, Layer, Skin, layers
from lutgen.solvers import burley, dipole, direct, multipole, path_table, profiles
from lutgen.tables import bake, expand, wavelengths

TONES = ("very-light", "intermediate", "tan", "brown", "dark", "source-african")
LIGHT = TONES[0]
"""The tone whose profile is used on all tones."""
NOISE = "noise of the truth"
LUT, BEST, MEAN, ONE, TABLE = "baked LUT", "best Burley", "mean Burley", "one Burley", "one table"
DIPOLE, MULTIPOLE, WALKS, DIRECT = "dipole", "multipole", "path-table walks", "direct walks"
UNSAFE = (DIPOLE, MULTIPOLE)
"""Skin lies outside the domain of these: computed with unsafe=True."""
TRUTH_RULE, RULE = "12", "8"
TRUTH_SEEDS, SEEDS = (101, 102), (1, 2, 3)
_EDGES = profiles.ring_edges()
_WALK_PHOTONS = {False: (2048, 8192, 32_768, 131_072, 524_288), True: (2048, 16_384)}
_DIRECT_PHOTONS = {False: (2048, 8192, 32_768, 131_072), True: (1024, 4096)}
_TRUTH_PHOTONS = {False: 4_000_000, True: 100_000}
_REPEATS, _REPEATED_S = 101, 0.03
_LOOKS = {
    LUT: (HUES[0], "*"), BEST: (HUES[1], "^"), MEAN: (HUES[1], "v"), ONE: (HUES[1], "s"), TABLE: (HUES[3], "D"),
    DIPOLE: (HUES[4], "o"), MULTIPOLE: (HUES[4], "s"), WALKS: (HUES[2], "o"), DIRECT: (INK, "X"),
}  # fmt: skip


@dataclass(frozen=True)
class Row:
    """One contender on one tone: seconds it took, EE difference from the truth per ACEScg channel and at worst.

    `photons` per wavelength and `seed` are 0 where none are traced. The row of NOISE tells the truth's own noise, and
    the seconds of both its traces, for all tones together.
    """

    tone: str
    contender: str
    unsafe: bool
    photons: int
    seed: int
    seconds: float
    ee_red: float
    ee_green: float
    ee_blue: float
    ee_worst: float


def _row(tone: str, contender: str, difference: np.ndarray, seconds: float, photons: int = 0, seed: int = 0) -> Row:
    red, green, blue = (float(v) for v in difference)
    return Row(tone, contender, contender in UNSAFE, photons, seed, seconds, red, green, blue, max(red, green, blue))


def rings_to_rgb(energy: np.ndarray, rule: wavelengths.Quadrature) -> np.ndarray:
    """Normalized ring energies [..., 3, B] in ACEScg of spectral ones [..., K, B]."""
    mixed = np.swapaxes(energy, -1, -2) @ expand.rgb_weights(rule.xyz_weights)
    return np.swapaxes(expand.normalized(mixed)[0], -1, -2)


def truth(photons: int, progress: Callable = drawing.silent) -> tuple[np.ndarray, np.ndarray, float]:
    """Converged ring energies [T, 3, B] of the tones, noise [T, 3] as an EE difference, and the seconds of the trace.

    The mean of two traces of `photons` per wavelength each; half their difference is what the mean may be off by.
    Its twelve wavelengths err by 3e-4 at most besides (data/quadrature.csv).
    """
    rule, since = wavelengths.load(TRUTH_RULE), time.perf_counter()
    skins = [PRESETS[tone] for tone in TONES]
    medium, reach = bake.skin_medium(skins[0].tissue, rule.wavelength_nm)
    shares = (np.array([getattr(skin, name) for skin in skins]) for name in chromophores.NAMES)
    mu = expand.coefficients(rule.wavelength_nm, expand.absorbers(rule.wavelength_nm, 0.7), *shares)
    halves = []
    for seed in TRUTH_SEEDS:
        paths = path_table.trace(
            medium, *reach, _EDGES, photons, seed, progress=lambda tally: progress("profiles: truth", tally)
        )
        halves.append(rings_to_rgb(paths.evaluate(*mu).transpose(2, 0, 1), rule))
    noise = profiles.ee_difference(halves[0], halves[1], _EDGES) / 2
    return (halves[0] + halves[1]) / 2, noise, time.perf_counter() - since


def spectral(skin: Skin, rings: Callable[[list[Layer], float], profiles.Profile]) -> np.ndarray:
    """Encircled energy [3, B + 1] of a skin from a profile at each of the eight wavelengths, rings(layers, nm)."""
    rule = wavelengths.load(RULE)
    energy = np.array([rings(layers(skin, float(nm)), float(nm)).energy for nm in rule.wavelength_nm])
    return profiles.encircled(rings_to_rgb(energy, rule))


def walk(method: str, skin: Skin, photons: int, seed: int) -> np.ndarray:
    """Encircled energy [3, B + 1] of a skin by WALKS or DIRECT, photons per wavelength."""
    solver = path_table if method == WALKS else direct
    return spectral(skin, lambda stack, nm: solver.profile(stack, _EDGES, photons=photons, seed=seed, wavelength_nm=nm))


def _answers(skin: Skin, shape: np.ndarray, light: np.ndarray, lut: lutgen.LutSet) -> dict[str, Callable]:
    """How each contender that traces nothing finds encircled energy [3, B + 1]; shapes [3, B] of the skin and LIGHT."""
    cells, nodes = lut.profile_lut.shape, lut.profile_lut.grid
    shares, lightest = ((s.melanin, s.eumelanin, s.hemoglobin) for s in (skin, PRESETS[LIGHT]))
    table = nodes.interpolate(cells, *lightest).T
    fitted = (BEST, burley.fit, shape), (MEAN, burley.by_mean_radius, shape), (ONE, burley.fit, light)
    d_mm = {name: fit(energy.T, _EDGES)[0][:, None] for name, fit, energy in fitted}
    return {
        LUT: lambda: profiles.encircled(nodes.interpolate(cells, *shares).T),
        **{name: lambda d=d: burley.encircled(_EDGES, d) for name, d in d_mm.items()},
        TABLE: lambda: profiles.encircled(table),
        DIPOLE: lambda: spectral(skin, lambda _, nm: dipole.profile([mixed_layer(skin, nm)], _EDGES, unsafe=True)),
        MULTIPOLE: lambda: spectral(skin, lambda stack, _: multipole.profile(stack, _EDGES, unsafe=True)),
    }


def _timed(answer: Callable) -> tuple[np.ndarray, float]:
    """An answer and its time in seconds: the median of 101 repeats, or of as many as begin within 30 ms."""
    answered, taken, begun = np.empty(0), [], time.perf_counter()
    while not taken or (len(taken) < _REPEATS and time.perf_counter() - begun < _REPEATED_S):
        since = time.perf_counter()
        answered = answer()
        taken.append(time.perf_counter() - since)
    return answered, float(np.median(taken))


def contest(quick: bool = False, progress: Callable = drawing.silent) -> list[Row]:
    """Every contender on every tone, tone by tone from light to dark; `quick`: fewer photons."""
    progress("profiles: truth", None)
    shapes_of, noise, traced_s = truth(_TRUTH_PHOTONS[quick], progress)
    lut, rows = lutgen.load(), []
    for method in (WALKS, DIRECT):
        walk(method, PRESETS[LIGHT], 1, 0)  # builds the kernel, which no answer below pays for
    for i, tone in enumerate(TONES):
        progress(f"profiles: {tone}", None)
        skin, shape = PRESETS[tone], shapes_of[i]
        rows.append(_row(tone, NOISE, noise[i], traced_s, _TRUTH_PHOTONS[quick], TRUTH_SEEDS[-1]))
        for name, answer in _answers(skin, shape, shapes_of[0], lut).items():
            within, seconds = _timed(answer)
            rows.append(_row(tone, name, profiles.ee_difference(np.diff(within), shape, _EDGES), seconds))
        for method, budget in ((WALKS, _WALK_PHOTONS[quick]), (DIRECT, _DIRECT_PHOTONS[quick])):
            for photons in budget:
                for seed in SEEDS:
                    since = time.perf_counter()
                    within = walk(method, skin, photons, seed)
                    seconds = time.perf_counter() - since
                    difference = profiles.ee_difference(np.diff(within), shape, _EDGES)
                    rows.append(_row(tone, method, difference, seconds, photons, seed))
    return rows


def shapes(folder: Path, quick: bool = False, progress: Callable = drawing.silent) -> str:
    """The chart `profiles`: EE difference against cost, a panel per tone; its main figures in words."""
    rows = contest(quick, progress)
    draw(folder, rows, ocl.choose().name)
    return words(rows)


def words(rows: list[Row]) -> str:
    """The main figures of a contest in a line."""
    last = {(row.tone, row.contender): row for row in rows}
    burley, spread = last["dark", ONE], [[last[tone, name].ee_worst for tone in TONES] for name in (LUT, BEST)]
    shown = ", ".join(f"{name} {min(v):.2g} to {max(v):.2g}" for name, v in zip((LUT, BEST), spread, strict=True))
    return (
        f"EE difference over six tones: {shown}; one Burley fitted to very light skin, on dark skin "
        f"{burley.ee_red:.2f} {burley.ee_green:.2f} {burley.ee_blue:.2f} (R G B); the LUT answers in "
        f"{1e6 * last['dark', LUT].seconds:.0f} us"
    )


def draw(folder: Path, rows: list[Row], device: str) -> None:
    """Write the chart `profiles` of a contest that ran its walks on that device."""
    notes = (
        "Error: largest difference of encircled energy from a converged trace, at radii of 0.01 mm and more, worst of "
        "R, G, B (ACEScg). Cost: time of one tone's RGB profile,\n"
        "64 rings, from what is stored (LUT, Burley's d, a table) or given (layers), kernels built. Best, mean Burley: "
        "d fitted to each tone and channel, or by its mean radius.\n"
        "One Burley, one table: those of very light skin on every tone. Walks: photons at each of "
        f"{RULE} wavelengths, geometric mean and range of {len(SEEDS)} seeds,\non {device}. "
        "Hollow: outside the method's domain, computed with unsafe=True "
        f"(dipole: skin averaged over {MIXED_DEPTH_MM:g} mm)."
    )
    title = "Profile error against cost on six skin tones: one light profile used on every tone fails on dark skin"
    with drawing.figure(folder, "profiles", rows, (13.4, 9.4), title, notes) as drawn:
        for i, tone in enumerate(TONES):
            left, top = 0.95 + 4.14 * (i % 3), 1.85 + 3.8 * (i // 3)
            skin = PRESETS[tone]
            drawing.strip(inches(drawn, left, top - 0.33, 0.36, 0.24), shades(spectra([skin]))[0])
            heading = f"{tone}, melanin {percent(skin.melanin)}"
            write(drawn, left + 0.44, top - 0.21, heading, size=10.5, va="center")
            axes = inches(drawn, left, top, 3.85, 2.95)
            _panel(axes, [row for row in rows if row.tone == tone])
            axes.set_xlabel("cost: seconds per profile" if i > 2 else "")
            axes.set_ylabel("" if i % 3 else "EE difference")
            axes.tick_params(labelleft=i % 3 == 0)


def _panel(axes, rows: list[Row]) -> None:
    """One tone: points and their names, the walks as curves over photons, the noise of the truth as a band."""
    axes.set(xscale="log", yscale="log", xlim=(4e-6, 4), ylim=(1e-4, 1.2))
    axes.set_xticks([1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1], ["10 µs", "0.1 ms", "1 ms", "10 ms", "0.1 s", "1 s"])
    axes.set_yticks([1e-4, 1e-3, 1e-2, 1e-1, 1], ["0.0001", "0.001", "0.01", "0.1", "1"])
    axes.minorticks_off()
    axes.grid(axis="y")
    axes.set_axisbelow(True)
    single = {row.contender: row for row in rows if not row.seed}
    noise = next(row.ee_worst for row in rows if row.contender == NOISE)
    axes.axhspan(1e-4, noise, color=drawing.RULE, linewidth=0)
    note(axes, f"{NOISE} {_short(noise)}", (4e-6, noise), (3, -3), size=8, color=GRAY, va="top")
    for name, row in single.items():
        hue, marker = _LOOKS[name]
        size = 11 if name == LUT else 6.5
        axes.plot(row.seconds, row.ee_worst, marker, color=hue, markersize=size, clip_on=False,
                  markerfacecolor="white" if row.unsafe else hue)  # fmt: skip
    for name, offset, align in ((LUT, (8, 0), "left"), (DIPOLE, (8, 0), "left"), (MULTIPOLE, (0, 8), "center")):
        row, placed = single[name], {"ha": align, "va": "baseline" if offset[1] else "center"}
        note(axes, _told(row), (row.seconds, row.ee_worst), offset, size=8, color=_LOOKS[name][0], **placed)
    stored = [single[name] for name in (BEST, MEAN, ONE, TABLE)]
    places = drawing.apart([np.log10(row.ee_worst) for row in stored], 0.17)
    beside = 1.7 * max(row.seconds for row in stored)
    star = np.log10(single[LUT].ee_worst)
    for row, place in zip(stored, np.where(abs(places - star) < 0.1, star - 0.22, places), strict=True):
        hue, _ = _LOOKS[row.contender]
        axes.annotate("", (row.seconds, row.ee_worst), (beside, 10**place), arrowprops=leader(hue))
        axes.text(1.05 * beside, 10**place, _told(row), color=hue, size=8, va="center")
    for method, dash in ((WALKS, DASHES[0]), (DIRECT, DASHES[1])):
        _curve(axes, [row for row in rows if row.contender == method], dash)


def _curve(axes, rows: list[Row], dash) -> None:
    """A Monte Carlo method over photons: geometric means over seeds, and the range of the seeds."""
    hue, marker = _LOOKS[rows[0].contender]
    budgets = sorted({row.photons for row in rows})
    of = [[row for row in rows if row.photons == photons] for photons in budgets]
    x, y = ([float(np.exp(np.mean([np.log(getattr(row, name)) for row in group]))) for group in of]
            for name in ("seconds", "ee_worst"))  # fmt: skip
    axes.plot(x, y, color=hue, linestyle=dash, marker=marker, markersize=5, clip_on=False)
    told = f"{rows[0].contender}\n{_thousands(budgets[0])} to {_thousands(budgets[-1])}"
    right = rows[0].contender == DIRECT
    placed = {"ha": "left", "va": "bottom"} if right else {"ha": "right", "va": "top"}
    note(axes, told, (x[0], y[0]), (8, 6) if right else (-6, -7), size=8, color=hue, **placed)
    for seconds, group in zip(x, of, strict=True):
        axes.plot([seconds] * 2, [f(row.ee_worst for row in group) for f in (min, max)], color=hue, linewidth=0.9)


def _thousands(photons: int) -> str:
    return f"{photons:,}".replace(",", " ")


def _told(row: Row) -> str:
    return f"{row.contender} {_short(row.ee_worst)}"


def _short(value: float) -> str:
    """Two digits, without the zero before the point."""
    return f"{value:.{max(2, 1 - int(np.floor(np.log10(value))))}f}".lstrip("0")
