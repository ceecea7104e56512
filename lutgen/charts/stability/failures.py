"""The table of known failures: each with the law that guards against it and how much of what it allows is used."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from lutgen.charts import drawing
from lutgen.charts.drawing import GRAY, HUES, INK, inches
from lutgen.charts.stability.laws import LAWS


@dataclass(frozen=True)
class Row:
    """One failure: the law against it, what was measured now, the most that is allowed, and what it is."""

    failure: str
    law: str
    measured: float
    allowed: float
    what: str

    @property
    def used(self) -> float:
        """Measured over allowed: 1 is the limit, and anything where none is allowed is beyond it."""
        return self.measured / self.allowed if self.allowed else (float("inf") if self.measured else 0.0)


def rows() -> list[Row]:
    """Every law measured now, with fixed seeds."""
    return [Row(law.failure, law.name, law.measure(), law.allowed, law.measured) for law in LAWS]


def table(folder: Path, progress: Callable) -> str:
    """Draw `failures`: failure, law, what was measured, and how much of what is allowed it used."""
    progress("failures", None)
    measured = rows()
    draw(folder, measured)
    beyond = [row.failure for row in measured if not row.used <= 1]
    closest = max(measured, key=lambda row: row.used)
    words = f"beyond their limit: {', '.join(beyond)}" if beyond else "none beyond its limit"
    return f"{len(measured)} known failures, {words}; nearest: {closest.failure}, {closest.used:.0%} of what is allowed"


def draw(folder: Path, measured: list[Row]) -> None:
    """One line per failure: words at the left, measured over allowed at the right."""
    size = 13.6, 2.1 + 0.36 * len(measured)
    notes = (
        "Measured now, seeds fixed. What is counted in σ is chance: any value below its limit is as good as 0. "
        "Left of the axis: exactly 0, none allowed."
    )
    rows = [asdict(row) | {"used": row.used} for row in measured]
    title = "Known failures: how much of what is allowed each uses"
    with drawing.figure(folder, "failures", rows, size, title, notes) as drawn:
        axes = inches(drawn, 9.2, 1.05, 3.2, 0.36 * len(measured))
        axes.set(xscale="log", xlim=(1e-6, 3), ylim=(len(measured) - 0.5, -0.5), xlabel="measured / allowed")
        axes.set_xticks([1e-6, 1e-4, 1e-2, 1], ["1e-6", "1e-4", "0.01", "limit"])
        axes.axvline(1, color=HUES[1], linewidth=1.2)
        axes.set_yticks([])
        axes.grid(axis="x")
        for i, row in enumerate(measured):
            place = {"transform": axes.get_yaxis_transform(), "va": "center", "clip_on": False}
            used = min(max(row.used, 1e-6), 3)
            axes.plot(used, i, "o" if row.used else "s", color=HUES[0] if row.used <= 1 else HUES[1], clip_on=False,
                      markersize=6, markerfacecolor=None if row.used else "white")  # fmt: skip
            value = f"{row.measured:.2g} of {row.allowed:g}" if row.allowed else f"{row.measured:g}"
            axes.text(1.04, i, value, size=8.5, color=INK, **place)
            axes.text(-2.82, i - 0.16, row.failure, size=9.5, color=INK, **place)
            axes.text(-2.82, i + 0.2, row.law, size=7, color=GRAY, **place)
            axes.text(-1.32, i - 0.16, row.what, size=8.5, color=GRAY, **place)
