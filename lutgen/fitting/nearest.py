"""The skin nearest to a measurement: what is compared, in which unit, and the descent to the least difference.

*Model*: the table of exact totals (lutgen/solvers/exact_totals.py), far more right than anything measured. *Residual*:
the color difference that is left (CIEDE2000, as its quadratic form at the measured color) and, for a spectrum, the
difference in lightness of each wavelength, 116 cbrt(R), as a root mean square: both in one unit, so no weight is to be
chosen. By wavelengths alone the color of measured skin is up to 2 off; with the color beside them melanin's sigma under
noise is up to twice, hemoglobin's 1.6 times as large.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from lutgen import color
from lutgen.fitting import least_squares
from lutgen.fitting.measured import Measured, color_weights
from lutgen.skin import chromophores
from lutgen.skin.tissue import Skin
from lutgen.solvers import exact_totals

PARAMETERS = {
    "melanin": chromophores.MELANIN, "hemoglobin": chromophores.HEMOGLOBIN,
    "oxygenation": chromophores.OXYGENATION, "eumelanin": chromophores.EUMELANIN,
}  # fmt: skip
CUBE_ROOT = ("melanin", "hemoglobin")
"""What is fitted in its cube root: color follows it almost evenly."""
_COARSE = {"melanin": 10, "hemoglobin": 7, "oxygenation": 3, "eumelanin": 3}
_STARTS, _APART, _AT_ONCE = 3, 0.3, 50_000


@dataclass(frozen=True)
class Problem:
    """What is fitted to what; a point [P] holds cube roots of melanin and hemoglobin, the two ratios as they are.

    `offset`: specular share that the data include. `weights` [n, 3] give XYZ of the spectrum at `wavelength_nm` [n],
    of data and model alike.
    """

    data: Measured
    names: tuple[str, ...]
    base: Skin
    offset: float
    wavelength_nm: np.ndarray
    weights: np.ndarray
    lab: np.ndarray
    metric: np.ndarray
    low: np.ndarray
    high: np.ndarray

    @cached_property
    def _exact(self) -> exact_totals.ExactTotals:
        return exact_totals.exact_totals(self.base.tissue)

    def values(self, points: np.ndarray) -> dict[str, np.ndarray]:
        """The fitted parameters [B] at points [B, P]."""
        values = {name: column ** _power(name) for name, column in zip(self.names, points.T, strict=True)}
        return {name: np.clip(value, *PARAMETERS[name]) for name, value in values.items()}

    def spectra(self, points: np.ndarray) -> np.ndarray:
        """The model's reflectance [B, n] at points [B, P]."""
        of = {name: np.full(len(points), getattr(self.base, name)) for name in PARAMETERS} | self.values(points)
        reflectance = exact_totals.spectra(
            self._exact, self.wavelength_nm, of["melanin"], of["eumelanin"], of["hemoglobin"], of["oxygenation"]
        )
        return reflectance + self.offset

    def residual(self, points: np.ndarray) -> np.ndarray:
        """Differences [B, n + 3] in lightness per wavelength and in color; [B, 3] where there is only a color."""
        reflectance = self.spectra(points)
        apart = (color.lab(reflectance @ self.weights) - self.lab) @ self.metric.T
        if self.data.reflectance is None:
            return apart
        share = 116 / np.sqrt(reflectance.shape[1])
        return np.concatenate([share * (np.cbrt(reflectance) - np.cbrt(self.data.reflectance)), apart], axis=1)

    def slopes(self, reflectance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What `residual` gains per reflectance at a spectrum [n]: each wavelength's own [n], the color's [3, n]."""
        xyz = reflectance @ self.weights
        to_lab = least_squares.linearized(color.lab, xyz, np.zeros(3), 2 * xyz)[1]
        return 116 / 3 / np.cbrt(reflectance) ** 2 / np.sqrt(len(reflectance)), self.metric @ to_lab @ self.weights.T


def problem(data: Measured, names: tuple[str, ...], base: Skin, offset: float = 0.0) -> Problem:
    """Fit these parameters to the data; all else is `base`'s.

    >>> from lutgen.fitting import measured
    >>> problem(measured.read("#c09580"), ("melanin",), Skin(0.02, 0.7, 0.01)).low.round(6).tolist()
    [0.1]
    """
    nm, weights = color.xyz_weights()
    if data.wavelength_nm is not None:
        nm, weights = data.wavelength_nm, color_weights(data.wavelength_nm)
    low, high = np.array([[end ** (1 / _power(name)) for end in PARAMETERS[name]] for name in names]).T
    lab = color.lab(data.xyz)
    return Problem(data, names, base, offset, nm, weights, lab, color.metric(lab), low, high)


def solve(task: Problem) -> np.ndarray:
    """The best point [P] of descents from the best cells of a coarse table that lie apart.

    >>> from lutgen.fitting import measured
    >>> task = problem(measured.read("#b98c74"), ("melanin", "hemoglobin"), Skin(0.02, 0.7, 0.01))
    >>> {name: round(float(value[0]), 4) for name, value in task.values(solve(task)[None]).items()}
    {'melanin': 0.0194, 'hemoglobin': 0.0157}
    """
    low, high = task.low, task.high
    lines = [np.linspace(a, b, _COARSE[name]) for name, a, b in zip(task.names, low, high, strict=True)]
    points = np.array(list(product(*lines)))
    parts = np.array_split(points, 1 + len(points) * len(task.wavelength_nm) // _AT_ONCE)
    left = np.concatenate([(task.residual(part) ** 2).sum(axis=1) for part in parts])
    starts: list[np.ndarray] = []
    for i in np.argsort(left, kind="stable"):
        if all(np.abs((points[i] - other) / (high - low)).max() > _APART for other in starts):
            starts.append(points[i])
        if len(starts) == _STARTS:
            break
    ends = [least_squares.minimize(task.residual, start, low, high) for start in starts]
    return min(ends, key=lambda end: float((task.residual(end[None]) ** 2).sum()))


def _power(name: str) -> int:
    return 3 if name in CUBE_ROOT else 1
