"""Pictures in stages over a queue (kernels/stages.cl): camera rays, walks of any kind, light where they left."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from lutgen import device as ocl
from lutgen.render import stage
from lutgen.render.stage import Stage

ENTRY = np.dtype(
    [("position", "f4", (3,)), ("wavelength", "u4"), ("normal", "f4", (3,)), ("pad", "u4")]
    + [("direction", "f4", (3,)), ("sample", "u4")]
)
"""A walk's beginning: on the skin (mm), unit outward normal, refracted unit direction inside; `sample` EMPTY: none."""
EXIT = np.dtype(
    [("position", "f4", (3,)), ("path_epidermis_mm", "f4"), ("direction", "f4", (3,)), ("path_dermis_mm", "f4")]
    + [("normal", "f4", (3,)), ("pad", "f4")]
)
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
"""Places of a queue at most: 0.1 GB."""
NEAR_MM = 0.5
_AT_A_TIME = 64

WalkStage = Callable[[object, object, int, int], int]
"""Turns a buffer of ENTRY into one of EXIT: (entries, exits, how many places, block for the random streams) -> events."""


@dataclass
class Staged:
    """A way to take samples (walks.Walk) around a stage that walks; `seconds` and `events` add up by stage."""

    stage: Stage
    walk: WalkStage
    kernels: dict[str, object]
    facts: dict
    group: int
    seconds: dict[str, float] = field(default_factory=dict)
    events: int = 0

    def __call__(self, begin: int, end: int, first: int, samples: int, moments, tallies) -> None:
        """Add samples of pixels begin ... end - 1, as many pixels at a time as the queue holds."""
        most = max(SLOTS // samples // _AT_A_TIME * _AT_A_TIME, _AT_A_TIME)
        for low in range(begin, end, most):
            self._some(low, min(low + most, end), first, samples, moments, tallies)

    def _some(self, begin: int, end: int, first: int, samples: int, moments, tallies) -> None:
        device, scene = self.stage.device, self.stage.arguments
        pixels, places = end - begin, -(-(end - begin) * samples // _AT_A_TIME) * _AT_A_TIME
        entries = ocl.buffer(device, _emptied(places))
        exits, queue = ocl.buffer(device, EXIT.itemsize * places), ocl.buffer(device, SAMPLE.itemsize * places)
        waiting = np.zeros(places // _AT_A_TIME, "u4")
        waiting_buffer = ocl.buffer(device, waiting)
        numbers = tuple(np.uint32(v) for v in (begin, first, samples))
        self._timed("camera", lambda: ocl.launch(
            device, self.kernels["aim"], (pixels,), *scene, *numbers, entries, queue, tallies))  # fmt: skip
        for turn in range(2 * int(self.stage.view["bounces"]) + 2):
            self.events += self._timed(
                "walk", lambda turn=turn: self.walk(entries, exits, places, _block(begin, first, turn))
            )
            self._timed("light", lambda turn=turn: ocl.launch(
                device, self.kernels["gather"], (places // _AT_A_TIME,), *scene, *numbers, np.uint32(turn),
                np.uint32(_AT_A_TIME), entries, exits, queue, tallies, waiting_buffer))  # fmt: skip
            if not ocl.read(device, waiting_buffer, waiting).any():
                break
        self._timed("light", lambda: ocl.launch(
            device, self.kernels["settle"], (pixels,), numbers[0], numbers[2], queue, moments, tallies))  # fmt: skip

    def _timed(self, name: str, act: Callable):
        since = time.perf_counter()
        done = act()
        self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - since
        return done


def staged(on: Stage, walk: WalkStage, facts: dict, flat: bool, reach: float) -> Staged:
    """Open the stages around a walk; `flat`: exits lie in the tangent plane and are looked for on the real surface."""
    n = float(on.luts.manifest["trace"]["n"])
    options = {"REACH": reach, "NEAR_MM": NEAR_MM, "SINE_INSIDE": 1 / n, **({"FLAT": 1} if flat else {})}
    kernels = {
        name: stage.kernel(on, name, "places", "stages", structs=STRUCTS, **options)
        for name in ("aim", "gather", "settle")
    }
    return Staged(on, walk, kernels, facts, group=len(on.luts.weights))


def _emptied(places: int) -> np.ndarray:
    entries = np.zeros(places, ENTRY)
    entries["sample"] = EMPTY
    return entries


def _block(begin: int, first: int, turn: int) -> int:
    """A block number of its own for the random streams of a launch, whatever launches come before it."""
    return ((begin // _AT_A_TIME) * 0x9E3779B1 + first * 0x85EBCA77 + turn) % 2**32
