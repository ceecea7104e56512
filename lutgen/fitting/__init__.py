"""Which skin a measured spectrum or color is: its chromophores, how sure they are, and what to beware of.

*Uncertainty*: each reflectance's noise carried through the linearized solution. Unless the noise is stated, each
residual stands for its own variance, which holds whether noise grows with reflectance or not; where neighboring
residuals are alike, the model's shape rather than noise is left, and they count as fewer.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from lutgen import color
from lutgen.errors import InputError, in_range, one_of, shown, summary
from lutgen.fitting import least_squares, measured, nearest
from lutgen.fitting.measured import Measured
from lutgen.fitting.nearest import CUBE_ROOT, PARAMETERS, Problem
from lutgen.skin.tissue import Skin, specular

BASE = Skin(0.02, 0.7, 0.01)
"""What has the parameters that are not fitted, where no other skin is given."""
OF_SPECTRUM, OF_COLOR = ("melanin", "hemoglobin", "oxygenation"), ("melanin", "hemoglobin")
"""What is fitted unless said otherwise; a color hardly shows its oxygenation."""
SKIN, NO_SKIN = 2.0, 10.0
"""Difference from the nearest skin up to which a measurement is one's, and from which it is refused (CIEDE2000, and
root mean square lightness of a spectrum): the Monk scale's ten tones lie up to 9.3 away, black 10.5, white 14."""
TRADE_OFF, UNSURE = 0.9, 0.3
"""Correlation from which two parameters trade off; sigma (relative for melanin and hemoglobin) that says little."""
SEEN_NM = (420.0, 680.0)
"""A spectrum that covers less is no fair picture of a color: beyond lie 1.2, 0.2 and 3.2 % of X, Y and Z."""
NOISE = {"spectrum": (1e-6, 0.1), "color": (1e-3, 20.0)}


@dataclass(frozen=True)
class Fit:
    """The skin nearest to a measurement and how sure that is.

    `parameters` and `sigma` by name (sigma None at a bound), `correlation` [P, P] in the same order (0 at a bound).
    `sigma` comes from the residual, or from the noise that was stated: of each reflectance, or of the color along
    each direction in units of CIEDE2000 (1 unless stated). `reflectance` [n] of the model at `wavelength_nm` [n]
    (the data's; for a color every 5 nm) and `xyz` [3], specular share included where the data have it. `rmse` is
    that of reflectance, None for a color. `notes`: what to know before using the figures.

    >>> import lutgen
    >>> lutgen.fit("#b89985").sigma["melanin"] > 0
    True
    """

    skin: Skin
    parameters: dict[str, float]
    sigma: dict[str, float | None]
    correlation: np.ndarray
    delta_e00: float
    rmse: float | None
    data: Measured
    wavelength_nm: np.ndarray
    reflectance: np.ndarray
    xyz: np.ndarray
    notes: tuple[str, ...]

    __repr__ = summary


