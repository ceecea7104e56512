"""What Unreal and Unity make of their exports, by readers written from what the engines do, not from the exporter."""

import importlib
import json
import re
import subprocess
from dataclasses import replace

import numpy as np
import OpenImageIO
import pytest

import lutgen
from lutgen import color, exports
from lutgen.cli import main
from lutgen.errors import InputError
from lutgen.exports import lookup
from lutgen.tables.axes import Axis, Grid
from lutgen.tables.lut_set import ColorLut

gl = importlib.import_module("lutgen.viewer.gl")
COUNTS = (5, 3, 4)
"""Melanin, eumelanin, hemoglobin of the asymmetric set: each its own."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("exports") / "all"
    assert main(["export", "--to", "unreal,unity", "--out", str(out)]) == 0
    return out


@pytest.fixture(scope="module")
def asymmetric():
    """A set whose Rec. 709 colors say which node they are: (0.1 + m / 8, 0.1 + e / 4, 0.1 + h / 16)."""
    luts = lutgen.load()
    spacing = ("melanin", "cbrt", 0.001, 0.5), ("eumelanin", "linear", 0.0, 1.0), ("hemoglobin", "cbrt", 0.001, 0.1)
    axes = {
        name: Axis(name, "1", low, high, n, kind) for (name, kind, low, high), n in zip(spacing, COUNTS, strict=True)
    }
    h, e, m = np.indices(COUNTS[::-1])
    rec709 = np.stack([0.1 + m / 8, 0.1 + e / 4, 0.1 + h / 16], axis=-1)
    to_rec709 = color.from_acescg(np.eye(3), "srgb", luts.pipeline)
    return replace(luts, color_lut=ColorLut(Grid(**axes), rec709 @ np.linalg.inv(to_rec709)))


@pytest.fixture(scope="module")
def known(asymmetric, tmp_path_factory):
    out = tmp_path_factory.mktemp("exports") / "known"
    exports.export(asymmetric, ("unreal", "unity"), out, None, False, lambda *_: None)
    return out


def image(path) -> np.ndarray:
    """The pixels of an image file as OpenImageIO reads them, the top row first."""
    file = OpenImageIO.ImageInput.open(str(path))
    assert file, path
    pixels = file.read_image("float")
    file.close()
    return np.asarray(pixels)


def unreal_volume(folder) -> np.ndarray:
    """What Unreal's UpdateSourceFromSourceTexture cuts out of the strip: [z, y, x, 3], y downward."""
    pixels = image(folder / "T_LutgenColor.exr")
    width, height = json.loads((folder / "lutgen.json").read_text())["color"]["tile"]
    across, down = pixels.shape[1] // width, pixels.shape[0] // height
    corners = [((z % across) * width, (z // across) * height) for z in range(across * down)]
    return np.stack([pixels[y : y + height, x : x + width] for x, y in corners])


def meta(path) -> dict:
    """Keys and plain values of a .meta file, sections flattened."""
    return dict(re.findall(r"^[\s-]*(\w+): (\S+)$", path.with_name(path.name + ".meta").read_text(), re.MULTILINE))


def unity_volume(folder) -> np.ndarray:
    """What Unity makes of a flipbook by its .meta: a slice per cell, and y upward from the bottom row: [z, y, x, 3]."""
    pixels = image(folder / "lutgen_color.exr")[::-1]
    settings = meta(folder / "lutgen_color.exr")
    columns, rows = int(settings["flipbookColumns"]), int(settings["flipbookRows"])
    assert rows == 1  # then the order of rows cannot matter
    return np.stack(np.split(pixels, columns, axis=1))


def cube_volume(folder) -> np.ndarray:
    """The table of a .cube, red fastest: [blue, green, red, 3]."""
    lines = (folder / "lutgen_color.cube").read_text().splitlines()
    size = next(int(line.split()[1]) for line in lines if line.startswith("LUT_3D_SIZE"))
    rows = [[float(word) for word in line.split()] for line in lines if line[0].isdigit()]
    return np.array(rows).reshape(size, size, size, 3)


def unreal_profile(folder) -> np.ndarray:
    return image(folder / "T_LutgenProfile.exr")


def unity_profile(folder) -> np.ndarray:
    return image(folder / "lutgen_profile.exr")[::-1]


def sampled(volume: np.ndarray, uvw: np.ndarray) -> np.ndarray:
    """A clamped trilinear fetch [N, 3] at texture coordinates [N, 3], texel i at (i + 0.5) / n, as GPUs define it."""
    colors = np.zeros((len(uvw), 3))
    place = uvw * np.array(volume.shape[2::-1]) - 0.5
    low = np.floor(place).astype(int)
    for corner in np.ndindex(2, 2, 2):
        texel = np.clip(low + corner, 0, np.array(volume.shape[2::-1]) - 1)
        weight = np.where(corner, place - low, 1 - (place - low)).prod(axis=1)
        colors += weight[:, None] * volume[texel[:, 2], texel[:, 1], texel[:, 0]]
    return colors


def coordinates(skins: np.ndarray, counts) -> np.ndarray:
    """Texture coordinates [N, 3] of skins [N, 3] on axes that are even in the cube root, linear, cube root."""
    m, e, h = skins.T
    t = np.stack([(np.cbrt(m) - 0.1) / (np.cbrt(0.5) - 0.1), e, (np.cbrt(h) - 0.1) / (np.cbrt(0.1) - 0.1)], axis=1)
    return (t * (np.array(counts) - 1) + 0.5) / np.array(counts)


@pytest.mark.parametrize(("target", "volume"), [("unreal", unreal_volume), ("unity", unity_volume)])
def test_colors_lie_where_the_engine_looks(known, target, volume):
    texels = volume(known / target)
    assert texels.shape == (*COUNTS[::-1], 3)
    for z, y, x in np.ndindex(texels.shape[:3]):
        assert texels[z, y, x] == pytest.approx([0.1 + x / 8, 0.1 + y / 4, 0.1 + z / 16], abs=1e-3), (x, y, z)


def test_unreals_green_is_down_and_unitys_up(known):
    assert image(known / "unreal/T_LutgenColor.exr")[[0, -1], 0, 1] == pytest.approx([0.1, 0.6], abs=1e-3)
    assert image(known / "unity/lutgen_color.exr")[[0, -1], 0, 1] == pytest.approx([0.6, 0.1], abs=1e-3)


def test_the_cube_runs_red_first(known, asymmetric):
    texels = cube_volume(known / "unity")
    size = len(texels)
    assert size == 9  # twice the finest axis less one: its nodes are among them
    for z, y, x in np.ndindex(size, size, size):
        share = np.array([x * 4, y * 2, z * 3]) / (size - 1)
        assert texels[z, y, x] == pytest.approx(0.1 + share * [1 / 8, 1 / 4, 1 / 16], abs=1e-6)


@pytest.mark.parametrize(
    ("target", "volume", "stated"),
    [
        ("unreal", unreal_volume, lambda error: error["color"]),
        ("unity", unity_volume, lambda error: error["color"]),
        ("unity", cube_volume, lambda error: error["cube"]["color"]),
    ],
)
def test_a_thousand_skins_within_the_stated_error(folder, source, target, volume, stated):
    """Stated is what is measured, and measured here anew: no guess above it."""
    cells = volume(folder / target)
    colors = sampled(cells, coordinates(source.skins, cells.shape[2::-1]))
    error = json.loads((folder / "manifest.json").read_text())["export"]["error"][target]
    off = np.abs(colors - source.luts.color(*source.skins.T)).max()
    assert off == pytest.approx(stated(error)["largest"], rel=1e-3, abs=1e-7)
    assert off < 2e-4


def test_half_a_texel_is_not_lost(known):
    """The ends of the axes are the centers of the outer texels: there a fetch gives the outer nodes and no mix."""
    ends = np.array([[0.001, 0.0, 0.001], [0.5, 1.0, 0.1]])
    for volume, target in ((unreal_volume, "unreal"), (unity_volume, "unity")):
        colors = sampled(volume(known / target), coordinates(ends, COUNTS))
        assert colors == pytest.approx(np.array([[0.1, 0.1, 0.1], [0.6, 0.6, 0.2875]]), abs=1e-3)
        inside = coordinates(ends, COUNTS) * np.array(COUNTS) - 0.5
        assert inside == pytest.approx(np.array([[0, 0, 0], [4, 2, 3]]), abs=1e-12)


def within(own, radius_mm: np.ndarray) -> np.ndarray:
    """Share of each channel's light [N, 3] of a Rec. 709 profile within radii [N]; what is negative counts as none."""
    P = np.concatenate([np.zeros((1, 3)), np.cumsum(np.maximum(own.energy, 0), axis=0)])
    return np.stack([np.interp(radius_mm, own.radius_edges_mm, P[:, c] / P[-1, c]) for c in range(3)], axis=1)


@pytest.mark.parametrize(("target", "profile"), [("unreal", unreal_profile), ("unity", unity_profile)])
def test_profile_rows_are_nodes(folder, source, target, profile):
    """The row of a node: melanin fastest, then eumelanin, then hemoglobin; in it radii and the light within them."""
    rows, grid = profile(folder / target), source.luts.profile_lut.grid
    N_h, N_e, N_m = grid.shape
    assert rows.shape == (N_h * N_e * N_m, 64, 4)
    assert np.all(np.diff(rows[..., 0], axis=1) >= 0)
    for m, e, h in ((0, 0, 0), (3, 1, 2), (9, 3, 7), (1, 2, 5)):
        skin = grid.melanin.values[m], grid.eumelanin.values[e], grid.hemoglobin.values[h]
        own = source.luts.profile(*skin, space="srgb")
        row = rows[m + N_m * (e + N_e * h)]
        assert within(own, row[:, 0]) == pytest.approx(row[:, 1:], abs=1e-5)


def test_rings_within_the_stated_error(folder, source):
    """Between nodes as a shader mixes them: the share of light within each radius against the set's own profile."""
    rows = unreal_profile(folder / "unreal").astype(float)
    stated = json.loads((folder / "manifest.json").read_text())["export"]["error"]["unreal"]["rings"]["largest"]
    grid, worst = source.luts.profile_lut.grid, 0.0
    for skin in source.skins[:100]:
        place = [float(axis.position(v)) for axis, v in zip(grid.axes[::-1], skin, strict=True)]
        mix = np.zeros((64, 4))
        for corner in np.ndindex(2, 2, 2):
            node = [min(int(p) + c, n - 1) for p, c, n in zip(place, corner, grid.shape[::-1], strict=True)]
            share = np.prod([p % 1 if c else 1 - p % 1 for p, c in zip(place, corner, strict=True)])
            mix += share * rows[node[0] + grid.shape[2] * (node[1] + grid.shape[1] * node[2])]
        own = source.luts.profile(*skin, space="srgb")
        seen = mix[:, 0] >= 0.01
        worst = max(worst, np.abs(mix[seen, 1:] - within(own, mix[seen, 0])).max())
    assert worst == pytest.approx(stated, rel=1e-4)
    assert stated < 0.025


def unreal_d_mm(values: dict) -> np.ndarray:
    """Unreal's own way from a Subsurface Profile to the d of Burley's shape, its storage in 16 bits included."""
    albedo = np.clip(values["surface_albedo"], 0.009, 1)
    color = np.clip(values["mean_free_path_color"], 0.009, 1)
    along_normal = 1.85 - albedo + 7 * np.abs(albedo - 0.8) ** 3
    diffuse = 3.5 + 100 * (albedo - 0.33) ** 4
    assert values["enable_burley"]
    assert values["enable_mean_free_path"]
    assert 0.1 <= values["mean_free_path_distance"] <= 50
    path_mm = color * values["mean_free_path_distance"] * diffuse / along_normal * 10 / 0.6
    assert np.all(path_mm < 500)
    stored_mm = np.floor(path_mm * 0.002 * 65536) / 65535 / 0.002
    scale = np.floor(values["world_unit_scale"] * 0.02 * 65536) / 65535 / 0.02
    return scale * stored_mm / diffuse


def half_radius_mm(d_mm: np.ndarray) -> np.ndarray:
    """Radius that holds half the light of (exp(-r/d) + exp(-r/3d)) / 4d, by summing it."""
    x = np.linspace(0, 60, 600_001)
    P = np.cumsum((np.exp(-x) + np.exp(-x / 3)) / 4) * (x[1] - x[0])
    return np.interp(0.5, P, x) * np.asarray(d_mm)


def test_unreals_formula_gives_our_radius_back(folder, source):
    profiles = json.loads((folder / "unreal/lutgen.json").read_text())["subsurface_profiles"]
    assert len(profiles) == len(source.presets) == 9
    for values, preset in zip(profiles.values(), source.presets, strict=True):
        d_mm = unreal_d_mm(values)
        # A step of the stored path, 500/65536 mm, is 0.22 um of d at a scale of 0.1; the scale's own step is 0.05 %.
        ours = preset.burley_d_mm
        assert np.abs(d_mm - ours).max() <= 2.2e-4 + 6e-4 * ours.max()
        assert np.allclose(half_radius_mm(d_mm), half_radius_mm(ours), rtol=6e-4, atol=1.55 * 2.2e-4)
        assert np.allclose(2.5 * d_mm, 2.5 * ours, rtol=6e-4, atol=2.5 * 2.2e-4)
        assert values["ior"] == 1.4
        assert values["surface_albedo"] == pytest.approx(np.clip(preset.linear_srgb, 0.009, 1))


def test_hdrps_formula_gives_our_radius_back(folder, source):
    profiles = json.loads((folder / "unity/lutgen.json").read_text())["profiles"]
    assert len(profiles) == len(source.presets) <= 15
    for values, preset in zip(profiles, source.presets, strict=True):
        color = np.array(values["color"])
        assert color.max() == 1
        assert color.min() > 0
        S = 1 / (values["multiplier"] * color)
        r = np.linspace(0, 20, 200_001)[:, None]
        P = 1 - np.exp(-r * S) / 4 - 3 * np.exp(-r * S / 3) / 4
        half = [np.interp(0.5, P[:, c], r[:, 0]) for c in range(3)]
        assert half == pytest.approx(half_radius_mm(preset.burley_d_mm), rel=1e-3, abs=2e-6)
        assert values["filterRadiusMm"] == pytest.approx(np.interp(0.997, P[:, color.argmax()], r[:, 0]), rel=1e-3)
        assert values["ior"] == 1.4


def test_unitys_settings_keep_the_numbers(folder):
    shape = {"2d": "1", "3d": "8"}
    for name, dimension, pixels, filtering in (
        ("lutgen_color.exr", "3d", "17", "1"), ("lutgen_profile.exr", "2d", "20", "0")
    ):  # fmt: skip
        settings = meta(folder / "unity" / name)
        expected = {
            "textureShape": shape[dimension], "textureFormat": pixels, "filterMode": filtering, "sRGBTexture": "0",
            "enableMipMap": "0", "nPOTScale": "0", "textureCompression": "0", "maxTextureSize": "16384",
            "wrapU": "1", "wrapV": "1", "wrapW": "1", "alphaIsTransparency": "0",
        }  # fmt: skip
        assert settings.items() >= expected.items()


def test_the_same_set_gives_the_same_bytes_and_guids(folder, known, tmp_path):
    out = tmp_path / "again"
    assert main(["export", "--to", "unreal,unity", "--out", str(out)]) == 0
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            assert (out / path.relative_to(folder)).read_bytes() == path.read_bytes(), path.name
    metas = sorted((folder / "unity").rglob("*.meta"))
    guids = [re.findall(r"^guid: ([0-9a-f]{32})$", path.read_text(), re.MULTILINE) for path in metas]
    assert all(len(guid) == 1 for guid in guids)
    assert len({guid[0] for guid in guids}) == len(metas) == 7
    for path in metas:  # a file for each, and the same GUID for another set: references outlive an export
        assert path.with_suffix("").exists()
        other = (known / "unity" / path.relative_to(folder / "unity")).read_text()
        assert other.splitlines()[:2] == path.read_text().splitlines()[:2]


def test_every_folder_explains_itself(folder):
    for name in ("unreal", "unity"):
        lines = (folder / name / "README.txt").read_text().splitlines()
        assert len(lines) == 10
        assert "Error it adds" in lines[8]
        assert "melanin" in "".join(lines[:6])
    assert "/tmp" not in "".join(p.read_text() for p in folder.rglob("*") if p.suffix in (".py", ".cs", ".txt", ".ush"))


@pytest.mark.parametrize("target", ["unreal", "unity"])
def test_a_set_that_no_texture_holds_is_one_line(asymmetric, target, tmp_path):
    axes = (Axis("melanin", "1", 0.001, 0.5, 256, "cbrt"), Axis("eumelanin", "1", 0.0, 1.0, 2),
            Axis("hemoglobin", "1", 0.001, 0.1, 65, "cbrt"))  # fmt: skip
    large = replace(asymmetric, color_lut=ColorLut(Grid(*axes), np.full((65, 2, 256, 3), 0.5)))
    with pytest.raises(InputError) as error:
        exports.export(large, (target,), tmp_path / "out", 31, False, lambda *_: None)
    assert str(error.value).startswith(f"{target}: the color texture is 16640 x 2 texels: allowed is 16384 a side")
    assert "\n" not in str(error.value)
    assert not (tmp_path / "out").exists()


def unreal_include(folder) -> str:
    return (folder / "unreal/lutgen.ush").read_text() + (
        "float3 skin_color(float3 skin) { return lutgen_color(Lut, LutSampler, skin); }\n"
        "float4 skin_ring(float quantile, float3 skin) { return lutgen_ring(Profile, quantile, skin); }\n"
    )


def unreal_nodes(folder) -> str:
    """As Unreal pastes the code of Custom nodes: each into a function with the inputs as parameters."""
    color, ring = ((folder / f"unreal/custom_node_{name}.hlsl").read_text() for name in ("color", "ring"))
    return (
        f"float3 CustomExpression0(Texture3D lut, SamplerState lutSampler, float3 skin)\n{{\n{color}\n}}\n"
        "float4 CustomExpression1(Texture2D profile, SamplerState profileSampler, float quantile, float3 skin)\n"
        f"{{\n{ring}\n}}\n"
        "float3 skin_color(float3 skin) { return CustomExpression0(Lut, LutSampler, skin); }\n"
        "float4 skin_ring(float quantile, float3 skin) "
        "{ return CustomExpression1(Profile, LutSampler, quantile, skin); }\n"
    )


def unity_graph(folder) -> str:
    """As Shader Graph calls a Custom Function, with the structs of its own Texture.hlsl."""
    return (
        "#define UNITY_TEXTURE_INCLUDED\n"
        "struct UnityTexture3D { Texture3D tex; SamplerState samplerstate; };\n"
        "struct UnityTexture2D { Texture2D tex; SamplerState samplerstate; };\n"
        + (folder / "unity/lutgen.hlsl").read_text()
        + "float3 skin_color(float3 skin) { UnityTexture3D lut; lut.tex = Lut; lut.samplerstate = LutSampler;"
        " float3 color; LutgenColor_float(lut, skin, color); return color; }\n"
        "float4 skin_ring(float quantile, float3 skin) { UnityTexture2D p; p.tex = Profile; "
        "p.samplerstate = LutSampler; float4 ring; LutgenRing_float(p, quantile, skin, ring); return ring; }\n"
    )


def unity_include(folder) -> str:
    return unreal_include(folder).replace(
        (folder / "unreal/lutgen.ush").read_text(), (folder / "unity/lutgen.hlsl").read_text()
    )


def compiled(text: str, folder) -> str:
    """The GLSL of a fragment shader in HLSL, by glslang and SPIRV-Cross: what a compiler understood."""
    path = folder / "shader.hlsl"
    path.write_text(
        "Texture3D Lut; SamplerState LutSampler; Texture2D Profile; Texture2D Skins;\n" + text +
        "float4 main(float4 at : SV_Position) : SV_Target\n{\n"
        "    float4 skin = Skins.Load(int3(int2(at.xy), 0));\n"
        "    return skin.w < 0 ? float4(skin_color(skin.xyz), 1) : skin_ring(skin.w, skin.xyz);\n}\n"
    )  # fmt: skip
    spirv = folder / "shader.spv"
    command = ["glslangValidator", "-D", "-V", "-S", "frag", "-e", "main", str(path), "-o", str(spirv)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    command = ["spirv-cross", str(spirv), "--version", "330", "--no-es", "--no-420pack-extension"]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def shaded(glsl: str, volume: np.ndarray, rows: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """What the shader gives [N, 4] for wanted [N, 4]: a skin and -1 (its color) or a quantile (its ring)."""
    context = gl.context()
    vertex = "#version 330\nin vec2 corner; void main() { gl_Position = vec4(corner, 0.0, 1.0); }"
    program = context.program(vertex_shader=vertex, fragment_shader=glsl)
    size = volume.shape[2::-1]
    rgba = np.concatenate([volume, np.ones((*volume.shape[:3], 1))], axis=3).astype("f4")
    lut = context.texture3d(size, 4, rgba.tobytes(), dtype="f4")
    lut.repeat_x = lut.repeat_y = lut.repeat_z = False
    profile = gl.texture((64, len(rows)), 4, "f4", np.ascontiguousarray(rows, "f4").tobytes())
    skins = gl.texture((100, len(wanted) // 100), 4, "f4", np.ascontiguousarray(wanted, "f4").tobytes())
    textures = {"Lut": lut, "Profile": profile, "Skins": skins}
    names = [name for name in program if name.startswith("SPIRV_Cross_Combined")]
    assert len(names) == 3
    bound = {name: next(t for key, t in textures.items() if f"Combined{key}" in name) for name in names}
    corners = context.buffer(np.array([-1, -1, 3, -1, -1, 3], "f4").tobytes())
    array = context.vertex_array(program, [(corners, "2f", "corner")])
    out = gl.texture((100, len(wanted) // 100), 4, "f4")
    target = context.framebuffer([out])
    gl.bind(program, **bound)
    target.use()
    array.render()
    values = gl.read(target).reshape(-1, 4)
    gl.free(program, lut, profile, skins, corners, array, out, target)
    gl.check()
    return values


@pytest.mark.parametrize(
    ("text", "target", "volume", "profile"),
    [
        (unreal_include, "unreal", unreal_volume, unreal_profile),
        (unreal_nodes, "unreal", unreal_volume, unreal_profile),
        (unity_include, "unity", unity_volume, unity_profile),
        (unity_graph, "unity", unity_volume, unity_profile),
    ],
)
def test_the_hlsl_compiles_and_reads_the_set(folder, source, tmp_path, text, target, volume, profile):
    """Compiled and run on the textures as the engine holds them: colors and rings at 1,000 skins."""
    glsl = compiled(text(folder), tmp_path)
    cells, rows = volume(folder / target), profile(folder / target)
    skins = source.skins
    colors = shaded(glsl, cells, rows, np.column_stack([skins, np.full(len(skins), -1.0)]))[:, :3]
    stated = json.loads((folder / "manifest.json").read_text())["export"]["error"][target]["color"]["largest"]
    assert np.abs(colors - source.luts.color(*skins.T)).max() <= stated + 3e-4  # 8 bits of weight in a GPU's filter
    columns = np.random.default_rng(3).integers(0, 64, len(skins))
    rings = shaded(glsl, cells, rows, np.column_stack([skins, (columns + 0.5) / 64]))
    grid = source.luts.profile_lut.grid
    exact = grid.interpolate(rows.reshape(*grid.shape, 64, 4).astype(float), *skins.T)
    assert rings == pytest.approx(exact[np.arange(len(skins)), columns], abs=2e-5, rel=1e-4)


def test_a_fixed_axis_stays_one_texel_thick(asymmetric, tmp_path):
    axis, profile = Axis("eumelanin", "1", 1.0, 1.0, 1), asymmetric.profile_lut
    colors = ColorLut(replace(asymmetric.color_lut.grid, eumelanin=axis), asymmetric.color_lut.acescg[:, -1:])
    grid = replace(profile.grid, eumelanin=axis)
    shapes = replace(profile, grid=grid, shape=profile.shape[:, -1:], clamped_share=profile.clamped_share[:, -1:])
    thin = replace(asymmetric, color_lut=colors, profile_lut=shapes)
    exports.export(thin, ("unreal", "unity"), tmp_path / "out", None, False, lambda *_: None)
    for target, volume in (("unreal", unreal_volume), ("unity", unity_volume)):
        texels = volume(tmp_path / "out" / target)
        assert texels.shape == (COUNTS[2], 1, COUNTS[0], 3)
        assert texels[3, 0, 2] == pytest.approx([0.35, 0.6, 0.2875], abs=1e-3)
    for text in (unreal_nodes, unity_graph):
        assert "texture" in compiled(text(tmp_path / "out"), tmp_path)


def test_a_compiler_refuses_what_is_wrong(folder, tmp_path):
    with pytest.raises(AssertionError, match="error"):
        compiled(unreal_include(folder).replace("lerp(", "mix("), tmp_path)


def test_quantiles_are_as_many_as_the_shader_reads(folder):
    assert unreal_profile(folder / "unreal").shape[1] == lookup.QUANTILES
