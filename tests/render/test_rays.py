"""Rays against the tree meet what rays against every triangle meet, whatever their direction."""

import numpy as np
import pytest
from rendering import ball, plane

from lutgen import device as ocl
from lutgen.render import bvh

WIDTHS = 4, 8, 16


def traced(tree: bvh.Bvh, rays: np.ndarray, width: int, first: bool = False) -> np.ndarray:
    """Distance, both weights and triangle (-1: none) [N, 4] of rays [N, 8]: origin, farthest, direction, 0."""
    device = ocl.choose()
    kernel = ocl.kernel(device, "intersect", ocl.source("render/trace", "measure/intersect"), {"WIDTH": width})
    found = np.zeros((len(rays), 4), "f4")
    out = ocl.buffer(device, found)
    parts = [ocl.buffer(device, part) for part in (tree.boxes, tree.children, tree.triangles, tree.numbers)]
    rays = ocl.buffer(device, rays.astype("f4"))
    ocl.launch(device, kernel, (len(found),), rays, out, np.int32(first), *parts)
    return ocl.read(device, out, found)


def brute(corners: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """Distances [N] to the nearest triangle of corners [T, 3, 3], in double precision; inf: none."""
    a, ab, ac = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    out = np.full(len(rays), np.inf)
    for i, ray in enumerate(rays.astype(float)):
        p = np.cross(ray[4:7], ac)
        volume = (ab * p).sum(axis=1)
        inverse = 1 / np.where(volume == 0, np.inf, volume)
        s = ray[:3] - a
        u, q = (s * p).sum(axis=1) * inverse, np.cross(s, ab)
        v, t = (ray[4:7] * q).sum(axis=1) * inverse, (ac * q).sum(axis=1) * inverse
        met = (volume != 0) & (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t < ray[3])
        out[i] = t[met].min(initial=np.inf)
    return out


@pytest.mark.parametrize("width", WIDTHS)
def test_the_tree_finds_what_is_there(width):
    shape, rng = ball(50.0, 20), np.random.default_rng(4)
    rays = np.zeros((400, 8))
    rays[:, :3] = 80 * rng.standard_normal((400, 3))
    rays[:, 3] = np.where(np.arange(400) % 4, 1e9, 60.0)
    toward = 40 * rng.standard_normal((400, 3)) - rays[:, :3]
    rays[:, 4:7] = toward / np.linalg.norm(toward, axis=1, keepdims=True)
    tree = bvh.build(shape.positions_mm, shape.triangles, width)
    expected = brute(shape.positions_mm[shape.triangles].astype(float), rays.astype("f4"))
    found, some = traced(tree, rays, width), traced(tree, rays, width, first=True)
    numbers = found[:, 3].view("i4")
    met = np.isfinite(expected)
    assert 0.2 < met.mean() < 0.9
    assert np.array_equal(numbers >= 0, met)
    assert np.array_equal(some[:, 3].view("i4") >= 0, met)
    assert found[met, 0] == pytest.approx(expected[met], rel=1e-4)
    a, b, c = np.moveaxis(shape.positions_mm[shape.triangles[numbers[met]]], 1, 0)
    u, v = found[met, 1:2], found[met, 2:3]
    assert (1 - u - v) * a + u * b + v * c == pytest.approx(
        rays[met, :3] + expected[met, None] * rays[met, 4:7], abs=2e-3
    )


@pytest.mark.parametrize("zero", [0.0, -0.0])
def test_rays_along_an_axis_meet_flat_boxes(zero):
    """Of -0 the sign bit says one side and the comparison with 0 the other."""
    for axis in range(3):
        shape = plane(100.0)
        positions = np.roll(shape.positions_mm, axis + 1, axis=1)
        for sign in (1.0, -1.0):
            ray = np.full((1, 8), zero)
            ray[0, :3] = 7.0, 3.0, 5.0
            ray[0, axis], ray[0, 3] = -20 * sign, 1e9
            ray[0, 4 + axis] = sign
            found = traced(bvh.build(positions, shape.triangles, 4), ray, 4)
            assert found[0, 0] == pytest.approx(20)
