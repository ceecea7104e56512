"""The results of Zhang, Human face rendering: linear and exponential, in its color pipeline and in the default."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from lutgen import color
from lutgen.charts import drawing
from lutgen.charts.document import comparisons, portraits
from lutgen.charts.document.spectra import (
    ABSORPTIONS,
    SWEEPS,
    columns,
    nanometers,
    numbers,
    percent,
    shades,
    spectra,
    sweep,
    ticks,
)
from lutgen.charts.drawing import DASHES, GRAY, HUES, inches, write
from lutgen.skin import chromophores
from lutgen.skin.tissue import PRESETS, plain

STEPS = 24
TYPES = comparisons.TYPES
PIPELINE_NAMES = {"source": "the document's color pipeline", "default": "default color pipeline"}
AXIS_NAMES = {
    "melanin": "melanin (volume fraction of the epidermis)",
    "hemoglobin": "hemoglobin (blood volume fraction of the dermis)",
    "eumelanin": "eumelanin (share of the melanin)",
}


def draw(
    out: Path, steps: int = STEPS, size: tuple[int, int] = portraits.SIZE, progress: Callable = drawing.silent
) -> dict[str, str]:
    """Draw every figure into the folder `out`, which appears whole or not at all; what each shows, by its name.

    `steps`: colors along a strip; `size`: pixels of a portrait. Raises InputError where `out` holds something,
    MachineError without matplotlib.
    """
    charts = {f"sweep-{name}": lambda folder, name=name: sweep_figure(folder, name, steps) for name in SWEEPS} | {
        "skin-types": skin_types,
        "scattering-curves": comparisons.law_curves,
        "scattering-colors": lambda folder: comparisons.law_colors(folder, steps),
        "presets": comparisons.presets,
        "published": comparisons.published,
        "portraits": lambda folder: portraits.portraits(folder, size, progress),
    }
    return drawing.draw_all(out, charts, progress)


def sweep_figure(folder: Path, parameter: str, steps: int = STEPS) -> str:
    """One of the document's sweeps as strips, and the color differences along it."""
    skins = sweep(parameter, steps)
    reflectance = {a: spectra(skins, a) for a in ABSORPTIONS}
    looks = {(p, a): shades(reflectance[a], p) for p in PIPELINE_NAMES for a in ABSORPTIONS}
    apart = {p: color.delta_e00(*(looks[p, a][1] for a in ABSORPTIONS)) for p in PIPELINE_NAMES}
    between = color.delta_e00(*(looks[p, "linear"][1] for p in PIPELINE_NAMES))
    base, ends, _ = SWEEPS[parameter]
    fixed = [f"{n} {percent(getattr(base, n), n)}" for n in chromophores.NAMES if n != parameter]
    title = f"{parameter.capitalize()} {' to '.join(percent(v, parameter) for v in ends)}; {', '.join(fixed)}"
    notes = (
        "A sweep of the source document, from exact spectra. Linear absorption is right in the mean; the document's\n"
        "exponential absorption, with steps drawn from μt, comes out too bright."
    )
    off = {f"delta_e00_linear_to_exponential_{p}": apart[p] for p in PIPELINE_NAMES}
    off["delta_e00_between_pipelines_linear"] = between
    rows = [
        {**plain(skin), "absorption": a, **numbers(r), **{key: float(v[i]) for key, v in off.items()}}
        for a in ABSORPTIONS
        for i, (skin, r) in enumerate(zip(skins, reflectance[a], strict=True))
    ]
    with drawing.figure(folder, f"sweep-{parameter}", rows, (9.8, 6.0), title, notes) as drawn:
        for i, (pipeline, heading) in enumerate(PIPELINE_NAMES.items()):
            top = 1.32 + 1.2 * i
            write(drawn, 2.1, top - 0.07, heading, color=GRAY)
            for j, a in enumerate(ABSORPTIONS):
                words = ("linear (exact)", "exponential (biased)")[j]
                drawing.strip(inches(drawn, 2.1, top + 0.43 * j, 5.6, 0.43), looks[pipeline, a][0], words)
        lines = (
            (apart["source"], "linear to exponential,\nthe document's pipeline"),
            (apart["default"], "linear to exponential,\ndefault pipeline"),
            (between, "one pipeline to the\nother, linear"),
        )
        axes = inches(drawn, 2.1, 3.8, 5.6, 1.6)
        for (y, _), hue, dash in zip(lines, HUES, DASHES, strict=False):
            axes.plot(y, color=hue, linestyle=dash)
        top = 1.08 * max(float(y.max()) for y, _ in lines)
        axes.set(xlim=(-0.5, steps - 0.5), ylim=(0, top), xlabel=AXIS_NAMES[parameter], ylabel="color difference\nΔE00")
        axes.set_xticks(*ticks(parameter, steps))
        axes.grid(axis="y")
        labels = [(float(y[-1]), words, hue) for (y, words), hue in zip(lines, HUES, strict=False)]
        drawing.label_ends(axes, steps - 1, labels, 0.25 * top)
    return f"linear to exponential absorption ΔE00 up to {np.max(list(apart.values())):.2f}; {_range(between)}"


