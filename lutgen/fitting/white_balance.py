"""Light that an albedo was painted or photographed in: the gain per channel that makes its colors those of skin.

Skins are a surface among the colors. The gain is moved until the albedo's texels lie as near that surface as they can
(their mean distance, in which few outliers count little), and as near 1 as a prior holds it, for light and pigment
trade off: a darker exposure looks like more melanin, a redder light like more blood. What skin can explain is not
balanced.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lutgen.fitting import skin_colors
from lutgen.fitting.skin_colors import Surface
from lutgen.tables.lut_set import LutSet

TINT, EXPOSURE = 0.2, 0.5
"""How far from 1, in logarithm, the gain of a channel and of all three lie as readily as texels lie off by half a
color difference."""
EUMELANIN, EUMELANIN_SPREAD = 0.7, 1.0
"""The ratio that the presets were fitted with, and the distance from it that costs half a color difference."""
WORTH = 0.1
"""Color difference that balancing must gain, or nothing is balanced."""
_SOME, _STEPS, _FAR, _NEAR, _SETTLED = 2048, 16, 0.3, 0.25, 0.005


@dataclass(frozen=True)
class Fit:
    """`gain` [3] of linear sRGB, the eumelanin ratio, and the mean color difference that is left plus the priors'."""

    gain: np.ndarray
    eumelanin: float
    cost: float


def fitted(luts: LutSet, painted: np.ndarray, ratios: list[float], start: np.ndarray, free: str) -> Fit:
    """The best gain and eumelanin of `ratios` for the painted texels [N, 3] of an albedo in linear sRGB.

    `start` [3] is given gain; `free` says what is found beside it: `nothing`, the `exposure`, the `tint` or `both`.
    """
    texels = sample(painted) * start
    first = min(ratios, key=lambda ratio: abs(ratio - EUMELANIN))
    gain, cost, positions = _gain(skin_colors.of(luts, first), texels, free)
    if len(ratios) > 1:
        costs = {}
        for ratio in ratios:
            surface, prior = skin_colors.of(luts, ratio), 0.5 * ((ratio - EUMELANIN) / EUMELANIN_SPREAD) ** 2
            for tried in (np.ones(3), gain):
                off, _, _ = _off_surface(surface, texels, tried, positions)
                moved = np.linalg.lstsq(_basis(free), np.log(tried), rcond=None)[0]
                costs[ratio, tuple(tried)] = float(np.linalg.norm(off, axis=0).mean() + 0.5 * moved @ moved + prior)
        first, _ = min(costs, key=lambda key: costs[key])
        gain, cost, positions = _gain(skin_colors.of(luts, first), texels, free)
    return Fit(start * gain, float(first), cost)


def sample(painted: np.ndarray) -> np.ndarray:
    """Some of the texels [N, 3], always the same; all of few."""
    if len(painted) <= _SOME:
        return painted.astype(float)
    picks = np.random.default_rng(0).integers(0, len(painted), _SOME)  # a stride could meet a pattern
    return painted[picks].astype(float)


def _basis(free: str) -> np.ndarray:
    """Directions of log gain that may move [3, k], each as long as its prior is wide."""
    tint = np.linalg.qr(np.array([[1.0, 1, 1], [1, 0, -1], [0, 1, -1]]).T)[0][:, 1:] * TINT
    exposure = np.ones((3, 1)) * EXPOSURE
    return {"nothing": np.zeros((3, 0)), "exposure": exposure, "tint": tint, "both": np.hstack([exposure, tint])}[free]


def _gain(surface: Surface, texels: np.ndarray, free: str) -> tuple[np.ndarray, float, np.ndarray]:
    """Gain [3], its cost and positions [2, N], by least squares on the distances, reweighted to their mean size."""
    basis = _basis(free)
    amount, best, costs = np.zeros(basis.shape[1]), np.ones(3), []
    off, slopes, positions = _off_surface(surface, texels, best, None)
    while True:
        size = np.linalg.norm(off, axis=0)
        costs.append(float(size.mean() + 0.5 * amount @ amount))
        if costs[-1] == min(costs):
            best = np.exp(basis @ amount)
        settled = len(costs) > 2 and costs[-1] > costs[-3] - _SETTLED
        if not len(amount) or settled or len(costs) == _STEPS:
            break
        along = np.einsum("lnc,ck->lnk", slopes, basis)
        weight = 1 / np.maximum(size, _NEAR) / len(size)
        matrix = np.einsum("lni,lnj,n->ij", along, along, weight) + np.eye(len(amount))
        step = np.linalg.solve(matrix, -np.einsum("lni,ln,n->i", along, off, weight) - amount)
        amount = amount + step * min(1.0, _FAR / max(np.abs(basis @ step).max(), 1e-9))
        off, slopes, positions = _off_surface(surface, texels, np.exp(basis @ amount), positions)
    return (best, min(costs), positions) if min(costs) < costs[0] - WORTH else (np.ones(3), costs[0], positions)


def _off_surface(surface: Surface, texels: np.ndarray, gain: np.ndarray, positions: np.ndarray | None):
    """Differences from the nearest skins [3, N], their slopes by the log gain of each channel [3, N, 3], positions."""
    colors = (texels * gain).astype("f4")
    xyz = skin_colors.relative(colors)
    root, rate = skin_colors.roots(xyz)
    wanted = skin_colors.opponent(root)
    if positions is None:
        positions = skin_colors.refined(surface, wanted, surface.start(wanted))
    else:
        positions = skin_colors.refined(surface, wanted, positions, reach=skin_colors.NEAR)
    skin, *along = surface.read(positions)
    root_there, rate_there = skin_colors.roots(skin)
    shown = skin_colors.opponent(root_there)
    weights = skin_colors.metric((wanted + shown) / 2)
    off = skin_colors.seen(weights, wanted - shown)
    tangents = [skin_colors.seen(weights, skin_colors.opponent(rate_there * slope)) for slope in along]
    slopes = np.stack([
        skin_colors.seen(weights, skin_colors.opponent(rate * skin_colors.relative(colors * np.eye(3, dtype="f4")[c])))
        for c in range(3)
    ], axis=-1)  # fmt: skip
    first = _unit(tangents[0])
    second = _unit(tangents[1] - (first * tangents[1]).sum(axis=0) * first)
    for tangent, position, last in zip((first, second), positions, surface.most, strict=True):
        free = np.where((position <= 0) | (position >= last), 0.0, tangent)  # at the edge skins follow no further
        off = off - free * (free * off).sum(axis=0)
        slopes = slopes - free[..., None] * np.einsum("ln,lnc->nc", free, slopes)
    return off, slopes, positions


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=0), 1e-9)
