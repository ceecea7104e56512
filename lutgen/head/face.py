"""Where a head's points would lie on the built-in head: its face found by its profile, its ears by what stands out.

The midline is where the head mirrors best. The profile along it is compared with the built-in head's at every scale and
with every foremost point as the tip of the nose; then sellion, subnasale, the line of the mouth, the fold above the
chin, the chin's foremost and its lowest point are looked for near where they should be. Between these landmarks heights
map linearly. Across, the face is as wide as fits its relief best. Along z, and along x at the ears, points move by as
much as the two reliefs differ, so that what is painted near a surface lies on it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from lutgen.head import builtin, landmarks, occlusion
from lutgen.head.mesh import Mesh

_CELL_MM = 2.0
_FACE_MM = np.array([[-70.0, 70.0], [-125.0, 75.0]])
_EAR_MM = np.array([[-70.0, 30.0], [-60.0, 50.0]])
"""Extent along x and y of the face, along z and y of the ears' surroundings, in the built-in head's frame."""


@dataclass(frozen=True)
class Placement:
    """How points of a mesh move into the built-in head's frame; see `into`.

    `middle_mm` the mesh's x of its midline; `heights_mm` landmarks' y [K, 2] in the mesh and in the frame, rising;
    `scale` mesh per frame along y and z, `across` along x; `foremost_mm` z of the nose's tip in both; `relief_mm` what
    the mesh lacks along z over the face [rows, columns]; `ear` (z and y of its middle in the mesh, in the frame, size
    ratio of each) or None where none stands out; `flare_mm` what it lacks along x around the ears.
    """

    middle_mm: float
    heights_mm: np.ndarray
    scale: float
    across: float
    foremost_mm: tuple[float, float]
    relief_mm: np.ndarray | None = None
    ear: np.ndarray | None = None
    flare_mm: np.ndarray | None = None

    def into(self, points: np.ndarray) -> np.ndarray:
        """Points [..., 3] of the mesh in the built-in head's frame, mm."""
        x = (points[..., 0] - self.middle_mm) / self.across
        y = self._height(points[..., 1])
        z = (points[..., 2] - self.foremost_mm[0]) / self.scale + self.foremost_mm[1]
        if self.ear is not None:
            share = _fading(np.abs(x), 50, 62) * _inside(z, y, _EAR_MM, 12)
            own, known, size = self.ear
            z = z + share * (known[0] + (z - own[0]) / size[0] - z)
            y = y + share * (known[1] + (y - own[1]) / size[1] - y)
        if self.relief_mm is not None:
            z = z + _read(self.relief_mm, x, y, _FACE_MM) * _inside(x, y, _FACE_MM, 15) * _fading(z, 10, 40)
        if self.flare_mm is not None:
            share = _fading(np.abs(x), 50, 62) * _inside(z, y, _EAR_MM, 12)
            x = x + np.sign(x) * _read(self.flare_mm, z, y, _EAR_MM) * share
        return np.stack([x, y, z], axis=-1)

    @property
    def origin_mm(self) -> np.ndarray:
        """The mesh's point [3] where the built-in head has its origin, between the ears."""
        own, to = self.heights_mm.T
        return np.array([self.middle_mm, np.interp(0, to, own), self.foremost_mm[0] - self.scale * self.foremost_mm[1]])

    def _height(self, y: np.ndarray) -> np.ndarray:
        own, to = self.heights_mm.T
        middle = np.interp(y, own, to)
        return middle + (np.minimum(y - own[0], 0) + np.maximum(y - own[-1], 0)) / self.scale


def place(shape: Mesh) -> Placement | None:
    """Where a mesh lies against the built-in head; None where no face is found on its midline.

    +y up and +z forward, in mm up to a factor of about 0.7 to 1.4; a bust or a head alone.
    """
    points = _points(shape)
    middle = _middle(points)
    own, known = landmarks.profile(points, middle), landmarks.profile(_known_points(), 0.0)
    tip = landmarks.tip_of(own, known)
    if tip is None:
        return None
    tip_y, scale = tip
    heights = landmarks.landmarks(own, known, tip_y, scale)
    if heights is None:
        return None
    scale = float(np.ptp(heights[:, 0]) / np.ptp(heights[:, 1]))
    foremost = float(own[1][np.searchsorted(own[0], heights[landmarks.TIP, 0])]), float(known[1].max())
    fitted = min((_misfit(Placement(middle, heights, scale, scale * k, foremost), points), k)
                 for k in np.linspace(0.84, 1.16, 17))[1]  # fmt: skip
    fit = Placement(middle, heights, scale, scale * fitted, foremost)
    relief = _smoothed(_map(_known_points(), _FACE_MM) - _map(fit.into(points.T).T, _FACE_MM))
    ear = _ear(fit.into(points.T).T)
    fit = Placement(middle, heights, scale, fit.across, foremost, np.clip(relief, -20, 20), ear)
    if ear is None:
        return fit
    flare = _smoothed(_map(_sideways(_known_points()), _EAR_MM) - _map(_sideways(fit.into(points.T).T), _EAR_MM))
    return Placement(middle, heights, scale, fit.across, foremost, fit.relief_mm, ear, np.clip(flare, -12, 12))


def _points(shape: Mesh) -> np.ndarray:
    return occlusion.sampled(shape.positions_mm.astype("f8"), shape.triangles, 0.9)[0]


@cache
def _known_points() -> np.ndarray:
    return _points(builtin.builtin())