def _range(between: np.ndarray) -> str:
    return f"one color pipeline to the other ΔE00 {between.min():.2f} to {between.max():.2f}"


def skin_types(folder: Path) -> str:
    """The document's three skin types as patches and spectra, linear beside exponential."""
    skins = [PRESETS[f"source-{name.lower()}"] for name in TYPES]
    reflectance = {a: spectra(skins, a) for a in ABSORPTIONS}
    off = np.zeros((3, 2))
    rows = [
        {"skin": TYPES[i], **plain(skins[i]), "absorption": a, **numbers(r), **columns(r)}
        for a in ABSORPTIONS for i, r in enumerate(reflectance[a])
    ]  # fmt: skip
    notes = "Left half of each patch: linear absorption (exact). Right half: the document's exponential one (biased)."
    with drawing.figure(folder, "skin-types", rows, (12.4, 5.6), "The document's three skin types", notes) as drawn:
        for i, (name, skin) in enumerate(zip(TYPES, skins, strict=True)):
            left = 1.25 + 1.85 * i
            write(drawn, left, 1.05, name, size=11)
            write(drawn, left, 1.13, comparisons.told(skin), color=GRAY, va="top", size=8.5)
            for j, pipeline in enumerate(PIPELINE_NAMES):
                rgb, lab = zip(*(shades(reflectance[a][i], pipeline) for a in ABSORPTIONS), strict=True)
                off[i, j] = color.delta_e00(*lab)
                axes = inches(drawn, left, 1.95 + 1.75 * j, 1.65, 1.15)
                words = "" if i else PIPELINE_NAMES[pipeline].replace(" color ", "\ncolor\n")
                drawing.strip(axes, np.array(rgb), words)
                for x, a in zip((0, 1), ABSORPTIONS, strict=True):
                    place = {"transform": axes.transAxes, "ha": ("left", "right")[x], "va": "bottom"}
                    axes.text(x, 1.02, a, color=GRAY, size=8.5, **place)
                words = f"L* {lab[0][0]:.1f} | {lab[1][0]:.1f}   ΔE00 {off[i, j]:.2f}"
                axes.text(0, -0.05, words, transform=axes.transAxes, va="top", size=8.5)
        axes = inches(drawn, 7.75, 1.1, 3.3, 3.8)
        for i, hue in zip(range(3), HUES, strict=False):
            for a, dash in zip(ABSORPTIONS, DASHES, strict=False):
                axes.plot(nanometers(), reflectance[a][i], color=hue, linestyle=dash)
        comparisons.dress_spectra(axes)
        axes.set_title("solid: linear · dashed: exponential", color=GRAY, size=9.5)
        labels = [(float(reflectance["linear"][i][-1]), TYPES[i], HUES[i]) for i in range(3)]
        drawing.label_ends(axes, 780, labels, 0.12)
    return "linear to exponential absorption ΔE00 " + ", ".join(
        f"{name} {row.max():.2f}" for name, row in zip(TYPES, off, strict=True)
    )
