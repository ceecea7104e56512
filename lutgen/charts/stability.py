"""`lutgen stability`: where methods err beyond their promise, what `mixed` absorption costs, known failures."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from lutgen.charts import bias, drawing, maps, margins


def draw(out: Path, quick: bool = False, progress: Callable = lambda stage, tally: None) -> dict[str, str]:
    """Draw every map into the folder `out`, which appears whole or not at all; what each shows, by its name.

    `quick` takes coarser maps. Raises InputError where `out` holds something, MachineError without matplotlib.
    """
    with drawing.folder(out) as folder:
        shown = {"error maps": maps.methods(folder, quick, progress)}
        shown["diffusion-domain"] = maps.diffusion(folder, quick, progress)
        progress("mixed-bias", None)
        shown["mixed-bias"] = bias.bias(folder, quick)
        shown["failures"] = margins.table(folder, progress)
    return shown
