"""Exact laws and guards of kernels and solvers that a statistical test is too wide to see.

Laws of where such methods are known to fail, which `lutgen stability` measures too, are in charts/test_laws.py.
"""

import math

import numpy as np
import pytest

import lutgen
from lutgen import device as ocl
from lutgen.charts.stability.kernel_values import WIDTHS, evaluate
from lutgen.skin import tissue
from lutgen.skin.tissue import Layer
from lutgen.solvers import adding_doubling, path_table, profiles
from lutgen.tables import bake


def test_a_deflection_of_zero_keeps_direction_and_sign():
    """mu_z = +1 and -1, exactly, with every number of lanes; a right angle leaves nothing of the height."""
    z = np.array([1.0, -1.0] * 8, "f4")
    zero, one = np.zeros(16, "f4"), np.ones(16, "f4")
    statement = (
        "out[0] = a; out[1] = a; out[2] = b;"
        "vf p, q, sine = sqrt(1.0f - c * c); uniform_azimuth(AS_VU(b) * 77u, &p, &q);"
        "turn(&out[0], &out[1], &out[2], c, sine * p, sine * q, 0.5f);"
    )
    for lanes in WIDTHS:
        straight = evaluate(statement, zero, z, one, lanes=lanes, outputs=3)
        assert np.array_equal(straight, np.stack([zero, zero, z]))
        aside = evaluate(statement, zero, z, zero, lanes=lanes, outputs=3)
        assert np.abs(aside[2]).max() < 1e-6


def test_directions_stay_unit_over_long_walks():
    """Ten thousand turns without renormalization: float rounding alone, no drift of the polynomials."""
    u = np.random.default_rng(0).random(256).astype("f4")
    statement = (
        "out[0] = (vf)(0.0f); out[1] = (vf)(0.0f); out[2] = (vf)(1.0f); hg_t h = hg_constants($g);"
        "rng_t s = start_streams(1u, 2u, get_global_id(0));"
        "for (int k = 0; k < 10000; k++) { vf x = next_signed(&s);"
        "vf cosine = hg_cosine(h, x, 1.0f / hg_denominator(h, x));"
        "vf p, q, sine = sqrt(fma(-cosine, cosine, (vf)(1.0f))); uniform_azimuth(next_bits(&s), &p, &q);"
        "turn(out, out + 1, out + 2, cosine, sine * p, sine * q, 1.0f / (1.0f + fabs(out[2]))); }"
    )
    length = np.linalg.norm(evaluate(statement, u, outputs=3, g=0.8).astype(float), axis=0)
    assert np.abs(length - 1).max() < 1e-3


def test_a_horizontal_direction_gives_finite_numbers():
    """uz = 0 exactly comes once in some 1e8 steps: there the walk's own function."""
    found = evaluate(
        "slope_t slope = slope_of(a); out[0] = slope.per_depth * 0.0f; out[1] = slope.inverse;",
        np.array([0.0, -0.0, 1e-30, -1e-12] * 4), outputs=2,
    )  # fmt: skip
    assert np.array_equal(found[0], np.zeros(16))
    assert found[1] == pytest.approx(np.ones(16), abs=1e-6)


def test_sums_of_many_photons_do_not_stagnate():
    """A float sum of weights near 1 stops growing at 1.7e7; the fixed-point sum of the same counts does not.

    The trace's tally unit is 2^-30 in 64 bits: room for 8e9 weights of 1, four times the photons a recipe may ask for.
    """
    total = np.float32(2.0**24)
    assert total + np.float32(1) == total
    assert (path_table.PHOTONS[1] + 1) * path_table._FIXED_POINT * 4 <= 2.0**63
    medium, reach = bake.skin_medium(lutgen.preset("light"), np.array([600.0]))
    table = path_table.trace(medium, *reach, profiles.ring_edges(), 400_000)
    mu_s, g = tissue.scattering(lutgen.preset("light"), np.array([600.0]))
    exact = adding_doubling.two_layer_grid(0.1, table.mu_epidermis[:, :1], table.mu_dermis[:, :1], mu_s, g, 1.4)
    sigma = math.sqrt(exact.item() * (table.entry - exact.item()) / 400_000)
    assert abs(table.energy[0, :, 0, 0].sum() - exact.item()) < 4 * sigma + 1e-4


