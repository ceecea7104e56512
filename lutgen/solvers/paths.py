"""The path table: what one absorption-free trace per wavelength knows about every chromophore; NumPy only.

It holds the Laplace transform of the photons' paths, E[exp(-mu_e L_e - mu_d L_d)] per exit ring, at Chebyshev nodes
in the cube roots of both absorptions, and is evaluated between them by polynomial interpolation. Separable, so a
whole grid is a few matrix products.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lutgen.errors import InputError, summary

PHOTONS = (1, 2**31 - 1)
SEEDS = (0, 2**32 - 1)
"""What the counters of a trace hold: photons per wavelength, and the seed."""
TOLERANCE = 1e-6
"""Relative slack of the covered absorption range, for float rounding."""


def chebyshev(low, high, count: int) -> np.ndarray:
    """Chebyshev nodes of the first kind [..., count] on [low, high], ascending.

    >>> chebyshev(0.0, 1.0, 2).round(4).tolist()
    [0.1464, 0.8536]
    """
    low, high = np.asarray(low, float)[..., None], np.asarray(high, float)[..., None]
    return low + (high - low) * (1 - np.cos(np.pi * (np.arange(count) + 0.5) / count)) / 2


def interpolation_matrix(nodes: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Weights [..., P, N] that carry values at Chebyshev nodes [..., N] to points [..., P] (Berrut & Trefethen 2004).

    >>> nodes = chebyshev(0.0, 2.0, 5)
    >>> round(float(interpolation_matrix(nodes, np.array([1.5]))[0] @ nodes**3), 12)
    3.375
    """
    count = nodes.shape[-1]
    weight = (-1.0) ** np.arange(count) * np.sin(np.pi * (np.arange(count) + 0.5) / count)
    apart = x[..., :, None] - nodes[..., None, :]
    terms = weight / np.where(apart == 0, 1e-300, apart)
    return terms / terms.sum(axis=-1, keepdims=True)


