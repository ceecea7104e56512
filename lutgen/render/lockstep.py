"""Walks over a queue: entries into the skin on the device become exits (kernels/flat_walk.cl, kernels/mesh_walk.cl).

Entry i of a queue has the wavelength of index i % K, and its exit is exit i. Paths are absorption-free with drawn
lives, as the path table's: an exit weighs exp(-(mu_e - nu) Le - (mu_d - nu) Ld).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lutgen import device as ocl
from lutgen.render import distance, queues
from lutgen.solvers.path_table import Medium

JOB = np.dtype(
    [(name, "f4") for name in ("mu_s", "g", "nu", "n", "epidermis_mm")]
    + [(name, "u4") for name in ("seed", "wavelength", "block", "photons", "max_steps", "first", "stride")]
)
RESULT = np.dtype([(name, "u4") for name in ("escaped", "unfinished", "entered", "lost")] + [("events", "u8")])
_STRUCTS = (*queues.STRUCTS[:2], ("job_t", JOB), ("result_t", RESULT))
BLOCK = {"cpu": 2048, "gpu": 128}
"""Entries that one work-item walks in turn; random streams are keyed by their number."""
STEPS_PER_PHOTON = 100_000
"""Steps after which a photon is given up, on average over a block: far beyond any that skin's absorption allows."""


@dataclass
class Tally:
    """What walks did: entries, of which escaped, were lost off the grid or left unfinished by the step budget; events."""

    entered: int = 0
    escaped: int = 0
    lost: int = 0
    unfinished: int = 0
    events: int = 0


def block(device: ocl.Device) -> int:
    """Entries per block on that device."""
    return BLOCK["gpu" if device.kind == "gpu" else "cpu"]


def kernel(device: ocl.Device, inside_mesh: bool, trust: str = ""):
    """The built kernel of either walk."""
    if not inside_mesh:
        text = ocl.struct_source(device, _STRUCTS) + ocl.source("lanes", "rng", "optics", "queue", "flat_walk")
        return ocl.kernel(device, "flat_walk", text, {"W": device.lanes})
    text = trust + ocl.struct_source(device, (*_STRUCTS, distance.STRUCT))
    text += ocl.source("lanes", "rng", "optics", "queue", "depth", "mesh_walk")
    return ocl.kernel(device, "mesh_walk", text, {"W": device.lanes})


def jobs(medium: Medium, entries: int, seed: int, first_block: int, size: int) -> np.ndarray:
    """Jobs for a queue of `entries` in blocks of `size` per wavelength, numbered from `first_block` on."""
    K = len(medium.wavelength_nm)
    each = -(-entries // K)
    blocks = -(-each // size)
    table = np.zeros((blocks, K), JOB)
    for field, values in (("mu_s", medium.mu_s_per_mm), ("g", medium.g), ("nu", medium.nu_per_mm)):
        table[field] = np.asarray(values)
    table["n"], table["epidermis_mm"], table["seed"] = medium.n, medium.epidermis_mm, seed
    table["wavelength"] = np.rint(np.asarray(medium.wavelength_nm) * 1000)
    number, k = np.arange(blocks)[:, None], np.arange(K)
    table["block"] = first_block + number
    table["stride"], table["first"] = K, number * size * K + k
    table["photons"] = np.clip((entries - k + K - 1) // K - number * size, 0, size)
    per_life = np.minimum(4 * (medium.mu_s_per_mm / np.maximum(medium.nu_per_mm, 1e-30) + 1), STEPS_PER_PHOTON)
    table["max_steps"] = np.minimum(per_life * (4 * size + 64), 4e9).astype("u4")
    return table.ravel()


def walk(
    medium: Medium, entry_buffer, exit_buffer, entries: int, seed: int, first_block: int, device: ocl.Device,
    tally: Tally, depth_buffers=None,
) -> int:  # fmt: skip
    """Walk a queue on the device, inside the mesh whose depths are given or under flat skin; the next free block."""
    table = jobs(medium, entries, seed, first_block, block(device))
    results = np.zeros(len(table), RESULT)
    found = ocl.buffer(device, results)
    compiled = kernel(device, depth_buffers is not None)
    ocl.launch(
        device, compiled, (len(table),), ocl.buffer(device, table), entry_buffer, exit_buffer, found, *(depth_buffers or ())
    )
    ocl.read(device, found, results)
    for name in ("entered", "escaped", "lost", "unfinished", "events"):
        setattr(tally, name, getattr(tally, name) + int(results[name].sum()))
    return int(table["block"].max()) + 1
