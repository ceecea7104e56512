"""The Monte Carlo trace: against adding-doubling, against a literal walk, its sigma, its determinism, its limits."""

from dataclasses import replace

import numpy as np
import pytest
from reference import TWO_LAYER, document_walk, two_layers

import lutgen
from lutgen import device as ocl
from lutgen.charts.stability.kernel_values import WIDTHS, wide
from lutgen.errors import MachineError
from lutgen.skin import tissue
from lutgen.skin.tissue import Layer
from lutgen.solvers import exact_totals, path_table, profiles
from lutgen.tables import bake, expand
from lutgen.tables.axes import default_grid

NM = np.array([420.0, 540.0, 660.0])
SKIN = tissue.preset("light")
EDGES = profiles.ring_edges()


def trace(photons=32_768, seed=0, nm=NM, **options):
    medium, reach = bake.skin_medium(SKIN, nm)
    return path_table.trace(medium, *reach, EDGES, photons, seed, **options)


@pytest.mark.parametrize("row", TWO_LAYER, ids=lambda r: f"{r['reading']}-{r['wavelength_nm']}-{r['f_mel']}")
def test_reference_two_layer(row):
    """45 rows at 4 sigma: chance fails one of them in 350 seeds."""
    result = lutgen.reflectance(two_layers(row), method="path-table", photons=1_000_000, seed=1)
    assert abs(result.diffuse - float(row["R_diffuse_excl_specular"])) < 4 * result.std_error


def test_sigma_is_right():
    """z-scores of 100 seeds: mean within 4/sqrt(100), standard deviation within 4/sqrt(200) of 1."""
    layers = lutgen.layers(lutgen.preset("tan"), 540)
    exact = lutgen.reflectance(layers).diffuse
    runs = [lutgen.reflectance(layers, method="path-table", photons=20_000, seed=seed) for seed in range(100)]
    z = np.array([(run.diffuse - exact) / run.std_error for run in runs])
    assert abs(z.mean()) < 0.4
    assert abs(z.std(ddof=1) - 1) < 0.28


def test_table_sigma_is_right():
    """The same for the table's own sigma, read at 2 mu - nu, on a skin far above nu, total and one ring."""
    mu = expand.coefficients(NM, expand.absorbers(NM, 0.7), np.array([0.1]), np.array([0.7]), np.array([0.02]))
    exact = exact_totals.exact_totals(SKIN)(NM, *mu)[:, 0]
    tables = [trace(8192, seed) for seed in range(60)]
    sums = [table.totals() for table in tables]
    z = np.array([(t.evaluate(*mu)[:, 0, 0] - exact) / t.std_error(*mu)[:, 0, 0] for t in sums])
    assert abs(z.mean()) < 4 / np.sqrt(z.size)
    assert abs(z.std() - 1) < 4 / np.sqrt(2 * z.size)
    ring = int(np.searchsorted(EDGES, 0.1))
    values = np.array([t.evaluate(*mu)[:, ring, 0] for t in tables])
    stated = np.array([t.std_error(*mu)[:, ring, 0] for t in tables]).mean(axis=0)
    assert np.all(np.abs(values.std(axis=0, ddof=1) / stated - 1) < 4 / np.sqrt(2 * 60))


@pytest.mark.parametrize(("melanin", "nm"), [(0.02, 640.0), (0.3, 450.0)])
def test_profile_agrees_with_the_document_walk(melanin, nm):
    """Radii have no closed form: an independent, literal walk is the truth, 20 rings at 4 sigma."""
    layers = lutgen.layers(lutgen.Skin(melanin, 0.7, 0.01), nm)
    edges = np.concatenate([[0], np.geomspace(2e-3, 8, 20)])
    found = lutgen.profile(layers, edges, photons=400_000, seed=2)
    photons = 20_000
    radius, weight = document_walk(layers, photons, 7)
    mean = np.histogram(radius, edges, weights=weight)[0] / photons
    square = np.histogram(radius, edges, weights=weight**2)[0] / photons
    sigma = np.sqrt((square - mean**2) / photons + found.std_error**2)
    hit = np.histogram(radius, edges)[0] >= 25  # a normal law needs some counts
    assert hit.sum() > 8
    assert np.all(np.abs(found.energy - mean)[hit] < 4 * sigma[hit])


