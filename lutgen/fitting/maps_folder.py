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


def layers(luts: LutSet, inversion: Inversion, absolute: bool = False) -> dict[str, Layer]:
    """The maps by name, first row on top as `inversion` has them."""
    every = (0.0, np.inf)
    ratios = albedo_to_skin.ratios(inversion, (1.0, 1.0), every).astype("f4")
    by_name = {}
    for k, name in enumerate(texture_maps.RATIOS):
        texels = np.cbrt(np.clip(ratios[..., k], 0, texture_maps.RATIO_RANGE) / np.float32(texture_maps.RATIO_RANGE))
        meaning = f"ratio of {name} to the skin's, the median"
        by_name[name] = Layer(ratios[..., k], texels, f"{meaning}: {texture_maps.RATIO_RANGE:g} t^3", meaning)
    if absolute:
        grid = luts.color_lut.grid
        for axis, values in ((grid.melanin, inversion.melanin), (grid.hemoglobin, inversion.hemoglobin)):
            by_name[f"{axis.name}_absolute"] = Layer(
                values, axis.warp(values), _axis_formula(axis), f"{axis.name} as it is"
            )
    residual = inversion.residual
    by_name["residual"] = Layer(
        residual, residual / np.float32(RESIDUAL_RANGE),
        f"CIEDE2000 difference from the balanced albedo: {RESIDUAL_RANGE:g} t",
        "CIEDE2000 difference from the balanced albedo",
    )  # fmt: skip
    out = out_of_reach(inversion)
    coded = (
        f"{BEYOND:g}: farther than {REACH:g} from any skin (CIEDE2000); {AT_EDGE:g}: at an end of a LUT axis; else 0"
    )
    by_name["out_of_reach"] = Layer(out, out, coded, coded)
    return by_name


def _axis_formula(axis: Axis) -> str:
    if axis.count == 1:
        return f"{axis.name} is {axis.low:g} throughout"
    value = shader_axes.unwarp(axis, "t", "text")
    return f"{axis.name}: {value}; the LUT's texture coordinate is {shader_axes.texel('t', axis.count)}"


def out_of_reach(inversion: Inversion) -> np.ndarray:
    """1 where a painted texel is farther from skin than `REACH`, 0.5 where it stands at the LUT's edge, else 0."""
    coded = np.where(inversion.at_edge, np.float32(AT_EDGE), np.float32(0))
    return np.where(inversion.painted, np.where(inversion.residual > REACH, np.float32(BEYOND), coded), np.float32(0))


def statistics(inversion: Inversion) -> dict:
    """CIEDE2000 left in painted texels, and their shares out of reach, at an edge, beyond what PNG ratios hold."""
    residual = inversion.residual[inversion.painted]
    skin = inversion.skin
    beyond = (inversion.melanin > texture_maps.RATIO_RANGE * skin[0]) | (
        inversion.hemoglobin > texture_maps.RATIO_RANGE * skin[2]
    )
    middle, p95 = np.quantile(residual, (0.5, 0.95))
    return {
        "texels": int(residual.size), "delta_e00_mean": float(residual.mean(dtype=float)),
        "delta_e00_median": float(middle), "delta_e00_p95": float(p95), "delta_e00_max": float(residual.max()),
        "out_of_reach_share": float(np.mean(residual > REACH)),
        "at_edge_share": float(np.mean(inversion.at_edge[inversion.painted])),
        "beyond_png_ratio_share": float(np.mean(beyond[inversion.painted])),
    }  # fmt: skip


def write(
    folder: Path, layers: dict[str, Layer], kind: str,
    recolored: np.ndarray | None, alpha: np.ndarray | None, facts: dict,
) -> None:  # fmt: skip
    """Write the maps as 16-bit PNG or float EXR, a recolored albedo [R, C, 3] in linear sRGB, and maps.json."""
    files = {f"{name}.{kind}": layer.png if kind == "png" else layer.exr for name, layer in layers.items()}
    jobs = [(folder / name, layer) for name, layer in zip(files, layers.values(), strict=True)]

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
        for job in waiting:
            job.result()
    document = {"files": files | {"preview.png": "what was given, what the LUT makes of it, the maps"}, **facts}
    (folder / texture_maps.REPORT).write_text(json.dumps(document, indent=1, sort_keys=True) + "\n")


def _write_color(path: Path, linear: np.ndarray, alpha: np.ndarray | None) -> None:
    if path.suffix == ".exr":
        channels = exr.rgb(linear.astype("f4")) | ({} if alpha is None else {"A": alpha.astype("f4")})
        exr.write(path, [exr.Part("recolored", channels, {})], exr.REC709)
        return
    from lutgen import color

    encoded = color.encode_srgb(linear)
    images.write_16_bit(path, encoded if alpha is None else np.concatenate([encoded, alpha[..., None]], axis=-1))
