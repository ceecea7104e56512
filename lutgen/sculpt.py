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
    one = np.sqrt(sum((v * a) ** 2 for v, a in zip(q, k, strict=True))) + np.float32(1e-9)
    two = np.sqrt(sum((v * a * a) ** 2 for v, a in zip(q, k, strict=True))) + np.float32(1e-9)
    return one * (one - 1) / two


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
    at = np.linspace(0, len(points) - 1, 3 * len(points) - 2)
    k, t = np.minimum(at.astype(int), len(points) - 2), 0.0
    t = (at - k)[:, None]
    a, b, c, d = (padded[k + i] for i in range(4))
    line = 0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t**2 + (3 * b - a - 3 * c + d) * t**3)
    thick = np.interp(at, np.arange(len(points)), radii)
    rods = (_rod(p, line[i], line[i + 1], thick[i], thick[i + 1]) for i in range(len(line) - 1))
    return reduce(np.minimum, rods)


def _skull(p: Points):
    d = _ellipsoid(p, (0, 34, -12), (71, 72, 88))
    d = _join(d, _ellipsoid(p, (0, 32, 27), (57, 49, 58)), 26)  # forehead
    d = _join(d, _ellipsoid(p, (0, -12, -14), (68, 62, 56)), 22)  # temples and the root of the ear
    d = _join(d, _ellipsoid(p, (0, -38, 28), (54, 68, 56)), 22)  # face
    d = _join(d, _ellipsoid(p, (37, -22, 44), (25, 18, 25)), 18)  # cheekbone
    d = _join(d, _ellipsoid(p, (29, -48, 46), (24, 28, 28)), 20)  # cheek
    d = _join(d, _ellipsoid(p, (36, -46, 20), (18, 24, 26)), 22)  # chewing muscle
    d = _join(d, _rod(p, (49, -54, -4), (15, -92, 64), 15, 13.5), 22)  # jaw
    d = _join(d, _ellipsoid(p, (0, -93, 72), (19, 14, 17)), 14)  # chin
    return _join(d, _ellipsoid(p, (0, -60, 62), (29, 30, 25)), 16)  # around the teeth


def _neck(p: Points):
    d = _join(_rod(p, (0, -40, -36), (0, -200, -40), 49, 57), _rod(p, (54, -40, -30), (12, -185, 10), 11, 10), 20)
    d = _join(d, _rod(p, (0, -120, 10), (0, -130, 10), 8), 16)
    d = _join(d, _rod(p, (40, -130, -50), (120, -200, -45), 26, 30), 40)
    return _join(d, _ellipsoid(p, (0, -245, -38), (215, 66, 74)), 34)


SLIT_MM = [(17.2, -5.4, 73.2), (23, -8.2, 75.4), (31, -9.2, 76), (39, -7.8, 73), (46, -4, 65.5)]
"""Along the closed lids."""


def _eyes(d, p: Points):
    d = _join(d, _curve(p, [(8, 14, 81), (22, 19, 77.5), (38, 18, 67), (51, 9, 47)], [6.3, 6.5, 6, 5]), 14)  # brow
    d = _carve(d, _ellipsoid(p, (30, -3, 92), (20, 13, 17)), 12)
    d = _carve(d, _ellipsoid(p, (15, 0, 90), (7, 9, 10)), 9)
    d = _join(d, _ellipsoid(p, (31, -2.5, 64), (14.8, 12.5, 13)), 6)  # closed lid over the eyeball
    crease = [(18, 3, 75.5), (24, 6.2, 76.8), (32, 7.2, 76.6), (40, 5, 72.5), (46, 1, 66)]
    d = _carve(d, _curve(p, crease, [0.5, 0.9, 1, 0.9, 0.5]), 3)
    edge = [(17.4, -4.2, 72.2), (23, -6.7, 74.2), (31, -7.7, 75), (39, -6.2, 71.8), (46, -2.8, 64.6)]
    d = _join(d, _curve(p, edge, [1.2, 1.8, 1.9, 1.8, 1.2]), 3)
    d = _carve(d, _curve(p, SLIT_MM, [0.9, 1.2, 1.3, 1.2, 0.9]), 2.6)
    return _carve(d, _curve(p, [(18, -13, 79), (29, -18, 80.5), (42, -14, 74)], [0.5, 1, 0.5]), 6)


