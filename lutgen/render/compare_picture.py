"""Two pictures and how far they are apart, side by side, with the scale of the map; Pillow and NumPy only."""

from __future__ import annotations

import numpy as np
from PIL import Image

from lutgen import color
from lutgen.render.compare import BOX, Difference
from lutgen.render.compare_files import Picture
from lutgen.tables.canvas import GRAY, INK, OVERSAMPLE, Canvas

_RAMP = np.array([[12, 12, 28], [59, 25, 99], [140, 41, 99], [214, 77, 59], [249, 152, 30], [252, 240, 160]])
"""From none to much, evenly spaced: darker is less, also for those who see no red or green."""
_BACKDROP = (64, 66, 70)
_ENDS = (2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
_LEAST_SIDE = 320
_GAP, _HEAD, _FOOT = 16, 64, 56


def draw(a: Picture, b: Picture, found: Difference) -> Image.Image:
    """A, B and the map of ΔE00, pixel by pixel; pictures narrower than 320 pixels are enlarged by whole factors."""
    rows, columns = a.acescg.shape[:2]
    factor = max(1, -(-_LEAST_SIDE // columns))
    width, height = columns * factor, rows * factor
    canvas = Canvas(3 * width + 4 * _GAP, _HEAD + height + _FOOT)
    end = next((e for e in _ENDS if found.p95.value <= 0.8 * e), _ENDS[-1])
    words = (
        f"mean {found.mean.value:.2f} ± {found.mean.sigma:.2f}, median {found.median.value:.2f}, "
        f"p95 {found.p95.value:.2f}, most {found.most:.2f}"
    )
    change = _map(found, end, rows, columns)
    panels = [(_display(a), "A", a.name), (_display(b), "B", b.name), (change, "Color difference", words)]
    for k, (pixels, title, line) in enumerate(panels):
        left = _GAP + k * (width + _GAP)
        canvas.text(left, 26, title, 16)
        canvas.text(left, 48, _shortened(canvas, line, width), 12, GRAY)
        large = pixels.repeat(factor * OVERSAMPLE, axis=0).repeat(factor * OVERSAMPLE, axis=1)
        canvas.image.paste(Image.fromarray(large), (left * OVERSAMPLE, _HEAD * OVERSAMPLE))
    left, top = _GAP + 2 * (width + _GAP), _HEAD + height + 12
    bar = _colors(np.linspace(0, 1, width * OVERSAMPLE))[None].repeat(12 * OVERSAMPLE, axis=0)
    canvas.image.paste(Image.fromarray(bar), (left * OVERSAMPLE, top * OVERSAMPLE))
    for k in range(6):
        more = "+" if k == 5 and found.most > end else ""
        anchor = "ls" if k == 0 else "rs" if k == 5 else "ms"
        canvas.text(left + width * k / 5, top + 28, f"{end * k / 5:g}{more}", 11, INK, anchor)
    canvas.text(
        _GAP, top + 28, f"CIEDE2000 of boxes of {BOX} x {BOX} pixels, noise taken off; gray: not compared", 11, GRAY
    )
    return canvas.image.reduce(OVERSAMPLE)


def _display(one: Picture) -> np.ndarray:
    """Bytes [rows, columns, 3] of a picture, clipped to sRGB as a display would."""
    return np.rint(255 * color.encode_srgb(color.from_acescg(one.acescg, "srgb"))).astype("u1")


def _map(found: Difference, end: float, rows: int, columns: int) -> np.ndarray:
    large = found.delta_e00.repeat(BOX, axis=0).repeat(BOX, axis=1)[:rows, :columns]
    return np.where(np.isnan(large)[..., None], _BACKDROP, _colors(np.nan_to_num(large) / end)).astype("u1")


def _colors(share: np.ndarray) -> np.ndarray:
    at = np.clip(share, 0, 1) * (len(_RAMP) - 1)
    return np.rint(np.stack([np.interp(at, np.arange(len(_RAMP)), _RAMP[:, c]) for c in range(3)], axis=-1)).astype(
        "u1"
    )


def _shortened(canvas: Canvas, words: str, width: float) -> str:
    while len(words) > 4 and canvas.measure(words, 12) > width:
        words = words[:-4] + "..."
    return words
