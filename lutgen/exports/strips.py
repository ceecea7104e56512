"""Half-float OpenEXR strips of the color LUT, in linear Rec. 709 and in ACEScg, at the set's own nodes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lutgen.exports.resampled import MADE, MEANING, Report, Source
from lutgen.files import exr
from lutgen.tables.shader_axes import formulas, texel

FILES = {"color_rec709.exr": "srgb", "color_acescg.exr": "acescg"}
CHROMATICITIES = {"srgb": exr.REC709, "acescg": exr.ACESCG}


def strip(cells: np.ndarray) -> np.ndarray:
    """An image [N_h, N_e N_m, 3] of cells [N_h, N_e, N_m, 3]: melanin along x in a tile, tiles along eumelanin."""
    return cells.reshape(cells.shape[0], -1, cells.shape[-1])


def write(source: Source, folder: Path) -> Report:
    """Write both strips into a folder, rows of low hemoglobin first in the file."""
    error, axes = {}, formulas(source.grid)
    for name, space in FILES.items():
        half = source.own_colors(space).astype("f2")
        note = {"axes": axes, "space": space}
        part = exr.Part("color", exr.rgb(strip(half)), note)
        exr.write(folder / name, [part], CHROMATICITIES[space])
        error[name] = source.color_error(source.grid, half, space)
    N_h, N_e, N_m = source.grid.shape
    largest = max(off["largest"] for off in error.values())
    return Report((
        f"{', '.join(FILES)}: skin color as strips of {N_e * N_m} x {N_h} texels, half float, ZIP, unclipped.",
        f"x: melanin, {N_m} texels a tile; {N_e} tiles along eumelanin. y: hemoglobin, row 0 is the lowest.",
        "Space: linear Rec. 709 (D65), or linear ACEScg (ACES white, adapted from D65 by CAT02).",
        f"Axis warp to t in 0 to 1: {'; '.join(axes.values())}.",
        f"Half texel: u = {texel('t', N_m)} in a tile, v = {texel('t', N_h)}. Mix two",
        "tiles by eumelanin and keep u within its tile, or filtering bleeds into the neighbor.",
        *MEANING,
        f"Error it adds (half floats): {largest:.2g} at most at {len(source.skins)} random skins.",
        MADE,
    ), error)  # fmt: skip
