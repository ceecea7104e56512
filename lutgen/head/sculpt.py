"""A human head as a signed distance function, and its surface: about 45 mirrored primitives, blended.

Millimetres; +x is the head's left, +y up, +z where it looks; the origin lies between the ears. Proportions follow
published means of adults (breadth of head 152, length 197, bizygomatic 140, face height menton to sellion 122, nose
35 broad, pupils 63 apart, mouth 52 broad, ear 63 long: Gordon et al. 2014, ANSUR II; Farkas 1994).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce

import numpy as np

Points = tuple[np.ndarray, ...]
"""x, y and z of points, arrays of one shape."""
BUST_MM = -200.0
"""Height at which the neck and shoulders are cut."""


def _join(a, b, soft: float):
    """Union with a rounded seam (Quilez's polynomial smooth minimum)."""
    h = np.clip(0.5 + 0.5 * (b - a) / soft, 0, 1)
    return b + (a - b) * h - soft * h * (1 - h)


def _carve(a, b, soft: float):
    """What of a lies outside b, with a rounded edge."""
    return -_join(-a, b, soft)


def _turned(p: Points, about: str, degrees: float) -> Points:
    c, s = (np.float32(f(np.radians(degrees))) for f in (np.cos, np.sin))
    x, y, z = p
    if about == "x":
        return x, c * y - s * z, s * y + c * z
    if about == "y":
        return c * x + s * z, y, -s * x + c * z
    return c * x - s * y, s * x + c * y, z


def _from(p: Points, center) -> Points:
    return tuple(v - np.float32(c) for v, c in zip(p, center, strict=True))


def _ellipsoid(p: Points, center, radii, **turns: float):
    q = _from(p, center)
    for about in ("z", "y", "x"):
        if about in turns:
            q = _turned(q, about, turns[about])
    k = [np.float32(1 / r) for r in radii]
    scaled = np.sqrt(sum((v * a) ** 2 for v, a in zip(q, k, strict=True))) + np.float32(1e-9)
    slope = np.sqrt(sum((v * a * a) ** 2 for v, a in zip(q, k, strict=True))) + np.float32(1e-9)
    return scaled * (scaled - 1) / slope


def _rod(p: Points, start, end, radius: float, radius_end: float | None = None):
    """A capsule whose radius changes from start to end."""
    a, d = np.array(start, "f4"), np.array(end, "f4") - np.array(start, "f4")
    q = _from(p, a)
    t = np.clip((q[0] * d[0] + q[1] * d[1] + q[2] * d[2]) / (d @ d), 0, 1)
    distance = np.sqrt(sum((v - w * t) ** 2 for v, w in zip(q, d, strict=True)))
    return distance - (radius + ((radius if radius_end is None else radius_end) - radius) * t)


def _curve(p: Points, points, radii):
    """A rounded tube along a Catmull-Rom curve through points."""
    points = np.array(points, float)
    radii = np.broadcast_to(np.array(radii, float), len(points))
    padded = np.vstack([2 * points[0] - points[1], points, 2 * points[-1] - points[-2]])
    along = np.linspace(0, len(points) - 1, 3 * len(points) - 2)
    k, t = np.minimum(along.astype(int), len(points) - 2), 0.0
    t = (along - k)[:, None]
    a, b, c, d = (padded[k + i] for i in range(4))
    line = 0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t**2 + (3 * b - a - 3 * c + d) * t**3)
    thick = np.interp(along, np.arange(len(points)), radii)
    rods = (_rod(p, line[i], line[i + 1], thick[i], thick[i + 1]) for i in range(len(line) - 1))
    return reduce(np.minimum, rods)


def _skull(p: Points):
    d = _ellipsoid(p, (0, 34, -12), (71, 72, 88))
    d = _join(d, _ellipsoid(p, (0, 32, 27), (57, 49, 58)), 26)  # forehead
    d = _join(d, _ellipsoid(p, (0, -12, -14), (68, 62, 56)), 22)  # temples and the root of the ear
    d = _join(d, _ellipsoid(p, (0, -38, 28), (54, 68, 56)), 22)  # face
    d = _join(d, _ellipsoid(p, (37, -22, 44), (25, 19, 25)), 24)  # cheekbone
    d = _join(d, _ellipsoid(p, (29, -48, 46), (24, 29, 28)), 24)  # cheek
    d = _join(d, _ellipsoid(p, (36, -46, 20), (18, 24, 26)), 22)  # chewing muscle
    d = _join(d, _rod(p, (49, -54, -4), (15, -92, 64), 15, 13.5), 22)  # jaw
    d = _join(d, _ellipsoid(p, (0, -93, 72), (19, 14, 17)), 14)  # chin
    return _join(d, _ellipsoid(p, (0, -60, 62), (29, 30, 25)), 16)  # around the teeth


