"""lutgen: precomputed lookup tables for real-time skin shading, from one Monte Carlo trace per wavelength.

Names load on first use: `lutgen.load` and what it returns never import OpenCL.
"""

from __future__ import annotations

from importlib import import_module

TYPE_CHECKING = False  # what typing's is at run time, without 10 ms of imports before a command line is in charge
if TYPE_CHECKING:
    from pathlib import Path

    from lutgen.errors import InputError, MachineError
    from lutgen.fitting import Fit, fit
    from lutgen.skin.tissue import PRESETS, Layer, Skin, layers, preset
    from lutgen.solvers import linear_srgb, profile, reflectance, spectrum
    from lutgen.solvers.profiles import Profile, Reflectance
    from lutgen.tables.axes import Axis, Grid
    from lutgen.tables.bake import bake
    from lutgen.tables.lut_set import LutSet
    from lutgen.tables.recipe import Recipe
    from lutgen.tables.storage import save

_WHERE = {
    "errors": ("InputError", "MachineError"),
    "fitting": ("Fit", "fit"),
    "skin.tissue": ("PRESETS", "Layer", "Skin", "layers", "preset"),
    "solvers": ("linear_srgb", "profile", "reflectance", "spectrum"),
    "solvers.profiles": ("Profile", "Reflectance"),
    "tables.axes": ("Axis", "Grid"),
    "tables.bake": ("bake",),
    "tables.lut_set": ("LutSet",),
    "tables.recipe": ("Recipe",),
    "tables.storage": ("save",),
}
_MODULE_OF = {name: module for module, names in _WHERE.items() for name in names}

__all__ = [
    "PRESETS", "Axis", "Fit", "Grid", "InputError", "Layer", "LutSet", "MachineError", "Profile", "Recipe",
    "Reflectance", "Skin", "bake", "default_luts", "fit", "layers", "linear_srgb", "load", "preset", "profile",
    "reflectance", "save", "spectrum",
]  # fmt: skip


def __getattr__(name: str):
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'lutgen' has no attribute {name!r}")
    return getattr(import_module(f"lutgen.{_MODULE_OF[name]}"), name)


def default_luts() -> Path:
    """The folder of the default LUT set that comes with the package.

    >>> default_luts().name
    'default'
    """
    from pathlib import Path

    return Path(str(import_module("lutgen.luts").__file__)).parent / "default"


def load(path: str | Path | None = None) -> LutSet:
    """Load a LUT set from its folder (default: the one that comes with the package); InputError if it is not whole.

    >>> load().color(0.0195, 0.7, 0.0088).round(2).tolist()
    [0.46, 0.3, 0.2]
    """
    from lutgen.tables import storage

    return storage.load(default_luts() if path is None else path)
