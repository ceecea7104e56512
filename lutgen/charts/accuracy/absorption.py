"""What a walk costs, by the way that absorption ends it: time per event and time to an error of 1 %, measured."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lutgen import device as ocl
from lutgen import solvers
from lutgen.charts import drawing
from lutgen.charts.drawing import GRAY, HUES, INK, RULE, ground, inches, note, write
from lutgen.skin.tissue import layers, preset
from lutgen.solvers import direct, path_table
from lutgen.tables.bake import skin_medium

PLACES = (("light", 640.0), ("light", 460.0), ("dark", 550.0))
"""Presets, and a wavelength in nm: much light returns, some, little."""
WALKS = {
    "albedo": "direct, albedo",
    "continuous": "direct, continuous (exp)",
    "mixed": "direct, mixed (exp, biased)",
    "own nu": "drawn lives, ν of this skin",
    "bake nu": "drawn lives, ν of a bake",
    "capped": "capped at 9/ν, ν of a bake",
}
FACTORS = ("ns_per_event", "events_per_photon", "photons_to_1_percent", "ms_to_1_percent")
QUICK, FULL = (2e7, 5), (1.5e8, 7)
"""Events of one timed walk, and rounds."""
CAP = 9.0
"""A capped photon lives 9/nu: what it then lacks weighs below exp(-9) (kernels/README.md, Lives)."""
_FIXED_LIFE = "(vf)(mean_life)"
_EVEN_BLOCKS = 64  # blocks that keep every core busy to the end
_TITLES = ("time per event (ns)", "× events per photon", "× photons to 1 % error", "= time to 1 % error (ms)")
_LOOKS = {walk: (HUES[k], shape) for walk, k, shape in zip(WALKS, (0, 0, 0, 2, 2, 1), "oooDDs", strict=True)}
_WIDTH, _TOP, _ROW, _GROUP = 13.6, 1.45, 0.235, len(WALKS) + 1.7  # inches, the last in rows
_FOOT = (
    "An event is a scattering or, in direct, a surface met. Error: standard error of the diffuse reflectance over its "
    "exact value (adding-doubling). Hollow: biased, so that the\n"
    "time is that to a scatter of 1 %; the bias stays, however many photons."
)


@dataclass(frozen=True)
class Cost:
    """What one walk cost at one place: FACTORS in each round [R, 4], and the reflectance of all rounds together."""

    photons: int
    factors: np.ndarray
    mean: float
    std_error: float
    exact: float

    @property
    def bias(self) -> tuple[float, float]:
        """How far the mean is off, relative to the exact reflectance, and the standard error of that."""
        return self.mean / self.exact - 1, self.std_error / self.exact


def white(name: str, nm: float, walk: str) -> tuple[path_table.Medium, str, float]:
    """Medium, life (see path_table.records) and the rate that the lives have taken from the weights, 1/mm."""
    if walk == "own nu":
        own = path_table.medium_of(layers(preset(name), nm), nm)
        return own, "", float(own.nu_per_mm[0])
    bake, _ = skin_medium(preset(name).tissue, np.array([nm]))
    if walk == "bake nu":
        return bake, "", float(bake.nu_per_mm[0])
    return replace(bake, nu_per_mm=bake.nu_per_mm / CAP), _FIXED_LIFE, 0.0


def run(name: str, nm: float, walk: str, photons: int, seed: int, device: ocl.Device) -> tuple[np.ndarray, int, float]:
    """Weights of the photons that left [n], events, and seconds until the walk's records were read, sums excluded."""
    skin = layers(preset(name), nm)
    if walk in direct.ABSORPTION:
        start = time.perf_counter()
        launches = list(direct.records(skin, photons, seed, walk, device=device, wavelength_nm=nm))
        seconds = time.perf_counter() - start
        ends, events = zip(*launches, strict=True)
        return np.concatenate([end[:, 1] for end in ends]).astype(float), sum(events), seconds
    (medium, life, nu), tally = white(name, nm, walk), path_table.Tally()
    start = time.perf_counter()
    exits = list(path_table.records(medium, photons, seed, device, tally, life))
    seconds = time.perf_counter() - start
    _, path, in_epidermis = np.concatenate([rows for _, rows in exits]).astype(float).T
    mu_e, mu_d = (layer.mu_a_per_mm - nu for layer in skin)
    weights = medium.entry * np.exp(-mu_e * in_epidermis - mu_d * np.maximum(path - in_epidermis, 0))
    return weights, tally.events, seconds


def factors(total: float, square: float, photons: int, events: int, seconds: float, exact: float) -> np.ndarray:
    """FACTORS [4] of a walk by the sums of its weights and of their squares; the last is the product of the others.

    Photons to 1 % error: (variance of one photon / exact²) / 0.01².
    """
    needed = (square / photons - (total / photons) ** 2) / exact**2 / 0.01**2
    return np.array([1e9 * seconds / events, events / photons, needed, 1e3 * seconds / photons * needed])