def _map(points: np.ndarray, extent: np.ndarray) -> np.ndarray:
    """Highest third coordinate [rows, columns] of points [3, N] in cells over an extent of the first two; NaN: none."""
    columns, rows = (np.ptp(extent, axis=1) / _CELL_MM).astype(int)
    cells = ((points[:2] - extent[:, :1]) / _CELL_MM).astype(int)
    inside = np.all((points[:2] >= extent[:, :1]) & (points[:2] < extent[:, 1:]), axis=0)
    top = np.full(rows * columns, -np.inf)
    np.maximum.at(top, cells[1, inside] * columns + cells[0, inside], points[2, inside])
    return np.where(np.isfinite(top), top, np.nan).reshape(rows, columns)


def _sideways(points: np.ndarray) -> np.ndarray:
    """Points as both sides are seen from the side: z, y, distance from the midline."""
    return np.stack([points[2], points[1], np.abs(points[0])])


def _read(values: np.ndarray, across: np.ndarray, up: np.ndarray, extent: np.ndarray) -> np.ndarray:
    """A map over an extent read linearly, its edges held."""
    place = [(v - low) / _CELL_MM - 0.5 for v, low in ((up, extent[1, 0]), (across, extent[0, 0]))]
    place = [np.clip(v, 0, size - 1.001) for v, size in zip(place, values.shape, strict=True)]
    (i, j), (a, b) = [v.astype(int) for v in place], [v - np.floor(v) for v in place]
    below = values[i, j] * (1 - b) + values[i, j + 1] * b
    return below * (1 - a) + (values[i + 1, j] * (1 - b) + values[i + 1, j + 1] * b) * a


def _fading(x: np.ndarray, low: float, high: float) -> np.ndarray:
    t = np.clip((x - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def _inside(across: np.ndarray, up: np.ndarray, extent: np.ndarray, edge: float) -> np.ndarray:
    """1 within an extent, down to 0 at its borders."""
    depth = [np.minimum(v - low, high - v) for v, (low, high) in zip((across, up), extent, strict=True)]
    return _fading(np.minimum(*depth), 0, edge)


def _smoothed(values: np.ndarray, passes: int = 3) -> np.ndarray:
    """A map without its holes and its finest detail: means over 3 x 3 cells of what is there."""
    known = np.isfinite(values)
    values, known = np.where(known, values, 0.0), known.astype(float)
    for turn in range(40):
        if turn >= passes and known.all():
            break
        total, count = _of_nine(values * known), _of_nine(known)
        fresh = np.where(count > 0, total / np.maximum(count, 1e-9), 0.0)
        values = fresh if turn < passes else np.where(known > 0, values, fresh)
        known = np.where(count > 0, 1.0, 0.0)
    return values


def _of_nine(values: np.ndarray) -> np.ndarray:
    wide = np.pad(values, 1, mode="edge")
    rows = wide[:-2] + wide[1:-1] + wide[2:]
    return rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:]


def _middle(points: np.ndarray) -> float:
    """The x about which the relief seen from the front mirrors best."""
    low, high = points.min(axis=1), points.max(axis=1)
    extent = np.stack([low, low + np.ceil((high - low + 1) / _CELL_MM) * _CELL_MM], axis=1)[:2]
    seen = _map(points, extent)
    seen = np.where(seen > high[2] - 120, seen, np.nan)
    center, best = seen.shape[1] - 1, []
    for twice in range(center - 40, center + 41):  # columns j and twice - j mirror each other
        columns = np.arange(max(0, twice - seen.shape[1] + 1), min(seen.shape[1] - 1, twice) + 1)
        apart = np.abs(seen[:, columns] - seen[:, twice - columns])
        both = np.isfinite(apart)
        missing = np.isfinite(seen).sum() - both.sum()
        best.append(((np.minimum(apart[both], 20).sum() + 20 * missing), twice))
    return float(extent[0, 0] + (min(best)[1] + 1) / 2 * _CELL_MM)


def _misfit(fit: Placement, points: np.ndarray) -> float:
    """Mean difference of the relief of the face from the built-in head's, mm, apart from a shift."""
    extent = np.array([[-48.0, 48.0], [-105.0, 25.0]])
    apart = _map(fit.into(points.T).T, extent) - _map(_known_points(), extent)
    return float(np.minimum(np.abs(apart - np.nanmedian(apart)), 12)[np.isfinite(apart)].mean())


def _ear(points: np.ndarray) -> np.ndarray | None:
    """Middles (z, y) of what stands out at the sides of a head in the frame, and of the built-in ear, and their size
    ratio [3, 2]; None where nothing does."""
    middles = []
    for both in (points, _known_points()):
        seen = _map(_sideways(both), _EAR_MM)
        seen = np.where(seen > 45, seen, np.nan)
        stands_out = np.nan_to_num(seen - _smoothed(seen, 25))
        weight = np.clip(stands_out - 1.5, 0, 6)
        if weight.sum() < 60:
            return None
        rows, columns = (
            _EAR_MM[k, 0] + (np.arange(n) + 0.5) * _CELL_MM for k, n in ((1, seen.shape[0]), (0, seen.shape[1]))
        )
        z, y = np.meshgrid(columns, rows)
        middle = np.array([(weight * v).sum() for v in (z, y)]) / weight.sum()
        spread = np.sqrt(
            np.array([(weight * (v - m) ** 2).sum() for v, m in zip((z, y), middle, strict=True)]) / weight.sum()
        )
        middles.append((middle, spread))
    (own, wide), (known, usual) = middles
    return np.array([own, own + np.clip(known - own, -25, 25), np.clip(wide / usual, 0.75, 1.35)])
