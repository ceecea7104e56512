"""What a picture shows: a head with its maps, and what lights it from all around; for the viewer and the renderer."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from lutgen import color
from lutgen.errors import InputError
from lutgen.files import texture_maps
from lutgen.files.texture_maps import Maps
from lutgen.fitting import albedo_to_skin
from lutgen.head import builtin, mesh, paint
from lutgen.head.mesh import Mesh
from lutgen.scene import environment, light
from lutgen.tables.lut_set import LutSet

MAX_SIDE = 4096
NO_MAPS = "none"
"""What stands for a folder of maps where skin shall be the same all over."""
ALBEDO = ("recolor", "invert")
"""What is made of a painted albedo: its detail laid over any skin, or maps of pigment and blood."""


def size_of(text: str) -> tuple[int, int]:
    """Width and height of `640x360`."""
    parts = text.lower().split("x")
    if len(parts) != 2 or not all(part.isdigit() for part in parts):
        raise InputError(f"size = {text!r}: width x height is needed, for example 640x360")
    width, height = (int(part) for part in parts)
    if not (16 <= width <= MAX_SIDE and 16 <= height <= MAX_SIDE):
        raise InputError(f"size = {text}: allowed is 16 to {MAX_SIDE} each way")
    return width, height


def model(name: str | None, mm_per_unit: float | None, folder: str | None, flip_v: bool = False) -> tuple[Mesh, Maps]:
    """The head and its maps: built-in without a name; painted maps, under the file's own, under those of a folder, or
    none at all.

    Skin that is painted into an albedo is not painted a second time: beside one, lips and freckles are its own, and
    only gloss, pores, open sky and thickness are generated. Where a face is found the head is moved so that the
    camera looks at it.
    """
    shape = builtin.builtin() if name is None else mesh.of(name, mm_per_unit, flip_v)
    maps = Maps(**paint.paint(shape))
    if "albedo" in shape.textures:
        maps = replace(maps, chromophores=None, albedo=color.decode_srgb(shape.textures["albedo"] / 255.0))
    if "normal" in shape.textures:
        maps = replace(maps, normal=shape.textures["normal"])
    if folder == NO_MAPS:
        maps = Maps()
    elif folder is not None:
        maps = texture_maps.load(Path(folder), maps)
    centered = (shape.positions_mm - paint.origin_mm(shape)).astype("f4")
    return replace(shape, positions_mm=centered, notes=(*shape.notes, *paint.notes(shape))), maps


def detail(albedo: np.ndarray, coverage: float = 1e-3) -> np.ndarray:
    """What a painted albedo adds to a plain skin: its ratio to its own median, ACEScg [rows, columns, 3].

    Multiplied with the color of any skin it is `LutSet.recolor` with the painted skin's own mean as base: the detail
    stays, the tone is the sliders'.
    """
    acescg = np.maximum(color.to_acescg(albedo), 1e-4)
    painted = acescg.sum(axis=-1) > coverage * 3
    if not painted.any():
        raise InputError("albedo is black throughout: there is no skin on it")
    return np.clip(acescg / np.median(acescg[painted], axis=0), 0.05, 8)


def inverted(luts: LutSet, maps: Maps, eumelanin: float) -> tuple[Maps, tuple[str, ...]]:
    """Maps whose albedo is taken apart into pigment and blood instead of being laid over the skin; and what was found.

    `eumelanin` is the look's, for ratios found with one pigment tint another. Chromophore maps that were given stay.
    """
    if maps.albedo is None:
        return maps, ("no albedo to invert: neither the mesh nor the maps bring one",)
    inversion = albedo_to_skin.invert(luts, _shrunk(maps.albedo, 2048), eumelanin)
    layers = albedo_to_skin.ratios(inversion)
    if maps.chromophores is not None:
        painted = np.any(maps.chromophores != 1, axis=(0, 1))
        rows, columns = layers.shape[:2]
        layers = np.stack(
            [
                texture_maps.resized(maps.chromophores[..., k], rows, columns) if painted[k] else layers[..., k]
                for k in range(3)
            ],
            axis=-1,
        )
    skin, gain = inversion.skin, " ".join(f"{v:.2f}" for v in inversion.gain)
    left = float(np.median(inversion.residual[inversion.painted]))
    note = (
        f"albedo inverted: median melanin {skin[0]:.3g}, eumelanin {skin[1]:.2g}, hemoglobin {skin[2]:.3g}; "
        f"balanced by {gain}; median color difference left {left:.1f}"
    )
    return replace(maps, chromophores=layers, albedo=None, full_contrast_melanin=skin[0]), (note,)


def surroundings_of(name: str, normalized: bool = False) -> np.ndarray | None:
    """Light from all around by name: None for `studio`, black for `none`, else the radiance of an .exr or .hdr.

    `normalized` scales a file so that its mean radiance is the studio's, for pictures of unknown exposure.
    """
    if name == "studio":
        return None
    if name == "none":
        return np.zeros((1, 2, 3))
    radiance = environment.read(Path(name))
    mean = environment.mean_radiance(radiance)
    return radiance * (light.studio_mean() / mean) if normalized and mean > 0 else radiance


def textures_of(maps: Maps) -> dict[str, np.ndarray]:
    """The maps as the passes take them, four channels where they filter them together."""
    textures = {"normal": maps.normal, "chromophores": maps.chromophores, "surface": maps.surface}
    if maps.albedo is not None:
        textures["detail"] = detail(maps.albedo)
    return {name: _shrunk(values) for name, values in textures.items() if values is not None}


def _shrunk(values: np.ndarray, most: int = 4096) -> np.ndarray:
    step = -(-max(values.shape[:2]) // most)
    return np.ascontiguousarray(values[::step, ::step])