def _neck(p: Points):
    d = _join(_rod(p, (0, -40, -36), (0, -200, -40), 49, 57), _rod(p, (54, -40, -30), (12, -185, 10), 11, 10), 20)
    d = _join(d, _rod(p, (0, -120, 10), (0, -130, 10), 8), 16)
    d = _join(d, _rod(p, (40, -130, -50), (120, -200, -45), 26, 30), 40)
    return _join(d, _ellipsoid(p, (0, -245, -38), (215, 66, 74)), 34)


SLIT_MM = [(17.2, -5.4, 74.6), (23, -8.2, 75.6), (31, -9.2, 76.4), (39, -7.8, 74), (46, -4, 69.2)]
"""Along the closed lids."""


def _eyes(d, p: Points):
    d = _join(
        d,
        _curve(p, [(0, 14, 79.5), (9, 14, 79.5), (22, 18.5, 76.5), (38, 18, 66.5), (51, 9, 47)], [5.5, 5.8, 6, 5.6, 5]),
        15,
    )  # brow
    d = _carve(d, _ellipsoid(p, (30, -3, 92), (20, 13, 17)), 12)
    d = _carve(d, _ellipsoid(p, (14.5, 2, 91), (6, 8, 9.5)), 12)
    d = _join(d, _ellipsoid(p, (31, -2.5, 64), (14.8, 12.5, 13)), 6)  # closed lid over the eyeball
    crease = [(18, 3, 76), (24, 6.2, 76.6), (32, 7.2, 76), (40, 5, 73.4), (46, 1, 68.8)]
    d = _carve(d, _curve(p, crease, [0.5, 0.9, 1, 0.4, -1.2]), 3.2)
    edge = [(17.4, -4.2, 72.2), (23, -6.7, 74.2), (31, -7.7, 75), (39, -6.2, 72), (46, -2.8, 66.4)]
    d = _join(d, _curve(p, edge, [1.2, 1.8, 1.9, 1.5, 0]), 3.4)
    d = _carve(d, _curve(p, SLIT_MM, [0.7, 1.1, 1.2, 1, 0.2]), 2.8)
    return _carve(d, _curve(p, [(17, -10, 80.5), (29, -17, 81.5), (42, -14, 75)], [0.3, 0.8, 0.4]), 10)


def _nose(d, p: Points):
    n = _curve(p, [(0, 10, 78), (0, 1, 79.5), (0, -9, 85), (0, -22, 93.5), (0, -34, 100)], [5.4, 5.6, 6.3, 7.4, 8.6])
    n = _join(n, _ellipsoid(p, (0, -24, 84), (15, 19, 12)), 10)
    n = _join(n, _ellipsoid(p, (0, -36.5, 100.5), (9.6, 8.4, 9)), 6)  # tip
    n = _join(n, _ellipsoid(p, (11.4, -40.2, 91.5), (6, 6.8, 10), y=-22), 8)  # wing
    n = _join(n, _rod(p, (0, -42, 99), (0, -46.5, 91), 3, 3.6), 4.5)
    d = _join(d, n, 10)
    wing = [(11, -32, 98), (16.5, -33.5, 95.5), (20.6, -38.5, 91), (21, -44, 88.5)]
    d = _carve(d, _curve(p, wing, [0.2, 0.6, 0.9, 0.7]), 5)
    d = _carve(d, _ellipsoid(p, (6.6, -45, 95), (3.2, 8, 5.6), y=-24, x=16), 1.6)  # nostril
    return _carve(d, _curve(p, [(20, -43, 92), (27, -54, 88), (32, -68, 83)], [0.3, 0.8, 0.3]), 11)


def lips(p: Points):
    """Distance to the red of the lips."""
    upper = _curve(p, [(0, -62, 87.8), (5, -61.4, 87.8), (13, -62.9, 84.8), (25, -66, 77)], [4.2, 4.2, 3.7, 1.4])
    lower = _curve(p, [(0, -71, 86), (8, -70.8, 85.4), (16, -69, 82.2), (25, -66.6, 76.6)], [5.4, 5.2, 4, 1.4])
    return upper, lower


