"""Monte Carlo by absorption-free paths: one trace per wavelength serves every absorption (white Monte Carlo).

The kernels are kernels/solvers/path_table.cl (the walk into a bank of exit records) and tabulate.cl beside it (the
bank into a Laplace table). Photons come in blocks of fixed size, each with its own random streams, so that any split
into launches, in any order, gives the same records and the same fixed-point sums.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from lutgen import device as ocl
from lutgen.errors import InputError, MachineError, in_range, whole
from lutgen.skin.tissue import Layer, specular
from lutgen.solvers.paths import PHOTONS, SEEDS, PathTable, chebyshev
from lutgen.solvers.profiles import Profile, Reflectance

OPTIONS = ("device", "wavelength_nm")
BLOCK_PHOTONS = {"cpu": 2048, "gpu": 128}
"""Photons that one work-item walks in turn: a CPU wants few long items, a GPU tens of thousands of short ones."""
NODES_E, NODES_D = 16, 16  # multiples of the widest lanes; totals err by 5e-6 (14 nodes: 3e-5, 20: 2e-7)
MAX_STEPS_PER_LIFE = 1e6
_BLOCKS_PER_LAUNCH = {"cpu": (64, 1024), "gpu": (4096, 32_768)}
_EVENTS_PER_LAUNCH = 5e8
_ROWS = 64
_FIXED_POINT = 2.0**30

JOB = np.dtype(
    [("mu_s", "f4"), ("g", "f4"), ("nu", "f4"), ("n", "f4"), ("epidermis_mm", "f4"), ("sine", "f4"), ("cosine", "f4")]
    + [(name, "u4") for name in ("seed", "wavelength", "block", "photons", "max_steps")]
)
RESULT = np.dtype([("escaped", "u4"), ("unfinished", "u4"), ("events", "u8")])
STRUCTS = (("job_t", JOB), ("result_t", RESULT))
WALK = "common/lanes", "common/rng", "common/optics", "common/step"
"""Kernel files that every lock-step walk builds on."""


@dataclass(frozen=True)
class Medium:
    """What a trace needs of the skin: scattering, anisotropy and life rate per wavelength [K], thickness, index."""

    wavelength_nm: np.ndarray
    mu_s_per_mm: np.ndarray
    g: np.ndarray
    nu_per_mm: np.ndarray
    epidermis_mm: float
    n: float

    @property
    def entry(self) -> float:
        """Share of light along the normal that enters: 1 - R_specular."""
        return 1 - specular(self.n)


@dataclass
class Tally:
    """What a trace did: events and photons so far, and of how many."""

    photons: int = 0
    events: int = 0
    of: int = 0


def block_photons(device: ocl.Device) -> int:
    """Photons per block on that device; part of what random streams are keyed by."""
    return BLOCK_PHOTONS["gpu" if device.kind == "gpu" else "cpu"]


def walk_kernel(device: ocl.Device, life: str = "", record: int = 3):
    """The built kernel of kernels/solvers/path_table.cl; `life` replaces its LIFE, `record` 4 adds azimuths."""
    text = ocl.struct_source(device, STRUCTS) + ocl.source(*WALK, "solvers/path_table")
    text = f"#define LIFE {life}\n{text}" if life else text
    return ocl.kernel(
        device, "walk", text, {"W": device.lanes, "BLOCK_PHOTONS": block_photons(device), "RECORD": record}
    )


def tabulate_kernel(device: ocl.Device, rings: int, slices: int, nodes: tuple[int, int] = (NODES_E, NODES_D)):
    """The built kernel of kernels/solvers/tabulate.cl."""
    text = ocl.struct_source(device, STRUCTS) + ocl.source("common/lanes", "solvers/tabulate")
    sizes = {"NODES_E": nodes[0], "NODES_D": nodes[1], "RINGS": rings, "SLICES": slices}
    return ocl.kernel(device, "tabulate", text, {"W": device.lanes, "BLOCK_PHOTONS": block_photons(device), **sizes})


def kernel_hash(device: ocl.Device) -> str:
    """Short hash of everything the trace's numbers depend on: kernel text, structs, lanes and block size."""
    text = ocl.struct_source(device, STRUCTS) + ocl.source(*WALK, "solvers/path_table", "solvers/tabulate")
    return hashlib.sha256(f"{device.lanes} {block_photons(device)} {NODES_E} {NODES_D} {text}".encode()).hexdigest()[
        :16
    ]


