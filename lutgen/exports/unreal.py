"""Unreal 5.1 or later: texture strips, HLSL, Subsurface Profile values and an editor script that imports them all.

The engine makes Burley's shape of a profile's values, each channel with its surface albedo A, by
    diffuse mean free path = mean free path S_d(A) / (0.6 S_p(A)),  mean free path = color x distance (cm)
    d = world unit scale x diffuse mean free path / S_d(A)
    S_p(A) = 1.85 - A + 7 |A - 0.8|^3,  S_d(A) = 3.5 + 100 (A - 0.33)^4
(SubsurfaceProfile.cpp, BurleyNormalizedSSS.h and PostProcessSubsurfaceCommon.ush; the scaling factors are Christensen &
Burley 2015, for light along the normal and for the diffuse mean free path; 0.6 is the engine's own), after clamping
albedo and color to 0.009 or more. So a mean free path of 0.6 S_p(A) d gives our d back, whatever S_d is.
The mean free path must be enabled: with it off the engine takes the value for a diffuse one, then converts the profile
and makes the world unit scale 10/3 times larger, to keep the looks of older versions.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from lutgen.exports import engine_textures, lookup
from lutgen.exports.resampled import MADE, MEANING, Preset, Report, Source
from lutgen.files import exr
from lutgen.solvers import burley
from lutgen.tables import shader_axes

COLOR, PROFILE = "T_LutgenColor.exr", "T_LutgenProfile.exr"
LEAST = 0.009
"""What the engine raises an albedo and a mean free path color to."""
WORLD_UNIT_SCALE = 0.1
"""The least that the editor takes: the engine stores paths in steps of 500/65536 mm before this scale."""
LEAST_DISTANCE_CM = 0.1


def subsurface_profile(preset: Preset) -> dict:
    """A preset as the editor properties of a SubsurfaceProfileStruct; lengths in cm, colors in linear Rec. 709.

    The surface albedo is the color itself: the engine's diffuse light does not lose the share that its gloss reflects.
    """
    albedo = np.clip(preset.linear_srgb, LEAST, 1)
    path_cm = 0.6 * burley.mean_free_path_mm(preset.burley_d_mm, albedo) / 10 / WORLD_UNIT_SCALE
    distance = max(float(path_cm.max()), LEAST_DISTANCE_CM)
    return {
        "surface_albedo": albedo.tolist(),
        "mean_free_path_color": np.maximum(path_cm / distance, LEAST).tolist(),
        "mean_free_path_distance": distance,
        "world_unit_scale": WORLD_UNIT_SCALE,
        "enable_burley": True,
        "enable_mean_free_path": True,
        "ior": preset.refractive_index,
    }


def asset_name(preset: str) -> str:
    """The asset of a preset.

    >>> asset_name("very-light")
    'SSP_Lutgen_VeryLight'
    """
    return f"SSP_Lutgen_{engine_textures.capitalized(preset)}"


def write(source: Source, folder: Path) -> Report:
    """Write the strips, the HLSL, the values and the import script into a folder."""
    half = source.own_colors("srgb").astype("f2")
    strip = engine_textures.fits("unreal", "color", engine_textures.slices(half))
    texels = engine_textures.fits("unreal", "profile", lookup.profile_texels(source).astype("f4"))
    axes = shader_axes.formulas(source.grid)
    notes = {"axes": axes, "space": "linear Rec. 709"}
    exr.write(folder / COLOR, [exr.Part("color", exr.rgb(strip), notes)], exr.REC709)
    exr.write(folder / PROFILE, [exr.Part("profile", engine_textures.rgba(texels), {})], exr.REC709)
    (folder / "lutgen.ush").write_text(engine_textures.hlsl(source, _NOTE), encoding="ascii")
    for name in ("color", "ring"):
        (folder / f"custom_node_{name}.hlsl").write_text(lookup.custom_node(source, name), encoding="ascii")
    (folder / "import_lutgen.py").write_text(engine_textures.template("import_lutgen.py.txt"), encoding="ascii")
    N_h, N_e, N_m = source.grid.shape
    values = {
        "color": {"file": COLOR, "tile": [N_m, N_e]},
        "profile": {"file": PROFILE},
        "subsurface_profiles": {asset_name(p.name): subsurface_profile(p) for p in source.presets},
    }
    (folder / "lutgen.json").write_text(json.dumps(values, indent=1) + "\n", encoding="ascii")
    error, worst = engine_textures.errors(source, half, texels)
    n = source.refractive_index
    return Report((
        "import_lutgen.py: run it in the editor (Python Editor Script Plugin, Tools > Execute Python Script; 5.1 or "
        "later): it makes /Game/Lutgen, the textures and a Subsurface Profile per preset (values: lutgen.json).",
        f"{COLOR}: half, linear Rec. 709, unclipped; {N_h} slices of {N_m} x {N_e} along hemoglobin, melanin +x, "
        "eumelanin down; for VT_LutgenColor, a Volume Texture by tile size: no sRGB, no mips, clamp, HDR.",
        f"{PROFILE}: float, {lookup.QUANTILES} x {len(texels)}: row = node, melanin fastest; column = quantile; R "
        "is a radius in mm, G B A the share of red, green, blue light within it.",
        "custom_node_*.hlsl: code of Custom nodes: inputs lut, skin (float3 out) or profile, quantile, skin (float4);"
        " or lutgen.ush in PROJECT/Shaders, included as /Project/lutgen.ush. Skin: melanin, eumelanin, hemoglobin.",
        f"Axis warp: {'; '.join(axes.values())}; half texel: u = {shader_axes.texel('t', 'n')}; both in the "
        "HLSL.",
        "Subsurface Profile: color * distance * world unit scale = 0.6 (1.85 - A + 7 |A - 0.8|^3) d in cm, A the color,"
        f" d the closest Burley shape's; mean free path must stay enabled; IOR {n:g} (the engine's own is 1.55).",
        *MEANING,
        f"Error it adds: color {error['color']['largest']:.2g} (half floats); of the light at the wrong radius: rings "
        f"{error['rings']['largest']:.2g}, Subsurface Profiles {worst:.2g} at most (Burley's shape).",
        MADE,
    ), error)  # fmt: skip


_NOTE = """Skin color and scattering from LUTs made by lutgen, for Custom nodes: include path /Project/lutgen.ush.
Code, with the texture object VT_LutgenColor as input lut or T_LutgenProfile as input profile:
    return lutgen_color(lut, lutSampler, skin);
    return lutgen_ring(profile, quantile, skin);"""
