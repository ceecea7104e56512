"""Speed against accuracy of every method and setting, as charts."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from lutgen.commands import Outcome, chart_options

EXAMPLES = ("lutgen chart --out charts --quick",)


def arguments(parser: ArgumentParser) -> None:
    """Add the folder and --quick."""
    chart_options.arguments(parser, quick=True)


def run(options: Namespace) -> Outcome:
    """Speed against accuracy."""
    from lutgen.charts.accuracy import chart

    return chart_options.drawn(options, chart.draw, quick=options.quick)
