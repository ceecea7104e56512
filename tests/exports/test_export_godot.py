"""The Godot folder as Godot 4 itself runs it: the official WebAssembly build, in Chromium, from a pack made here."""

import base64
import json
import re
import struct
from dataclasses import replace

import godot_pack
import numpy as np
import pytest
from browser import WEB, node, rings
from PIL import Image

from lutgen import color, exports
from lutgen.exports import godot, lookup
from lutgen.exports import resampled as sources
from lutgen.tables.axes import Axis
from lutgen.tables.lut_set import ColorLut

HALF = 2.0**-11
"""Largest relative rounding of a half float."""
WIDTH, HEIGHT = 40, 25
BASE = {"melanin": 0.05, "eumelanin": 0.35, "hemoglobin": 0.02}
PACKED = """
uniform int channel;
uniform int part;

// 12 of 24 bits of a channel, 4 in each of red, green and blue, in the middle of their steps.
vec3 packed(vec4 values) {
    int whole = min(int(clamp(values[channel], 0.0, 1.0) * 16777215.0 + 0.5), 16777215);
    int bits = part == 0 ? whole >> 12 : whole & 4095;
    return (vec3(float(bits >> 8), float((bits >> 4) & 15), float(bits & 15)) + 0.5) / 16.0;
}
"""
PLANE = """shader_type canvas_item;
render_mode unshaded, blend_disabled;
uniform sampler3D skin_color : filter_linear, repeat_disable;
uniform sampler2D skin_profile : filter_nearest, repeat_disable;
uniform sampler2D points : filter_nearest;
"""
READ = """
void fragment() {
    vec4 point = texelFetch(points, ivec2(FRAGCOORD.xy), 0);
    COLOR = vec4(packed(VALUES), 1.0);
}
"""
RADIUS_MM, SCALE = 8.0, "vec4(8.0, 1.0, 1.0, 1.0)"
"""What a packed radius of 1 stands for."""


@pytest.fixture(scope="module")
def folder(source, tmp_path_factory):
    out = tmp_path_factory.mktemp("godot") / "out"
    exports.export(source.luts, ("godot",), out, None, False, lambda *_: None)
    return out / "godot"


def test_the_folder_imports_itself(folder, source):
    """No project of its own (Godot would skip the folder), no path of ours, and the importer's cut is our slices."""
    names = {path.name for path in folder.iterdir()}
    assert names >= {"skin_color.exr", "skin_color.exr.import", "skin_profile.exr.import", "skin.gdshader", "skin.tscn"}
    assert "project.godot" not in names
    assert (folder / "README.txt").read_text().splitlines()[8].startswith("Error it adds (half floats): color 0.00019")
    for path in folder.iterdir():
        if path.suffix in (".tscn", ".tres", ".import"):
            assert "res://" not in path.read_text()
            assert set(re.findall(r'path="([^"]+)"', path.read_text())) <= names
    kind, suffix, content = godot_pack.imported(folder / "skin_color.exr")
    assert (kind, suffix) == ("CompressedTexture3D", "ctex3d")
    N_h, N_e, N_m = source.grid.shape
    tile = 16 + 6 * N_e * N_m
    assert len(content) == 36 + N_h * tile
    texels = np.stack([np.frombuffer(content, "<f2", 3 * N_e * N_m, 36 + k * tile + 16) for k in range(N_h)])
    assert np.array_equal(texels.reshape(N_h, N_e, N_m, 3), source.own_colors("srgb").astype("f2"))


def test_a_fixed_axis_and_no_preset(source, tmp_path):
    """A set of one eumelanin that covers no preset: a thin volume, no slider, an empty scene."""
    luts, axis = source.luts, Axis("eumelanin", "1", 1.0, 1.0, 1)
    colors = ColorLut(replace(source.grid, eumelanin=axis), luts.color_lut.acescg[:, -1:])
    lut = luts.profile_lut
    shapes = replace(
        lut, grid=replace(lut.grid, eumelanin=axis), shape=lut.shape[:, -1:], clamped_share=lut.clamped_share[:, -1:]
    )
    godot.write(sources.Source(replace(luts, color_lut=colors, profile_lut=shapes), 5), tmp_path)
    text = (tmp_path / "skin.gdshader").read_text()
    assert "uniform float eumelanin = 1.0;" in text
    assert "uniform float melanin : hint_range(0.001, 0.5, 0.0001) = 0.001;" in text
    assert not list(tmp_path.glob("*.tres"))
    assert godot_pack.imported(tmp_path / "skin_color.exr")[2][36 + 4 : 36 + 8] == struct.pack("<HH", 16, 1)


@pytest.fixture(scope="module")
def quantiles(source):
    return np.random.default_rng(1).random(len(source.skins))


