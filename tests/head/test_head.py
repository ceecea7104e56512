"""The built-in head: closed, even, of human proportions, and painted where blood and pigment are."""

import numpy as np
import pytest

from lutgen.head import builtin, mesh, paint, sculpt


@pytest.fixture(scope="module")
def shape():
    """The head and its maps, from the cache: its key is the text of the modules that make them."""
    head = builtin.builtin()
    return head, paint.paint(head)


def merged(shape: mesh.Mesh) -> np.ndarray:
    """Triangles over places instead of vertices: both sides of the seam are one."""
    _, place = np.unique(np.round(shape.positions_mm, 4), axis=0, return_inverse=True)
    return place.ravel()[shape.triangles]


def test_it_is_closed_but_for_the_cut(shape):
    triangles = merged(shape[0])
    edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    each, count = np.unique(edges, axis=0, return_counts=True)
    places = np.unique(np.round(shape[0].positions_mm, 4), axis=0)
    open_edges = each[count == 1]
    assert set(count) <= {1, 2, 4}  # 4 where two sheets touch in one cell
    assert (count == 4).sum() < 30
    sides, low = np.abs(places[open_edges][..., 0]) > 135, places[open_edges][..., 1] < sculpt.BUST_MM + 8
    assert np.all(sides | low)  # the bust is cut off below, and the shoulders at the sides
    assert len(open_edges) < 500


def test_triangles_have_area_and_face_outward(shape):
    v, t = shape[0].positions_mm.astype(float), shape[0].triangles
    normal = np.cross(v[t[:, 1]] - v[t[:, 0]], v[t[:, 2]] - v[t[:, 0]])
    area = np.linalg.norm(normal, axis=1) / 2
    assert area.min() > 1e-6
    outward = (normal * shape[0].normals[t[:, 0]]).sum(axis=1)
    assert (outward > 0).mean() > 0.999
    assert 20_000 < len(v) < 40_000


def test_both_halves_are_alike(shape):
    v = np.unique(np.round(shape[0].positions_mm, 2), axis=0)
    mirrored = np.unique(v * [-1, 1, 1] + 0.0, axis=0)
    assert len(v) == len(mirrored)
    assert np.abs(v[np.lexsort(v.T)] - mirrored[np.lexsort(mirrored.T)]).max() < 0.05


def test_texture_coordinates_lie_in_the_texture_and_do_not_wrap(shape):
    uv = shape[0].uv
    assert 0 <= uv.min() <= uv.max() <= 1
    assert (np.ptp(uv[shape[0].triangles][..., 0], axis=1) > 0.5).sum() < 20  # around the pole at the crown


def test_no_triangle_lies_upside_down_in_the_texture(shape):
    """Else the front of an ear and its back would share texels; what is left is around the pole at the crown."""
    head, _ = shape
    a, b, c = (head.uv[head.triangles[:, k]].astype(float) for k in range(3))
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    below = head.positions_mm[head.triangles].mean(axis=1)[:, 1] < 90
    assert (area[below] <= 0).mean() < 0.001
    around = np.arctan2(head.positions_mm[:, 0], head.positions_mm[:, 2] + 20)
    plain = np.stack([around / 7, head.positions_mm[:, 1] / 340], axis=1)
    assert np.array_equal(builtin.unfolded(plain, head.triangles[:0], np.ones(len(plain), bool)), plain)


# Means and standard deviations of men and women, mm (Gordon et al. 2014, ANSUR II; nose and mouth: Farkas 1994).
PUBLISHED = {
    "head breadth": (151, 7), "head length": (193, 9), "bizygomatic breadth": (138, 7), "menton to sellion": (117, 8),
    "nose breadth": (34, 4), "ear length": (62, 5), "head height": (229, 12),
}  # fmt: skip


def measures(v: np.ndarray) -> dict[str, float]:
    x, y, z = np.abs(v[:, 0]), v[:, 1], v[:, 2]
    middle = x < 1.5
    above_ears = (y > 30) & (y < 70)
    chin = y[middle & (z > 55) & (y < -80)].min()
    ear = (x > 74) & (np.abs(y) < 60) & (z > -50) & (z < 10)
    sellion = y[middle & (y > -10) & (y < 25)][z[middle & (y > -10) & (y < 25)].argmin()]
    return {
        "head breadth": 2 * x[above_ears].max(),
        "head length": z[middle & (y > 10) & (y < 40)].max() - z[y > 0].min(),
        "bizygomatic breadth": 2 * x[(y > -35) & (y < -10) & (z > 15)].max(),
        "menton to sellion": sellion - chin,
        "nose breadth": 2 * x[(z > 84) & (y > -48) & (y < -32) & (x < 25)].max(),
        "ear length": np.ptp(y[ear]),
        "head height": y.max() - chin,
    }


def test_proportions_are_those_of_people(shape):
    measured = measures(shape[0].positions_mm.astype(float))
    off = {name: (measured[name] - mean) / sd for name, (mean, sd) in PUBLISHED.items()}
    assert all(abs(z) <= 2 for z in off.values()), (measured, off)


def texel(shape: mesh.Mesh, near) -> tuple[int, int]:
    """Row and column of the map texel of the vertex nearest to a place."""
    k = np.linalg.norm(shape.positions_mm - near, axis=1).argmin()
    assert shape.uv is not None
    u, v = shape.uv[k] * paint.MAP_SIZE
    return int(v), int(u)


def test_maps_know_lips_ears_and_lids(shape):
    head, maps = shape
    melanin, eumelanin, hemoglobin = np.moveaxis(maps["chromophores"], -1, 0)
    forehead = hemoglobin[texel(head, (0, 60, 80))]
    assert hemoglobin[texel(head, (0, -71, 92))] > 1.8 * forehead
    assert hemoglobin[texel(head, (78, -7, -25))] > 1.2 * forehead
    assert np.all(eumelanin == 1)
    assert 0.3 < melanin.min() < 1 < melanin.max()
    surface = maps["surface"]
    assert np.all(np.isfinite(surface))
    assert surface[texel(head, (0, 60, 80))][2] > 0.9  # open sky over the forehead
    assert surface[texel(head, (0, -115, 20))][2] < 0.8  # less under the chin
    rim = [surface[texel(head, (80, y, -30))][3] * 32 for y in (-10, 0, 10, 20)]
    assert min(rim) < 9 < 25 < surface[texel(head, (0, 60, 80))][3] * 32


def test_no_seam_shows(shape):
    """What is painted by place is alike on both sides of the seam."""
    head, maps = shape
    _, place, count = np.unique(np.round(head.positions_mm, 4), axis=0, return_inverse=True, return_counts=True)
    doubled = np.flatnonzero(count[place.ravel()] > 1)
    assert len(doubled) > 50
    texels = np.clip((head.uv[doubled] * paint.MAP_SIZE).astype(int), 0, paint.MAP_SIZE - 1)
    values = maps["chromophores"][texels[:, 1], texels[:, 0]]
    for k in np.unique(place.ravel()[doubled]):
        pair = values[place.ravel()[doubled] == k]
        assert np.abs(pair[0] - pair[1]).max() < 0.2
