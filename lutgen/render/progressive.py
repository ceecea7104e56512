"""Sampling until a goal is met: launches under a second, a file every few seconds, and counts of what was done."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from lutgen import device as ocl
from lutgen.errors import InputError
from lutgen.render import film, flat_walk
from lutgen.render.device_scene import TALLIES, DeviceScene, items
from lutgen.render.film import Film
from lutgen.render.goal import Goal

LAUNCH_SECONDS = 0.4
SAVE_SECONDS, CHECK_SECONDS = 5.0, 0.5
_HELD = 16
"""Estimates that the device adds up in single precision before the host takes them over in double: always the same
ones together, so that sums do not depend on how launches were cut."""


@dataclass
class Tally:
    """What a run did, for a progress bar and a report; `photons` of `of`: how near the goal is, `events`: rays."""

    photons: int = 0
    of: int = 0
    events: int = 0
    unit: str = "rays"
    counts: dict[str, int] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)

    def add(self, name: str, seconds: float) -> None:
        """Add to what a part of the work took."""
        self.seconds[name] = self.seconds.get(name, 0.0) + seconds

    @property
    def rays(self) -> int:
        """Rays of all kinds."""
        return sum(self.counts.get(name, 0) for name in TALLIES[:4])


def render(
    scene: DeviceScene, walk: flat_walk.Walk, start: Film, goal: Goal, save: Callable[[Film, float], None],
    stopped: Callable[[], bool] = lambda: False, progress: Callable = lambda scene, tally: None, exposure: float = 0.0,
) -> tuple[Film, Tally, float]:  # fmt: skip
    """Add samples to a picture until the goal or a stop; returns it, what was done, and its noise in ΔE00.

    `save` is given the picture every few seconds and in the end. InputError where the camera looks at back faces.
    """
    columns, rows = scene.size
    pixels, device, group = columns * rows, scene.device, walk.group
    tally, begun, rate, cost = Tally(), time.perf_counter(), 2e4, 0.0
    saved = checked = begun
    held_buffer = ocl.buffer(device, np.zeros((pixels, film.MOMENTS), "f4"))
    tallies = np.zeros((items(scene, pixels), len(TALLIES)), "u4")
    tally_buffer = ocl.buffer(device, tallies)
    made, held, noise = start, 0, film.noise_delta_e(start, exposure)
    earlier = start.facts.get("counts", {})
    limit = None if goal.samples is None else -(-goal.samples // group) * group

    def gathered() -> Film:
        """The picture with what the device holds, and what was counted for it in all runs."""
        moments = ocl.read(device, held_buffer, np.zeros((pixels, film.MOMENTS), "f4"))
        sums = made.sums + moments.reshape(made.sums.shape)
        counts = {name: earlier.get(name, 0) + count for name, count in tally.counts.items()} or earlier
        return replace(made, sums=sums, estimates=made.estimates + held, facts=made.facts | {"counts": counts})

    while True:
        done = (made.estimates + held) * group
        elapsed = time.perf_counter() - begun
        if (limit is not None and done >= limit) or (goal.seconds is not None and elapsed >= goal.seconds) or stopped():
            break
        if goal.noise is not None and noise <= goal.noise:
            break
        room = (_HELD - (made.estimates + held) % _HELD) * group
        room = room if limit is None else min(room, limit - done)
        samples = group if walk.pixels else max(min(int(LAUNCH_SECONDS * rate / pixels) // group * group, room), group)
        at_a_time = walk.pixels or max(int(LAUNCH_SECONDS * rate / samples) // 64 * 64, 64)
        since = time.perf_counter()
        for begin in range(0, pixels, at_a_time):
            launched = time.perf_counter()
            end = min(begin + at_a_time, pixels)
            walk(begin, end, done, samples, held_buffer, tally_buffer)
            taken = max(time.perf_counter() - launched, 1e-4)
            rate = min((end - begin) * samples / taken, 4 * rate)
        tally.add("sample", time.perf_counter() - since)
        held += samples // group
        counts = ocl.read(device, tally_buffer, tallies).sum(axis=0, dtype="u8")
        tally.counts = dict(zip(TALLIES, counts.tolist(), strict=True))
        _look_outside(tally)
        tally.events = tally.rays
        _say(tally, goal, limit, done + samples, time.perf_counter() - begun, noise)
        progress("render", tally)
        if (made.estimates + held) % _HELD == 0:
            made, held = gathered(), 0
            ocl.clear(device, held_buffer, 4 * pixels * film.MOMENTS)
        since = time.perf_counter()
        due = since - saved > max(SAVE_SECONDS, 10 * cost)
        if due or (goal.noise is not None and since - checked > CHECK_SECONDS):
            now = gathered()
            noise = film.noise_delta_e(now, exposure)
            if due:
                save(now, noise)
            checked = time.perf_counter()
            cost, saved = (checked - since, checked) if due else (cost, saved)
            tally.add("write", checked - since)
    since = time.perf_counter()
    made = gathered()
    noise = film.noise_delta_e(made, exposure)
    save(made, noise)
    tally.add("write", time.perf_counter() - since)
    return made, tally, noise


def _look_outside(tally: Tally) -> None:
    """InputError where most of what the camera sees are back faces."""
    if tally.counts["BACKS"] > 0.5 * tally.counts["HITS"] > 0:
        share = tally.counts["BACKS"] / tally.counts["HITS"]
        raise InputError(
            f"the camera sees {100 * share:.0f} % back faces: it is inside the head, or behind an open surface; change "
            "distance_mm, azimuth or target_mm, or mend the mesh's normals"
        )


def _say(tally: Tally, goal: Goal, limit: int | None, done: int, elapsed: float, noise: float) -> None:
    """How far the goal that comes first is."""
    shares = [
        0.0 if limit is None else done / limit,
        0.0 if goal.seconds is None else elapsed / goal.seconds,
        0.0 if goal.noise is None or not noise < float("inf") else (goal.noise / max(noise, 1e-9)) ** 2,
    ]
    tally.photons, tally.of = int(1e6 * min(max(shares), 1.0)), 10**6
