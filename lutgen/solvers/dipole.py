"""Diffusion dipole for one semi-infinite layer (Jensen, Marschner, Levoy & Hanrahan 2001).

A point source one reduced mean free path below the surface stands for the light that came in, its mirror image over
the extrapolated boundary for the surface. What leaves is the sum of two terms z (1 + s d) exp(-s d) / (4 pi d^3),
which integrate over a disc in closed form.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lutgen.errors import InputError
from lutgen.skin.tissue import Layer, specular
from lutgen.solvers.profiles import Profile, Reflectance

OPTIONS = ("unsafe", "wavelength_nm")

TOLERANCE = 0.10
"""Largest relative error of the diffuse total, against adding-doubling, where the method answers unasked."""
LEAST_ALBEDO = ((1.0, 0.91), (1.2, 0.87), (1.3, 0.90), (1.33, 0.91), (1.4, 0.94), (1.5, 0.96), (1.6, 0.972))
"""(refractive index, least reduced albedo mu_s' / (mu_a + mu_s')) within TOLERANCE; linear between."""
# Derived: the dipole's total was compared with adding-doubling (16 nodes) at reduced albedos .3 to .9999 and g 0, .3,
# .6, .8, .9, .95. The highest albedo at which it errs by 10 % is .849 at n 1 (g 0, too dark), and, too bright and at
# g .95, .830 at n 1.2, .892 at 1.3, .906 at 1.33, .931 at 1.4, .954 at 1.5, .969 at 1.6. Rounded up; at n 1 to 1.2
# farther, so that the multipole can share the table. Within it the dipole errs by .092 at most (n 1.33), by .034 of
# the incident light. Errors saturate with g: .90 and .95 differ by .001 in albedo. The table does not hold at g < 0
# (g -.5, n 1: .925); beyond n 1.6 it would near 1 (.984 at n 1.8, .991 at n 2).
LEAST_G, GREATEST_N = 0.0, 1.6
SLACK = 1 - 1e-9
"""Limits are compared up to rounding."""
LEAST_RADIUS = 1.0
"""Least radius of a profile in reduced mean free paths: a diffuse profile knows nothing nearer to the entry point."""
# Beyond it encircled energies of the dipole err by this, against path-table at albedos from the least to .995:
# g .75 and .9: .05 to .09 (n 1), .07 to .12 (n 1.4), .10 to .15 (n 1.5); g 0: .15 to .20, .05, .07.


@dataclass(frozen=True)
class Diffusion:
    """What diffusion keeps of a layer: reduced albedo, mean free path and diffusion length's inverse in mm, 1/mm."""

    albedo: float
    path_mm: float
    sigma_per_mm: float

    def extrapolation_mm(self, mismatch: float) -> float:
        """Distance 2 A D from a boundary to where the fluence extrapolates to zero, `mismatch` being A."""
        return 2 / 3 * mismatch * self.path_mm


def diffusion(layer: Layer) -> Diffusion:
    """Diffusion's quantities of a layer; raises InputError where nothing scatters.

    >>> diffusion(Layer(float("inf"), mu_a_per_mm=0.0, mu_s_per_mm=20.0, g=0.5))
    Diffusion(albedo=1.0, path_mm=0.1, sigma_per_mm=0.0)
    """
    reduced = layer.mu_s_per_mm * (1 - layer.g)
    if not reduced > 0:
        raise InputError(
            f"mu_s_per_mm = {layer.mu_s_per_mm:g}: diffusion needs scattering; use method adding-doubling or direct"
        )
    total = layer.mu_a_per_mm + reduced
    return Diffusion(reduced / total, 1 / total, float(np.sqrt(3 * layer.mu_a_per_mm * total)))


def mismatch(n: float) -> float:
    """A = (1 + Fdr) / (1 - Fdr), Fdr being the diffuse reflectance met from inside (Jensen 2001, section 2.1).

    >>> round(mismatch(1.4), 4)
    3.2507
    """
    inside = -1.440 / n**2 + 0.710 / n + 0.668 + 0.0636 * n
    return (1 + inside) / (1 - inside)


def least_albedo(n: float) -> float:
    """Least reduced albedo that the dipole is trusted with, at refractive index n; see LEAST_ALBEDO.

    >>> round(least_albedo(1.4), 3)
    0.94
    """
    index, albedo = zip(*LEAST_ALBEDO, strict=True)
    return float(np.interp(n, index, albedo))


def require_flag(unsafe: object) -> None:
    """Raise InputError for an `unsafe` that is no bool."""
    if not isinstance(unsafe, bool):
        raise InputError(f"unsafe = {unsafe!r}: allowed is True or False")


def require_unsafe(unsafe: bool, reason: str, able: str = "adding-doubling or direct") -> None:
    """Raise InputError with the reason and the methods that are able unless the caller takes the wrong number."""
    if not unsafe:
        raise InputError(f"{reason}; use method {able}, or unsafe=True to compute anyway")


def require_albedo(layer: Layer, least: float, method: str, unsafe: bool) -> None:
    """Raise InputError, unless unsafe, for optics of a layer that the diffusion method must not be trusted with."""
    if layer.g < LEAST_G:
        require_unsafe(unsafe, f"g = {layer.g:g}: {method} is within {TOLERANCE:.0%} from g {LEAST_G:g} on")
    if layer.n > GREATEST_N:
        require_unsafe(unsafe, f"n = {layer.n:g}: {method} is within {TOLERANCE:.0%} up to n {GREATEST_N:g}")
    albedo = diffusion(layer).albedo
    if albedo < least * SLACK:
        require_unsafe(
            unsafe,
            f"mu_a_per_mm = {layer.mu_a_per_mm:g}: reduced albedo {albedo:.4g} is below {least:.4g}, "
            f"where {method} errs by more than {TOLERANCE:.0%}",
        )


