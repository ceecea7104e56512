"""Unity: a flipbook and a .cube with import settings, HLSL, HDRP Diffusion Profile values and an editor importer.

HDRP draws Burley's shape with D = scattering color x multiplier in mm per channel (world scale: meters per unit) as
S = 1/D, cut at the radius that holds 99.7 % of the widest channel, 16.56 D, in 20, 40 or 80 samples by quality
(DiffusionProfileSettings.cs); it holds 15 profiles beside the neutral one. So the color is our d over its largest
channel, the multiplier that largest. Unity counts rows from the bottom: the lowest eumelanin, and node 0 of the
profiles, are the last row in the file.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np

from lutgen.errors import InputError
from lutgen.exports import cube, engine_textures, lookup
from lutgen.exports.resampled import MADE, MEANING, Preset, Report, Source
from lutgen.files import exr
from lutgen.tables import shader_axes

COLOR, PROFILE, CUBE = "lutgen_color.exr", "lutgen_profile.exr", "lutgen_color.cube"
IMPORTER = "Editor/LutgenImporter.cs"
PROFILES = 15
FILTER_RADIUS = 16.56
"""Radius that holds 99.7 % of Burley's shape, in units of D."""
HALF, FLOAT = 17, 20
"""TextureImporterFormat.RGBAHalf and RGBAFloat."""
TEXTURE_2D, TEXTURE_3D = 1, 8
POINT, BILINEAR = 0, 1
"""Values of TextureImporterShape and FilterMode."""


def guid(name: str) -> str:
    """The GUID of a file of this export, the same each time: what refers to the file survives another export.

    >>> guid("lutgen.hlsl")
    '18d462d32de62ebc863c9db8c7bb7cc8'
    """
    return hashlib.md5(f"lutgen/unity/{name}".encode(), usedforsecurity=False).hexdigest()


def diffusion_profile(preset: Preset) -> dict:
    """A preset as an HDRP Diffusion Profile: color x multiplier is Burley's d in mm."""
    widest = float(preset.burley_d_mm.max())
    return {
        "name": f"Lutgen{engine_textures.capitalized(preset.name)}",
        "color": (preset.burley_d_mm / widest).tolist(),
        "multiplier": widest,
        "ior": preset.refractive_index,
        "filterRadiusMm": FILTER_RADIUS * widest,
    }


