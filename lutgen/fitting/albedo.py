"""An albedo as it was painted or photographed: read with its alpha, decoded to linear sRGB, and doubted.

Pictures of 8 and 16 bits are taken for sRGB, EXR for linear Rec. 709 or ACEScg, as it says. Whether a file means what
it seems to is asked of skin itself: read the wrong way, its colors lie farther from those of skin, or are those of a
tone that no one has.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lutgen import color
from lutgen.errors import InputError, one_of
from lutgen.files import images
from lutgen.fitting import skin_colors, white_balance
from lutgen.fitting.albedo_to_skin import UNPAINTED, checked, ratios_of
from lutgen.skin.tissue import PRESETS
from lutgen.tables.lut_set import LutSet

ENCODINGS = ("srgb", "linear")
_MEASURED = [skin for name, skin in PRESETS.items() if not name.startswith("source-")]
_MELANIN = min(s.melanin for s in _MEASURED), max(s.melanin for s in _MEASURED)
_HEMOGLOBIN = float(np.median([s.hemoglobin for s in _MEASURED]))
_TONE_SPREAD = 0.5
"""How far in logarithm a median lies from measured skin as readily as its texels lie off by half a color difference."""
_DOUBT, _FARTHER = 2.0, 0.5
"""The other reading is named where this one's score is so many times as large, and larger by so much. Where the file
was said to be other than its kind is, that it is larger is enough."""
_COLORLESS = 0.02


@dataclass(frozen=True)
class Albedo:
    """`linear` [R, C, 3] sRGB, first row on top; `alpha` [R, C] or None; `painted` [R, C]: neither clear nor black.
    `encoding` is how it was read, `usual` how its kind of file is; `bits` of each channel."""

    linear: np.ndarray
    alpha: np.ndarray | None
    painted: np.ndarray
    encoding: str
    usual: str
    bits: int


def read(path: Path | str, encoding: str | None = None) -> Albedo:
    """An albedo from a picture; `encoding` srgb or linear overrules its kind.

    InputError for no picture, and for one that is gray, black or clear throughout, or holds NaN or negative values.
    """
    image = images.read(path, "albedo")
    values, alpha = image.values, image.alpha
    usual = "linear" if image.bits == 32 else "srgb"
    encoding = usual if encoding is None else one_of("encoding", encoding, ENCODINGS)
    gray = f"albedo {path}: is gray; melanin and hemoglobin can only be told from color, give a color picture"
    if values.shape[-1] != 3:
        raise InputError(gray)
    if values.min() < 0:
        raise InputError(f"albedo {path}: holds negative values, down to {values.min():g}; mend it")
    linear = color.decode_srgb(values) if encoding == "srgb" else _linear(image, path)
    covered = None if alpha is None else alpha > 0
    if covered is not None and not covered.any():
        raise InputError(f"albedo {path}: is clear throughout (alpha 0); there is no skin to invert")
    try:
        _, painted = checked(linear, covered)
    except InputError as error:
        raise InputError(f"albedo {path}: {str(error).removeprefix('albedo ')}") from error
    texels = linear[painted]
    if np.mean(np.ptp(texels, axis=1) > _COLORLESS * texels.max(axis=1)) < 0.01:
        raise InputError(gray)
    return Albedo(linear, alpha, painted, encoding, usual, image.bits)


def _linear(image: images.Image, path: Path | str) -> np.ndarray:
    """Linear sRGB [R, C, 3] of linear texels; what lies outside sRGB is brought to its edge."""
    from lutgen.files import exr

    if image.chromaticities is None or np.allclose(image.chromaticities, exr.REC709, atol=1e-3):
        return np.ascontiguousarray(image.values, "f4")
    if not np.allclose(image.chromaticities, exr.ACESCG, atol=1e-3):
        raise InputError(f"albedo {path}: has other primaries than Rec. 709 and ACEScg; convert it to linear Rec. 709")
    return np.maximum(color.from_acescg(image.values, "srgb"), 0).astype("f4")


def doubt(luts: LutSet, albedo: Albedo) -> str | None:
    """One line that says so where the albedo's colors are those of skin if its texels are read the other way."""
    other = ENCODINGS[1 - ENCODINGS.index(albedo.encoding)]
    colors = white_balance.sample(albedo.linear[albedo.painted])
    turned = color.encode_srgb(colors) if other == "linear" else color.decode_srgb(colors)
    turned = turned[turned.sum(axis=1) > 3 * UNPAINTED]
    if not len(turned):
        return None
    (score, said), (other_score, other_said) = _tone(luts, colors), _tone(luts, turned)
    sure = other_score * _DOUBT < score and other_score + _FARTHER < score
    if not (sure or (albedo.encoding != albedo.usual and other_score < score)):
        return None
    return (
        f"read as {albedo.encoding}, its skin would have {said}; read as {other}, {other_said}, which is nearer to "
        f"measured skin: give --encoding {other} if that is what it is"
    )


def _tone(luts: LutSet, colors: np.ndarray) -> tuple[float, str]:
    """How far colors [N, 3] are from measured skin, in color differences, and the tone in words."""
    usual = min(ratios_of(luts, None), key=lambda ratio: abs(ratio - white_balance.EUMELANIN))
    fit = white_balance.fitted(luts, colors, [usual], np.ones(3), "both")
    surface = skin_colors.of(luts, usual)
    positions = np.median(skin_colors.nearest(surface, skin_colors.coded(colors * fit.gain)), axis=1)
    melanin, hemoglobin = (float(v) for v in surface.values(positions))
    off = np.log(melanin / np.clip(melanin, *_MELANIN)), np.log(hemoglobin / _HEMOGLOBIN)
    score = fit.cost + 0.5 * sum(float(v / _TONE_SPREAD) ** 2 for v in off)
    return score, f"melanin {melanin:.2g} and hemoglobin {hemoglobin:.2g} at a color difference of {fit.cost:.1f}"
