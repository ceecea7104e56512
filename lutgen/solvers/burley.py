"""Burley's normalized diffusion, the one-parameter profile that renderers ship, fitted to profiles.

Source: Christensen & Burley 2015, "Approximate reflectance profiles for efficient subsurface scattering", equation 3.
Its density over radius, (exp(-r/d) + exp(-r/3d)) / 4d, integrates to 1 for every d.
"""

from __future__ import annotations

import numpy as np

from lutgen.errors import InputError
from lutgen.solvers.profiles import ee_difference

MEAN_RADIUS = 2.5
"""Mean radius of the shape in units of d."""
_SCAN = 128
_GOLDEN = (np.sqrt(5) - 1) / 2


def encircled(radius_mm: np.ndarray | float, d_mm: np.ndarray | float) -> np.ndarray:
    """Share of the light that leaves within a radius: 1 - exp(-r/d) / 4 - 3 exp(-r/3d) / 4; both in mm, broadcast.

    >>> encircled(np.array([0.0, 1.55, 16.56, np.inf]), 1.0).round(3).tolist()
    [0.0, 0.5, 0.997, 1.0]
    """
    x = np.asarray(radius_mm, float) / np.asarray(d_mm, float)
    return -(np.expm1(-x) + 3 * np.expm1(-x / 3)) / 4


def mean_free_path_mm(d_mm: np.ndarray, albedo: np.ndarray) -> np.ndarray:
    """Mean free path in mm of a medium of surface albedo `albedo` whose searchlight profile is Burley's of length d.

    d (1.85 - A + 7 |A - 0.8|^3); Christensen & Burley 2015, equation 5.

    >>> float(mean_free_path_mm(2.0, 0.8))
    2.1
    """
    albedo = np.asarray(albedo, float)
    return np.asarray(d_mm, float) * (1.85 - albedo + 7 * np.abs(albedo - 0.8) ** 3)


def _columns(profile_energy: np.ndarray, radius_edges_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Energies [channels, B] and finite edges [B + 1], or InputError."""
    energy, edges = np.asarray(profile_energy, float), np.asarray(radius_edges_mm, float)
    if edges.ndim != 1 or len(edges) < 2 or not np.all(np.isfinite(edges)) or not np.all(np.diff(edges) > 0):
        raise InputError("radius_edges_mm: at least two finite ascending radii are needed")
    if energy.ndim not in (1, 2) or len(energy) != len(edges) - 1:
        raise InputError(
            f"profile_energy: shape {energy.shape}; {len(edges) - 1} rings are needed, or rings x channels"
        )
    columns = energy.reshape(len(energy), -1).T
    if not np.all(columns.sum(axis=-1) > 0):
        raise InputError("profile_energy: a channel without energy has no shape to fit")
    return columns, edges


def _difference(energy: np.ndarray, edges: np.ndarray, d_mm: np.ndarray) -> np.ndarray:
    """EE difference [N] of one profile [B] from the shape at each d [N], both normalized within the edges."""
    return ee_difference(np.diff(encircled(edges, d_mm[:, None]), axis=-1), energy[None], edges)


def fit(profile_energy: np.ndarray, radius_edges_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The d in mm with the least EE difference from a profile [B] or [B, 3], and that difference; scalars or [3].

    Seen at one radius the encircled energy falls with d, so its difference from the profile has one valley, and so
    has the largest over all radii: a scan over log d brackets it, golden section narrows it to 1e-9.

    >>> edges = np.geomspace(0.01, 30, 40)
    >>> d, difference = fit(np.diff(encircled(edges, 0.7)), edges)
    >>> round(float(d), 6), float(difference) < 1e-8
    (0.7, True)
    """
    columns, edges = _columns(profile_energy, radius_edges_mm)
    d = np.array([_valley(column, edges) for column in columns])
    differences = np.array([_difference(c, edges, d[i : i + 1])[0] for i, c in enumerate(columns)])
    shape = np.shape(profile_energy)[1:]
    return d.reshape(shape), differences.reshape(shape)


def _valley(energy: np.ndarray, edges: np.ndarray) -> float:
    """The d in mm of least EE difference from one profile [B]."""
    positive = edges[edges > 0]
    scan = np.linspace(np.log(positive[0] / 20), np.log(positive[-1]), _SCAN)
    best = int(_difference(energy, edges, np.exp(scan)).argmin())
    low, high = scan[max(best - 1, 0)], scan[min(best + 1, _SCAN - 1)]
    while high - low > 1e-9:
        inner = np.array([high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)])
        left, right = _difference(energy, edges, np.exp(inner))
        low, high = (low, inner[1]) if left < right else (inner[0], high)
    return float(np.exp((low + high) / 2))


def by_mean_radius(profile_energy: np.ndarray, radius_edges_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The d in mm with the profile's mean radius (2.5 d), and its EE difference; profile [B] or [B, 3].

    Rings spread their energy evenly in radius, as everywhere in this package. Cheaper than `fit` and up to three
    times worse: a few far photons move the mean.

    >>> edges = np.linspace(0, 30, 3001)
    >>> d, difference = by_mean_radius(np.diff(encircled(edges, 0.7)), edges)
    >>> round(float(d), 4)
    0.7
    """
    columns, edges = _columns(profile_energy, radius_edges_mm)
    d = (columns @ (edges[:-1] + edges[1:])) / 2 / columns.sum(axis=-1) / MEAN_RADIUS
    differences = np.array([_difference(c, edges, d[i : i + 1])[0] for i, c in enumerate(columns)])
    shape = np.shape(profile_energy)[1:]
    return d.reshape(shape), differences.reshape(shape)
