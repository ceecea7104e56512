"""The kernels' building blocks: functions to stated accuracy, sampling laws, random streams."""

import math

import numpy as np
import pytest
from reference import Xoshiro128Plus, fresnel_sin_tan

from lutgen.charts.stability.kernel_values import WIDTHS, draws, evaluate
from lutgen.solvers import adding_doubling

RANDOM = np.random.default_rng(11)
COUNT = 1 << 18
RAW = "mix_lanes(AS_VU(a))"  # 32 random bits of a uniform number's own bits
SIGNED = "(a * 2.0f - 1.0f) / SIGNED_UNIT"


def uniform(count=COUNT):
    return RANDOM.random(count).astype("f4")


def mixed(u: np.ndarray) -> np.ndarray:
    """RAW of each number, on the host."""
    x = u.astype("f4").view("u4").copy()
    for shift, factor in ((16, 0x7FEB352D), (15, 0x846CA68B), (16, 1)):
        x ^= x >> np.uint32(shift)
        x *= np.uint32(factor)
    return x


@pytest.mark.parametrize("lanes", WIDTHS)
def test_exponential_exp_and_azimuth_are_accurate(lanes):
    u = np.concatenate([uniform(4080), 2.0 ** -np.arange(1.0, 17)]).astype("f4")
    found = evaluate(f"out[0] = exponential({RAW}, 1.0f);", u, lanes=lanes)[0]
    exact = -np.log(((mixed(u) & 0x7FFFFFFF) | 1) / 2.0**31)
    assert np.all(np.abs(found - exact) < 2e-6 * np.maximum(1, np.abs(exact)))
    x = (-90 * u).astype("f4")
    found, exact = evaluate("out[0] = exp_lanes(a);", x, lanes=lanes)[0], np.exp(x.astype(float))
    normal = x > -86
    # x log2(e) is rounded once before its whole part is taken off: |x| 2^-24 relative.
    assert np.all(np.abs(found / exact - 1)[normal] < 3e-7 + 1.2e-7 * np.abs(x[normal]))
    assert np.all(found[x < -88] == 0)
    sine, cosine = evaluate(f"uniform_azimuth({RAW}, out, out + 1);", u, lanes=lanes, outputs=2).astype(float)
    bits = mixed(u)
    angle = np.pi / 4 + np.pi / 2 * ((bits & 0x7FFFFF) / 2.0**23 - 0.5)
    assert np.abs(sine - np.sin(angle) * np.where(bits >> 31, -1, 1)).max() < 1e-6
    assert np.abs(cosine - np.cos(angle) * np.where(bits >> 30 & 1, -1, 1)).max() < 1e-6


@pytest.mark.parametrize("g", [-0.9, -0.3, -0.05, 0.0, 1e-6, 0.01, 0.0999, 0.1001, 0.5, 0.78, 0.9, 0.99, 0.999])
def test_henyey_greenstein_sampling_has_its_cosine_and_its_distribution(g):
    """Mean cosine g within 4 sigma and Kolmogorov's distance below its 1e-4 quantile.

    Beyond g = .99 a float's spacing near cosine 1 is no longer small against 1 - cosine: there only the mean is asked.
    """
    u = uniform()
    statement = f"hg_t h = hg_constants($g); vf x = {SIGNED}; out[0] = hg_cosine(h, x, 1.0f / hg_denominator(h, x));"
    cosine = evaluate(statement, u, g=g)[0].astype(float)
    assert np.all(np.abs(cosine) <= 1)
    assert abs(cosine.mean() - g) < 4 * cosine.std() / math.sqrt(COUNT) + 1e-6
    if g > 0.99:
        return
    s = np.sort(cosine)
    cdf = (1 + s) / 2 if g == 0 else (1 - g * g) / (2 * g) * (1 / np.sqrt(1 + g * g - 2 * g * s) - 1 / (1 + g))
    distance = np.abs(cdf - (np.arange(COUNT) + 0.5) / COUNT).max()
    assert distance < 2.23 / math.sqrt(COUNT)


def test_henyey_greenstein_forms_meet_where_they_change():
    u = uniform(4096)
    statement = f"hg_t h = hg_constants($g); vf x = {SIGNED}; out[0] = hg_cosine(h, x, 1.0f / hg_denominator(h, x));"
    below, above = (evaluate(statement, u, g=g)[0] for g in (0.09999999, 0.10000001))
    assert np.abs(below - above).max() < 5e-6


@pytest.mark.parametrize("lanes", WIDTHS)
def test_turn_keeps_length_and_angle(lanes):
    """From any direction, +z and -z included, the new one is a unit vector at the wanted cosine."""
    rng = np.random.default_rng(1)
    d = rng.normal(size=(3, 4096))
    d[:, :8] = np.array([[0, 0, 1]] * 4 + [[0, 0, -1]] * 4).T
    d /= np.linalg.norm(d, axis=0)
    c, t = rng.uniform(-1, 1, 4096), rng.random(4096)
    statement = (
        "out[0] = a; out[1] = b; out[2] = c;"
        f"vf p, q, sine = sqrt(1.0f - d * d); uniform_azimuth({RAW.replace('(a)', '(e)')}, &p, &q);"
        "turn(&out[0], &out[1], &out[2], d, sine * p, sine * q, 1.0f / (1.0f + fabs(c)));"
    )
    new = evaluate(statement, *d, c, t, lanes=lanes, outputs=3).astype(float)
    assert np.abs(np.linalg.norm(new, axis=0) - 1).max() < 2e-6
    assert np.abs((new * d.astype("f4")).sum(axis=0) - c).max() < 3e-6


