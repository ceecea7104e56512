"""Light of a scene: sun, studio and pictures of the surroundings, their irradiance, and the specular's energy."""

from __future__ import annotations

from functools import cache

import numpy as np

REFRACTIVE_INDEX = 1.4
SECOND_LOBE, SECOND_WEIGHT = 0.55, 0.2
"""Roughness of the sharper of both specular lobes relative to the other, and its share."""
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


def fresnel(cosine: np.ndarray) -> np.ndarray:
    """Schlick's reflectance at index 1.4, as the shaders have it."""
    f0 = ((REFRACTIVE_INDEX - 1) / (REFRACTIVE_INDEX + 1)) ** 2
    return np.asarray(f0 + (1 - f0) * (1 - cosine) ** 5)


def exit_mean() -> float:
    """Mean of what a cosine lobe lets out: 2 * integral of (1 - F(c)) c dc, which the exit lobe is divided by."""
    x, w = np.polynomial.legendre.leggauss(64)
    c = (x + 1) / 2
    return float(((1 - fresnel(c)) * c * w).sum())


def exit_means() -> np.ndarray:
    """The same for rough skin, by roughness evenly from 0 to 1 [32]: mean of what one GGX lobe does not reflect."""
    table = ggx_albedo()
    whole, part = table[..., 0], table[..., 1]
    f0 = fresnel(np.ones(1))
    kept = (f0 * (whole - part) + part) * (1 + f0 * (1 / np.maximum(whole, 1e-6) - 1))
    root = np.linspace(0, 1, table.shape[1])
    return np.asarray(np.trapezoid((1 - kept) * 4 * root**3, root, axis=1))


def entry_of_the_sky() -> float:
    """What an even sky enters with, relative to light along the normal."""
    return exit_mean() / float(1 - fresnel(np.ones(1))[0])


@cache
def ggx_albedo(size: int = 64, radial: int = 96, turns: int = 32) -> np.ndarray:
    """Directional albedo [roughness, root of cosine, 2] of one GGX lobe: at F = 1, and weighted with (1 - v.h)^5.

    Height-correlated Smith masking; visible normals (Heitz 2018) on a regular grid, weights G2 / G1 <= 1. Half a turn
    is enough, the other is its mirror image. Radii are dense at the rim, where the facets lean and masking sets in: of
    an even grid, a smooth lobe's whole tail lies in the last cell. Nodes are right to 1e-4; between them, for lobes of
    roughness .08 to 1, an energy divided by the table's is off by -0.3 to +0.11 % (32 nodes: -1.5 to +0.5).
    """
    cosines = np.maximum(np.linspace(0, 1, size) ** 2, 1e-3)  # close at grazing, where it is steep
    return np.stack([_lobe(cosines, roughness, radial, turns) for roughness in np.linspace(0, 1, size)])


def _lobe(cosines: np.ndarray, roughness: float, radial: int, turns: int) -> np.ndarray:
    """Both albedos [N, 2] of a lobe seen at cosines [N]."""
    alpha, c = max(roughness, 0.02) ** 2, cosines[:, None, None]
    t = (np.arange(radial) + 0.5) / radial
    r = np.sqrt(1 - (1 - t) ** 3)[:, None]
    share = ((1 - t) ** 2 / ((1 - t) ** 2).sum())[:, None] / turns
    turn = np.pi * ((np.arange(turns) + 0.5) / turns - 0.5)
    x, z = alpha * np.sqrt(1 - c * c), c  # the view where the facets' ellipsoid is a sphere
    x, z = x / np.hypot(x, z), z / np.hypot(x, z)
    across, s = r * np.cos(turn), (1 + z) / 2
    along = (1 - s) * np.sqrt(1 - across**2) + s * r * np.sin(turn)
    up = np.sqrt(np.maximum(1 - across**2 - along**2, 0))
    half = np.stack(np.broadcast_arrays(alpha * (up * x - along * z), alpha * across, along * x + up * z))
    half /= np.sqrt((half**2).sum(axis=0))
    vh = half[0] * np.sqrt(1 - c * c) + half[2] * c
    nl = 2 * vh * half[2] - c
    masked, shadowed = _smith(c, alpha), _smith(np.maximum(nl, 1e-6), alpha)
    weight = share * np.where(nl > 0, (1 + masked) / (1 + masked + shadowed), 0)
    return np.stack([weight.sum(axis=(1, 2)), (weight * (1 - np.clip(vh, 0, 1)) ** 5).sum(axis=(1, 2))], axis=1)


def _smith(cosine: np.ndarray, alpha: float) -> np.ndarray:
    """Smith's Lambda of GGX: hidden per visible microfacet area (Heitz 2014)."""
    return (np.sqrt(1 + alpha**2 * (1 - cosine**2) / cosine**2) - 1) / 2
