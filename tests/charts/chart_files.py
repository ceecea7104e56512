"""What a chart leaves on disk: a picture twice, and its numbers."""

import csv
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

KINDS = ("svg", "png", "csv")


def rows_of(folder: Path, name: str) -> list[dict[str, str]]:
    """The rows of a chart's table."""
    with (folder / f"{name}.csv").open() as file:
        return list(csv.DictReader(file))


def holds_only(folder: Path, name: str, rows: Sequence) -> None:
    """Assert that a folder holds one chart and nothing else, its table those rows (dataclasses) to six digits."""
    assert {path.name for path in folder.iterdir()} == {f"{name}.{kind}" for kind in KINDS}
    told = [{k: f"{v:.6g}" if isinstance(v, float) else str(v) for k, v in asdict(row).items()} for row in rows]
    assert rows_of(folder, name) == told
    assert list(rows_of(folder, name)[0]) == list(told[0])
