"""A MaterialX document with an OpenPBR surface per preset: subsurface color, radius and scale.

OpenPBR's subsurface is a medium: `subsurface_radius` times `subsurface_radius_scale` is its mean free path, its albedo
follows from `subsurface_color`: the mean free path whose profile is the preset's Burley shape is
`burley.mean_free_path_mm`.
"""

from __future__ import annotations

from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from lutgen.exports.resampled import MADE, Preset, Report, Source
from lutgen.solvers import burley

FILE = "skin.mtlx"


def subsurface_color(preset: Preset) -> np.ndarray:
    """Albedo [3] under the dielectric, which the renderer puts over it itself: the color without the entry."""
    return np.clip(preset.linear_srgb / preset.entry, 0, 1)


def mean_free_path_mm(preset: Preset) -> np.ndarray:
    """Mean free path in mm [3] whose profile is the preset's Burley shape."""
    return burley.mean_free_path_mm(preset.burley_d_mm, subsurface_color(preset))


def single_scattering_albedo(color: np.ndarray, g: float = 0.0) -> np.ndarray:
    """Albedo of one scattering event that makes a medium look like `color`, as OpenPBR inverts it."""
    s = 4.09712 + 4.20863 * color - np.sqrt(9.59217 + 41.6808 * color + 17.7126 * color**2)
    return (1 - s**2) / (1 - g * s**2)


def document(presets: list[Preset], mm_per_unit: float = 10.0) -> str:
    """The MaterialX text; lengths in scene units of that many mm."""
    lines = ['<?xml version="1.0"?>', '<materialx version="1.39" colorspace="lin_rec709">']
    for preset in presets:
        name = preset.name.replace("-", "_")
        radius = mean_free_path_mm(preset) / mm_per_unit
        values = {
            "subsurface_weight": ("float", "1"), "subsurface_color": ("color3", _numbers(subsurface_color(preset))),
            "subsurface_radius": ("float", _numbers([radius.max()])),
            "subsurface_radius_scale": ("color3", _numbers(radius / radius.max())),
            "subsurface_scatter_anisotropy": ("float", "0"),
            "specular_ior": ("float", _numbers([preset.refractive_index])),
            "specular_roughness": ("float", "0.45"),
        }  # fmt: skip
        lines.append(f'  <open_pbr_surface name="surface_{name}" type="surfaceshader">')
        lines += [
            f"    <input name={quoteattr(k)} type={quoteattr(t)} value={quoteattr(v)} />"
            for k, (t, v) in values.items()
        ]
        lines.append("  </open_pbr_surface>")
        lines.append(f'  <surfacematerial name="skin_{name}" type="material">')
        lines.append(f'    <input name="surfaceshader" type="surfaceshader" nodename="surface_{name}" />')
        lines.append("  </surfacematerial>")
    return "\n".join([*lines, "</materialx>"]) + "\n"


def _numbers(values) -> str:
    return ", ".join(f"{float(v):.9g}" for v in values)


def write(source: Source, folder: Path) -> Report:
    """Write skin.mtlx into a folder."""
    presets, n, entry = source.presets, source.refractive_index, source.entry
    (folder / FILE).write_text(document(presets), encoding="utf-8")
    error = {p.name: {"burley_ee_difference": p.burley_difference.tolist(), "negative_share": p.clamped_share.tolist()}
             for p in presets}  # fmt: skip
    worst = max(presets, key=lambda p: p.burley_difference.max())
    return Report((
        f"{FILE}: MaterialX 1.39, an OpenPBR surface and material for each of {len(presets)} presets.",
        "Space: linear Rec. 709. Lengths: 1 scene unit is 1 cm; scale subsurface_radius where yours is another.",
        f"subsurface_color: diffuse color without the entry transmission ({entry:.4f}), which the renderer applies "
        "itself.",
        "subsurface_radius * subsurface_radius_scale: mean free path per channel,",
        "d (1.85 - A + 7 |A - 0.8|^3) of the closest Burley shape d and the albedo A (Christensen & Burley 2015).",
        "No axis and no texture: values per preset; for maps use the cube or exr export.",
        f"specular_ior is the skin's {n:g}; specular_roughness 0.45 is a start, not measured.",
        "A renderer's random walk gives its own shape: these numbers set its width.",
        f"Error it adds: {worst.burley_difference.max():.2g} of the light at the wrong radius at most ({worst.name}).",
        MADE,
    ), error)  # fmt: skip
