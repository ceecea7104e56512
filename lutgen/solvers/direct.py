"""Monte Carlo through any stack of layers: the walk, weights and roulette of Zhang, Human face rendering.

Its kernel is kernels/solvers/direct.cl.

The independent check of path tables, and what that document's section 3 compares (kernels/README.md, Three ways to
absorb): absorption by `albedo` (unbiased), `continuous` (unbiased) or `mixed` (the document's exponential with steps
from mu_t, which equals the exact solution for a medium that scatters with mu_s + mu_a: too bright).
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lutgen import device as ocl
from lutgen.errors import InputError, MachineError, in_range, one_of, whole
from lutgen.skin.tissue import Layer, specular
from lutgen.solvers.path_table import RESULT
from lutgen.solvers.paths import PHOTONS, SEEDS
from lutgen.solvers.profiles import Profile, Reflectance

ABSORPTION = ("albedo", "continuous", "mixed")
THRESHOLD, SURVIVORS = 1e-4, 10.0
OPTIONS = ("absorption", "threshold", "survivors", "device", "wavelength_nm")
BLOCK_PHOTONS = 512
MAX_LAYERS = 32
_SMALL_G = 0.1  # below, half_inverse_g = 0 picks the form of the phase function that does not divide by g
_FAR_MM = 1e30
_LAUNCH_S = 0.3

JOB = np.dtype(
    [(name, "u4") for name in ("seed", "wavelength", "block", "photons", "max_steps")]
    + [("threshold", "f4"), ("survival", "f4")]
)
LAYER = np.dtype([(name, "f4") for name in ("top_mm", "bottom_mm", "mu_a", "mu_s", "g", "half_inverse_g", "n")])
_STRUCTS = (("job_t", JOB), ("layer_t", LAYER), ("result_t", RESULT))


@dataclass(frozen=True)
class Shares:
    """Shares of light that fell along the normal, with the standard error of each; `absorbed` per layer [L]."""

    diffuse: float
    specular: float
    transmitted: float
    absorbed: np.ndarray
    diffuse_error: float
    transmitted_error: float
    absorbed_error: np.ndarray
    total_error: float
    events: int

    @property
    def total(self) -> float:
        """Sum of all shares: 1 within `total_error`, for roulette keeps energy in the mean only."""
        return self.diffuse + self.specular + self.transmitted + float(self.absorbed.sum())


def records(
    layers: list[Layer], photons: int, seed: int = 0, absorption: str = "albedo", threshold: float = THRESHOLD,
    survivors: float = SURVIVORS, device: ocl.Device | None = None, wavelength_nm: float = 0.0,
) -> Iterator[tuple[np.ndarray, int]]:  # fmt: skip
    """Yield (ends [n, 3 + L], events) launch by launch; columns: exit radius in mm, weight out above, out below, then
    what each layer absorbed. Weights start at the share that enters the surface."""
    whole("photons", photons, *PHOTONS)
    whole("seed", seed, *SEEDS)
    one_of("absorption", absorption, ABSORPTION)
    in_range("threshold", threshold, 1e-9, 0.1)
    in_range("survivors", survivors, 1.001, 1e6)
    _check(layers)
    device = device or ocl.choose()
    kernel = _kernel(device, len(layers), ABSORPTION.index(absorption))
    jobs = _jobs(photons, seed, threshold, survivors, wavelength_nm)
    table, record = ocl.buffer(device, _layer_table(layers)), 3 + len(layers)
    start, size = 0, 64
    while start < len(jobs):
        part = jobs[start : start + size]
        bank, results = ocl.buffer(device, 4 * record * BLOCK_PHOTONS * len(part)), np.zeros(len(part), RESULT)
        result_buffer, since = ocl.buffer(device, results), time.perf_counter()
        ocl.launch(device, kernel, (len(part),), ocl.buffer(device, part), table, bank, result_buffer)
        ocl.read(device, result_buffer, results)
        if results["unfinished"].any():
            raise MachineError(
                f"device {device.name}: {results['unfinished'].sum()} photons exceeded the step budget; "
                "absorption is too weak for method direct: use adding-doubling"
            )
        ends = ocl.read(device, bank, np.empty((len(part), BLOCK_PHOTONS, record), "f4"))
        yield ends.reshape(-1, record)[: int(part["photons"].sum())], int(results["events"].sum())
        start += size
        if time.perf_counter() - since < _LAUNCH_S and size < 1024:
            size *= 2


def _kernel(device: ocl.Device, layers: int, absorption: int):
    text = ocl.struct_source(device, _STRUCTS) + ocl.source(
        "common/lanes", "common/rng", "common/optics", "solvers/direct"
    )
    sizes = {"W": device.lanes, "BLOCK_PHOTONS": BLOCK_PHOTONS, "LAYERS": layers, "ABSORPTION": absorption}
    return ocl.kernel(device, "direct", text, sizes)


def _jobs(photons: int, seed: int, threshold: float, survivors: float, wavelength_nm: float) -> np.ndarray:
    blocks = -(-photons // BLOCK_PHOTONS)
    jobs = np.zeros(blocks, JOB)
    jobs["seed"], jobs["block"] = seed, np.arange(blocks)
    jobs["wavelength"] = round(wavelength_nm * 1000)
    jobs["photons"] = BLOCK_PHOTONS
    jobs["photons"][-1] = photons - (blocks - 1) * BLOCK_PHOTONS
    jobs["threshold"], jobs["survival"] = threshold, 1 / survivors
    jobs["max_steps"] = 50_000_000
    return jobs


def _layer_table(layers: list[Layer]) -> np.ndarray:
    table = np.zeros(len(layers), LAYER)
    bottoms = np.minimum(np.cumsum([layer.thickness_mm for layer in layers]), _FAR_MM)
    table["bottom_mm"], table["top_mm"][1:] = bottoms, bottoms[:-1]
    for field, name in (("mu_a", "mu_a_per_mm"), ("mu_s", "mu_s_per_mm"), ("g", "g"), ("n", "n")):
        table[field] = [getattr(layer, name) for layer in layers]
    small = np.abs(table["g"]) <= _SMALL_G
    table["half_inverse_g"] = np.where(small, 0, 0.5 / np.where(small, 1, table["g"]))
    return table


def _check(layers: list[Layer]) -> None:
    if len(layers) > MAX_LAYERS:
        raise InputError(f"layers: method direct takes up to {MAX_LAYERS}, not {len(layers)}")
    if any(np.isinf(layer.thickness_mm) for layer in layers[:-1]):
        raise InputError("thickness_mm = inf: only the last layer may be semi-infinite")
    last = layers[-1]
    if np.isinf(last.thickness_mm) and last.mu_a_per_mm <= 1e-5 * last.mu_s_per_mm:
        raise InputError(
            f"mu_a_per_mm = {last.mu_a_per_mm:g} in a semi-infinite layer: a walk without absorption does not end; "
            f"method direct needs more than {1e-5 * last.mu_s_per_mm:g} here, method adding-doubling any value"
        )


def shares(layers: list[Layer], photons: int = 100_000, seed: int = 0, **options) -> Shares:
    """Where the light goes: diffuse, specular, transmitted, absorbed per layer; options as of `records`.

    >>> from lutgen.skin.tissue import Layer
    >>> light = shares([Layer(2.0, 1.0, 0.0, 0.0, 1.0)], photons=2048)
    >>> abs(light.transmitted - 0.1353) < 4 * light.transmitted_error  # colored glass without scattering: exp(-2)
    True
    """
    sums, squares, total, total_square, events = 0.0, 0.0, 0.0, 0.0, 0
    for ends, count in records(layers, photons, seed, **options):
        weights = ends[:, 1:].astype(float)
        whole_photon = weights.sum(axis=1)
        sums, squares = sums + weights.sum(axis=0), squares + (weights**2).sum(axis=0)
        total, total_square = total + whole_photon.sum(), total_square + (whole_photon**2).sum()
        events += count
    mean = np.asarray(sums) / photons
    error = np.sqrt(np.maximum(np.asarray(squares) / photons - mean**2, 0) / photons)
    total_error = float(np.sqrt(max(total_square / photons - (total / photons) ** 2, 0) / photons))
    return Shares(
        float(mean[0]), specular(layers[0].n), float(mean[1]), mean[2:], float(error[0]), float(error[1]), error[2:],
        total_error, events,
    )  # fmt: skip


def reflectance(
    layers: list[Layer], photons: int = 100_000, seed: int = 0, device: str | None = None, **options
) -> Reflectance:
    """Diffuse, specular and transmitted share of any stack; options as of `records`."""
    light = shares(layers, photons, seed, device=ocl.choose(device), **options)
    return Reflectance(light.diffuse, light.specular, light.transmitted, light.diffuse_error)


def profile(
    layers: list[Layer], radius_edges_mm: np.ndarray, photons: int = 100_000, seed: int = 0,
    device: str | None = None, **options,
) -> Profile:  # fmt: skip
    """Energy per ring of any stack; options as of `records`."""
    sums = np.zeros((2, len(radius_edges_mm) - 1))
    for ends, _ in records(layers, photons, seed, device=ocl.choose(device), **options):
        weight = ends[:, 1].astype(float)
        for power in (1, 2):
            sums[power - 1] += np.histogram(ends[:, 0], radius_edges_mm, weights=weight**power)[0]
    mean = sums[0] / photons
    return Profile(radius_edges_mm, mean, np.sqrt(np.maximum(sums[1] / photons - mean**2, 0) / photons))
