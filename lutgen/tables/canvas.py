"""A white canvas for labelled charts, with Pillow and its own font: what pictures of the core are drawn on."""

from __future__ import annotations

from functools import cache

import numpy as np
from PIL import Image, ImageDraw, ImageFont

PAPER, INK, GRAY, RULE = "#ffffff", "#1a1a1a", "#595959", "#dddddd"
OVERSAMPLE = 2

Box = tuple[float, float, float, float]  # left, top, right, bottom


@cache
def _font(size: float) -> ImageFont.FreeTypeFont:
    return ImageFont.load_default(size=size)  # type: ignore[return-value]


class Canvas:
    """A white picture, drawn on in pixels of the finished one; it is kept larger, then reduced."""

    def __init__(self, width: int, height: int):
        self.image = Image.new("RGB", (width * OVERSAMPLE, height * OVERSAMPLE), PAPER)
        self.pen = ImageDraw.Draw(self.image)

    def text(self, x: float, y: float, words: str, size=12, fill=INK, anchor="ls", halo: str | None = None) -> None:
        """Write at an anchor (Pillow's two letters; baseline left)."""
        outline = 3 * OVERSAMPLE if halo else 0
        self.pen.text(
            (x * OVERSAMPLE, y * OVERSAMPLE),
            words,
            fill,
            _font(size * OVERSAMPLE),
            anchor,
            stroke_width=outline,
            stroke_fill=halo,
        )

    def measure(self, words: str, size: float) -> float:
        """Width of the words in pixels of the finished picture."""
        return _font(size * OVERSAMPLE).getlength(words) / OVERSAMPLE

    def upright(self, x: float, y: float, words: str, size=12, fill=GRAY) -> None:
        """Write upward, centered on (x, y)."""
        along, across = round(self.measure(words, size) + 4), round(size * 1.6)
        label = Canvas(along, across)
        label.text(along / 2, across / 2, words, size, fill, "mm")
        corner = round((x - across / 2) * OVERSAMPLE), round((y - along / 2) * OVERSAMPLE)
        self.image.paste(label.image.transpose(Image.Transpose.ROTATE_90), corner)

    def line(self, points, fill=INK, width=1.0, dash: tuple = ()) -> None:
        """Draw through points [P, 2]; `dash` is (on, off) in pixels."""
        points = np.asarray(points, float) * OVERSAMPLE
        pieces = points[None]
        if dash:
            along = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
            starts = np.arange(0, along[-1], sum(dash) * OVERSAMPLE)
            inked = np.linspace(starts, np.minimum(starts + dash[0] * OVERSAMPLE, along[-1]), 4, axis=1)
            pieces = np.stack([np.interp(inked, along, values) for values in points.T], axis=-1)
        for piece in pieces:
            self.pen.line([tuple(p) for p in piece], fill, round(width * OVERSAMPLE), joint="curve")

    def box(self, box: Box, fill: str | None = None, outline: str | None = None) -> None:
        """Draw a rectangle; its outline lies outside, so what it frames stays whole."""
        left, top, right, bottom = (round(v * OVERSAMPLE) for v in box)
        if fill:
            self.pen.rectangle((left, top, right - 1, bottom - 1), fill)
        if outline:
            grown = left - OVERSAMPLE, top - OVERSAMPLE, right + OVERSAMPLE - 1, bottom + OVERSAMPLE - 1
            self.pen.rectangle(grown, outline=outline, width=OVERSAMPLE)

    def frame(self, box: Box, x_ticks, y_ticks, x_label: str, y_label: str = "", grid: bool = False) -> None:
        """Outline a plot; ticks are (fraction of the side, label), the y label stands left of the y ticks' labels."""
        left, top, right, bottom = box
        for share, words in x_ticks:
            x = left + share * (right - left)
            self.line([(x, top if grid else bottom), (x, bottom + 4)], RULE if grid else GRAY)
            self.text(x, bottom + 15, words, 11, anchor="ms")
        for share, words in y_ticks:
            y = bottom - share * (bottom - top)
            self.line([(left - 4, y), (right if grid else left - 1, y)], RULE if grid else GRAY)
            self.text(left - 7, y, words, 11, anchor="rm")
        self.box(box, outline=GRAY)
        self.text((left + right) / 2, bottom + 32, x_label, 12, GRAY, "ms")
        if y_label:
            widest = max(self.measure(words, 11) for _, words in y_ticks)
            self.upright(left - widest - 20, (top + bottom) / 2, y_label)
