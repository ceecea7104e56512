"""Least squares within bounds by damped Gauss-Newton steps (Levenberg 1944; Marquardt 1963), and how sure they are.

NumPy only.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

Residual = Callable[[np.ndarray], np.ndarray]
"""Points [B, P] to residuals [B, M]."""
_STEPS, _DIFFERENCE, _SMALL = 100, 1e-4, 1e-9
_FEW = 10
"""Degrees of freedom under which all residuals share one variance: their own would be too noisy."""
_MOST_ALIKE = 0.9


def minimize(residual: Residual, start: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Point [P] in the box [low, high] where the squared residual is least near `start`.

    >>> minimize(lambda x: x - [3.0, 0.5], np.array([0.2, 0.2]), np.zeros(2), np.ones(2)).round(9).tolist()
    [1.0, 0.5]
    """
    point, damping = start, 1e-3
    left, slope = linearized(residual, point, low, high)
    for _ in range(_STEPS):
        downhill = -slope.T @ left
        free = ~(((point <= low) & (downhill < 0)) | ((point >= high) & (downhill > 0)))
        if not free.any():
            break
        normal = slope[:, free].T @ slope[:, free]
        normal += np.diag(damping * np.diag(normal) + 1e-30)
        new = point.copy()
        new[free] = np.clip(point[free] + np.linalg.solve(normal, downhill[free]), low[free], high[free])
        moved = np.abs((new - point) / (high - low)).max()
        tried = residual(new[None])[0]
        if tried @ tried < left @ left:
            point, damping = new, damping / 10
            left, slope = linearized(residual, point, low, high)
        else:
            damping *= 8
        if moved < _SMALL:
            break
    return point


def linearized(
    residual: Residual, point: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Residual [M] at a point [P] and its Jacobian [M, P] by central differences that stay within the box.

    >>> linearized(lambda x: x**2, np.array([3.0]), np.array([0.0]), np.array([5.0]))[1].round(6).tolist()
    [[6.0]]
    """
    step = np.diag(_DIFFERENCE * (high - low))
    above, below = np.minimum(point + step, high), np.maximum(point - step, low)
    values = residual(np.concatenate([point[None], above, below]))
    up, down = values[1 : len(point) + 1], values[len(point) + 1 :]
    return values[0], ((up - down) / np.diag(above - below)[:, None]).T


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
