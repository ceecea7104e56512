"""An albedo moved to another skin: its pigment and blood moved in the LUT, what they do not explain laid on top.

A mole or a blush is a ratio of melanin or hemoglobin to the skin around it. The same ratio shows more on a skin whose
color follows that chromophore more steeply, and so do noise and baked light: dark skin would blotch. There they are
moved by what shows as much as they did.
"""

from __future__ import annotations

import numpy as np

from lutgen import color, gamut
from lutgen.gamut import Surface
from lutgen.inversion import Inversion
from lutgen.lutset import LutSet

_FACTOR = (0.05, 8.0)
"""Least and most that what the LUT does not explain may multiply a channel by."""
_NODES = 256
_SRGB = color.SRGB_FROM_XYZ.astype("f4") * (np.linalg.inv(color.SRGB_FROM_XYZ) @ np.ones(3)).astype("f4")
_ACESCG = color.ACESCG_FROM_XYZ.astype("f4") * (np.linalg.inv(color.SRGB_FROM_XYZ) @ np.ones(3)).astype("f4")
_SRGB_FROM_ACESCG = (color.SRGB_FROM_XYZ @ np.linalg.inv(color.ACESCG_FROM_XYZ)).astype("f4")


def moves(
    luts: LutSet, base: tuple[float, float, float], target: tuple[float, float, float]
) -> list[tuple[np.ndarray, np.ndarray]]:
    """For melanin and for hemoglobin: values around `base` [N], rising, and what becomes of each around `target` [N].

    A value's ratio to the base is kept where the luminance that it makes, over its skin's, differs on the target no
    more than on the base; else the value is the one that makes the same.
    """
    grid, found = luts.color_lut.grid, []
    for k, axis in ((0, grid.melanin), (2, grid.hemoglobin)):
        values = np.geomspace(axis.low, axis.high, _NODES) if axis.low > 0 else np.linspace(axis.low, axis.high, _NODES)
        shown = []
        for skin in (base, target):
            skins = np.array([skin] * _NODES + [skin])
            skins[:-1, k] = values
            luminance = np.log(luts.color(*skins.T, space="xyz")[:, 1])
            shown.append(luminance[:-1] - luminance[-1])
        same = np.interp(-shown[0], -shown[1], values)  # the more there is of either, the darker
        ratio = np.clip(values * (target[k] / base[k]), axis.low, axis.high)
        nearer = np.abs(same - target[k]) < np.abs(ratio - target[k])
        found.append((values, np.where(nearer, same, ratio)))
    return found


def recolored(luts: LutSet, found: Inversion, albedo: np.ndarray, target: tuple[float, float, float]) -> np.ndarray:
    """The inverted albedo [R, C, 3] in linear sRGB on another skin (melanin, eumelanin, hemoglobin), white-balanced.

    Its median texel becomes the target's color; background stays as it is. InputError for a skin outside the LUT.
    """
    curves = moves(luts, found.skin, target)
    before, after = gamut.of(luts, found.eumelanin), gamut.of(luts, target[1])
    inside = found.painted
    skins = np.stack([found.melanin[inside], found.hemoglobin[inside]]).astype("f4")
    painted, gain = albedo[inside], found.gain.astype("f4")
    out = np.array(albedo, "f4")
    moved = np.empty_like(painted, "f4")

    def _move(part: slice) -> None:
        goal = np.stack([np.interp(v, *curve) for v, curve in zip(skins[:, part], curves, strict=True)])
        was, now = _acescg(before, skins[:, part]), _acescg(after, goal)
        given = _ACESCG @ gamut.relative(painted[part] * gain)
        factor = np.clip(given / np.maximum(was, np.float32(1e-5)), *np.array(_FACTOR, "f4"))
        moved[part] = np.maximum(_SRGB_FROM_ACESCG @ (now * factor), 0).T

    gamut.in_chunks(_move, len(painted))
    out[inside] = moved
    return out


def _acescg(surface: Surface, skins: np.ndarray) -> np.ndarray:
    at = [axis.position(v) for axis, v in zip((surface.melanin, surface.hemoglobin), skins, strict=True)]
    return _ACESCG @ surface.read(np.stack(at).astype("f4"))[0]