def test_laplace_table_is_the_bank():
    """Interpolation between 16 x 16 nodes against every record's own weight: measured 5e-6 on totals, 1e-6 per ring."""
    medium, reach = bake.skin_medium(SKIN, NM)
    table = path_table.trace(medium, *reach, EDGES, 32_768, 3)
    skins = bake.random_skins(default_grid(2, 2, 2), 40, 4)
    mu = expand.coefficients(NM, expand.absorbers(NM, 0.4), *skins)
    direct, square = np.zeros((len(NM), len(EDGES) - 1, 40)), np.zeros((len(NM), 40))
    for k, rows in path_table.records(medium, 32_768, 3):
        radius, path, in_e = rows.astype(float).T
        ring = np.searchsorted(EDGES[1:-1], radius, side="right")
        for p in range(40):
            rate = (mu[0][k, p] - medium.nu_per_mm[k]) * in_e + (mu[1][k, p] - medium.nu_per_mm[k]) * (path - in_e)
            direct[k, :, p] += np.bincount(ring, np.exp(-rate), len(EDGES) - 1)
            square[k, p] += np.exp(-2 * rate).sum()
    direct *= medium.entry / 32_768
    sigma = np.sqrt((medium.entry**2 * square / 32_768 - direct.sum(axis=1) ** 2) / 32_768)
    assert np.abs(table.totals().std_error(*mu)[:, 0] / sigma - 1).max() < 1e-3
    found = table.evaluate(*mu)
    assert np.abs(found.sum(axis=1) - direct.sum(axis=1)).max() < 2e-5
    assert np.abs(found - direct).max() < 5e-6


def test_records_obey_geometry():
    medium, _ = bake.skin_medium(SKIN, NM)
    for _, rows in path_table.records(medium, 20_000, 5):
        radius, path, in_epidermis = rows.T
        assert np.all((radius >= 0) & np.isfinite(rows).all(axis=1))
        assert np.all(path > 0)
        assert np.all((in_epidermis >= 0) & (in_epidermis <= path + 1e-6))  # sums of steps in single precision
        assert np.all(radius <= path + 1e-5)


def test_any_split_into_launches_gives_the_same_bytes():
    photons = 3 * path_table.BLOCK_PHOTONS["cpu"] + 77  # 4 blocks x 3 wavelengths = 12
    whole, *split = [trace(photons, blocks_per_launch=size) for size in (12, 6, 2, 5, 1)]
    for table in split:
        assert table.energy.tobytes() == whole.energy.tobytes()


@pytest.mark.parametrize("block", [1, 3])
def test_blocks_smaller_than_the_lanes_are_unbiased(block, monkeypatch):
    """Lanes without a photon stay idle: 20,000 photons in blocks of 1 or 3 reflect what they should."""
    monkeypatch.setitem(path_table.BLOCK_PHOTONS, "cpu", block)
    layers = [Layer(np.inf, 1.0, 30, 0.78, 1.4)]
    found = lutgen.reflectance(layers, method="path-table", photons=20_000, seed=6)
    assert abs(found.diffuse - lutgen.reflectance(layers).diffuse) < 4 * found.std_error


def test_profile_sums_to_the_reflectance():
    layers = lutgen.layers(SKIN, 600)
    one = lutgen.profile(layers, [0, 1, 1e3], photons=20_000, seed=3)
    two = lutgen.reflectance(layers, method="path-table", photons=20_000, seed=3)
    assert float(one.total) == pytest.approx(two.diffuse, rel=1e-12)


def test_lives_end_at_the_least_absorption_of_any_allowed_skin():
    medium, (epidermis, dermis) = bake.skin_medium(SKIN, NM)
    assert medium.nu_per_mm == pytest.approx(np.minimum(epidermis[0], dermis[0]), rel=1e-12)


def test_kernel_hash_names_text_and_lanes(monkeypatch):
    device = ocl.choose()
    hashes = {path_table.kernel_hash(device), path_table.kernel_hash(replace(device, lanes=1))}
    source = ocl.source
    monkeypatch.setattr(ocl, "source", lambda *names: source(*names) + "// changed")
    assert len(hashes | {path_table.kernel_hash(device)}) == 3


def test_photons_need_not_fill_blocks():
    for photons in (1, 15, path_table.BLOCK_PHOTONS["cpu"] + 1):
        tally = path_table.Tally()
        medium, _ = bake.skin_medium(SKIN, NM[:1])
        path_table.walk_only(medium, photons, ocl.choose(), tally)
        assert tally.photons == photons


