"""What `lutgen maps` writes: chromophore maps, what is left of the color, what is out of reach, and maps.json.

Maps of melanin, eumelanin and hemoglobin are ratios to the skin's median, for that is what a viewer's or an engine's
sliders multiply; maps.json names the skin that the sliders must stand at. Beside them there may be absolute ones, whose
texel is the place on the LUT's own axis.
"""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lutgen.files import exr, images, texture_maps
from lutgen.fitting import albedo_to_skin
from lutgen.fitting.albedo_to_skin import Inversion
from lutgen.tables import shader_axes
from lutgen.tables.axes import Axis
from lutgen.tables.lut_set import LutSet

FORMATS = ("png", "exr")
REACH = 5.0
"""CIEDE2000 difference from which on a texel counts as no color of skin: two colors at a glance, not shades of one."""
RESIDUAL_RANGE = 32.0
AT_EDGE, BEYOND = 0.5, 1.0


@dataclass(frozen=True)
class Layer:
    """One file: `values` as an EXR holds them, `texels` 0 to 1 as a PNG does, and what either says."""

    values: np.ndarray
    texels: np.ndarray
    png: str
    exr: str


def layers(luts: LutSet, found: Inversion, absolute: bool = False) -> dict[str, Layer]:
    """The maps by name, first row on top as `found` has them."""
    every = (0.0, np.inf)
    made = albedo_to_skin.ratios(found, (1.0, 1.0), every).astype("f4")
    result = {}
    for k, name in enumerate(texture_maps.RATIOS):
        texels = np.cbrt(np.clip(made[..., k], 0, texture_maps.RATIO_RANGE) / np.float32(texture_maps.RATIO_RANGE))
        meaning = f"ratio of {name} to the skin's, the median"
        result[name] = Layer(made[..., k], texels, f"{meaning}: {texture_maps.RATIO_RANGE:g} t^3", meaning)
    if absolute:
        grid = luts.color_lut.grid
        for axis, values in ((grid.melanin, found.melanin), (grid.hemoglobin, found.hemoglobin)):
            result[f"{axis.name}_absolute"] = Layer(
                values, axis.warp(values), _axis_formula(axis), f"{axis.name} as it is"
            )
    left = found.residual
    result["residual"] = Layer(
        left, left / np.float32(RESIDUAL_RANGE), f"CIEDE2000 difference from the balanced albedo: {RESIDUAL_RANGE:g} t",
        "CIEDE2000 difference from the balanced albedo",
    )  # fmt: skip
    missed = out_of_reach(found)
    coded = (
        f"{BEYOND:g}: farther than {REACH:g} from any skin (CIEDE2000); {AT_EDGE:g}: at an end of a LUT axis; else 0"
    )
    result["out_of_reach"] = Layer(missed, missed, coded, coded)
    return result


def _axis_formula(axis: Axis) -> str:
    if axis.count == 1:
        return f"{axis.name} is {axis.low:g} throughout"
    value = shader_axes.unwarp(axis, "t", "text")
    return f"{axis.name}: {value}; the LUT's texture coordinate is {shader_axes.texel('t', axis.count)}"


def out_of_reach(found: Inversion) -> np.ndarray:
    """1 where a painted texel is farther from skin than `REACH`, 0.5 where it stands at the LUT's edge, else 0."""
    coded = np.where(found.at_edge, np.float32(AT_EDGE), np.float32(0))
    return np.where(found.painted, np.where(found.residual > REACH, np.float32(BEYOND), coded), np.float32(0))


def statistics(found: Inversion) -> dict:
    """CIEDE2000 left in painted texels, and their shares out of reach, at an edge, beyond what PNG ratios hold."""
    left = found.residual[found.painted]
    skin = found.skin
    beyond = (found.melanin > texture_maps.RATIO_RANGE * skin[0]) | (
        found.hemoglobin > texture_maps.RATIO_RANGE * skin[2]
    )
    middle, p95 = np.quantile(left, (0.5, 0.95))
    return {
        "texels": int(left.size), "delta_e00_mean": float(left.mean(dtype=float)), "delta_e00_median": float(middle),
        "delta_e00_p95": float(p95), "delta_e00_max": float(left.max()),
        "out_of_reach_share": float(np.mean(left > REACH)),
        "at_edge_share": float(np.mean(found.at_edge[found.painted])),
        "beyond_png_ratio_share": float(np.mean(beyond[found.painted])),
    }  # fmt: skip


def write(
    folder: Path, made: dict[str, Layer], kind: str, recolored: np.ndarray | None, alpha: np.ndarray | None, facts: dict
) -> None:
    """Write the maps as 16-bit PNG or float EXR, a recolored albedo [R, C, 3] in linear sRGB, and maps.json."""
    files = {f"{name}.{kind}": layer.png if kind == "png" else layer.exr for name, layer in made.items()}
    jobs = [(folder / name, layer) for name, layer in zip(files, made.values(), strict=True)]

    def _put(job: tuple[Path, Layer]) -> None:
        path, layer = job
        if kind == "png":
            images.write_16_bit(path, layer.texels)
        else:
            exr.write(path, [exr.Part(path.stem, {"Y": layer.values.astype("f4")}, {"meaning": layer.exr})], exr.REC709)

    with ThreadPoolExecutor() as threads:
        waiting = [threads.submit(_put, job) for job in jobs]
        if recolored is not None:
            name = f"recolored.{kind}"
            files[name] = "albedo on the target skin: " + ("sRGB" if kind == "png" else "linear Rec. 709")
            _write_color(folder / name, recolored, alpha)
        for one in waiting:
            one.result()
    said = {"files": files | {"preview.png": "what was given, what the LUT makes of it, the maps"}, **facts}
    (folder / texture_maps.MADE).write_text(json.dumps(said, indent=1, sort_keys=True) + "\n")


def _write_color(path: Path, linear: np.ndarray, alpha: np.ndarray | None) -> None:
    if path.suffix == ".exr":
        channels = exr.rgb(linear.astype("f4")) | ({} if alpha is None else {"A": alpha.astype("f4")})
        exr.write(path, [exr.Part("recolored", channels, {})], exr.REC709)
        return
    from lutgen import color

    encoded = color.encode_srgb(linear)
    images.write_16_bit(path, encoded if alpha is None else np.concatenate([encoded, alpha[..., None]], axis=-1))
