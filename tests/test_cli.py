"""Commands as a user types them: results, one-line errors, exit statuses."""

import hashlib
import json
import os
import shutil
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

import lutgen
from lutgen import cli, color
from lutgen import device as ocl
from lutgen.tables import check, storage


def run(capsys, *arguments):
    status = cli.main([str(a) for a in arguments])
    out, err = capsys.readouterr()
    return status, out, err


def test_bake_info_check(capsys, tmp_path):
    out = tmp_path / "luts"
    status, text, err = run(capsys, "bake", "--quality", "draft", "--photons", 8192, "--out", out, "--quiet")
    assert (status, err) == (0, "")
    assert text.splitlines()[0] == str(out)
    assert "ΔE00 max" in text
    assert sorted(p.name for p in out.iterdir()) == [
        "color.exr",
        "manifest.json",
        "paths.exr",
        "preview.png",
        "profile.exr",
    ]
    with Image.open(out / "preview.png") as picture:
        assert picture.size[0] > 600
    status, text, _ = run(capsys, "info", out)
    assert status == 0
    assert "melanin 0.001 to 0.5 (16, cbrt)" in text
    status, text, _ = run(capsys, "check", out)
    assert status == 0, text
    assert "FAIL" not in text
    status, text, _ = run(capsys, "check", out, "--json")
    assert json.loads(text)["passed"]


def test_an_expanded_set_can_be_saved_shown_and_checked(capsys, draft, tmp_path):
    out = storage.save(draft.expand(oxygenation=0.4, extra_absorbers={"dermis": 0.01}), tmp_path / "pale")
    status, text, _ = run(capsys, "info", out)
    assert status == 0
    assert "oxygenation 0.4" in text
    status, text, _ = run(capsys, "check", out)
    assert status == 0, text


def test_bake_json_is_one_object(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "lutgen.cli", "bake", "--quality", "draft", "--json", "--out", str(tmp_path / "x")],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    result = json.loads(done.stdout)
    assert done.stderr == ""
    assert result["error"]["color"]["delta_e00_max"] < 1.5
    assert {"imports", "trace", "exact totals", "expand", "measure", "write", "total"} <= set(result["seconds"])


def test_recipe_file_and_options_override_each_other_in_order(capsys, tmp_path):
    recipe = tmp_path / "r.toml"
    recipe.write_text('photons = 4096\nwavelengths = "6"\nseed = 3\n')
    status, text, _ = run(capsys, "bake", recipe, "--seed", 4, "--out", tmp_path / "x", "--json")
    assert status == 0
    followed = json.loads(text)["recipe"]
    assert (followed["photons"], followed["wavelengths"], followed["seed"]) == (4096, "6", 4)


def test_swatch_prints_color_and_json(capsys, tmp_path):
    status, text, _ = run(capsys, "swatch", "--preset", "dark", "--png", tmp_path / "dark.png")
    assert status == 0
    assert text.startswith("#")
    status, text, _ = run(capsys, "swatch", "--melanin", 0.158, "--hemoglobin", 0.018, "--json")
    result = json.loads(text)
    assert (len(result["wavelength_nm"]), len(result["reflectance"]), len(result["std_error"])) == (81, 81, 81)
    expected = lutgen.linear_srgb(lutgen.preset("dark"))
    assert result["linear_srgb"] == pytest.approx(expected.tolist(), abs=1e-12)
    assert result["srgb_hex"] == color.hex_code(expected)
    assert np.allclose(color.lab(result["xyz"]), result["lab"])
    picture = Image.open(tmp_path / "dark.png").convert("RGB")
    wanted = tuple(int(result["srgb_hex"][i : i + 2], 16) for i in (1, 3, 5))
    assert wanted in {rgb for _, rgb in picture.getcolors(1 << 24) or []}


def test_swatch_takes_every_setting(capsys):
    def swatch(*more):
        status, text, _ = run(capsys, "swatch", "--preset", "tan", "--json", *more)
        assert status == 0
        return json.loads(text)

    plain, seeded = swatch(), ["--method", "path-table", "--photons", 2048, "--seed"]
    assert swatch(*seeded, 1)["reflectance"] != swatch(*seeded, 2)["reflectance"]
    for more in (
        ["--reading", "literal"],
        ["--scattering", "jacques"],
        ["--oxygenation", 0.2],
        ["--epidermis-mm", 0.25],
    ):
        assert np.abs(np.subtract(swatch(*more)["reflectance"], plain["reflectance"])).max() > 1e-3
    source = swatch("--pipeline", "source")
    expected = lutgen.linear_srgb(lutgen.preset("tan"), pipeline="source")
    assert source["linear_srgb"] == pytest.approx(expected.tolist(), abs=1e-12)
    assert source["linear_srgb"] != plain["linear_srgb"]


