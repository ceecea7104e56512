"""Where methods are known to fail: one test per row of that list that concerns the trace, solver, files or color."""

import math

import numpy as np
import pytest

import lutgen
from lutgen import color
from lutgen.charts.stability.probing import WIDTHS, draws, evaluate, wide
from lutgen.skin import tissue
from lutgen.skin.tissue import Layer
from lutgen.solvers import adding_doubling, path_table, profiles
from lutgen.solvers.paths import PathTable
from lutgen.tables import bake, expand, storage


def agrees(layers, photons=300_000, seed=4, **options):
    """Whether path-table meets adding-doubling within 4 of its own sigmas."""
    found = lutgen.reflectance(layers, method="path-table", photons=photons, seed=seed, **options)
    assert abs(found.diffuse - lutgen.reflectance(layers).diffuse) < 4 * found.std_error


def test_direction_straight_down_and_up():
    """mu_z = +1 and -1: the frame stays finite, and a deflection of 0 keeps the direction and its sign."""
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
        assert np.abs(np.linalg.norm(aside, axis=0) - 1).max() < 1e-6
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


def test_isotropic_scattering():
    """g = 0 divides by zero in the usual form."""
    agrees([Layer(np.inf, 0.5, 10, 0.0, 1.4)])


@pytest.mark.parametrize("g", [-0.5, 1e-7, 0.05, 0.95, 0.99, 0.999])
def test_extreme_anisotropy(g):
    """Backward, nearly isotropic and nearly straight scattering."""
    agrees([Layer(np.inf, 0.5, 10 / (1 - g), g, 1.4)])


def test_scattering_cosine_stays_in_range():
    """Henyey-Greenstein at the ends of the random number, where rounding leaves [-1, 1]."""
    ends = np.array([-(2.0**31), 2.0**31 - 128, -(2.0**31) + 128, 0.0] * 4, "f4")
    for g in (-0.9999, -0.5, 0.0, 0.1, 0.5, 0.9999):
        statement = "hg_t h = hg_constants($g); out[0] = hg_cosine(h, a, 1.0f / hg_denominator(h, a));"
        cosine = evaluate(statement, ends, g=g)[0]
        assert np.all(np.isfinite(cosine) & (np.abs(cosine) <= 1))
        assert cosine[:2] == pytest.approx([-1, 1], abs=3e-3)  # one float of the random number at g = -.9999


def test_fresnel_at_normal_incidence_and_beyond_the_critical_angle():
    """0/0 in the sine and tangent form; nothing gets out beyond the critical angle, whatever is drawn."""
    assert adding_doubling.fresnel(np.ones(1), 1.4, 1.0)[0] == pytest.approx(1 / 36, rel=1e-12)
    never = evaluate("out[0] = TO_VF(reflects(a, b, 1.4f));", np.full(16, 1 - 2.0**-24), np.linspace(0, 0.69, 16))[0]
    assert np.all(never == -1)


def test_logarithm_of_zero_cannot_occur():
    """The least and greatest random bits give a finite path or life, and a uniform number inside (0, 1)."""
    for bits, u, path in ((0, 2.0**-24, 31 * math.log(2)), (0xFFFFFFFF, 1 - 2.0**-24, 0.0)):
        found = evaluate(
            f"vu bits = {bits}u; out[0] = uniform_of(bits);"
            "out[1] = exponential(bits, 1.0f);",
            np.ones(16), outputs=2,
        )  # fmt: skip
        assert found[0] == pytest.approx(u, rel=1e-6)
        assert found[1] == pytest.approx(path, abs=1e-5)


def test_tallies_do_not_stagnate():
    """A float sum of weights near 1 stops growing at 1.7e7; the fixed-point sum of the same counts does not.

    The trace's tally unit is 2^-30 in 64 bits: room for 8e9 weights of 1, four times the photons a recipe may ask for.
    """
    total = np.float32(2.0**24)
    assert total + np.float32(1) == total
    assert (path_table.PHOTONS[1] + 1) * path_table._FIXED_POINT * 4 <= 2.0**63
    table = _trace(np.array([600.0]), 400_000)
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


def _trace(nm, photons, **options) -> PathTable:
    medium, reach = bake.skin_medium(lutgen.preset("light"), nm)
    return path_table.trace(medium, *reach, profiles.default_edges(), photons, **options)


@pytest.mark.parametrize("thickness", [1e-6, 1e-3, 0.06, 0.25, 5.0])
def test_boundary_overshoot_in_single_precision(thickness):
    """A step that ends on, grazes or hugely oversteps the interface: any thickness gives the same for like layers."""
    alike = (0.8, 25, 0.78, 1.4)
    found = lutgen.reflectance([Layer(thickness, *alike), Layer(np.inf, *alike)], "path-table", photons=300_000)
    assert abs(found.diffuse - lutgen.reflectance([Layer(np.inf, *alike)]).diffuse) < 4 * found.std_error
    agrees([Layer(thickness, 5.0, 25, 0.78, 1.4), Layer(np.inf, 0.2, 25, 0.78, 1.4)])


