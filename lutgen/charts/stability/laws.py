"""What must hold where such methods are known to fail: each law, what measures it here, and the most that is allowed.

`lutgen stability` draws them as a table; the tests hold every one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np

import lutgen
from lutgen import device as ocl
from lutgen.charts.document.spectra import as_mixed
from lutgen.charts.stability.kernel_values import WIDTHS, draws, evaluate, wide
from lutgen.skin.tissue import Layer, Skin, Tissue, layers, preset
from lutgen.solvers import adding_doubling, dipole, direct, path_table, paths, profiles
from lutgen.tables import bake


@dataclass(frozen=True)
class Law:
    """What holds, the failure that it guards against, what is measured, how, and the most allowed (0: none at all)."""

    name: str
    failure: str
    measured: str
    measure: Callable[[], float]
    allowed: float


def _sigmas(stack: list[Layer], method: str = "path-table", photons: int = 100_000, **options) -> float:
    """Distance from adding-doubling in standard errors."""
    walked = lutgen.reflectance(stack, method, photons=photons, seed=11, **options)
    return abs(walked.diffuse - adding_doubling.stack(stack)[0]) / walked.std_error


def turned_length() -> float:
    """Off ±z by a cosine of 0.6 and by a right angle, with every number of lanes."""
    z, zero = np.array([1.0, -1.0] * 8), np.zeros(16)
    statement = "out[0] = a; out[1] = a; out[2] = b; turn(&out[0], &out[1], &out[2], {}, 0.5f);"
    turns = (statement.format(turn) for turn in ("a + 0.6f, a + 0.48f, a + 0.64f", "a, a + 0.6f, a + 0.8f"))
    turned = [evaluate(turn, zero, z, lanes=lanes, outputs=3) for turn in turns for lanes in WIDTHS]
    return float(np.abs(np.linalg.norm(turned, axis=1) - 1).max())


def isotropic_walk() -> float:
    """g = 0 divides by zero in the usual form of Henyey-Greenstein sampling; near it a series takes over."""
    return max(_sigmas([Layer(np.inf, 0.5, 10 / (1 - g), g)], photons=300_000) for g in (0.0, 1e-7, 0.05))


def forward_walk() -> float:
    """Nearly straight scattering, and backward; fewer photons at g = 0.999, where each scatters most often."""
    of_g = {-0.5: 300_000, 0.95: 300_000, 0.99: 300_000, 0.999: 100_000}
    return max(_sigmas([Layer(np.inf, 0.5, 10 / (1 - g), g)], photons=photons) for g, photons in of_g.items())


def cosines_outside() -> float:
    """At the ends of the random number, where rounding leaves [-1, 1]; one float of it is 3e-3 at g = -0.9999."""
    statement = "hg_t h = hg_constants($g); out[0] = hg_cosine(h, a, 1.0f / hg_denominator(h, a));"
    ends = np.array([-(2.0**31), 2.0**31 - 128, -(2.0**31) + 128, 0.0] * 4)
    cosines = np.array([evaluate(statement, ends, g=g)[0] for g in (-0.9999, -0.5, 0.0, 0.1, 0.5, 0.9999)])
    off_ends = np.abs(cosines[:, :2] - [-1, 1]) > 3e-3
    return float((~(np.abs(cosines) <= 1)).sum() + off_ends.sum())


def fresnel_at_normal_incidence() -> float:
    """0/0 in the form of sines and tangents."""
    return abs(float(adding_doubling.fresnel(np.ones(1), 1.4, 1.0)[0]) * 36 - 1)


def let_out_beyond_critical() -> float:
    """Whatever random number is drawn: the greatest there is."""
    cosine = np.linspace(0, 0.699, 16)
    kept = evaluate("out[0] = TO_VF(reflects(a, b, 1.4f));", np.full(16, 1 - 2.0**-24), cosine)[0]
    return float((kept != -1).sum())


def lengths_off_their_ends() -> float:
    """Of uniform numbers and of paths, at the least and the greatest random bits: inside (0, 1), and finite."""
    off = 0
    for bits, uniform, length in ((0, 2.0**-24, 31 * math.log(2)), (0xFFFFFFFF, 1 - 2.0**-24, 0.0)):
        statement = f"vu bits = {bits}u; out[0] = uniform_of(bits); out[1] = exponential(bits, 1.0f);"
        uniforms, lengths = evaluate(statement, np.ones(16), outputs=2)
        off += (~((np.abs(uniforms / uniform - 1) <= 1e-6) & (np.abs(lengths - length) <= 1e-5))).sum()
    return float(off)


def filled_sum() -> float:
    """A float sum of weights near 1 stops growing at 1.7e7; the sums here count units of fixed size in 64 bits."""
    return (paths.PHOTONS[1] + 1) * path_table._FIXED_POINT / 2.0**63


def needed_of_budget() -> float:
    """One and a half times what a block's lives take in the mean, 5 σ and more, over its budget in 32 bits.

    Over lives of 1 step to the longest that is walked; a budget that wraps around is too small for some of them.
    """
    steps = np.geomspace(1, path_table.MAX_STEPS_PER_LIFE, 61)
    ones = np.ones(len(steps))
    medium = path_table.Medium(500 * ones, steps, 0 * ones, ones, 0.1, 1.4)
    blocks = path_table.BLOCK_PHOTONS.values()
    budgets = [path_table._jobs(medium, block, 0, block)["max_steps"] for block in blocks]
    return float(max((1.5 * block * steps / budget).max() for block, budget in zip(blocks, budgets, strict=True)))


def boundary_overshoot() -> float:
    """Steps that end on, graze or hugely overstep an interface, between layers alike and unlike."""
    thicknesses = (1e-6, 1e-3, 0.06, 0.25, 5.0)
    pairs = (((0.8, 25, 0.78), (0.8, 25, 0.78)), ((5.0, 25, 0.78), (0.2, 25, 0.78)))
    stacks = [[Layer(mm, *upper), Layer(np.inf, *lower)] for mm in thicknesses for upper, lower in pairs]
    return max(_sigmas(stack, photons=300_000) for stack in stacks)


def cells_that_differ() -> float:
    """No sum depends on the order of atomics, nor on how the blocks are split over launches."""
    medium, reach = bake.skin_medium(Tissue(), np.array([450.0, 620.0]))
    edges = profiles.ring_edges()
    runs = [path_table.trace(medium, *reach, edges, 10_000, blocks_per_launch=size).energy for size in (None, None, 3)]
    return float(sum((run != runs[0]).sum() for run in runs))


def biased_bit() -> float:
    """A fair bit is set in half of the draws, with a standard error of half the root of their number."""
    raw = draws(3, 500_000, 0, 4096)[1]
    ones = ((raw[..., None] >> np.arange(32, dtype="u4")) & 1).sum(axis=(0, 1))
    return float(np.abs(ones / raw.size - 0.5).max() * 2 * np.sqrt(raw.size))


def equal_states() -> float:
    """Of 64 blocks of 16 lanes, at the start and a thousand draws later (told by the four draws that end there)."""
    streams = [draws(3, 500_000, block, 1000) for block in range(64)]
    starts = {tuple(state) for start, _ in streams for state in start.T.tolist()}
    later = {tuple(stream[-4:]) for _, raw in streams for stream in raw.T.tolist()}
    return float(2 * 64 * 16 - len(starts) - len(later))


def roulette_bias() -> float:
    """At thresholds high enough for roulette to matter."""
    stack = layers(preset("brown"), 500)
    return max(_sigmas(stack, "direct", threshold=threshold, survivors=10) for threshold in (0.01, 0.1))


def clear_top() -> float:
    """Layers of no thickness, of no absorption and scattering, and of an optical thickness that is no float."""
    below = Layer(np.inf, 0.3, 20, 0.8)
    plain = lutgen.reflectance([below]).diffuse
    tops = Layer(0, 9, 20, 0.8), Layer(1, 0, 0, 0), Layer(1e-200, 1e-200, 20, 0.8)
    return max(abs(lutgen.reflectance([top, below]).diffuse - plain) for top in tops)


def missing_light() -> float:
    """Everything comes back, at last."""
    back = lutgen.reflectance([Layer(np.inf, 0, 20, 0.8)])
    return abs(back.diffuse + back.specular - 1)


def low_albedo() -> float:
    """From the least reduced albedo that the dipole answers."""
    albedos = np.linspace(dipole.least_albedo(1.4), 1, 8)
    stacks = [[Layer(np.inf, 1 - a, a / (1 - g), g)] for a, g in product(albedos, (0.0, 0.5, 0.75, 0.9))]
    return max(abs(dipole.reflectance(stack).diffuse / adding_doubling.stack(stack)[0] - 1) for stack in stacks)


def near_source() -> float:
    """Encircled energy from a tenth of a millimetre, a mean free path here, on."""
    stack, edges = [Layer(np.inf, 0.5, 38, 0.75)], np.concatenate([[0.0], np.geomspace(0.1001, 10, 16), [1e4]])
    traced = path_table.profile(stack, edges, photons=100_000, seed=2)
    return float(profiles.ee_difference(dipole.profile(stack, edges).energy, traced.energy, edges))


def lanes_apart() -> float:
    """Ring sums of one source at every number of lanes, against more photons with the device's own."""
    stack, edges = [Layer(0.1, 3.0, 25, 0.78), Layer(np.inf, 0.3, 25, 0.78)], np.array([0.0, 0.05, 0.5, 20.0])

    def rings(photons: int, seed: int, device: ocl.Device) -> tuple[np.ndarray, np.ndarray]:
        """Share of the photons in each ring, and its variance."""
        """Share of the photons in each ring, and its variance."""
        total, square, _ = path_table.ring_sums(stack, edges, photons, seed, device)
        return total / photons, (square / photons - (total / photons) ** 2) / photons

    mean, variance = rings(200_000, 4, ocl.choose())
    narrow = [rings(60_000, 3, wide(lanes)) for lanes in WIDTHS]
    return float(max((np.abs(m - mean) / np.sqrt(v + variance)).max() for m, v in narrow))


