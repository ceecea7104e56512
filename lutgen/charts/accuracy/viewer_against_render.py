"""The viewer's tiers against a render of the same scene: color differences over what a frame costs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import lutgen
from lutgen import device as ocl
from lutgen.charts import drawing
from lutgen.charts.accuracy import viewer_tiers
from lutgen.charts.drawing import DASHES, HUES, INK, inches
from lutgen.render import compare, compare_files, device_scene, film, flat_walk, progressive
from lutgen.scene import look as looks
from lutgen.scene import subject, viewer
from lutgen.scene.look import Look

VIEWS = {
    "portrait": Look(),
    "close-up": Look(distance_mm=60.0, target_mm=(20.0, -30.0, 88.0)),
}
"""The default look at 1.3 mm per pixel of a picture of 192 x 192, and the shadow of the nose at 0.13."""
_MM_PER_PIXEL = {"portrait": 1.3, "close-up": 0.13}
QUICK = {"tiers": ("off", "medium", "high"), "side": 96, "samples": 32, "rounds": 1, "timed": (320, 180),
         "tones": {"portrait": ("light",), "close-up": ("light",)}}  # fmt: skip
FULL = {"tiers": looks.TIERS, "side": 192, "samples": 128, "rounds": 3, "timed": (640, 360),
        "tones": {"portrait": ("very-light", "light", "intermediate", "tan", "brown", "dark"),
                  "close-up": ("very-light", "dark")}}  # fmt: skip
_SIZE = 13.4, 6.3
_MARKS = "os"


@dataclass(frozen=True)
class Row:
    """One tier in one view and tone: its frame, and ΔE00 of boxes of 4 x 4 pixels from the render."""

    view: str
    tone: str
    tier: str
    milliseconds: float
    ratio: float
    mean: float
    mean_sigma: float
    p95: float
    p95_of_noise: float
    lightness: float


def truth(folder: Path, quick: bool = False, progress: Callable = drawing.silent) -> str:
    """The chart `truth`; its main figures in words, or why it was left out: it needs OpenGL and the extra `view`."""
    extent = QUICK if quick else FULL
    if missing := viewer_tiers.missing():
        return f"left out: {missing}"
    costs = viewer_tiers.costs(extent["timed"], extent["tiers"], extent["rounds"], progress)
    rows = differences({cost.name: cost for cost in costs}, extent, progress)
    draw(folder, rows, extent)
    return words(rows)


def differences(costs: dict, extent: dict, progress: Callable = drawing.silent) -> list[Row]:
    """Every tier of `costs` in every view and tone, the built-in head."""
    app, stages, side = viewer.viewer("app"), viewer.viewer("stage"), extent["side"]
    shape, textures = subject.model(None, None, None)
    rows = []
    opened = app.open_stage(lutgen.load(), shape, textures, (side, side))
    try:
        for view, look in VIEWS.items():
            for tone in extent["tones"][view]:
                progress(f"render: {view}, {tone}", None)
                skin = looks.of_preset(tone, look)
                true = rendered(shape, textures, skin, side, extent["samples"])
                for tier, cost in costs.items():
                    off = compare.compare(true, seen(opened, replace(skin, tier=tier)))
                    rows.append(Row(view, tone, tier, cost.total, cost.ratio, off.mean.value, off.mean.sigma,
                                    off.p95.value, off.noise_alone[2], off.lightness.value))  # fmt: skip
    finally:
        stages.release(opened)
    return rows


def rendered(shape, textures, look: Look, side: int, samples: int, seed: int = 0) -> compare_files.Picture:
    """The scene traced by the flat walk, side x side pixels."""
    opened = device_scene.open_scene(ocl.choose(), lutgen.load(), shape, textures, look, (side, side), seed=seed)
    walk = flat_walk.flat(opened, seed)
    start, goal = film.empty((side, side), walk.group, {}), progressive.Goal(samples=samples)
    traced, _, _ = progressive.render(opened, walk, start, goal, lambda picture, noise: None)
    return compare_files.Picture("render", traced.rgb, traced.covariance(), traced.mask)


def seen(opened, look: Look) -> compare_files.Picture:
    """The scene as the viewer has it before exposure and tone curve."""
    passes = viewer.viewer("passes")
    passes.draw(opened, look)
    light, skin = passes.radiance(opened)
    return compare_files.Picture("view", light, None, skin)


def worst(rows: list[Row], view: str, tier: str) -> tuple[float, float]:
    """The largest mean and the largest p95 of all tones."""
    tones = [row for row in rows if (row.view, row.tier) == (view, tier)]
    return max(row.mean for row in tones), max(row.p95 for row in tones)


def words(rows: list[Row]) -> str:
    """The main figures of the chart in a line."""
    names = list(dict.fromkeys(row.tier for row in rows))
    each = []
    for view in VIEWS:
        figures = (f"{tier} {mean:.2f} / {p95:.2f}" for tier in names for mean, p95 in [worst(rows, view, tier)])
        each.append(f"{view} {', '.join(figures)}")
    return f"ΔE00 from a render, mean / p95 of the worst tone: {'; '.join(each)}"


def draw(folder: Path, rows: list[Row], extent: dict) -> None:
    """Write the chart `truth`."""
    width, height = extent["timed"]
    side, tones = extent["side"], len(extent["tones"]["portrait"])
    notes = (
        f"Built-in head, default light, {tones} tones: the viewer's linear frame against `lutgen render --walk flat` "
        f"of {extent['samples']} samples a pixel, {side} × {side},\nboxes of 4 × 4 pixels, noise taken off (`lutgen "
        "compare`). Lines: worst tone; bands: all, close up the two extremes. "
        f"Cost: a frame of {width} × {height} over that of a plain head."
    )
    title = "How far the viewer is from a traced picture, and what a tier buys"
    panels = ("mean", "mean ΔE00 of boxes"), ("p95", "ΔE00 that 95 % of boxes are below")
    with drawing.figure(folder, "truth", rows, _SIZE, title, notes) as drawn:
        for k, (figure, heading) in enumerate(panels):
            _panel(inches(drawn, 0.85 + 6.75 * k, 1.75, 4.1, 3.95), rows, figure, heading)


def _panel(axes, rows: list[Row], figure: str, title: str) -> None:
    ratios = {row.tier: row.ratio for row in rows}
    top = 1.15 * max(getattr(row, figure) for row in rows)
    axes.set(ylim=(0, top))
    axes.set_title(title, color=INK, pad=36)
    names = {f"{row.tier}\n{row.milliseconds:.0f} ms": row.ratio for row in rows}
    viewer_tiers.axis(axes, names, top, top * 1.035)
    labels, x = [], list(ratios.values())
    for k, view in enumerate(VIEWS):
        y = np.array(
            [[getattr(row, figure) for row in rows if (row.view, row.tier) == (view, tier)] for tier in ratios]
        )
        axes.fill_between(x, y.min(axis=1), y.max(axis=1), color=HUES[k], alpha=0.12, linewidth=0)
        axes.plot(x, y.max(axis=1), linestyle=DASHES[k], color=HUES[k], marker=_MARKS[k], markersize=5.5)
        labels.append((float(y[-1].max()), f"{view}, {_MM_PER_PIXEL[view]:g} mm", HUES[k]))
    drawing.label_ends(axes, max(x), labels, 0.06 * top)
