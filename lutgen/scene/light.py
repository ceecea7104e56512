"""Light of a scene: sun, studio and pictures of the surroundings, and their irradiance."""

from __future__ import annotations

import numpy as np

STUDIO = (  # direction, sharpness, color times strength
    ((-0.55, 0.60, 0.58), 14.0, (3.00, 2.90, 2.75)),
    ((0.90, 0.20, 0.40), 10.0, (0.78, 0.80, 0.82)),
    ((0.62, 0.30, -0.72), 28.0, (3.20, 3.10, 3.00)),
)
"""Soft boxes: exp(sharpness (cos - 1)) lobes, linear ACEScg."""
SUN = np.array([1.0, 0.965, 0.9])
"""Color of the directional light, linear ACEScg."""
_GROUND, _SKY = np.array([0.088, 0.083, 0.080]), np.array([0.29, 0.31, 0.335])


def studio(directions: np.ndarray) -> np.ndarray:
    """Radiance [N, 3] of the studio from unit directions [N, 3]; the viewer's shaders have the same."""
    t = np.clip((directions[:, 1] + 0.6) / 1.5, 0, 1)
    s = (t * t * (3 - 2 * t))[:, None]
    light = _GROUND * (1 - s) + _SKY * s
    for way, sharpness, color in STUDIO:
        toward = np.array(way) / np.linalg.norm(way)
        light = light + np.array(color) * np.exp(sharpness * (directions @ toward - 1))[:, None]
    return light


def fibonacci(count: int) -> np.ndarray:
    """Unit directions [count, 3], evenly spread."""
    i = np.arange(count) + 0.5
    y, turn = 1 - 2 * i / count, i * 2.39996323
    r = np.sqrt(1 - y * y)
    return np.stack([r * np.cos(turn), y, r * np.sin(turn)], axis=1)


def irradiance_sh(directions: np.ndarray, radiance: np.ndarray, angles: np.ndarray | None = None) -> np.ndarray:
    """Cosine-convolved harmonics [9, 3] of radiance [N, 3] (Ramamoorthi & Hanrahan 2001).

    `angles` [N]: solid angle of each direction; without it they are evenly spread.
    """
    angles = np.full(len(directions), 4 * np.pi / len(directions)) if angles is None else angles
    x, y, z = directions.T
    basis = np.stack([
        0.282095 + 0 * x, 0.488603 * y, 0.488603 * z, 0.488603 * x, 1.092548 * x * y, 1.092548 * y * z,
        0.315392 * (3 * z * z - 1), 1.092548 * x * z, 0.546274 * (x * x - y * y),
    ])  # fmt: skip
    bands = np.array([np.pi] + [2 * np.pi / 3] * 3 + [np.pi / 4] * 5)
    return bands[:, None] * ((basis * angles) @ radiance)


def studio_irradiance() -> np.ndarray:
    """Cosine-convolved harmonics [9, 3] of the studio."""
    directions = fibonacci(4096)
    return irradiance_sh(directions, studio(directions))


def studio_mean() -> float:
    """Mean radiance of the studio over all directions and channels."""
    return float(studio(fibonacci(4096)).mean())
