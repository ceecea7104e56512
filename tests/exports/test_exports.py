"""What every export has, and what real readers of .cube and OpenEXR make of it."""

import importlib
import json
from dataclasses import replace

import numpy as np
import pytest

from lutgen import exports
from lutgen.cli import main
from lutgen.tables.axes import Axis
from lutgen.tables.lut_set import ColorLut

PyOpenColorIO, OpenImageIO = (importlib.import_module(name) for name in ("PyOpenColorIO", "OpenImageIO"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("exports") / "all"
    assert main(["export", "--to", "cube,exr", "--out", str(out)]) == 0
    return out


def added(folder) -> dict:
    return json.loads((folder / "manifest.json").read_text())["export"]["error"]


def test_every_folder_explains_itself(folder):
    for name in ("cube", "exr"):
        lines = (folder / name / "README.txt").read_text().splitlines()
        assert len(lines) == 10
        assert "Error it adds" in lines[8]
        assert json.loads((folder / name / "manifest.json").read_text())["export"]["targets"] == ["cube", "exr"]


def test_opencolorio_reads_the_cube(folder, source):
    """1,000 random skins, trilinear, within the error that the export states."""
    transform = PyOpenColorIO.FileTransform(
        str(folder / "cube" / "skin.cube"), interpolation=PyOpenColorIO.INTERP_LINEAR
    )
    processor = PyOpenColorIO.Config.CreateRaw().getProcessor(transform).getDefaultCPUProcessor()
    pixels = np.ascontiguousarray(source.coordinates(source.skins), "f4")
    processor.applyRGB(pixels)
    stated = added(folder)["cube"]["color"]["largest"]
    off = np.abs(pixels - source.luts.color(*source.skins.T)).max()
    assert off <= stated + 1e-6
    assert off >= 0.5 * stated  # stated is what is measured, not a guess above it


def read_by_oiio(path) -> np.ndarray:
    image = OpenImageIO.ImageInput.open(str(path))
    assert image is not None, OpenImageIO.geterror()
    pixels = image.read_image("float")
    image.close()
    return pixels


def test_openimageio_reads_every_picture_of_every_target(tmp_path, source):
    out = tmp_path / "all"
    assert main(["export", "--to", "all", "--out", str(out)]) == 0
    pictures = sorted([*out.rglob("*.exr"), *out.rglob("*.png")])
    assert {path.parent.name for path in pictures} == {"exr", "unreal", "unity", "godot", "preintegrated"}
    for path in pictures:
        assert np.all(np.isfinite(read_by_oiio(path))), path
    N_h, N_e, N_m = source.grid.shape
    color = source.luts.color(*source.skins.T)
    for target, name in (("unreal", "T_LutgenColor.exr"), ("godot", "skin_color.exr"), ("unity", "lutgen_color.exr")):
        tiles = read_by_oiio(out / target / name)[..., :3]
        tiles = tiles[::-1] if target == "unity" else tiles  # Unity counts rows from the bottom
        cells = tiles.reshape(N_e, N_h, N_m, 3).transpose(1, 0, 2, 3)
        off = np.abs(source.grid.interpolate(cells, *source.skins.T) - color).max()
        assert off <= added(out)[target]["color"]["largest"] + 1e-6


def test_openimageio_reads_the_strips(folder, source):
    for name, space in (("color_rec709.exr", "srgb"), ("color_acescg.exr", "acescg")):
        image = OpenImageIO.ImageInput.open(str(folder / "exr" / name))
        assert str(image.spec().format) == "half"
        strip = image.read_image("float")
        image.close()
        N_h, N_e, N_m = source.grid.shape
        assert strip.shape == (N_h, N_e * N_m, 3)
        t = source.coordinates(source.skins)
        x, tile, y = t[:, 0] * (N_m - 1), t[:, 1] * (N_e - 1), t[:, 2] * (N_h - 1)
        colors = np.zeros((len(t), 3))
        for dx, de, dy in np.ndindex(2, 2, 2):
            low = [np.minimum(v.astype(int), n - 2) for v, n in ((x, N_m), (tile, N_e), (y, N_h))]
            parts = zip((dx, de, dy), (x, tile, y), low, strict=True)
            weight = np.prod([v - k if d else 1 - v + k for d, v, k in parts], axis=0)
            colors += weight[:, None] * strip[low[2] + dy, (low[1] + de) * N_m + low[0] + dx]
        stated = added(folder)["exr"][name]["largest"]
        assert np.abs(colors - source.luts.color(*source.skins.T, space=space)).max() <= stated + 1e-6


def test_a_default_size_holds_the_sets_own_nodes(source):
    assert exports.nested_size(source.luts) == 31
    cells, own = source.colors("srgb"), source.own_colors("srgb")
    assert np.abs(source.cubic.interpolate(cells, *source.grid.nodes()) - own).max() < 2e-3
    ends = cells[::30, ::30, ::30]
    assert ends == pytest.approx(own[::15, ::7, ::15], abs=1e-12)


def test_a_fixed_axis_becomes_a_cube_too(tmp_path, source):
    luts, grid = source.luts, source.grid
    fixed = replace(grid, eumelanin=Axis("eumelanin", "1", 1.0, 1.0, 1))
    thin = replace(luts, color_lut=ColorLut(fixed, luts.color_lut.acescg[:, -1:]))
    exports.export(thin, ("cube",), tmp_path / "out", 5, False, lambda *_: None)
    rows = [line for line in (tmp_path / "out/cube/skin.cube").read_text().splitlines() if line[0].isdigit()]
    assert len(rows) == 125
    cube = np.array([[float(v) for v in row.split()] for row in rows]).reshape(5, 5, 5, 3)
    assert np.all(cube == cube[:, :1])
    assert cube[-1, 0, -1] == pytest.approx(luts.color(0.5, 1.0, 0.1).clip(0, 1), abs=1e-6)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--to", "blender"], "to = 'blender': allowed is cube, exr"),
        (["--to", ","], "allowed is cube, exr"),
        (["--to", "cube", "--size", "257"], "size = 257"),
        (["--to", "cube", "--size", "1"], "size = 1"),
        (["--to", "cube", "nowhere"], "nowhere"),
        (["--to", "cube", "--out", "here"], "here: exists; give another folder, or --force"),
        (["--to", "cube", "--out", "no/where"], "there is no folder"),
        (["--to", "cube", "--out", "/proc/out"], "cannot be written"),
    ],
)
def test_bad_input_is_one_line(arguments, message, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "here").mkdir()
    options = arguments if "--out" in arguments else [*arguments, "--out", "out"]
    assert main(["export", *options]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert {path.name for path in tmp_path.iterdir()} == {"here"}


def test_force_replaces_an_export_and_nothing_else(tmp_path):
    out = tmp_path / "out"
    assert main(["export", "--to", "exr", "--out", str(out)]) == 0
    assert main(["export", "--to", "exr", "--out", str(out), "--force"]) == 0
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "work.txt").write_text("")
    assert main(["export", "--to", "exr", "--out", str(tmp_path / "mine"), "--force"]) == 2
    assert (tmp_path / "mine" / "work.txt").exists()