def test_same_seed_same_result():
    """No atomic order in the sums: two runs, and runs split otherwise, are byte-identical."""
    nm = np.array([450.0, 620.0])
    first, again, split = (_trace(nm, 10_000, blocks_per_launch=size) for size in (None, None, 3))
    assert first.energy.tobytes() == again.energy.tobytes() == split.energy.tobytes()


def test_streams_do_not_overlap():
    """128-bit keys go through a bijection: all states differ, at the start and a thousand draws later."""
    starts = {tuple(c) for block in range(64) for c in draws(3, 500_000, block, 1)[0].T}
    assert len(starts) == 64 * 16
    later = {tuple(stream[-4:]) for block in range(64) for stream in draws(3, 500_000, block, 1000)[1].T.tolist()}
    assert len(later) == 64 * 16


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
    assert lutgen.reflectance([Layer(1, 0, 0, 0, 1.4), below]).diffuse == pytest.approx(plain, abs=1e-9)
    assert 0 < lutgen.reflectance([Layer(1, 0, 0, 0, 1.5), below]).diffuse < 1  # a glass plate, guided light and all
    agrees([Layer(0, 9, 20, 0.8, 1.4), below])


def test_no_absorption_in_a_semi_infinite_medium():
    """Everything comes back, at last: adding-doubling says so within 5e-5, path-table refuses a walk without end."""
    clear = [Layer(np.inf, 0, 20, 0.8, 1.4)]
    result = lutgen.reflectance(clear)
    assert result.diffuse + result.specular == pytest.approx(1, abs=5e-5)
    with pytest.raises(lutgen.InputError, match="does not end"):
        lutgen.reflectance(clear, method="path-table")


@pytest.mark.parametrize("lanes", WIDTHS)
def test_truth_of_scalars_and_vectors(lanes):
    """The same source at every width: tables of 1, 4, 8 and 16 lanes agree within their sigmas."""
    layers = [Layer(0.1, 3.0, 25, 0.78, 1.4), Layer(np.inf, 0.3, 25, 0.78, 1.4)]
    edges = np.array([0.0, 0.05, 0.5, 20.0])
    total, square, _ = path_table.ring_sums(layers, edges, 60_000, 3, wide(lanes))
    wide_total, wide_square, _ = path_table.ring_sums(layers, edges, 200_000, 4)
    mean, reference = total / 60_000, wide_total / 200_000
    sigma = np.sqrt((square / 60_000 - mean**2) / 60_000 + (wide_square / 200_000 - reference**2) / 200_000)
    assert np.all(np.abs(mean - reference) < 4 * sigma)


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


def test_quadrature_does_not_drift_with_nodes():
    """Dark skin, and forward scattering, where too many Legendre moments are no longer integrated."""
    for stack in (lutgen.layers(lutgen.preset("dark"), 450), [Layer(np.inf, 0.5, 100, 0.9, 1.4)]):
        values = [lutgen.reflectance(stack, nodes=n).diffuse for n in (16, 32, 64)]
        assert np.ptp(values) < 1e-6


def test_profile_tails_are_stored_as_floats(tmp_path):
    """Half floats go subnormal below 6e-5: files keep floats, and far rings keep their relative accuracy."""
    luts = lutgen.bake({"photons": 4096, "wavelengths": "6"})
    loaded = storage.load(storage.save(luts, tmp_path / "set"))
    tail = luts.profile_lut.shape[(luts.profile_lut.shape > 1e-30) & (luts.profile_lut.shape < 6e-5)]
    kept = loaded.profile_lut.shape[(luts.profile_lut.shape > 1e-30) & (luts.profile_lut.shape < 6e-5)]
    assert len(tail) > 100
    assert np.abs(kept / tail - 1).max() < 1e-6


def test_out_of_gamut_light_is_clamped_in_acescg_and_its_share_stored():
    """Far rings are nearly pure red: negative in sRGB, at most 1 % of a channel in ACEScg, never negative in a LUT."""
    luts = lutgen.load()
    assert (luts.profile_lut.shape >= 0).all()
    assert luts.profile_lut.clamped_share.max() <= 0.01
    dark = luts.profile(0.158, 0.7, 0.05)
    assert color.from_acescg(dark.energy, "srgb").min() < 0
    energy = np.array([[[1.0, 0.5, -0.004], [0.0, 0.5, 0.404]]])
    shape, share = expand.normalized(energy)
    assert shape.min() == 0
    assert shape.sum(axis=1) == pytest.approx(np.ones((1, 3)))
    assert share[0].tolist() == pytest.approx([0, 0, 0.004 / 0.404])
