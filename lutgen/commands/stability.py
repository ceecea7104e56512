"""Where each method errs beyond its promise, as maps and a table."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from lutgen.commands import Outcome, chart_options

EXAMPLES = ("lutgen stability --out stability --quick",)


def arguments(parser: ArgumentParser) -> None:
    """Add the folder and --quick."""
    chart_options.arguments(parser, quick=True)


def run(options: Namespace) -> Outcome:
    """Error maps, bias and the failure list."""
    from lutgen.charts.stability import stability

    return chart_options.drawn(options, stability.draw, quick=options.quick)
