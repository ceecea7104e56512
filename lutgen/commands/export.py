"""A LUT set in the form that engines open."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path

import lutgen
from lutgen import exports
from lutgen.commands import Outcome, progress
from lutgen.exports import resampled

EXAMPLES = ("lutgen export --to unity,unreal --out for-engines", "lutgen export my-luts --to all --out exports --force")


def arguments(parser: ArgumentParser) -> None:
    """Add the set, and what it becomes."""
    parser.add_argument("dir", nargs="?", metavar="LUT_DIR", help="LUT set (default: the one that came along)")
    parser.add_argument(
        "--to", required=True, metavar="TARGET[,TARGET...]", help=f"{', '.join(exports.TARGETS)}, or all"
    )
    parser.add_argument("--out", required=True, metavar="DIR", help="folder to make, with one folder a target")
    parser.add_argument(
        "--size", type=int,
        help="nodes along each axis of a cube, {} to {} (default: so many that the set's own are among them, 31 for "
        "the default set)".format(*resampled.SIZES),
    )  # fmt: skip
    parser.add_argument("--force", action="store_true", help="replace an existing folder")
    progress.arguments(parser)


def run(options: Namespace) -> Outcome:
    """A folder per engine, and the error that each adds."""
    targets = exports.targets_of(options.to)
    luts = lutgen.load(options.dir)
    with progress.Progress(options) as tell:
        errors = exports.export(luts, targets, options.out, options.size, options.force, tell)
    out = str(Path(options.out).absolute())
    text = "\n".join([out, *(f"{name}: {words}" for name, (words, _) in errors.items())])
    values = {name: error for name, (_, error) in errors.items()}
    return {"out": out, "targets": list(targets), "error": values}, text, 0
