"""A progress bar on a terminal, nothing elsewhere."""

from __future__ import annotations

import sys
import time


class Progress:
    """A rich progress bar on a terminal, nothing elsewhere; called with the stage and, in the trace, a tally."""

    def __init__(self, quiet: bool):
        self._bar = None
        if not quiet and sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

            self._bar = Progress(
                TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[rate]}"),
                TimeRemainingColumn(), console=Console(stderr=True), transient=True,
            )  # fmt: skip
            self._task = self._bar.add_task("start", total=None, rate="")
            self._since = time.perf_counter()

    def __enter__(self):
        if self._bar:
            self._bar.start()
        return self

    def __exit__(self, *_):
        if self._bar:
            self._bar.stop()

    def __call__(self, stage: str, tally) -> None:
        if not self._bar:
            return
        if tally is None:
            self._since = time.perf_counter()
            self._bar.update(self._task, description=stage, total=None, completed=0, rate="")
        else:
            unit = getattr(tally, "unit", "events")
            rate = f"{tally.events / (time.perf_counter() - self._since) / 1e6:.3g} M {unit}/s"
            self._bar.update(self._task, total=tally.of, completed=tally.photons, rate=rate)