def fit(
    data,
    parameters: Iterable[str] | None = None,
    base: Skin | None = None,
    specular_included: bool = False,
    noise: float | None = None,
) -> Fit:
    """The skin whose spectrum or color is nearest to what was measured, with uncertainties.

    `data`: the path of a CSV with columns wavelength_nm and reflectance; a color as `#rrggbb`, `srgb:r,g,b` (encoded),
    `linear:r,g,b`, `lab:L,a,b` or `xyz:X,Y,Z`; or (wavelengths in nm [n], reflectance [n]). `parameters`: of melanin,
    hemoglobin, oxygenation, eumelanin (default: the first three of a spectrum, two of a color); all else is `base`'s
    (default: oxygenation and eumelanin 0.7, epidermis 0.1 mm). `specular_included`: whether the surface's reflection
    is in the data. `noise`: standard deviation of each reflectance, or of the color (CIEDE2000).
    Raises InputError for what it cannot read, too few values, or what is 10 or more from any skin.

    >>> import lutgen
    >>> nm = [450.0, 500.0, 550.0, 600.0, 650.0]
    >>> found = lutgen.fit((nm, lutgen.spectrum(lutgen.preset("tan"), nm)))
    >>> round(found.skin.melanin, 4), round(found.skin.hemoglobin, 4), round(found.skin.oxygenation, 2)
    (0.0439, 0.0093, 0.7)
    """
    data = measured.read(data)
    base = BASE if base is None else base
    if not isinstance(base, Skin):
        raise InputError(f"base = {shown(base)}: a lutgen.Skin is needed; lutgen.preset(name) gives one")
    if noise is not None:
        noise = in_range("noise", noise, *NOISE["color" if data.reflectance is None else "spectrum"])
    names = _names(parameters, data, noise)
    task = nearest.problem(data, names, base, specular(base.refractive_index) if specular_included else 0.0)
    point = nearest.solve(task)
    values = {name: float(value[0]) for name, value in task.values(point[None]).items()}
    reflectance = task.spectra(point[None])[0]
    xyz = reflectance @ task.weights
    left = float(color.delta_e00(color.lab(xyz), task.lab))
    rmse = None if data.reflectance is None else float(np.sqrt(np.mean((reflectance - data.reflectance) ** 2)))
    far = _far(task, point, xyz, left)
    free = (point > task.low) & (point < task.high)
    spread, correlation, alike = _spread(task, point, free, noise)
    per_step = np.array([3 * np.cbrt(values[name]) ** 2 if name in CUBE_ROOT else 1.0 for name in names])
    sigma = {n: float(s) if inside else None for n, s, inside in zip(names, spread * per_step, free, strict=True)}
    notes = (*data.notes, *far, *_cautions(values, sigma, correlation), *_of_spectrum(data, alike))
    skin, nm = replace(base, **values), task.wavelength_nm
    return Fit(skin, values, sigma, correlation, left, rmse, data, nm, reflectance, xyz, notes)


def _names(parameters: Iterable[str] | None, data: Measured, noise: float | None) -> tuple[str, ...]:
    """The parameters to fit, in the order of PARAMETERS."""
    if parameters is None:
        parameters = OF_COLOR if data.wavelength_nm is None else OF_SPECTRUM
    wanted = [one_of("parameters", name, tuple(PARAMETERS)) for name in parameters]
    if not wanted or len(set(wanted)) < len(wanted):
        raise InputError(f"parameters = {shown(','.join(wanted))}: each once is needed, of {', '.join(PARAMETERS)}")
    if data.wavelength_nm is None:
        if len(wanted) > 3:
            raise InputError(f"parameters = {','.join(wanted)}: a color has three numbers, which tell three at most")
    elif len(data.wavelength_nm) < len(wanted) + (noise is None):
        raise InputError(
            f"the spectrum has {len(data.wavelength_nm)} wavelengths: {len(wanted)} parameters need at least "
            f"{len(wanted) + (noise is None)}; measure more, or fit fewer"
        )
    return tuple(name for name in PARAMETERS if name in wanted)


def _spread(task: Problem, point: np.ndarray, free: np.ndarray, noise: float | None):
    """Sigma [P] of a point (0 at a bound), correlation [P, P], and how alike neighboring residuals are."""
    ends = task.low, task.high
    if task.data.reflectance is None:
        solution = np.linalg.pinv(least_squares.linearized(task.residual, point, *ends)[1][:, free], rcond=1e-9)
        inner, alike = (1.0 if noise is None else noise) ** 2 * solution @ solution.T, 0.0
    else:
        reflectance, slope = least_squares.linearized(task.spectra, point, *ends)
        slope = slope[:, free]
        own, of_color = task.slopes(reflectance)
        inverse = np.linalg.pinv(np.concatenate([own[:, None] * slope, of_color @ slope]), rcond=1e-9)
        solution = inverse[:, : len(reflectance)] * own + inverse[:, len(reflectance) :] @ of_color
        inner, alike = least_squares.covariance(solution, slope, task.data.reflectance - reflectance, noise)
    spread, correlation = np.zeros(len(point)), np.zeros((len(point), len(point)))
    spread[free] = np.sqrt(np.diag(inner))
    correlation[np.ix_(free, free)] = inner / np.maximum(np.outer(spread[free], spread[free]), 1e-300)
    np.fill_diagonal(correlation, free)
    return spread, correlation, alike


