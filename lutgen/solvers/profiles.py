"""What solvers return: shares of light, and radial profiles of where light that enters at a point comes out again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lutgen.errors import summary

COMPARED_FROM_MM = 0.01
"""Profiles are compared from this radius on: what leaves nearer looks like a surface reflection."""


@dataclass(frozen=True)
class Reflectance:
    """Shares of light that fell along the normal: diffuse, specular, transmitted; std_error is the diffuse share's.

    >>> Reflectance(diffuse=0.29, specular=0.0278).transmitted
    0.0
    """

    diffuse: float
    specular: float
    transmitted: float = 0.0
    std_error: float = 0.0


def ring_edges(rings: int = 64, first_mm: float = 1e-4, last_mm: float = 30.0) -> np.ndarray:
    """Ring edges in mm: a disc of 0.1 um (a dark skin's blue r10 is 1 um), rings even in logarithm around it to 30 mm.

    >>> ring_edges()[[0, 1, -1]].tolist()
    [0.0, 0.0001, 30.0]
    """
    edges = np.concatenate([[0.0], np.geomspace(first_mm, last_mm, rings)])
    edges[1], edges[-1] = first_mm, last_mm
    return edges


def encircled(energy: np.ndarray) -> np.ndarray:
    """Share of the energy [..., B] within each ring edge [..., B + 1], from 0 to 1 (0 throughout if there is none).

    >>> encircled(np.array([1.0, 3.0])).tolist()
    [0.0, 0.25, 1.0]
    """
    summed = np.cumsum(np.concatenate([np.zeros_like(energy[..., :1]), energy], axis=-1), axis=-1)
    return summed / np.where(summed[..., -1:] > 0, summed[..., -1:], 1)


def ee_difference(energy_1: np.ndarray, energy_2: np.ndarray, radius_edges_mm: np.ndarray) -> np.ndarray:
    """Largest difference of encircled energy [...] of two profiles [..., B] over radii of 0.01 mm and more.

    >>> ee_difference(np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), np.array([0, 0.1, 0.2, 0.3])).item()
    1.0
    """
    far = radius_edges_mm >= COMPARED_FROM_MM
    return np.abs(encircled(energy_1) - encircled(energy_2))[..., far].max(axis=-1)


@dataclass(frozen=True)
class Profile:
    """Share of incident light that leaves in each ring [B], or per color channel [B, 3], with its standard error.

    >>> profile = Profile(np.array([0.0, 1.0, 2.0]), np.array([0.1, 0.3]), np.zeros(2))
    >>> float(profile.total), profile.encircled().tolist()
    (0.4, [0.0, 0.25, 1.0])
    """

    radius_edges_mm: np.ndarray
    energy: np.ndarray
    std_error: np.ndarray

    __repr__ = summary

    @property
    def total(self) -> np.ndarray:
        """Diffuse reflectance: the sum over rings, a scalar or [3]."""
        return self.energy.sum(axis=0)

    def encircled(self) -> np.ndarray:
        """Normalized encircled energy at each edge, [B + 1] or [B + 1, 3]."""
        return np.moveaxis(encircled(np.moveaxis(self.energy, 0, -1)), -1, 0)

    def radius_mm(self, share: float) -> np.ndarray:
        """Radius in mm within which that share of the light leaves, a scalar or [3]; linear within a ring."""
        columns = self.encircled().reshape(len(self.radius_edges_mm), -1).T
        return np.array([np.interp(share, p, self.radius_edges_mm) for p in columns]).reshape(self.energy.shape[1:])


def even_quantiles(count: int = 64) -> np.ndarray:
    """Quantiles [count], each in the middle of an equal share.

    >>> even_quantiles(4).tolist()
    [0.125, 0.375, 0.625, 0.875]
    """
    return (np.arange(count) + 0.5) / count


def taps(shapes: np.ndarray, radius_edges_mm: np.ndarray, quantiles: np.ndarray | None = None) -> np.ndarray:
    """What a gather samples, [N, Q, 4], of normalized profiles [N, B, 3]: radius in mm and P_R, P_G, P_B there.

    Radii are `quantiles` [Q] of the node's widest channel (largest r90), or the 64 of `even_quantiles`; P is encircled
    energy. Each ring spreads its energy evenly in radius.
    """
    P = np.moveaxis(encircled(np.moveaxis(shapes, 1, -1)), 1, -1)  # [N, B + 1, 3]
    r90 = inverse(P.transpose(0, 2, 1), radius_edges_mm, np.array([0.9]))[..., 0]
    widest = np.take_along_axis(P, r90.argmax(axis=1)[:, None, None], axis=2)[:, :, 0]
    radius = inverse(widest, radius_edges_mm, even_quantiles() if quantiles is None else quantiles)
    ring = np.clip(np.searchsorted(radius_edges_mm, radius, side="right") - 1, 0, len(radius_edges_mm) - 2)
    along = (radius - radius_edges_mm[ring]) / np.diff(radius_edges_mm)[ring]
    low, high = (np.take_along_axis(P, (ring + i)[..., None], axis=1) for i in (0, 1))
    return np.concatenate([radius[..., None], low + along[..., None] * (high - low)], axis=-1)


def inverse(P: np.ndarray, radius_edges_mm: np.ndarray, shares: np.ndarray) -> np.ndarray:
    """Radii [..., S] at which encircled energies P [..., B + 1] reach the shares [S]."""
    above = (P[..., None, :] < shares[:, None]).sum(axis=-1)  # first edge at or above the share
    above = np.clip(above, 1, P.shape[-1] - 1)
    low, high = (np.take_along_axis(P, above - i, axis=-1) for i in (1, 0))
    step = np.where(high > low, high - low, 1)
    along = np.clip((shares - low) / step, 0, 1)
    return radius_edges_mm[above - 1] + along * (radius_edges_mm[above] - radius_edges_mm[above - 1])
