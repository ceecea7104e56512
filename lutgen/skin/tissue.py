"""Skin parameters and the layers they stand for at one wavelength."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from lutgen.errors import InputError, in_range, one_of, shown
from lutgen.skin import chromophores

LAWS = ("source", "bashkatov", "jacques", "saidi", "donner")
READINGS = ("reduced", "similarity", "literal")
REFRACTIVE_INDEX = 1.4
EPIDERMIS_MM = (0.001, 0.5)

_LAYER_RANGES = {
    "thickness_mm": (0, np.inf), "mu_a_per_mm": (0, 1e6), "mu_s_per_mm": (0, 1e6), "g": (-0.9999, 0.9999), "n": (1, 3),
}  # fmt: skip
SKIN_RANGES = {
    "melanin": chromophores.MELANIN, "eumelanin": chromophores.EUMELANIN, "hemoglobin": chromophores.HEMOGLOBIN,
    "oxygenation": chromophores.OXYGENATION, "epidermis_mm": EPIDERMIS_MM,
    "saidi_a_per_mm": (0, 100), "saidi_b_nm4_per_mm": (0, 1e13),
}  # fmt: skip


@dataclass(frozen=True)
class Layer:
    """One slab of tissue: thickness in mm (`inf` for the last), absorption and scattering in 1/mm, anisotropy, index.

    >>> Layer(0.1, mu_a_per_mm=1.28, mu_s_per_mm=36.9, g=0.75, n=1.4).g
    0.75
    """

    thickness_mm: float
    mu_a_per_mm: float
    mu_s_per_mm: float
    g: float
    n: float = REFRACTIVE_INDEX

    def __post_init__(self):
        for name, (low, high) in _LAYER_RANGES.items():
            object.__setattr__(self, name, in_range(name, getattr(self, name), low, high))


@dataclass(frozen=True)
class Skin:
    """Two-layer skin: fractions of melanosomes, eumelanin and blood; oxygenation; epidermis thickness in mm.

    `scattering` names the law of reduced scattering, `reading` what the law's value means (lutgen/skin/README.md,
    Readings: `reduced` is mu_s (1 - g) with Henyey-Greenstein g; `similarity` the same value with isotropic scattering;
    `literal` takes it for mu_s itself). `saidi_*` are the fitted values of Saidi's law. Raises InputError outside the
    allowed ranges.

    >>> Skin(0.0195, 0.7, 0.0088).oxygenation
    0.7
    """

    melanin: float
    eumelanin: float
    hemoglobin: float
    oxygenation: float = 0.7
    epidermis_mm: float = 0.1
    scattering: str = "source"
    reading: str = "reduced"
    saidi_a_per_mm: float = 5.7
    saidi_b_nm4_per_mm: float = 8.4e10

    def __post_init__(self):
        for name, (low, high) in SKIN_RANGES.items():
            object.__setattr__(self, name, in_range(name, getattr(self, name), low, high))
        one_of("scattering", self.scattering, LAWS)
        one_of("reading", self.reading, READINGS)
        if self.scattering == "saidi" and self.saidi_a_per_mm < 0.01 and self.saidi_b_nm4_per_mm < 1e9:
            raise InputError(
                f"saidi_a_per_mm = {self.saidi_a_per_mm:g} with saidi_b_nm4_per_mm = {self.saidi_b_nm4_per_mm:g}: skin "
                "that hardly scatters; allowed is A of at least 0.01 or B of at least 1e9"
            )


PRESETS = MappingProxyType(
    {
        # Two parameters fitted to the mean spectra of six ITA classes (after Lu et al. 2025, ISSA archive).
        "very-light": Skin(0.0127, 0.7, 0.0077),
        "light": Skin(0.0195, 0.7, 0.0088),
        "intermediate": Skin(0.0292, 0.7, 0.0093),
        "tan": Skin(0.0439, 0.7, 0.0093),
        "brown": Skin(0.0734, 0.7, 0.0101),
        "dark": Skin(0.158, 0.7, 0.018),
        # The three types of Zhang, Human face rendering, far from measured skin of those names.
        "source-caucasian": Skin(0.013, 0.7, 0.005),
        "source-asian": Skin(0.16, 0.0, 0.01),
        "source-african": Skin(0.43, 0.7, 0.01),
    }
)


def preset(name: str) -> Skin:
    """Return the preset skin of that name; raises InputError that lists the names.

    >>> preset("dark").melanin
    0.158
    """
    return PRESETS[one_of("preset", name, tuple(PRESETS))]


def reduced_scattering(skin: Skin, wavelength_nm) -> np.ndarray:
    """Reduced scattering of the skin's epidermis, 1/mm, by its law (the dermis has the same but for `donner`).

    >>> round(float(reduced_scattering(preset("light"), 450.0)), 4)
    9.2091
    """
    if skin.scattering == "saidi":
        return chromophores.scattering_saidi(wavelength_nm, skin.saidi_a_per_mm, skin.saidi_b_nm4_per_mm)
    law = "source" if skin.scattering == "donner" else skin.scattering
    return getattr(chromophores, f"scattering_{law}")(wavelength_nm)


def scattering(skin: Skin, wavelength_nm) -> tuple[np.ndarray, np.ndarray]:
    """Scattering coefficient, 1/mm, and anisotropy of the epidermis, by the skin's law and reading.

    >>> [round(float(v), 4) for v in scattering(preset("light"), 450.0)]
    [36.9102, 0.7505]
    """
    mu_s, g = reduced_scattering(skin, wavelength_nm), chromophores.anisotropy(wavelength_nm)
    if skin.reading == "reduced":
        return mu_s / (1 - g), g
    return mu_s, np.zeros_like(g) if skin.reading == "similarity" else g


def layers(skin: Skin, wavelength_nm: float) -> list[Layer]:
    """Epidermis and semi-infinite dermis of a skin at one wavelength in nm.

    >>> [round(layer.mu_a_per_mm, 4) for layer in layers(Skin(0.013, 0.7, 0.005), 450)]
    [1.2804, 0.322]
    """
    if not isinstance(skin, Skin):
        raise InputError(f"skin = {shown(skin)}: a lutgen.Skin is needed; lutgen.preset(name) gives one")
    wavelength_nm = in_range("wavelength_nm", wavelength_nm, *chromophores.WAVELENGTH_NM)
    mu_s, g = (float(v) for v in scattering(skin, wavelength_nm))
    mu_e = float(chromophores.epidermis(wavelength_nm, skin.melanin, skin.eumelanin))
    mu_d = float(chromophores.dermis(wavelength_nm, skin.hemoglobin, skin.oxygenation))
    mu_s_dermis = mu_s / 2 if skin.scattering == "donner" else mu_s
    return [Layer(skin.epidermis_mm, mu_e, mu_s, g), Layer(float("inf"), mu_d, mu_s_dermis, g)]


def require_one_scatterer(skin: Skin) -> None:
    """Raise InputError when the layers scatter differently, which a path table cannot represent."""
    if skin.scattering == "donner":
        raise InputError(
            "scattering = 'donner': its layers scatter differently, which path tables cannot represent; "
            f"use method adding-doubling, or one of {', '.join(LAWS[:-1])}"
        )
