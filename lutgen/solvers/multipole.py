"""Diffusion multipoles for a slab over a semi-infinite layer (Donner & Jensen 2005).

A point source one reduced mean free path deep and its images over the slab's two extrapolated boundaries give what
the slab reflects and transmits. Over radius each image is a term z (1 + s d) exp(-s d) / (4 pi d^3); its Hankel
transform is exp(-z sqrt(k^2 + s^2)) / 2, so the endless series of images is a geometric one with the sum of `_slab`.
In frequency space convolutions are products, and layers add as R = R1 + T1 R2 T1' / (1 - R1' R2) (Kubelka 1954),
the dash meaning light from below. The profile comes back by quadrature over frequency.
"""

from __future__ import annotations

import numpy as np

from lutgen.errors import InputError
from lutgen.skin.tissue import Layer, specular
from lutgen.solvers import dipole
from lutgen.solvers.dipole import Diffusion
from lutgen.solvers.profiles import Profile, Reflectance

OPTIONS = ("unsafe", "wavelength_nm")

LEAST_THICKNESS = 1.0
"""Least thickness of the upper layer in its reduced mean free paths: a thinner one does not hold its own source."""
LEAST_ALBEDO_BELOW = 0.92
"""Least reduced albedo of the lower layer; the upper one has the dipole's."""
# Derived as the dipole's, against adding-doubling over upper albedo (the dipole's least, to 1) x lower albedo (.59 to
# 1) x thickness (.25 to 8 mean free paths) x n (1 to 1.6) x g (0, .75, .9). At a thickness of 1 the error reaches 10 %
# where the lower layer's albedo is .88 (n 1.4) to .91 (n 1; with the dipole's own least albedo above it would be .95,
# which is why LEAST_ALBEDO is higher there); at 1.5 below .7. Thinner slabs, lower albedo .91 or more: at .75 -7 % to
# +14 %, at .5 -14 % to +23 %, at .25 -22 % to +34 %. Inside the domain errors are -9.2 % to +9.2 %.
# Whether the layers scatter alike makes no difference: totals depend on the albedos and optical thickness only.
# Encircled energies err more, against path-table over the same map: at n 1.4 .02 to .14 (g 0), .07 to .22 (g .75, .9;
# median .11), most for a bright slab of one mean free path over the darkest lower layer; at n 1.5 up to .29.

_NODES = 16
_SMALLEST = 37.0  # exp(-37) is a double's rounding


def _slab(
    s: np.ndarray, slab: Diffusion, thickness_mm: float, entered_mm: float, left_mm: float
) -> tuple[np.ndarray, np.ndarray]:
    """Hankel transforms of a slab's reflected and transmitted flux; extrapolation of the sides of entry and exit."""
    depth = min(slab.path_mm, thickness_mm)
    whole = thickness_mm + entered_mm + left_mm
    reflected = _even(s, entered_mm) * _sinh_ratio(s, thickness_mm + left_mm - depth, whole, entered_mm)
    transmitted = _even(s, left_mm) * _sinh_ratio(s, depth + entered_mm, whole, left_mm)
    return slab.albedo * reflected, slab.albedo * transmitted


def _even(s: np.ndarray, z: float) -> np.ndarray:
    """exp(-s z) cosh(s z)."""
    return (1 + np.exp(-2 * s * z)) / 2


def _sinh_ratio(s: np.ndarray, part: float, whole: float, z: float) -> np.ndarray:
    """exp(s z) sinh(s part) / sinh(s whole), z not above whole - part, with its limit part / whole at s = 0."""
    at_zero = s * whole < 1e-12
    s = np.where(at_zero, 1.0, s)
    ratio = np.exp(s * (z + part - whole)) * np.expm1(-2 * s * part) / np.expm1(-2 * s * whole)
    return np.where(at_zero, part / whole, ratio)


def _transform(layers: list[Layer], k_per_mm: np.ndarray) -> np.ndarray:
    """Hankel transform of the diffuse profile at frequencies in 1/mm, per unit of light that has entered."""
    upper, lower = (dipole.diffusion(layer) for layer in layers)
    thickness = layers[0].thickness_mm
    surface = upper.extrapolation_mm(dipole.mismatch(layers[0].n))
    between = upper.extrapolation_mm(1.0)
    s = np.hypot(k_per_mm, upper.sigma_per_mm)
    R, T = _slab(s, upper, thickness, surface, between)
    R_below, T_below = _slab(s, upper, thickness, between, surface)
    s = np.hypot(k_per_mm, lower.sigma_per_mm)
    R_lower = lower.albedo * np.exp(-s * lower.path_mm) * _even(s, lower.extrapolation_mm(1.0))
    return R + T * R_lower * T_below / (1 - R_below * R_lower)


