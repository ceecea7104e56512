"""Ways to get the reflectance and profile of layered tissue: one file a method, one signature, a dict of them."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module

import numpy as np

from lutgen.errors import InputError, numbers, one_of, shown, whole
from lutgen.skin.tissue import Layer, Skin, layers
from lutgen.solvers.paths import PHOTONS, SEEDS
from lutgen.solvers.profiles import Profile, ring_edges

METHODS = {
    "path-table": "path_table",
    "adding-doubling": "adding_doubling",
    "direct": "direct",
    "dipole": "dipole",
    "multipole": "multipole",
}
"""Method name -> module of this package with `reflectance` and, where the method knows radii, `profile`."""


def _call(method: str, function: str, layers, *arguments, photons: int, seed: int, options: dict):
    """Check what all methods share, then call the method's function of that name."""
    module = import_module(f"lutgen.solvers.{METHODS[one_of('method', method, tuple(METHODS))]}")
    whole("photons", photons, *PHOTONS)
    whole("seed", seed, *SEEDS)
    stack = list(layers) if isinstance(layers, Iterable) else [layers]
    if not stack or not all(isinstance(layer, Layer) for layer in stack):
        raise InputError(f"layers = {shown(layers)}: a list of at least one lutgen.Layer is needed")
    if not hasattr(module, function):
        able = [name for name in METHODS if hasattr(import_module(f"lutgen.solvers.{METHODS[name]}"), function)]
        raise InputError(f"method = {method!r}: gives no {function}; use {' or '.join(able)}")
    for name in options:
        if name not in module.OPTIONS:
            raise InputError(f"{name}: method {method} has no such option; it has {', '.join(module.OPTIONS)}")
    return getattr(module, function)(stack, *arguments, photons=photons, seed=seed, **options)


def reflectance(layers, method: str = "adding-doubling", photons: int = 100_000, seed: int = 0, **options):
    """Diffuse, specular and transmitted share of light along the normal, with the diffuse share's standard error.

    `layers`: Layers from the surface down. `photons` and `seed` matter to Monte Carlo only. Options: `device` of
    path-table and direct, `nodes` of adding-doubling, `absorption`, `threshold`, `survivors` of direct, `unsafe` of
    dipole and multipole. Raises InputError for stacks that the method cannot represent or must not be trusted with.

    >>> import lutgen
    >>> result = lutgen.reflectance(lutgen.layers(lutgen.preset("light"), 550))
    >>> round(result.diffuse, 4), round(result.specular, 4)
    (0.289, 0.0278)
    """
    return _call(method, "reflectance", layers, photons=photons, seed=seed, options=options)


def profile(
    layers, radius_edges_mm=None, method: str = "path-table", photons: int = 1_000_000, seed: int = 0, **options
) -> Profile:
    """Share of incident light that leaves diffusely in each ring, with standard errors.

    `radius_edges_mm`: ascending from 0 or more (default: 64 rings to 30 mm); what leaves outside them is not counted.

    >>> import lutgen
    >>> profile = lutgen.profile(lutgen.layers(lutgen.preset("dark"), 550), photons=20_000)
    >>> profile.energy.shape
    (64,)
    """
    edges = ring_edges() if radius_edges_mm is None else numbers("radius_edges_mm", radius_edges_mm)
    if edges.ndim != 1 or len(edges) < 2 or not edges[0] >= 0 or not np.all(np.diff(edges) > 0):
        raise InputError(
            f"radius_edges_mm = {shown(radius_edges_mm)}: at least two ascending radii of 0 or more are needed"
        )
    return _call(method, "profile", layers, edges, photons=photons, seed=seed, options=options)


def spectrum(skin: Skin, wavelength_nm=None, method: str = "adding-doubling", **options) -> np.ndarray:
    """Diffuse reflectance [n] of a skin at wavelengths in nm [n] (default: every 5 nm from 380 to 780).

    >>> import lutgen
    >>> lutgen.spectrum(lutgen.preset("light")).shape
    (81,)
    """
    return np.array([result.diffuse for result in _each(skin, wavelength_nm, method, options)])


def spectrum_with_error(skin: Skin, wavelength_nm=None, method: str = "adding-doubling", **options):
    """Diffuse reflectance and its standard error, [n] each; see `spectrum`.

    >>> import lutgen
    >>> from lutgen.solvers import spectrum_with_error
    >>> spectrum_with_error(lutgen.preset("light"), [550.0])[1].tolist()
    [0.0]
    """
    results = _each(skin, wavelength_nm, method, options)
    return np.array([r.diffuse for r in results]), np.array([r.std_error for r in results])


def _each(skin: Skin, wavelength_nm, method: str, options: dict) -> list:
    nm = (
        np.arange(380.0, 781.0, 5.0)
        if wavelength_nm is None
        else np.atleast_1d(numbers("wavelength_nm", wavelength_nm))
    )
    if nm.ndim != 1:
        raise InputError(f"wavelength_nm has shape {nm.shape}: one wavelength or a list of them is needed")
    return [reflectance(layers(skin, float(w)), method, **options, wavelength_nm=float(w)) for w in nm]


def linear_srgb(skin: Skin, method: str = "adding-doubling", pipeline: str = "default", **options) -> np.ndarray:
    """Linear, unclipped sRGB [3] of a skin's diffuse reflectance, from its spectrum every 5 nm.

    >>> import lutgen
    >>> lutgen.linear_srgb(lutgen.preset("light")).round(3).tolist()
    [0.457, 0.297, 0.202]
    """
    from lutgen import color

    return color.from_xyz(color.spectrum_to_xyz(spectrum(skin, None, method, **options), pipeline), "srgb", pipeline)
