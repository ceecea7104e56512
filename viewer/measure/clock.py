"""What each pass of a frame took: on the GPU's own clock, or on the processor's where it draws in software."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator
from dataclasses import dataclass, field

import moderngl

from .. import gl

_SOFTWARE = ("llvmpipe", "softpipe", "swrast", "swr ", "swiftshader", "software")
_FREE: list[moderngl.Query] = []
"""Queries of released clocks. moderngl never deletes a query, so the next clock takes these instead of new ones."""


@dataclass
class Clock:
    """`taken`: the last frame's passes, each with its query or its seconds; `queries`: those made so far, by pass.

    `software`: without queries. A tiled software renderer (llvmpipe) stamps a query per tile, and each tile overwrites
    the stamp before it: within one batch a query tells the time of the last tile. There every pass is finished before
    the next one starts and the processor's clock is read; that costs nothing measurable, for a software renderer
    hardly overlaps its passes.
    """

    software: bool
    queries: dict[str, moderngl.Query] = field(default_factory=dict)
    taken: dict[str, moderngl.Query | float] = field(default_factory=dict)


def is_software() -> bool:
    """Whether the process's OpenGL draws on the processor."""
    renderer = gl.context().info["GL_RENDERER"].lower()
    return any(name in renderer for name in _SOFTWARE)


def open_clock(software: bool | None = None) -> Clock:
    """A clock that has measured nothing yet."""
    return Clock(is_software() if software is None else software)


def start(clock: Clock) -> None:
    """Begin a frame: what the last one took is forgotten."""
    clock.taken.clear()


@contextlib.contextmanager
def timed(clock: Clock, name: str) -> Iterator[None]:
    """Measure the pass drawn inside, once a frame; on a GPU without waiting for it."""
    context = gl.context()
    if clock.software:
        context.finish()
        since = time.perf_counter()
        yield
        context.finish()
        clock.taken[name] = time.perf_counter() - since
        return
    if name not in clock.queries:
        clock.queries[name] = next((q for q in _FREE if q.ctx is context), None) or context.query(time=True)
        _FREE[:] = [q for q in _FREE if q is not clock.queries[name]]
    with clock.queries[name]:
        yield
    clock.taken[name] = clock.queries[name]


def milliseconds(clock: Clock) -> dict[str, float]:
    """Milliseconds of the last frame's passes; a GPU that has not finished that frame is waited for.

    So read them before the next frame is drawn, when this one is on the screen. A pass of 4.29 s or more reads 4.29 s:
    moderngl reads nanoseconds in 32 bits.
    """
    return {
        name: 1000 * taken if isinstance(taken, float) else taken.elapsed / 1e6 for name, taken in clock.taken.items()
    }


def release(clock: Clock) -> None:
    """Hand the clock's queries to the next one."""
    _FREE.extend(clock.queries.values())
    clock.queries.clear()
    clock.taken.clear()