@dataclass(frozen=True)
class PathTable:
    """Paths of light that entered along the normal, by wavelength [K], exit ring [B] and absorption nodes [E], [D].

    `energy` [K, B, E, D]: share of the light that fell on the surface and leaves in that ring when the epidermis
    absorbs mu_epidermis[k, e] and the dermis mu_dermis[k, d] (1/mm). It includes the entry transmission. Absorptions
    under `nu_per_mm` are not covered: re-expanding below it would make weights above 1 and the variance infinite.
    """

    wavelength_nm: np.ndarray
    nu_per_mm: np.ndarray
    radius_edges_mm: np.ndarray
    mu_epidermis: np.ndarray
    mu_dermis: np.ndarray
    energy: np.ndarray
    photons: int
    entry: float

    __repr__ = summary

    def totals(self) -> PathTable:
        """The same table with all rings joined into one."""
        edges = self.radius_edges_mm[[0, -1]]
        return replace(self, radius_edges_mm=edges, energy=self.energy.sum(axis=1, keepdims=True, dtype=float))

    def epidermis_matrix(self, mu: np.ndarray) -> np.ndarray:
        """Interpolation weights [K, P, E] at epidermis absorptions [K, P]; InputError outside the covered range."""
        return self._matrix("epidermis", self.mu_epidermis, mu)

    def dermis_matrix(self, mu: np.ndarray) -> np.ndarray:
        """Interpolation weights [K, P, D] at dermis absorptions [K, P]; InputError outside the covered range."""
        return self._matrix("dermis", self.mu_dermis, mu)

    def _matrix(self, layer: str, nodes: np.ndarray, mu: np.ndarray) -> np.ndarray:
        mu = np.asarray(mu, float)
        low, high = _low_end(nodes)[:, None], _high_end(nodes)[:, None]
        wrong = ~((mu >= low * (1 - TOLERANCE)) & (mu <= high * (1 + TOLERANCE)))
        if np.any(wrong):
            k, p = np.argwhere(wrong)[0]
            raise InputError(
                f"{layer} absorption = {mu[k, p]:.6g} /mm at {self.wavelength_nm[k]:g} nm: the stored paths cover "
                f"{low[k, 0]:.6g} to {high[k, 0]:.6g} /mm; change less, or bake anew"
            )
        return interpolation_matrix(np.cbrt(nodes), np.cbrt(np.clip(mu, low, high)))

    def evaluate(self, mu_epidermis, mu_dermis) -> np.ndarray:
        """Energy [K, B, P] per wavelength and ring for P pairs of absorptions, each [K, P]."""
        to_e, to_d = self.epidermis_matrix(mu_epidermis), self.dermis_matrix(mu_dermis)
        return np.einsum("kpe,kbed,kpd->kbp", to_e, self.energy, to_d, optimize=True)

    def std_error(self, mu_epidermis, mu_dermis) -> np.ndarray:
        """Standard error [K, B, P] of `evaluate`, from the same table read at 2 mu - nu.

        A weight w at mu is sqrt of one at 2 mu - nu, so E[w^2] is in the table. Beyond its end the value at the end
        bounds it from above.
        """
        second = []
        for mu, nodes in ((mu_epidermis, self.mu_epidermis), (mu_dermis, self.mu_dermis)):
            doubled = 2 * np.asarray(mu, float) - self.nu_per_mm[:, None]
            second.append(np.clip(doubled, _low_end(nodes)[:, None], _high_end(nodes)[:, None]))
        mean = np.maximum(self.evaluate(mu_epidermis, mu_dermis), 0)
        square = np.maximum(self.evaluate(*second), 0) * self.entry
        return np.sqrt(np.maximum(square - mean**2, 0) / self.photons)

    def grid(self, mu_epidermis: np.ndarray, mu_dermis: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Color energy [Q, P, B, C] of all P epidermis [K, P] by Q dermis [K, Q] absorptions, weights [K, C].

        Contracts with the dermis first, folds the color weights in, then one product over wavelengths and nodes.
        """
        to_e, to_d = self.epidermis_matrix(mu_epidermis), self.dermis_matrix(mu_dermis)
        K, B, E, D = self.energy.shape
        P, Q, C = to_e.shape[1], to_d.shape[1], weights.shape[1]
        half = self.energy.reshape(K, B * E, D) @ to_d.transpose(0, 2, 1)  # [K, B E, Q]
        half = half.reshape(K, B, E, Q).transpose(0, 2, 3, 1)[..., None] * weights[:, None, None, None]
        left = to_e.transpose(1, 0, 2).reshape(P, K * E)
        return (left @ half.reshape(K * E, Q * B * C)).reshape(P, Q, B, C).transpose(1, 0, 2, 3)

    def anchored(self, exact_totals: np.ndarray) -> PathTable:
        """The table with each node's rings scaled to exact totals [K, E, D]: Monte Carlo shape, no noise in sums."""
        sums = self.energy.sum(axis=1, dtype=float)
        if not np.all(sums > 0):
            raise InputError(f"photons = {self.photons}: too few for anchored totals; ask for more, or for monte-carlo")
        scale = exact_totals / sums
        return replace(self, energy=(self.energy * scale[:, None]).astype(self.energy.dtype))


def _ends(nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The interval whose Chebyshev nodes in the cube root these are."""
    roots = np.cbrt(nodes.astype(float))
    count = nodes.shape[-1]
    half = (roots[..., -1] - roots[..., 0]) / 2 / np.cos(np.pi / 2 / count)
    middle = (roots[..., -1] + roots[..., 0]) / 2
    return (middle - half) ** 3, (middle + half) ** 3


def _low_end(nodes: np.ndarray) -> np.ndarray:
    return _ends(nodes)[0]


def _high_end(nodes: np.ndarray) -> np.ndarray:
    return _ends(nodes)[1]
