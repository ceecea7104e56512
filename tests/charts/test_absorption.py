"""The chart of walks: what each walk must find, how it ends, and what is made of its time."""

import re

import numpy as np
import pytest
from chart_files import KINDS, rows_of

from lutgen import device as ocl
from lutgen import solvers
from lutgen.charts.accuracy import absorption
from lutgen.charts.document.spectra import as_mixed
from lutgen.skin.tissue import layers, preset
from lutgen.solvers import path_table

DARK, LIGHT = ("dark", 550.0), ("light", 460.0)


def walked(place: tuple[str, float], walk: str, photons: int):
    """Mean and standard error of the reflectance by one walk, and the share of photons that left."""
    weights, _, _ = absorption.run(*place, walk, photons, 11, ocl.choose())
    mean = weights.sum() / photons
    return mean, np.sqrt(((weights**2).sum() / photons - mean**2) / photons), len(weights) / photons


@pytest.mark.parametrize("place", [DARK, LIGHT])
@pytest.mark.parametrize("walk", ["albedo", "continuous", "own nu", "bake nu", "capped"])
def test_unbiased_walks_agree_with_adding_doubling(place, walk):
    exact = solvers.reflectance(layers(preset(place[0]), place[1])).diffuse
    mean, sigma, left = walked(place, walk, 131_072)
    cut = np.exp(-absorption.CAP) * (1 - left) if walk == "capped" else 0.0  # no photon that met the cap weighed more
    assert -cut - 4 * sigma < mean - exact < 4 * sigma
    assert sigma < 0.01 * exact


def test_the_mixed_walk_is_off_by_what_the_chart_says():
    skin = layers(preset(DARK[0]), DARK[1])
    mean, sigma, _ = walked(DARK, "mixed", 131_072)
    assert abs(mean - solvers.reflectance(as_mixed(skin)).diffuse) < 4 * sigma
    assert mean - solvers.reflectance(skin).diffuse > 10 * sigma


def test_capped_photons_live_until_the_cap_and_no_longer():
    bake, _, nu = absorption.white(*LIGHT, "bake nu")
    medium, life, taken = absorption.white(*LIGHT, "capped")
    paths = np.concatenate([rows[:, 1] for _, rows in path_table.records(medium, 131_072, 3, life=life)])
    assert taken == 0
    assert 0.99 * 9 / nu < paths.max() <= np.float32(9 / nu) * (1 + 1e-6)
    drawn = np.concatenate([rows[:, 1] for _, rows in path_table.records(bake, 131_072, 4)])
    # Up to the cap a drawn life only thins the paths, by exp(-nu L).
    expected, sigma = np.exp(-nu * paths.astype(float)).sum(), np.sqrt(len(drawn) + len(paths))
    assert abs((drawn <= 9 / nu).sum() - expected) < 4 * sigma


def test_without_another_life_the_walk_draws_them():
    medium, _, _ = absorption.white(*LIGHT, "bake nu")
    drawn = "exponential(next_bits(&rng), mean_life)"
    plain, named = (b"".join(r.tobytes() for _, r in path_table.records(medium, 6000, 3, life=x)) for x in ("", drawn))
    assert plain == named


def test_factors_of_weights_known_by_hand():
    # 200 photons, half of them weigh 1: variance 1/4, the square of the mean; 1 % needs 1 / 0.01² photons.
    factors = absorption.factors(100.0, 100.0, 200, 4000, 2e-6, 0.5)
    assert factors == pytest.approx([0.5, 20, 10_000, 0.1])
    assert factors[3] == pytest.approx(factors[0] * factors[1] * factors[2] * 1e-6)
    dimmer = absorption.factors(100.0, 100.0, 200, 4000, 2e-6, 0.25)
    assert dimmer == pytest.approx([0.5, 20, 40_000, 0.4])


def test_ratios_are_of_medians():
    slow, fast = (
        absorption.Cost(1, np.array(rounds, float)[:, None] * [1, 1, 1, 2], 0.5, 0.01, 0.4)
        for rounds in ((5, 6, 90), (1, 2, 3))
    )
    assert absorption.over(slow, fast, "ms_to_1_percent") == 3
    assert slow.bias == pytest.approx((0.25, 0.025))


def test_chart_and_its_numbers(tmp_path, monkeypatch):
    pytest.importorskip("matplotlib")
    monkeypatch.setattr(absorption, "QUICK", (1.0, 2))
    told = absorption.walks(tmp_path, quick=True)
    assert {path.name for path in tmp_path.iterdir()} == {f"walks.{kind}" for kind in KINDS}
    rows = {(r["preset"], float(r["wavelength_nm"]), r["walk"]): r for r in rows_of(tmp_path, "walks")}
    assert set(rows) == {(*place, walk) for place in absorption.PLACES for walk in absorption.WALKS}
    for (_, _, walk), row in rows.items():
        assert walk == "mixed" or abs(float(row["sigmas_off"])) < 4
        needed = float(row["photons_to_1_percent"]) / (int(row["photons_a_round"]) * int(row["rounds"]))
        assert float(row["std_error"]) == pytest.approx(0.01 * float(row["exact"]) * needed**0.5, rel=0.05)
        assert float(row["ns_per_event_least"]) <= float(row["ns_per_event"]) <= float(row["ns_per_event_most"])
    ratios = []
    for place in absorption.PLACES:
        bake, capped = rows[*place, "bake nu"], rows[*place, "capped"]
        assert float(bake["events_per_photon"]) < float(capped["events_per_photon"]) / 2
        assert float(bake["photons_to_1_percent"]) > 0.95 * float(capped["photons_to_1_percent"])
        ratios.append(float(capped["ms_to_1_percent"]) / float(bake["ms_to_1_percent"]))
    said = re.search(r"([\d.]+) to ([\d.]+) times as fast", told)
    assert said
    assert [float(ratio) for ratio in said.groups()] == pytest.approx([min(ratios), max(ratios)], abs=0.006)
