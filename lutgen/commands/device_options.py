"""The OpenCL device that a command computes on: --device."""

from __future__ import annotations

from argparse import ArgumentParser


def arguments(parser: ArgumentParser) -> None:
    """Add --device."""
    parser.add_argument(
        "--device",
        metavar="NAME",
        help="index or part of a name that `lutgen devices` lists (default: LUTGEN_DEVICE, else the first)",
    )
