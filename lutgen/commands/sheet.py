"""A picture of every preset on a head."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from lutgen.commands import Outcome, progress, scene_options, stage_options
from lutgen.scene import look as looks
from lutgen.scene import subject, viewer

EXAMPLES = ("lutgen sheet --out presets.png", "lutgen sheet my-luts --set tier=high --size 320x320 --out presets.png")
SIZE = "480x480"


def arguments(parser: ArgumentParser) -> None:
    """Add the scene, and the picture."""
    stage_options.arguments(parser, SIZE)
    parser.add_argument("--out", required=True, metavar="FILE", help="PNG to write")
    progress.arguments(parser)


def run(options: Namespace) -> Outcome:
    """Draw every preset beside the others."""
    look, app = scene_options.look_of(options), viewer.viewer("app")
    size = subject.size_of(options.size or SIZE)
    open_stage, notes = stage_options.opener(options, look)
    with stage_options.opened(open_stage, size) as stage, progress.Progress(options) as tell:
        pixels = app.sheet(stage, look, progress=lambda preset: tell(preset, None))
    app.write(pixels, options.out)
    result = {"sheet": options.out, "presets": list(looks.PRESETS), "notes": list(notes)}
    line = f"{options.out}: {pixels.shape[1]} x {pixels.shape[0]}, {len(looks.PRESETS)} presets"
    return result, "\n".join([line, *notes]), 0
