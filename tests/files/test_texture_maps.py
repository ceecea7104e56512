"""Texture maps: encodings, every kind of picture that artists hand over, and one line for what cannot be read."""

import numpy as np
import pytest
from PIL import Image

import lutgen
from lutgen.files import exr, texture_maps
from lutgen.skin import chromophores


def test_ratios_come_back_within_half_a_step():
    ratio = np.linspace(0, 4, 1001)
    back = texture_maps.decode_ratio(texture_maps.encode_ratio(ratio) / 255)
    step = 4 * 3 * (ratio / 4) ** (2 / 3) / 255
    assert np.all(np.abs(back - ratio) <= 0.5 * step + 4 * (1 / 255) ** 2)
    assert texture_maps.decode_ratio(np.array(0.0)) == 0


@pytest.mark.parametrize("size", [(1, 1), (7, 13)])
@pytest.mark.parametrize("mode", ["L", "LA", "RGB", "RGBA", "P", "I;16", "1"])
def test_pictures_of_every_kind_are_read_bottom_row_first(tmp_path, size, mode):
    gray = np.zeros(size[::-1], "u1")
    gray[0] = 255  # the top row
    image = Image.fromarray((gray.astype("u2") * 257) if mode == "I;16" else gray)
    image = image if mode == "I;16" else image.convert(mode)
    image.save(tmp_path / "melanin.png")
    values, as_values = texture_maps.read(tmp_path / "melanin.png")
    assert not as_values
    assert values.shape[:2] == size[::-1]
    assert values[-1].min() == 1
    assert size[1] == 1 or values[0].max() == 0


def test_a_folder_becomes_textures(tmp_path):
    Image.fromarray(texture_maps.encode_ratio(np.full((4, 4), 2.0))).save(tmp_path / "melanin.png")
    exr.write(tmp_path / "hemoglobin.exr", [exr.Part("map", {"Y": np.full((8, 2), 3.0, "f4")}, {})])
    Image.fromarray(np.full((3, 3), 128, "u1")).save(tmp_path / "roughness.png")
    exr.write(tmp_path / "thickness.exr", [exr.Part("map", {"Y": np.full((2, 2), 8.0, "f4")}, {})])
    Image.new("RGB", (5, 5), (255, 188, 0)).save(tmp_path / "albedo.png")
    maps = texture_maps.load(tmp_path)
    assert maps.normal is None
    assert maps.chromophores is not None
    assert maps.chromophores.shape == (8, 4, 3)
    assert maps.chromophores[0, 0] == pytest.approx([2, 1, 3], rel=0.02)
    assert maps.surface is not None
    assert maps.surface[0, 0] == pytest.approx([256 / 255, 1, 1, 8 / 32], abs=1e-3)
    assert maps.albedo is not None
    assert maps.albedo[0, 0] == pytest.approx([1, 0.503, 0], abs=1e-3)


def test_each_map_replaces_one_and_leaves_the_others(tmp_path):
    chromophores = np.broadcast_to(np.array([1.5, 1.0, 2.0]), (4, 4, 3))
    surface = np.broadcast_to(np.array([0.9, 1.1, 0.7, 0.25]), (4, 4, 4))
    under = texture_maps.Maps(chromophores, surface, np.full((4, 4, 3), 128, "u1"))
    Image.fromarray(np.full((8, 2), 51, "u1")).save(tmp_path / "occlusion.png")
    maps = texture_maps.load(tmp_path, under)
    assert maps.surface is not None
    assert maps.surface.shape == (8, 4, 4)
    assert maps.surface[3, 2] == pytest.approx([0.9, 1.1, 0.2, 0.25])
    assert maps.chromophores is not None
    assert np.array_equal(maps.chromophores, chromophores)
    assert maps.normal is under.normal
    Image.fromarray(texture_maps.encode_ratio(np.full((4, 4), 3.0))).save(tmp_path / "melanin.png")
    maps = texture_maps.load(tmp_path, under)
    assert maps.chromophores is not None
    assert maps.chromophores[0, 0] == pytest.approx([3, 1, 2], rel=0.02)
    Image.new("RGB", (4, 4), (200, 150, 120)).save(tmp_path / "albedo.png")
    maps = texture_maps.load(tmp_path, under)
    assert maps.chromophores is not None
    assert maps.chromophores[0, 0] == pytest.approx([3, 1, 1], rel=0.02)  # what was generated lies in the albedo
    (tmp_path / "melanin.png").unlink()
    assert texture_maps.load(tmp_path, under).chromophores is None


def test_what_cannot_be_read_is_one_line(tmp_path):
    with pytest.raises(lutgen.InputError, match="no such folder"):
        texture_maps.load(tmp_path / "none")
    with pytest.raises(lutgen.InputError, match="holds none of melanin"):
        texture_maps.load(tmp_path)
    (tmp_path / "melanin.png").write_bytes(b"\x89PNG broken")
    with pytest.raises(lutgen.InputError, match=r"melanin\.png: not a picture"):
        texture_maps.load(tmp_path)
    exr.write(tmp_path / "melanin.exr", [exr.Part("map", {"Y": np.full((2, 2), np.nan, "f4")}, {})])
    with pytest.raises(lutgen.InputError, match="melanin is there twice"):
        texture_maps.load(tmp_path)
    (tmp_path / "melanin.png").unlink()
    with pytest.raises(lutgen.InputError, match="NaN"):
        texture_maps.load(tmp_path)
    (tmp_path / "melanin.exr").write_bytes(b"v/1\1 broken")
    with pytest.raises(lutgen.InputError, match=r"map .*melanin\.exr: not a whole OpenEXR file, or"):
        texture_maps.load(tmp_path)
    exr.write(tmp_path / "melanin.exr", [exr.Part("map", {"Y": np.full((2, 2), -0.5, "f4")}, {})])
    with pytest.raises(lutgen.InputError, match=r"melanin\.exr: holds negative values, down to -0.5"):
        texture_maps.load(tmp_path)
    (tmp_path / "melanin.exr").unlink()
    Image.fromarray(np.full((2, 2), 70000, "i4")).save(tmp_path / "melanin.tif")
    with pytest.raises(lutgen.InputError, match=r"melanin\.tif: holds integers of 32 bits"):
        texture_maps.load(tmp_path)


def test_float_pictures_hold_values(tmp_path):
    Image.fromarray(np.full((3, 5), 12.8, "f4")).save(tmp_path / "thickness.tif")
    Image.fromarray(np.full((3, 5), 2.5, "f4")).save(tmp_path / "hemoglobin.tiff")
    exr.write(tmp_path / "normal.exr", [exr.Part("map", exr.rgb(np.full((1, 7, 3), 0.5, "f4")), {})])
    maps = texture_maps.load(tmp_path)
    assert maps.surface is not None
    assert maps.surface[0, 0, 3] == pytest.approx(0.4)
    assert maps.chromophores is not None
    assert maps.chromophores[2, 4, 2] == pytest.approx(2.5)
    assert maps.normal is not None
    assert maps.normal.shape == (1, 7, 3)


def test_resizing_keeps_even_values_and_order():
    assert texture_maps.resized(np.full((3, 2), 0.7), 7, 5) == pytest.approx(np.full((7, 5), 0.7))
    ramp = texture_maps.resized(np.array([[0.0, 1.0]]), 1, 8)[0]
    assert np.all(np.diff(ramp) >= 0)
    assert (ramp[0], ramp[-1]) == (0, 1)


def test_ratio_maps_are_named_by_the_chromophores():
    """Files lie below skin, which spells the names; nothing else would tell them apart."""
    assert texture_maps.RATIOS == chromophores.NAMES
