"""One skin by its parameters, as swatch and fit take it."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from dataclasses import replace

from lutgen.errors import InputError
from lutgen.skin.tissue import LAWS, READINGS, SKIN_RANGES, Skin

_MEANINGS = {
    "melanin": "share of the epidermis that is melanosomes",
    "eumelanin": "share of the melanin that is eumelanin",
    "hemoglobin": "share of the dermis that is blood",
    "oxygenation": "share of the hemoglobin that carries oxygen",
    "epidermis_mm": "thickness of the epidermis in mm",
    "scattering": "law of reduced scattering",
    "reading": "what the law's value means: μs (1 − g), the same with isotropic scattering, or μs itself",
    "saidi_a_per_mm": "A of Saidi's law in 1/mm",
    "saidi_b_nm4_per_mm": "B of Saidi's law in nm⁴/mm",
}
_CHOICES = {"scattering": LAWS, "reading": READINGS}
FIELDS = tuple(_MEANINGS)


def arguments(parser: ArgumentParser, base: Skin, default: str = "{}", **defaults: str) -> None:
    """Add an option for each parameter of a skin.

    What stands for a parameter that is not given is told by `defaults`, else by `default` around `base`'s value.
    """
    for name, meaning in _MEANINGS.items():
        option, value = f"--{name.replace('_', '-')}", getattr(base, name)
        text = defaults.get(name) or default.format(f"{value:g}" if isinstance(value, float) else value)
        if name in _CHOICES:
            parser.add_argument(option, choices=_CHOICES[name], help=f"{meaning} (default: {text})")
        else:
            low, high = SKIN_RANGES[name]
            parser.add_argument(option, type=float, help=f"{meaning}, {low:g} to {high:g} (default: {text})")


def parameters(options: Namespace) -> dict:
    """Parameters of a skin that stand on the command line."""
    return {name: getattr(options, name) for name in FIELDS if getattr(options, name) is not None}


def changed(base: Skin, values: dict) -> Skin:
    """The skin with those parameters; InputError for values of Saidi's law under another one."""
    skin = replace(base, **values)
    if skin.scattering != "saidi" and {"saidi_a_per_mm", "saidi_b_nm4_per_mm"} & set(values):
        raise InputError(f"saidi_*: scattering is {skin.scattering}, which has no such values; add --scattering saidi")
    return skin
