"""What tests of the renderer share: small shapes, even skies, samples taken without a file."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import lutgen
from lutgen import device as ocl
from lutgen.files.texture_maps import Maps
from lutgen.head.mesh import Mesh, normals
from lutgen.render import device_scene, film, flat_walk, progressive
from lutgen.scene.look import Look

PHOTONS = 32_768
FRONT = Look(azimuth=0, elevation=0, distance_mm=300, light_azimuth=0, light_elevation=0, light_size=0, bumps=0)
BARE = replace(FRONT, entry=0, specular=0)
"""Head-on, without what the surface does to light: transport alone."""
SUN = replace(BARE, environment=0, light=float(np.pi))
SKY = replace(BARE, environment=1, light=0)
EVEN = np.ones((4, 8, 3))


def plane(side: float = 1000.0) -> Mesh:
    """A square that faces +z."""
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], "f4") * (side / 2)
    toward = np.tile(np.array([0, 0, 1], "f4"), (4, 1))
    return Mesh(corners, toward, None, np.array([[0, 1, 2], [0, 2, 3]], "i4"))


def ball(radius: float, count: int = 48, inward: bool = False) -> Mesh:
    """A sphere of triangles."""
    down, around = np.pi * np.arange(count + 1) / count, 2 * np.pi * np.arange(2 * count + 1) / (2 * count)
    p = np.stack([
        np.sin(down)[:, None] * np.sin(around), np.repeat(np.cos(down)[:, None], 2 * count + 1, axis=1),
        np.sin(down)[:, None] * np.cos(around),
    ], axis=-1).reshape(-1, 3) * radius  # fmt: skip
    i = (np.arange(count)[:, None] * (2 * count + 1) + np.arange(2 * count)).ravel()
    quads = np.stack([i, i + 2 * count + 1, i + 2 * count + 2, i + 1], axis=1)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    corners = p[triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    triangles = triangles[area > 1e-9 * radius**2].astype("i4")
    triangles = triangles[:, ::-1] if inward else triangles
    return Mesh(p.astype("f4"), normals(p, triangles), None, np.ascontiguousarray(triangles))


def opened(
    shape: Mesh, look: Look, size: tuple[int, int] = (32, 32), given: Maps | None = None, around=None, luts=None, **more
) -> device_scene.DeviceScene:
    """A stage of the default set."""
    found = lutgen.load() if luts is None else luts
    return device_scene.open_scene(ocl.choose(), found, shape, given or Maps(), look, size, around, **more)


def sampled(scene: device_scene.DeviceScene, walk: flat_walk.Walk, samples: int) -> tuple[film.Film, dict[str, int]]:
    """A picture of that many samples, and what was counted."""
    start = film.empty(scene.size, walk.group, {})
    goal = progressive.Goal(samples)
    made, tally, _ = progressive.render(scene, walk, start, goal, lambda one, noise: None)
    return made, tally.counts


def mean(made: film.Film) -> tuple[np.ndarray, np.ndarray]:
    """Mean color [3] of the skin in a picture and its standard error."""
    share = made.mask.sum()
    return made.rgb.sum(axis=(0, 1)) / share, np.sqrt((made.sigma() ** 2).sum(axis=(0, 1))) / share
