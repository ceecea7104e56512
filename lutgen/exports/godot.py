"""For Godot 4: strips that import themselves as textures, a shader driven by maps, a material per preset, a scene.

No project.godot: Godot ignores a folder that holds one inside another project. Paths are relative, so that the folder
works wherever in a project it is dropped.
"""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

import numpy as np

from lutgen.exports import lookup
from lutgen.exports.engine_textures import slices
from lutgen.exports.resampled import MADE, MEANING, Preset, Report, Source
from lutgen.files import exr
from lutgen.skin.chromophores import NAMES
from lutgen.tables import shader_axes

COLOR, PROFILE, SHADER, SCENE = "skin_color.exr", "skin_profile.exr", "skin.gdshader", "skin.tscn"
_KEPT = {"compress/mode": 3, "compress/high_quality": "false", "compress/hdr_compression": 0,
         "compress/channel_pack": 1, "mipmaps/generate": "false", "mipmaps/limit": -1}  # fmt: skip
"""Texels as they are (VRAM uncompressed), none left out and no mips."""
_PLAIN = {"compress/normal_map": 2, "process/fix_alpha_border": "false", "process/premult_alpha": "false",
          "process/hdr_as_srgb": "false", "process/hdr_clamp_exposure": "false", "process/size_limit": 0,
          "detect_3d/compress_to": 0}  # fmt: skip
"""A 2-D texture that holds numbers: its alpha is one of them, and use on a mesh must not import it anew."""


def write(source: Source, folder: Path) -> Report:
    """Write the strips with their sidecars, the shader, the materials and the scene into a folder."""
    N_h, N_e, N_m = source.grid.shape
    half = source.own_colors("srgb").astype("f2")
    formulas = shader_axes.formulas(source.grid)
    note = {"axes": formulas, "space": "linear Rec. 709"}
    exr.write(folder / COLOR, [exr.Part("color", exr.rgb(slices(half)), note)], exr.REC709)
    table = lookup.profile_texels(source)
    channels = {name: np.ascontiguousarray(table[..., k].astype("f2")) for k, name in enumerate("RGBA")}
    profile_note = {"axes": shader_axes.formulas(source.luts.profile_lut.grid)}
    exr.write(folder / PROFILE, [exr.Part("profile", channels, profile_note)])
    presets = source.presets
    texts = {
        f"{COLOR}.import": sidecar("3d_texture", "CompressedTexture3D",
                                   _KEPT | {"slices/horizontal": N_h, "slices/vertical": 1}),
        f"{PROFILE}.import": sidecar("texture", "CompressedTexture2D", _KEPT | _PLAIN),
        SHADER: shader_text(source), SCENE: scene(presets),
        **{f"skin_{preset.name}.tres": material(preset) for preset in presets},
    }  # fmt: skip
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    error, error_line = lookup.half_error(source, half, table)
    axes = "; ".join(formula.removeprefix("t = ") for formula in formulas.values())
    return Report((
        f"{SCENE}: {len(presets)} spheres, one a preset; skin_PRESET.tres: their materials; {SHADER}: the shader.",
        "Drop the folder into a project: Godot 4 imports the strips by their .import files. Give a material to a mesh.",
        f"{COLOR}: Texture3D {N_m} x {N_e} x {N_h} as {N_h} tiles; half, linear Rec. 709, unclipped.",
        f"x melanin, y eumelanin, z hemoglobin: u = {shader_axes.texel('t', 'N')}; t = {axes}.",
        f"{PROFILE}: columns: quantiles (k + 0.5) / {lookup.QUANTILES}, rows: nodes; R radius in mm, GBA energy within",
        "(lutgen_ring, for your own gather). Maps: a texel t multiplies its slider by 4 t^3; import them lossless.",
        *MEANING,
        error_line,
        MADE,
    ), error)  # fmt: skip


def sidecar(importer: str, kind: str, parameters: dict) -> str:
    """A `.import` file without cache paths: the editor sees that it has to import, and does so by these parameters."""
    lines = "\n".join(f"{key}={value}" for key, value in parameters.items())
    return f'[remap]\n\nimporter="{importer}"\ntype="{kind}"\n\n[params]\n\n{lines}\n'


