"""How far long work is: a bar on a terminal, else a line per stage or per 30 s; --quiet."""

from __future__ import annotations

import sys
import time
from argparse import ArgumentParser, Namespace

LINE_S = 30.0
"""Without a terminal, a stage that counts what it has done says so this often."""


def arguments(parser: ArgumentParser) -> None:
    """Add --quiet."""
    parser.add_argument("--quiet", action="store_true", help="no progress on stderr (default: a bar, or lines)")


class Progress:
    """Progress on stderr, silent with --quiet and --json.

    Called as progress(stage, None) where a stage begins and progress(stage, tally) while it runs; a tally has
    `photons` done `of` so many, the `events` so far and, where these are not scattering events, their `unit`.
    """

    def __init__(self, options: Namespace):
        self._quiet = options.quiet or options.json
        self._bar = None
        if not self._quiet and sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

            self._bar = Progress(
                TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[rate]}"),
                TimeRemainingColumn(), console=Console(stderr=True), transient=True,
            )  # fmt: skip
            self._task = self._bar.add_task("start", total=None, rate="")
        self._start = self._stage_start = self._said = time.perf_counter()

    def __enter__(self):
        if self._bar:
            self._bar.start()
        return self

    def __exit__(self, *_):
        if self._bar:
            self._bar.stop()

    def __call__(self, stage: str, tally) -> None:
        if self._quiet:
            return
        now = time.perf_counter()
        if tally is None:
            self._stage_start = now
            if self._bar:
                self._bar.update(self._task, description=stage, total=None, completed=0, rate="")
            else:
                self._say(now, stage)
            return
        taken = now - self._stage_start
        rate = f"{tally.events / taken / 1e6:.3g} M {getattr(tally, 'unit', 'events')}/s"
        if self._bar:
            self._bar.update(self._task, total=tally.of, completed=tally.photons, rate=rate)
        elif now - self._said >= LINE_S and tally.photons:
            share = tally.photons / tally.of
            self._say(now, f"{stage}: {share:.0%}, {rate}, {taken * (1 - share) / share:.0f} s left")

    def _say(self, now: float, line: str) -> None:
        self._said = now
        print(f"{now - self._start:7.1f} s  {line}", file=sys.stderr, flush=True)
