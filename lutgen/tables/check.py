"""What `lutgen check` verifies of a LUT set on disk."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lutgen import color
from lutgen.errors import InputError
from lutgen.solvers import exact_totals
from lutgen.tables import expand, storage
from lutgen.tables.lut_set import LutSet

NODES = 100
SIGMAS = 5.0
"""A node's channel may miss by this many standard errors: among 300, chance exceeds 5 once in six thousand sets."""
SOLVER_TOLERANCE = 3e-5
"""Twice what the exact totals (1e-5) and the path table between its nodes (5e-6) were measured to err by."""


@dataclass(frozen=True)
class Finding:
    """One verified law: its name, whether it holds, and the figure that says so."""

    name: str
    passed: bool
    detail: str


def check(folder: Path) -> list[Finding]:
    """Load a set (InputError where files, hashes, axes or shapes are wrong) and verify its laws."""
    luts = storage.load(folder)
    color, shape = luts.color_lut.acescg, luts.profile_lut.shape
    off = float(np.abs(shape.sum(axis=-2) - 1).max())
    findings = [
        _preview(folder, luts),
        _finite("color", color),
        _finite("profile", shape),
        _finite("paths", luts.paths.energy),
        Finding("profile sums", bool(off < 1e-5), f"shapes sum to 1 within {off:.1e}"),
        Finding("clamped share", bool(luts.profile_lut.clamped_share.max() <= 0.01),
                f"at most {luts.profile_lut.clamped_share.max():.2e} of a channel's energy (1 % allowed)"),
        _expanded(luts),
        _monotone(luts),
        _nodes(luts),
    ]  # fmt: skip
    return findings


def _preview(folder: Path, luts: LutSet) -> Finding:
    try:
        storage.verify(folder, "preview.png", luts.manifest)
    except InputError as error:
        return Finding("files", False, str(error))
    return Finding("files", True, "SHA-256 as in manifest.json")


def _expanded(luts: LutSet) -> Finding:
    """Color and profile must be what the stored paths expand to."""
    again = luts.expand()
    color = float(np.abs(again.color_lut.acescg - luts.color_lut.acescg).max())
    shape = float(np.abs(again.profile_lut.shape - luts.profile_lut.shape).max())
    return Finding(
        "expansion", max(color, shape) < 1e-5, f"stored paths give color within {color:.1e}, shape {shape:.1e}"
    )


def _finite(name: str, values: np.ndarray) -> Finding:
    wrong = int((~np.isfinite(values)).sum())
    low = float(np.nanmin(values))
    return Finding(f"{name} values", wrong == 0, f"{wrong} of {values.size} not finite, least {low:.3g}")


def _monotone(luts: LutSet) -> Finding:
    if luts.color_lut.grid.melanin.count == 1:
        return Finding("monotone in melanin", True, "melanin is fixed")
    rises = np.diff(luts.color_lut.acescg @ color.XYZ_FROM_ACESCG[1], axis=2)
    return Finding("monotone in melanin", bool(rises.max() < 0), f"luminance changes by {rises.max():.2e} at most")


def _nodes(luts: LutSet) -> Finding:
    """Random nodes against adding-doubling at the set's own wavelengths."""
    cells = [v.ravel() for v in luts.color_lut.grid.nodes()]
    pick = np.random.default_rng(0).choice(len(cells[0]), min(NODES, len(cells[0])), replace=False)
    melanin, eumelanin, hemoglobin = (v[pick] for v in cells)
    nm = luts.paths.wavelength_nm
    mu = expand.coefficients(nm, luts.absorbers, melanin, eumelanin, hemoglobin)
    exact = exact_totals.exact_totals(luts.tissue)(nm, *mu)
    allowed = SIGMAS * luts.color_std_error(melanin, eumelanin, hemoglobin) + SOLVER_TOLERANCE
    miss = np.abs(luts.color_lut.acescg.reshape(-1, 3)[pick] - exact.T @ luts.weights)
    worst = float((miss / allowed).max())
    return Finding(
        "nodes", worst <= 1,
        f"{len(pick)} random nodes against adding-doubling: worst miss {miss.max():.2e}, "
        f"{worst:.2f} of what {SIGMAS:g} standard errors and {SOLVER_TOLERANCE:g} allow",
    )  # fmt: skip