def test_turn_is_uniform_in_azimuth():
    t = uniform()
    zero, one = np.zeros_like(t), np.ones_like(t)
    statement = (
        f"out[0] = a; out[1] = a; out[2] = b; vf p, q; uniform_azimuth({RAW.replace('(a)', '(c)')}, &p, &q);"
        "turn(&out[0], &out[1], &out[2], a, p, q, 0.5f);"
    )
    x, y, _ = evaluate(statement, zero, one, t, outputs=3)
    angle = np.sort(np.arctan2(y, x) / (2 * np.pi) + 0.5)
    assert np.abs(angle - (np.arange(COUNT) + 0.5) / COUNT).max() < 2.23 / math.sqrt(COUNT)


@pytest.mark.parametrize("n", [1.0, 1.33, 1.4, 1.5])
def test_surface_reflects_as_fresnel_says(n):
    """The rate at which uniform numbers say `reflected`, per incidence, within 4.5 sigma; always beyond critical."""
    cosines = np.repeat([1.0, 0.95, 0.8, 0.75, 0.71, 0.5, 0.1, 1e-6], 1 << 14)
    found = evaluate("out[0] = TO_VF(reflects(a, b, $n));", uniform(len(cosines)), cosines, n=n)[0]
    rate = -found.reshape(8, -1).mean(axis=1)
    exact = adding_doubling.fresnel(np.array([1.0, 0.95, 0.8, 0.75, 0.71, 0.5, 0.1, 1e-6]), n, 1.0)
    assert np.all(np.abs(rate - exact) <= 4.5 * np.sqrt(exact * (1 - exact) / (1 << 14)) + 1e-9)


def test_fresnel_is_the_documents_sines_and_tangents_where_those_are_finite():
    cosines = np.linspace(0.72, 0.999, 50)
    expected = [fresnel_sin_tan(c, 1.4, 1.0) for c in cosines]
    assert np.allclose(adding_doubling.fresnel(cosines, 1.4, 1.0), expected, rtol=1e-9)


@pytest.mark.parametrize("lanes", WIDTHS)
def test_generator_is_xoshiro128_plus(lanes):
    start, out = draws(5, 450_000, 3, 200, lanes)
    for lane in range(lanes):
        stream = Xoshiro128Plus([int(v) for v in start[:, lane]])
        assert [stream.next() for _ in range(200)] == out[:, lane].tolist()


def test_streams_of_different_keys_differ_and_do_not_correlate():
    keys = [(0, 450_000, 0), (1, 450_000, 0), (0, 450_001, 0), (0, 450_000, 1), (2**32 - 1, 0, 2**20)]
    streams = [draws(*key, 4096)[1] for key in keys]
    starts = np.concatenate([draws(*key, 1)[0] for key in keys], axis=1)
    assert len({tuple(column) for column in starts.T}) == 16 * len(keys)
    u = np.concatenate([s.T for s in streams]) / 2.0**32 - 0.5  # [80 streams, 4096]
    correlation = u @ u.T / 4096 * 12
    off = correlation[~np.eye(len(u), dtype=bool)]
    assert np.abs(off).max() < 5.5 / math.sqrt(4096)  # 3160 pairs
    assert np.abs((u[:, 1:] * u[:, :-1]).mean(axis=1) * 12).max() < 4.5 / math.sqrt(4096)


def test_output_is_uniform_in_every_bit_used_and_in_pairs():
    raw = np.concatenate([draws(seed, 550_000, 0, 1 << 14)[1].ravel() for seed in range(4)])  # 2^20 draws
    for bit in range(9, 32):
        ones = int(((raw >> bit) & 1).sum())
        assert abs(ones - len(raw) / 2) < 4.5 * math.sqrt(len(raw) / 4)
    cells = (raw >> 24).astype(int)
    chi2 = float(((np.bincount(cells, minlength=256) - len(raw) / 256) ** 2 / (len(raw) / 256)).sum())
    assert abs(chi2 - 255) < 4.5 * math.sqrt(2 * 255)
    lanes = raw.reshape(-1, 16)
    pairs = (lanes[:-1:2] >> 28).astype(int) * 16 + (lanes[1::2] >> 28).astype(int)
    expected = pairs.size / 256
    chi2 = float(((np.bincount(pairs.ravel(), minlength=256) - expected) ** 2 / expected).sum())
    assert abs(chi2 - 255) < 4.5 * math.sqrt(2 * 255)


def test_masks_are_minus_one_and_bits_name_their_lanes():
    """Vectors' true is -1 and scalars' is 1: MASK, SELECT and bits hide it at every width."""
    for lanes in WIDTHS:
        x = np.resize([2.0, 0.0, 1.0], 16).astype("f4")
        mask, chosen, bits = evaluate(
            "vi m = MASK(a > 1.0f); out[0] = TO_VF(m); out[1] = SELECT((vf)(5.0f), (vf)(7.0f), m); "
            "out[2] = (vf)((float)bits(m));", x, lanes=lanes, outputs=3,
        )  # fmt: skip
        assert mask.tolist() == [-1.0 if v > 1 else 0.0 for v in x]
        assert chosen.tolist() == [7.0 if v > 1 else 5.0 for v in x]
        expected = [sum(1 << i for i in range(lanes) if x[start + i] > 1) for start in range(0, 16, lanes)]
        assert bits[::lanes].tolist() == expected