MOUTH_MM = [(0, -66.6, 92.6), (7, -65.9, 92.2), (15, -66.3, 88.6), (26, -67, 80.4)]
"""Along the parting of the lips."""


def _mouth(d, p: Points):
    d = _carve(d, _rod(p, (0, -49, 94.4), (0, -56, 95), 1.3, 1.8), 6)
    for lip in lips(p):
        d = _join(d, lip, 3.5)
    d = _carve(d, _curve(p, MOUTH_MM, [0.9, 1, 0.9, 0.7]), 2.2)
    d = _carve(d, _ellipsoid(p, (28, -67, 83.5), (2.2, 2.6, 3.2)), 6)
    return _carve(d, _ellipsoid(p, (0, -82, 94), (15, 4, 4.5)), 10)


def ear(p: Points):
    """Distance to the ear."""
    q = _turned(_turned(_from(p, (70, -7, -14)), "y", 22), "x", -8)
    q = tuple(v / np.float32(0.93) for v in q)
    d = _ellipsoid(q, (0.5, 1, -8), (5.6, 30, 18))
    d = _carve(d, _ellipsoid(q, (10.4, 1, -7), (6, 26, 15.5)), 4)
    d = _carve(d, _ellipsoid(q, (6, -4, -5), (8.5, 11, 8)), 3)  # bowl
    rim = [
        (-2, -3, 0), (0, 1, 6.5), (3, 9, 9.5), (5, 19, 8.5), (6.5, 27, 2), (7.2, 30, -8), (7.6, 25, -19),
        (7.6, 13, -25), (6.6, -2, -23.5), (5, -14, -17), (3, -23, -10),
    ]  # fmt: skip
    d = _join(d, _curve(q, rim, [1.2, 2, 2.4, 2.6, 2.8, 3, 3, 2.8, 2.6, 2.6, 2.4]), 2.6)
    floor = [(1.5, 22, 0), (2.6, 25, -9), (3.2, 17, -19), (3.4, 3, -20.5), (3, -10, -15)]
    d = _join(d, _curve(q, floor, [2.6, 3, 3.2, 3, 2.6]), 3)
    fold = [(4, -13, -9), (5.8, -6, -15), (6.2, 4, -15.6), (5.4, 12, -12), (4, 18, -6)]
    d = _join(d, _curve(q, fold, [2.3, 2.6, 2.6, 2.2, 1.4]), 2.8)
    d = _join(d, _curve(q, [(5.6, 8, -14), (5, 16, -14), (4.2, 22, -12)], [2.2, 1.9, 1.2]), 2.2)
    d = _join(d, _ellipsoid(q, (1.8, -25, -5), (3.6, 7, 6.4)), 4)  # lobe
    d = _carve(d, _ellipsoid(q, (1, -5, -0.5), (6, 4, 3.6)), 2)
    d = _join(d, _ellipsoid(q, (3.4, -5.5, 5), (2.6, 5.4, 3.2)), 2.5)  # flap before the canal
    return _join(d, _ellipsoid(q, (4, -14.5, -5), (2.3, 2.8, 4)), 2.5) * np.float32(0.93)


