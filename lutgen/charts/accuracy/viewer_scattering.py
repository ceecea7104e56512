"""What a better picture costs: a frame's time over a plain head's, against errors of the scattering, by tier."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import lutgen
from lutgen.charts import drawing
from lutgen.charts.accuracy import viewer_tiers
from lutgen.charts.drawing import DASHES, HUES, INK, inches
from lutgen.scene import look as looks
from lutgen.scene import viewer

LUT, BURLEY = "profile per pixel", "one Burley"
SCALES = (0.05, 0.2, 0.5)
"""Millimetres per pixel: a close-up, a portrait, a person."""
QUICK = {"tiers": ("off", "medium", "high"), "tones": ("very-light", "dark"), "places": (0,),
         "size": (320, 180), "rounds": 2}  # fmt: skip
FULL = {"tiers": looks.TIERS, "tones": ("very-light", "light", "intermediate", "tan", "brown", "dark"),
        "places": range(16), "size": (640, 360), "rounds": 5}  # fmt: skip
_SIZE = 13.4, 6.3
_MARKS = "osD"


@dataclass(frozen=True)
class Row:
    """One tier with one kind of profile: its frame, EE differences by SCALES and the RMS at an edge, worst tones."""

    tier: str
    profile: str
    taps: int
    frames: int
    milliseconds: float
    ratio: float
    ee_close: float
    ee_portrait: float
    ee_person: float
    worst_tone: str
    edge_rms: float


def viewing(folder: Path, quick: bool = False, progress: Callable = drawing.silent) -> str:
    """The chart `viewing`; its main figures in words, or why it was left out: it needs OpenGL and the extra `view`."""
    extent = QUICK if quick else FULL
    if missing := viewer_tiers.missing():
        return f"left out: {missing}"
    costs = viewer_tiers.costs(extent["size"], extent["tiers"], extent["rounds"], progress)
    rows = errors(costs, extent, progress)
    draw(folder, rows, viewer.viewer("gl").context().info["GL_RENDERER"], extent)
    return words(rows)


def errors(costs: list, extent: dict, progress: Callable = drawing.silent) -> list[Row]:
    """Each tier's errors with the set's own profiles and with one Burley fitted to the lightest tone, LUT first."""
    gl, laws = viewer.viewer("gl"), viewer.viewer("measure.scattering_laws")
    plane = laws.open_plane(lutgen.load())
    burley = laws.one_burley(plane.luts)
    rows = []
    try:
        for profile, tables in ((LUT, None), (BURLEY, burley)):
            for cost in costs:
                places = extent["places"][:: 4 if cost.frames > 1 else 1]  # added frames average the places already
                if profile == BURLEY and cost.name in ("off", "reference"):
                    continue  # no profile is read, or 16 frames, which no engine adds up
                progress(f"viewer: {cost.name}, {profile}", None)
                of_tone = {
                    tone: [laws.searchlight(plane, tone, scale, cost.taps, cost.frames, places, tables)
                           for scale in SCALES] + [laws.edge_noise(plane, tone, cost.taps, cost.frames, tables=tables)]
                    for tone in extent["tones"]
                }  # fmt: skip
                worst = [max(values[k] for values in of_tone.values()) for k in range(len(SCALES) + 1)]
                tone = max(of_tone, key=lambda name: of_tone[name][0])
                rows.append(Row(cost.name, profile, cost.taps, cost.frames, cost.total, cost.ratio, worst[0], worst[1],
                                worst[2], tone, worst[3]))  # fmt: skip
    finally:
        gl.free(*burley)
        laws.release(plane)
    return rows


def words(rows: list[Row]) -> str:
    """The main figures of the chart in a line."""
    by_tier = {(row.tier, row.profile): row for row in rows}
    each = ", ".join(f"{row.tier} {row.ratio:.2f} × EE {max(_ee(row)):.2g}" for row in rows if row.profile == LUT)
    burley = max(_ee(by_tier["high", BURLEY]))
    return f"frame over a plain head's, and worst EE difference: {each}; one Burley at high EE {burley:.2g}"


def _ee(row: Row) -> tuple[float, float, float]:
    return row.ee_close, row.ee_portrait, row.ee_person


def draw(folder: Path, rows: list[Row], renderer: str, extent: dict) -> None:
    """Write the chart `viewing` of rows measured on that renderer."""
    width, height = extent["size"]
    notes = (
        "Cost: median time of a frame of the built-in head over that of the same head with a plain color texture, no "
        f"LUT and no scattering, drawn in turn;\n{width} × {height}, 4 samples a pixel, on {renderer}. Errors: worst "
        f"of {len(extent['tones'])} tones and of R, G, B (ACEScg) on a flat plane. One Burley: fitted to very\nlight "
        "skin, read from tables of the same size by the same taps, so at the same cost. Reference: 16 frames of 64 "
        "taps added up; off: no taps."
    )
    title = "What scattering costs a frame, and how right it is: more taps do not mend a profile that is not the skin's"
    with drawing.figure(folder, "viewing", rows, _SIZE, title, notes) as drawn:
        curves = [(f"{scale:g} mm per pixel", lambda row, k=k: _ee(row)[k]) for k, scale in enumerate(SCALES)]
        left = inches(drawn, 0.85, 1.75, 4.1, 3.95)
        _panel(left, rows, curves, "EE difference of a disc of 6 pixels", (1.5e-3, 1.2))
        right = inches(drawn, 7.75, 1.75, 4.1, 3.95)
        alone = [(f"{SCALES[0]:g} mm per pixel", lambda row: row.edge_rms)]
        _panel(right, rows, alone, f"RMS error at a lit edge, {alone[0][0]}", (1.5e-3, 1.2))


def _panel(axes, rows: list[Row], curves: list, title: str, ends: tuple[float, float]) -> None:
    """Errors over cost: a solid line per curve with the skin's own profiles, a dashed one with one Burley."""
    axes.set(yscale="log", ylim=ends)
    axes.set_title(title, color=INK, pad=26)
    viewer_tiers.axis(axes, {row.tier: row.ratio for row in rows if row.profile == LUT}, ends[1], ends[1] * 1.32)
    axes.set_yticks([0.01, 0.1, 1], ["0.01", "0.1", "1"])
    axes.yaxis.set_minor_formatter("")
    for profile, dash, face in ((LUT, DASHES[0], None), (BURLEY, DASHES[1], "white")):
        line, labels = [row for row in rows if row.profile == profile], []
        for k, (name, value) in enumerate(curves):
            hue, y = HUES[k], [value(row) for row in line]
            axes.plot([row.ratio for row in line], y, linestyle=dash, color=hue, marker=_MARKS[k], markersize=5.5,
                      markerfacecolor=face or hue, clip_on=False)  # fmt: skip
            said = profile if len(curves) == 1 else f"{profile}, {name.split()[0]} mm"
            labels.append((y[-1], said, hue))
        drawing.label_ends(axes, max(row.ratio for row in line), labels, 0.12)