def measure(events: float, rounds: int, device: ocl.Device) -> dict[tuple[str, float, str], Cost]:
    """Cost of every walk at every place, from rounds in which all take their turn; seed 0 builds, 1, 2 … count.

    `events`: of one timed walk, roughly: photons come in whole launches of equal work.
    """
    cases = [(name, nm, walk) for name, nm in PLACES for walk in WALKS]
    photons, sums = {}, {case: [] for case in cases}
    for case in cases:
        block = direct.BLOCK_PHOTONS if case[2] in direct.ABSORPTION else path_table.block_photons(device)
        per_photon = run(*case, 2 * block, 0, device)[1] / (2 * block)
        photons[case] = _EVEN_BLOCKS * block * max(1, round(events / per_photon / (_EVEN_BLOCKS * block)))
    for seed in range(1, rounds + 1):
        for case in cases:
            weights, done, seconds = run(*case, photons[case], seed, device)
            sums[case].append((weights.sum(), (weights**2).sum(), done, seconds))
    return {case: _cost(np.array(sums[case]), photons[case], *case[:2]) for case in cases}


def _cost(sums: np.ndarray, photons: int, name: str, nm: float) -> Cost:
    exact = solvers.reflectance(layers(preset(name), nm)).diffuse
    each = [factors(total, square, photons, done, seconds, exact) for total, square, done, seconds in sums]
    mean, second = sums[:, :2].mean(axis=0) / photons
    return Cost(photons, np.array(each), mean, float(np.sqrt((second - mean**2) / (photons * len(sums)))), exact)


def over(cost: Cost, other: Cost, factor: str) -> float:
    """The median of a factor of one walk over that of another."""
    k = FACTORS.index(factor)
    return float(np.median(cost.factors[:, k]) / np.median(other.factors[:, k]))


def walks(folder: Path, quick: bool) -> str:
    """Draw time per event, events, photons and time to an error of 1 %, for each walk and skin."""
    device = ocl.choose()
    events, rounds = QUICK if quick else FULL
    costs = measure(events, rounds, device)
    cores = f" with {os.cpu_count()} cores" if device.kind == "cpu" else ""
    notes = (
        f"Marks: medians of {rounds} rounds in turn; thin bars: all rounds. Wall time on {device.name}{cores}: records "
        "read, not summed. Direct walks serve one skin;\n"
        "those with drawn or capped lives carry no absorption, and where ν is that of a bake (the least absorption of "
        "any allowed skin) they serve every skin at once."
    )
    rows = len(PLACES) * _GROUP
    height = _TOP + _ROW * rows + 0.75
    table = [_row(costs, case) for case in costs]
    with drawing.figure(folder, "walks", table, (_WIDTH, height), _title(costs), notes) as drawn:
        panels = [inches(drawn, 2.35 + 2.5 * k, _TOP, 1.75, _ROW * rows) for k in range(len(FACTORS))]
        every = np.concatenate([cost.factors for cost in costs.values()])
        for axes, words, values in zip(panels, _TITLES, every.T, strict=True):
            _dress(axes, words, values, rows)
        for i, place in enumerate(PLACES):
            _group(panels, place, {walk: costs[*place, walk] for walk in WALKS}, i * _GROUP)
        write(drawn, 0.18, height - 0.12, _FOOT, color=GRAY, size=8.5, linespacing=1.35)
    return _told(costs)


def _dress(axes, title: str, values: np.ndarray, rows: float) -> None:
    axes.set_title(title, color=INK, pad=22)
    if title == _TITLES[0]:
        axes.set(xlim=(0, 1.05 * values.max()))
    else:
        low, high = values.min() / 1.3, values.max() * 1.3
        ticks = [m * 10.0**e for e in range(7) for m in (1, 3) if low < m * 10.0**e < high]
        axes.set(xscale="log", xlim=(low, high), xticks=ticks)
        axes.xaxis.set_minor_formatter("")
    axes.xaxis.set_major_formatter("{x:,.0f}")
    axes.set(ylim=(rows - 0.6, -0.9), yticks=[])
    axes.spines["left"].set_visible(False)
    axes.tick_params(axis="x", labeltop=True, top=True, which="major", labelsize=8.5)
    axes.grid(axis="x")
    axes.set_axisbelow(True)