@pytest.fixture(scope="module")
def ran(folder, source, quantiles, tmp_path_factory):
    """What Godot shows of the exported scene and reads at 1,000 skins."""
    text = (folder / "skin.gdshader").read_text()
    functions = lookup.text(source, "gdshader")
    assert functions.strip() in text
    whole = text.replace("render_mode ", "render_mode unshaded, ").replace(
        "void fragment()", PACKED + "void fragment()"
    )
    whole = whole.rstrip().removesuffix("}") + "    ALBEDO = packed(vec4(ALBEDO, 1.0));\n}\n"
    plane = PLANE + functions + PACKED + READ
    skins = source.skins
    points = {
        "width": WIDTH, "height": HEIGHT, **BASE,
        "melanin_map": _texels(np.cbrt(skins[:, 0] / BASE["melanin"] / 4)),
        "hemoglobin_map": _texels(np.cbrt(skins[:, 2] / BASE["hemoglobin"] / 4)),
        "points": np.column_stack([skins, quantiles]).ravel().tolist(),
        "shaders": {
            "whole": whole, "color": plane.replace("VALUES", "vec4(lutgen_color(skin_color, point.xyz), 1.0)"),
            "ring": plane.replace("VALUES", f"lutgen_ring(skin_profile, point.w, point.xyz) / {SCALE}"),
        },
    }  # fmt: skip
    files = godot_pack.project(folder, "skin") | {
        "points.json": json.dumps(points).encode(),
        "main.gd": (WEB / "godot_main.gd").read_bytes(),
        "main.tscn": b'[gd_scene format=3]\n[ext_resource type="Script" path="main.gd" id="main"]\n'
        b'[node name="Main" type="Node3D"]\nscript = ExtResource("main")\n',
        "project.godot": b'config_version=5\n[application]\nconfig/name="test"\nrun/main_scene="res://main.tscn"\n'
        b"[display]\nwindow/size/viewport_width=640\nwindow/size/viewport_height=640\n"
        b'[rendering]\nrenderer/rendering_method="gl_compatibility"\n',
        ".godot/global_script_class_cache.cfg": b"list=[]\n",
    }
    place = tmp_path_factory.mktemp("pack")
    (place / "main.pck").write_bytes(godot_pack.pck(files))
    return node("godot.mjs", place, place / "scene.png"), np.asarray(Image.open(place / "scene.png").convert("RGB"))


def _texels(values: np.ndarray) -> list[float]:
    return np.column_stack([values, values, values, np.ones_like(values)]).ravel().tolist()


def pixels(ran, name: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(ran[0][name]), "u1").reshape(-1, 4)[:, :3].astype(int)


def unpacked(ran, name: str) -> np.ndarray:
    """Values [1000, 4] of a packing shader."""
    values = np.zeros((WIDTH * HEIGHT, 4))
    for channel in range(4):
        parts = [pixels(ran, f"{name}_{channel}_{part}") // 16 @ [256, 16, 1] for part in range(2)]
        values[:, channel] = (parts[0] * 4096 + parts[1]) / 16777215
    return values


def test_godot_loads_the_strip_as_a_volume(ran, source):
    assert ran[0]["version"].startswith("4.")
    assert ran[0]["kind"] == ["CompressedTexture3D", *source.grid.shape[::-1], False]


def test_godot_samples_what_the_luts_say(ran, source):
    """`lutgen_color` at 1,000 skins: half precision of the nodes, as in three.js; the packing adds 6e-8."""
    exact = source.luts.color(*source.skins.T)
    assert np.all(np.abs(unpacked(ran, "color")[:, :3] - exact) <= HALF * exact + 1e-6)


def test_godots_rings_are_the_profiles(ran, source, quantiles):
    expected = rings(source, quantiles)
    read = unpacked(ran, "ring") * [RADIUS_MM, 1, 1, 1]
    assert np.all(np.abs(read - expected) <= HALF * expected + 5e-6)


def test_the_exported_shader_by_maps(ran, source):
    """The whole exported shader, sliders times maps: its ALBEDO, decoded as the Compatibility renderer decodes it.

    Half precision as above; the maps' halves of a texel and the decoding add 1e-5.
    """
    exact = source.luts.color(source.skins[:, 0], BASE["eumelanin"], source.skins[:, 2])
    s = unpacked(ran, "whole")[:, :3]
    albedo = s * (s * (s * 0.305306011 + 0.682171111) + 0.012522878)
    assert np.all(np.abs(albedo - exact) <= HALF * exact + 1e-5)


def test_the_exported_material_shows_the_color(ran, source):
    """Unchanged, in even light: the pixels are the sRGB of the LUTs' color."""
    exact = source.luts.color(source.skins[:, 0], BASE["eumelanin"], source.skins[:, 2])
    assert np.abs(pixels(ran, "exported") - 255 * color.encode_srgb(exact)).max() <= 1


def test_the_exported_scene_shows_every_preset(ran, source):
    """The middle of each sphere is its preset's color times what the scene's lights give there, plus gloss."""
    scene, picture = ran
    assert picture.shape == (640, 640, 3)
    assert set(scene["places"]) == {preset.name for preset in source.presets}
    key, rim = (np.array(v) / np.linalg.norm(v) for v in ((-0.6, 0.7, 0.8), (0.9, 0.2, -0.6)))
    for i, preset in enumerate(source.presets):
        x, y = (round(v) for v in scene["places"][preset.name])
        coded = picture[y - 1 : y + 2, x - 1 : x + 2].reshape(-1, 3).mean(axis=0) / 255
        seen = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
        normal = np.array([-0.26 * (i % 3 - 1), -0.26 * (1 - i // 3), 1.5])  # toward the camera
        normal /= np.linalg.norm(normal)
        light = 0.25 + 1.0 * max(normal @ key, 0) + 0.35 * max(normal @ rim, 0)
        gloss = seen - light * preset.linear_srgb
        assert np.all((gloss > -0.005) & (gloss < 0.015)), preset.name
