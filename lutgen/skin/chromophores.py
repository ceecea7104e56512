"""Absorption and scattering spectra of skin, each with its source; wavelength in nm, coefficients in 1/mm.

Every function takes an array of any shape and returns one of the same shape.
"""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import numpy as np

RANGES = {"melanin": (0.001, 0.5), "eumelanin": (0.0, 1.0), "hemoglobin": (0.001, 0.1)}
"""What the axes of a LUT may span: shares of melanosomes in the epidermis, of eumelanin among them, of blood in the
dermis."""
NAMES = tuple(RANGES)
"""The chromophores of a skin in the order in which functions take them; arrays over a grid have them reversed."""
MELANIN, EUMELANIN, HEMOGLOBIN = RANGES.values()
OXYGENATION = (0.0, 1.0)
WAVELENGTH_NM = (380.0, 780.0)

_BLOOD_GRAM_PER_LITER = 150.0
_HEMOGLOBIN_GRAM_PER_MOLE = 64_500.0
BLOOD_FACTOR = np.log(10) * _BLOOD_GRAM_PER_LITER / _HEMOGLOBIN_GRAM_PER_MOLE / 10
"""1/mm per molar extinction of 1/cm/M, for whole blood of 150 g/l (Prahl 1999): 5.35485e-4."""


def anisotropy(wavelength_nm):
    """Mean cosine of scattering (van Gemert et al. 1989).

    >>> float(anisotropy(500.0))
    0.765
    """
    return 0.62 + 0.29e-3 * np.asarray(wavelength_nm, float)


def scattering_source(wavelength_nm):
    """Reduced scattering, 1/mm, as Zhang (Human face rendering) and Donner & Jensen 2006 use it (twice Bashkatov's).

    >>> round(float(scattering_source(450.0)), 4)
    9.2091
    """
    w = np.asarray(wavelength_nm, float)
    return 14.74 * w**-0.22 + 2.2e11 * w**-4


def scattering_bashkatov(wavelength_nm):
    """Reduced scattering, 1/mm (Bashkatov et al. 2005).

    >>> round(float(scattering_bashkatov(450.0)), 4)
    4.6046
    """
    w = np.asarray(wavelength_nm, float)
    return 7.37 * w**-0.22 + 1.1e11 * w**-4


def scattering_jacques(wavelength_nm):
    """Reduced scattering, 1/mm (Jacques 1998).

    >>> round(float(scattering_jacques(500.0)), 4)
    4.9889
    """
    w = np.asarray(wavelength_nm, float)
    return 2e4 * w**-1.5 + 2e11 * w**-4


def scattering_saidi(wavelength_nm, a_per_mm=5.7, b_nm4_per_mm=8.4e10):
    """Reduced scattering, 1/mm, of neonatal skin (Saidi et al. 1995); A and B as fitted at 36 weeks of gestation.

    >>> round(float(scattering_saidi(500.0)), 4)
    3.4734
    """
    w = np.asarray(wavelength_nm, float)
    return a_per_mm * (1 - 1.745e-3 * w + 9.843e-7 * w**2) + b_nm4_per_mm * w**-4


def baseline(wavelength_nm):
    """Absorption of bloodless, melaninless skin, 1/mm (Jacques 1998).

    >>> round(float(baseline(450.0)), 5)
    0.12192
    """
    return 0.0244 + 8.53 * np.exp(-(np.asarray(wavelength_nm, float) - 154) / 66.2)


def eumelanin(wavelength_nm):
    """Absorption of a eumelanin melanosome, 1/mm (Jacques 1998).

    >>> round(float(eumelanin(450.0)), 2)
    96.46
    """
    return 6.6e10 * np.asarray(wavelength_nm, float) ** -3.33


def pheomelanin(wavelength_nm):
    """Absorption of a pheomelanin melanosome, 1/mm (Donner & Jensen 2006).

    >>> round(float(pheomelanin(450.0)), 2)
    72.38
    """
    return 2.9e14 * np.asarray(wavelength_nm, float) ** -4.75


@cache
def _prahl() -> np.ndarray:
    path = files("lutgen.skin") / "hemoglobin_prahl_1998.csv"
    rows = [line for line in path.read_text().splitlines() if line[:1].isdigit()]
    return np.array([[float(cell) for cell in row.split(",")] for row in rows]).T


def blood(wavelength_nm, oxygenation: np.ndarray | float = 0.7):
    """Absorption of whole blood, 1/mm, from tabulated molar extinctions (Prahl 1998, linear between 2 nm rows).

    >>> round(float(blood(450.0)), 3)
    40.139
    """
    nm, oxy, deoxy = _prahl()
    w = np.asarray(wavelength_nm, float)
    return BLOOD_FACTOR * (oxygenation * np.interp(w, nm, oxy) + (1 - oxygenation) * np.interp(w, nm, deoxy))


def epidermis(wavelength_nm, melanin, eumelanin_ratio):
    """Absorption of the epidermis, 1/mm: melanosome fraction over baseline (Jacques 1998, Donner & Jensen 2006).

    >>> round(float(epidermis(450.0, 0.013, 0.7)), 5)
    1.28041
    """
    pigment = eumelanin_ratio * eumelanin(wavelength_nm) + (1 - eumelanin_ratio) * pheomelanin(wavelength_nm)
    return melanin * pigment + (1 - melanin) * baseline(wavelength_nm)


def dermis(wavelength_nm, hemoglobin, oxygenation: np.ndarray | float = 0.7):
    """Absorption of the dermis, 1/mm: blood volume fraction over baseline (Jacques 1998).

    >>> round(float(dermis(450.0, 0.005)), 5)
    0.32201
    """
    return hemoglobin * blood(wavelength_nm, oxygenation) + (1 - hemoglobin) * baseline(wavelength_nm)


def epidermis_range(wavelength_nm) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest epidermis absorption, 1/mm, over every allowed melanin and eumelanin.

    >>> [round(float(v), 3) for v in epidermis_range(600.0)]
    [0.053, 18.521]
    """
    corners = [epidermis(wavelength_nm, m, e) for m in MELANIN for e in EUMELANIN]
    return np.min(corners, axis=0), np.max(corners, axis=0)


def dermis_range(wavelength_nm) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest dermis absorption, 1/mm, over every allowed hemoglobin and oxygenation.

    >>> [round(float(v), 3) for v in dermis_range(600.0)]
    [0.036, 0.817]
    """
    corners = [dermis(wavelength_nm, h, s) for h in HEMOGLOBIN for s in OXYGENATION]
    return np.min(corners, axis=0), np.max(corners, axis=0)
