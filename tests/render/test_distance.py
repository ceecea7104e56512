"""Depths under a closed mesh, and which meshes are closed."""

import numpy as np
import pytest
import trimesh

from lutgen import device as ocl
from lutgen.errors import InputError
from lutgen.head import builtin, mend
from lutgen.render import distance


def sphere(radius: float, subdivisions: int = 4):
    made = trimesh.creation.icosphere(subdivisions, radius)
    return np.asarray(made.vertices), np.asarray(made.faces)


def depths_at(points: np.ndarray, positions, triangles, depths: distance.Depths):
    """Exact depths [N], the grid's [N] and its gradients [N, 3]."""
    device, N = ocl.choose(), len(points)
    exact, found = np.empty(N, "f4"), np.empty((N, 4), "f4")
    buffers = ocl.buffer(device, exact), ocl.buffer(device, found)
    ocl.launch(
        device, distance.kernel(device, "depths"), (N,), ocl.buffer(device, points.astype("f4")), *buffers,
        *distance.buffers(device, depths), *distance.tree_buffers(device, positions, triangles),
    )  # fmt: skip
    ocl.read(device, buffers[0], exact)
    ocl.read(device, buffers[1], found)
    return exact.astype(float), found[:, 3].astype(float), found[:, :3].astype(float)


def test_depths_of_a_sphere_are_its_radius_less_the_distance_to_its_middle():
    """Exact ones to what a facet cuts off (R (1 - cos) of half an edge), the grid's near the surface to what a cell's
    curvature adds (h^2 / 4 R), their gradients to h / R."""
    R, h = 8.0, 0.25
    positions, triangles = sphere(R)
    depths = distance.of_mesh(positions, triangles, 0.1, ocl.choose(), h)
    rng = np.random.default_rng(2)
    way = rng.normal(size=(4096, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    radius = np.concatenate([rng.uniform(R - 0.6, R + 0.3, 2048), rng.uniform(0, R, 2048)])
    exact, found, rise = depths_at(way * radius[:, None], positions, triangles, depths)
    edge = np.linalg.norm(positions[triangles[:, 0]] - positions[triangles[:, 1]], axis=1).max()
    facet = R * (1 - np.cos(edge / R / 2)) * 1.5
    assert np.abs(exact - (R - radius)).max() < facet
    near = np.arange(4096) < 2048
    assert np.abs(found - exact)[near].max() < h**2 / 4 / R + 2 * facet
    slope = np.linalg.norm(rise, axis=1)
    assert np.abs(slope[near] - 1).max() < h / R + edge / R
    assert np.einsum("ij,ij->i", -rise[near] / slope[near, None], way[near]).min() > 1 - (edge / R) ** 2
    deep = slope == 0
    assert deep.any()
    assert np.all(found[deep] <= exact[deep] + 1e-4)  # a bound never promises more room than there is


def signs(points: np.ndarray, positions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Whether points [N] are inside."""
    one = np.zeros((1, 1, 1), "f4")
    none = distance.Depths(np.zeros(3), 1.0, 1.0, one, one.astype("i4") - 1, one.astype("i2"))
    return depths_at(points, positions, triangles, none)[0] > 0


def test_inside_is_inside_however_the_mesh_is_turned():
    """A thin box at 20 angles, with points around its edges and corners."""
    rng = np.random.default_rng(5)
    box = trimesh.creation.box((6.0, 3.0, 1.0))
    for _ in range(20):
        turn = trimesh.transformations.random_rotation_matrix(rng.random(3))[:3, :3]
        positions, triangles = mend.surface(np.asarray(box.vertices) @ turn.T, np.asarray(box.faces))[:2]
        local = rng.choice([-1.0, 0.0, 1.0], (512, 3)) * (3, 1.5, 0.5) + rng.choice([-1e-2, 1e-2], (512, 3))
        inside = np.all(np.abs(local) < (3, 1.5, 0.5), axis=1)
        assert np.array_equal(signs(local @ turn.T, positions, triangles), inside)


def test_no_ray_is_fooled_by_the_edge_that_it_meets():
    """Points from which the first ray of distance.cl runs into an edge, or into a corner, of an octahedron."""
    octahedron = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
    faces = np.array([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]], "i4")
    rng = np.random.default_rng(6)
    ends = octahedron[faces[rng.integers(0, 8, 20_000)][:, :2]]
    share = rng.choice([0.0, 0.25, 0.5, 1.0], 20_000)[:, None]
    points = ends[:, 0] * share + ends[:, 1] * (1 - share)
    points -= np.array([0.5377, 0.7123, 0.4511]) * rng.uniform(0.02, 2.5, 20_000)[:, None]
    size = np.abs(points).sum(axis=1)
    clear = np.abs(size - 1) > 1e-3
    assert np.array_equal(signs(points[clear], octahedron, faces), size[clear] < 1)


def test_depths_are_kept_and_come_back_the_same(monkeypatch, tmp_path):
    monkeypatch.setenv("LUTGEN_CACHE", str(tmp_path))
    positions, triangles = sphere(4.0, 2)
    first = distance.of_mesh(positions, triangles, 0.1, ocl.choose())
    monkeypatch.setattr(distance, "_make", lambda *given: pytest.fail("made anew"))
    again = distance.of_mesh(positions, triangles, 0.1, ocl.choose())
    assert np.array_equal(first.values, again.values)
    assert np.array_equal(first.middles, again.middles)


def test_the_built_in_head_is_closed_at_its_neck():
    made = builtin.builtin()
    positions, triangles, notes = mend.surface(made.positions_mm, made.triangles)
    assert "closed with a flat cap" in notes[-1]
    solid = trimesh.Trimesh(positions, triangles, process=False)
    assert solid.is_watertight
    assert solid.volume > 0


def test_meshes_that_no_walk_can_be_inside_of_are_refused_in_a_line():
    positions, triangles = sphere(40.0, 3)
    up = positions[triangles].mean(axis=1)
    holed = triangles[up[:, 2] < 35]
    with pytest.raises(InputError, match=r"1 hole, \d+ open edges, the largest \d+\.\d mm wide.*--walk flat"):
        mend.surface(positions, holed)
    with pytest.raises(InputError, match="face inward"):
        mend.surface(positions, triangles[:, ::-1])
    some = triangles.copy()
    some[:5] = some[:5, ::-1]
    with pytest.raises(InputError, match=r"at \d+ edges both triangles face opposite ways"):
        mend.surface(positions, some)
    with pytest.raises(InputError, match="degenerate"):
        mend.surface(positions, triangles[:, [0, 0, 1]])
    mended = mend.surface(positions, np.concatenate([triangles, triangles[:3, [0, 0, 1]]]))
    assert len(mended[1]) == len(triangles)
    assert "3 degenerate triangles" in mended[2][0]


def test_seams_are_welded():
    positions, triangles = sphere(20.0, 2)
    apart = positions[triangles].reshape(-1, 3)  # every triangle with corners of its own
    welded = mend.surface(apart, np.arange(len(apart)).reshape(-1, 3))
    assert len(welded[0]) == len(positions)
    assert not welded[2]
