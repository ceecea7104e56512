"""The viewer's chart: errors that the laws measure at costs that the bench measures, or a line that says why not."""

import importlib
from types import SimpleNamespace

import chart_files
import pytest

from lutgen.charts.accuracy import chart, viewer_scattering
from lutgen.errors import MachineError

gl, laws, timing = (
    importlib.import_module(f"lutgen.viewer.{n}") for n in ("gl", "measure.scattering_laws", "measure.timing")
)
EXTENT = viewer_scattering.QUICK | {"tones": ("dark",)}


def cost(name: str, taps: int, ratio: float, frames: int = 1):
    return timing.Cost(name, taps, frames, {"surface": 100.0 * ratio}, 100.0 * ratio, ratio, (ratio, ratio))


COSTS = [cost("off", 0, 1.3), cost("medium", 16, 1.6), cost("high", 64, 2.1)]


@pytest.fixture(scope="module")
def rows():
    return viewer_scattering.errors(COSTS, EXTENT)


def test_each_row_has_its_tiers_cost_and_the_laws_errors(rows):
    assert [(row.tier, row.profile) for row in rows] == [
        ("off", viewer_scattering.LUT), ("medium", viewer_scattering.LUT), ("high", viewer_scattering.LUT),
        ("medium", viewer_scattering.BURLEY),
        ("high", viewer_scattering.BURLEY),
    ]  # fmt: skip
    assert [row.ratio for row in rows] == [1.3, 1.6, 2.1, 1.6, 2.1]
    plane = laws.open_plane(importlib.import_module("lutgen").load())
    high = rows[2]
    assert high.ee_portrait == laws.searchlight(plane, "dark", 0.2, 64, places=EXTENT["places"])
    assert high.edge_rms == laws.edge_noise(plane, "dark", 64)
    laws.release(plane)


def test_more_taps_help_the_skins_own_profile_and_not_anothers(rows):
    off, medium, high, burley, burley_high = rows
    assert high.edge_rms < 0.6 * medium.edge_rms < 0.3 * off.edge_rms
    for name in ("ee_close", "ee_portrait", "ee_person"):
        assert getattr(high, name) < 0.05 * getattr(off, name)
        assert getattr(burley_high, name) > 8 * getattr(high, name)
        assert getattr(burley_high, name) == pytest.approx(getattr(burley, name), rel=0.1)


def test_on_its_own_tone_one_burley_is_as_good_as_the_shape_allows():
    own, burley = viewer_scattering.errors(COSTS[-1:], EXTENT | {"tones": ("very-light",)})
    assert (
        2 * max(viewer_scattering._ee(own)) < max(viewer_scattering._ee(burley)) < 0.06
    )  # lutgen/solvers/README.md, Burley: .02 to .06 for skin tones


def test_the_chart_comes_as_svg_png_and_csv_of_its_rows(rows, tmp_path):
    pytest.importorskip("matplotlib")
    viewer_scattering.draw(tmp_path, rows, "some renderer", EXTENT)
    chart_files.holds_only(tmp_path, "viewing", rows)
    svg = (tmp_path / "viewing.svg").read_text()
    for said in ("some renderer", "medium", "high", "one Burley, 0.05 mm", "profile per pixel, 0.5 mm"):
        assert said in svg
    assert "high 2.10 ×" in viewer_scattering.words(rows)
    assert viewer_scattering.words(rows).endswith(f"one Burley at high EE {rows[-1].ee_close:.2g}")


def without(*_, **__):
    raise MachineError("no OpenGL 3.3 (no display); on Debian or Ubuntu: apt-get install -y libegl1 libgl1-mesa-dri")


DRAWN_BY = {
    "speed": "speed", "profile_shapes": "shapes", "settings": "settings", "absorption": "walks",
    "viewer_against_render": "truth",
}  # fmt: skip
"""The function of each module of `lutgen chart` that draws it."""


@pytest.mark.parametrize("missing", ["package", "OpenGL"])
def test_where_it_cannot_be_drawn_the_others_are(missing, tmp_path, monkeypatch):
    pytest.importorskip("matplotlib")
    if missing == "OpenGL":
        monkeypatch.setattr(viewer_scattering.viewer, "viewer", lambda _: SimpleNamespace(context=without))
    else:
        monkeypatch.setattr(viewer_scattering.viewer, "viewer", without)
    for module in (chart.speed, chart.profile_shapes, chart.settings, chart.absorption, chart.viewer_against_render):
        name = DRAWN_BY[module.__name__.split(".")[-1]]
        monkeypatch.setattr(module, name, lambda folder, *_: (folder / "x").write_text("") or "")
    shown = chart.draw(tmp_path / "out", quick=True)
    assert list(shown) == ["speed-accuracy", "profiles", "settings", "walks", "viewing", "truth"]
    assert shown["viewing"].startswith("left out: no OpenGL 3.3 (no display)")
    assert "\n" not in shown["viewing"]
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["x"]


def test_a_fault_while_it_is_drawn_is_not_hidden(tmp_path, monkeypatch):
    monkeypatch.setattr(timing, "costs", without)
    with pytest.raises(MachineError, match="no OpenGL"):
        viewer_scattering.viewing(tmp_path, quick=True)