def _jobs(medium: Medium, photons: int, seed: int, block: int, cosine: float = 1.0) -> np.ndarray:
    """One job per block, ordered by wavelength, then block; light enters at that cosine inside the skin."""
    K, blocks = len(medium.wavelength_nm), -(-photons // block)
    jobs = np.zeros((K, blocks), JOB)
    for field, values in (("mu_s", medium.mu_s_per_mm), ("g", medium.g), ("nu", medium.nu_per_mm)):
        jobs[field] = np.asarray(values)[:, None]
    jobs["n"], jobs["epidermis_mm"], jobs["seed"] = medium.n, medium.epidermis_mm, seed
    jobs["cosine"], jobs["sine"] = cosine, np.sqrt(1 - cosine**2)
    jobs["wavelength"] = np.rint(np.asarray(medium.wavelength_nm) * 1000).astype("u4")[:, None]
    jobs["block"] = np.arange(blocks)
    jobs["photons"] = block
    jobs["photons"][:, -1] = photons - (blocks - 1) * block
    # A life is under 22 / nu; the sum of a block's lives never comes near 4 times its mean plus such a life.
    per_life = medium.mu_s_per_mm / medium.nu_per_mm + 1  # the step that outlives it counts too
    jobs["max_steps"] = np.minimum(per_life * (4 * block + 64), 4e9).astype("u4")[:, None]
    return jobs.ravel()


def _launches(
    medium: Medium, photons: int, seed: int, device: ocl.Device, blocks_per_launch: int | None, tally: Tally,
    life: str = "", cosine: float = 1.0, record: int = 3,
) -> Iterator[tuple[np.ndarray, np.ndarray, object, object]]:  # fmt: skip
    """Walk all blocks; yield jobs, results, and the device buffers of bank and results after each launch."""
    whole("photons", photons, *PHOTONS)
    whole("seed", seed, *SEEDS)
    in_range("mu_s_per_mm", float(np.min(medium.mu_s_per_mm)), 1e-6, 1e6, " for path-table")
    steps_per_life = float(np.max(medium.mu_s_per_mm / np.maximum(medium.nu_per_mm, 1e-30)))
    if steps_per_life > MAX_STEPS_PER_LIFE:
        least = float(np.max(medium.mu_s_per_mm)) / MAX_STEPS_PER_LIFE
        raise InputError(
            f"mu_a_per_mm = {float(np.min(medium.nu_per_mm)):g}: a walk without absorption does not end; path-table "
            f"needs at least {least:.3g} /mm here, method adding-doubling any value"
        )
    block = block_photons(device)
    jobs = _jobs(medium, photons, seed, block, cosine)
    low, high = _BLOCKS_PER_LAUNCH["gpu" if device.kind == "gpu" else "cpu"]
    if blocks_per_launch is not None:
        whole("blocks_per_launch", blocks_per_launch, 1, 2**20)
    fit = _EVENTS_PER_LAUNCH / (block * (steps_per_life + 1))
    size = blocks_per_launch or int(np.clip(fit, low, high))
    size = min(size, len(jobs))
    walk = walk_kernel(device, life, record)
    bank = ocl.buffer(device, 4 * record * block * size)
    tally.of = photons * len(medium.wavelength_nm)
    for start in range(0, len(jobs), size):
        part = jobs[start : start + size]
        results = np.zeros(len(part), RESULT)
        result_buffer = ocl.buffer(device, results)
        ocl.launch(device, walk, (len(part),), ocl.buffer(device, part), bank, result_buffer)
        ocl.read(device, result_buffer, results)
        if results["unfinished"].any():
            raise MachineError(f"device {device.name}: {results['unfinished'].sum()} photons exceeded the step budget")
        tally.photons += int(part["photons"].sum())
        tally.events += int(results["events"].sum())
        yield part, results, bank, result_buffer


def walk_only(medium: Medium, photons: int, device: ocl.Device, tally: Tally, seed: int = 0) -> None:
    """Walk and drop the records: what a benchmark times."""
    for _ in _launches(medium, photons, seed, device, None, tally):
        pass


def records(
    medium: Medium, photons: int, seed: int = 0, device: ocl.Device | None = None, tally: Tally | None = None,
    life: str = "", cosine: float | None = None,
) -> Iterator[tuple[int, np.ndarray]]:  # fmt: skip
    """Yield (wavelength index, exits [n, 3]) block by block; columns: radius, path, path in the epidermis, mm.

    With `cosine`, the entry's inside the skin, rows have a fourth column: the cosine of the exit's azimuth from the
    way along the surface that the light came in with. `life` is an OpenCL expression for how long a photon lives, in
    place of the life that is drawn (see the kernel).
    """
    device = device or ocl.choose()
    key = {round(nm * 1000): k for k, nm in enumerate(medium.wavelength_nm)}
    record, entry = (3, 1.0) if cosine is None else (4, cosine)
    for jobs, results, bank, _ in _launches(medium, photons, seed, device, None, tally or Tally(), life, entry, record):
        exits = ocl.read(device, bank, np.empty((len(jobs), block_photons(device), record), "f4"))
        for job, result, rows in zip(jobs, results, exits, strict=True):
            yield key[int(job["wavelength"])], rows[: result["escaped"]]


def trace(
    medium: Medium,
    epidermis_range: tuple[np.ndarray, np.ndarray],
    dermis_range: tuple[np.ndarray, np.ndarray],
    radius_edges_mm: np.ndarray,
    photons: int,
    seed: int = 0,
    device: ocl.Device | None = None,
    blocks_per_launch: int | None = None,
    progress: Callable[[Tally], None] | None = None,
    nodes: tuple[int, int] = (NODES_E, NODES_D),
) -> PathTable:
    """Trace all wavelengths and return their path table; photons are per wavelength.

    The absorption ranges, 1/mm, each (low [K], high [K]), must lie above the medium's nu. Nodes reach to 2 high - nu,
    where the standard error is read. The last ring takes all that leaves farther out. `nodes` of both absorptions are
    multiples of 16; those of a bake suit the absorptions of one wavelength.
    """
    device, tally = device or ocl.choose(), Tally()
    K, rings = len(medium.wavelength_nm), len(radius_edges_mm) - 1
    if rings & (rings - 1):
        raise InputError(f"rings = {rings}: allowed is a power of 2")
    slices = max(1, _ROWS // K)
    tabulate = tabulate_kernel(device, rings, slices, nodes)
    mu = [
        chebyshev(np.cbrt(low), np.cbrt(2 * high - medium.nu_per_mm), count) ** 3
        for (low, high), count in zip((epidermis_range, dermis_range), nodes, strict=True)
    ]
    rates = np.concatenate(mu, axis=1) - medium.nu_per_mm[:, None]
    rate_buffer, edge_buffer = (
        ocl.buffer(device, rates.astype("f4")),
        ocl.buffer(device, np.asarray(radius_edges_mm, "f4")),
    )
    sums = np.zeros((K, slices, rings, *nodes), "i8")
    sum_buffer = ocl.buffer(device, sums)
    columns = 1 if device.kind == "cpu" else nodes[1]
    wavelengths = np.rint(np.asarray(medium.wavelength_nm) * 1000)
    for jobs, _, bank, results in _launches(medium, photons, seed, device, blocks_per_launch, tally):
        counts = [int((jobs["wavelength"] == nm).sum()) for nm in wavelengths]
        first = ocl.buffer(device, np.concatenate([[0], np.cumsum(counts)]).astype("u4"))
        ocl.launch(device, tabulate, (K * slices, columns), bank, results, first, rate_buffer, edge_buffer, sum_buffer)
        if progress:
            progress(tally)
    energy = ocl.read(device, sum_buffer, sums).sum(axis=1) * (medium.entry / _FIXED_POINT / photons)
    return PathTable(
        np.asarray(medium.wavelength_nm, float), np.asarray(medium.nu_per_mm, float),
        np.asarray(radius_edges_mm, float), mu[0], mu[1], energy.astype("f4"), photons, medium.entry,
    )  # fmt: skip


def medium_of(layers: list[Layer], wavelength_nm: float = 0.0) -> Medium:
    """The medium of one stack, or InputError for stacks that absorption-free paths of two layers cannot represent."""
    method = "use method adding-doubling"
    if not 1 <= len(layers) <= 2:
        raise InputError(f"layers: path-table takes 1 or 2 layers, not {len(layers)}; {method}")
    top, bottom = layers[0], layers[-1]
    if not np.isinf(bottom.thickness_mm) or (len(layers) == 2 and np.isinf(top.thickness_mm)):
        raise InputError(
            f"thickness_mm = {bottom.thickness_mm:g}: path-table needs one semi-infinite layer, last; {method}"
        )
    for name in ("mu_s_per_mm", "g", "n"):
        a, b = getattr(top, name), getattr(bottom, name)
        if a != b:
            raise InputError(f"{name} = {a:g} and {b:g}: path-table needs the same in both layers; {method}")
    in_range("wavelength_nm", wavelength_nm, 0, 1e6)
    thickness = top.thickness_mm if len(layers) == 2 else 0.0
    nu = min(layer.mu_a_per_mm for layer in layers if layer.thickness_mm > 0)
    columns = [np.array([v], float) for v in (wavelength_nm, top.mu_s_per_mm, top.g, nu)]
    return Medium(columns[0], columns[1], columns[2], columns[3], thickness, top.n)


def ring_sums(
    layers: list[Layer],
    radius_edges_mm: np.ndarray,
    photons: int,
    seed: int,
    device: ocl.Device | None = None,
    wavelength_nm: float = 0.0,
) -> tuple[np.ndarray, np.ndarray, Medium]:
    """Sums of weights and squared weights per ring [B] for one stack, in double precision, and its medium."""
    medium = medium_of(layers, wavelength_nm)
    mu_e, mu_d, nu = layers[0].mu_a_per_mm, layers[-1].mu_a_per_mm, medium.nu_per_mm[0]
    sums = np.zeros((2, len(radius_edges_mm) - 1))
    for _, rows in records(medium, photons, seed, device):
        radius, path, in_epidermis = rows.astype(float).T
        weight = np.exp(-(mu_e - nu) * in_epidermis - (mu_d - nu) * np.maximum(path - in_epidermis, 0))
        for power in (1, 2):
            sums[power - 1] += np.histogram(radius, radius_edges_mm, weights=weight**power)[0]
    return sums[0], sums[1], medium


def reflectance(
    layers: list[Layer], photons: int = 100_000, seed: int = 0, device: str | None = None, wavelength_nm: float = 0.0
) -> Reflectance:
    """Diffuse reflectance of one or two layers that scatter alike over a semi-infinite medium.

    `wavelength_nm` only keys the random streams, so that the samples of a spectrum are independent.
    """
    total, square, medium = ring_sums(layers, np.array([0, np.inf]), photons, seed, ocl.choose(device), wavelength_nm)
    mean, second = float(total[0]) / photons, float(square[0]) / photons
    sigma = float(np.sqrt(max(second - mean**2, 0) / photons))
    return Reflectance(medium.entry * mean, 1 - medium.entry, 0.0, medium.entry * sigma)


def profile(
    layers: list[Layer], radius_edges_mm: np.ndarray, photons: int = 1_000_000, seed: int = 0,
    device: str | None = None, wavelength_nm: float = 0.0,
) -> Profile:  # fmt: skip
    """Energy per ring of one or two layers that scatter alike over a semi-infinite medium."""
    total, square, medium = ring_sums(layers, radius_edges_mm, photons, seed, ocl.choose(device), wavelength_nm)
    mean = total / photons
    sigma = np.sqrt(np.maximum(square / photons - mean**2, 0) / photons)
    return Profile(radius_edges_mm, medium.entry * mean, medium.entry * sigma)