def test_an_interrupt_is_one_line_status_130(capsys, monkeypatch):
    def interrupted(_):
        raise KeyboardInterrupt

    monkeypatch.setattr("lutgen.commands.devices.run", interrupted)
    status, _, err = run(capsys, "devices")
    assert status == 130
    assert err.count("\n") == 1


@pytest.mark.parametrize("method", ["path-table", "direct"])
def test_swatch_by_monte_carlo_agrees_with_its_sigma(capsys, method):
    status, text, _ = run(capsys, "swatch", "--preset", "tan", "--method", method, "--photons", 8192, "--json")
    assert status == 0
    estimate, exact = json.loads(text), lutgen.spectrum(lutgen.preset("tan"))
    z = (np.array(estimate["reflectance"]) - exact) / np.array(estimate["std_error"])
    assert np.abs(z).max() < 4.5
    assert 0.6 < z.std() < 1.4


def test_devices_lists_what_is_there(capsys):
    status, text, _ = run(capsys, "devices", "--json")
    assert status == 0
    devices = json.loads(text)["devices"]
    assert devices[0]["lanes"] in (1, 4, 8, 16)


def test_bench_reports_the_trace_and_the_bakes(capsys, monkeypatch):
    from lutgen.tables import bench

    monkeypatch.setattr(bench, "ROUNDS", 1)
    monkeypatch.setattr(bench, "_PHOTONS", {"lanes": 8192, "one lane": 2048})
    status, text, _ = run(capsys, "bench", "--json")
    assert status == 0
    result = json.loads(text)
    assert {"events_per_s", "photons_per_s", "ratio_w1"} <= set(result["trace"])
    assert set(result["bake"]) == {"draft", "standard", "reference"}


BAD = [
    (["bake", "--photons", "0"], "photons = 0: allowed is a whole number 1 to 2147483647"),
    (["bake", "--photons", "many"], "invalid int value: 'many'"),
    (["bake", "--quality", "best"], "quality = 'best': allowed is draft, standard, reference"),
    (["bake", "--wavelengths", "9"], "wavelengths = '9': allowed is 6, 8, 12, 10nm, 5nm"),
    (["bake", "--device", "abacus"], "device = 'abacus': no device matches"),
    (["bake", "absent.toml"], "recipe absent.toml: cannot be read"),
    (["bake", "--quiet", "--out", "/proc/x"], "out = /proc/x"),
    (["swatch"], "--preset or --melanin is needed"),
    (["swatch", "--preset", "pale"], "preset = 'pale': allowed is very-light, light"),
    (["swatch", "--melanin", "nan"], "melanin = nan: allowed is 0.001 to 0.5"),
    (["swatch", "--preset", "light", "--method", "magic"], "method = 'magic': allowed is path-table, adding-doubling"),
    (["swatch", "--preset", "light", "--scattering", "donner", "--method", "path-table"], "use method adding-doubling"),
    (["swatch", "--preset", "light", "--png", "/proc/x.png"], "png = /proc/x.png: cannot be written"),
    (["swatch", "--preset", "light", "--device", "abacus"], "device = 'abacus': no device matches"),
    (["swatch", "--preset", "light", "--photons", "-5"], "photons = -5: allowed"),
    (["swatch", "--preset", ""], "preset = '': allowed is very-light"),
    (["swatch", "--preset", "light", "--saidi-a-per-mm", "9"], "add --scattering saidi"),
    (["swatch", "--preset", "light", "--method", "direct", "--photons", "0"], "photons = 0: allowed"),
    (["fit"], "quote #, with which shells begin a comment"),
    (["fit", "absent.csv"], "'absent.csv': cannot be read (No such file"),
    (["fit", "lab:62,10"], "three numbers with commas are needed"),
    (["fit", "#c0958"], "six hexadecimal digits are needed"),
    (["fit", "srgb:198,136,99"], "r = 198: allowed is 0 to 1; divide by 255"),
    (["fit", "#808080"], "measured color #808080: no skin has it; the nearest of the model, #"),
    (["fit", "lab:62,10,18", "--parameters", "iron"], "parameters = 'iron': allowed is melanin, hemoglobin"),
    (["fit", "lab:62,10,18", "--parameters", "melanin"], "hemoglobin: neither fitted nor fixed"),
    (["fit", "lab:62,10,18", "--parameters", "melanin,melanin"], "melanin is there twice"),
    (["fit", "lab:62,10,18", "--melanin", "0.05", "--hemoglobin", "0.01"], "all is fixed, nothing is left to fit"),
    (["fit", ""], "measured = '': a CSV's path or a color is needed"),
    (["fit", "lab:62,10,18", "--parameters", "melanin,hemoglobin", "--melanin", "0.1"], "both fitted and fixed"),
    (["fit", "lab:62,10,18", "--noise", "nan"], "noise = nan: allowed is 0.001 to 20"),
    (["fit", "lab:62,10,18", "--saidi-a-per-mm", "9"], "add --scattering saidi"),
    (["fit", "lab:62,10,18", "--png", "/proc/x.png"], "png = /proc/x.png: cannot be written"),
    (["bake", "--out", ""], "out = '': the name of a folder is needed"),
    (["bake", "--out", "x" * 300], "the name is too long"),
    (["info", "a\nb"], "a b: no LUT set there"),
    (["info", "/absent"], "/absent: no LUT set there"),
    (["check", "/absent"], "/absent: no LUT set there"),
    (["paint"], "invalid choice: 'paint'"),
]