def _far(task: Problem, point: np.ndarray, xyz: np.ndarray, left: float) -> list[str]:
    """What to say of a measurement that the nearest skin misses by a visible difference; InputError if by far."""
    shape = float(np.linalg.norm(task.residual(point[None])[0][:-3]))
    if left > NO_SKIN:
        here, there = (color.hex_code(color.from_xyz(v, "srgb")) for v in (task.data.xyz, xyz))
        raise InputError(
            f"measured color {here}: no skin has it; the nearest of the model, {there}, is ΔE00 {left:.1f} away "
            f"(allowed is {NO_SKIN:g}){_as_read_otherwise(task, left)}"
        )
    if shape > NO_SKIN:
        raise InputError(
            f"measured spectrum: no skin has it; the nearest of the model is a lightness L* of {shape:.1f} away, root "
            f"mean square (allowed is {NO_SKIN:g})"
        )
    if left > SKIN:
        return [f"no skin of the model has this color: ΔE00 {left:.1f} is left{_as_read_otherwise(task, left)}"]
    return []


def _as_read_otherwise(task: Problem, left: float) -> str:
    """Advice where an RGB color would be one of skin, were it encoded where it was said to be linear, or not."""
    other = {"srgb": "linear", "linear": "srgb"}.get(task.data.space)
    if other is None:
        return ""
    linear = np.clip(color.from_xyz(task.data.xyz, "srgb"), 0, 1)
    again = measured.of_color(other, color.encode_srgb(linear) if other == "linear" else linear)
    retried = nearest.problem(again, task.names, task.base, task.offset)
    xyz = retried.spectra(nearest.solve(retried)[None])[0] @ retried.weights
    closer = float(color.delta_e00(color.lab(xyz), retried.lab))
    return f"; read as {other}: {closer:.1f}" if closer < min(SKIN, left) else ""


def _cautions(values: dict[str, float], sigma: dict[str, float | None], correlation: np.ndarray) -> list[str]:
    """Parameters at bounds, hardly determined, or trading off."""
    said, names = [], list(values)
    apart = np.abs(correlation - np.diag(np.diag(correlation)))
    for name, against in zip(names, apart, strict=True):
        spread, partner = sigma[name], int(against.argmax())
        if spread is None:
            end = min(PARAMETERS[name], key=lambda end: abs(values[name] - end))
            said.append(f"{name} is at its bound {end:g}: it has no sigma, and the others' hold it there")
        elif spread > UNSURE * (values[name] if name in CUBE_ROOT else 1):
            most = f", mostly against {names[partner]}" if 0.5 < against[partner] <= TRADE_OFF else ""
            said.append(f"{name} is hardly determined by these data (sigma {spread:.2g}{most})")
    for i, j in combinations(range(len(names)), 2):
        if apart[i, j] > TRADE_OFF:
            how = f"correlation {correlation[i, j]:.2f}"
            said.append(f"{names[i]} and {names[j]} trade off ({how}): these data hardly tell them apart")
    return said


def _of_spectrum(data: Measured, alike: float) -> list[str]:
    """Misfit that is no noise, and a range that says little of color."""
    if data.wavelength_nm is None:
        return []
    said, nm = [], data.wavelength_nm
    if alike:
        said.append(
            f"neighboring residuals are alike (correlation {alike:.2f}), misfit rather than noise: sigma counts "
            f"{len(nm)} values as {len(nm) * (1 - alike) / (1 + alike):.1f}"
        )
    if nm[0] > SEEN_NM[0] or nm[-1] < SEEN_NM[1]:
        said.append(f"{nm[0]:g} to {nm[-1]:g} nm is less than the eye sees: the color holds the ends' values beyond")
    return said
