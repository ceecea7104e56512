"""Full walks in lock step over a queue, under flat skin or inside the mesh (kernels/flat_walk.cl, mesh_walk.cl).

Sample i of a pixel has the wavelength of index i % K. Paths are absorption-free with drawn lives, as the path table's: an
exit weighs exp(-(mu_e - nu) Le - (mu_d - nu) Ld).
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from lutgen import baking
from lutgen import device as ocl
from lutgen.render import distance, queues
from lutgen.render.stage import Stage
from lutgen.solvers.path_table import Medium
from lutgen.tissue import Skin

JOB = np.dtype(
    [(name, "f4") for name in ("mu_s", "g", "nu", "n", "epidermis_mm")]
    + [(name, "u4") for name in ("seed", "wavelength", "block", "photons", "max_steps", "first", "stride")]
)
RESULT = np.dtype([(name, "u4") for name in ("escaped", "unfinished", "entered", "lost")] + [("events", "u8")])
_STRUCTS = (*queues.STRUCTS[:2], ("job_t", JOB), ("result_t", RESULT))
BLOCK = {"cpu": 2048, "gpu": 128}
"""Pixels that one work-item walks in turn; random streams are keyed by their number."""
STEPS_PER_PHOTON = 100_000
"""Steps that a block's photons may take on average: far more than any skin's absorption leaves them."""
_GROUPS, _TURNS = 2**13, 16  # of pixels and of walks from skin to skin, in a stream's number
_EVENTS_PER_LAUNCH = 4e7  # half a second of the slower walk on two cores


@dataclass(frozen=True)
class Part:
    """What a queue holds: samples first ... first + samples - 1 of the pixels begin ... end - 1, one after the other;
    counts of samples are multiples of K. `turn`: how often their walks have been from skin to skin."""

    begin: int
    end: int
    first: int
    samples: int
    turn: int = 0


@dataclass
class Tally:
    """What walks did: photons that entered, of which escaped, were lost off the surface (by a fold of the mesh) or given
    up by the step budget; the others outlived their lives. Scattering events."""

    entered: int = 0
    escaped: int = 0
    lost: int = 0
    unfinished: int = 0
    events: int = 0


def block(device: ocl.Device) -> int:
    """Pixels per block on that device."""
    return BLOCK["gpu" if device.kind == "gpu" else "cpu"]


def kernel(device: ocl.Device, inside: bool, before: str = ""):
    """The built kernel of either walk; `before` are definitions that replace its own."""
    structs, names = (*_STRUCTS, distance.STRUCT), ("depth", "anchors", "mesh_walk") if inside else ("flat_walk",)
    text = before + ocl.struct_source(device, structs) + ocl.source("lanes", "rng", "optics", "queue", *names)
    return ocl.kernel(device, names[-1], text, {"W": device.lanes})


def jobs(medium: Medium, part: Part, seed: int, size: int) -> np.ndarray:
    """Jobs of `size` pixels of one estimate at one wavelength each.

    They are keyed by pixel, estimate and turn, so that no exit depends on how a picture was cut into parts whose first
    pixels are multiples of `size`.
    """
    K = len(medium.wavelength_nm)
    pixel, estimate, k = np.meshgrid(
        np.arange(part.begin, part.end, size), np.arange(part.samples // K), np.arange(K), indexing="ij"
    )
    table = np.zeros(pixel.shape, JOB)
    for field, values in (("mu_s", medium.mu_s_per_mm), ("g", medium.g), ("nu", medium.nu_per_mm)):
        table[field] = values
    table["n"], table["epidermis_mm"], table["seed"] = medium.n, medium.epidermis_mm, seed
    table["wavelength"] = np.rint(np.asarray(medium.wavelength_nm) * 1000)
    table["block"] = ((part.first // K + estimate) * _GROUPS + pixel // size) * _TURNS + part.turn
    table["stride"], table["first"] = part.samples, (pixel - part.begin) * part.samples + estimate * K + k
    table["photons"] = np.minimum(part.end - pixel, size)
    steps = np.minimum(4 * (medium.mu_s_per_mm / medium.nu_per_mm + 1), STEPS_PER_PHOTON)
    table["max_steps"] = np.minimum(steps * (4 * size + 64), 4e9)
    return table.ravel()


def walk(
    medium: Medium, entries, exits, part: Part, seed: int, device: ocl.Device, tally: Tally, depths: tuple = (),
    before: str = "",
) -> None:  # fmt: skip
    """Walk a queue on the device and add to the tally: inside the mesh of distance.buffers, or under flat skin."""
    table, compiled = jobs(medium, part, seed, block(device)), kernel(device, bool(depths), before)
    each = float(np.mean(medium.mu_s_per_mm / medium.nu_per_mm)) * block(device)
    size = max(int(_EVENTS_PER_LAUNCH / each), 64 if device.kind == "cpu" else 4096)
    for start in range(0, len(table), size):
        some = table[start : start + size]
        results = np.zeros(len(some), RESULT)
        found = ocl.buffer(device, results)
        ocl.launch(device, compiled, (len(some),), ocl.buffer(device, some), entries, exits, found, *depths)
        ocl.read(device, found, results)
        for name in asdict(tally):
            setattr(tally, name, getattr(tally, name) + int(results[name].sum()))


def flat(on: Stage, seed: int = 0) -> queues.Staged:
    """Full walks under flat skin, exits looked for on the real surface."""
    return _staged(on, seed, {"walk": "flat-full"}, ())


def inside(on: Stage, seed: int = 0) -> queues.Staged:
    """Walks inside the stage's mesh; InputError for one with holes."""
    facts = on.luts.manifest["recipe"]["skin"]
    depths = distance.of_mesh(on.shape.positions_mm, on.shape.triangles, facts["epidermis_mm"], on.device)
    told = {"walk": "mesh", "depth_cell_mm": depths.spacing_mm, "depth_bytes": depths.bytes, "notes": list(depths.notes)}
    return _staged(on, seed, told, tuple(distance.buffers(on.device, depths)))


def _staged(on: Stage, seed: int, facts: dict, depths: tuple) -> queues.Staged:
    skin, tally = on.luts.manifest["recipe"]["skin"], Tally()
    medium, _ = baking.skin_medium(Skin(0.02, 0.7, 0.01, **skin), on.luts.paths.wavelength_nm)

    def step(entries, exits, part: Part) -> int:
        before = tally.events
        walk(medium, entries, exits, part, seed, on.device, tally, depths)
        facts["photons"] = asdict(tally)
        return tally.events - before

    return queues.staged(on, step, facts, flat=not depths)
