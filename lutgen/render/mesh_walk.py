"""Full walks in lock step over a queue, under flat skin or inside the mesh (kernels/render/flat_walk.cl, mesh_walk.cl).

Sample i of a pixel has the wavelength of index i % K. Paths are absorption-free with drawn lives, as the path table's:
an exit weighs exp(-(mu_e - nu) Le - (mu_d - nu) Ld).
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace

import numpy as np

from lutgen import device as ocl
from lutgen.render import device_scene, distance, sample_queue
from lutgen.render.device_scene import DeviceScene
from lutgen.solvers import path_table
from lutgen.solvers.path_table import Medium
from lutgen.tables import bake, expand

JOB = np.dtype(
    [(name, "f4") for name in ("mu_s", "g", "nu", "n", "epidermis_mm")]
    + [(name, "u4") for name in ("seed", "wavelength", "block", "photons", "max_steps", "first", "stride")]
)
RESULT = np.dtype([(name, "u4") for name in ("escaped", "unfinished", "entered", "lost")] + [("events", "u8")])
_STRUCTS = (*sample_queue.STRUCTS[:2], ("job_t", JOB), ("result_t", RESULT))
REACH = 1.5
"""How far above and below the tangent plane an exit is looked for, in units of its distance."""
BLOCK = {"cpu": sample_queue.BLOCK, "gpu": sample_queue.BLOCK // 16}
"""Pixels that one work-item walks in turn; random streams are keyed by their number."""
STEPS_PER_PHOTON = 100_000
"""Steps that a block's photons may take on average: far more than any skin's absorption leaves them."""
_GROUPS, _TURNS = 2**17, 16  # of pixels and of walks from skin to skin, in a stream's number
_EVENTS_PER_LAUNCH = 4e7  # half a second of the slower walk on two cores


@dataclass
class Tally:
    """What walks did: photons that entered, of which escaped, were lost off the surface (by a fold of the mesh) or
    given up by the step budget; the others outlived their lives. Scattering events."""

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
    structs, names = (
        (*_STRUCTS, distance.STRUCT),
        ("render/depth", "render/anchors", "render/mesh_walk") if inside else ("render/flat_walk",),
    )
    text = (
        before
        + ocl.struct_source(device, structs)
        + ocl.source(*path_table.WALK, "common/frame", "render/queue", *names)
    )
    return ocl.kernel(device, names[-1].removeprefix("render/"), text, {"W": device.lanes})


def jobs(medium: Medium, part: sample_queue.Part, seed: int, size: int) -> np.ndarray:
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
    number = ((part.first // K + estimate) * _GROUPS + pixel // size) * _TURNS + part.turn  # below 2 ** 44
    table["wavelength"] = np.rint(np.asarray(medium.wavelength_nm) * 1000).astype("u4") | (number >> 32 << 20)
    table["block"] = number & 0xFFFFFFFF
    table["stride"], table["first"] = part.samples, (pixel - part.begin) * part.samples + estimate * K + k
    table["photons"] = np.minimum(part.end - pixel, size)
    steps = np.minimum(4 * (medium.mu_s_per_mm / medium.nu_per_mm + 1), STEPS_PER_PHOTON)
    table["max_steps"] = np.minimum(steps * (4 * size + 64), 4e9)
    return table.ravel()


def walk(
    medium: Medium, entries, exits, part: sample_queue.Part, seed: int, device: ocl.Device, tally: Tally,
    depths: tuple = (), before: str = "",
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


def flat(scene: DeviceScene, seed: int = 0) -> sample_queue.QueueWalk:
    """Full walks under flat skin, exits looked for on the real surface."""
    return _queue_walk(scene, seed, {"walk": "flat-full"}, ())


def inside(scene: DeviceScene, seed: int = 0) -> sample_queue.QueueWalk:
    """Walks inside the scene's mesh; InputError for one with holes."""
    depths = distance.of_mesh(
        scene.shape.positions_mm, scene.shape.triangles, scene.luts.tissue.epidermis_mm, scene.device
    )
    told = {
        "walk": "mesh",
        "depth_cell_mm": depths.spacing_mm,
        "depth_bytes": depths.bytes,
        "notes": list(depths.notes),
    }
    return _queue_walk(scene, seed, told, tuple(distance.buffers(scene.device, depths)))


def _queue_walk(scene: DeviceScene, seed: int, facts: dict, depths: tuple) -> sample_queue.QueueWalk:
    tally = Tally()
    medium, _ = bake.skin_medium(scene.luts.tissue, scene.luts.paths.wavelength_nm)
    medium = replace(medium, nu_per_mm=least_absorption(scene))
    waves = device_scene.waves(scene.luts, scene.luts.oxygenation)
    waves[:, device_scene.NU] = medium.nu_per_mm
    here = replace(scene, buffers=scene.buffers | {"waves": ocl.buffer(scene.device, waves)})

    def step(entries, exits, part: sample_queue.Part) -> int:
        """Walk a part and say how many events that took."""
        before = tally.events
        walk(medium, entries, exits, part, seed, scene.device, tally, depths)
        facts["photons"] = asdict(tally)
        return tally.events - before

    return sample_queue.queue_walk(here, step, facts, not depths, REACH)


def least_absorption(scene: DeviceScene) -> np.ndarray:
    """The least absorption [K] of any texel's epidermis or dermis, 1/mm: how fast lives may end.

    It is linear in melanosome and blood fractions and in the eumelanin ratio, so least where each is least or most.
    """
    columns, rows = scene.view["chromophore_size"]
    ratios = ocl.read(scene.device, scene.buffers["chromophore_map"], np.empty((rows, columns, 4), "f2"))[..., :3]
    ends = np.stack([ratios.min(axis=(0, 1)), ratios.max(axis=(0, 1))]).astype(float)
    allowed = scene.view["chromophores_low"].astype(float), scene.view["chromophores_high"].astype(float)
    skins = np.clip(scene.view["chromophores"] * ends, *allowed)
    corners = [skin.ravel() for skin in np.meshgrid(*skins.T, indexing="ij")]
    mu = expand.coefficients(scene.luts.paths.wavelength_nm, scene.luts.absorbers, *corners)
    return 0.999 * np.minimum(mu[0].min(axis=1), mu[1].min(axis=1))  # half floats and shares of texels round