def shader_text(source: Source) -> str:
    """The shader: its sliders span the set's axes and start at the first preset that the set covers."""
    sliders = []
    axes = source.grid.axes[::-1]
    start = source.presets[0].skin if source.presets else [axis.low for axis in axes]
    for axis, value in zip(axes, start, strict=True):
        span = f" : hint_range({axis.low:.9g}, {axis.high:.9g}, 0.0001)" if axis.count > 1 else ""
        sliders.append(f"uniform float {axis.name}{span} = {float(value)};")
    text = files("lutgen.exports").joinpath("templates", SHADER).read_text(encoding="utf-8")
    functions = lookup.text(source, "gdshader").strip()
    parts = {"SLIDERS": "\n".join(sliders), "FUNCTIONS": functions, "SPECULAR": f"{(1 - source.entry) / 0.08:.3g}"}
    for name, part in parts.items():
        text = text.replace(f"/*{name}*/", part)
    return text


def material(preset: Preset) -> str:
    """A ShaderMaterial of a preset."""
    values = "\n".join(f"shader_parameter/{name} = {v:.9g}" for name, v in zip(NAMES, preset.skin, strict=True))
    return (
        '[gd_resource type="ShaderMaterial" format=3]\n\n'
        f'[ext_resource type="Shader" path="{SHADER}" id="shader"]\n'
        f'[ext_resource type="Texture3D" path="{COLOR}" id="color"]\n\n'
        f'[resource]\nshader = ExtResource("shader")\nshader_parameter/skin_color = ExtResource("color")\n{values}\n'
    )


def scene(presets: list[Preset]) -> str:
    """Spheres in rows of three before a camera, a key light, a rim light, gray surroundings."""
    # No shadow: the Compatibility renderer adds shadowed lights up in sRGB, which burns skin out.
    lines = ["[gd_scene format=3]\n"]
    lines += [f'[ext_resource type="Material" path="skin_{p.name}.tres" id="{p.name}"]' for p in presets]
    lines += [
        '\n[sub_resource type="SphereMesh" id="sphere"]\nradius = 0.11\nheight = 0.22\n',
        '[sub_resource type="Environment" id="gray"]\nbackground_mode = 1',
        "background_color = Color(0.08, 0.08, 0.085, 1)\nambient_light_source = 2",
        "ambient_light_color = Color(1, 1, 1, 1)\nambient_light_energy = 0.25\n",
        '[node name="Skin" type="Node3D"]\n',
        '[node name="Surroundings" type="WorldEnvironment" parent="."]\nenvironment = SubResource("gray")\n',
        _node("Camera", "Camera3D", _looking((0, 0, 1.5)), "fov = 32.0\nnear = 0.1\nfar = 10.0\ncurrent = true"),
        _node("Key", "DirectionalLight3D", _looking((-0.6, 0.7, 0.8)), "light_energy = 1.0"),
        _node("Rim", "DirectionalLight3D", _looking((0.9, 0.2, -0.6)), "light_energy = 0.35"),
    ]
    rows = -(-len(presets) // 3)
    for i, preset in enumerate(presets):
        place = 0.26 * (i % 3 - 1), 0.26 * ((rows - 1) / 2 - i // 3), 0.0
        own = f'mesh = SubResource("sphere")\nsurface_material_override/0 = ExtResource("{preset.name}")'
        lines.append(_node(preset.name, "MeshInstance3D", (np.eye(3), place), own))
    return "\n".join(lines)


def _looking(place) -> tuple[np.ndarray, tuple]:
    """Rotation and place of what stands there and looks at the origin along its own -z."""
    z = np.asarray(place, float) / np.linalg.norm(place)
    x = np.cross([0, 1, 0], z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1), tuple(place)


def _node(name: str, kind: str, stands: tuple, own: str) -> str:
    turn, place = stands
    numbers = ", ".join(f"{v:.9g}" for v in [*np.ravel(turn), *place])
    return f'[node name="{name}" type="{kind}" parent="."]\ntransform = Transform3D({numbers})\n{own}\n'