def _group(panels, place: tuple[str, float], costs: dict[str, Cost], top: float) -> None:
    beside = {"transform": panels[0].get_yaxis_transform(), "va": "center"}
    name, nm = place
    words = f"{name} skin at {nm:.0f} nm, diffuse reflectance {costs['albedo'].exact:.3f}"
    panels[0].text(-1.24, top, words, weight="bold", bbox=ground(0.6), **beside)
    lines = {walk: top + row for row, walk in enumerate(costs, 1)}
    for walk, cost in costs.items():
        y, (hue, shape) = lines[walk], _LOOKS[walk]
        panels[0].text(-0.04, y, WALKS[walk], color=hue, ha="right", **beside)
        remarks = ["", "", "", ""]
        if walk in ("continuous", "mixed"):
            remarks[0] = f"  {100 * over(cost, costs['albedo'], 'ns_per_event') - 100:+.0f} %"
        if walk == "mixed":
            remarks[3] = "  bias {:+.2f} ± {:.2f} %".format(*(100 * v for v in cost.bias)).replace("-", "−")
        for axes, values, remark in zip(panels, cost.factors.T, remarks, strict=True):
            middle = float(np.median(values))
            axes.axhline(y, color=RULE, linewidth=0.6)
            axes.plot([values.min(), values.max()], [y, y], color=hue, linewidth=1.2)
            axes.plot(middle, y, shape, markersize=5.5, color=hue, markerfacecolor="white" if walk == "mixed" else hue)
            words = (f"{middle:,.0f}" if middle >= 99.95 else f"{middle:#.3g}") + remark
            placed = {"va": "center", "size": 8.5, "annotation_clip": False, "bbox": ground(0.6)}
            note(axes, words, (float(values.max()), y), (7, 0), **placed)
    right = {"transform": panels[3].get_yaxis_transform(), "clip_on": False}
    a, b = lines["bake nu"], lines["capped"]
    panels[3].plot([1.36, 1.4, 1.4, 1.36], [a, a, b, b], color=INK, linewidth=0.9, **right)
    ratio = over(costs["capped"], costs["bake nu"], "ms_to_1_percent")
    panels[3].text(1.45, (a + b) / 2, f"{ratio:.2f} ×\nas fast", va="center", weight="bold", **right)


def between(costs: dict[tuple[str, float, str], Cost], walk: str, other: str, factor: str) -> tuple[float, float]:
    """The least and the greatest, over the places, of `over` of two walks."""
    ratios = [over(costs[*place, walk], costs[*place, other], factor) for place in PLACES]
    return min(ratios), max(ratios)


def _title(costs: dict[tuple[str, float, str], Cost]) -> str:
    slower = [100 * r - 100 for r in between(costs, "continuous", "albedo", "ns_per_event")]
    faster = between(costs, "capped", "bake nu", "ms_to_1_percent")
    return (
        f"Exp absorption: {slower[0]:+.0f} to {slower[1]:+.0f} % time per event over albedo. "
        f"Drawn lives: {faster[0]:.1f} to {faster[1]:.1f} times as fast as capped ones"
    )


def _row(costs: dict[tuple[str, float, str], Cost], case: tuple[str, float, str]) -> dict:
    (name, nm, walk), cost = case, costs[case]
    spread = {}
    for k, factor in enumerate(FACTORS):
        values = cost.factors[:, k]
        spread |= {factor: float(np.median(values)), f"{factor}_least": float(values.min())}
        spread |= {f"{factor}_most": float(values.max())}
    return {
        "preset": name, "wavelength_nm": nm, "walk": walk, "rounds": len(cost.factors), "photons_a_round": cost.photons,
        **spread, "reflectance": cost.mean, "std_error": cost.std_error, "exact": cost.exact, "relative_bias":
        cost.bias[0], "sigmas_off": (cost.mean - cost.exact) / cost.std_error,
        "ns_per_event_over_albedo": over(cost, costs[name, nm, "albedo"], "ns_per_event"),
        "ms_to_1_percent_over_capped": over(cost, costs[name, nm, "capped"], "ms_to_1_percent"),
    }  # fmt: skip


def _told(costs: dict[tuple[str, float, str], Cost]) -> str:
    per_event = []
    for walk in ("continuous", "mixed"):
        low, high = between(costs, walk, "albedo", "ns_per_event")
        per_event.append(f"{walk} {100 * low - 100:+.0f} to {100 * high - 100:+.0f} %")
    bake, own = (between(costs, "capped", walk, "ms_to_1_percent") for walk in ("bake nu", "own nu"))
    bias = max(costs[*place, "mixed"].bias[0] for place in PLACES)
    return (
        f"time per event over albedo {', '.join(per_event)}; mixed biased up to {100 * bias:+.1f} %; drawn lives reach "
        f"1 % {bake[0]:.2f} to {bake[1]:.2f} times as fast as lives of 9/ν ({own[0]:.2f} to {own[1]:.2f} with ν of the "
        "skin)"
    )
