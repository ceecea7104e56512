"""Every method at any allowed skin: finite, not negative, no more light out than in."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lutgen
from lutgen.skin import chromophores, tissue
from lutgen.skin.tissue import Layer
from lutgen.solvers import METHODS, adding_doubling

ENTRY = 1 - 1 / 36  # index 1.4
EDGES = np.concatenate([[0.0], np.geomspace(1e-4, 30, 12), [np.inf]])


def log_uniform(low: float, high: float):
    return st.floats(np.log(low), np.log(high)).map(lambda x: float(np.clip(np.exp(x), low, high)))


skins = st.builds(
    lutgen.Skin,
    melanin=log_uniform(*chromophores.MELANIN),
    eumelanin=st.floats(*chromophores.EUMELANIN),
    hemoglobin=log_uniform(*chromophores.HEMOGLOBIN),
    oxygenation=st.floats(*chromophores.OXYGENATION),
    epidermis_mm=log_uniform(*tissue.EPIDERMIS_MM),
    scattering=st.sampled_from(tissue.LAWS),
    reading=st.sampled_from(tissue.READINGS),
    saidi_a_per_mm=st.floats(0.01, 100),
    saidi_b_nm4_per_mm=st.floats(1e9, 1e13),
)
wavelengths = st.one_of(st.sampled_from(chromophores.WAVELENGTH_NM), st.floats(*chromophores.WAVELENGTH_NM))


@pytest.mark.parametrize("method", METHODS)
@settings(derandomize=True, max_examples=40, deadline=None)
@given(skin=skins, nm=wavelengths)
def test_no_method_gives_nan_or_negative_energy(method, skin, nm):
    stack = lutgen.layers(skin, nm)
    if method == "path-table" and skin.scattering == "donner":
        with pytest.raises(lutgen.InputError, match="the same in both layers"):
            lutgen.reflectance(stack, method)
        return
    if method == "dipole":
        stack = stack[1:]
    more = {"unsafe": True} if method in ("dipole", "multipole") else {}
    found = lutgen.reflectance(stack, method, photons=2048, **more)
    assert found.specular == pytest.approx(1 - ENTRY, abs=1e-7)
    assert found.transmitted == 0
    assert np.isfinite(found.std_error)
    assert found.std_error >= 0
    assert 0 <= found.diffuse <= ENTRY + 1e-6
    if method == "adding-doubling":
        diffuse, specular, transmitted, absorbed = adding_doubling.stack(stack)
        assert diffuse + specular + transmitted + absorbed.sum() == pytest.approx(1, abs=1e-9)
        assert np.all(absorbed >= -1e-12)
        return
    rings = lutgen.profile(stack, EDGES, method, photons=2048, **more)
    for values in (rings.energy, rings.std_error):
        assert np.all(np.isfinite(values) & (values >= 0))
    assert rings.total == pytest.approx(found.diffuse, abs=1e-6)


wide_layers = st.builds(
    Layer,
    thickness_mm=st.one_of(st.just(0.0), log_uniform(1e-6, 1e3)),
    mu_a_per_mm=st.one_of(st.just(0.0), log_uniform(1e-6, 1e4)),
    mu_s_per_mm=st.one_of(st.just(0.0), log_uniform(1e-6, 1e4)),
    g=st.floats(-0.9, 0.99),
    n=st.sampled_from([1.0, 1.33, 1.4, 1.5, 2.0]),
)


@settings(derandomize=True, max_examples=40, deadline=None)
@given(st.lists(wide_layers, min_size=1, max_size=3))
def test_adding_doubling_keeps_energy_exactly_in_any_stack(layers):
    diffuse, specular, transmitted, absorbed = adding_doubling.stack(layers)
    assert diffuse + specular + transmitted + absorbed.sum() == pytest.approx(1, abs=1e-9)
    assert min(diffuse, transmitted) >= 0
    # A layer's absorption is what is left of sums over both directions of N nodes. Rounding spreads each of 2N terms
    # evenly over an epsilon, a standard deviation of eps / sqrt(12); four of a sum's are allowed, of the light in the
    # layer: total reflection keeps some inside, but no more than n^2 of the light outside goes each way. Doubling
    # doubles it: it grows with the optical thickness along the most grazing node.
    thickness = max((x.mu_a_per_mm + x.mu_s_per_mm) * x.thickness_mm for x in layers)
    cosines = adding_doubling.directions([1.0, *(x.n for x in layers)])[0]
    rounding = 4 * np.sqrt(2 * len(cosines) / 12) * np.finfo(float).eps
    inside = 2 * max(x.n for x in layers) ** 2
    assert min(absorbed) >= -rounding * inside * (thickness / cosines.min() + 100)
