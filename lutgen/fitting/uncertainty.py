"""How sure a least-squares fit is: the noise of the data carried through the linearized solution; NumPy only."""

from __future__ import annotations

import numpy as np

_FEW = 10
"""Degrees of freedom under which all residuals share one variance: their own would be too noisy."""
_MOST_ALIKE = 0.9


def covariance(solution: np.ndarray, slope: np.ndarray, off: np.ndarray, noise: float | None) -> tuple:
    """Covariance [P, P] of fitted parameters, and how alike neighboring residuals are (0 if not more than by chance).

    `solution` [P, n]: how the parameters follow the data; `slope` [n, P]: how the model follows the parameters;
    `off` [n]: data less model; `noise`: standard deviation of each datum, or None for what the residual says. Then
    each residual is its own variance (White 1980), scaled to what the fit has absorbed of it. Where neighbors are
    correlated by r, n values count as n (1 - r) / (1 + r) (Bayley & Hammersley 1946).

    >>> ones = np.ones((1, 4))
    >>> covariance(ones / 4, ones.T, np.array([1.0, -1.0, 1.0, -1.0]), 0.2)[0].round(6).tolist()
    [[0.01]]
    """
    count, fitted = slope.shape
    if noise is not None:
        return noise**2 * solution @ solution.T, 0.0
    taken = 2 * (slope * solution.T).sum(axis=1) - ((slope @ (solution @ solution.T)) * slope).sum(axis=1)
    kept = np.maximum(1 - taken, 1e-12)  # variance of a residual, per variance of the data
    variance = off**2 / kept if count - fitted >= _FEW else np.full(count, off @ off / kept.sum())
    plain = off / np.sqrt(kept)
    alike = float(plain[1:] @ plain[:-1] / max(plain @ plain, 1e-300))
    alike = min(alike, _MOST_ALIKE) if alike > 2 / np.sqrt(count) else 0.0
    return (solution * variance) @ solution.T * (1 + alike) / (1 - alike), alike
