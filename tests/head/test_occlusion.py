"""Open sky and thickness of shapes that are known: balls, cups, slabs, tubes; with holes or without."""

import numpy as np
import pytest
import trimesh

from lutgen.head import mesh, occlusion


def around(shape: trimesh.Trimesh):
    positions, triangles = np.array(shape.vertices), np.array(shape.faces, "i4")
    return positions, *occlusion.around(positions, mesh.normals(positions, triangles), triangles)


def slab(thickness: float) -> trimesh.Trimesh:
    """Two squares of 60 mm, one above the other, facing away from each other, open at the sides."""
    sheet = trimesh.Trimesh([[-30, -30, 0], [30, -30, 0], [30, 30, 0], [-30, 30, 0]], [[0, 1, 2], [0, 2, 3]])
    for _ in range(4):
        sheet = sheet.subdivide()
    below = trimesh.Trimesh(sheet.vertices - [0, 0, thickness], sheet.faces[:, ::-1])
    return trimesh.util.concatenate([sheet, below])


def tube(radius: float) -> trimesh.Trimesh:
    wall = trimesh.creation.cylinder(radius, 60, sections=48)
    for _ in range(2):
        wall = wall.subdivide()
    return wall


def test_a_ball_sees_the_whole_sky():
    for shape in (trimesh.creation.icosphere(3, 60), trimesh.creation.uv_sphere(radius=60, count=[16, 16])):
        _, seen, thick = around(shape)
        assert seen.min() >= 0.97
        assert thick.min() == occlusion.THICKEST_MM


def test_the_inside_of_a_cup_sees_as_much_as_its_mouth_lets_in():
    """At the bottom of a well of radius r and depth d a cosine-weighted share r^2 / (r^2 + d^2) of the sky is open."""
    outer, hole = tube(25), tube(20)
    hole.apply_translation([0, 0, 10])
    ring = trimesh.Trimesh(*_without_cap(hole, top=True))
    ring.invert()
    cup = trimesh.util.concatenate([trimesh.Trimesh(*_without_cap(outer, top=True)), ring])
    positions, seen, _ = around(cup)
    bottom = (np.hypot(*positions[:, :2].T) < 1) & (np.abs(positions[:, 2] + 20) < 0.1)
    assert bottom.any()
    expected = 20**2 / (20**2 + 60**2)  # the hole's walls end 10 mm above the cup's
    assert seen[bottom] == pytest.approx(np.full(bottom.sum(), expected), abs=0.06)
    outside = (np.hypot(*positions[:, :2].T) > 24.9) & (np.abs(positions[:, 2]) < 15)
    assert seen[outside].min() > 0.9


def _without_cap(shape: trimesh.Trimesh, top: bool):
    high = shape.vertices[:, 2].max()
    lid = np.all(shape.vertices[shape.faces][:, :, 2] > high - 1e-6, axis=1)
    return shape.vertices, shape.faces[~lid] if top else shape.faces


@pytest.mark.parametrize("thickness", [3.0, 6.0, 15.0])
@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_a_slab_is_as_thick_as_it_is(thickness, turn):
    shape = slab(thickness)
    middle = np.all(np.abs(shape.vertices[:, :2]) < 10, axis=1)
    shape.apply_transform(trimesh.transformations.rotation_matrix(turn, [0.3, 1, 0.2]))
    _, seen, thick = around(shape)
    assert np.abs(thick[middle] - thickness).max() < 0.7
    assert seen.min() > 0.95


def test_sheets_with_holes_and_loose_triangles_are_no_obstacle():
    ball = trimesh.creation.icosphere(3, 60)
    keep = np.random.default_rng(2).random(len(ball.faces)) > 0.3
    torn = trimesh.Trimesh(ball.vertices, ball.faces[keep], process=False)
    _, seen, thick = around(torn)
    assert np.all(np.isfinite(seen) & np.isfinite(thick))
    assert np.quantile(seen, 0.05) > 0.9
    loose = trimesh.Trimesh([[0, 0, 0], [9, 0, 0], [0, 9, 0.0]], [[0, 1, 2], [0, 0, 1]], process=False)
    _, seen, thick = around(loose)
    assert seen == pytest.approx(np.ones(3), abs=0.05)
    assert np.all(thick == occlusion.THICKEST_MM)


def test_a_mesh_of_meters_is_sampled_more_coarsely():
    _, seen, thick = around(trimesh.creation.box((8000, 90, 90)))
    assert np.all(seen > 0.9)
    assert np.all(np.isfinite(thick))
