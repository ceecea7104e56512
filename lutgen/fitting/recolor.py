"""An albedo moved to another skin: its pigment and blood moved in the LUT, what they do not explain laid on top.

A mole is a ratio of melanin to the skin around it. The same ratio shows far more on dark skin, whose color follows
melanin more steeply, and so do noise and baked light: it would blotch. Detail is therefore moved to what shows as much.
"""

from __future__ import annotations

import numpy as np

from lutgen import color
from lutgen.fitting import skin_colors
from lutgen.fitting.albedo_to_skin import Inversion
from lutgen.fitting.skin_colors import Surface
from lutgen.tables.lut_set import LutSet

_FACTOR = (0.05, 8.0)
"""Least and most that what the LUT does not explain may multiply a channel by."""
_NODES = 256
_SRGB = color.SRGB_FROM_XYZ.astype("f4") * (color.XYZ_FROM_SRGB @ np.ones(3)).astype("f4")
_ACESCG = color.ACESCG_FROM_XYZ.astype("f4") * (color.XYZ_FROM_SRGB @ np.ones(3)).astype("f4")
_SRGB_FROM_ACESCG = (color.SRGB_FROM_XYZ @ color.XYZ_FROM_ACESCG).astype("f4")


def moves(
    luts: LutSet, base: tuple[float, float, float], target: tuple[float, float, float]
) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """For melanin and for hemoglobin: values around `base` [N], rising, what becomes of each around `target` [N], and
    what its light is multiplied with [N].

    Melanin becomes what makes the same luminance over its skin's as it did on the base. So does hemoglobin, unless the
    same ratio shows less: a flush fades on dark skin. Where the LUT ends before that, light goes on as it does on the
    base: brows on the darkest skin are darker than skin can be.
    """
    grid, curves = luts.color_lut.grid, []
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
        fades = axis is grid.hemoglobin and np.abs(ratio - target[k]) < np.abs(same - target[k])
        goal = np.where(fades, ratio, same)
        inside = np.flatnonzero((goal > axis.low) & (goal < axis.high))
        first, end = (int(inside[0]), int(inside[-1])) if len(inside) else (0, _NODES - 1)
        last = np.clip(np.arange(_NODES), first, end)
        curves.append((values, goal, np.exp(shown[0] - shown[0][last])))
    return curves


def recolored(luts: LutSet, inversion: Inversion, albedo: np.ndarray, target: tuple[float, float, float]) -> np.ndarray:
    """The inverted albedo [R, C, 3] in linear sRGB on another skin (melanin, eumelanin, hemoglobin), white-balanced.

    Its median texel becomes the target's color; background stays as it is. InputError for a skin outside the LUT.
    """
    curves = moves(luts, inversion.skin, target)
    before, after = skin_colors.of(luts, inversion.eumelanin), skin_colors.of(luts, target[1])
    inside = inversion.painted
    skins = np.stack([inversion.melanin[inside], inversion.hemoglobin[inside]]).astype("f4")
    painted, gain = albedo[inside], inversion.gain.astype("f4")
    result = np.array(albedo, "f4")
    moved = np.empty_like(painted, "f4")

    def _move(part: slice) -> None:
        goal = np.stack([np.interp(v, of, to) for v, (of, to, _) in zip(skins[:, part], curves, strict=True)])
        light = [np.interp(v, of, rest).astype("f4") for v, (of, _, rest) in zip(skins[:, part], curves, strict=True)]
        before_acescg, after_acescg = _acescg(before, skins[:, part]), _acescg(after, goal)
        painted_acescg = _ACESCG @ skin_colors.relative(painted[part] * gain)
        factor = np.clip(painted_acescg / np.maximum(before_acescg, np.float32(1e-5)), *np.array(_FACTOR, "f4"))
        moved[part] = np.maximum(_SRGB_FROM_ACESCG @ (after_acescg * factor * light[0] * light[1]), 0).T

    skin_colors.in_chunks(_move, len(painted))
    result[inside] = moved
    return result


def _acescg(surface: Surface, skins: np.ndarray) -> np.ndarray:
    positions = [axis.position(v) for axis, v in zip((surface.melanin, surface.hemoglobin), skins, strict=True)]
    return _ACESCG @ surface.read(np.stack(positions).astype("f4"))[0]