def used_budget() -> float:
    """By the longest work-item of a trace at a wavelength of long paths."""
    medium, _ = bake.skin_medium(Tissue(), np.array([640.0]))
    device, used = ocl.choose(), 0.0
    for jobs, results, _, _ in path_table._launches(medium, 65_536, 0, device, None, path_table.Tally()):
        used = max(used, float((results["events"] / device.lanes / jobs["max_steps"]).max()))
    return used


def mixed_closed_form() -> float:
    """Steps from mu_t that keep exp(-mu_a s) solve, exactly, a medium that scatters with mu_s + mu_a."""
    stack = layers(Skin(0.43, 0.7, 0.01), 450)
    walked = direct.shares(stack, 100_000, 5, absorption="mixed")
    return abs(walked.diffuse - adding_doubling.stack(as_mixed(stack))[0]) / walked.diffuse_error


def quadrature_drift() -> float:
    """Dark skin, and forward scattering, where too many Legendre moments are no longer integrated.

    The latter errs by 6e-7 with 1.5 moments per direction, by 9e-6 with 1 and by 5e-5 with 2.
    """
    stacks = layers(preset("dark"), 450), [Layer(np.inf, 0.5, 100, 0.9)]
    return max(float(np.ptp([lutgen.reflectance(stack, nodes=n).diffuse for n in (16, 32, 64)])) for stack in stacks)