def test_counters_do_not_overflow():
    """Steps of a work-item are counted in 32 bits, its events and the sums in 64; the budget stops short of 2^32."""
    endless = path_table.Medium(np.array([500.0]), np.array([1e4]), np.array([0.8]), np.array([0.01]), 0.1, 1.4)
    (job,) = path_table._jobs(endless, 2048, 0, 2048)
    assert job["max_steps"] == 4_000_000_000
    assert path_table.RESULT["events"].itemsize == 8
    assert path_table.RESULT["escaped"].itemsize * 8 > math.log2(max(path_table.BLOCK_PHOTONS.values()))
    with pytest.raises(lutgen.InputError, match="photons"):
        lutgen.reflectance([Layer(np.inf, 1, 10, 0.8)], "path-table", photons=2**31)


def test_ending_photons_by_their_life_is_unbiased():
    """No roulette: the mean does not depend on nu, from the medium's own absorption down to a fifth of it."""
    layers = [Layer(0.1, 1.0, 25, 0.78, 1.4), Layer(np.inf, 1.0, 25, 0.78, 1.4)]
    exact = lutgen.reflectance(layers).diffuse
    for share in (1.0, 0.6, 0.2):
        medium = path_table.medium_of(layers)
        clearer = path_table.Medium(
            medium.wavelength_nm, medium.mu_s_per_mm, medium.g, medium.nu_per_mm * share, 0.1, 1.4
        )
        one, two, photons = 0.0, 0.0, 200_000
        for _, rows in path_table.records(clearer, photons, 8):
            weight = np.exp(-(1.0 - share) * rows[:, 1].astype(float))
            one, two = one + weight.sum(), two + (weight**2).sum()
        sigma = clearer.entry * math.sqrt((two / photons - (one / photons) ** 2) / photons)
        assert abs(clearer.entry * one / photons - exact) < 4 * sigma


def test_zero_thickness_and_clear_top_layers():
    below = Layer(np.inf, 0.3, 20, 0.8, 1.4)
    plain = lutgen.reflectance([below]).diffuse
    vanishing = Layer(1e-200, 1e-200, 20, 0.8, 1.4)  # its optical thickness is no float
    assert lutgen.reflectance([vanishing, below]).diffuse == pytest.approx(plain, abs=1e-12)
    assert lutgen.reflectance([Layer(1e-200, 1e-200, 1e-200, 0, 1.0)]).transmitted == pytest.approx(1, abs=1e-12)
    assert lutgen.reflectance([Layer(0, 9, 20, 0.8, 1.4), below]).diffuse == pytest.approx(plain, abs=1e-12)
    assert 0 < lutgen.reflectance([Layer(1, 0, 0, 0, 1.5), below]).diffuse < 1  # a glass plate, guided light and all
    walked = lutgen.reflectance([Layer(0, 9, 20, 0.8, 1.4), below], "path-table", photons=300_000, seed=4)
    assert abs(walked.diffuse - plain) < 4 * walked.std_error


def test_a_walk_without_absorption_or_end_is_refused():
    with pytest.raises(lutgen.InputError, match="does not end"):
        lutgen.reflectance([Layer(np.inf, 0, 20, 0.8, 1.4)], method="path-table")


