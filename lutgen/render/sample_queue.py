"""Pictures over a queue of samples: camera rays, walks of any kind, light where they left.

Its kernels are kernels/render/sample_queue.cl.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from lutgen import device as ocl
from lutgen.render import device_scene
from lutgen.render.device_scene import DeviceScene

ENTRY = np.dtype(
    [("position", "f4", (3,)), ("wavelength", "u4"), ("normal", "f4", (3,)), ("pad", "u4"), ("direction", "f4", (3,)),
     ("sample", "u4")]
)  # fmt: skip
"""A walk's beginning: on the skin (mm), unit outward normal, refracted unit direction inside; `sample` EMPTY: none."""
EXIT = np.dtype(
    [("position", "f4", (3,)), ("path_epidermis_mm", "f4"), ("direction", "f4", (3,)), ("path_dermis_mm", "f4"),
     ("normal", "f4", (3,)), ("pad", "f4")]
)  # fmt: skip
"""A walk's end: where it left, unit direction in air, paths (the dermis's negative: it did not leave), normal there."""
SAMPLE = np.dtype(
    [(name, "f4", (3,)) for name in ("light", "tint", "skin", "mirrored_direction", "mirrored_tint")]
    + [(name, "f4") for name in ("share", "u", "v", "mirrored_u", "mirrored_v")]
    + [(name, "i4") for name in ("triangle", "mirrored_triangle", "hit", "bounces")]
    + [("wavelength", "u4")]
)
"""What a sample has gathered so far, and what its walk goes on with."""
STRUCTS = (("entry_t", ENTRY), ("exit_t", EXIT), ("sample_t", SAMPLE))
EMPTY = 0xFFFFFFFF
SLOTS = 2**19
"""Places of a queue at most: 0.1 GB. Every call fills as many, so that random streams do not depend on speed."""
BLOCK = 2048
"""Pixels that random streams are keyed by."""
NEAR_MM = 0.5


@dataclass(frozen=True)
class Part:
    """What a queue holds: samples first ... first + samples - 1 of the pixels begin ... end - 1, one after the other;
    counts of samples are multiples of the wavelengths. `turn`: how often their walks have been from skin to skin."""

    begin: int
    end: int
    first: int
    samples: int
    turn: int = 0


PathWalk = Callable[[object, object, Part], int]
"""Turns a buffer of ENTRY into one of EXIT: (entries, exits, what they hold) -> events."""


@dataclass
class QueueWalk:
    """A way to take samples (walks.Walk) around a stage that walks; `seconds` and `events` add up by stage."""

    scene: DeviceScene
    walk: PathWalk
    kernels: dict[str, object]
    facts: dict
    group: int
    seconds: dict[str, float] = field(default_factory=dict)
    events: int = 0

    @property
    def pixels(self) -> int:
        """Pixels of every call but a picture's last."""
        return max(SLOTS // self.group // BLOCK * BLOCK, BLOCK)

    def __call__(self, begin: int, end: int, first: int, samples: int, moments, tallies) -> None:
        """Add samples of pixels begin ... end - 1."""
        device, arguments = self.scene.device, self.scene.arguments
        places, shape = (end - begin) * samples, (device_scene.items(self.scene, end - begin),)
        entries, exits, queue = (ocl.buffer(device, kind.itemsize * places) for kind in (ENTRY, EXIT, SAMPLE))
        waiting = np.zeros(shape, "u4")
        waiting_buffer = ocl.buffer(device, waiting)
        numbers = tuple(np.uint32(v) for v in (begin, end, first, samples))
        with self._timed("camera"):
            ocl.launch(device, self.kernels["aim"], shape, *arguments, *numbers, entries, queue, tallies)
        for turn in range(2 * int(self.scene.view["bounces"]) + 2):
            with self._timed("walk"):
                self.events += self.walk(entries, exits, Part(begin, end, first, samples, turn))
            with self._timed("light"):
                more = np.uint32(turn), entries, exits, queue, tallies, waiting_buffer
                ocl.launch(device, self.kernels["gather"], shape, *arguments, *numbers, *more)
            if not ocl.read(device, waiting_buffer, waiting).any():
                break
        with self._timed("light"):
            ocl.launch(device, self.kernels["settle"], shape, *numbers[:2], numbers[3], queue, moments, tallies)

    @contextlib.contextmanager
    def _timed(self, name: str) -> Iterator[None]:
        since = time.perf_counter()
        yield
        self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - since


def queue_walk(scene: DeviceScene, walk: PathWalk, facts: dict, flat: bool, reach: float) -> QueueWalk:
    """Open the stages around a walk; `flat`: exits lie in the tangent plane and are looked for on the real surface."""
    n = float(scene.luts.manifest["trace"]["n"])
    options = {"REACH": reach, "NEAR_MM": NEAR_MM, "SINE_INSIDE": 1 / n, **({"FLAT": 1} if flat else {})}
    kernels = {
        name: device_scene.kernel(scene, name, "render/exit_surface", "render/sample_queue", structs=STRUCTS, **options)
        for name in ("aim", "gather", "settle")
    }
    return QueueWalk(scene, walk, kernels, facts, group=len(scene.luts.weights))
