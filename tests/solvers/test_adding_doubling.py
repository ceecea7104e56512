"""Adding-doubling against published values, laws, and itself at other resolutions."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from reference import H_FUNCTION, HG_075, TWO_LAYER, two_layers

import lutgen
from lutgen.skin import chromophores
from lutgen.skin.tissue import Chromophores, Layer, Tissue, skin_of
from lutgen.solvers import adding_doubling, exact_totals

TOLERANCE = 5e-5  # what tests/README.md, Tolerances, asks of a deterministic solver


def diffuse(layers, **options):
    return adding_doubling.stack(layers, **options)[0]


@pytest.mark.parametrize("row", TWO_LAYER, ids=lambda r: f"{r['reading']}-{r['wavelength_nm']}-{r['f_mel']}")
def test_reference_two_layer(row):
    result = lutgen.reflectance(two_layers(row))
    assert abs(result.diffuse - float(row["R_diffuse_excl_specular"])) < TOLERANCE
    assert abs(result.specular - float(row["R_specular"])) < 1e-6


def test_van_de_hulst_slab():
    result = lutgen.reflectance([Layer(0.2, 1, 9, 0.75, 1.0)])
    assert abs(result.diffuse - 0.09739) < TOLERANCE
    assert abs(result.transmitted - 0.66096) < TOLERANCE


def test_giovanelli():
    result = lutgen.reflectance([Layer(np.inf, 1, 9, 0, 1.5)])
    assert abs(result.diffuse + result.specular - 0.2600) < 1e-4  # printed with four digits


@pytest.mark.parametrize(("albedo", "expected"), H_FUNCTION.items())
def test_h_function(albedo, expected):
    assert abs(diffuse([Layer(np.inf, 1 - albedo, albedo, 0, 1.0)]) - expected) < 1e-7


@pytest.mark.parametrize(("albedo", "expected"), HG_075.items())
def test_henyey_greenstein_semi_infinite(albedo, expected):
    assert abs(diffuse([Layer(np.inf, 1 - albedo, albedo, 0.75, 1.4)]) - expected) < 5e-6  # as good as the reference


@pytest.mark.parametrize("thickness", [0.0, 1e-3, 0.1, 3.0])
def test_interface_between_like_layers_is_not_there(thickness):
    alike = (1, 30, 0.78, 1.4)
    split = diffuse([Layer(thickness, *alike), Layer(np.inf, *alike)])
    assert abs(split - diffuse([Layer(np.inf, *alike)])) < 1e-10
    assert abs(split - 0.195213) < TOLERANCE


def test_specular_at_normal_incidence():
    assert lutgen.reflectance([Layer(np.inf, 1, 9, 0.5, 1.4)]).specular == pytest.approx(1 / 36, abs=1e-12)


def test_unscattered_transmission_is_beer_lambert():
    assert lutgen.reflectance([Layer(2, 1, 0, 0.8, 1.0)]).transmitted == pytest.approx(np.exp(-2), abs=1e-12)


layer_values = st.tuples(
    st.floats(0, 3), st.floats(0, 20), st.floats(0, 60), st.floats(-0.5, 0.95), st.sampled_from([1.0, 1.33, 1.4, 1.5])
)


@settings(derandomize=True, max_examples=40, deadline=None)
@given(st.lists(layer_values, min_size=1, max_size=4))
def test_energy_is_conserved_and_no_share_is_negative(values):
    diffuse, specular, transmitted, absorbed = adding_doubling.stack([Layer(*v) for v in values], nodes=8)
    assert diffuse + specular + transmitted + absorbed.sum() == pytest.approx(1, abs=1e-9)
    assert min(diffuse, specular, transmitted, *absorbed) > -1e-9


def test_seven_layers_reversed_transmit_the_same():
    """Reciprocity holds for transmission along the normal between equal outer media, summed over directions by n^2."""
    rng = np.random.default_rng(3)
    stack = [Layer(float(t), float(a), 0.0, 0.0, float(n)) for t, a, n in zip(
        rng.uniform(0.1, 1, 7), rng.uniform(0, 1, 7), rng.choice([1.33, 1.4, 1.5], 7), strict=True)]  # fmt: skip
    forward = adding_doubling.stack(stack)[2]
    assert forward == pytest.approx(adding_doubling.stack(stack[::-1])[2], rel=1e-12)


def test_reflectance_falls_with_absorption():
    values = [
        diffuse([Layer(0.1, mu, 30, 0.78, 1.4), Layer(np.inf, 0.1, 30, 0.78, 1.4)]) for mu in (0, 0.1, 1, 10, 100)
    ]
    assert np.all(np.diff(values) < 0)


def test_nodes_converge_without_drift():
    """A peer (iadpython 0.5.3) drifts above 32 nodes; here more nodes only come closer."""
    row = next(r for r in TWO_LAYER if r["reading"] == "A")
    values = [diffuse(two_layers(row), nodes=n) for n in (12, 16, 24, 32, 48, 64)]
    assert np.ptp(values[1:]) < 2e-6
    assert abs(values[0] - values[-1]) < 3e-6  # one moment per direction instead of 1.5 errs by 7e-6


def test_two_layer_grid_is_the_stack():
    mu_e, mu_d = np.array([[0.2, 3.0]]), np.array([[0.05, 0.5, 5.0]])
    grid = adding_doubling.two_layer_grid(0.1, mu_e, mu_d, np.array([30.0]), np.array([0.78]), 1.4)
    for i, a in enumerate(mu_e[0]):
        for j, b in enumerate(mu_d[0]):
            expected = diffuse([Layer(0.1, a, 30, 0.78, 1.4), Layer(np.inf, b, 30, 0.78, 1.4)])
            assert grid[0, i, j] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(
    ("law", "mm", "n"),
    [("source", 0.1, 1.4), ("source", 0.5, 1.4), ("source", 0.01, 1.5), ("saidi", 0.1, 1.4), ("donner", 0.1, 1.33)],
)
def test_exact_totals_stand_for_the_solver(law, mm, n):
    tissue = Tissue(epidermis_mm=mm, scattering=law, refractive_index=n)
    exact = exact_totals.exact_totals(tissue)
    rng = np.random.default_rng(5)
    nm = np.array([380.0, 423.0, 575.0, 780.0])
    skins = np.array([rng.uniform(*chromophores.MELANIN, 6) ** 1.5 + 0.001, rng.uniform(0, 1, 6),
                      rng.uniform(*chromophores.HEMOGLOBIN, 6), rng.uniform(0, 1, 6)])  # fmt: skip
    spectra = exact_totals.spectra(exact, nm, *skins)
    for (*pigments, oxygenation), spectrum in zip(skins.T, spectra, strict=True):
        skin = skin_of(Chromophores(*pigments), replace(tissue, oxygenation=oxygenation))
        assert np.abs(spectrum - lutgen.spectrum(skin, nm)).max() < 2e-5  # measured 1e-5


def test_bad_stacks_are_refused():
    inf = Layer(np.inf, 1, 10, 0.8, 1.4)
    for layers, message in (([], "at least one"), ([inf, inf], "only the last"), ([1, 2], "lutgen.Layer")):
        with pytest.raises(lutgen.InputError, match=message):
            lutgen.reflectance(layers)
    for call, message in (
        (lambda: lutgen.reflectance(inf, nodes=16, absorption="albedo"), "no such option; it has nodes"),
        (
            lambda: lutgen.reflectance([inf], method="path-table", nodes=16),
            "nodes: method path-table has no",
        ),
        (lambda: lutgen.reflectance(None), "a list of at least one"),
        (lambda: lutgen.reflectance([inf], photons=-5), "photons = -5"),
        (lambda: lutgen.spectrum("light"), "skin = 'light': a lutgen.Skin is needed"),  # type: ignore[arg-type]
        (lambda: lutgen.spectrum(lutgen.preset("light"), "abc"), "wavelength_nm = 'abc'"),
        (lambda: lutgen.spectrum(lutgen.preset("light"), [[550.0]]), "has shape"),
        (lambda: lutgen.spectrum(lutgen.preset("light"), 900), "wavelength_nm = 900: allowed is 380 to 780"),
        (lambda: lutgen.profile([inf], "abc"), "radius_edges_mm = 'abc'"),
        (lambda: lutgen.profile([inf], [2, 1]), "ascending radii"),
        (lambda: lutgen.Layer("a", 1, 1, 1), "thickness_mm = 'a': a number"),  # type: ignore[arg-type]
        (lambda: lutgen.Skin(np.array([0.1, 0.2]), 0.7, 0.01), "melanin = array"),  # type: ignore[arg-type]
        (lambda: lutgen.load([1]), "the folder of a LUT set"),  # type: ignore[arg-type]
    ):
        with pytest.raises(lutgen.InputError, match=message):
            call()
    with pytest.raises(lutgen.InputError, match=r"nodes = 3: allowed"):
        lutgen.reflectance([inf], nodes=3)
    with pytest.raises(lutgen.InputError, match="method = 'magic': allowed is path-table, adding-doubling"):
        lutgen.reflectance([inf], method="magic")
    with pytest.raises(lutgen.InputError, match="gives no profile"):
        lutgen.profile([inf], method="adding-doubling")
