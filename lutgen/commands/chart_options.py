"""Charts in a folder: what figures, chart and stability take, and what they say."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from pathlib import Path

from lutgen.commands import Outcome, progress


def arguments(parser: ArgumentParser, quick: bool) -> None:
    """Add the folder and, where charts can be `quick`, --quick."""
    parser.add_argument("--out", required=True, metavar="DIR", help="folder to make")
    if quick:
        parser.add_argument("--quick", action="store_true", help="in under a minute: fewer photons, coarser maps")
    progress.arguments(parser)


def drawn(options: Namespace, draw: Callable[..., dict[str, str]], **settings) -> Outcome:
    """What `draw(out, progress=..., **settings)` drew: each chart by name, and in words what it shows."""
    out = Path(options.out)
    with progress.Progress(options) as tell:
        charts = draw(out, progress=tell, **settings)
    text = f"{out.absolute()}\n" + "\n".join(f"{name}: {words}" for name, words in charts.items())
    return {"out": str(out.absolute()), "charts": charts}, text, 0
