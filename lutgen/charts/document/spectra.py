"""Exact spectra and colors of many skins, with linear or with the document's exponential absorption; no photon traced.

`linear` absorption (weights times 1 - mu_a/mu_t) is right in the mean, so adding-doubling gives it. `exponential`
absorption with steps from mu_t, as Zhang (Human face rendering) mixes it, is exactly linear absorption in a
medium that scatters with mu_s + mu_a (kernels/README.md, Three ways to absorb), so adding-doubling gives that too.
"""

from __future__ import annotations

from dataclasses import astuple, replace

import numpy as np

from lutgen import color
from lutgen.errors import one_of
from lutgen.skin import chromophores
from lutgen.skin.tissue import Layer, Skin, dermis_scattering, scattering
from lutgen.solvers import adding_doubling, exact_totals

ABSORPTIONS = ("linear", "exponential")
_STREAMS = 12
SWEEPS = {
    "melanin": (Skin(0.013, 0.7, 0.005), (0.013, 0.43), (0.013, 0.02, 0.05, 0.1, 0.2, 0.43)),
    "hemoglobin": (Skin(0.013, 0.5, 0.001), (0.001, 0.1), (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1)),
    "eumelanin": (Skin(0.43, 0.0, 0.001), (0.0, 1.0), (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)),
}
"""The document's sweeps: what else the skin is, from where to where, and the values that the axis names."""


def nanometers() -> np.ndarray:
    """The wavelengths of every spectrum here: 380 to 780 nm in steps of 5."""
    return color.tables()["wavelength_nm"]


def spectra(skins: list[Skin], absorption: str = "linear") -> np.ndarray:
    """Exact diffuse reflectance [P, 81] of P skins with `linear` or with the document's `exponential` absorption."""
    of = _linear if one_of("absorption", absorption, ABSORPTIONS) == "linear" else _exponential
    return np.array([of(skin) for skin in skins])


def _linear(skin: Skin) -> np.ndarray:
    exact = exact_totals.exact_totals(skin.tissue)
    shares = [[value] for value in (*astuple(skin.chromophores), skin.oxygenation)]
    return exact_totals.spectra(exact, nanometers(), *shares)[0]


def _exponential(skin: Skin) -> np.ndarray:
    nm = nanometers()
    mu_s, g = scattering(skin, nm)
    mu_e = chromophores.epidermis(nm, skin.melanin, skin.eumelanin)
    mu_d = chromophores.dermis(nm, skin.hemoglobin, skin.oxygenation)
    below = dermis_scattering(skin, mu_s) + mu_d
    return adding_doubling.two_layer_grid(
        skin.epidermis_mm, mu_e[:, None], mu_d[:, None], mu_s + mu_e, g, skin.refractive_index, below, nodes=_STREAMS
    )[:, 0, 0]


def as_mixed(stack: list[Layer]) -> list[Layer]:
    """What `mixed` absorption solves in place of a stack: layers that scatter with mu_s + mu_a."""
    return [replace(layer, mu_s_per_mm=layer.mu_s_per_mm + layer.mu_a_per_mm) for layer in stack]


def shades(reflectance: np.ndarray, pipeline: str = "default") -> tuple[np.ndarray, np.ndarray]:
    """Display sRGB in 0 to 1 and L*a*b*, [..., 3] each, of spectra [..., 81]."""
    xyz = color.spectrum_to_xyz(reflectance, pipeline)
    return color.encode_srgb(color.from_xyz(xyz, "srgb", pipeline)), color.lab(xyz)


def numbers(reflectance: np.ndarray, pipelines: tuple[str, ...] = color.PIPELINES) -> dict:
    """One spectrum's color as columns of a table."""
    named = {}
    for pipeline in pipelines:
        rgb, lab = shades(reflectance, pipeline)
        named[f"srgb_{pipeline}"] = "#" + "".join(f"{round(255 * float(v)):02x}" for v in rgb)
        named |= {f"{axis}_{pipeline}": float(v) for axis, v in zip("Lab", lab, strict=True)}
    return named


def columns(reflectance: np.ndarray) -> dict:
    """One spectrum as columns of a table."""
    return {f"R{nm:.0f}nm": float(value) for nm, value in zip(nanometers(), reflectance, strict=True)}


def percent(value: float, parameter: str = "") -> str:
    """A volume fraction as percent; the eumelanin ratio as it is.

    >>> percent(0.013, "melanin"), percent(0.7, "eumelanin")
    ('1.3 %', '0.7')
    """
    return f"{value:g}" if parameter == "eumelanin" else f"{100 * value:.3g} %"


def sweep(parameter: str, steps: int) -> list[Skin]:
    """The skins of one of the document's sweeps, evenly spaced (melanin and hemoglobin: in ratio)."""
    base, (low, high), _ = SWEEPS[parameter]
    space = np.linspace if parameter == "eumelanin" else np.geomspace
    return [replace(base, **{parameter: float(v)}) for v in np.clip(space(low, high, steps), low, high)]


def ticks(parameter: str, steps: int) -> tuple[list[float], list[str]]:
    """Where the named values of a sweep lie between its first step, 0, and its last, and their labels."""
    _, ends, values = SWEEPS[parameter]
    low, high, *named = np.array([*ends, *values]) if parameter == "eumelanin" else np.log([*ends, *values])
    places = [float((v - low) / (high - low) * (steps - 1)) for v in named]
    return places, [percent(v, parameter) for v in values]
