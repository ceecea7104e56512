"""What the exports for Unreal and Unity share: the layout of their textures, limits, errors, and files as they are."""

from __future__ import annotations

from importlib.resources import files

import numpy as np

from lutgen.errors import InputError
from lutgen.exports import lookup
from lutgen.exports.resampled import POINTS, Source, difference
from lutgen.solvers import profiles
from lutgen.tables import expand

LIMIT = 16384
"""Texels along a side of a texture, in both engines."""


def slices(cells: np.ndarray) -> np.ndarray:
    """An image [N_e, N_h N_m, C] of cells [N_h, N_e, N_m, C]: a tile per hemoglobin from left to right, in it melanin
    along x and eumelanin along y, row 0 the lowest."""
    return cells.transpose(1, 0, 2, 3).reshape(cells.shape[1], -1, cells.shape[-1])


def capitalized(preset: str) -> str:
    """A preset's name as a part of an asset's.

    >>> capitalized("very-light")
    'VeryLight'
    """
    return "".join(word.capitalize() for word in preset.split("-"))


def fits(engine: str, what: str, image: np.ndarray) -> np.ndarray:
    """The image, or InputError where a side is longer than the engine takes."""
    height, width = image.shape[:2]
    if max(width, height) > LIMIT:
        advice = f"allowed is {LIMIT} a side; bake a set with fewer nodes"
        raise InputError(f"{engine}: the {what} texture is {width} x {height} texels: {advice}")
    return image


def rgba(image: np.ndarray) -> dict[str, np.ndarray]:
    """Channels R, G, B, A of an array [rows, columns, 4]."""
    return {name: np.ascontiguousarray(image[..., i]) for i, name in enumerate("RGBA")}


def errors(source: Source, half: np.ndarray, texels: np.ndarray) -> tuple[dict, float]:
    """What an export adds: of half cells [N_h, N_e, N_m, 3] against the set's colors at random skins, of profile texels
    [nodes, 64, 4], and of Burley's shape per preset; and the largest EE difference of the last."""
    burley = {p.name: {"d_mm": p.burley_d_mm.tolist(), "burley_ee_difference": p.burley_difference.tolist()}
              for p in source.presets}  # fmt: skip
    worst = max((max(fit["burley_ee_difference"]) for fit in burley.values()), default=0.0)
    color = source.color_error(source.grid, half)
    return {"color": color, "rings": ring_error(source, texels), "presets": burley}, worst


def ring_error(source: Source, texels: np.ndarray, skins: int = POINTS // 10) -> dict:
    """Difference of the encircled energy that a shader reads from profile texels [nodes, 64, 4] from the set's own,
    over radii of 0.01 mm and more, at random skins."""
    grid = source.luts.profile_lut.grid
    axes = grid.axes[::-1]
    points = np.clip(source.skins[:skins], [axis.low for axis in axes], [axis.high for axis in axes])
    read = grid.interpolate(texels.reshape(*grid.shape, -1, 4).astype(float), *points.T)
    off = []
    for rings, point in zip(read, points, strict=True):
        profile = source.luts.profile(*point, space="srgb")
        shape, _ = expand.normalized(profile.energy)
        P, edges = profiles.encircled(shape.T), profile.radius_edges_mm
        far = rings[rings[:, 0] >= profiles.COMPARED_FROM_MM]
        exact = np.stack([np.interp(far[:, 0], edges, P[c]) for c in range(3)], axis=1)
        off.append(np.abs(far[:, 1:] - exact).ravel())
    return difference(np.concatenate(off), np.array(0.0))


def hlsl(source: Source, note: str, more: str = "") -> str:
    """An include file with the shader functions, guarded; `note` is a comment, `more` follows the functions."""
    head = "".join(f"// {line}\n" for line in note.splitlines())
    body = lookup.text(source, "hlsl").strip()
    return f"{head}#ifndef LUTGEN_INCLUDED\n#define LUTGEN_INCLUDED\n\n{body}\n{more}\n#endif\n"


def template(name: str) -> str:
    """The text of a file of lutgen/exports/templates, which is copied into exports as it is."""
    return (files("lutgen.exports") / "templates" / name).read_text(encoding="utf-8")
