"""Painted color to pigment: which melanin and hemoglobin a color LUT would need for each texel of an albedo.

*Balance*: one gain per channel, for paint is seldom white-balanced (white_balance.py). *Solution*: the skin nearest to
each texel's color (skin_colors.py). *Blotches*: dark skin hardly shows its blood, so noise would become blotches. The
albedo's low frequencies are therefore solved first, and each texel is held to that solution as strongly as the color
alone says little. What is left in the low frequencies is mostly baked light; ratio maps may keep only a share of it.

Eumelanin is one number: three unknowns fit any three channels, but texel by texel it only flips between its ends.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lutgen import color
from lutgen.errors import InputError, in_range, numbers
from lutgen.files import texture_maps
from lutgen.fitting import skin_colors, white_balance
from lutgen.fitting.skin_colors import Surface
from lutgen.tables.lut_set import LutSet

LOW_KEPT = (0.2, 0.55)
"""Share of the low frequencies of log melanin and log hemoglobin that ratio maps keep."""
RATIO = (0.1, 8.0)
UNPAINTED = 1e-3
"""Mean of R, G and B up to which a texel is background where no alpha says."""
_CELLS = 32
"""Cells along each side of what is called low frequencies; with fewer, patches of baked light show on dark skin."""


@dataclass(frozen=True)
class Inversion:
    """`melanin` and `hemoglobin` [R, C]; `residual` [R, C]: the CIEDE2000 difference that is left; `at_edge` [R, C]:
    where either stands at an end of its axis; `painted` [R, C]: what is no background. `gain` [3]: what the linear sRGB
    albedo was multiplied with. `eumelanin`: as given or fitted."""

    melanin: np.ndarray
    hemoglobin: np.ndarray
    residual: np.ndarray
    at_edge: np.ndarray
    painted: np.ndarray
    gain: np.ndarray
    eumelanin: float

    @cached_property
    def skin(self) -> tuple[float, float, float]:
        """Median melanin, the eumelanin, median hemoglobin: what a slider must stand at to show the painted tone."""
        melanin, hemoglobin = (float(np.median(v[self.painted])) for v in (self.melanin, self.hemoglobin))
        return melanin, self.eumelanin, hemoglobin


def invert(
    luts: LutSet, albedo, eumelanin: float | None = None, gain=None, painted: np.ndarray | None = None
) -> Inversion:
    """Melanin and hemoglobin of an albedo [R, C, 3] in linear sRGB.

    What is not `painted` [R, C], or black, is background. Without `eumelanin` or `gain` [3] they are fitted. Raises
    InputError for another shape, NaN, negative values, or an albedo that is black throughout.

    >>> import lutgen
    >>> luts = lutgen.load()
    >>> found = invert(luts, luts.color(np.full((4, 4), 0.05), 0.7, 0.02), eumelanin=0.7)
    >>> [round(v, 3) for v in found.skin]
    [0.05, 0.7, 0.02]
    """
    albedo, painted = checked(albedo, painted)
    colors = albedo[painted]
    if gain is None or eumelanin is None:
        start = np.ones(3) if gain is None else np.asarray(gain, float)
        fit = white_balance.fitted(
            luts, colors, ratios_of(luts, eumelanin), start, "both" if gain is None else "nothing"
        )
        gain, eumelanin = fit.gain, fit.eumelanin
    eumelanin = ratios_of(luts, eumelanin)[0]
    gain = np.asarray(gain, float)
    surface = skin_colors.of(luts, eumelanin)
    low = _low(albedo, painted)
    low_positions = skin_colors.nearest(surface, skin_colors.coded(low.reshape(-1, 3) * gain)).reshape(
        2, *low.shape[:2]
    )
    size = painted.shape
    hold = np.stack([texture_maps.resized(layer, *size)[painted] for layer in low_positions]).astype("f4")
    wanted = np.empty((3, len(colors)), "f4")
    scale = gain.astype("f4")

    def _code(part: slice) -> None:
        wanted[:, part] = skin_colors.coded(colors[part] * scale)

    skin_colors.in_chunks(_code, len(colors))
    positions = skin_colors.nearest(surface, wanted, hold)
    melanin, hemoglobin = surface.values(positions)
    ends = [
        (p <= 0) | (p >= last) if last else np.zeros(p.shape, bool)
        for p, last in zip(positions, surface.most, strict=True)
    ]
    return Inversion(
        _laid_out(painted, melanin, np.median(melanin)), _laid_out(painted, hemoglobin, np.median(hemoglobin)),
        _laid_out(painted, _difference(surface, wanted, positions), 0), _laid_out(painted, ends[0] | ends[1], False),
        painted, gain, eumelanin,
    )  # fmt: skip


def checked(albedo, painted: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """An albedo [R, C, 3] and what is painted of it [R, C]; InputError where it cannot be inverted."""
    albedo = albedo if isinstance(albedo, np.ndarray) and albedo.dtype == np.float32 else numbers("albedo", albedo)
    if albedo.ndim != 3 or albedo.shape[-1] != 3 or not albedo.size:
        raise InputError(f"albedo has shape {albedo.shape}: rows, columns and R, G, B are needed")
    if not np.all(np.isfinite(albedo)) or albedo.min() < 0:
        raise InputError("albedo holds NaN, infinite or negative values; mend it")
    bright = albedo[..., 0] + albedo[..., 1] + albedo[..., 2] > 3 * UNPAINTED
    painted = bright if painted is None else bright & painted
    if not painted.any():
        raise InputError("albedo is black throughout: there is no skin to invert")
    return albedo, painted


def ratios_of(luts: LutSet, eumelanin: float | None) -> list[float]:
    """The eumelanin ratios that come into question: the given one, or the LUT's nodes and the presets'."""
    axis = luts.color_lut.grid.eumelanin
    if eumelanin is not None:
        return [in_range("eumelanin", eumelanin, axis.low, axis.high)]
    usual = [white_balance.EUMELANIN] if axis.low < white_balance.EUMELANIN < axis.high else []
    return sorted({*(float(v) for v in axis.values), *usual})


def ratios(
    inversion: Inversion, low_kept: tuple[float, float] = LOW_KEPT, most: tuple[float, float] = RATIO
) -> np.ndarray:
    """Ratio maps [R, C, 3] of melanin, eumelanin (1) and hemoglobin as `texture_maps.Maps.chromophores` holds them.

    Median 1 each, so that the sliders set the tone; background is 1.
    """
    layers = []
    for values, share in zip((inversion.melanin, inversion.hemoglobin), low_kept, strict=True):
        log = np.log(values)
        if share < 1:
            low = _low(log[..., None], inversion.painted)[..., 0]
            log = log - (1 - share) * texture_maps.resized(low, *log.shape)
        ratio = np.exp(log - np.median(log[inversion.painted]))
        layers.append(np.where(inversion.painted, np.clip(ratio, *most), 1.0))
    return np.stack([layers[0], np.ones_like(layers[0]), layers[1]], axis=-1)


def _laid_out(painted: np.ndarray, values: np.ndarray, background) -> np.ndarray:
    if painted.all():
        return values.reshape(painted.shape)
    whole = np.full(painted.shape, background, values.dtype)
    whole[painted] = values
    return whole


def _difference(surface: Surface, wanted: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """CIEDE2000 differences [N] of colors [3, N] from the skins at positions [2, N]."""
    difference, offset = np.empty(wanted.shape[1], "f4"), np.array([16, 0, 0], "f4")

    def _compare(part: slice) -> None:
        shown = surface.coded(positions[:, part])
        difference[part] = color.delta_e00(shown.T - offset, wanted[:, part].T - offset)

    skin_colors.in_chunks(_compare, len(difference))
    return difference


def _low(values: np.ndarray, painted: np.ndarray) -> np.ndarray:
    """Low frequencies [32, 32, channels] of a picture [R, C, channels]: means of what is painted, else of all."""
    rows, columns = (min(n, _CELLS) for n in painted.shape)
    down, across = (np.arange(n) * k // n for n, k in zip(painted.shape, (rows, columns), strict=True))
    cell = (down[:, None] * columns + across)[painted]
    count = np.bincount(cell, minlength=rows * columns)
    inside = values[painted]
    sums = np.stack([np.bincount(cell, v, rows * columns) for v in inside.T], axis=1)
    whole = np.where(count[:, None] > 0, sums / np.maximum(count, 1)[:, None], inside.mean(axis=0))
    return whole.reshape(rows, columns, -1)
