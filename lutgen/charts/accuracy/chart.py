"""`lutgen chart`: speed against accuracy, in color, in profiles, by setting, by walk and in the viewer."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from lutgen.charts import drawing
from lutgen.charts.accuracy import absorption, profile_shapes, settings, speed, viewer_against_render, viewer_scattering


def draw(out: Path, quick: bool = False, progress: Callable = drawing.silent) -> dict[str, str]:
    """Draw every chart into the folder `out`, which appears whole or not at all; what each shows, by its name.

    `quick` takes fewer photons, seeds and skins. Raises InputError where `out` holds something, MachineError without
    matplotlib or OpenCL; without OpenGL two are left out, and their lines say why.
    """
    with drawing.folder(out) as folder:
        shown = {"speed-accuracy": speed.speed(folder, quick, progress)}
        shown["profiles"] = profile_shapes.shapes(folder, quick, progress)
        progress("settings", None)
        shown["settings"] = settings.settings(folder, quick)
        progress("walks", None)
        shown["walks"] = absorption.walks(folder, quick)
        shown["viewing"] = viewer_scattering.viewing(folder, quick, progress)
        shown["truth"] = viewer_against_render.truth(folder, quick, progress)
    return shown
