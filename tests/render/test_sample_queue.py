"""Pictures in stages around full walks: the LUT's color, the other flat walk's picture, texels, refusals."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from rendering import BARE, EVEN, PHOTONS, SKY, SUN, ball, mean, opened, plane, sampled
from test_render_laws import from_paths, skin_of

from lutgen.cli import main
from lutgen.errors import InputError
from lutgen.files.texture_maps import Maps
from lutgen.head.mesh import Mesh
from lutgen.render import film, flat_walk, mesh_walk, progressive
from lutgen.scene import light as lighting
from lutgen.scene.look import of_preset

SIGMAS = 4


def block(side: float = 120.0, depth: float = 60.0) -> Mesh:
    """A box with its front face at z = 0, corners of its own for each face."""
    box = trimesh.creation.box((side, side, depth))
    corners = np.asarray(box.vertices)[np.asarray(box.faces)].reshape(-1, 3) - (0, 0, depth / 2)
    toward = np.repeat(np.asarray(box.face_normals), 3, axis=0).astype("f4")
    return Mesh(corners.astype("f4"), toward, None, np.arange(len(corners), dtype="i4").reshape(-1, 3))


@pytest.mark.parametrize("light", ["sun", "sky"])
@pytest.mark.parametrize("walk", ["flat-full", "mesh"])
def test_skin_under_even_light_has_the_color_of_the_lut(walk, light):
    """Along the normal, without entry factors, in the middle of a plane or of a thick block's face."""
    look = replace(of_preset("light", SUN if light == "sun" else SKY), field_of_view=6.0)
    scene = opened(plane() if walk == "flat-full" else block(), look, around=EVEN)
    found, sigma = mean(sampled(scene, flat_walk.WALKS[walk](scene, 0), 160)[0])
    expected, of_paths = from_paths(scene.luts, skin_of(look))
    found, sigma = (v / (lighting.SUN if light == "sun" else 1) for v in (found, sigma))
    assert np.all(np.abs(found - expected) < SIGMAS * np.hypot(sigma, of_paths))
    assert np.all(sigma < 0.02 * expected)


@pytest.mark.parametrize("ratio", [None, 0.3])
def test_both_flat_walks_make_the_same_picture(ratio):
    """A ball under sun and sky, light from skin to skin, half of it with less melanin and blood by its map."""
    shape = ball(60.0)
    texels = np.ones((2, 2, 3), "f2")
    if ratio is not None:
        texels[:, 0, [0, 2]] = ratio
        around = np.arctan2(shape.positions_mm[:, 0], shape.positions_mm[:, 2]) / (2 * np.pi) + 0.5
        shape = replace(shape, uv=np.stack([around, np.full_like(around, 0.5)], axis=1).astype("f4"))
    look = replace(BARE, entry=1, specular=0, environment=1, light=2.0, light_azimuth=50.0, field_of_view=30.0)
    scene = opened(shape, look, (24, 24), Maps(chromophores=texels), EVEN)
    full, one = mean(sampled(scene, flat_walk.WALKS["flat-full"](scene, 0), 240)[0])
    drawn, two = mean(sampled(scene, flat_walk.flat(scene, photons=4 * PHOTONS), 100)[0])
    assert np.all(np.abs(full - drawn) < SIGMAS * np.hypot(one, two) + 0.004 * drawn)  # rings and angles of the table
    least = mesh_walk.least_absorption(scene)
    if ratio is None:
        plain = least
        assert np.all(plain > 1.02 * scene.luts.paths.nu_per_mm)
    else:
        assert np.all(least < mesh_walk.least_absorption(opened(shape, look)))
        assert np.all(least >= 0.999 * scene.luts.paths.nu_per_mm)


def test_thin_skin_lets_light_through_by_the_walk_inside_only():
    """A sheet 2 mm thick lit from behind: red comes through it, more than other colors; under flat skin none does."""
    look = replace(SUN, light_azimuth=180.0, field_of_view=6.0)
    seen = {}
    for walk in ("flat-full", "mesh"):
        scene = opened(block(60.0, 2.0), look)
        seen[walk], sigma = mean(sampled(scene, flat_walk.WALKS[walk](scene, 0), 80)[0])
        seen[walk, "sigma"] = sigma
    assert np.all(seen["flat-full"] == 0)
    red, green, blue = seen["mesh"]
    assert red > 4 * seen["mesh", "sigma"][0]
    assert red > 2 * green > 2 * blue


def test_a_mesh_with_holes_is_refused():
    with pytest.raises(InputError, match="hole.*--walk flat"):
        flat_walk.WALKS["mesh"](opened(plane(), SUN), 0)


def test_the_command_says_what_a_walk_inside_needs(tmp_path, capsys):
    """Status 2 and one line for a mesh with a hole in its face; nothing is written."""
    made = ball(120.0, 24)
    front = made.positions_mm[made.triangles][:, :, 2].min(axis=1) > 110
    trimesh.Trimesh(made.positions_mm, made.triangles[~front], process=False).export(tmp_path / "open.obj")
    out = tmp_path / "open.exr"
    command = [
        "render",
        "--mesh",
        str(tmp_path / "open.obj"),
        "--mm-per-unit",
        "1",
        "--walk",
        "mesh",
        "--out",
        str(out),
        "--quiet",
    ]
    assert main([*command, "--size", "16x16", "--spp", "8"]) == 2
    said = capsys.readouterr().err.strip()
    assert "1 hole, " in said
    assert "close them in your editor, or use --walk flat" in said
    assert "\n" not in said
    assert not out.exists()


def test_the_same_seed_makes_the_same_picture():
    """Whether in one run or in two."""
    scene = opened(ball(60.0), replace(SUN, field_of_view=20.0), (16, 16), around=EVEN)
    K = len(scene.luts.weights)
    once, _ = sampled(scene, flat_walk.WALKS["mesh"](scene, 3), 4 * K)
    walk = flat_walk.WALKS["mesh"](scene, 3)
    made = film.empty(scene.size, walk.group, {})
    for goal in (2 * K, 4 * K):
        made, _, _ = progressive.render(scene, walk, made, progressive.Goal(goal), lambda one, noise: None)
    assert made.samples == once.samples
    assert np.allclose(made.sums, once.sums, rtol=1e-6, atol=1e-7)
    other, _ = sampled(scene, flat_walk.WALKS["mesh"](scene, 4), 4 * K)
    assert not np.allclose(other.sums, once.sums, rtol=1e-3)
