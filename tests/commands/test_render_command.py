"""`lutgen render`: pictures from the command line, going on, stopping, and one line for what it cannot do."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from lutgen import device as ocl
from lutgen.cli import main
from lutgen.files import exr
from lutgen.render import flat_exits

SMALL = ["--size", "32x32", "--set", "distance_mm=900"]


@pytest.fixture(autouse=True)
def _few_exits(monkeypatch):
    monkeypatch.setattr(flat_exits, "EXITS", 8192)


@pytest.fixture(scope="module")
def head(tmp_path_factory) -> str:
    """A ball of the size of a head, without texture coordinates."""
    path = tmp_path_factory.mktemp("head") / "ball.glb"
    trimesh.creation.icosphere(3, 110).export(path)
    return str(path)


def run(capsys, *arguments: str) -> dict:
    """What a render says as JSON."""
    assert main(["render", *SMALL, *arguments, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_a_picture_holds_what_it_is_and_how_sure(tmp_path, head, capsys):
    out, png = str(tmp_path / "a.exr"), str(tmp_path / "a.png")
    report = run(capsys, "--mesh", head, "--spp", "20", "--out", out, "--png", png, "--preset", "dark")
    assert report["samples"] == 20
    assert report["rays"] == sum(report["counts"][name] for name in ("CAMERA_RAYS", "PROBES", "SUN_RAYS", "SKY_RAYS"))
    assert report["rays_per_s"] > 0
    assert report["events_per_s"] > 0
    assert {"tree", "exits", "sample", "write"} <= set(report["seconds"])
    (part,) = exr.read(Path(out)).values()
    assert {*"RGB", "mask", "samples", "sigma.R", "sigma.G", "sigma.B"} <= set(part.channels)
    assert all(np.all(np.isfinite(values)) for values in part.channels.values())
    assert np.all(part.channels["samples"] == 20)
    assert part.channels["mask"].max() == 1
    assert part.channels["mask"].min() == 0
    made_of = part.attributes["render"]
    assert made_of["samples"] == 20
    assert made_of["recipe"]["look"]["melanin"] == 0.158
    assert made_of["walk"]["exits_per_wavelength_and_angle"] == 8192
    with Image.open(png) as image:
        assert image.size == (32, 32)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.exr", "a.png"]


def test_the_same_command_goes_on_and_another_one_is_refused(tmp_path, head, capsys):
    out = str(tmp_path / "a.exr")
    first = run(capsys, "--mesh", head, "--spp", "10", "--out", out)
    more = run(capsys, "--mesh", head, "--spp", "25", "--out", out, "--set", "exposure=1")
    assert (first["samples"], more["samples"]) == (10, 25)
    assert more["counts"]["CAMERA_RAYS"] == 15 * 32 * 32
    same = run(capsys, "--mesh", head, "--spp", "25", "--out", out)
    assert same["samples"] == 25
    assert same["rays"] == 0
    (part,) = exr.read(Path(out)).values()
    for name in ("CAMERA_RAYS", "PROBES", "MISSES", "REJECTED"):
        assert part.attributes["render"]["counts"][name] == first["counts"][name] + more["counts"][name]
    before = Path(out).read_bytes()
    for changed, message in (
        (["--set", "melanin=0.05"], "look.melanin 0.0195, now 0.05"), (["--seed", "3"], "seed 0, now 3"),
        (["--mm-per-unit", "1.1"], "head "), (["--size", "16x16"], "size [32, 32], now [16, 16]"),
        (["--environment", "none"], "environment studio, now "),
    ):  # fmt: skip
        assert main(["render", *SMALL, "--mesh", head, "--spp", "30", "--out", out, *changed]) == 2
        error = capsys.readouterr().err
        assert "was rendered with other options" in error
        assert message in error
        assert error.count("\n") == 1
    assert Path(out).read_bytes() == before
    again = run(capsys, "--mesh", head, "--spp", "10", "--out", out, "--seed", "3", "--force")
    assert again["samples"] == 10


def test_a_killed_render_goes_on_and_an_interrupted_one_saves(tmp_path, head):
    """SIGKILL leaves a whole file of a moment before; Ctrl-C saves what there is and says so."""
    out = tmp_path / "a.exr"
    code = (
        "import sys; from lutgen.render import progressive, flat_exits;"
        "progressive.SAVE_SECONDS = 0.2; flat_exits.EXITS = 8192;"
        "from lutgen.cli import main; sys.exit(main(sys.argv[1:]))"
    )
    command = [sys.executable, "-c", code, "render", *SMALL, "--mesh", head, "--time", "300s", "--out", str(out)]

    def started() -> subprocess.Popen:
        before = out.stat().st_mtime_ns if out.exists() else 0
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        until = time.monotonic() + 60
        while not (out.exists() and out.stat().st_mtime_ns > before) and time.monotonic() < until:
            assert process.poll() is None, process.communicate()
            time.sleep(0.05)
        return process

    process = started()
    process.kill()
    process.communicate()
    first = next(iter(exr.read(out).values())).attributes["render"]["samples"]
    assert first > 0
    process = started()
    process.send_signal(signal.SIGINT)
    report, _ = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "interrupted; the same command goes on" in report
    assert next(iter(exr.read(out).values())).attributes["render"]["samples"] > first


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--spp", "0"], "spp = 0: allowed is a whole number 1 to"),
        (["--time", "soon"], "time = 'soon': seconds are needed, for example 60s"),
        (["--time", "0s"], "time = 0: allowed is 0.1 to"),
        (["--noise", "0"], "noise = 0: allowed is 0.01 to 100 (ΔE00)"),
        (["--noise", "nan"], "noise = nan"),
        (["--size", "8x8"], "size = 8x8: allowed is 16 to 4096"),
        (["--walk", "random"], "walk = 'random': allowed is flat"),
        (["--seed", "-1"], "seed = -1"),
        (["--out", "a.png"], "out = a.png: the name of a file ending in .exr is needed"),
        (["--out", "none/a.exr"], "there is no folder none; make it first"),
        (["--out", "folder.exr"], "is a folder"),
        (["--png", "folder.png"], "png = folder.png: is a folder"),
        (["--png", "a.jpg"], "png = a.jpg: the name of a file ending in .png is needed"),
        (["--set", "melanin=0.7"], "melanin = 0.7: allowed is"),
        (["--device", "none such"], "no device matches"),
        (["--mesh", "none.glb"], "there is no such file"),
        (["--set", "distance_mm=40"], "back faces: it is inside the head"),
    ],
)
def test_bad_input_is_one_line(arguments, message, tmp_path, head, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.exr").mkdir()
    (tmp_path / "folder.png").mkdir()
    assert main(["render", *SMALL, "--quiet", "--spp", "5", "--out", "a.exr", "--mesh", head, *arguments]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["folder.exr", "folder.png"]


def test_a_set_that_does_not_cover_the_skin_is_one_line(tmp_path, head, capsys):
    import lutgen
    from lutgen.tables import storage

    narrow = lutgen.bake({
        "photons": 2048, "wavelengths": "6",
        "color": {"melanin": {"low": 0.01, "high": 0.05, "count": 4}},
    })  # fmt: skip
    folder = storage.save(narrow, tmp_path / "narrow")
    assert main(["render", str(folder), *SMALL, "--mesh", head, "--spp", "5", "--out", str(tmp_path / "a.exr"),
                 "--preset", "dark"]) == 2  # fmt: skip
    error = capsys.readouterr().err
    assert "melanin = 0.158: allowed is 0.01 to 0.05" in error
    assert error.count("\n") == 1
    assert run(capsys, str(folder), "--mesh", head, "--spp", "5", "--out", str(tmp_path / "b.exr"))["samples"] == 5


def test_without_opencl_the_line_says_what_to_install(tmp_path, head, capsys, monkeypatch):
    monkeypatch.setattr(ocl, "devices", lambda: ())
    assert main(["render", *SMALL, "--mesh", head, "--spp", "5", "--out", str(tmp_path / "a.exr")]) == 1
    error = capsys.readouterr().err
    assert "no OpenCL device" in error
    assert error.count("\n") == 1


def test_triangles_that_run_both_ways_are_said(tmp_path, capsys):
    ball = trimesh.creation.icosphere(3, 110)
    ball.faces[::5] = ball.faces[::5, ::-1]
    ball.export(tmp_path / "mixed.glb")
    command = ["render", *SMALL, "--mesh", str(tmp_path / "mixed.glb"), "--spp", "5", "--out", str(tmp_path / "a.exr")]
    assert main(command) == 0
    assert "% of what the camera sees are back faces: triangles run both ways round" in capsys.readouterr().out


def test_what_is_odd_about_a_head_is_said(tmp_path, capsys):
    inside_out = trimesh.creation.icosphere(2, 1100)
    inside_out.invert()
    inside_out.export(tmp_path / "ball.glb")
    out = str(tmp_path / "a.exr")
    command = ["render", "--size", "16x16", "--mesh", str(tmp_path / "ball.glb"), "--spp", "5", "--out", out]
    command += ["--set", "distance_mm=4000"]
    assert main([*command, "--mm-per-unit", "1"]) == 0
    report = capsys.readouterr().out
    assert "triangles ran clockwise" in report
    assert "the head is 2200 mm high" in report
    assert "has no texture coordinates" in report
    assert (
        main([*command, "--mm-per-unit", "0.1", "--set", "target_mm=900,0,0", "--set", "field_of_view=5", "--force"])
        == 0
    )
    assert "no head is in the picture" in capsys.readouterr().out


def test_a_place_that_cannot_be_written_is_said_before_any_work(tmp_path, head, capsys):
    (tmp_path / "file").write_text("")
    assert main(["render", *SMALL, "--mesh", head, "--out", str(tmp_path / "file" / "a.exr")]) == 2
    assert "make it first" in capsys.readouterr().err