def test_a_work_item_always_ends(monkeypatch):
    """The step budget stops a walk whose photons never would, and says so."""
    monkeypatch.setattr(path_table, "MAX_STEPS_PER_LIFE", 1e30)
    endless = path_table.Medium(np.array([500.0]), np.array([20.0]), np.array([0.8]), np.array([1e-9]), 0.1, 1.4)
    jobs = path_table._jobs
    monkeypatch.setattr(path_table, "_jobs", lambda *a: _with(jobs(*a), max_steps=10_000))
    with pytest.raises(lutgen.MachineError, match="exceeded the step budget"):
        path_table.walk_only(endless, 64, path_table.ocl.choose(), path_table.Tally())


def _with(jobs, **fields):
    for name, value in fields.items():
        jobs[name] = value
    return jobs


def test_tabulate_sums_every_record_once_in_its_ring_to_the_unit():
    """A made-up bank of two wavelengths, 5 and 2 blocks: weights of a few units, radii on the edges and between."""
    device = ocl.choose()
    rings, slices, blocks, size = 4, 3, (5, 2), path_table.block_photons(device)
    edges = np.array([0.0, 1.0, 2.0, 4.0, 8.0], "f4")
    rng = np.random.default_rng(2)
    bank = np.zeros((sum(blocks), size, 3), "f4")
    bank[..., 0] = rng.choice(np.array([0.0, 0.5, 1.0, 1.5, 2.0, 3.9, 4.0, 7.0, 9.0], "f4"), bank.shape[:2])
    units = rng.integers(0, 8, bank.shape[:2]) + rng.choice([0.25, 0.75], bank.shape[:2])  # to be rounded
    bank[..., 1] = -np.log(units * 2.0**-30)  # whole path; none of it in the epidermis
    results = np.zeros(sum(blocks), path_table.RESULT)
    results["escaped"] = rng.integers(1, size, sum(blocks))
    nodes = np.concatenate([np.zeros((2, path_table.NODES_E)), np.ones((2, path_table.NODES_D))], axis=1).astype("f4")
    sums = np.zeros((2, slices, rings, path_table.NODES_E, path_table.NODES_D), "i8")
    out = ocl.buffer(device, sums)
    inputs = [ocl.buffer(device, v) for v in (bank, results, np.array([0, 5, 7], "u4"), nodes, edges)]
    ocl.launch(device, path_table.tabulate_kernel(device, rings, slices), (2 * slices, 1), *inputs, out)
    found = ocl.read(device, out, sums).sum(axis=1)
    expected = np.zeros((2, rings))
    for block, (rows, unit) in enumerate(zip(bank, units, strict=True)):
        ring = np.clip(np.searchsorted(edges, rows[:, 0], side="right") - 1, 0, rings - 1)
        kept = slice(0, results["escaped"][block])
        expected[int(block >= 5)] += np.bincount(ring[kept], np.rint(unit[kept]), rings)
    assert np.array_equal(found, np.broadcast_to(expected[..., None, None], found.shape))


def test_structs_of_another_layout_are_refused(monkeypatch):
    import pyopencl.tools

    match = pyopencl.tools.match_dtype_to_c_struct

    def pads(device, name, dtype):
        return np.dtype([*((field, dtype[field]) for field in dtype.names), ("padding", "u4")]), match(
            device, name, dtype
        )[1]

    monkeypatch.setattr(pyopencl.tools, "match_dtype_to_c_struct", pads)
    structs = (("odd_t", np.dtype([("a", "f4"), ("b", "f4")])),)  # a name of its own: declarations are cached
    with pytest.raises(lutgen.MachineError, match="another layout"):
        ocl.struct_source(ocl.choose(), structs)


def test_an_absorbing_slab_obeys_beer_and_lambert_in_every_direction():
    """Nearly one mean free path at grazing, where the thin slab's series would show."""
    cosine, weight = adding_doubling.directions([1.0, 1.4])
    thickness = 0.9 * float(cosine.min())
    R, T = adding_doubling.layer_matrices(thickness, np.array(1.0), np.array(0.0), np.array(0.0), cosine, weight)
    assert np.abs(R).max() < 1e-14
    assert np.diag(T) == pytest.approx(np.exp(-thickness / cosine), rel=1e-10)
