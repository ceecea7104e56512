"""Skin parameters, chromophores and tissue, and the layers that they stand for at one wavelength."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from types import MappingProxyType

import numpy as np

from lutgen.errors import InputError, in_range, one_of, shown, summary
from lutgen.skin import chromophores

LAWS = ("source", "bashkatov", "jacques", "saidi", "donner")
READINGS = ("reduced", "similarity", "literal")
REFRACTIVE_INDEX = 1.4
"""The default; what depends on it takes the index of its tissue, medium or layer."""
EPIDERMIS_MM = (0.001, 0.5)

_LAYER_RANGES = {
    "thickness_mm": (0, np.inf), "mu_a_per_mm": (0, 1e6), "mu_s_per_mm": (0, 1e6), "g": (-0.9999, 0.9999), "n": (1, 3),
}  # fmt: skip
TISSUE_RANGES = {
    "oxygenation": chromophores.OXYGENATION, "epidermis_mm": EPIDERMIS_MM,
    "saidi_a_per_mm": (0, 100), "saidi_b_nm4_per_mm": (0, 1e13), "refractive_index": _LAYER_RANGES["n"],
}  # fmt: skip
SKIN_RANGES = chromophores.RANGES | TISSUE_RANGES


def _hold_ranges(record: object, ranges: dict[str, tuple[float, float]]) -> None:
    """Make the fields of a frozen dataclass floats; InputError for one outside its range."""
    for name, (low, high) in ranges.items():
        object.__setattr__(record, name, in_range(name, getattr(record, name), low, high))


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
        _hold_ranges(self, _LAYER_RANGES)


@dataclass(frozen=True)
class Chromophores:
    """What absorbs differently from skin to skin, and what the axes of a LUT span.

    Volume shares of melanosomes in the epidermis and of blood in the dermis; `eumelanin` is the share of melanosomes
    that hold it, the others hold pheomelanin. Raises InputError outside the allowed ranges.

    >>> Chromophores(0.0195, 0.7, 0.0088).hemoglobin
    0.0088
    """

    melanin: float
    eumelanin: float
    hemoglobin: float

    def __post_init__(self):
        _hold_ranges(self, chromophores.RANGES)


@dataclass(frozen=True)
class Tissue:
    """All else of two-layer skin, which a bake fixes: oxygenation of the blood, thickness of the epidermis in mm,
    scattering, refractive index.

    `scattering` names the law of reduced scattering, `reading` what the law's value means (lutgen/skin/README.md,
    Readings: `reduced` is mu_s (1 - g) with Henyey-Greenstein g; `similarity` the same value with isotropic scattering;
    `literal` takes it for mu_s itself). `saidi_*` are the fitted values of Saidi's law. Raises InputError outside the
    allowed ranges.

    >>> Tissue(epidermis_mm=0.06).oxygenation
    0.7
    """

    oxygenation: float = 0.7
    epidermis_mm: float = 0.1
    scattering: str = "source"
    reading: str = "reduced"
    saidi_a_per_mm: float = 5.7
    saidi_b_nm4_per_mm: float = 8.4e10
    refractive_index: float = REFRACTIVE_INDEX

    __repr__ = summary

    def __post_init__(self):
        _hold_ranges(self, TISSUE_RANGES)
        one_of("scattering", self.scattering, LAWS)
        one_of("reading", self.reading, READINGS)
        if self.scattering == "saidi" and self.saidi_a_per_mm < 0.01 and self.saidi_b_nm4_per_mm < 1e9:
            raise InputError(
                f"saidi_a_per_mm = {self.saidi_a_per_mm:g} with saidi_b_nm4_per_mm = {self.saidi_b_nm4_per_mm:g}: skin "
                "that hardly scatters; allowed is A of at least 0.01 or B of at least 1e9"
            )


@dataclass(frozen=True)
class Skin(Tissue, Chromophores):
    """Two-layer skin: its chromophores and its tissue. Raises InputError outside the allowed ranges.

    >>> Skin(0.0195, 0.7, 0.0088).oxygenation
    0.7
    >>> skin_of(preset("dark").chromophores, Tissue(epidermis_mm=0.06)).melanin
    0.158
    """

    __repr__ = summary

    def __post_init__(self):
        Chromophores.__post_init__(self)
        Tissue.__post_init__(self)

    @property
    def chromophores(self) -> Chromophores:
        """What a LUT's axes span of it."""
        return Chromophores(*(getattr(self, name) for name in chromophores.NAMES))

    @property
    def tissue(self) -> Tissue:
        """What a bake fixes of it."""
        return Tissue(**{name: value for name, value in vars(self).items() if name not in chromophores.NAMES})


