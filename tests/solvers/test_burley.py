"""Burley's profile: its published facts, and that the fit is the best there is."""

import numpy as np
import pytest
from scipy.integrate import quad

import lutgen
from lutgen.solvers import burley, path_table, profiles

EDGES = np.concatenate([[0.0], np.geomspace(1e-3, 60, 80)])


def shape(d_mm):
    return np.diff(burley.encircled(EDGES, d_mm))


@pytest.mark.parametrize("d", [0.02, 1.0, 3.0])
def test_published_facts(d):
    def density(r):
        return (np.exp(-r / d) + np.exp(-r / (3 * d))) / (4 * d)

    def moment(power):
        return quad(lambda r: r**power * density(r), 0, 200 * d, epsabs=0, limit=200)[0]

    assert [moment(p) for p in (0, 1, 2)] == pytest.approx([1, 2.5 * d, 14 * d**2], rel=1e-9)
    assert burley.encircled(1.3 * d, d) == pytest.approx(quad(density, 0, 1.3 * d)[0], rel=1e-12)
    assert burley.encircled(1.55 * d, d) == pytest.approx(0.5, abs=1e-3)
    assert burley.encircled(16.56 * d, d) == pytest.approx(0.997, abs=1e-5)
    assert burley.encircled(1e-12 * d, d) == pytest.approx(0.5e-12, rel=1e-10)  # no digits lost near 0


@pytest.mark.parametrize("d", [0.005, 0.2, 4.0])
def test_fit_finds_the_shape_it_was_given(d):
    found, difference = burley.fit(7 * shape(d), EDGES)
    assert found == pytest.approx(d, rel=1e-7)
    assert difference < 1e-8


def test_fit_is_the_least_of_a_fine_scan():
    energy = 0.6 * shape(0.05) + 0.4 * shape(1.5)
    d, difference = burley.fit(energy, EDGES)
    scan = np.geomspace(0.01, 10, 4001)
    differences = [profiles.ee_difference(shape(x), energy, EDGES) for x in scan]
    assert difference <= min(differences) + 1e-12
    assert d == pytest.approx(scan[np.argmin(differences)], rel=2e-3)


def test_by_mean_radius_keeps_the_mean():
    """Narrow rings: spreading each ring's energy evenly then costs nothing."""
    edges = np.linspace(0, 100, 20_001)
    energy = np.diff(0.6 * burley.encircled(edges, 0.2) + 0.4 * burley.encircled(edges, 1.5))
    d, difference = burley.by_mean_radius(energy, edges)
    assert d == pytest.approx(0.6 * 0.2 + 0.4 * 1.5, rel=1e-5)
    best, least = burley.fit(energy, edges)
    assert best < d
    assert difference > 2 * least


def test_channels_are_fitted_one_by_one():
    energy = np.stack([shape(0.4), 0.5 * shape(0.1) + 0.5 * shape(0.4), 3 * shape(0.1)], axis=1)
    for function in (burley.fit, burley.by_mean_radius):
        d, difference = function(energy, EDGES)
        assert d.shape == difference.shape == (3,)
        for channel in range(3):
            one = function(energy[:, channel], EDGES)
            assert (d[channel], difference[channel]) == pytest.approx((float(one[0]), float(one[1])), rel=1e-6)
            assert one[0].shape == ()


def test_skin_is_not_burleys_shape():
    """.02 to .06 for skin tones per channel (lutgen/solvers/README.md, Burley); here at single wavelengths, and the
    mean radius is worse."""
    edges = profiles.ring_edges()
    for nm in (450.0, 550.0, 650.0):
        traced = path_table.profile(lutgen.layers(lutgen.preset("light"), nm), edges, photons=100_000)
        d, difference = burley.fit(traced.energy, edges)
        assert 0.005 < difference < 0.07
        assert burley.by_mean_radius(traced.energy, edges)[1] > difference
        assert 0.3 < traced.radius_mm(0.5) / (1.55 * d) < 2


def test_profiles_without_a_shape_are_refused():
    with pytest.raises(lutgen.InputError, match="without energy"):
        burley.fit(np.zeros(len(EDGES) - 1), EDGES)
    with pytest.raises(lutgen.InputError, match=r"shape \(3,\); 80 rings are needed"):
        burley.fit(np.ones(3), EDGES)
    with pytest.raises(lutgen.InputError, match="finite ascending"):
        burley.by_mean_radius(np.ones(2), np.array([0, 1, np.inf]))