@pytest.mark.parametrize("lanes", WIDTHS)
def test_every_width_agrees_with_adding_doubling(lanes):
    layers = [Layer(0.1, 2.0, 30, 0.78, 1.4), Layer(np.inf, 0.3, 30, 0.78, 1.4)]
    photons = 100_000
    total, square, medium = path_table.ring_sums(layers, np.array([0, np.inf]), photons, 9, wide(lanes))
    sigma = medium.entry * np.sqrt((square[0] / photons - (total[0] / photons) ** 2) / photons)
    assert abs(medium.entry * total[0] / photons - lutgen.reflectance(layers).diffuse) < 4 * sigma


def test_a_gpus_blocks_and_columns_give_the_same_physics():
    """What a GPU runs, one lane and short blocks with the table's columns shared out, run on the device there is."""
    gpu = replace(wide(1), kind="gpu")
    mu = expand.coefficients(NM, expand.absorbers(NM, 0.7), np.array([0.02]), np.array([0.7]), np.array([0.02]))
    table = trace(30_000, device=gpu).totals()
    exact = exact_totals.exact_totals(SKIN)(NM, *mu)
    assert np.all(np.abs(table.evaluate(*mu)[:, 0] - exact) < 4 * table.std_error(*mu)[:, 0])


def test_wavelengths_and_seeds_have_their_own_streams():
    medium, reach = bake.skin_medium(SKIN, NM[:1])
    keyed_otherwise = replace(medium, wavelength_nm=NM[:1] + 1)  # the same physics under another key
    tables = [
        path_table.trace(m, *reach, EDGES, 8192, seed) for m, seed in ((medium, 0), (medium, 1), (keyed_otherwise, 0))
    ]
    assert len({table.energy.tobytes() for table in tables}) == 3


@pytest.mark.parametrize(
    ("layers", "message"),
    [
        ([Layer(0.1, 1, 30, 0.8), Layer(np.inf, 1, 20, 0.8)], "mu_s_per_mm = 30 and 20"),
        ([Layer(0.1, 1, 30, 0.8), Layer(np.inf, 1, 30, 0.7)], "g = 0.8 and 0.7"),
        ([Layer(0.1, 1, 30, 0.8, 1.4), Layer(np.inf, 1, 30, 0.8, 1.5)], "n = 1.4 and 1.5"),
        ([Layer(0.1, 1, 30, 0.8)], "semi-infinite"),
        ([Layer(0.1, 1, 30, 0.8)] * 2 + [Layer(np.inf, 1, 30, 0.8)], "1 or 2 layers"),
        ([Layer(np.inf, 0, 30, 0.8)], "does not end"),
        ([Layer(np.inf, 1, 0, 0.8)], "mu_s_per_mm = 0"),
    ],
)
def test_stacks_it_cannot_represent_are_refused_with_the_method_that_can(layers, message):
    with pytest.raises(lutgen.InputError, match=message) as caught:
        lutgen.reflectance(layers, method="path-table")
    if "mu_s_per_mm = 0" not in message:
        assert "adding-doubling" in str(caught.value)


@pytest.mark.parametrize(("photons", "seed"), [(0, 0), (-5, 0), (2**31, 0), (1.5, 0), (True, 0), (10, -1), (10, 2**32)])
def test_photons_and_seed_beyond_the_counters_are_refused(photons, seed):
    with pytest.raises(lutgen.InputError, match="(photons|seed) = .*allowed is a whole number"):
        lutgen.reflectance([Layer(np.inf, 1, 10, 0.8)], method="path-table", photons=photons, seed=seed)


@pytest.mark.parametrize(("mu_a", "mu_s"), [(100, 1), (1, 0.01), (1000, 10)])
def test_strong_absorption_ends_within_the_step_budget(mu_a, mu_s):
    layers = [Layer(np.inf, mu_a, mu_s, 0.8)]
    found = lutgen.reflectance(layers, method="path-table", photons=200_000)
    assert abs(found.diffuse - lutgen.reflectance(layers).diffuse) <= 4 * found.std_error + 1e-5


def test_reading_below_nu_is_refused():
    table = trace(2048)
    mu = np.tile(table.nu_per_mm[:, None] * 0.5, (1, 1))
    with pytest.raises(lutgen.InputError, match="the stored paths cover"):
        table.evaluate(mu, mu)


def test_an_exhausted_step_budget_is_an_error_not_a_bias(monkeypatch):
    jobs = path_table._jobs

    def starved(*arguments):
        found = jobs(*arguments)
        found["max_steps"] = 50
        return found

    monkeypatch.setattr(path_table, "_jobs", starved)
    with pytest.raises(MachineError, match="step budget"):
        trace(2048)
