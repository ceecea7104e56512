"""The results of Zhang, Human face rendering, as charts and tables."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from lutgen.commands import Outcome, chart_options

EXAMPLES = ("lutgen figures --out figures",)


def arguments(parser: ArgumentParser) -> None:
    """Add the folder."""
    chart_options.arguments(parser, quick=False)


def run(options: Namespace) -> Outcome:
    """The document's results, and what they are compared with."""
    from lutgen.charts.document import figures

    return chart_options.drawn(options, figures.draw)
