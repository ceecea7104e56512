"""Where such methods are known to fail: every failure has a law, every law holds, and a broken one is named."""

from dataclasses import replace

import pytest
from chart_files import rows_of

from lutgen.charts.stability import failures
from lutgen.charts.stability.laws import LAWS

KNOWN = {  # the list of where such methods fail
    "μz = ±1: frame and sign", "g = 0: division", "g → 1", "scattering cosine outside [−1, 1]",
    "Fresnel 0/0 at normal incidence", "Fresnel beyond the critical angle", "log(0)", "float tallies that stagnate",
    "32-bit counters that overflow", "float32 overshoot at a boundary", "same seed, other result", "weak generators",
    "overlapping streams", "roulette bias", "zero-thickness or clear top layer", "μa = 0 in a semi-infinite medium",
    "diffusion at low albedo", "diffusion near the source", "scalar against vector truth values",
    "a work-item that never ends", "mixed absorption at high μa", "quadrature drift in adding-doubling",
    "half-float tails below 6e-5", "out-of-gamut RGB",
}  # fmt: skip


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_law_holds(law):
    """By the same measure as `lutgen stability`; a NaN holds no law."""
    measured = law.measure()
    assert measured <= law.allowed, f"{law.failure}: {law.measured} = {measured:g}, allowed {law.allowed:g}"


def test_every_known_failure_has_a_law():
    assert sorted(law.failure for law in LAWS) == sorted(KNOWN)
    assert len({law.name for law in LAWS}) == len(LAWS)


def test_a_broken_law_is_named(tmp_path, monkeypatch):
    pytest.importorskip("matplotlib")
    measured = 2e-6, 1.0, float("nan"), 1e-7
    laws = [
        replace(law, measure=lambda v=v: v) for law, v in zip((LAWS[0], LAWS[3], *LAWS[1:3]), measured, strict=True)
    ]
    monkeypatch.setattr(failures, "LAWS", laws)
    words = failures.table(tmp_path, lambda stage, tally: None)
    assert f"beyond their limit: {', '.join(law.failure for law in laws[:3])};" in words
    rows = rows_of(tmp_path, "failures")
    assert [(row["failure"], row["law"]) for row in rows] == [(law.failure, law.name) for law in laws]
    assert [float(row["used"]) for row in rows[:2]] == [2, float("inf")]
