"""Speed against accuracy: what is drawn is what was made, and says so."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from chart_files import rows_of

from lutgen import color
from lutgen.charts.accuracy import methods, speed
from lutgen.charts.stability import absorption_bias
from lutgen.skin import tissue
from lutgen.skin.tissue import PRESETS
from lutgen.solvers import adding_doubling

PANEL = methods.jury(2, seed=3)
WHOLE = methods.jury(seed=3)
FEW = replace(PANEL, nodes=PANEL.nodes[::4], chromophores=PANEL.chromophores[:, ::4])
"""A quarter of the nodes, for what is worked out at each of them alone."""


def test_a_jury_of_cells_holds_their_corners_and_skins_inside():
    assert PANEL.skins.shape == (3, 2 * methods.SKINS_PER_CELL)
    assert len(PANEL.nodes) <= 16
    assert PANEL.share == len(PANEL.nodes) / 2048
    melanin, eumelanin, hemoglobin = PANEL.chromophores
    for axis, column in zip(("melanin", "eumelanin", "hemoglobin"), (melanin, eumelanin, hemoglobin), strict=True):
        assert set(column) <= set(getattr(methods.GRID, axis).values)
    for k, skins in enumerate(np.split(PANEL.skins, 2, axis=1)):
        first = methods.bake.random_skins(methods.GRID, 2, 3)
        for axis, drawn, picked in zip(("melanin", "eumelanin", "hemoglobin"), skins, first, strict=True):
            spacing = getattr(methods.GRID, axis)
            assert set(spacing.position(drawn).astype(int)) == {int(spacing.position(picked[k]))}


def test_the_truth_of_a_jury_is_adding_doubling_at_5_nm():
    for i in (0, 50):
        skin = tissue.skin_of(tissue.Chromophores(*PANEL.skins[:, i]), methods.RECIPE.skin)
        R = [adding_doubling.reflectance(tissue.layers(skin, nm)).diffuse for nm in np.arange(380.0, 781.0, 5.0)]
        assert color.delta_e00(color.lab(color.spectrum_to_xyz(R)), PANEL.lab[i]) < 0.01


def test_exact_methods_agree_on_nodes_and_end_at_interpolation():
    factored, tabled = methods.factored("8"), methods.tabled("8")
    assert np.abs(factored - tabled).max() < 2e-5
    alone = methods.one_by_one(methods._stacked, FEW)
    assert np.abs(alone - factored[FEW.nodes]).max() < 1e-9
    floor = methods.judge(methods.tabled("5nm"), WHOLE)
    assert methods.judge(factored, WHOLE) == pytest.approx(floor, abs=0.05)
    assert methods.judge(factored * 1.01, WHOLE)[1] > floor[1] + 0.05


def test_walks_end_at_the_floor_and_err_more_with_fewer_photons():
    few, many = (methods.judge(methods.walked(n, 5), WHOLE) for n in (1024, 65_536))
    floor = methods.judge(methods.tabled("5nm"), WHOLE)
    assert floor[0] - 0.05 < many[0] < few[0] / 3
    anchored = methods.judge(methods.walked(1024, 5, anchored=True), WHOLE)
    assert anchored == pytest.approx(floor, abs=0.05)


def test_mixed_absorption_ends_at_its_bias_and_albedo_does_not():
    """The document's exponential: 32,768 photons at each node still err by what its bias costs."""
    photons = 32_768
    mixed, albedo = (
        methods.one_by_one(lambda s, nm, a=a: methods._drawn(s, nm, a, photons, iter([int(1e4 * s.melanin)])), FEW)
        for a in ("mixed", "albedo")
    )
    expected, exact = (methods.one_by_one(f, FEW) for f in (methods._mixed, methods._stacked))
    weights = np.abs(methods.rule_weights(methods.quadrature.load("8")))
    sigma = np.sqrt(
        exact.max() / photons * (weights**2).sum(axis=0)
    )  # variance of a weight in 0 to 1 is below its mean
    assert np.all(np.abs(mixed - expected) < 4 * sigma)
    assert np.all(np.abs(albedo - exact) < 4 * sigma)


def test_pareto_front():
    points = [(1.0, 5.0), (2.0, 5.0), (2.0, 3.0), (3.0, 4.0), (4.0, 1.0)]
    assert methods.pareto(points) == [0, 2, 4]
    assert methods.pareto(points[::-1]) == [4, 2, 0]


def runs() -> list[methods.Run]:
    """Made-up runs of every method, two seeds of each walk."""
    made_up = [methods.Run("path table, anchored", 9, 0, 1.0, 1.0, True, 9, 0.2, 0.3)]
    for i, method in enumerate(("adding-doubling, factored, 8 wavelengths", "dipole", "multipole")):
        made_up.append(methods.Run(method, 0, 0, 2.0 + i, 0.5, False, 9, 0.2, 0.3))
    for k, method in enumerate(("path table, 8 wavelengths", "path table, 6 wavelengths")):
        for photons, seed in ((1000, 0), (1000, 1), (4000, 0), (4000, 1)):
            made_up.append(methods.Run(method, photons, seed, photons / 9e4, 1.0, True, 9, 1.0 + seed + k, 3.0))
    for absorption in ("albedo", "continuous", "mixed"):
        for photons in (64, 256):
            made_up.append(methods.Run(f"direct, {absorption}", photons, 0, photons / 9, 0.1, False, 9, 1.0, 3.0))
    return made_up


def test_the_chart_and_its_table_hold_every_run_and_floor(tmp_path: Path):
    pytest.importorskip("matplotlib")
    drawn = sorted(runs(), key=lambda run: not run.method.startswith("path table, 8"))
    speed.draw(tmp_path, drawn, {"interpolation between nodes": (0.17, 0.23)})
    rows = rows_of(tmp_path, "speed-accuracy")
    assert len(rows) == len(drawn) + 1
    assert rows[-1]["floor"] == "interpolation between nodes"
    picture = (tmp_path / "speed-accuracy.svg").read_text()
    for method in {run.method for run in drawn}:
        assert method in picture


def test_medians_are_over_seeds_of_one_setting():
    group = [run for run in runs() if run.method == "path table, 8 wavelengths" and run.photons == 1000]
    assert speed._median(group).delta_e00_p95 == 1.5


def test_half_space_is_the_h_function():
    from reference import H_FUNCTION

    for albedo, expected in H_FUNCTION.items():
        assert absorption_bias.half_space(albedo) == pytest.approx(expected, abs=2e-9)


@pytest.fixture(scope="module")
def walked() -> list[absorption_bias.Biased]:
    return absorption_bias.walks(20_000)


def test_walks_with_mixed_absorption_meet_their_closed_form(walked):
    for b in walked:
        assert abs(b.mixed - b.exact_mixed) < 4 * b.mixed_error
        assert abs(b.albedo - b.exact) < 4 * b.albedo_error
    assert walked[-1].exact_mixed > 5 * walked[-1].exact


def test_what_mixed_costs_rises_with_melanin(walked, tmp_path: Path, monkeypatch):
    pytest.importorskip("matplotlib")
    monkeypatch.setattr(absorption_bias, "walks", lambda photons: walked)
    words = absorption_bias.bias(tmp_path, True)
    cost = {row["preset"]: float(row["delta_e00"]) for row in rows_of(tmp_path, "mixed-bias") if row["preset"]}
    assert set(cost) == set(PRESETS)
    fitted = [cost[name] for name in ("very-light", "light", "intermediate", "tan", "brown", "dark")]
    assert fitted == sorted(fitted)
    assert "source-african" in words