@pytest.mark.parametrize(("arguments", "message"), BAD, ids=lambda v: " ".join(v) if isinstance(v, list) else "")
def test_bad_input_is_one_line_status_2_and_nothing_written(capsys, tmp_path, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    status, out, err = run(capsys, *arguments)
    assert (status, out) == (2, "")
    assert message in err
    assert err.startswith("lutgen: ")
    assert err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_existing_folder_is_refused_before_any_work(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr("lutgen.tables.bake.bake", None)  # calling it would fail otherwise
    status, _, err = run(capsys, "bake", "--out", tmp_path)
    assert status == 2
    assert "exists" in err
    assert not list(tmp_path.iterdir())


def test_fit_prints_its_figures_and_json(capsys, tmp_path):
    skin = lutgen.Skin(0.03, 0.7, 0.01, oxygenation=0.6)
    nm = np.arange(400, 701, 10)
    data = tmp_path / "skin.csv"
    rows = [f"{w},{v + 1 / 36:.6f}" for w, v in zip(nm, lutgen.spectrum(skin, nm), strict=True)]
    data.write_text("wavelength_nm,reflectance\n" + "\n".join(rows))
    status, text, err = run(capsys, "fit", data, "--specular-included", "--png", tmp_path / "fit.png")
    assert (status, err) == (0, "")
    lines = text.splitlines()
    assert [line.split()[0] for line in lines[:3]] == ["melanin", "hemoglobin", "oxygenation"]
    assert "over 31 wavelengths, 400 to 700 nm; measured #" in text
    with Image.open(tmp_path / "fit.png") as picture:
        assert picture.size == (800, 400)
    status, text, _ = run(capsys, "fit", data, "--specular-included", "--json")
    result = json.loads(text)
    assert result["parameters"] == pytest.approx({"melanin": 0.03, "hemoglobin": 0.01, "oxygenation": 0.6}, rel=0.01)
    assert result["skin"]["melanin"] == result["parameters"]["melanin"]
    assert set(result["sigma"]) == set(result["correlation"]) == set(result["parameters"])
    assert result["delta_e00"] < 0.01
    assert result["rmse"] < 1e-5
    status, text, _ = run(capsys, "fit", data, "--specular-included", "--json", "--oxygenation", 0.6)
    assert set(json.loads(text)["parameters"]) == {"melanin", "hemoglobin"}
    assert json.loads(text)["skin"]["oxygenation"] == 0.6
    status, text, _ = run(capsys, "fit", "lab:62,10,18", "--json", "--parameters", "hemoglobin", "--melanin", 0.02)
    assert set(json.loads(text)["parameters"]) == {"hemoglobin"}
    assert json.loads(text)["rmse"] is None


def test_fit_says_what_it_left_out_and_draws_a_color(capsys, tmp_path):
    status, text, _ = run(capsys, "fit", "#b89985", "--png", tmp_path / "color.png")
    assert status == 0
    assert "±: at a noise of ΔE00 1 in the color" in text
    assert (tmp_path / "color.png").stat().st_size > 3000
    status, text, _ = run(capsys, "fit", "linear:0.71,0.58,0.48")
    assert "note: no skin of the model has this color" in text
    assert "; read as srgb: " in text
    assert "at its bound" in text


def test_no_opencl_is_one_line_status_1(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr(ocl, "devices", lambda: ())
    for arguments in (["devices"], ["bake", "--out", tmp_path / "x"]):
        status, _, err = run(capsys, *arguments)
        assert status == 1
        assert 'pip install "lutgen[cpu]"' in err
        assert err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_full_disk_is_status_1(capsys, tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(storage.exr, "write", full)
    status, _, err = run(capsys, "bake", "--quality", "draft", "--photons", 2048, "--out", tmp_path / "x")
    assert status == 1
    assert "No space left on device" in err
    assert not list(tmp_path.iterdir())


def test_device_is_taken_from_the_environment(monkeypatch):
    monkeypatch.setenv("LUTGEN_DEVICE", "abacus")
    with pytest.raises(lutgen.InputError, match="LUTGEN_DEVICE = 'abacus'"):
        ocl.choose()
    assert ocl.choose("0").name == ocl.devices()[0].name  # what is asked for goes first
    monkeypatch.setenv("LUTGEN_DEVICE", "0")
    assert ocl.choose().name == ocl.devices()[0].name


def test_an_index_is_an_index_even_where_names_hold_the_digit():
    for i, device in enumerate(ocl.devices()):
        assert (ocl.choose(i).platform, ocl.choose(str(i)).name) == (device.platform, device.name)
    with pytest.raises(lutgen.InputError, match="device = '99'"):
        ocl.choose("99")


def test_the_runtime_that_pip_brings_serves_too(tmp_path):
    """[cpu]: found by itself, listed, and a bake on it agrees with adding-doubling."""
    environment = {k: v for k, v in os.environ.items() if k != "LUTGEN_DEVICE"}
    command = [sys.executable, "-m", "lutgen.cli", "bake", "--quality", "draft", "--device", "Intel", "--json", "--out"]
    done = subprocess.run([*command, str(tmp_path / "x")], capture_output=True, text=True, env=environment)
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["error"]["color"]["delta_e00_max"] < 1.5


def test_a_full_disk_under_a_picture_is_status_1(capsys):
    status, _, err = run(capsys, "swatch", "--preset", "light", "--png", "/dev/full")
    assert status == 1
    assert "free some space" in err


def test_a_terminal_without_the_signs_still_gets_its_lines(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "lutgen.cli", "info", str(lutgen.default_luts())],
        capture_output=True, text=True, env=os.environ | {"PYTHONIOENCODING": "ascii"},
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert "E00 max" in done.stdout


@pytest.mark.parametrize("harm", ["nan", "sums", "clamped"])
def test_check_names_the_law_that_a_profile_breaks(draft, draft_dir, tmp_path, harm):
    folder = tmp_path / "set"
    shutil.copytree(draft_dir, folder)
    shape, clamped = draft.profile_lut.shape.copy(), draft.profile_lut.clamped_share.copy()
    if harm == "nan":
        shape[0, 0, 0, 5, 1] = np.nan
    elif harm == "sums":
        shape[1, 1, 1] *= 1.01
    else:
        clamped[0, 0, 0, 2] = 0.02
    harmed = replace(draft, profile_lut=replace(draft.profile_lut, shape=shape, clamped_share=clamped))
    storage.exr.write(folder / "profile.exr", storage._parts(harmed)["profile.exr"])
    facts = json.loads((folder / "manifest.json").read_text())
    facts["files"]["profile.exr"] = hashlib.sha256((folder / "profile.exr").read_bytes()).hexdigest()
    (folder / "manifest.json").write_text(json.dumps(facts))
    failed = {finding.name for finding in check.check(folder) if not finding.passed}
    assert {"nan": "profile values", "sums": "profile sums", "clamped": "clamped share"}[harm] in failed


@pytest.mark.parametrize("harm", ["node", "rise", "nan", "preview", "no preview"])
def test_check_finds_what_is_wrong(capsys, draft, draft_dir, tmp_path, harm):
    folder = tmp_path / "set"
    shutil.copytree(draft_dir, folder)
    if harm == "preview":
        (folder / "preview.png").write_bytes(b"other")
    elif harm == "no preview":
        (folder / "preview.png").unlink()
    else:
        cells = draft.color_lut.acescg.copy()
        if harm == "node":
            cells *= 1.02
        elif harm == "rise":
            cells[3, 2, 5] = cells[3, 2, 4] * 1.1
        else:
            cells[0, 0, 0, 0] = np.nan
        harmed = replace(draft, color_lut=replace(draft.color_lut, acescg=cells))
        storage.exr.write(folder / "color.exr", storage._parts(harmed)["color.exr"])
        facts = json.loads((folder / "manifest.json").read_text())
        facts["files"]["color.exr"] = hashlib.sha256((folder / "color.exr").read_bytes()).hexdigest()
        (folder / "manifest.json").write_text(json.dumps(facts))
    status, text, _ = run(capsys, "check", folder)
    assert status == 2
    assert "FAIL" in text


def test_check_allows_what_chance_allows(draft_dir):
    nodes = next(f for f in check.check(draft_dir) if f.name == "nodes")
    assert nodes.passed
    assert "100 random nodes" in nodes.detail
