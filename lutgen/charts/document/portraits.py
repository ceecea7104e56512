"""The three skin types of Zhang, Human face rendering, as rendered heads, by samples, without and with textures."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import lutgen
from lutgen import device as ocl
from lutgen.charts import drawing
from lutgen.charts.document import comparisons
from lutgen.charts.drawing import GRAY, HUES, inches, write
from lutgen.errors import MachineError
from lutgen.render import device_scene, film, flat_walk, progressive
from lutgen.scene import display, subject
from lutgen.scene import look as looks
from lutgen.scene.look import Look

SAMPLES = (20, 55, 150)
"""Samples a pixel of the document's pictures; each goes on from the one before."""
MEASURED = {"Caucasian": "light", "Asian": "intermediate", "African": "dark"}
"""A preset fitted to measured skin for each of the document's names: of light, medium and dark skin, no more."""
SIZE = 176, 216
BARE, TEXTURED = "without textures", "with textures"
_LEFT, _TOP, _GAP, _FOOT = 1.25, 1.55, 0.06, 0.28


@dataclass(frozen=True)
class Portrait:
    """One rendered head: display sRGB [rows, columns, 3] in bytes, and the ΔE00 of a pixel's noise."""

    skin: str
    preset: str
    textures: str
    samples: int
    noise_delta_e00: float
    pixels: np.ndarray


def portraits(folder: Path, size: tuple[int, int] = SIZE, progress: Callable = drawing.silent) -> str:
    """The figure `portraits`; its main figures in words, or why it was left out: it needs OpenCL."""
    try:
        device = ocl.choose()
    except MachineError as error:
        return f"left out: {error}"
    heads = list(_all(device, size, progress))
    draw(folder, heads, size)
    last = [head for head in heads if head.samples == SAMPLES[-1] and head.textures == TEXTURED]
    noise = ", ".join(f"{head.preset} {head.noise_delta_e00:.1f}" for head in last)
    return f"ΔE00 of a pixel's noise at {SAMPLES[-1]} samples: {noise}"


def _all(device: ocl.Device, size: tuple[int, int], progress: Callable) -> Iterator[Portrait]:
    luts = lutgen.load()
    models = {kind: subject.model(None, None, maps) for kind, maps in ((BARE, subject.NO_MAPS), (TEXTURED, None))}
    trees = {kind: device_scene.tree_of(device, shape) for kind, (shape, _) in models.items()}
    for skin in comparisons.TYPES:
        for preset, kind in ((f"source-{skin.lower()}", BARE), (f"source-{skin.lower()}", TEXTURED),
                             (MEASURED[skin], TEXTURED)):  # fmt: skip
            progress(f"portrait: {preset}, {kind}", None)
            look = looks.of_preset(preset, Look() if kind == TEXTURED else Look(bumps=0.0))
            opened = device_scene.open_scene(device, luts, *models[kind], look, size, tree=trees[kind])
            levels = SAMPLES if preset != MEASURED[skin] else SAMPLES[-1:]
            for traced, noise in at_samples(opened, levels):
                pixels = display.picture(traced.rgb, traced.mask, look.exposure)
                yield Portrait(skin, preset, kind, traced.samples, noise, pixels)


def at_samples(
    opened: device_scene.DeviceScene, levels: tuple[int, ...], seed: int = 0
) -> Iterator[tuple[film.Film, float]]:
    """One picture by the flat walk as it is at each number of samples, and its noise in ΔE00."""
    walk = flat_walk.flat(opened, seed)
    traced = film.empty(opened.size, walk.group, {})
    for samples in levels:
        goal = progressive.Goal(samples)
        traced, _, noise = progressive.render(opened, walk, traced, goal, lambda picture, noise: None)
        yield traced, noise


def draw(folder: Path, heads: list[Portrait], size: tuple[int, int]) -> None:
    """Write the figure `portraits`: a row for each skin, a column for each number of samples."""
    wide, high = SIZE[0] / drawing.DPI, SIZE[1] / drawing.DPI
    columns = [(preset, kind, samples) for preset, kind in (("document", BARE), ("document", TEXTURED))
               for samples in SAMPLES] + [("measured", TEXTURED, SAMPLES[-1])]  # fmt: skip
    width = _LEFT + len(columns) * (wide + _GAP) + 2 * 0.2 + 0.15
    height = _TOP + len(comparisons.TYPES) * (high + _GAP + _FOOT) + 0.1
    notes = (
        "`lutgen render`, flat walk, the same head and light for all; under each picture the ΔE00 of a pixel's noise. "
        "At the right, presets\nfitted to measured light, intermediate and dark skin (ITA classes), the same textures."
    )
    rows = [
        {"skin": head.skin, "preset": head.preset, "textures": head.textures, "samples": head.samples,
         "noise_delta_e00": head.noise_delta_e00, "brightness": float(head.pixels.mean() / 255)}
        for head in heads
    ]  # fmt: skip
    title = "The document's three skin types on a head, by samples"
    with drawing.figure(folder, "portraits", rows, (width, height), title, notes) as drawn:
        for i, skin in enumerate(comparisons.TYPES):
            top = _TOP + i * (high + _GAP + _FOOT)
            write(drawn, 0.18, top + high / 2, skin, size=11, va="center")
            for j, (whose, kind, samples) in enumerate(columns):
                left = _LEFT + j * (wide + _GAP) + 0.2 * (j >= 3) + 0.2 * (j >= 6)
                (head,) = (p for p in heads if (p.skin, p.textures, p.samples) == (skin, kind, samples)
                           and (p.preset == MEASURED[skin]) == (whose == "measured"))  # fmt: skip
                axes = inches(drawn, left, top, wide, high)
                axes.imshow(head.pixels, interpolation="none" if size == SIZE else "nearest", aspect="auto")
                axes.set_axis_off()
                words = f"noise {head.noise_delta_e00:.1f}" + (f"   {head.preset}" if whose == "measured" else "")
                write(drawn, left, top + high + 0.17, words, color=GRAY, size=8.5)
                if i:
                    continue
                write(drawn, left, _TOP - 0.07, f"{samples} samples", color=GRAY, va="bottom")
                if j in (0, 3, 6):
                    heading = "measured skin" if whose == "measured" else f"the document's, {kind}"
                    write(drawn, left, _TOP - 0.27, heading, color=HUES[j // 3], va="bottom")
