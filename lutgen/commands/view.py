"""A window with a face shaded from a LUT set, or a picture of it."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from dataclasses import asdict

from lutgen.commands import Outcome, scene_options, stage_options
from lutgen.scene import subject, viewer

EXAMPLES = (
    "lutgen view",
    "lutgen view --preset dark --set tier=high --set exposure=0.5 --size 640x360 --screenshot dark.png",
    "lutgen view my-luts --mesh lee-perry-smith --maps maps",
)
SIZE = "1280x720"


def arguments(parser: ArgumentParser) -> None:
    """Add the scene, and a picture instead of a window."""
    stage_options.arguments(parser, SIZE)
    parser.add_argument(
        "--screenshot", metavar="FILE",
        help="picture to write instead of a window, by its suffix; .exr: linear (default: a window)",
    )  # fmt: skip


def run(options: Namespace) -> Outcome:
    """Open a window, or draw one picture."""
    look, app = scene_options.look_of(options), viewer.viewer("app")
    size = subject.size_of(options.size or SIZE)
    open_stage, notes = stage_options.opener(options, look)
    if options.screenshot is None:
        look = viewer.viewer("window.window").run(open_stage, look, size, notes)
        return {"look": asdict(look), "notes": list(notes)}, "\n".join(notes) or "closed", 0
    with stage_options.opened(open_stage, size) as stage:
        app.screenshot(stage, look, options.screenshot)
    result = {"screenshot": options.screenshot, "size": list(size), "look": asdict(look), "notes": list(notes)}
    return result, "\n".join([f"{options.screenshot}: {size[0]} x {size[1]}", *notes]), 0