def _nose(d, p: Points):
    n = _curve(p, [(0, 12, 80), (0, -6, 85.5), (0, -22, 94), (0, -34, 100)], [6, 6.2, 7.4, 9])
    n = _join(n, _ellipsoid(p, (0, -26, 84), (15, 17, 12)), 8)
    n = _join(n, _ellipsoid(p, (0, -36, 100.5), (10, 9, 9.5)), 5)  # tip
    n = _join(n, _ellipsoid(p, (11.6, -39.5, 91), (6.4, 7.2, 9.5), y=-20), 5.5)  # wing
    n = _join(n, _rod(p, (0, -42, 99), (0, -46, 90), 3.4, 4), 5)
    d = _join(d, n, 8)
    d = _carve(d, _ellipsoid(p, (19, -38, 95), (1.5, 7, 6), y=-30), 4)
    d = _carve(d, _ellipsoid(p, (6.4, -47, 95), (2.8, 4.2, 5.4), y=-22, x=20), 2.2)  # nostril
    return _carve(d, _curve(p, [(20, -42, 94), (28, -55, 89), (32, -68, 83)], [0.5, 1, 0.5]), 10)


def lips(p: Points):
    """Distance to the red of the lips."""
    upper = _curve(
        p, [(0, -60.6, 89.2), (5.5, -59.6, 89.4), (14, -62.2, 86.2), (25, -65.6, 78.5)], [3.9, 4.1, 3.5, 1.5]
    )
    lower = _curve(p, [(0, -70.6, 87.6), (9, -70.2, 86.8), (17, -68, 83.2), (25, -66, 78)], [5, 4.7, 3.4, 1.5])
    return upper, lower


MOUTH_MM = [(0, -65.2, 94.2), (7, -64.6, 93.6), (15, -65.6, 90), (26, -66.4, 82)]


def _mouth(d, p: Points):
    d = _carve(d, _rod(p, (0, -50, 93.5), (0, -56, 94.5), 1.4, 1.8), 4.5)
    for lip in lips(p):
        d = _join(d, lip, 5)
    d = _carve(d, _curve(p, MOUTH_MM, [1.2, 1.2, 1.1, 0.8]), 2)
    d = _carve(d, _ellipsoid(p, (28, -66.4, 84.5), (2.4, 3, 3.5)), 5)
    return _carve(d, _ellipsoid(p, (0, -81, 92.5), (14, 4, 4.5)), 8)


def ear(p: Points):
    """Distance to the ear."""
    q = _turned(_turned(_from(p, (70, -7, -14)), "y", 20), "x", -8)
    q = tuple(v / np.float32(0.93) for v in q)
    d = _ellipsoid(q, (1.5, 0, -8), (6.2, 30, 18.5))
    d = _carve(d, _ellipsoid(q, (10, -1, -5), (6.6, 28, 17)), 3)
    rim = [
        (-1, -2, 8),
        (4, 14, 10),
        (6, 27, 3),
        (7, 30, -9),
        (7.5, 24, -20),
        (7.5, 10, -26),
        (6, -6, -23),
        (4, -20, -13),
    ]
    inner = [(4, 16, -7), (5, 8, -14), (5, -4, -15), (4, -14, -9)]
    ridges = _join(_curve(q, rim, [3, 3.2, 3.3, 3.4, 3.4, 3.1, 2.8, 2.5]), _curve(q, inner, [2.2, 2.5, 2.6, 2.4]), 2.5)
    d = _join(d, ridges, 3.5)
    d = _join(d, _ellipsoid(q, (1, -26, -3), (4, 7, 6.5)), 5)  # lobe
    d = _carve(d, _ellipsoid(q, (7, -3, -3.5), (8.5, 11.5, 7.5)), 3)
    return _join(d, _ellipsoid(q, (3, -5, 6.5), (3.2, 6.5, 3.8)), 3) * np.float32(0.93)


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
    fine_x = [(0, 14, 1.5), (14, 50, 1.25), (50, 66, 2.6), (66, 100, 1.6)]
    fine_y = [(-118, -80, 2.4), (-80, -48, 1.25), (-48, -30, 1.5), (-30, -16, 1.9), (-16, 10, 1.1), (10, 32, 2.0)]
    fine_z = [(-122, -45, 5.0), (-45, 4, 1.9), (4, 60, 2.6), (60, 116, 1.5)]
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
