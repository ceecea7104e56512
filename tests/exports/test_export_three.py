"""The KTX2 files, the GLSL and the page, as ktx-parse, three.js and Chromium read them."""

import base64
import json
from itertools import pairwise

import numpy as np
import pytest
from browser import node, rings
from PIL import Image

from lutgen import color
from lutgen.cli import main
from lutgen.exports import lookup
from lutgen.tables import shader_axes

HALF = 2.0**-11
"""Largest relative rounding of a half float."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("three") / "out"
    assert main(["export", "--to", "three,cube,exr", "--out", str(out)]) == 0
    return out


def own(source) -> np.ndarray:
    return source.own_colors("srgb")


def test_ktx_parse_reads_both_textures(folder, source):
    """Header, descriptor and metadata as KTX 2.0 has them, and every texel."""
    color_file, profile = node("ktx.mjs", folder / "three/skin_color.ktx2", folder / "three/skin_profile.ktx2")
    N_h, N_e, N_m = source.grid.shape
    for file, size, primaries in ((color_file, (N_m, N_e, N_h), 1), (profile, (64, 512, 0), 0)):
        assert file["vkFormat"] == 97
        assert (file["pixelWidth"], file["pixelHeight"], file["pixelDepth"]) == size
        assert (file["typeSize"], file["layerCount"], file["faceCount"], file["supercompressionScheme"]) == (2, 0, 1, 0)
        assert len(file["pixels"]) == 1
        assert file["keyValue"]["KTXwriter"].startswith("lutgen ")
        assert json.loads(file["keyValue"]["lutgen.axes"]) == shader_axes.formulas(source.grid)
        (block,) = file["descriptor"]
        assert (block["vendorId"], block["descriptorType"], block["versionNumber"]) == (0, 0, 2)
        assert (block["colorModel"], block["colorPrimaries"], block["transferFunction"]) == (1, primaries, 1)
        assert block["bytesPlane"] == [8, 0, 0, 0, 0, 0, 0, 0]
        assert [s["bitOffset"] for s in block["samples"]] == [0, 16, 32, 48]
        assert [s["channelType"] for s in block["samples"]] == [0xC0, 0xC1, 0xC2, 0xCF]
        assert all(s["bitLength"] == 15 for s in block["samples"])
    texels = np.frombuffer(base64.b64decode(color_file["pixels"][0]), "<f2").reshape(N_h, N_e, N_m, 4)
    assert np.array_equal(texels[..., :3], own(source).astype("f2"))
    assert np.all(texels[..., 3] == 1)
    rows = np.frombuffer(base64.b64decode(profile["pixels"][0]), "<f2").reshape(512, 64, 4)
    assert np.array_equal(rows, lookup.profile_texels(source).astype("f2"))


def test_the_readme_states_the_error(folder):
    lines = (folder / "three/README.txt").read_text().splitlines()
    assert len(lines) == 10
    assert lines[8].startswith("Error it adds (half floats): color 0.00019")


def test_the_files_lie_as_the_specification_asks(folder):
    """Level data starts at a multiple of a texel, where the index says, and ends with the file."""
    for name, size in (("skin_color.ktx2", 8), ("skin_profile.ktx2", 8)):
        data = (folder / "three" / name).read_bytes()
        start, length, plain = np.frombuffer(data[80:104], "<u8")
        assert start % size == 0
        assert start + length == len(data)
        assert length == plain
        descriptor, long = np.frombuffer(data[48:56], "<u4")
        assert np.frombuffer(data[descriptor : descriptor + 4], "<u4") == long == 4 + 24 + 4 * 16


@pytest.fixture(scope="module")
def read(folder, source, tmp_path_factory):
    quantiles = np.random.default_rng(1).random(len(source.skins))
    points = {
        "skins": source.skins.tolist(), "coordinates": source.coordinates(source.skins).tolist(),
        "quantiles": quantiles.tolist(), "size": source.size, "counts": list(source.grid.shape[::-1]),
    }  # fmt: skip
    path = tmp_path_factory.mktemp("points") / "points.json"
    path.write_text(json.dumps(points))
    return node("three.mjs", folder, path), quantiles


def values(read, name) -> np.ndarray:
    return np.array(read[0][name]).reshape(-1, 4)


def test_three_js_samples_what_the_luts_say(read, source):
    """KTX2Loader, EXRLoader and LUTCubeLoader at 1,000 skins: half precision of the nodes, nothing else.

    Node errors of 2^-11 of a value, mixed with weights that sum to 1, are 2^-11 of the mixed value; floats add 1e-6.
    The cube has floats and adds the resampling that the export states. SwiftShader filters with whole floats (measured:
    3e-7 off the formula); a GPU's 8-bit filter weights may add 2^-9 of neighbors' differences, 3e-4 here.
    """
    assert read[0]["shape"] == [True, *source.grid.shape[::-1], "srgb-linear"]
    exact = source.luts.color(*source.skins.T)
    for name in ("color", "strip"):
        assert np.all(np.abs(values(read, name)[:, :3] - exact) <= HALF * exact + 1e-6), name
    cells = np.clip(source.colors("srgb"), 0, 1)
    cube = source.cubic.interpolate(cells, *source.skins.T)
    assert values(read, "cube")[:, :3] == pytest.approx(cube, abs=1e-6)
    assert values(read, "cube")[:, :3] == pytest.approx(exact, abs=2e-4)


def test_the_glsl_reads_rings(read, source):
    """`lutgen_ring` mixes the table's nodes and columns; the widest channel's energy is the quantile that was asked."""
    ring, quantiles = values(read, "ring"), read[1]
    expected = rings(source, quantiles)
    assert np.all(np.abs(ring - expected) <= HALF * expected + 5e-6)
    assert ring[:, 1:].min(axis=1) == pytest.approx(np.clip(quantiles, 0.5 / 64, 63.5 / 64), abs=1e-5)


@pytest.fixture(scope="module")
def shown(folder, tmp_path_factory):
    pictures = tmp_path_factory.mktemp("page")
    return node("page.mjs", folder / "three/skin.html", pictures / "page.png"), pictures


def test_the_page_follows_the_sliders(shown, folder, source):
    """Dragged by mouse, offline: the swatch on the screen is the LUTs' color within 2/255, and the note tells it."""
    page, _ = shown
    assert [url for url in page["asked"] if not url.startswith("file:")] == []
    assert len(page["asked"]) == 1
    assert (folder / "three/skin.html").stat().st_size < 1.5e6
    skins = [step["skin"] for step in page["steps"]]
    for step in page["steps"]:
        exact = 255 * color.encode_srgb(source.luts.color(*step["skin"]))
        assert np.abs(np.array(step["pixel"]) - exact).max() <= 2, step
        assert step["told"] == "#" + bytes(step["pixel"]).hex().upper()
    moved = [np.flatnonzero(np.array(a) != b).tolist() for a, b in pairwise(skins)]
    assert moved[:4] == [[0], [1], [2], [0]]  # a drag moves its own slider and no other
    assert skins[4][0] == pytest.approx(0.001)  # the end of the track is the end of the axis
    presets = {preset.name: preset.skin for preset in source.presets}
    assert skins[5:] == [list(presets["dark"]), list(presets["very-light"])]


def test_the_page_shows_a_lit_head(shown):
    """Scattering moves light, so it changes the picture, red most, and hardly its mean."""
    pictures = [np.asarray(Image.open(shown[1] / name).convert("RGB"), float) for name in ("page.png", "page_flat.png")]
    head = [picture[40:180, 60:165] for picture in pictures]  # a head and little else
    assert all(part.mean() > 60 for part in head)
    assert all(part.std() > 15 for part in head)
    red, green, blue = np.abs(head[0] - head[1]).mean(axis=(0, 1))
    assert red > 0.2
    assert red > 2 * green > 2 * blue
    assert head[0].mean() == pytest.approx(head[1].mean(), rel=0.01)
