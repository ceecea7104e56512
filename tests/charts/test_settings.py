"""`lutgen chart`, the settings: each is measured apart from the others, and noise is not taken for an error."""

from functools import cache
from pathlib import Path

import chart_files
import numpy as np
import pytest

import lutgen
from lutgen.charts.accuracy import settings
from lutgen.planning.stored_paths import at_rule
from lutgen.solvers import profiles
from lutgen.solvers.paths import interpolation_matrix
from lutgen.tables import expand, wavelengths

EDGES = profiles.ring_edges()
NAMES = ("wavelengths", "axes", "profile-axes")
SKINS = (np.array([0.0127, 0.0734, 0.43]), np.array([0.7, 0.2, 0.7]), np.array([0.0077, 0.05, 0.005]))


@pytest.fixture(scope="module")
def exact():
    return settings.exact_paths()


@pytest.fixture(scope="module")
def drawn(tmp_path_factory) -> tuple[Path, str]:
    """The folder of the quick charts, and what they are said to show."""
    pytest.importorskip("matplotlib")
    folder = tmp_path_factory.mktemp("settings")
    return folder, settings.settings(folder, quick=True)


def rows_of(drawn: tuple[Path, str], name: str) -> list[dict]:
    rows = chart_files.rows_of(drawn[0], name)
    return [{k: v if k in ("rule", "nodes") else _number(v) for k, v in row.items()} for row in rows]


def _number(cell: str) -> float | str:
    try:
        return float(cell)
    except ValueError:
        return cell


def test_exact_colors_are_those_of_the_solver(exact):
    """Without photons: within the 3e-6 of reflectance that lutgen/solvers/exact_totals.py promises."""
    table, weights = at_rule(exact, "5nm")
    colors = settings.acescg(table, weights, SKINS)[..., 0]
    for melanin, eumelanin, hemoglobin, rgb in zip(*SKINS, colors, strict=True):
        skin = lutgen.Skin(float(melanin), float(eumelanin), float(hemoglobin))
        spectrum = lutgen.spectrum(skin, method="adding-doubling")
        assert rgb == pytest.approx(spectrum @ weights, abs=1e-5)


def test_a_table_errs_nowhere_at_its_nodes_and_half_by_its_rounding(exact):
    """Half rounds a channel by 2**-11 at most, float by 2**-24; between the nodes both err more."""
    table, weights = at_rule(exact, "5nm")
    nodes = settings.grid((5, 3, 4), "cbrt", "linear")
    at_nodes, between = (v.ravel() for v in nodes.nodes()), settings._skins(50)
    off = {}
    for name, skins in (("nodes", tuple(at_nodes)), ("between", between)):
        truth = settings.acescg(table, weights, skins)[..., 0]
        rows = settings.table_rows(
            ((5, 3, 4),), skins, "error",
            lambda grid: expand.color_cells(table, grid, settings._absorbers(table), weights),
            lambda colors, truth=truth: np.abs(colors / truth - 1),
        )  # fmt: skip
        off |= {(name, row["stored"]): row["error_max"] for row in rows if row["spacing"] == settings.CUBE_ROOT}
        assert {row["bytes"] for row in rows} == {5 * 3 * 4 * 12, 5 * 3 * 4 * 6}
    assert off["nodes", "float"] <= 2.0**-24 * 1.1
    assert 2.0**-12 < off["nodes", "half"] <= 2.0**-11
    assert off["between", "float"] > 0.05


def test_traced_paths_between_their_wavelengths_are_right(exact):
    """Interpolated in wavelength, totals stay within 5 sigma of exact ones; sigma interpolated the same way."""
    few = settings.traced_paths(2**14, seed=3).totals()
    mu = expand.coefficients(wavelengths.load("8").wavelength_nm, settings._absorbers(at_rule(few, "8")[0]), *SKINS)
    mean, truth = (at_rule(paths, "8")[0].evaluate(*mu)[:, 0] for paths in (few, exact))
    across = interpolation_matrix(few.wavelength_nm, wavelengths.load("8").wavelength_nm)
    sigma = np.zeros_like(mean)
    for k in range(len(mean)):
        pair = [np.repeat(values[k : k + 1], settings.TRACE_WAVELENGTHS, axis=0) for values in mu]
        sigma[k] = np.sqrt(across[k] ** 2 @ few.std_error(*pair)[:, 0] ** 2)
    assert (np.abs(mean - truth) < 5 * sigma).all()
    assert (sigma < 0.03 * truth.max()).all()


