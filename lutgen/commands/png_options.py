"""A picture beside the figures: --png of swatch and fit."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable

from lutgen.errors import cannot_write


def arguments(parser: ArgumentParser, picture: str) -> None:
    """Add --png, whose picture those words name."""
    parser.add_argument("--png", metavar="FILE", help=f"write {picture} (default: none)")


def write(options: Namespace, draw: Callable) -> None:
    """Write what `draw(lutgen.tables.preview)` returns to --png, if it is asked for."""
    if options.png is not None:
        from lutgen.tables import preview

        try:
            draw(preview).save(options.png, format="PNG")
        except OSError as error:
            raise cannot_write("png", options.png, error) from error
