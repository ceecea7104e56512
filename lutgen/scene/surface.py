"""A skin's surface: what it reflects, lets in and lets out, as functions of its refractive index n.

Renderer and viewer read one text of it, kernels/common/surface.cl, with constants from here.
"""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import numpy as np

from lutgen.skin.tissue import specular

SECOND_LOBE, SECOND_WEIGHT = 0.55, 0.2
"""Roughness of the sharper of both specular lobes relative to the other, and its share."""
_OPENCL = """
#define FUNCTION inline
#define REAL(x) ((float)(x))
#define WHOLE(x) ((int)(x))
"""
_GLSL = """
#define FUNCTION
#define REAL(x) float(x)
#define WHOLE(x) int(x)
#define float2 vec2
#define float3 vec3
#define fmax max
"""


def opencl(n: float) -> str:
    """OpenCL C of the surface at refractive index n."""
    return f"{_OPENCL}{_constants(n, '__constant float EXIT_MEAN[EXIT_MEANS] = {{{}}};')}{_text()}"


def glsl(n: float) -> str:
    """GLSL (3.30, ES 3.00) of the surface at refractive index n."""
    return f"{_GLSL}{_constants(n, 'const float EXIT_MEAN[EXIT_MEANS] = float[]({});')}{_text()}"


def _text() -> str:
    return files("lutgen.kernels").joinpath("common", "surface.cl").read_text(encoding="utf-8")


def _constants(n: float, table: str) -> str:
    """The surface's constants; `table`: how a language writes one of floats."""
    means = exit_means(n)
    numbers = {"F0": specular(n), "SECOND_LOBE": SECOND_LOBE, "SECOND_WEIGHT": SECOND_WEIGHT}
    lines = [f"#define {name} {value:.9e}f" for name, value in numbers.items()]
    return "\n".join([
        *lines, f"#define EXIT_MEANS {len(means)}", table.format(", ".join(f"{mean:.9e}f" for mean in means)), "",
    ])  # fmt: skip


def fresnel(cosine: np.ndarray, n: float) -> np.ndarray:
    """Schlick's reflectance [N] in air at cosines [N]."""
    f0 = specular(n)
    return np.asarray(f0 + (1 - f0) * (1 - cosine) ** 5)


def entry_factor(cosine: np.ndarray, n: float) -> np.ndarray:
    """Share of light at cosines [N] that enters, relative to light along the normal."""
    return (1 - fresnel(cosine, n)) / (1 - specular(n))


def lobe_share(energy: np.ndarray, n: float) -> np.ndarray:
    """What a lobe of energies [..., 2] (`ggx_energy`) reflects [...] of an even environment, lost energy recovered."""
    f0, whole, part = specular(n), energy[..., 0], energy[..., 1]
    return np.asarray((f0 * (whole - part) + part) * (1 + f0 * (1 / np.maximum(whole, 1e-6) - 1)))


def exit_mean(n: float) -> float:
    """Mean of what a cosine lobe lets out: 2 * integral of (1 - F(c)) c dc, which the exit lobe is divided by."""
    x, w = np.polynomial.legendre.leggauss(64)
    c = (x + 1) / 2
    return float(((1 - fresnel(c, n)) * c * w).sum())


def exit_means(n: float) -> np.ndarray:
    """The same for rough skin, by roughness evenly from 0 to 1 [64]: mean of what one GGX lobe does not reflect."""
    table = ggx_energy()
    root = np.linspace(0, 1, table.shape[1])
    return np.asarray(np.trapezoid((1 - lobe_share(table, n)) * 4 * root**3, root, axis=1))


def entry_of_the_sky(n: float) -> float:
    """What an even sky enters with, relative to light along the normal."""
    return exit_mean(n) / (1 - specular(n))


@cache
def ggx_energy(size: int = 64, radial: int = 96, turns: int = 32) -> np.ndarray:
    """Energy [roughness, root of cosine, 2] of one GGX lobe: at F = 1, and weighted with (1 - v.h)^5.

    Height-correlated Smith masking; visible normals (Heitz 2018) on a regular grid, weights G2 / G1 <= 1. Half a turn
    is enough, the other is its mirror image. Radii are dense at the rim, where the facets lean and masking sets in: of
    an even grid, a smooth lobe's whole tail lies in the last cell. Nodes are right to 1e-4; between them, for lobes of
    roughness .08 to 1, an energy divided by the table's is off by -0.3 to +0.11 % (32 nodes: -1.5 to +0.5).
    """
    cosines = np.maximum(np.linspace(0, 1, size) ** 2, 1e-3)  # close at grazing, where it is steep
    return np.stack([_lobe(cosines, roughness, radial, turns) for roughness in np.linspace(0, 1, size)])


def _lobe(cosines: np.ndarray, roughness: float, radial: int, turns: int) -> np.ndarray:
    """Both energies [N, 2] of a lobe seen at cosines [N]."""
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


def _smith(cosine: np.ndarray, alpha: float | np.ndarray) -> np.ndarray:
    """Smith's Lambda of GGX: hidden per visible microfacet area (Heitz 2014)."""
    return (np.sqrt(1 + alpha**2 * (1 - cosine**2) / cosine**2) - 1) / 2