def far_rings() -> float:
    """Half floats go subnormal below 6e-5: the default set's rings below that, against the paths that it stores."""
    luts = lutgen.load()
    again, stored = luts.expand().profile_lut.shape, luts.profile_lut.shape
    tail = (again > 1e-30) & (again < 6e-5)
    return float(np.abs(stored[tail] / again[tail] - 1).max())


def clamped_share() -> float:
    """Far rings are nearly pure red: negative in sRGB, hardly so in ACEScg. As stored, and expanded from its paths."""
    luts = lutgen.load()
    return float(max(same.profile_lut.clamped_share.max() for same in (luts, luts.expand())))


LAWS = [
    Law("directions stay unit", "μz = ±1: frame and sign", "length of a direction turned off ±z, minus 1",
        turned_length, 1e-6),
    Law("isotropic scattering is exact", "g = 0: division", "path-table off adding-doubling at g = 0 to 0.05, in σ",
        isotropic_walk, 4),
    Law("extreme anisotropy is exact", "g → 1", "path-table off adding-doubling at g = −0.5 to 0.999, in σ",
        forward_walk, 4),
    Law("cosines stay in range", "scattering cosine outside [−1, 1]", "cosines outside [−1, 1] or off its ends, of 96",
        cosines_outside, 0),
    Law("Fresnel at normal incidence", "Fresnel 0/0 at normal incidence",
        "reflectance at normal incidence off 1/36, relative", fresnel_at_normal_incidence, 1e-12),
    Law("total reflection", "Fresnel beyond the critical angle", "photons let out beyond the critical angle, of 16",
        let_out_beyond_critical, 0),
    Law("random ends are finite", "log(0)", "lengths off theirs at the ends of the random numbers, of 32",
        lengths_off_their_ends, 0),
    Law("sums have room", "float tallies that stagnate", "share of a 64-bit sum that the most photons can fill",
        filled_sum, 1),
    Law("steps fit their counter", "32-bit counters that overflow",
        "share of a work-item's 32-bit step budget that lives take", needed_of_budget, 1),
    Law("interfaces leave no trace", "float32 overshoot at a boundary",
        "off adding-doubling, interface at 1 nm to 5 mm, in σ", boundary_overshoot, 4),
    Law("same seed, same result", "same seed, other result", "table cells that differ between three runs",
        cells_that_differ, 0),
    Law("bits are fair", "weak generators", "bias of the worst of 32 bits, in σ", biased_bit, 4.5),
    Law("streams are apart", "overlapping streams", "equal states, of 2,048", equal_states, 0),
    Law("roulette is unbiased", "roulette bias", "thresholds 1 and 10 %, off adding-doubling, in σ", roulette_bias, 4),
    Law("an empty layer changes nothing", "zero-thickness or clear top layer", "change of the reflectance",
        clear_top, 1e-9),
    Law("without absorption all returns", "μa = 0 in a semi-infinite medium",
        "light missing without absorption (walks refuse it)", missing_light, 5e-5),
    Law("the dipole answers where it is right", "diffusion at low albedo",
        "dipole's largest relative error where it answers", low_albedo, dipole.TOLERANCE),
    Law("the dipole is right a free path away", "diffusion near the source",
        "dipole's encircled energy beyond a mean free path, difference", near_source, 0.12),
    Law("all numbers of lanes agree", "scalar against vector truth values",
        "1, 4, 8 and 16 lanes against more photons, in σ", lanes_apart, 4),
    Law("a work-item ends by itself", "a work-item that never ends", "share of its step budget that a work-item took",
        used_budget, 1),
    Law("mixed absorption is its closed form", "mixed absorption at high μa",
        "off its closed form (it is biased, and named so), in σ", mixed_closed_form, 4),
    Law("more nodes change nothing", "quadrature drift in adding-doubling", "spread over 16, 32 and 64 nodes",
        quadrature_drift, 1e-6),
    Law("far rings keep their accuracy", "half-float tails below 6e-5", "far rings as stored, relative error",
        far_rings, 1e-5),
    Law("light stays in gamut", "out-of-gamut RGB", "share clamped off a channel in the default set",
        clamped_share, 0.01),
]  # fmt: skip
"""Every law, in the order of the table."""
