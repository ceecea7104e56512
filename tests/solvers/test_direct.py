"""The walk of Zhang, Human face rendering, through general layers: against published values, two solvers."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from reference import H_FUNCTION, TWO_LAYER, two_layers

import lutgen
from lutgen.skin.tissue import Layer
from lutgen.solvers import adding_doubling, direct

FLOAT = 2e-6  # sums of weights in single precision per photon
SEVEN_LAYERS = [  # thicknesses and indices of a published seven-layer skin (Meglinski & Matcher 2002), optics made up
    Layer(0.02, 0.1, 50, 0.8, 1.5), Layer(0.08, 1.0, 40, 0.75, 1.34), Layer(0.15, 0.2, 25, 0.8, 1.40),
    Layer(0.08, 0.5, 25, 0.8, 1.39), Layer(1.5, 0.1, 20, 0.8, 1.40), Layer(0.08, 0.6, 25, 0.8, 1.38),
    Layer(6.0, 0.05, 5, 0.75, 1.44),
]  # fmt: skip


def agrees(layers, photons=100_000, seed=1, **options):
    """All shares within 4 of their own sigmas of adding-doubling."""
    found = direct.shares(layers, photons, seed, **options)
    diffuse, specular, transmitted, absorbed = adding_doubling.stack(layers)
    assert found.specular == pytest.approx(specular, abs=1e-6)
    assert abs(found.diffuse - diffuse) <= 4 * found.diffuse_error + FLOAT
    assert abs(found.transmitted - transmitted) <= 4 * found.transmitted_error + FLOAT
    assert np.all(np.abs(found.absorbed - absorbed) <= 4 * found.absorbed_error + FLOAT)
    assert abs(found.total - 1) <= 4 * found.total_error + FLOAT
    return found


@pytest.mark.parametrize("row", TWO_LAYER, ids=lambda r: f"{r['reading']}-{r['wavelength_nm']}-{r['f_mel']}")
def test_reference_two_layer(row):
    found = lutgen.reflectance(two_layers(row), method="direct", photons=100_000, seed=2)
    assert abs(found.diffuse - float(row["R_diffuse_excl_specular"])) < 4 * found.std_error


@pytest.mark.parametrize("absorption", ["albedo", "continuous"])
def test_van_de_hulst_slab(absorption):
    found = agrees([Layer(0.2, 1, 9, 0.75, 1.0)], absorption=absorption)
    assert abs(found.diffuse - 0.09739) < 4 * found.diffuse_error
    assert abs(found.transmitted - 0.66096) < 4 * found.transmitted_error


@pytest.mark.parametrize("absorption", ["albedo", "continuous"])
def test_giovanelli(absorption):
    found = agrees([Layer(np.inf, 1, 9, 0, 1.5)], absorption=absorption)
    assert abs(found.diffuse + found.specular - 0.2600) < 4 * found.diffuse_error + 1e-4  # printed with four digits


@pytest.mark.parametrize("albedo", [0.5, 0.8, 0.9, 0.99, 0.999])
def test_h_function(albedo):
    found = agrees([Layer(np.inf, 1 - albedo, albedo, 0, 1.0)], photons=50_000)
    assert abs(found.diffuse - H_FUNCTION[albedo]) < 4 * found.diffuse_error


@pytest.mark.parametrize("absorption", ["albedo", "continuous"])
def test_unscattered_transmission(absorption):
    """Through 2 mm of mu_a 1 without scattering: exp(-2), by chance with `albedo`, exactly with `continuous`."""
    found = direct.shares([Layer(2, 1, 0, 0.8, 1.0)], 100_000, absorption=absorption)
    assert abs(found.transmitted - np.exp(-2)) <= 4 * found.transmitted_error + FLOAT


def test_seven_layers_of_different_indices():
    agrees(SEVEN_LAYERS)
    agrees([*SEVEN_LAYERS[:-1], replace(SEVEN_LAYERS[-1], thickness_mm=np.inf)], absorption="continuous")


def test_clear_layers_and_zero_thickness():
    agrees([Layer(1, 0, 0, 0, 1.5), Layer(2, 0.5, 10, 0.05, 1.3)])
    agrees([Layer(0.5, 0.3, 9, 0.7, 1.4), Layer(1, 0, 0, 0, 1.0), Layer(1, 0.2, 12, 0.9, 1.5)])
    agrees([Layer(0, 1, 9, 0.7, 1.4), Layer(np.inf, 0.3, 12, 0.8, 1.4)])


@pytest.mark.parametrize("g", [-0.7, 0.0, 0.05, 0.95])
def test_anisotropy_of_each_layer(g):
    agrees([Layer(0.2, 0.5, 20, g, 1.4), Layer(np.inf, 0.3, 15, 0.8, 1.4)])


@pytest.mark.parametrize(("threshold", "survivors"), [(1e-2, 10), (1e-4, 2), (1e-3, 100)])
def test_roulette_is_unbiased(threshold, survivors):
    layers = lutgen.layers(lutgen.preset("brown"), 500)
    agrees(layers, threshold=threshold, survivors=survivors)


def test_mixed_absorption_is_a_medium_of_greater_scattering():
    """Zhang, Human face rendering, section 3: steps from mu_t and exp(-mu_a s) solve mu_s + mu_a exactly."""
    layers = lutgen.layers(lutgen.Skin(0.43, 0.7, 0.01), 450)
    found = direct.shares(layers, 200_000, absorption="mixed")
    brighter = [replace(layer, mu_s_per_mm=layer.mu_s_per_mm + layer.mu_a_per_mm) for layer in layers]
    assert abs(found.diffuse - adding_doubling.stack(brighter)[0]) < 4 * found.diffuse_error
    assert found.diffuse > 2 * adding_doubling.stack(layers)[0]


layer_values = st.tuples(
    st.floats(0, 2),
    st.floats(0.01, 20),
    st.floats(0, 60),
    st.floats(-0.5, 0.95),
    st.sampled_from([1.0, 1.33, 1.4, 1.5]),
)


@settings(derandomize=True, max_examples=25, deadline=None)
@given(st.lists(layer_values, min_size=3, max_size=3), st.sampled_from(["albedo", "continuous"]))
def test_any_stack_conserves_energy_and_has_no_negative_share(values, absorption):
    found = direct.shares([Layer(*v) for v in values], 4096, absorption=absorption)
    assert abs(found.total - 1) <= 4.5 * found.total_error + 1e-5
    assert np.isfinite(found.total)
    assert min(found.diffuse, found.transmitted, *found.absorbed) >= 0


@pytest.mark.parametrize("index", range(10))
def test_profiles_agree_with_the_path_table_at_every_radius(index):
    rng = np.random.default_rng(index)
    skin = lutgen.Skin(float(rng.uniform(0.005, 0.4)), float(rng.random()), float(rng.uniform(0.002, 0.08)))
    layers, edges = lutgen.layers(skin, float(rng.uniform(420, 680))), np.concatenate([[0], np.geomspace(5e-3, 6, 16)])
    one = lutgen.profile(layers, edges, method="direct", photons=200_000, seed=index)
    two = lutgen.profile(layers, edges, method="path-table", photons=400_000, seed=index)
    counted = one.energy > 5 * one.std_error  # a normal law needs some exits in the ring
    assert counted.sum() > 8
    assert np.all(np.abs(one.energy - two.energy)[counted] < 4 * np.hypot(one.std_error, two.std_error)[counted])


def test_sigma_is_right():
    """z-scores of 100 seeds: mean within 4/sqrt(100), standard deviation within 4/sqrt(200) of 1."""
    layers = lutgen.layers(lutgen.preset("tan"), 540)
    exact = adding_doubling.stack(layers)
    runs = [direct.shares(layers, 4096, seed) for seed in range(100)]
    for z in (
        np.array([(run.diffuse - exact[0]) / run.diffuse_error for run in runs]),
        np.array([(run.absorbed[1] - exact[3][1]) / run.absorbed_error[1] for run in runs]),
    ):
        assert abs(z.mean()) < 0.4
        assert abs(z.std(ddof=1) - 1) < 0.28


def test_same_seed_same_records():
    layers = lutgen.layers(lutgen.preset("light"), 600)
    first, again = ([ends.tobytes() for ends, _ in direct.records(layers, 3000, 7)] for _ in range(2))
    assert first == again


@pytest.mark.parametrize(
    ("layers", "options", "message"),
    [
        ([Layer(np.inf, 0, 20, 0.8)], {}, "does not end"),
        ([Layer(np.inf, 1, 20, 0.8), Layer(1, 1, 20, 0.8)], {}, "only the last"),
        ([Layer(1, 1, 20, 0.8)] * 40, {}, "up to 32, not 40"),
        ([Layer(1, 1, 20, 0.8)], {"absorption": "beer"}, "absorption = 'beer': allowed is albedo, continuous, mixed"),
        ([Layer(1, 1, 20, 0.8)], {"threshold": 0.0}, "threshold = 0"),
        ([Layer(1, 1, 20, 0.8)], {"survivors": 1}, "survivors = 1"),
        ([Layer(1, 1, 20, 0.8)], {"photons": 0}, "photons = 0"),
    ],
)
def test_bad_input_is_named(layers, options, message):
    with pytest.raises(lutgen.InputError, match=message):
        lutgen.reflectance(layers, method="direct", **options)
