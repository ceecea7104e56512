"""Where methods are known to fail: each failure, the test that covers it, and how far from its limit it is here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from itertools import product
from pathlib import Path

import numpy as np

import lutgen
from lutgen import device as ocl
from lutgen.charts import drawing
from lutgen.charts.drawing import GRAY, HUES, INK, inches
from lutgen.charts.stability import probing
from lutgen.skin.tissue import Layer, Skin, layers, preset
from lutgen.solvers import adding_doubling, dipole, direct, path_table, paths, profiles
from lutgen.tables import bake

Measured = tuple[float, float, str]
"""What was measured, what is allowed (0: none at all), and what it is."""
FAILURES, DIRECT, DIFFUSION = "charts/test_failure_modes.py", "solvers/test_direct.py", "solvers/test_diffusion.py"
KERNELS, PATHS = "solvers/test_kernels.py", "solvers/test_path_table.py"


@dataclass(frozen=True)
class Row:
    """One failure: the test that covers it, what was measured now, and the most that is allowed."""

    failure: str
    test: str
    measured: float
    allowed: float
    what: str

    @property
    def used(self) -> float:
        """Measured over allowed: 1 is the limit."""
        return self.measured / self.allowed if self.allowed else (np.inf if self.measured else 0.0)


def _frame() -> Measured:
    z, zero = np.array([1.0, -1.0] * 8), np.zeros(16)
    turned = probing.evaluate(
        "out[0] = a; out[1] = a; out[2] = b;"
        "turn(&out[0], &out[1], &out[2], a + 0.6f, a + 0.48f, a + 0.64f, 0.5f);",
        zero, z, outputs=3,
    )  # fmt: skip
    return float(np.abs(np.linalg.norm(turned, axis=0) - 1).max()), 1e-6, "length of a direction turned off ±z, minus 1"


def _sigmas(stack: list[Layer], method: str = "path-table", photons: int = 100_000, **options) -> float:
    """Distance from adding-doubling in standard errors."""
    found = lutgen.reflectance(stack, method, photons=photons, seed=11, **options)
    return abs(found.diffuse - adding_doubling.stack(stack)[0]) / found.std_error


def _of_g(g: float) -> Measured:
    return _sigmas([Layer(np.inf, 0.5, 10 / (1 - g), g)]), 4, f"path-table off adding-doubling at g = {g:g}, in σ"


def _cosines() -> Measured:
    ends = np.array([-(2.0**31), 2.0**31 - 128, -(2.0**31) + 128, 0.0] * 4)
    statement = "hg_t h = hg_constants($g); out[0] = hg_cosine(h, a, 1.0f / hg_denominator(h, a));"
    found = np.array([probing.evaluate(statement, ends, g=g)[0] for g in (-0.9999, 0.0, 0.1, 0.9999)])
    return float((~(np.abs(found) <= 1)).sum()), 0, f"cosines outside [−1, 1] of {found.size}"


def _normal_incidence() -> Measured:
    found = float(adding_doubling.fresnel(np.ones(1), 1.4, 1.0)[0])
    return abs(found * 36 - 1), 1e-12, "reflectance at normal incidence off 1/36, relative"


def _beyond_critical() -> Measured:
    cosine = np.linspace(0, 0.699, 16)
    kept = probing.evaluate("out[0] = TO_VF(reflects(a, b, 1.4f));", np.full(16, 1 - 2.0**-24), cosine)[0]
    return float((kept != -1).sum()), 0, "photons let out beyond the critical angle, of 16"


def _log_of_zero() -> Measured:
    found = [probing.evaluate(f"vu bits = {bits}u; out[0] = exponential(bits, 1.0f);", np.ones(16))[0]
             for bits in (0, 0xFFFFFFFF)]  # fmt: skip
    return float((~np.isfinite(found)).sum()), 0, "infinite paths at the ends of the random numbers, of 32"


def _tallies() -> Measured:
    return (paths.PHOTONS[1] + 1) * 2.0**30 / 2.0**63, 1, "share of a 64-bit sum that the most photons can fill"


def _counters() -> Measured:
    medium, _ = bake.skin_medium(preset("light"), np.array([780.0]))
    worst = max(float(path_table._jobs(medium, 2048, 0, block)["max_steps"].max()) for block in (128, 2048))
    return worst / 2.0**32, 1, "step budget at 780 nm, in 32-bit counts"


def _overshoot() -> Measured:
    alike = (0.8, 25, 0.78, 1.4)
    worst = max(_sigmas([Layer(mm, *alike), Layer(np.inf, *alike)]) for mm in (1e-6, 1e-3, 0.25))
    return worst, 4, "like layers against one, interface at 1 nm to .25 mm, in σ"


def _repeats() -> Measured:
    medium, reach = bake.skin_medium(preset("light"), np.array([450.0]))
    edges = profiles.default_edges()
    runs = [path_table.trace(medium, *reach, edges, 10_000, blocks_per_launch=size).energy for size in (None, None, 3)]
    return float(sum((run != runs[0]).sum() for run in runs)), 0, "table cells that differ between three runs"


def _generator() -> Measured:
    raw = probing.draws(3, 500_000, 0, 4096)[1]
    ones = ((raw[..., None] >> np.arange(32, dtype="u4")) & 1).sum(axis=(0, 1))
    return float(np.abs(ones / raw.size - 0.5).max() * 2 * np.sqrt(raw.size)), 4.5, "bias of the worst of 32 bits, in σ"


def _streams() -> Measured:
    starts = {tuple(column) for block in range(16) for column in probing.draws(3, 500_000, block, 1)[0].T}
    return float(16 * 16 - len(starts)), 0, "equal starting states, of 256"


def _roulette() -> Measured:
    stack = layers(preset("brown"), 500)
    return _sigmas(stack, "direct", threshold=1e-2, survivors=10), 4, "threshold 1 %, off adding-doubling, in σ"


def _clear_top() -> Measured:
    below = Layer(np.inf, 0.3, 20, 0.8)
    plain = lutgen.reflectance([below]).diffuse
    tops = Layer(0, 9, 20, 0.8), Layer(1, 0, 0, 0), Layer(1e-200, 1e-200, 20, 0.8)
    return max(abs(lutgen.reflectance([t, below]).diffuse - plain) for t in tops), 1e-9, "change of the reflectance"


def _endless() -> Measured:
    found = lutgen.reflectance([Layer(np.inf, 0, 20, 0.8)])
    return abs(found.diffuse + found.specular - 1), 5e-5, "light missing without absorption (walks refuse it)"


def _low_albedo() -> Measured:
    albedos = np.linspace(dipole.least_albedo(1.4), 1, 8)
    stacks = [[Layer(np.inf, 1 - a, a / (1 - g), g)] for a, g in product(albedos, (0.0, 0.5, 0.75, 0.9))]
    errors = [abs(dipole.reflectance(s).diffuse / adding_doubling.stack(s)[0] - 1) for s in stacks]
    return max(errors), dipole.TOLERANCE, "dipole's largest relative error where it answers"


def _near_source() -> Measured:
    stack, edges = [Layer(np.inf, 0.5, 38, 0.75)], np.concatenate([[0.0], np.geomspace(0.1001, 10, 16), [1e4]])
    found = dipole.profile(stack, edges)
    traced = path_table.profile(stack, edges, photons=100_000, seed=2)
    off = profiles.ee_difference(found.energy, traced.energy, edges)
    return float(off), 0.12, "dipole's encircled energy beyond a mean free path, difference"


def _truth_values() -> Measured:
    stack, edges = [Layer(0.1, 3.0, 25, 0.78), Layer(np.inf, 0.3, 25, 0.78)], np.array([0.0, 0.05, 0.5, 20.0])
    photons, found = 60_000, []
    for lanes in (1, 16):
        total, square, _ = path_table.ring_sums(stack, edges, photons, lanes, probing.wide(lanes))
        found.append((total / photons, (square / photons - (total / photons) ** 2) / photons))
    (one, one_variance), (many, many_variance) = found
    return float((np.abs(one - many) / np.sqrt(one_variance + many_variance)).max()), 4, "1 lane against 16, in σ"


def _ends() -> Measured:
    medium, _ = bake.skin_medium(preset("light"), np.array([640.0]))
    device, used = ocl.choose(), 0.0
    for jobs, results, _, _ in path_table._launches(medium, 65_536, 0, device, None, path_table.Tally()):
        used = max(used, float((results["events"] / device.lanes / jobs["max_steps"]).max()))
    return used, 1, "share of its step budget that a work-item took"


def _mixed() -> Measured:
    stack = layers(Skin(0.43, 0.7, 0.01), 450)
    as_scattering = [Layer(x.thickness_mm, x.mu_a_per_mm, x.mu_s_per_mm + x.mu_a_per_mm, x.g, x.n) for x in stack]
    found = direct.shares(stack, 100_000, 5, absorption="mixed")
    off = abs(found.diffuse - adding_doubling.stack(as_scattering)[0]) / found.diffuse_error
    return off, 4, "off its closed form (it is biased, and named so), in σ"


def _drift() -> Measured:
    stack = layers(preset("dark"), 450)
    values = [lutgen.reflectance(stack, nodes=n).diffuse for n in (16, 32, 64)]
    return max(values) - min(values), 1e-6, "spread over 16, 32 and 64 nodes"


def _tails() -> Measured:
    again, stored = lutgen.load().expand().profile_lut.shape, lutgen.load().profile_lut.shape
    tail = (again > 1e-30) & (again < 6e-5)
    return (
        float(np.abs(stored[tail] / again[tail] - 1).max()),
        1e-5,
        "far rings as stored, relative error",
    )


def _gamut() -> Measured:
    share = float(lutgen.load().profile_lut.clamped_share.max())
    return share, 0.01, "share clamped off a channel in the default set"


FAILURE_LIST: tuple[tuple[str, str, Callable[[], Measured]], ...] = (
    ("μz = ±1: frame and sign", f"{FAILURES}::test_direction_straight_down_and_up", _frame),
    ("g = 0: division", f"{FAILURES}::test_isotropic_scattering", lambda: _of_g(0.0)),
    ("g → 1", f"{FAILURES}::test_extreme_anisotropy", lambda: _of_g(0.999)),
    ("scattering cosine outside [−1, 1]", f"{FAILURES}::test_scattering_cosine_stays_in_range", _cosines),
    ("Fresnel 0/0 at normal incidence",
     f"{FAILURES}::test_fresnel_at_normal_incidence_and_beyond_the_critical_angle", _normal_incidence),
    ("Fresnel beyond the critical angle",
     f"{FAILURES}::test_fresnel_at_normal_incidence_and_beyond_the_critical_angle", _beyond_critical),
    ("log(0)", f"{FAILURES}::test_logarithm_of_zero_cannot_occur", _log_of_zero),
    ("float tallies that stagnate", f"{FAILURES}::test_tallies_do_not_stagnate", _tallies),
    ("32-bit counters that overflow", f"{FAILURES}::test_counters_do_not_overflow", _counters),
    ("float32 overshoot at a boundary", f"{FAILURES}::test_boundary_overshoot_in_single_precision", _overshoot),
    ("same seed, other result", f"{FAILURES}::test_same_seed_same_result", _repeats),
    ("weak generators", f"{KERNELS}::test_output_is_uniform_in_every_bit_used_and_in_pairs", _generator),
    ("overlapping streams", f"{FAILURES}::test_streams_do_not_overlap", _streams),
    ("roulette bias", f"{DIRECT}::test_roulette_is_unbiased", _roulette),
    ("zero-thickness or clear top layer", f"{DIRECT}::test_clear_layers_and_zero_thickness", _clear_top),
    ("μa = 0 in a semi-infinite medium", f"{FAILURES}::test_no_absorption_in_a_semi_infinite_medium", _endless),
    ("diffusion at low albedo", f"{DIFFUSION}::test_dipole_refuses_what_it_must_not_be_trusted_with", _low_albedo),
    ("diffusion near the source", f"{DIFFUSION}::test_radii_nearer_than_a_mean_free_path_are_refused", _near_source),
    ("scalar against vector truth values", f"{FAILURES}::test_truth_of_scalars_and_vectors", _truth_values),
    ("a work-item that never ends", f"{FAILURES}::test_a_work_item_always_ends", _ends),
    ("mixed absorption at high μa", f"{DIRECT}::test_mixed_absorption_is_a_medium_of_greater_scattering", _mixed),
    ("quadrature drift in adding-doubling", f"{FAILURES}::test_quadrature_does_not_drift_with_nodes", _drift),
    ("half-float tails below 6e-5", f"{FAILURES}::test_profile_tails_are_stored_as_floats", _tails),
    ("out-of-gamut RGB",
     f"{FAILURES}::test_out_of_gamut_light_is_clamped_in_acescg_and_its_share_stored", _gamut),
)  # fmt: skip
"""Each known failure, the test that covers it, and what measures its margin."""


def rows() -> list[Row]:
    """Every failure measured now, with fixed seeds."""
    return [Row(failure, f"tests/{test}", *measure()) for failure, test, measure in FAILURE_LIST]


def table(folder: Path, progress: Callable) -> str:
    """Draw `failures`: failure, test, what was measured, and how much of what is allowed it used."""
    progress("failures", None)
    found = rows()
    draw(folder, found)
    beyond = [row.failure for row in found if row.used > 1]
    closest = max(found, key=lambda row: row.used)
    words = f"beyond their limit: {', '.join(beyond)}" if beyond else "none beyond its limit"
    return f"{len(found)} known failures, {words}; nearest: {closest.failure}, {closest.used:.0%} of what is allowed"


def draw(folder: Path, found: list[Row]) -> None:
    """One line per failure: words at the left, measured over allowed at the right."""
    height = 1.7 + 0.36 * len(found)
    with drawing.figure(
        13.6, height + 0.4, "Known failures: how much of what is allowed each uses",
        "Measured now, seeds fixed. What is counted in σ is chance: any value below its limit is as good as 0. "
        "Left of the axis: exactly 0, none allowed.",
    ) as drawn:  # fmt: skip
        axes = inches(drawn, 9.2, 1.05, 3.2, 0.36 * len(found))
        axes.set(xscale="log", xlim=(1e-6, 3), ylim=(len(found) - 0.5, -0.5), xlabel="measured / allowed")
        axes.set_xticks([1e-6, 1e-4, 1e-2, 1], ["1e-6", "1e-4", "0.01", "limit"])
        axes.axvline(1, color=HUES[1], linewidth=1.2)
        axes.set_yticks([])
        axes.grid(axis="x")
        for i, row in enumerate(found):
            place = {"transform": axes.get_yaxis_transform(), "va": "center", "clip_on": False}
            used = min(max(row.used, 1e-6), 3)
            axes.plot(used, i, "o" if row.used else "s", color=HUES[0] if row.used <= 1 else HUES[1], clip_on=False,
                      markersize=6, markerfacecolor=None if row.used else "white")  # fmt: skip
            value = f"{row.measured:.2g} of {row.allowed:g}" if row.allowed else f"{row.measured:g}"
            axes.text(1.04, i, value, size=8.5, color=INK, **place)
            axes.text(-2.82, i - 0.16, row.failure, size=9.5, color=INK, **place)
            axes.text(-2.82, i + 0.2, row.test, size=7, color=GRAY, **place)
            axes.text(-1.32, i - 0.16, row.what, size=8.5, color=GRAY, **place)
        drawing.save(drawn, folder, "failures", [asdict(row) | {"used": row.used} for row in found])
