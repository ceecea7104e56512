"""Path table -> color and profile cells of a whole grid, by matrix products; NumPy only."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from lutgen.color import ACESCG_FROM_XYZ
from lutgen.errors import InputError, numbers, shown, summary
from lutgen.skin import chromophores
from lutgen.solvers.paths import PathTable
from lutgen.tables.axes import Grid

ExtraAbsorbers = Mapping[str, "float | np.ndarray | Callable[[np.ndarray], np.ndarray]"]


@dataclass(frozen=True)
class Absorbers:
    """What absorbs besides the three LUT axes: oxygenation of the blood, and extra coefficients [K] per layer, 1/mm."""

    oxygenation: float
    epidermis: np.ndarray
    dermis: np.ndarray

    __repr__ = summary


def absorbers(wavelength_nm: np.ndarray, oxygenation: float, extra: ExtraAbsorbers | None = None) -> Absorbers:
    """Absorbers at wavelengths [K]; `extra` maps a layer to 1/mm: a number, an array [K] or a function of nm."""
    added = {"epidermis": np.zeros(len(wavelength_nm)), "dermis": np.zeros(len(wavelength_nm))}
    if not isinstance(extra or {}, Mapping):
        raise InputError(f"extra_absorbers = {shown(extra)}: a mapping of epidermis or dermis to 1/mm is needed")
    for layer, value in (extra or {}).items():
        if layer not in added:
            raise InputError(f"extra_absorbers: unknown layer {layer!r}: allowed is epidermis, dermis")
        values = numbers(f"extra_absorbers[{layer!r}]", value(wavelength_nm) if callable(value) else value)
        if values.shape not in ((), wavelength_nm.shape) or not np.all(np.isfinite(values)) or np.any(values < 0):
            raise InputError(
                f"extra_absorbers[{layer!r}] = {values}: finite coefficients of 0 or more in 1/mm are needed, "
                f"one or one per wavelength ({len(wavelength_nm)})"
            )
        added[layer] = added[layer] + values
    return Absorbers(oxygenation, **added)


def epidermis_coefficients(wavelength_nm: np.ndarray, absorb: Absorbers, melanin, eumelanin) -> np.ndarray:
    """Absorption of the epidermis [K, P] in 1/mm, of P skins (chromophore arrays [P])."""
    own = chromophores.epidermis(wavelength_nm[:, None], np.asarray(melanin), np.asarray(eumelanin))
    return own + absorb.epidermis[:, None]


def dermis_coefficients(wavelength_nm: np.ndarray, absorb: Absorbers, hemoglobin) -> np.ndarray:
    """Absorption of the dermis [K, P] in 1/mm, of P skins (hemoglobin [P])."""
    own = chromophores.dermis(wavelength_nm[:, None], np.asarray(hemoglobin), absorb.oxygenation)
    return own + absorb.dermis[:, None]


def coefficients(
    wavelength_nm: np.ndarray, absorb: Absorbers, melanin, eumelanin, hemoglobin
) -> tuple[np.ndarray, np.ndarray]:
    """Absorption of epidermis and dermis, each [K, P] in 1/mm, of P skins (chromophore arrays [P])."""
    return (
        epidermis_coefficients(wavelength_nm, absorb, melanin, eumelanin),
        dermis_coefficients(wavelength_nm, absorb, hemoglobin),
    )


def rgb_weights(xyz_weights: np.ndarray) -> np.ndarray:
    """ACEScg weights [K, 3] of XYZ weights [K, 3]."""
    return xyz_weights @ ACESCG_FROM_XYZ.T


def cells(paths: PathTable, grid: Grid, absorb: Absorbers, weights: np.ndarray) -> np.ndarray:
    """ACEScg energy [N_h, N_e, N_m, B, 3] of every node, per ring of the table."""
    m, e = np.meshgrid(grid.melanin.values, grid.eumelanin.values)
    mu_e = epidermis_coefficients(paths.wavelength_nm, absorb, m.ravel(), e.ravel())
    mu_d = dermis_coefficients(paths.wavelength_nm, absorb, grid.hemoglobin.values)
    energy = paths.grid(mu_e, mu_d, weights)
    return energy.reshape(*grid.shape, *energy.shape[2:])


def color_cells(totals: PathTable, grid: Grid, absorb: Absorbers, weights: np.ndarray) -> np.ndarray:
    """Color LUT [N_h, N_e, N_m, 3]: linear ACEScg, unclipped; `totals` is the path table with its rings joined."""
    return cells(totals, grid, absorb, weights)[..., 0, :]


def profile_cells(
    paths: PathTable, grid: Grid, absorb: Absorbers, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Normalized profile shapes [N_h, N_e, N_m, B, 3] and the negative share clamped off each [N_h, N_e, N_m, 3].

    Far from the entry skin light is nearly pure red, just outside even AP1: such rings are set to 0 and the rest
    scaled to sum to 1; the share is what was set to 0 relative to what is left.
    """
    return normalized(cells(paths, grid, absorb, weights))


def normalized(energy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Non-negative shapes [..., B, 3] that sum to 1 per channel, and the clamped share [..., 3]."""
    kept = np.maximum(energy, 0)
    ones = np.ones(energy.shape[-2])  # as a product these sums are five times faster
    total = ones @ kept
    kept /= total[..., None, :]
    return kept, np.maximum(1 - (ones @ energy) / total, 0)