def require_radii(radius_edges_mm: np.ndarray, path_mm: float, method: str, unsafe: bool) -> None:
    """Raise InputError, unless unsafe, for ring edges between the entry point and LEAST_RADIUS mean free paths."""
    least = LEAST_RADIUS * path_mm
    inner = radius_edges_mm[(radius_edges_mm > 0) & (radius_edges_mm < least * SLACK)]
    if len(inner):
        require_unsafe(
            unsafe,
            f"radius_edges_mm = {inner[0]:g}: {method} knows no radius between 0 and {LEAST_RADIUS:g} reduced mean "
            f"free path, here {least:.4g} mm",
            "path-table or direct",
        )


def _layer(layers: list[Layer], unsafe: bool) -> Layer:
    """The one layer that a stack amounts to, or InputError."""
    require_flag(unsafe)
    bottom = layers[-1]
    if not np.isinf(bottom.thickness_mm):
        raise InputError(
            f"thickness_mm = {bottom.thickness_mm:g}: dipole needs a semi-infinite layer, last; "
            "use method adding-doubling or direct"
        )
    for name in ("mu_a_per_mm", "mu_s_per_mm", "g", "n"):
        values = {getattr(layer, name) for layer in layers}
        if len(values) > 1:
            able = "multipole, adding-doubling or direct" if len(layers) == 2 else "adding-doubling or direct"
            listed = " and ".join(f"{value:g}" for value in sorted(values))
            raise InputError(f"{name} = {listed}: dipole takes layers that are all alike; use method {able}")
    require_albedo(bottom, least_albedo(bottom.n), "dipole", unsafe)
    return bottom


def disc_rings(depth_mm: float, sigma_per_mm: float, radius_edges_mm: np.ndarray) -> np.ndarray:
    """Integrals [B] over rings of a source term z (1 + s d) exp(-s d) / (2 pi d^3), d the distance to depth z.

    The antiderivative in r of the term times 2 pi r is -z exp(-s d) / d; its difference is written as a sum of terms
    that are not negative, so that neither small nor far rings lose digits. The last edge may be infinite.

    >>> disc_rings(0.1, 0.0, np.array([0.0, 0.1, np.inf])).round(4).tolist()
    [0.2929, 0.7071]
    """
    distance = np.hypot(radius_edges_mm, depth_mm)
    near, far = distance[:-1], distance[1:]
    r, R = radius_edges_mm[:-1], radius_edges_mm[1:]
    beyond = depth_mm * np.exp(-sigma_per_mm * near) / near
    finite = np.isfinite(far)
    R, far = np.where(finite, R, r), np.where(finite, far, near)
    step = (R - r) * (R + r) / (near + far)
    return beyond * np.where(finite, step / far - near / far * np.expm1(-sigma_per_mm * step), 1.0)


def _depths(layer: Layer) -> tuple[Diffusion, np.ndarray]:
    """The layer's diffusion quantities and the depths in mm of its source and (above the surface) image."""
    inside = diffusion(layer)
    depth = inside.path_mm
    return inside, np.array([depth, depth + 2 * inside.extrapolation_mm(mismatch(layer.n))])


def reflectance(
    layers: list[Layer], photons: int = 0, seed: int = 0, unsafe: bool = False, wavelength_nm: float = 0.0
) -> Reflectance:
    """Diffuse and specular share of light along the normal by the dipole's closed form; photons, seed are not used.

    The paper's R_d = alpha'/2 (1 + exp(-4/3 A sqrt(3 (1 - alpha')))) exp(-sqrt(3 (1 - alpha'))) is the share of the
    light that has entered; `diffuse` is (1 - R_specular) R_d, the share of the light that fell, as every method of
    this package counts it. No other Fresnel factor belongs: A holds what the surface throws back inside, so that
    without absorption R_d is 1 and diffuse and specular share sum to 1. `layers`: one semi-infinite layer, or several
    that are all alike. Raises InputError where the total errs by more than 10 % (LEAST_ALBEDO), unless `unsafe`.

    >>> round(reflectance([Layer(float("inf"), mu_a_per_mm=0.05, mu_s_per_mm=20, g=0.8)]).diffuse, 4)
    0.568
    """
    layer = _layer(layers, unsafe)
    inside, depths = _depths(layer)
    total = inside.albedo / 2 * np.exp(-inside.sigma_per_mm * depths).sum()
    surface = specular(layer.n)
    return Reflectance(float((1 - surface) * total), surface)


def profile(
    layers: list[Layer], radius_edges_mm: np.ndarray, photons: int = 0, seed: int = 0,
    unsafe: bool = False, wavelength_nm: float = 0.0,
) -> Profile:  # fmt: skip
    """Share of incident light that leaves in each ring [B], integrated exactly; its standard error is 0.

    Counted and refused as `reflectance` is; also refused, unless `unsafe`, are ring edges nearer than one reduced mean
    free path 1 / (mu_a + mu_s') but not 0. Beyond it the encircled energy still errs by up to .15 (g 0, n 1: .20).

    >>> edges = np.array([0.0, 0.5, 1.0, np.inf])
    >>> profile([Layer(float("inf"), 0.05, 20, 0.8)], edges).energy.round(4).tolist()
    [0.2807, 0.1304, 0.1569]
    """
    layer = _layer(layers, unsafe)
    edges = np.asarray(radius_edges_mm, float)
    inside, depths = _depths(layer)
    require_radii(edges, inside.path_mm, "dipole", unsafe)
    shares = np.array([disc_rings(float(depth), inside.sigma_per_mm, edges) for depth in depths])
    energy = (1 - specular(layer.n)) * inside.albedo / 2 * shares.sum(axis=0)
    return Profile(edges, energy, np.zeros_like(energy))
