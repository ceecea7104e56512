"""Where light that enters flat skin leaves it: exits traced once without absorption, drawn by cells by the renderer.

Cells are rings of radius times sectors of azimuth from the plane of incidence, at several entry angles. All wavelengths
share the cell that is drawn, so one place on the head serves the whole spectrum; each then takes paths (in epidermis
and in dermis) out of the cell by itself. Radius and azimuth are drawn evenly within the cell (radius in its logarithm,
in the first ring by area), so sums over cells are exact and places are right to a ring's width.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lutgen import device as ocl
from lutgen.errors import MachineError
from lutgen.solvers import path_table, profiles
from lutgen.solvers.paths import PHOTONS
from lutgen.tables import bake, expand
from lutgen.tables.lut_set import LutSet

RINGS, SECTORS, ANGLES = 96, 6, 5
QUANTILES = 64
"""Records of a cell that the device keeps of each wavelength: the middles of as many parts of equal number, sorted by
length. All wavelengths of one part lie together: whole banks cost 1.6 times a picture's time, in cache misses."""
EXITS = 131_072
"""Photons per wavelength and entry angle."""
_DEFENSIVE = 0.1
"""Share of cells drawn by where white light leaves, so that no texel's skin meets a cell that is never drawn."""


@dataclass(frozen=True)
class Exits:
    """Cells in order of ring, then sector; A entry angles, C cells, K wavelengths.

    `cosines` [A]: of entry inside the skin, ascending. `radius_edges_mm` [rings + 1]. `drawn` [A, C]: probability of a
    cell. `energy` [A, C, K]: share of the light that entered. `first`, `count` [A, C, K]: its records; `records`
    [N, 2]: path in epidermis and dermis, mm, shortest first within a cell. `events`, `photons`: what the trace did.
    """

    cosines: np.ndarray
    radius_edges_mm: np.ndarray
    drawn: np.ndarray
    energy: np.ndarray
    first: np.ndarray
    count: np.ndarray
    records: np.ndarray
    photons: int
    events: int

    def color(self, luts: LutSet, skin: tuple[float, float, float], angle: int = -1) -> tuple[np.ndarray, np.ndarray]:
        """ACEScg color [3] of a skin from these exits at an entry angle (-1: along the normal), and its standard error.

        The entry transmission is in it, as in the LUT's colors.
        """
        mean, second = (self._spectrum(luts, skin, angle, power) for power in (1, 2))
        entry = luts.paths.entry
        sigma = entry * np.sqrt(np.maximum(second - mean**2, 0) / self.photons)
        return entry * mean @ luts.weights, np.sqrt(sigma**2 @ luts.weights**2)

    def rings(self, luts: LutSet, skin: tuple[float, float, float], angle: int = -1) -> tuple[np.ndarray, np.ndarray]:
        """ACEScg energy [rings, 3] of a skin per ring, and its standard error."""
        shape = (len(self.radius_edges_mm) - 1, SECTORS, -1)
        mean, second = (
            self._cells(luts, skin, angle, power).reshape(shape).sum(axis=1) for power in (1, 2)
        )  # fmt: skip
        sigma = luts.paths.entry * np.sqrt(np.maximum(second - mean**2, 0) / self.photons)
        return luts.paths.entry * mean @ luts.weights, np.sqrt(sigma**2 @ luts.weights**2)

    def _spectrum(self, luts: LutSet, skin: tuple[float, float, float], angle: int, power: int) -> np.ndarray:
        return self._cells(luts, skin, angle, power).sum(axis=0)

    def _cells(self, luts: LutSet, skin: tuple[float, float, float], angle: int, power: int) -> np.ndarray:
        """Mean of the weights' power [C, K] over all photons of an entry angle."""
        mu = expand.coefficients(luts.paths.wavelength_nm, luts.absorbers, *(np.array([v]) for v in skin))
        rates = np.stack([m[:, 0] for m in mu], axis=1) - luts.paths.nu_per_mm[:, None]
        _, C, K = self.first.shape
        out = np.zeros((C, K))
        for k in range(K):
            counts, start = self.count[angle, :, k], int(self.first[angle, 0, k])
            paths = self.records[start : start + int(counts.sum())].astype(float)
            weight = np.exp(-power * paths @ rates[k])
            out[:, k] = np.bincount(np.repeat(np.arange(len(counts)), counts), weight, len(counts))
        return out / self.photons


