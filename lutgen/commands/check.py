"""Verify a LUT set: files, axes, laws, 100 nodes against adding-doubling."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from dataclasses import asdict
from pathlib import Path

from lutgen.commands import Outcome

EXAMPLES = ("lutgen check my-luts",)


def arguments(parser: ArgumentParser) -> None:
    """Add the set."""
    parser.add_argument("dir", metavar="DIR", help="folder of the LUT set")


def run(options: Namespace) -> Outcome:
    """Every law that a LUT set must obey; status 2 where one fails."""
    from lutgen.tables import check

    findings = check.check(Path(options.dir))
    good = all(finding.passed for finding in findings)
    text = "\n".join(f"{'ok  ' if f.passed else 'FAIL'}  {f.name}: {f.detail}" for f in findings)
    return {"passed": good, "findings": [asdict(f) for f in findings]}, text, 0 if good else 2
