"""A 3-D .cube whose input is not a color but a skin: R, G, B are the warped melanin, eumelanin and hemoglobin."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lutgen.exports.resampled import MADE, MEANING, Report, Source
from lutgen.tables import shader_axes

FILE = "skin.cube"
DECIMALS = 7


def text(source: Source, title: str) -> tuple[str, np.ndarray]:
    """The file, and its values [N, N, N, 3] as they are written: linear Rec. 709, clipped to 0 to 1.

    Red (melanin) runs fastest; fixed decimals, for some readers skip rows with an exponent or a minus.
    """
    values = np.round(np.clip(source.colors("srgb"), 0, 1), DECIMALS)
    head = [
        f'TITLE "{title}"',
        "# Input is a skin: R melanin, G eumelanin, B hemoglobin, each a coordinate t in 0 to 1 after its axis warp:",
        *(f"# {name}: {code}" for name, code in shader_axes.formulas(source.grid).items()),
        "# Output is diffuse color: linear Rec. 709 (D65), clipped to 0 to 1. Interpolate trilinearly.",
        f"LUT_3D_SIZE {source.size}",
        "DOMAIN_MIN 0.0 0.0 0.0",
        "DOMAIN_MAX 1.0 1.0 1.0",
    ]
    rows = (f"{r:.{DECIMALS}f} {g:.{DECIMALS}f} {b:.{DECIMALS}f}" for r, g, b in values.reshape(-1, 3).tolist())
    return "\n".join([*head, *rows]) + "\n", values


def error(source: Source, values: np.ndarray) -> dict:
    """What a reader of the values [N, N, N, 3] gets at random skins against the set's colors, and the share of these
    that lies outside 0 to 1."""
    exact = source.luts.color(*source.skins.T)
    clipped = float(np.mean((exact < 0) | (exact > 1)))
    return {"color": source.color_error(source.cubic, values), "clipped_share": clipped}


def write(source: Source, folder: Path) -> Report:
    """Write skin.cube into a folder."""
    content, values = text(source, "lutgen skin")
    (folder / FILE).write_text(content, encoding="ascii")
    added = error(source, values)
    n, largest, mean = source.size, added["color"]["largest"], added["color"]["mean"]
    return Report((
        f"{FILE}: 3-D LUT of skin color, {n} x {n} x {n} nodes, for OpenColorIO, Unity and tools.",
        "Input R, G, B: melanin, eumelanin, hemoglobin as coordinates t in 0 to 1 after the axis warp:",
        "; ".join(shader_axes.formulas(source.grid).values()),
        "Output: diffuse color in linear Rec. 709 (sRGB primaries, D65), clipped to 0 to 1; no transfer curve.",
        f"Half texel: in a texture of it u = {shader_axes.texel('t', n)}; readers of .cube files do this themselves.",
        "Encoding: text, red (melanin) fastest, 7 fixed decimals, domain 0 to 1.",
        *MEANING,
        f"Error it adds: {largest:.2g} at most, {mean:.2g} on average at {len(source.skins)} skins, by resampling.",
        MADE,
    ), added)  # fmt: skip
