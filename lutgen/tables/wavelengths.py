"""Which wavelengths a bake traces, and the weights that carry a spectrum there to XYZ; NumPy only.

Skin spectra are smooth mixtures of few pigments, so eight well chosen wavelengths integrate them as well as eighty.
make_wavelengths.py beside this file chooses them and measures how well; both color pipelines share the wavelengths.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np

from lutgen import color
from lutgen.errors import one_of, summary

NAMES = ("6", "8", "12", "10nm", "5nm")


@dataclass(frozen=True)
class Quadrature:
    """Wavelengths in nm [K] and XYZ weights [K, 3]: XYZ under D65 is `reflectance @ xyz_weights`.

    Errors against every 5 nm, each (p95, maximum) over random skins at the default setting: `color_error` in
    CIEDE2000, `profile_error` as the largest difference of encircled energy beyond 0.01 mm in any ACEScg channel.
    """

    name: str
    wavelength_nm: np.ndarray
    xyz_weights: np.ndarray
    color_error: tuple[float, float]
    profile_error: tuple[float, float]

    __repr__ = summary


def load(name: str, pipeline: str = "default") -> Quadrature:
    """The rule of that name: few fitted wavelengths (`6`, `8`, `12`) or a regular grid (`10nm`, `5nm`).

    Weights are non-negative. Raises InputError for an unknown name or color pipeline.

    >>> rule = load("8")
    >>> rule.xyz_weights.shape, [round(float(v), 2) for v in rule.xyz_weights.sum(axis=0)]
    ((8, 3), [0.95, 1.0, 1.09])
    """
    one_of("wavelengths", name, NAMES)
    one_of("pipeline", pipeline, color.PIPELINES)
    errors, rules = _file()
    if name.endswith("nm"):
        nm, weights = color.xyz_weights(int(name[:-2]), pipeline)
    else:
        first = 1 + 3 * color.PIPELINES.index(pipeline)
        nm, weights = rules[name][:, 0].copy(), rules[name][:, first : first + 3].copy()
    return Quadrature(name, nm, weights, errors["color", name, pipeline], errors["profile", name, pipeline])


@cache
def _file() -> tuple[dict[tuple[str, str, str], tuple[float, float]], dict[str, np.ndarray]]:
    """Errors at the default setting by (kind, rule, pipeline), and wavelengths with all weights by rule."""
    errors, rows = {}, {}
    for line in (files("lutgen.tables") / "quadrature.csv").read_text().splitlines():
        cells = line.removeprefix("# ").split(",")
        if cells[0] in ("color", "profile") and cells[3] == "default":
            errors[cells[0], cells[1], cells[2]] = float(cells[4]), float(cells[5])
        elif cells[0] in NAMES:
            rows.setdefault(cells[0], []).append([float(cell) for cell in cells[1:]])
    return errors, {name: np.array(values) for name, values in rows.items()}
