"""Ways to take samples of a picture: each opens on a scene and then adds samples of pixels to their moments."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from lutgen import device as ocl
from lutgen import render
from lutgen.render import device_scene, flat_exits, mesh_walk
from lutgen.render.device_scene import DeviceScene
from lutgen.render.mesh_walk import REACH

GROUP = 5
"""Samples whose walks go evenly near and far: together one estimate. It divides 20, 50, 500."""
DRAWS = 4
"""Records that stand for one wavelength's paths through a cell."""


class Walk(Protocol):
    """An opened way to take samples.

    `group`: samples that make one whole estimate; counts of samples are multiples of it. `pixels`: how many each call
    must take, with one estimate each; None: any, and any number of samples. `facts`: for the manifest. `events` and
    `seconds` by stage, "walk" among them: of scattering so far.
    """

    group: int
    facts: dict
    events: int
    seconds: dict[str, float]

    @property
    def pixels(self) -> int | None:
        """Pixels of every call, or None."""
        ...

    def __call__(self, begin: int, end: int, first: int, samples: int, moments, tallies) -> None:
        """Add samples first ... first + samples - 1 of the pixels begin ... end - 1 to the buffers of moments
        [pixels, 10] f4 and of tallies [items, TALLIES] u4, of which `device_scene.items` rows are used."""


@dataclass
class Flat:
    """Flat walks drawn from path tables (kernels/render/flat.cl)."""

    scene: DeviceScene
    kernel: object
    tables: tuple
    facts: dict
    events: int
    seconds: dict[str, float]
    group: int = GROUP
    pixels: int | None = None

    def __call__(self, begin: int, end: int, first: int, samples: int, moments, tallies) -> None:
        numbers = (np.uint32(v) for v in (begin, end, first, samples))
        shape, arguments, since = (
            (device_scene.items(self.scene, end - begin),),
            self.scene.arguments,
            time.perf_counter(),
        )
        ocl.launch(self.scene.device, self.kernel, shape, *arguments, *self.tables, *numbers, moments, tallies)
        self.seconds["pictures"] += time.perf_counter() - since


def flat(scene: DeviceScene, seed: int = 0, photons: int | None = None) -> Flat:
    """Trace the exits of the scene's skin and open the flat walk over them."""
    melanin, eumelanin, hemoglobin = (float(v) for v in scene.view["chromophores"])
    skin = melanin, eumelanin, hemoglobin
    since = time.perf_counter()
    found = flat_exits.trace(scene.device, scene.luts, skin, photons or flat_exits.EXITS, seed)
    seconds = {"walk": time.perf_counter() - since, "pictures": 0.0}
    built = device_scene.kernel(
        scene, "flat", "render/exit_surface", "render/exits", "render/flat",
        ANGLES=len(found.cosines), CELLS=found.drawn.shape[1],
        SECTORS=flat_exits.SECTORS, QUANTILES=flat_exits.QUANTILES, GROUP=GROUP, DRAWS=DRAWS, REACH=REACH,
        LEAST_COSINE=float(found.cosines[0]),
    )  # fmt: skip
    color, sigma = found.color(scene.luts, skin)
    facts = {
        "walk": "flat", "exits_per_wavelength_and_angle": found.photons, "angles": len(found.cosines),
        "rings": len(found.radius_edges_mm) - 1, "sectors": flat_exits.SECTORS,
        "color_acescg": color.tolist(), "color_std_error_acescg": sigma.tolist(), "reach": REACH,
    }  # fmt: skip
    return Flat(scene, built, flat_exits.buffers(scene.device, found), facts, found.events, seconds)


WALKS: dict[str, Callable[..., Walk]] = dict(zip(render.WALKS, (flat, mesh_walk.flat, mesh_walk.inside), strict=True))
"""By the name that --walk takes."""
