"""The table of known failures: complete, its tests exist, and nothing is beyond its limit."""

import ast
import csv
from dataclasses import replace
from pathlib import Path

import pytest

from lutgen.charts.stability import failures

TESTS = Path(__file__).parent.parent
KNOWN = {  # the list of where such methods fail
    "μz = ±1: frame and sign", "g = 0: division", "g → 1", "scattering cosine outside [−1, 1]",
    "Fresnel 0/0 at normal incidence", "Fresnel beyond the critical angle", "log(0)", "float tallies that stagnate",
    "32-bit counters that overflow", "float32 overshoot at a boundary", "same seed, other result", "weak generators",
    "overlapping streams", "roulette bias", "zero-thickness or clear top layer", "μa = 0 in a semi-infinite medium",
    "diffusion at low albedo", "diffusion near the source", "scalar against vector truth values",
    "a work-item that never ends", "mixed absorption at high μa", "quadrature drift in adding-doubling",
    "half-float tails below 6e-5", "out-of-gamut RGB",
}  # fmt: skip


@pytest.fixture(scope="module")
def rows():
    """Every failure, measured."""
    return failures.rows()


def test_every_known_failure_has_a_row(rows):
    assert {row.failure for row in rows} == KNOWN
    assert len(rows) == len(KNOWN)


def test_every_row_names_a_test_that_exists(rows):
    for row in rows:
        file, name = row.test.removeprefix("tests/").split("::")
        tree = ast.parse((TESTS / file).read_text())
        assert name in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}, row.test


@pytest.mark.parametrize("failure", sorted(KNOWN))
def test_nothing_is_beyond_its_limit(rows, failure):
    (row,) = (row for row in rows if row.failure == failure)
    assert row.used <= 1, row


def test_a_row_beyond_its_limit_is_named(rows, tmp_path, monkeypatch):
    pytest.importorskip("matplotlib")
    broken = [replace(rows[0], measured=2 * rows[0].allowed), replace(rows[3], measured=1.0), *rows[4:6]]
    monkeypatch.setattr(failures, "rows", lambda: broken)
    words = failures.table(tmp_path, lambda stage, tally: None)
    assert f"beyond their limit: {rows[0].failure}, {rows[3].failure};" in words
    with (tmp_path / "failures.csv").open() as file:
        found = list(csv.DictReader(file))
    assert [row["failure"] for row in found] == [row.failure for row in broken]
    assert float(found[0]["used"]) == 2