def test_rules_err_as_their_file_says_and_noise_cancels(monkeypatch):
    """Other skins and paths than the file's: p95 within 15 % and 3 noises. Noise is far below that of the profiles."""
    monkeypatch.setattr(settings, "traced_paths", cache(settings.traced_paths))
    skins = settings._skins(60)
    off, noise = settings.profile_errors(2**16, skins)
    stored = np.array([wavelengths.load(rule).profile_error[0] for rule in settings.RULES])
    p95, noise_p95 = (np.percentile(values, 95, axis=1) for values in (off, noise))
    assert (np.abs(p95 - stored) < 0.15 * stored + 3 * noise_p95).all()
    seeds = (at_rule(settings.traced_paths(2**16, seed), "8") for seed in settings.TRACE_SEEDS)
    first, second = (np.maximum(settings.acescg(*table, skins), 0) for table in seeds)
    apart = profiles.ee_difference(first, second, EDGES)
    own = np.percentile(apart.max(axis=-1) / 2, 95)
    assert noise_p95[settings.RULES.index("8")] < own / 5


def test_each_way_of_keeping_halves_loses_what_its_format_loses():
    rng = np.random.default_rng(0)
    shapes = rng.dirichlet(np.full(64, 0.1), 200)
    kept = list(settings.roundings(shapes).values())
    normal = shapes >= 2.0**-14
    assert (~normal).any()
    assert (np.abs(kept[0] / shapes - 1)[normal] <= 2.0**-11).all()
    assert (np.abs(kept[0] - shapes)[~normal] <= 2.0**-25).all()
    assert (kept[1][shapes < 2.0**-14 * (1 - 2.0**-11)] == 0).all()
    assert (kept[1][normal] == kept[0][normal]).all()
    within = np.abs(np.cumsum(kept[2], axis=1) - np.cumsum(shapes, axis=1))
    assert 2.0**-13 < within.max() <= 2.0**-12 * 1.001
    area = np.pi * np.diff(EDGES**2)
    assert (kept[3] <= 65_504 * area * 1.0001).all()
    fits = (shapes / area < 65_504) & (shapes / area >= 2.0**-14)
    assert (np.abs(kept[3] / shapes - 1)[fits] <= 2.0**-11 * 1.001).all()


def test_the_far_light_is_what_lies_beyond_a_thousandth():
    shape = np.array([[0.9, 0.0985, 0.001, 0.0005], [0.5, 0.5, 0.0, 0.0]])
    rounded = np.array([[0.9, 0.0985, 0.001, 0.002], [0.5, 0.5, 0.0, 0.0]])
    beyond = 0.003 / 1.0015 / 0.0015 - 1
    assert settings.far_errors(shape, rounded) == pytest.approx([beyond, 0])
    assert settings.far_errors(shape, 3 * shape) == pytest.approx([0, 0])


def test_every_chart_comes_as_svg_png_and_csv(drawn):
    folder, words = drawn
    assert {path.name for path in folder.iterdir()} == {f"{n}.{kind}" for n in NAMES for kind in chart_files.KINDS}
    assert "\n" not in words
    assert "wavelengths" in words
    assert "half profiles" in words


def test_the_titles_are_true(drawn):
    rules = {row["rule"]: row for row in rows_of(drawn, "wavelengths")}
    for figure in ("delta_e00_p95", "delta_e00_max", "ee_difference_p95"):
        assert rules["12"][figure] < 1.1 * rules["10nm"][figure]
    assert (rules["12"]["wavelengths"], rules["10nm"]["wavelengths"]) == (12, 41)
    for name, kind in (("axes", "delta_e00"), ("profile-axes", "ee_difference")):
        rows = [row for row in rows_of(drawn, name) if row["part"] == "table"]
        by_table = {(row["spacing"], row["nodes"], row["stored"]): row for row in rows}
        for nodes in {row["nodes"] for row in rows}:
            for which in ("p95", "max"):
                cube, *others = (
                    by_table[s, nodes, "float"][f"{kind}_{which}"] for s in (settings.CUBE_ROOT, "linear", "log")
                )
                assert cube < min(others)
                if name == "profile-axes":
                    half = by_table[settings.CUBE_ROOT, nodes, "half"][f"{kind}_{which}"]
                    assert half == pytest.approx(cube, rel=0.03)
            assert by_table["log", nodes, "half"]["bytes"] == by_table["log", nodes, "float"]["bytes"] / 2


def test_the_default_profile_table_errs_as_its_manifest_says(drawn):
    """Fifty skins, as a bake measures itself: the same figure, but for the half and float rounding of the files."""
    stated = lutgen.load().manifest["error"]["profile"]
    (row,) = (
        row for row in rows_of(drawn, "profile-axes")
        if (row["part"], row["spacing"], row["nodes"], row["stored"]) == ("table", "cube root", "16×4×8", "float")
    )  # fmt: skip
    assert row["ee_difference_p95"] == pytest.approx(stated["ee_difference_p95"], rel=1e-3)
    assert row["ee_difference_max"] == pytest.approx(stated["ee_difference_max"], rel=1e-3)


def test_the_charts_stand_at_the_default_setting():
    luts = lutgen.load()
    assert luts.tissue == settings.TISSUE
    assert np.array_equal(luts.paths.radius_edges_mm, EDGES)