def skin_of(chromophores: Chromophores, tissue: Tissue) -> Skin:
    """The skin with these chromophores in that tissue.

    >>> skin_of(Chromophores(0.158, 0.7, 0.018), Tissue()) == preset("dark")
    True
    """
    return Skin(**asdict(chromophores), **asdict(tissue))


def plain(values: Tissue) -> dict:
    """A tissue's or a skin's fields as files and JSON hold them: the refractive index only where it is not 1.4.

    >>> plain(preset("dark"))["melanin"], "refractive_index" in plain(preset("dark"))
    (0.158, False)
    """
    fields = asdict(values)
    if values.refractive_index == REFRACTIVE_INDEX:
        del fields["refractive_index"]
    return fields


def specular(refractive_index: float) -> float:
    """Share of light along the normal that a smooth surface against air reflects (Fresnel).

    >>> round(specular(1.4), 6)
    0.027778
    """
    return ((refractive_index - 1) / (refractive_index + 1)) ** 2


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


def reduced_scattering(tissue: Tissue, wavelength_nm) -> np.ndarray:
    """Reduced scattering of the epidermis, 1/mm, by the tissue's law (the dermis has the same but for `donner`).

    >>> round(float(reduced_scattering(Tissue(), 450.0)), 4)
    9.2091
    """
    if tissue.scattering == "saidi":
        return chromophores.scattering_saidi(wavelength_nm, tissue.saidi_a_per_mm, tissue.saidi_b_nm4_per_mm)
    law = "source" if tissue.scattering == "donner" else tissue.scattering
    return getattr(chromophores, f"scattering_{law}")(wavelength_nm)


def scattering(tissue: Tissue, wavelength_nm) -> tuple[np.ndarray, np.ndarray]:
    """Scattering coefficient, 1/mm, and anisotropy of the epidermis, by the tissue's law and reading.

    >>> [round(float(v), 4) for v in scattering(Tissue(), 450.0)]
    [36.9102, 0.7505]
    """
    mu_s, g = reduced_scattering(tissue, wavelength_nm), chromophores.anisotropy(wavelength_nm)
    if tissue.reading == "reduced":
        return mu_s / (1 - g), g
    return mu_s, np.zeros_like(g) if tissue.reading == "similarity" else g


def dermis_scattering(tissue: Tissue, mu_s_per_mm):
    """Scattering coefficient of the dermis, 1/mm, under an epidermis of that coefficient.

    >>> dermis_scattering(Tissue(scattering="donner"), 30.0)
    15.0
    """
    return mu_s_per_mm / 2 if tissue.scattering == "donner" else mu_s_per_mm


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
    n = skin.refractive_index
    return [Layer(skin.epidermis_mm, mu_e, mu_s, g, n), Layer(np.inf, mu_d, dermis_scattering(skin, mu_s), g, n)]


def require_one_scatterer(tissue: Tissue) -> None:
    """Raise InputError when the layers scatter differently, which a path table cannot represent."""
    if tissue.scattering == "donner":
        raise InputError(
            "scattering = 'donner': its layers scatter differently, which path tables cannot represent; "
            f"use method adding-doubling, or one of {', '.join(LAWS[:-1])}"
        )
