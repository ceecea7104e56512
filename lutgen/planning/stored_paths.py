"""Paths traced once, by make_stored_paths.py, from which the error of any bake of the default skin is worked out.

At ten Chebyshev wavelengths, each covering all absorptions from 380 to 780 nm: scattering is smooth in wavelength, so
they give the paths at any wavelength. Differences between two readings of these paths have no noise of their own.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from importlib.resources import as_file, files

import numpy as np

from lutgen.files import exr
from lutgen.solvers import profiles
from lutgen.solvers.paths import PathTable, chebyshev, interpolation_matrix
from lutgen.tables import wavelengths
from lutgen.tables.expand import rgb_weights

RINGS, FIRST_MM, LAST_MM = 64, 5e-4, 30.0
TRUTH = "5nm"


def edges() -> np.ndarray:
    """Ring edges of the stored paths, mm.

    >>> edges()[[0, 1, -1]].tolist()
    [0.0, 0.0005, 30.0]
    """
    return profiles.ring_edges(RINGS, FIRST_MM, LAST_MM)


def part(paths: PathTable, attributes: dict) -> exr.Part:
    """The stored form of a path table whose wavelengths share nodes: half floats, a row per wavelength and ring."""
    K, B, E, D = paths.energy.shape
    facts = {
        "wavelength_nm": paths.wavelength_nm.tolist(), "nu_per_mm": paths.nu_per_mm.tolist(),
        "mu_epidermis": paths.mu_epidermis[0].tolist(), "mu_dermis": paths.mu_dermis[0].tolist(),
        "photons": paths.photons, "entry": paths.entry,
    }  # fmt: skip
    return exr.Part("paths", {"Y": paths.energy.reshape(K * B, E * D).astype("f2")}, attributes | facts)


@cache
def paths() -> PathTable:
    """The stored paths."""
    with as_file(files("lutgen.planning") / "plan.exr") as path:
        stored = exr.read(path)["paths"]
    facts = stored.attributes
    K = len(facts["wavelength_nm"])
    mu_e, mu_d = (np.tile(np.array(facts[key]), (K, 1)) for key in ("mu_epidermis", "mu_dermis"))
    energy = stored.channels["Y"].astype(float).reshape(K, RINGS, mu_e.shape[1], mu_d.shape[1])
    return PathTable(
        np.array(facts["wavelength_nm"]), np.array(facts["nu_per_mm"]), edges(), mu_e, mu_d, energy,
        facts["photons"], facts["entry"],
    )  # fmt: skip


def at_rule(traced: PathTable, rule: str) -> tuple[PathTable, np.ndarray]:
    """Paths at a rule's wavelengths and their ACEScg weights [K, 3], from paths at wavelengths that share nodes."""
    chosen = wavelengths.load(rule)
    nm = chosen.wavelength_nm
    shared = traced.nu_per_mm, traced.mu_epidermis, traced.mu_dermis
    nu, mu_e, mu_d = (np.repeat(values[:1], len(nm), axis=0) for values in shared)
    energy = np.tensordot(interpolation_matrix(traced.wavelength_nm, nm), traced.energy, axes=1)
    table = replace(traced, wavelength_nm=nm, nu_per_mm=nu, mu_epidermis=mu_e, mu_dermis=mu_d, energy=energy)
    return table, rgb_weights(chosen.xyz_weights)


@cache
def stored(rule: str) -> tuple[PathTable, np.ndarray]:
    """The stored paths at a rule's wavelengths, and their ACEScg weights [K, 3]."""
    return at_rule(paths(), rule)


def within(radius_edges_mm: np.ndarray, radius_mm: np.ndarray) -> np.ndarray:
    """Matrix [R, B + 1]: encircled energy at radii from that at ring edges, cubic in the logarithm of the radius.

    Below the second edge it is linear in the radius.
    """
    known = np.log(radius_edges_mm[1:])
    matrix = np.zeros((len(radius_mm), len(radius_edges_mm)))
    for row, radius in zip(matrix, radius_mm, strict=True):
        if radius < radius_edges_mm[1]:
            row[1] = radius / radius_edges_mm[1]
            continue
        first = int(np.clip(np.searchsorted(known, np.log(radius)) - 2, 0, len(known) - 4))
        four = known[first : first + 4]
        for k in range(4):
            others = np.delete(four, k)
            row[1 + first + k] = np.prod((np.log(radius) - others) / (four[k] - others))
    return matrix


def in_rings(radius_mm: np.ndarray, rings: int) -> np.ndarray:
    """Matrix [R, RINGS + 1]: encircled energy at radii as a LUT of that many rings tells it, linear within each."""
    coarse = np.minimum(profiles.ring_edges(rings), edges()[-1])
    at_edges = within(edges(), coarse)
    ring = np.clip(np.searchsorted(coarse, radius_mm, side="right") - 1, 0, rings - 1)
    along = ((radius_mm - coarse[ring]) / np.diff(coarse)[ring])[:, None]
    return (1 - along) * at_edges[ring] + along * at_edges[ring + 1]


def noise(
    table: PathTable, nu_per_mm: np.ndarray, spans: tuple[np.ndarray, np.ndarray], draws: int, seed: int, count: int = 5
) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]:
    """Noise [draws, K, B, count, count] of encircled energy (not normalized, totals anchored) at one photon traced.

    `spans`: least and greatest absorption [2, K] of epidermis and dermis; also returned: the cube roots [K, count] of
    the Chebyshev nodes where the noise is given. Weights w1, w2 of one path at two absorptions multiply to the weight
    at mu1 + mu2 - nu, so the table holds every covariance; paths that leave in different rings are independent but
    for the fixed number of photons, which anchoring takes out.
    """
    roots = [chebyshev(np.cbrt(low), np.cbrt(high), count) for low, high in spans]
    flat = np.repeat(roots[0], count, axis=1) ** 3, np.tile(roots[1], (1, count)) ** 3
    nu, A = nu_per_mm[:, None, None], count * count
    both_e, both_d = ((mu[:, :, None] + mu[:, None, :] - nu).reshape(len(nu_per_mm), -1) for mu in flat)
    covariance = table.evaluate(both_e, both_d).reshape(*table.energy.shape[:2], A, A) * table.entry
    values, vectors = np.linalg.eigh(covariance)
    root = vectors * np.sqrt(np.maximum(values, 0))[..., None, :]
    drawn = np.random.default_rng(seed).standard_normal((draws, *root.shape[:3]))
    energy = np.einsum("kbij,skbj->skbi", root, drawn, optimize=True)
    mean = table.evaluate(*flat)
    energy -= mean / mean.sum(axis=1, keepdims=True) * energy.sum(axis=2, keepdims=True)
    return np.cumsum(energy, axis=2).reshape(*energy.shape[:3], count, count), (roots[0], roots[1])
