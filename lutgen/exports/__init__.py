"""A LUT set in the form that each engine opens: one module a target, all with one function, `write`."""

from __future__ import annotations

import importlib
import json
from pathlib import Path

from lutgen.errors import InputError, one_of
from lutgen.exports.resampled import Report, Source, nested_size
from lutgen.files import folders
from lutgen.tables.lut_set import LutSet

TARGETS = {
    "cube": "cube", "exr": "strips", "unreal": "unreal", "unity": "unity", "godot": "godot", "three": "three",
    "openpbr": "openpbr", "preintegrated": "preintegrated",
}  # fmt: skip
"""Targets, and the module of this package that writes the folder of each."""
README_LINES, ERROR_LINE = 10, 8
"""Lines of each README, and the one (from 0) that states the error."""


def targets_of(text: str) -> tuple[str, ...]:
    """The targets of `cube,unity`, or all of them for `all`; InputError for an unknown or missing one.

    >>> targets_of("cube,exr")
    ('cube', 'exr')
    """
    names = tuple(dict.fromkeys(part.strip() for part in text.split(",") if part.strip()))
    if not names:
        raise InputError(f"to = {text!r}: allowed is {', '.join(TARGETS)} or all")
    return tuple(TARGETS) if names == ("all",) else tuple(one_of("to", name, tuple(TARGETS)) for name in names)


def export(luts: LutSet, targets: tuple[str, ...], out: str | Path, size: int | None, force: bool, progress) -> dict:
    """Write a folder with one folder per target: by target, the error that it adds, in words and as plain values.

    It is there whole or not at all. `size`: nodes along each axis of what must be cubic (None: so many that
    the set's own nodes are among them). Raises InputError
    for a size that a target cannot hold or a folder that cannot be written.
    """
    source = Source(luts, nested_size(luts) if size is None else size)
    errors = {}
    with folders.whole(out, force) as partial:
        for name in targets:
            progress(name, None)
            folder = partial / name
            folder.mkdir()
            report = importlib.import_module(f"lutgen.exports.{TARGETS[name]}").write(source, folder)
            (folder / "README.txt").write_text(_readme(name, report), encoding="utf-8")
            errors[name] = report.readme[ERROR_LINE], report.error
        facts = {key: value for key, value in luts.manifest.items() if key != "files"}
        manifest = facts | {
            "export": {"targets": list(targets), "size": source.size, "error": {k: v for k, (_, v) in errors.items()}}
        }
        text = json.dumps(manifest, indent=1) + "\n"
        for folder in (partial, *(partial / name for name in targets)):
            (folder / "manifest.json").write_text(text, encoding="utf-8")
    return errors


def _readme(name: str, report: Report) -> str:
    if len(report.readme) != README_LINES:
        raise ValueError(f"{name}: {len(report.readme)} lines of README")
    return "\n".join(report.readme) + "\n"
