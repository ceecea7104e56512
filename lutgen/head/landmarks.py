"""A face's landmarks on its profile: the midline's foremost points from the chin to the brow."""

from __future__ import annotations

import numpy as np

Profile = tuple[np.ndarray, np.ndarray]
"""Heights and the foremost z at each."""
_SCALES = np.geomspace(0.7, 1.45, 49)
_BELOW_MM, _ABOVE_MM = 78, 75
_WORST_MM, _UNLIKE_MM, _MISFIT_MM = 15.0, 8.0, 5.5
"""Most that a profile's difference counts, what a size unlike the scale counts, and more than a face may differ."""
TIP = 5
"""Which of the landmarks is the nose's tip."""


def profile(points: np.ndarray, middle: float) -> Profile:
    """Heights every millimeter, rising, and the foremost z within 2.5 mm of the midline at each; gaps bridged."""
    near = points[1:, np.abs(points[0] - middle) < 2.5]
    low = np.floor(near[0].min())
    bins = (near[0] - low).astype(int)
    z = np.full(bins.max() + 1, -np.inf)
    np.maximum.at(z, bins, near[1])
    there = np.isfinite(z)
    y = low + 0.5 + np.arange(len(z))
    z = np.interp(y, y[there], z[there])
    return y, np.convolve(np.pad(z, 1, mode="edge"), [0.25, 0.5, 0.25], mode="valid")


def tip_of(own: Profile, known: Profile) -> tuple[float, float] | None:
    """Height of the nose's tip on a profile, and the scale at which the profile fits best; None where none fits."""
    y, z = own
    reach = 12
    wide = np.lib.stride_tricks.sliding_window_view(np.pad(z, reach, constant_values=-np.inf), 2 * reach + 1)
    candidates = np.flatnonzero(z >= wide.max(axis=1))
    top = known[1].argmax()
    off = np.arange(-_BELOW_MM, _ABOVE_MM + 1)
    expected = known[1][top + off] - known[1][top]
    usual = _size(*known, float(known[0][top]), 1.0)
    best = (np.inf, 0.0, 1.0)
    for k in candidates:
        scales = _SCALES[(y[k] - _BELOW_MM * _SCALES > y[0]) & (y[k] + _ABOVE_MM * _SCALES < y[-1])]
        for scale in scales:
            relief = (np.interp(y[k] + scale * off, y, z) - z[k]) / scale
            size = _size(y, z, float(y[k]), float(scale)) / usual
            misfit = np.minimum(np.abs(relief - expected), _WORST_MM).mean() + _UNLIKE_MM * abs(np.log(size / scale))
            best = min(best, (float(misfit), float(y[k]), float(scale)))
    return best[1:] if best[0] < _MISFIT_MM else None


def _size(y: np.ndarray, z: np.ndarray, tip: float, scale: float) -> float:
    """From the lowest of a profile's landmarks to the highest."""
    features = _features(y, z, tip, scale)
    return features[-1] - features[0]


def landmarks(own: Profile, known: Profile, tip: float, scale: float) -> np.ndarray | None:
    """Heights [7, 2] in the mesh and in the frame, rising: menton, pogonion, fold, mouth, subnasale, tip, sellion."""
    first = _features(*known, float(known[0][known[1].argmax()]), 1.0)
    second = _features(*own, tip, scale)
    heights = np.stack([second, first], axis=1)
    steps = np.diff(heights, axis=0)
    ratio = steps[:, 0] / steps[:, 1] / scale
    return heights if np.all((ratio > 0.4) & (ratio < 2.5)) else None


def _features(y: np.ndarray, z: np.ndarray, tip: float, s: float) -> list[float]:
    """Heights of the landmarks on a profile whose nose's tip and scale are known."""

    def between(low: float, high: float) -> np.ndarray:
        """Places between two heights off the tip, in the frame's mm."""
        return np.flatnonzero((y >= tip + s * low) & (y <= tip + s * high))

    def deepest(low: int, high: int) -> int:
        """Where the profile lies deepest behind the chord of two of its places."""
        k = np.arange(low, high + 1)
        chord = np.interp(y[k], [y[low], y[high]], [z[low], z[high]])
        return int(k[(chord - z[k]).argmax()])

    near = between(-4, 4)
    top = int(near[z[near].argmax()])
    brow = between(52, 62)
    sellion = deepest(top, int(brow[z[brow].argmax()]))
    lips = between(-33, -19)
    subnasale = deepest(int(lips[z[lips].argmax()]), top)
    parting = between(-37, -21)
    parting = parting[y[parting] < y[subnasale] - 12 * s]  # nearer, the upper lip itself is hollow
    if not len(parting):
        return [np.nan] * 7
    own_dip = z[parting] - np.array([z[np.abs(y - y[k]) <= 5 * s].mean() for k in parting])
    mouth = int(parting[own_dip.argmin()])
    chin = between(-72, -48)
    pogonion = int(chin[z[chin].argmax()])
    fold = deepest(pogonion, mouth)
    under = between(-100, -50)
    under = under[under < pogonion]
    fallen = under[z[under] < z[pogonion] - 12 * s]
    menton = int(fallen.max()) if len(fallen) else int(under.min())
    return [float(y[k]) for k in (menton, pogonion, fold, mouth, subnasale, top, sellion)]
