"""How far two pictures of one scene are apart: CIEDE2000 over boxes of 4 x 4 pixels, without the part that is noise.

Colors are linear display colors in Lab, white the white of linear sRGB at exposure 0. Nothing is clipped: what is
brighter than white, or outside sRGB, counts as it is, where a display would hide it.

A box's color is the mean of its pixels. Let d be the difference of two boxes in Lab, C the covariance of its noise and
M the metric of CIEDE2000 there (ΔE00^2 = d' M d for small d). Then E[d' M d] = δ' M δ + trace(M C) with δ the true
difference, so that

    e = ΔE00(A, B)^2 - trace(M C)

has the true squared difference as its mean. C comes from the files: pixels err independently, so that their covariances
add up over a box, and C = J S J' with J the derivative of Lab and S the box's covariance in ACEScg. (Channels err
together, as one path carries light of all of them: without S's mixed terms the trace would be up to three times off.)

A box's difference is the root of e with e's sign, so that noise nearly cancels in a mean: of pictures that differ in
nothing else it leaves about -0.2 of what it was, and a spread, which a p95 keeps. Both are drawn from C and reported.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lutgen import color
from lutgen.errors import InputError, summary
from lutgen.render.compare_files import Picture, mask

BOX = 4
_LEAST = BOX * BOX // 2
_DRAWS = 64
_STEP = 0.1  # in Lab, for the metric: small beside where its weights change
_LAB_FROM_F = np.array([[0.0, 116, 0], [500, -500, 0], [0, 200, -200]])


@dataclass(frozen=True)
class Figure:
    """A figure and its standard error."""

    value: float
    sigma: float


@dataclass(frozen=True)
class Difference:
    """What B differs from A by.

    `delta_e00` [rows / 4, columns / 4]: a box's difference, NaN where less than half of it is skin in both.
    `noise_alone`: mean, median and p95 that pictures without any difference but this noise would show.
    `lightness`: mean of B - A in L*; `channels`: mean of B over mean of A, less 1, for R, G and B of ACEScg, NaN
    where A is black.
    `noise_over_sigma`: scatter within boxes over what the files' sigma says (1: honest; more also where fine structure
    differs); None without noise.
    """

    delta_e00: np.ndarray
    boxes: int
    mean: Figure
    median: Figure
    p95: Figure
    most: float
    noise_alone: tuple[float, float, float]
    lightness: Figure
    channels: tuple[Figure, ...]
    noise_over_sigma: float | None
    notes: tuple[str, ...]

    __repr__ = summary


def compare(a: Picture, b: Picture) -> Difference:
    """B against A, pictures of one size; InputError where sizes differ, too little shows skin in both, or renders share
    their random numbers."""
    if a.seed is not None and a.seed == b.seed:
        raise InputError(
            f"{a.name}, {b.name}: both rendered with seed {a.seed}, so their noise is alike and cannot be taken off; "
            "render one of them with another --seed"
        )
    seen, notes = mask(a, b)
    n = _boxed(seen[..., None].astype(float))[..., 0]
    full = n >= _LEAST
    if not full.any():
        raise InputError(f"{a.name}, {b.name}: no box of {BOX} x {BOX} pixels is skin by half; render them larger")
    count = n[full][:, None]
    means = [_boxed(one.acescg * seen[..., None])[full] / count for one in (a, b)]
    silent = [one.name for one in (a, b) if one.covariance is None]
    notes += (*a.notes, *b.notes, *(f"{name}: holds no sigma, so its noise counts as difference" for name in silent))
    covariance = sum((one.covariance for one in (a, b) if one.covariance is not None), np.zeros((*seen.shape, 3, 3)))
    summed = _boxed((covariance * seen[..., None, None]).reshape(*seen.shape, 9))[full].reshape(-1, 3, 3)

    labs = [color.lab(mean @ color.XYZ_FROM_ACESCG.T) for mean in means]
    middle = (means[0] + means[1]) / 2
    J = _lab_derivative(middle)
    metric = np.einsum("nia,nij,njb->nab", J, _metric(color.lab(middle @ color.XYZ_FROM_ACESCG.T)), J)
    S = summed / count[..., None] ** 2
    noise = np.einsum("nab,nab->n", metric, S)
    squared = color.delta_e00(*labs) ** 2
    found = _signed_root(squared - noise)
    sigmas, alone = _drawn(squared, means[1] - means[0], metric, S)

    image = np.full(full.shape, np.nan)
    image[full] = found
    values = found.mean(), np.median(found), np.quantile(found, 0.95)
    light = np.sqrt(np.einsum("na,nb,nab->", J[:, 0], J[:, 0], S)) / len(found)
    total = [one.acescg[seen].sum(axis=0) for one in (a, b)]
    error = np.sqrt(np.diag(covariance[seen].sum(axis=0)))
    mean, median, p95 = (Figure(float(v), s) for v, s in zip(values, sigmas, strict=True))
    lightness = Figure(float((labs[1] - labs[0])[:, 0].mean()), float(light))
    channels = tuple(
        Figure(float(two / one) - 1, float(s / one)) if one > 0 else Figure(np.nan, np.nan)
        for one, two, s in zip(*total, error, strict=True)
    )
    return Difference(
        image,
        len(found),
        mean,
        median,
        p95,
        float(found.max()),
        alone,
        lightness,
        channels,
        _scatter(b.acescg - a.acescg, seen, full, summed, count),
        notes,
    )


def _boxed(values: np.ndarray) -> np.ndarray:
    """Sums [ceil(rows / 4), ceil(columns / 4), channels] over boxes."""
    rows, columns, channels = values.shape
    values = np.pad(values, ((0, -rows % BOX), (0, -columns % BOX), (0, 0)))
    return values.reshape(values.shape[0] // BOX, BOX, values.shape[1] // BOX, BOX, channels).sum(axis=(1, 3))


def _signed_root(squared: np.ndarray) -> np.ndarray:
    return np.sign(squared) * np.sqrt(np.abs(squared))


def _scatter(
    difference: np.ndarray, seen: np.ndarray, full: np.ndarray, summed: np.ndarray, count: np.ndarray
) -> float | None:
    """Scatter of pixels around their box's mean over what sigma says: median over boxes of the root of their ratio."""
    first, second = (_boxed(difference**power * seen[..., None])[full] for power in (1, 2))
    expected = np.einsum("nii->ni", summed) * (1 - 1 / count)
    noisy = np.all(expected > 0, axis=1)
    ratio = (second - first**2 / count)[noisy] / expected[noisy]
    return float(np.sqrt(np.median(ratio))) if noisy.any() else None