def bessel_j1(x: np.ndarray) -> np.ndarray:
    """Bessel function J1 of x >= 0, to 1e-15.

    Below 25 Bessel's integral by the trapezoidal rule (DLMF 10.9.2; 64 points err by J63(25) = 1e-18), above it
    Hankel's asymptotic series (DLMF 10.17.3).

    >>> bessel_j1(np.array([1.0, 100.0])).round(12).tolist()
    [0.440050585745, -0.077145352014]
    """
    value = np.empty_like(x)
    near = x < 25
    angle = np.arange(64) * (np.pi / 32)
    value[near] = np.cos(angle - x[near, None] * np.sin(angle)).mean(axis=-1)
    far = x[~near]
    even, odd, term = np.ones_like(far), np.zeros_like(far), np.ones_like(far)
    for m in range(1, 20):
        term = term * (4 - (2 * m - 1) ** 2) / (8 * m * far)
        if m % 2:
            odd += (-1) ** (m // 2) * term
        else:
            even += (-1) ** (m // 2) * term
    phase = far - 3 * np.pi / 4
    value[~near] = np.sqrt(2 / (np.pi * far)) * (even * np.cos(phase) - odd * np.sin(phase))
    return value


def _encircled(layers: list[Layer], radius_mm: float) -> float:
    """Share of the entered light that leaves within a radius: r times the integral of transform times J1(k r).

    Panels double from near 0, where the transform bends on the scale of the diffusion lengths, to half a wave of
    the Bessel function. The transform falls as exp(-k z), z the shallowest source; where that is many waves away a
    smooth step at 500 / r ends the integral: with width 12.5 / r it alters it by exp(-12.5 pi) (its nearest pole).
    """
    if radius_mm == 0:
        return 0.0
    if np.isinf(radius_mm):
        return float(_transform(layers, np.zeros(1))[0])
    depth = min(layers[0].thickness_mm, *(dipole.diffusion(layer).path_mm for layer in layers))
    end = min(_SMALLEST / depth, 1000 / radius_mm)
    wave = min(np.pi / radius_mm, end)
    doubling = wave * 0.5 ** np.arange(24, -1, -1)
    edges = np.concatenate([[0.0], doubling, np.arange(2 * wave, end + wave, wave)])
    x, w = np.polynomial.legendre.leggauss(_NODES)
    half = np.diff(edges)[:, None] / 2
    k = (edges[:-1, None] + half * (x + 1)).ravel()
    step = 1 / (1 + np.exp(np.minimum((k * radius_mm - 500) / 12.5, 700)))
    return radius_mm * float(((half * w).ravel() * step * _transform(layers, k)) @ bessel_j1(k * radius_mm))


def _checked(layers: list[Layer], unsafe: bool) -> list[Layer]:
    """The slab and what lies under it, or InputError."""
    dipole.require_flag(unsafe)
    method = "use method adding-doubling or direct"
    if len(layers) != 2:
        advice = "use method dipole" if len(layers) == 1 else method
        raise InputError(f"layers: multipole takes 2 layers, not {len(layers)}; {advice}")
    upper, lower = layers
    if not np.isinf(lower.thickness_mm) or not 0 < upper.thickness_mm < np.inf:
        raise InputError(
            f"thickness_mm = {upper.thickness_mm:g} and {lower.thickness_mm:g}: multipole needs a slab over a "
            f"semi-infinite layer; {method}"
        )
    if upper.n != lower.n:
        raise InputError(f"n = {upper.n:g} and {lower.n:g}: multipole needs the same in both layers; {method}")
    dipole.require_albedo(upper, dipole.least_albedo(upper.n), "multipole", unsafe)
    dipole.require_albedo(lower, LEAST_ALBEDO_BELOW, "multipole", unsafe)
    least = LEAST_THICKNESS * dipole.diffusion(upper).path_mm
    if upper.thickness_mm < least * dipole.SLACK:
        dipole.require_unsafe(
            unsafe,
            f"thickness_mm = {upper.thickness_mm:g}: the upper layer is thinner than {LEAST_THICKNESS:g} reduced mean "
            f"free path, here {least:.4g} mm, where multipole errs by more than {dipole.TOLERANCE:.0%}",
        )
    return layers


def reflectance(
    layers: list[Layer], photons: int = 0, seed: int = 0, unsafe: bool = False, wavelength_nm: float = 0.0
) -> Reflectance:
    """Diffuse and specular share of light along the normal on a slab over a semi-infinite layer of the same index.

    The layers may scatter differently. Counted as the dipole's: `diffuse` is the share of the light that fell.
    Raises InputError where it errs by more than 10 % (a dark layer, or a slab thinner than a reduced mean free path),
    unless `unsafe`: then a thinner slab has its source at its lower face.

    >>> skin = [Layer(0.25, 0.1, 36, 0.75), Layer(float("inf"), 0.05, 18, 0.75)]
    >>> round(reflectance(skin).diffuse, 4)
    0.5802
    """
    pair = _checked(layers, unsafe)
    surface = specular(pair[0].n)
    return Reflectance((1 - surface) * _encircled(pair, np.inf), surface)


def profile(
    layers: list[Layer], radius_edges_mm: np.ndarray, photons: int = 0, seed: int = 0,
    unsafe: bool = False, wavelength_nm: float = 0.0,
) -> Profile:  # fmt: skip
    """Share of incident light that leaves in each ring [B], its quadrature good to 1e-14; its standard error is 0.

    Refused as `reflectance` is; also refused, unless `unsafe`, are ring edges nearer than the longer of the layers'
    reduced mean free paths but not 0. Beyond it the encircled energy still errs by up to .2 (n 1.4).

    >>> skin = [Layer(0.25, 0.1, 36, 0.75), Layer(float("inf"), 0.05, 18, 0.75)]
    >>> profile(skin, np.array([0.0, 0.5, 1.0, np.inf])).energy.round(4).tolist()
    [0.4018, 0.0912, 0.0873]
    """
    pair = _checked(layers, unsafe)
    edges = np.asarray(radius_edges_mm, float)
    dipole.require_radii(edges, max(dipole.diffusion(layer).path_mm for layer in pair), "multipole", unsafe)
    within = np.array([_encircled(pair, float(radius)) for radius in edges])
    # Rings may fall below 0 by rounding, and for slabs that only `unsafe` lets in because the flux there is taken
    # below a fluence that peaks above the surface. Cutting encircled energy at the total keeps the sum.
    within = np.maximum.accumulate(np.clip(within, 0, _encircled(pair, np.inf)))
    energy = (1 - specular(pair[0].n)) * np.diff(within)
    return Profile(edges, energy, np.zeros_like(energy))