def entry_cosines(n: float, angles: int = ANGLES) -> np.ndarray:
    """Cosines inside the skin [angles] from grazing light to light along the normal."""
    return np.linspace(np.sqrt(1 - 1 / n**2), 1.0, angles)


def trace(
    device: ocl.Device, luts: LutSet, skin: tuple[float, float, float], photons: int = EXITS, seed: int = 0,
    angles: int = ANGLES, edges: np.ndarray | None = None,
) -> Exits:  # fmt: skip
    """Trace the exits of a set's skin; cells are drawn by how much they matter to `skin` (chromophores).

    Deterministic: the seed and the entry angle key the random streams.
    """
    medium, _ = bake.skin_medium(luts.tissue, luts.paths.wavelength_nm)
    edges = profiles.ring_edges(RINGS, last_mm=60.0) if edges is None else edges
    cosines = entry_cosines(medium.n, angles)
    tally = path_table.Tally()
    K, C = len(luts.weights), (len(edges) - 1) * SECTORS
    first, count, found, base = np.zeros((angles, C, K), "u4"), np.zeros((angles, C, K), "u4"), [], 0
    for a, cosine in enumerate(cosines):
        rows = [[] for _ in range(K)]
        for k, part in path_table.records(
            medium, photons, (seed * angles + a) % 2**32, device, tally, cosine=float(cosine)
        ):
            rows[k].append(part.copy())
        for k in range(K):
            paths, counts = _sorted(np.concatenate(rows[k]), edges)
            first[a, :, k] = base + np.cumsum(counts) - counts
            count[a, :, k] = counts
            base += len(paths)
            found.append(paths)
    if base > PHOTONS[1]:
        raise MachineError(f"exits: {base} records are more than 32 bits count; ask for fewer photons")
    made = Exits(
        cosines, edges, np.zeros(0), count / photons, first, count, np.concatenate(found), photons, tally.events
    )
    return _with_importance(made, luts, skin)


def _sorted(rows: np.ndarray, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Paths in epidermis and dermis [N, 2] by cell, the shortest first, and how many each cell has [C].

    Sorted by length, because wavelengths draw theirs with one random number: then they agree about near and far, and
    noise is gray rather than colored.
    """
    rows = rows[np.argsort(rows[:, 1])]
    radius, path, epidermis, cosine = rows.T
    ring = np.clip(np.searchsorted(edges, radius, side="right") - 1, 0, len(edges) - 2)
    sector = np.minimum(np.arccos(np.clip(cosine, -1, 1)) * (SECTORS / np.pi), SECTORS - 1)
    cell = (ring * SECTORS + sector.astype(int)).astype("u2")
    order = np.argsort(cell, kind="stable")
    paths = np.stack([epidermis, np.maximum(path - epidermis, 0)], axis=1)[order]
    return paths.astype("f4"), np.bincount(cell, minlength=(len(edges) - 1) * SECTORS)


def _with_importance(made: Exits, luts: LutSet, skin: tuple[float, float, float]) -> Exits:
    """The same exits, cells drawn in proportion to the light of all channels that a skin sends back through them."""
    strength = np.abs(luts.weights).sum(axis=1)
    drawn = []
    for a in range(len(made.cosines)):
        matters, white = made._cells(luts, skin, a, 1) @ strength, made.energy[a] @ strength
        share = (1 - _DEFENSIVE) * matters / matters.sum() + _DEFENSIVE * white / white.sum()
        drawn.append(share / share.sum())
    return replace(made, drawn=np.array(drawn))


def buffers(device: ocl.Device, exits: Exits) -> tuple:
    """Device buffers of the tables of kernels/render/exits.cl, in the order of EXITS."""
    summed = np.cumsum(exits.drawn, axis=1)
    summed /= summed[:, -1:]
    share = exits.energy / np.maximum(exits.drawn[..., None], 1e-30)
    part = (np.arange(QUANTILES) + 0.5) / QUANTILES
    chosen = exits.first[:, :, None] + (part[:, None] * exits.count[:, :, None]).astype("u4")  # [A, C, quantiles, K]
    paths = exits.records[np.minimum(chosen, len(exits.records) - 1)]
    arrays = (
        exits.radius_edges_mm.astype("f4"), summed.astype("f4"), share.astype("f4"),
        np.minimum(paths, 6e4).astype("f2"),
    )  # fmt: skip
    return tuple(ocl.buffer(device, values) for values in arrays)
