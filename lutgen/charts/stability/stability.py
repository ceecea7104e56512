"""`lutgen stability`: where methods err beyond their promise, what `mixed` absorption costs, known failures."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from lutgen.charts import drawing
from lutgen.charts.stability import absorption_bias, error_maps, failures


def draw(out: Path, quick: bool = False, progress: Callable = drawing.silent) -> dict[str, str]:
    """Draw every map into the folder `out`, which appears whole or not at all; what each shows, by its name.

    `quick` takes coarser maps. Raises InputError where `out` holds something, MachineError without matplotlib.
    """
    with drawing.folder(out) as folder:
        shown = {"error maps": error_maps.methods(folder, quick, progress)}
        shown["diffusion-domain"] = error_maps.diffusion(folder, quick, progress)
        progress("mixed-bias", None)
        shown["mixed-bias"] = absorption_bias.bias(folder, quick)
        shown["failures"] = failures.table(folder, progress)
    return shown
