"""Least squares within bounds by damped Gauss-Newton steps (Levenberg 1944; Marquardt 1963); NumPy only."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

Residual = Callable[[np.ndarray], np.ndarray]
"""Points [B, P] to residuals [B, M]."""
_STEPS, _DIFFERENCE, _SMALL = 100, 1e-4, 1e-9


def minimize(residual: Residual, start: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Point [P] in the box [low, high] where the squared residual is least near `start`.

    >>> minimize(lambda x: x - [3.0, 0.5], np.array([0.2, 0.2]), np.zeros(2), np.ones(2)).round(9).tolist()
    [1.0, 0.5]
    """
    at, damping = start, 1e-3
    left, slope = linearized(residual, at, low, high)
    for _ in range(_STEPS):
        downhill = -slope.T @ left
        free = ~(((at <= low) & (downhill < 0)) | ((at >= high) & (downhill > 0)))
        if not free.any():
            break
        normal = slope[:, free].T @ slope[:, free]
        normal += np.diag(damping * np.diag(normal) + 1e-30)
        new = at.copy()
        new[free] = np.clip(at[free] + np.linalg.solve(normal, downhill[free]), low[free], high[free])
        moved = np.abs((new - at) / (high - low)).max()
        tried = residual(new[None])[0]
        if tried @ tried < left @ left:
            at, damping = new, damping / 10
            left, slope = linearized(residual, at, low, high)
        else:
            damping *= 8
        if moved < _SMALL:
            break
    return at


def linearized(residual: Residual, at: np.ndarray, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Residual [M] at a point [P] and its Jacobian [M, P] by central differences that stay within the box.

    >>> linearized(lambda x: x**2, np.array([3.0]), np.array([0.0]), np.array([5.0]))[1].round(6).tolist()
    [[6.0]]
    """
    step = np.diag(_DIFFERENCE * (high - low))
    above, below = np.minimum(at + step, high), np.maximum(at - step, low)
    values = residual(np.concatenate([at[None], above, below]))
    up, down = values[1 : len(at) + 1], values[len(at) + 1 :]
    return values[0], ((up - down) / np.diag(above - below)[:, None]).T
