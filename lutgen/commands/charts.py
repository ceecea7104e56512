"""Charts and tables of what lutgen does: figures, chart, stability."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable
from functools import partial
from pathlib import Path

from lutgen.commands import Outcome
from lutgen.commands.progress import Progress


def figures(options: Namespace) -> Outcome:
    """`lutgen figures`: the source document's results, and what they are compared with, as charts and tables."""
    from lutgen.charts.document import figures as charts

    return _drawn(options, charts.draw)


def chart(options: Namespace) -> Outcome:
    """`lutgen chart`: speed against accuracy."""
    from lutgen.charts.accuracy import chart as charts

    return _drawn(options, partial(charts.draw, quick=options.quick))


def stability(options: Namespace) -> Outcome:
    """`lutgen stability`: error maps, bias and the failure list."""
    from lutgen.charts.stability import stability as charts

    return _drawn(options, partial(charts.draw, quick=options.quick))


def _drawn(options: Namespace, draw: Callable[..., dict[str, str]]) -> Outcome:
    out = Path(options.out)
    with Progress(quiet=options.json) as progress:
        shown = draw(out, progress=progress)
    text = f"{out.absolute()}\n" + "\n".join(f"{name}: {words}" for name, words in shown.items())
    return {"out": str(out.absolute()), "charts": shown}, text, 0