def write(source: Source, folder: Path) -> Report:
    """Write textures, .meta files, HLSL, values and the importer into a folder."""
    presets = source.presets
    if len(presets) > PROFILES:
        raise InputError(f"unity: {len(presets)} presets: HDRP holds {PROFILES} Diffusion Profiles")
    N_h, N_e, N_m = source.grid.shape
    half = source.own_colors("srgb").astype("f2")
    flipbook = engine_textures.fits("unity", "color", engine_textures.slices(half))
    texels = engine_textures.fits("unity", "profile", lookup.profile_texels(source).astype("f4"))
    axes = shader_axes.formulas(source.grid)
    notes = {"axes": axes, "space": "linear Rec. 709"}
    exr.write(folder / COLOR, [exr.Part("color", exr.rgb(flipbook[::-1]), notes)], exr.REC709)
    exr.write(folder / PROFILE, [exr.Part("profile", engine_textures.rgba(texels[::-1]), {})], exr.REC709)
    text, values = cube.text(source, "lutgen skin")
    (folder / CUBE).write_text(text, encoding="ascii")
    (folder / "lutgen.hlsl").write_text(engine_textures.hlsl(source, _NOTE, _GRAPH), encoding="ascii")
    (folder / IMPORTER).parent.mkdir()
    (folder / IMPORTER).write_text(engine_textures.template("LutgenImporter.cs"), encoding="ascii")
    described = {
        "columns": N_h,
        "size": [N_m, N_e, N_h],
        "corners": half[np.ix_(*((0, n - 1) for n in half.shape[:3]))].astype(float).ravel().tolist(),
        "profiles": [diffusion_profile(preset) for preset in presets],
    }
    (folder / "lutgen.json").write_text(json.dumps(described, indent=1) + "\n", encoding="ascii")
    metas = {
        COLOR: _texture_meta(TEXTURE_3D, N_h, HALF, BILINEAR), PROFILE: _texture_meta(TEXTURE_2D, 1, FLOAT, POINT),
        "Editor": "folderAsset: yes\n", CUBE: "", "lutgen.hlsl": "", "lutgen.json": "", IMPORTER: "",
    }  # fmt: skip
    for name, settings in metas.items():
        meta = f"fileFormatVersion: 2\nguid: {guid(name)}\n{settings}"
        (folder / f"{name}.meta").write_text(meta, encoding="ascii")
    error, worst = engine_textures.errors(source, half, texels)
    error["cube"] = cube.error(source, values)
    n = source.refractive_index
    return Report((
        "Put the folder into Assets (2021.3 or later), then Tools > Lutgen > Import: textures, a Texture3D of the .cube"
        " and, where HDRP is installed, a Diffusion Profile per preset (values: lutgen.json).",
        f"{COLOR}: half, linear Rec. 709, unclipped; a flipbook of {N_h} columns (hemoglobin), {N_m} x {N_e} each: "
        "melanin right, eumelanin up. Its .meta makes it a Texture3D: linear, no mips, clamp, RGBAHalf.",
        f"{PROFILE}: float, {lookup.QUANTILES} x {len(texels)}: row from the bottom = node, melanin fastest; column = "
        "quantile; R is a radius in mm, G B A the share of red, green, blue light within it.",
        f"{CUBE}: {source.size} nodes an axis, clipped to 0 to 1; R G B = melanin, eumelanin, hemoglobin after the "
        f"warp. lutgen.hlsl is for the textures; its Lutgen*_float for Shader Graph's Custom Function (File).",
        f"Axis warp: {'; '.join(axes.values())}; half texel: u = {shader_axes.texel('t', 'n')}; both are in "
        "lutgen.hlsl.",
        "Diffusion Profile: scattering color * multiplier = D in mm of the closest Burley shape, 1 unit = 1 m, "
        f"IOR {n:g}; filter radius {FILTER_RADIUS} D; 20, 40 or 80 samples by quality; at most {PROFILES} profiles in "
        "a scene.",
        *MEANING,
        f"Error it adds: color {error['color']['largest']:.2g} (half floats), .cube "
        f"{error['cube']['color']['largest']:.2g}; of the light at the wrong radius: rings "
        f"{error['rings']['largest']:.2g}, Diffusion Profiles {worst:.2g} at most (Burley's shape).",
        MADE,
    ), error)  # fmt: skip


def _texture_meta(shape: int, columns: int, pixels: int, filtering: int) -> str:
    """The settings of a TextureImporter: no sRGB, no mips, clamp, no resizing, no compression."""
    flag = int(shape == TEXTURE_3D)  # readable, so that the importer can look at the corners
    return f"""TextureImporter:
  serializedVersion: 11
  mipmaps:
    enableMipMap: 0
    sRGBTexture: 0
    linearTexture: 0
  isReadable: {flag}
  streamingMipmaps: 0
  maxTextureSize: {engine_textures.LIMIT}
  textureSettings:
    serializedVersion: 2
    filterMode: {filtering}
    aniso: 0
    mipBias: 0
    wrapU: 1
    wrapV: 1
    wrapW: 1
  nPOTScale: 0
  alphaUsage: 1
  alphaIsTransparency: 0
  textureType: 0
  textureShape: {shape}
  flipbookRows: 1
  flipbookColumns: {columns}
  platformSettings:
  - serializedVersion: 3
    buildTarget: DefaultTexturePlatform
    maxTextureSize: {engine_textures.LIMIT}
    resizeAlgorithm: 0
    textureFormat: {pixels}
    textureCompression: 0
    compressionQuality: 50
    crunchedCompression: 0
    allowsAlphaSplitting: 0
    overridden: 0
"""


_NOTE = """Skin color and scattering from LUTs made by lutgen.
lutgen_color(lut, sampler, skin): lut is lutgen_color.exr as a Texture3D, skin = (melanin, eumelanin, hemoglobin).
lutgen_ring(profile, quantile, skin): profile is lutgen_profile.exr.
In Shader Graph: a Custom Function node of type File with this file and the name LutgenColor or LutgenRing."""
_GRAPH = """
#ifdef UNITY_TEXTURE_INCLUDED
void LutgenColor_float(UnityTexture3D Lut, float3 Skin, out float3 Color)
{
    Color = lutgen_color(Lut.tex, Lut.samplerstate, Skin);
}

void LutgenRing_float(UnityTexture2D Profile, float Quantile, float3 Skin, out float4 Ring)
{
    Ring = lutgen_ring(Profile.tex, Quantile, Skin);
}
#endif
"""
