"""What lies under the cursor: the skin's chromophores, its reflectance spectrum and its diffuse profile."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lutgen.scene.look import Look
from lutgen.solvers.profiles import Profile
from lutgen.tables import expand

from ..stage import SAMPLES, Stage, side


@dataclass(frozen=True)
class Picked:
    """A skin of the picture: chromophores, thickness under it in mm (32: at least), diffuse linear sRGB [3],
    reflectance [K] at the traced wavelengths [K], and the profile of its color, all at the look's oxygenation."""

    melanin: float
    eumelanin: float
    hemoglobin: float
    thickness_mm: float
    linear_srgb: np.ndarray
    wavelength_nm: np.ndarray
    reflectance: np.ndarray
    profile: Profile


def pick(stage: Stage, look: Look, x: int, y: int) -> Picked | None:
    """The skin at pixel x, y of the picture that was drawn last (0, 0 is its top left); None where there is none."""
    width, height = stage.size
    if not (0 <= x < width and 0 <= y < height):
        return None
    place = x * SAMPLES, (height - 1 - y) * SAMPLES, 1, 1
    raw = stage.targets["surface_buffer"].read(viewport=place, components=4, attachment=2, dtype="f4")
    *skin, thickness_mm = (float(v) for v in np.frombuffer(raw, "f4"))
    right = look.split != "none" and x >= width // 2
    luts = side(stage, look.split if right else "none").shown
    if skin[0] <= 0:
        return None
    grid = luts.color_lut.grid
    axes = grid.axes[::-1]
    m, e, h = (float(np.clip(v, a.low, a.high)) for v, a in zip(skin, axes, strict=True))
    columns = [np.array([v]) for v in (m, e, h)]
    mu = expand.coefficients(luts.paths.wavelength_nm, luts.absorbers, *columns)
    reflectance = luts.totals.evaluate(*mu)[:, 0, 0]
    return Picked(
        m, e, h, thickness_mm, luts.color(m, e, h), luts.paths.wavelength_nm, reflectance, luts.profile(m, e, h)
    )
