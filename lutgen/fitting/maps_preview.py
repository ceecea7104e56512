"""preview.png of maps made from an albedo: what was given, what the LUT makes of it, the maps, what is left."""

from __future__ import annotations

import numpy as np
from PIL import Image

from lutgen import color
from lutgen.fitting import skin_colors
from lutgen.fitting.albedo_to_skin import Inversion
from lutgen.fitting.maps_folder import REACH, Layer
from lutgen.tables.canvas import GRAY, INK, OVERSAMPLE, RULE, Canvas
from lutgen.tables.lut_set import LutSet

WIDTH, SIDE, GAP, TOP = 1200, 368, 24, 104
_BACKGROUND = np.array([0xF0, 0xF0, 0xF0], "u1")
_LEFT = np.array([[0xFF, 0xFF, 0xFF], [0xF4, 0xB1, 0x6A], [0xB2, 0x24, 0x1A], [0x2B, 0x0A, 0x3D]], float)
"""Colors of differences 0, a third, two thirds and all of twice the reach: each darker than the one before."""


def draw(
    luts: LutSet,
    balanced: np.ndarray,
    inversion: Inversion,
    layers: dict[str, Layer],
    words: str,
    recolored=None,
    name="",
) -> Image.Image:
    """RGB picture, 1200 pixels wide; the balanced albedo and the recolored one [R, C, 3] in linear sRGB."""
    pick = _fewer(inversion.painted.shape)
    painted, thin = inversion.painted[pick], balanced[pick]
    skins = [v[pick].ravel() for v in (inversion.melanin, inversion.hemoglobin)]
    surface = skin_colors.of(luts, inversion.eumelanin)
    positions = np.stack([a.position(v) for a, v in zip((surface.melanin, surface.hemoglobin), skins, strict=True)])
    from_xyz = color.SRGB_FROM_XYZ * (color.XYZ_FROM_SRGB @ np.ones(3))
    shown = (from_xyz @ surface.read(positions.astype("f4"))[0]).T.reshape(thin.shape)
    share = np.clip(inversion.residual[pick] / (2 * REACH), 0, 1) * (len(_LEFT) - 1)
    difference_colors = np.stack([np.interp(share, np.arange(len(_LEFT)), channel) for channel in _LEFT.T], axis=-1)
    melanin, eumelanin, hemoglobin = inversion.skin
    panels = [
        ("albedo, balanced", "gain " + " ".join(f"{v:.2f}" for v in inversion.gain), _bytes(thin)),
        ("the LUT's color", f"eumelanin ratio {eumelanin:.2g}", _bytes(shown)),
        ("melanin", f"median {100 * melanin:.3g} %", _gray(layers["melanin"].texels[pick])),
        ("hemoglobin", f"median {100 * hemoglobin:.3g} %", _gray(layers["hemoglobin"].texels[pick])),
        ("color difference left", "", difference_colors.astype("u1")),
    ]  # fmt: skip
    if recolored is not None:
        panels.append((f"on {name}", "detail kept", _bytes(recolored[pick])))
    height = round(SIDE * thin.shape[0] / thin.shape[1])
    height = min(max(height, 60), 3 * SIDE)
    canvas = Canvas(WIDTH, TOP + 2 * (height + 52))
    canvas.text(24, 40, "Maps from a painted albedo", 22)
    canvas.text(24, 62, words, 13, GRAY)
    canvas.line([(24, 76), (WIDTH - 24, 76)], RULE)
    for i, (title, note, pixels) in enumerate(panels):
        x, y = 24 + i % 3 * (SIDE + GAP), TOP + i // 3 * (height + 52)
        canvas.text(x, y, title, 14)
        canvas.text(x + SIDE, y, note, 12, GRAY, "rs")
        pixels = np.where(painted[..., None], pixels, _BACKGROUND)
        size = SIDE * OVERSAMPLE, height * OVERSAMPLE
        canvas.image.paste(
            Image.fromarray(pixels).resize(size, Image.Resampling.BILINEAR), (x * OVERSAMPLE, (y + 10) * OVERSAMPLE)
        )
        canvas.box((x, y + 10, x + SIDE, y + 10 + height), outline=RULE)
        if title == "color difference left":
            _scale(canvas, x + SIDE, y)
    return canvas.image.reduce(OVERSAMPLE)


def _scale(canvas: Canvas, right: float, y: float) -> None:
    """The colors of differences, from none to twice the reach."""
    left, width = right - 150, 110
    canvas.text(left - 6, y, "0", 12, GRAY, "rs")
    for k in range(width):
        step = k / (width - 1) * (len(_LEFT) - 1)
        ink = [round(float(np.interp(step, np.arange(len(_LEFT)), channel))) for channel in _LEFT.T]
        canvas.box((left + k, y - 9, left + k + 1, y), "#" + bytes(ink).hex())
    canvas.box((left, y - 9, left + width, y), outline=GRAY)
    canvas.text(right, y, f"{2 * REACH:g}+", 12, INK, "rs")


def _fewer(shape: tuple[int, ...]) -> tuple[slice, slice]:
    """Every n-th row and column, so that the smaller side has at least the pixels shown."""
    step = max(1, min(shape) // SIDE)
    return slice(None, None, step), slice(None, None, step)


def _bytes(linear: np.ndarray) -> np.ndarray:
    return np.rint(255 * color.encode_srgb(linear)).astype("u1")


def _gray(texels: np.ndarray) -> np.ndarray:
    return np.repeat(np.rint(255 * np.clip(texels, 0, 1)).astype("u1")[..., None], 3, axis=-1)
