"""The viewer's tiers as the axis of a chart: a frame's time over a plain head's."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import log10

import lutgen
from lutgen.charts import drawing
from lutgen.charts.drawing import GRAY, leader
from lutgen.errors import MachineError
from lutgen.scene import subject, viewer
from lutgen.scene.look import Look


def missing() -> str:
    """Why no frame can be drawn here (OpenGL, or the extra `view`); empty where it can."""
    try:
        viewer.viewer("gl").context()
        viewer.viewer("app")
    except MachineError as error:
        return str(error)
    return ""


def costs(size: tuple[int, int], tiers: tuple[str, ...], rounds: int, progress: Callable) -> list:
    """What a frame of the built-in head costs by tier."""
    app, timing, stages = (viewer.viewer(name) for name in ("app", "measure.timing", "stage"))
    opened = app.open_stage(lutgen.load(), *subject.model(None, None, None), size)
    try:
        _, measured = timing.costs(opened, Look(), tiers, rounds=rounds, progress=lambda name: progress(name, None))
    finally:
        stages.release(opened)
    return measured


def axis(axes, ratios: Mapping[str, float], top: float, above: float) -> None:
    """Make x the cost, with a rule per tier; names stand at y = `above`, over the upper end `top`."""
    most = max(ratios.values())
    axes.set(xscale="log", xlim=(1.0, most * 1.12), xlabel="frame time over a plain head's")
    ticks = [v for v in ((1, 2, 5, 10, 20, 50) if most > 5 else (1, 1.5, 2, 3)) if v <= most * 1.12]
    axes.set_xticks(ticks, [f"{v:g} ×" for v in ticks])
    axes.xaxis.set_minor_formatter("")
    axes.grid(axis="y")
    axes.set_axisbelow(True)
    places = drawing.apart([log10(ratio) for ratio in ratios.values()], 0.13 * log10(most * 1.12))
    for (tier, ratio), place in zip(ratios.items(), places, strict=True):
        axes.axvline(ratio, color=drawing.RULE, linewidth=0.8, zorder=0)
        axes.annotate(tier, (ratio, top), (10**place, above), color=GRAY, size=8.5, ha="center", va="bottom",
                      annotation_clip=False, arrowprops=leader(drawing.RULE, 0.8, 0))  # fmt: skip
