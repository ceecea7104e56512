"""The viewer's stage, on which view and sheet draw; --compare."""

from __future__ import annotations

import contextlib
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from lutgen.commands import scene_options
from lutgen.scene import viewer
from lutgen.scene.look import Look
from lutgen.tables import storage


def arguments(parser: ArgumentParser, size: str) -> None:
    """Add what describes a scene, and another LUT set beside its own."""
    scene_options.arguments(parser, size)
    parser.add_argument(
        "--compare", metavar="DIR", help="another LUT set, the right half with --set split=set (default: none)"
    )


def opener(options: Namespace, look: Look) -> tuple[Callable, tuple[str, ...]]:
    """What opens the stage that the options describe at a size in pixels, and the notes about its head."""
    app = viewer.viewer("app")
    other = None if options.compare is None else storage.load(Path(options.compare))
    scene = scene_options.scene_of(options, look)
    return (
        partial(app.open_stage, scene.luts, scene.head, scene.maps, other=other, around=scene.surroundings),
        scene.notes,
    )


@contextlib.contextmanager
def opened(open_stage: Callable, size: tuple[int, int]) -> Iterator:
    """A stage of a size in pixels, freed in the end."""
    stage = open_stage(size)
    try:
        yield stage
    finally:
        viewer.viewer("stage").release(stage)