def distance(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Signed distance in mm, roughly, to the skin at points; negative inside."""
    p = (np.sqrt(x * x + np.float32(0.04)), y, z)  # both halves from one, the seam rounded
    d = _join(_skull(p), _neck(p), 20)
    d = _mouth(_nose(_eyes(d, p), p), p)
    return _join(d, ear(p), 6)


def _steps(low: float, high: float, fine: Sequence[tuple[float, float, float]], coarse: float = 4.0) -> np.ndarray:
    """Grid lines with a spacing of its own in each (from, to, spacing)."""
    lines = [low]
    while lines[-1] < high:
        lines.append(lines[-1] + next((s for a, b, s in fine if a <= lines[-1] < b), coarse))
    return np.array(lines)


def grid(scale: float = 1.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lines of the sampling grid along x, y and z: close where the face has features."""
    fine_x = [(0, 14, 1.25), (14, 50, 1.15), (50, 66, 2.6), (66, 100, 1.3)]
    fine_y = [(-118, -80, 2.4), (-80, -56, 1.05), (-56, -30, 1.4), (-30, -16, 1.9), (-16, 10, 0.95), (10, 28, 1.6)]
    fine_z = [(-122, -42, 5.5), (-42, 4, 1.5), (4, 60, 3.0), (60, 116, 1.25)]
    scaled = [[(a, b, s * scale) for a, b, s in fine] for fine in (fine_x, fine_y, fine_z)]
    half = _steps(0.0, 142, scaled[0], 4 * scale)
    lines = _steps(BUST_MM, 126, scaled[1], 4 * scale), _steps(-126, 118, scaled[2], 4 * scale)
    return np.concatenate([-half[:0:-1], half]), *lines


def sampled(lines: tuple[np.ndarray, np.ndarray, np.ndarray]) -> np.ndarray:
    """Distances [X, Y, Z] on a grid; one half is computed, the other is its mirror."""
    xs, ys, zs = (line.astype("f4") for line in lines)
    half = distance(*np.meshgrid(xs[len(xs) // 2 :], ys, zs, indexing="ij"))
    return np.concatenate([half[:0:-1], half])


def surface_nets(values: np.ndarray, lines) -> tuple[np.ndarray, np.ndarray]:
    """Vertices [V, 3] and triangles [T, 3] of the zero level of a grid (Gibson 1998), outward.

    A vertex in each cell that the surface crosses, at the mean of its edge crossings; a quad around each such edge.
    """
    inside = values < 0
    shape = np.array(values.shape) - 1
    total, count = np.zeros((*shape, 3)), np.zeros(shape)
    offsets = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    index = np.stack(np.meshgrid(*(np.arange(n) for n in shape), indexing="ij"), axis=-1)
    window = lambda o: tuple(slice(o[a], o[a] + shape[a]) for a in range(3))  # noqa: E731
    for axis in range(3):
        for o in offsets[offsets[:, axis] == 0]:
            e = o.copy()
            e[axis] = 1
            a, b = values[window(o)], values[window(e)]
            crossed = inside[window(o)] != inside[window(e)]
            t = np.where(crossed, a / np.where(crossed, a - b, 1), 0)
            total += crossed[..., None] * (index + o + t[..., None] * np.eye(3)[axis])
            count += crossed
    cells = count > 0
    number = np.full(shape, -1)
    number[cells] = np.arange(cells.sum())
    place = total[cells] / count[cells][:, None]
    vertices = np.stack([np.interp(place[:, k], np.arange(len(lines[k])), lines[k]) for k in range(3)], axis=1)
    triangles = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        low = [slice(None)] * 3
        high = [slice(None)] * 3
        low[axis], high[axis] = slice(0, -1), slice(1, None)
        edges = np.argwhere(inside[tuple(low)] != inside[tuple(high)])
        edges = edges[((edges[:, [u, v]] > 0) & (edges[:, [u, v]] < shape[[u, v]])).all(axis=1)]
        corner = [
            edges - du * np.eye(3, dtype=int)[u] - dv * np.eye(3, dtype=int)[v]
            for du, dv in ((0, 0), (1, 0), (1, 1), (0, 1))
        ]
        quad = np.stack([number[tuple(c.T)] for c in corner], axis=1)
        flip = inside[tuple(edges.T)]
        quad[~flip] = quad[~flip][:, ::-1]
        triangles += [quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]]
    return vertices, np.concatenate(triangles)


def gradient(points: np.ndarray, step: float = 0.35) -> tuple[np.ndarray, np.ndarray]:
    """Outward unit normals [V, 3] of the distance function, and its slope [V]."""
    rise = np.stack(
        [
            np.subtract(*(distance(*(points + s * step * np.eye(3)[k]).T.astype("f4")) for s in (1, -1)))
            for k in range(3)
        ],
        axis=1,
    )
    length = np.linalg.norm(rise, axis=1)
    return rise / length[:, None], length / (2 * step)


def build(scale: float = 1.0) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, tuple]:
    """Vertices, normals, triangles of the head, and the grid of distances with its lines."""
    lines = grid(scale)
    values = sampled(lines)
    vertices, triangles = surface_nets(values, lines)
    free = vertices[:, 1] > BUST_MM + 1
    for _ in range(3):  # onto the zero level: the nets cut corners
        n, slope = gradient(vertices)
        d = distance(*vertices.T.astype("f4"))
        vertices = vertices - n * (np.clip(d / np.maximum(slope, 0.3), -1, 1) * 0.8 * free)[:, None]
    return vertices, gradient(vertices)[0], triangles, values, lines
