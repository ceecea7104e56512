"""`lutgen figures`: exact colors of the results of Zhang, Human face rendering: files whole, repeatable and alike."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from chart_files import KINDS, rows_of
from PIL import Image

from lutgen.charts import drawing
from lutgen.charts.document import comparisons, figures, portraits, spectra
from lutgen.errors import InputError, MachineError
from lutgen.render import flat_exits
from lutgen.skin.tissue import PRESETS, Skin, layers, preset
from lutgen.solvers import adding_doubling, direct

NM = list(spectra.nanometers())


@pytest.fixture(scope="module")
def drawn(tmp_path_factory) -> Path:
    """Every figure, its strips three colors long, its portraits small."""
    pytest.importorskip("matplotlib")
    out = tmp_path_factory.mktemp("figures") / "out"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(flat_exits, "EXITS", 8192)
        shown = figures.draw(out, steps=3, size=(22, 27))
    assert {path.stem for path in out.iterdir()} == set(shown)
    return out


@pytest.mark.parametrize(("absorption", "walk"), [("linear", "albedo"), ("exponential", "mixed")])
def test_exact_spectra_are_what_the_documents_walk_gives(absorption, walk):
    skin, nm = preset("source-african"), 450.0
    walked = direct.shares(layers(skin, nm), photons=400_000, seed=1, absorption=walk)
    exact = {a: spectra.spectra([skin], a)[0][NM.index(nm)] for a in spectra.ABSORPTIONS}
    assert abs(walked.diffuse - exact[absorption]) < 4 * walked.diffuse_error
    other = exact[next(a for a in exact if a != absorption)]
    assert abs(walked.diffuse - other) > 20 * walked.diffuse_error


@pytest.mark.parametrize("law", ["source", "donner"])
@pytest.mark.parametrize("epidermis_mm", [0.1, 0.25])
def test_spectra_equal_the_stack_solver(law, epidermis_mm):
    skin = replace(preset("source-asian"), scattering=law, epidermis_mm=epidermis_mm)
    for absorption, more in (("linear", 0), ("exponential", 1)):
        reflectance = spectra.spectra([skin], absorption)[0]
        for nm in (420.0, 550.0, 700.0):
            stack = [replace(x, mu_s_per_mm=x.mu_s_per_mm + more * x.mu_a_per_mm) for x in layers(skin, nm)]
            assert reflectance[NM.index(nm)] == pytest.approx(adding_doubling.stack(stack)[0], abs=1e-5)


def test_an_unknown_absorption_is_refused():
    with pytest.raises(InputError, match="linear, exponential"):
        spectra.spectra([preset("light")], "quadratic")


@pytest.mark.parametrize(
    ("parameter", "first", "last"),
    [
        ("melanin", Skin(0.013, 0.7, 0.005), Skin(0.43, 0.7, 0.005)),
        ("hemoglobin", Skin(0.013, 0.5, 0.001), Skin(0.013, 0.5, 0.1)),
        ("eumelanin", Skin(0.43, 0.0, 0.001), Skin(0.43, 1.0, 0.001)),
    ],
)
def test_sweeps_are_the_documents(parameter, first, last):
    skins = spectra.sweep(parameter, 7)
    assert (skins[0], skins[-1], len(skins)) == (first, last, 7)
    places, words = spectra.ticks(parameter, 7)
    assert (places[0], places[-1]) == (0, pytest.approx(6))
    assert words[0] == spectra.percent(getattr(first, parameter), parameter)


def test_every_figure_comes_as_svg_png_and_csv(drawn):
    names = {path.stem for path in drawn.iterdir()}
    assert {path.name for path in drawn.iterdir()} == {f"{n}.{kind}" for n in names for kind in KINDS}
    assert names == {
        "sweep-melanin", "sweep-hemoglobin", "sweep-eumelanin", "skin-types", "scattering-curves", "scattering-colors",
        "presets", "published", "portraits",
    }  # fmt: skip
    for name in names:
        assert len(rows_of(drawn, name)) > 1
        assert b"dc:date" not in (drawn / f"{name}.svg").read_bytes()


@pytest.mark.parametrize(
    "name",
    ["sweep-melanin", "sweep-hemoglobin", "sweep-eumelanin", "skin-types", "scattering-colors", "presets", "published"],
)
def test_the_picture_shows_the_colors_of_its_table(drawn, name):
    pixels = np.asarray(Image.open(drawn / f"{name}.png").convert("RGB")).reshape(-1, 3)
    shown, count = np.unique(pixels @ [65536, 256, 1], return_counts=True)
    areas = dict(zip(shown.tolist(), count.tolist(), strict=True))
    pipelines = ("source", "default") if name.startswith(("sweep", "skin")) else ("default",)
    for row in rows_of(drawn, name):
        for pipeline in pipelines:
            if row[f"srgb_{pipeline}"]:
                assert areas.get(int(row[f"srgb_{pipeline}"][1:], 16), 0) > 1000


def test_exponential_absorption_is_brighter_and_most_on_dark_skin(drawn):
    rows = rows_of(drawn, "skin-types")
    light = {(r["skin"], r["absorption"]): float(r["L_default"]) for r in rows}
    bias = [light[t, "exponential"] - light[t, "linear"] for t in ("Caucasian", "Asian", "African")]
    assert 0 < bias[0] < bias[1] < bias[2]
    at_450 = {r["absorption"]: float(r["R450nm"]) for r in rows if r["skin"] == "African"}
    assert at_450["linear"] == pytest.approx(0.006662, abs=5e-6)  # reference_two_layer.csv, line A, 450 nm, m .43
    assert at_450["exponential"] > 2 * at_450["linear"]


def test_tables_tell_laws_and_sources(drawn):
    for row in rows_of(drawn, "scattering-curves"):
        assert float(row["source_per_mm"]) == pytest.approx(2 * float(row["bashkatov_per_mm"]), rel=1e-5)
    laws = {row["scattering"]: float(row["delta_e00_to_source"]) for row in rows_of(drawn, "scattering-colors")}
    assert laws["source"] == 0 < min(v for law, v in laws.items() if law != "source")
    published = rows_of(drawn, "published")
    petrov = next(row for row in published if row["published"].startswith("Petrov"))
    assert petrov["status"] == "not found"
    assert not petrov["srgb_default"]
    printed = {r["skin"]: r for r in published if r["parameters"] == "printed"}
    for name, values in comparisons.DONNER_JENSEN.items():
        assert tuple(float(printed[name][key]) for key in ("melanin", "eumelanin", "hemoglobin")) == values
    assert {row["preset"] for row in rows_of(drawn, "presets")} == set(PRESETS)


def test_portraits_grow_calmer_with_samples_and_are_as_bright_as_their_skin(drawn):
    rows = {(r["preset"], r["textures"], int(r["samples"])): r for r in rows_of(drawn, "portraits")}
    assert len(rows) == 3 * (2 * 3 + 1)
    for name in comparisons.TYPES:
        own = f"source-{name.lower()}"
        for kind in (portraits.BARE, portraits.TEXTURED):
            noise = [float(rows[own, kind, n]["noise_delta_e00"]) for n in portraits.SAMPLES]
            assert noise == sorted(noise, reverse=True)
            assert noise[0] / noise[2] == pytest.approx((150 / 20) ** 0.5, rel=0.35)  # sigma of 4 estimates is rough
        shares = [float(rows[own, kind, 150]["brightness"]) for kind in (portraits.BARE, portraits.TEXTURED)]
        assert shares[1] < shares[0]  # brows, lips and lashes
    brightness = [float(rows[f"source-{n.lower()}", portraits.BARE, 150]["brightness"]) for n in comparisons.TYPES]
    assert brightness == sorted(brightness, reverse=True)
    pixels = np.asarray(Image.open(drawn / "portraits.png").convert("L"))
    assert (pixels < 60).mean() > 0.1  # the heads' dark backdrop


def test_portraits_are_left_out_where_there_is_no_opencl(tmp_path, monkeypatch):
    monkeypatch.setattr(portraits.ocl, "devices", lambda: ())
    assert portraits.portraits(tmp_path).startswith("left out: no OpenCL device")
    assert not list(tmp_path.iterdir())


def test_the_same_numbers_give_the_same_bytes(drawn, tmp_path):
    figures.sweep_figure(tmp_path, "hemoglobin", 3)
    for kind in KINDS:
        name = f"sweep-hemoglobin.{kind}"
        assert (tmp_path / name).read_bytes() == (drawn / name).read_bytes()


def test_a_folder_with_something_in_it_is_refused(drawn, tmp_path):
    before = sorted(drawn.iterdir())
    with pytest.raises(InputError, match="not an empty folder"):
        figures.draw(drawn, steps=3)
    assert sorted(drawn.iterdir()) == before
    (tmp_path / "file").write_text("mine")
    with pytest.raises(InputError, match="not an empty folder"), drawing.folder(tmp_path / "file"):
        pass
    with pytest.raises(InputError, match="make it first"), drawing.folder(tmp_path / "no" / "such"):
        pass


def interrupted(out: Path) -> None:
    with drawing.folder(out) as folder:
        (folder / "half").write_text("done")
        raise KeyboardInterrupt


def test_a_folder_appears_whole_or_not_at_all(tmp_path):
    pytest.importorskip("matplotlib")
    with pytest.raises(KeyboardInterrupt):
        interrupted(tmp_path / "out")
    assert not list(tmp_path.iterdir())
    (tmp_path / "out").mkdir()
    with drawing.folder(tmp_path / "out") as folder:
        (folder / "whole").write_text("done")
        assert not list((tmp_path / "out").iterdir())
    assert [path.name for path in tmp_path.rglob("*")] == ["out", "whole"]


def test_without_matplotlib_the_message_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MachineError, match=r'pip install "lutgen\[charts\]"'):
        figures.draw(tmp_path / "out")
    assert not list(tmp_path.iterdir())


def test_labels_move_apart_no_more_than_needed():
    random = np.random.default_rng(0)
    for count in (1, 2, 5, 9):
        places = random.uniform(0, 10, count)
        moved = drawing.apart(places, 1.0)
        assert np.array_equal(np.argsort(moved), np.argsort(places))
        assert (np.diff(np.sort(moved)) > 1 - 1e-9).all()
        assert moved.mean() == pytest.approx(places.mean())
    wide = np.array([3.0, 1.0, 9.0])
    assert drawing.apart(wide, 1.0).tolist() == wide.tolist()
