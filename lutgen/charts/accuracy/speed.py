"""Speed against accuracy: every method's time for a whole color LUT over its ΔE00 to adding-doubling."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from lutgen.charts import drawing
from lutgen.charts.accuracy import methods
from lutgen.charts.accuracy.methods import Run
from lutgen.charts.drawing import DASHES, GRAY, HUES, INK, ground, inches, leader, note

FRONT = "#c9c9c9"
_HUE = {
    "path table, 8 wavelengths": 0, "path table, 6 wavelengths": 2, "direct, albedo": 1, "direct, continuous": 3,
    "direct, mixed": 4,
}  # fmt: skip


def speed(folder: Path, quick: bool, progress: Callable) -> str:
    """Draw `speed-accuracy`: seconds of a whole LUT over ΔE00, p95 and largest, with its Pareto front and floors."""
    runs = methods.runs(quick, progress)
    floors = methods.floors(quick)
    draw(folder, runs, floors)
    whole = [run for run in runs if run.method == "path table, 8 wavelengths"]
    best = min(whole, key=lambda run: run.delta_e00_p95)
    return (
        f"path table at 8 wavelengths from ΔE00 p95 {max(r.delta_e00_p95 for r in whole):.2f} in "
        f"{min(r.seconds for r in whole):.2f} s to {best.delta_e00_p95:.3f} in {best.seconds:.2f} s; "
        f"nodes alone cost {floors['interpolation between nodes'][0]:.3f}"
    )


def draw(folder: Path, runs: list[Run], floors: dict[str, tuple[float, float]]) -> None:
    """Two panels, p95 and largest ΔE00; filled: made whole, hollow: time scaled up from a share."""
    notes = (
        "Difference from adding-doubling at 5 nm at random skins, from the darkest to the lightest. Circles: color and "
        "profiles from one trace; squares: color only.\nFilled: the whole LUT was made. Hollow: some nodes were made, "
        "the time is scaled to all. Small points: single seeds; large: their median. Imports and kernel building are "
        "not counted."
    )
    title = "Speed against accuracy of a color LUT of 16 × 8 × 16 nodes, by method"
    ends = [{"delta_e00_p95": p95, "delta_e00_max": top, "floor": name} for name, (p95, top) in floors.items()]
    with drawing.figure(folder, "speed-accuracy", [*runs, *ends], (14.6, 7.6), title, notes) as drawn:
        for k, name in enumerate(("p95", "max")):
            axes = inches(drawn, 0.85 + 7.0 * k, 1.3, 5.1, 5.6)
            heading = ("19 of 20 skins are closer than this (p95)", "largest of all skins")[k]
            _panel(axes, runs, {floor: errors[k] for floor, errors in floors.items()}, f"delta_e00_{name}")
            axes.set_title(heading, color=INK)


def _panel(axes, runs: list[Run], floors: dict[str, float], error: str) -> None:
    axes.set(xscale="log", yscale="log", xlim=(0.005, 2e5), ylim=(0.012, 40))
    axes.set(xlabel="time for the whole LUT (two cores)", ylabel="color difference ΔE00")
    axes.set_xticks([0.01, 0.1, 1, 10, 60, 600, 3600], ["10 ms", "0.1 s", "1 s", "10 s", "1 min", "10 min", "1 h"])
    axes.set_yticks([0.1, 1, 10], ["0.1", "1", "10"])
    axes.grid(axis="y")
    for floor, least in floors.items():
        axes.axhline(least, color=GRAY, linestyle=(0, (1, 2)), linewidth=0.9, zorder=1)
        axes.text(1.02, least, floor.replace(" of ", "\nof ", 1).replace(" between ", "\nbetween "), size=8, color=GRAY,
                  va="center", transform=axes.get_yaxis_transform(), linespacing=1.1)  # fmt: skip
    medians = [_median(group) for group in _groups(runs).values()]
    whole = [(run.seconds, getattr(run, error)) for run in medians if run.share == 1]
    front = np.array([whole[i] for i in methods.pareto(whole)])
    axes.plot(*front.T, color=FRONT, linewidth=7, solid_capstyle="round", zorder=0)
    note(axes, "Pareto front of whole LUTs", front[-1], (14, 8), color=GRAY, size=8.5)
    for run in runs:
        if run.method in _HUE:
            axes.plot(run.seconds, getattr(run, error), ".", color=HUES[_HUE[run.method]], markersize=3, zorder=2)
    alone = []
    for method in dict.fromkeys(run.method for run in medians):
        line = [run for run in medians if run.method == method]
        hue = HUES[_HUE[method]] if method in _HUE else INK
        x, y = [run.seconds for run in line], [getattr(run, error) for run in line]
        shape = {"marker": "o" if line[0].profiles else "s", "color": hue, "markersize": 6.5, "zorder": 3,
                 "markerfacecolor": hue if line[0].share == 1 else "white"}  # fmt: skip
        axes.plot(x, y, linestyle=DASHES[_HUE.get(method, 0)], linewidth=1.3, **shape)
        if method.startswith("path table,") and method in _HUE:
            place = (-4, 34) if method == medians[0].method else (-10, -150)
            arrow = {"arrowstyle": "-", "color": hue, "linewidth": 0.6, "relpos": (0, 1 if place[1] < 0 else 0)}
            words = f"{method},\n{line[0].photons:,} to {line[-1].photons:,}\nphotons each"
            note(axes, words, (x[0], y[0]), place, color=hue, size=9, arrowprops=arrow, linespacing=1.05,
                 bbox=ground(0.5))  # fmt: skip
        elif method not in _HUE:
            alone.append((x[0], y[0], method))
    walks = [run for run in medians if run.method.startswith("direct") and run.photons == medians[-1].photons]
    ends = [(getattr(run, error), f"{run.method}, {run.photons:,}", HUES[_HUE[run.method]]) for run in walks]
    drawing.label_ends(axes, max(run.seconds for run in walks), ends, 0.11)
    _name_points(axes, [point for point in alone if point[1] < 1], 46)
    _name_points(axes, [point for point in alone if point[1] >= 1], 0)
    _slope(axes, next(run for run in medians if run.method == "path table, 8 wavelengths"), error)


def _name_points(axes, points: list[tuple[float, float, str]], drop: float) -> None:
    """Names below points on thin lines, the leftmost lowest, so that no line crosses a name; beside them without."""
    for k, (x, y, name) in enumerate(sorted(points, reverse=True)):
        line = leader(GRAY, 0.6, relpos=(0, 1)) if drop else None
        place = (0, -drop - 15 * k) if drop else (8, 0)
        note(axes, name, (x, y), place, size=8.5, color=INK, arrowprops=line, va="top" if drop else "center")


def _slope(axes, start: Run, error: str) -> None:
    """A guide of error falling with the root of photons, hence of time, off the path table's start."""
    x = np.array([start.seconds * 2.5, start.seconds * 20])
    y = getattr(start, error) * 1.3 * (x / x[0]) ** -0.5
    axes.plot(x, y, color=GRAY, linewidth=0.9)
    note(axes, "error ∝ 1/√photons", (x[0], y[0]), (6, -3), size=8.5, color=GRAY)


def _groups(runs: list[Run]) -> dict[tuple[str, int], list[Run]]:
    groups: dict[tuple[str, int], list[Run]] = {}
    for run in runs:
        groups.setdefault((run.method, run.photons), []).append(run)
    return groups


def _median(group: list[Run]) -> Run:
    """Median time and errors of the seeds of one setting."""
    seconds, p95, largest = np.median([[r.seconds, r.delta_e00_p95, r.delta_e00_max] for r in group], axis=0)
    return replace(group[0], seconds=float(seconds), delta_e00_p95=float(p95), delta_e00_max=float(largest))