def _lab_derivative(acescg: np.ndarray) -> np.ndarray:
    """Derivative [N, 3, 3] of Lab by linear ACEScg [N, 3]."""
    white = color.from_acescg(np.ones(3), "xyz")
    ratio, delta = acescg @ color.XYZ_FROM_ACESCG.T / white, 6 / 29
    slope = np.where(ratio > delta**3, np.cbrt(np.maximum(ratio, delta**3)) ** -2 / 3, 1 / (3 * delta**2))
    return np.einsum("ik,nk,kj->nij", _LAB_FROM_F, slope / white, color.XYZ_FROM_ACESCG)


def _metric(lab: np.ndarray) -> np.ndarray:
    """Metric [N, 3, 3] of CIEDE2000 at colors [N, 3]: squared differences of small steps along axes and diagonals."""

    def squared(step) -> np.ndarray:
        """Squared difference per squared length of a step."""
        half = _STEP / 2 * np.asarray(step, float)
        return (color.delta_e00(lab - half, lab + half) / _STEP) ** 2

    axes = np.eye(3)
    alone = [squared(axis) for axis in axes]
    metric = np.empty((len(lab), 3, 3))
    for i in range(3):
        for j in range(3):
            both = alone[i] if i == j else (squared(axes[i] + axes[j]) - alone[i] - alone[j]) / 2
            metric[:, i, j] = both
    return metric


def _drawn(squared: np.ndarray, step: np.ndarray, metric: np.ndarray, S: np.ndarray) -> tuple[tuple, tuple]:
    """Standard errors of mean, median and p95 of the boxes, and the same three figures of noise alone.

    Noise is drawn from its covariance and, for the errors, added once more to what was found.
    """
    noise = np.einsum("nab,nab->n", metric, S)
    if not noise.any():
        return (0.0,) * 3, (0.0,) * 3
    rng = np.random.default_rng(0)
    values, vectors = np.linalg.eigh(S)
    root = vectors * np.sqrt(np.maximum(values, 0))[:, None]
    with_noise, alone = [], []
    for _ in range(_DRAWS):
        drawn = np.einsum("nab,nb->na", root, rng.standard_normal(step.shape))
        own = np.einsum("na,nab,nb->n", drawn, metric, drawn)
        across = 2 * np.einsum("na,nab,nb->n", step, metric, drawn)
        with_noise.append(_figures(_signed_root(squared + across + own - 2 * noise)))
        alone.append(_figures(_signed_root(own - noise)))
    return tuple(np.std(with_noise, axis=0).tolist()), tuple(np.mean(alone, axis=0).tolist())


def _figures(values: np.ndarray) -> tuple[float, float, float]:
    return float(values.mean()), float(np.median(values)), float(np.quantile(values, 0.95))
