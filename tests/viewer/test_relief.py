"""Relief in the viewer: it moves light about but adds none, and what is too fine to be seen makes the skin rougher."""

import importlib

import numpy as np
import pytest

import lutgen
from lutgen.files.texture_maps import Maps
from lutgen.head import pores
from lutgen.head.mesh import Mesh
from lutgen.scene import subject, surface
from lutgen.scene.look import Look
from lutgen.skin.tissue import REFRACTIVE_INDEX, specular

_NAMES = "app", "gl", "passes", "stage"
app, gl, passes, stages = (importlib.import_module(f"lutgen.viewer.{n}") for n in _NAMES)
LOOK = {"azimuth": 0, "elevation": 0, "environment": 0, "target_mm": (0, 0, 0), "light_size": 0}


@pytest.fixture(scope="module")
def plane():
    """A square of 1 m that faces the camera, without maps and texture coordinates."""
    corners = np.array([[-500, -500, 0], [500, -500, 0], [500, 500, 0], [-500, 500, 0]], "f4")
    normals = np.tile(np.array([0, 0, 1], "f4"), (4, 1))
    square = Mesh(corners, normals, None, np.array([[0, 1, 2], [0, 2, 3]], "i4"))
    stage = app.open_stage(lutgen.load(), square, Maps(), (160, 160))
    yield stage
    stages.release(stage)
    gl.check()


def layer(stage, name: str, **values) -> np.ndarray:
    """A layer [320, 320, 4] of the first pass."""
    passes.draw(stage, Look(**(LOOK | values)))
    names = "entering", "facing", "skin", "reflected"
    width = 160 * stages.SAMPLES
    texture = stage.targets[names[names.index(name)]]
    kind = texture.dtype
    return np.frombuffer(texture.read(), {"f4": "f4", "f2": "f2"}[kind]).reshape(width, width, 4).astype(float)


@pytest.mark.parametrize("angle", [0, 30, 60])
@pytest.mark.parametrize("distance", [60, 300])
def test_relief_adds_no_light(plane, angle, distance):
    """The light that enters, over all pixels, is what enters a smooth plane; pores shade and brighten by as much."""
    values = {"light_azimuth": angle, "light_elevation": 0, "distance_mm": distance, "entry": 0}
    smooth, rough = (layer(plane, "entering", bumps=b, **values)[..., :3] for b in (0, 1))
    assert smooth.std(axis=(0, 1)).max() < 1e-4 * smooth.mean()
    assert rough.mean() == pytest.approx(smooth.mean(), rel=0.005)
    if angle:
        assert rough.std() > 0.02 * smooth.mean()  # and they do show


def test_without_bumps_the_normal_is_the_mesh_s(plane):
    values = {"light_azimuth": 20, "light_elevation": 10, "distance_mm": 80, "bumps": 0}
    reflected = layer(plane, "reflected", **values)
    kept = plane.maps["pores"]
    plane.maps["pores"] = gl.image(np.array([[[0.0, 0.0, 0.0, 1.0]]], "f4"))
    flat = layer(plane, "reflected", **values)
    plane.maps["pores"].release()
    plane.maps["pores"] = kept
    assert np.array_equal(reflected, flat)


def test_pores_break_up_the_highlight_near_and_widen_it_far(plane):
    """Near, a highlight varies from pixel to pixel; from afar it is even, and dimmer than a smooth plane's."""
    values = {"light_azimuth": 0, "light_elevation": 0}
    near = layer(plane, "reflected", distance_mm=60, **values)[100:220, 100:220, 0]
    far = layer(plane, "reflected", distance_mm=3000, **values)[158:162, 158:162, 0]
    smooth = layer(plane, "reflected", distance_mm=3000, bumps=0, **values)[158:162, 158:162, 0]
    assert near.std() > 0.1 * near.mean()
    assert far.std() < 0.05 * far.mean()
    assert far.mean() < 0.9 * smooth.mean()


def rougher(pairs: np.ndarray) -> np.ndarray:
    """What the shader makes of (roughness, variance) pairs [N, 2]."""
    source = "#version 330\n" + gl.splice("pores.glsl") + (
        "uniform sampler2D pairs; out vec4 pixel;"
        "void main() { vec2 p = texelFetch(pairs, ivec2(gl_FragCoord.xy), 0).xy; pixel = vec4(rougher(p.x, p.y)); }"
    )  # fmt: skip
    context = gl.context()
    program = context.program(vertex_shader=gl.splice("screen.vert.glsl"), fragment_shader=source)
    corners = context.buffer(np.array([-1, -1, 3, -1, -1, 3], "f4").tobytes())
    array = context.vertex_array(program, [(corners, "2f", "corner")])
    inputs, out = (
        gl.texture((len(pairs), 1), 2, "f4", pairs.astype("f4").tobytes()),
        gl.texture((len(pairs), 1), 4, "f4"),
    )
    target = context.framebuffer([out])
    gl.bind(program, pairs=inputs)
    target.use()
    array.render()
    roughness = gl.read(target)[0, :, 0].astype(float)
    gl.free(program, corners, array, inputs, out, target)
    gl.check()
    return roughness


def test_roughness_grows_with_the_slopes_that_became_invisible():
    variance = np.linspace(0, 0.5, 26)
    for roughness in (0.2, 0.5, 0.9):
        rough = rougher(np.stack([np.full_like(variance, roughness), variance], axis=1))
        assert rough[0] == pytest.approx(roughness, abs=1e-5)
        assert np.all(np.diff(rough) >= 0)
        below = rough < 1
        assert rough[below] ** 4 == pytest.approx(roughness**4 + variance[below], abs=1e-5)
    assert rough.max() == 1


def test_no_black_outlines_and_no_lost_light():
    """What leaves at a cosine, weighted with it, is 1 on the mean; at grazing a rough skin still lets out most."""
    table, means = surface.ggx_energy(), surface.exit_means(REFRACTIVE_INDEX)
    f0 = specular(REFRACTIVE_INDEX)
    root = np.linspace(0, 1, table.shape[1])
    size = len(table)
    for i in range(size // 4, size):
        whole, part = table[i].T
        leaving = (1 - (f0 * (whole - part) + part) * (1 + f0 * (1 / whole - 1))) / means[i]
        assert np.trapezoid(leaving * 4 * root**3, root) == pytest.approx(1, abs=1e-3)
        assert leaving.max() < 1.1
    assert 0.9 < means[size // 4 :].min() < means[size // 4 :].max() < 1
    whole, part = table[size // 2, round(0.032 * (size - 1))]
    assert 1 - (f0 * (whole - part) + part) > 0.6
    assert surface.exit_mean(REFRACTIVE_INDEX) == pytest.approx(
        means[size // 16], abs=0.01
    )  # a smooth one is Fresnel's


def test_the_detail_of_a_painted_albedo_is_a_ratio_of_colors():
    """Gray stays gray, and red stays as red as it is painted."""
    from lutgen import color

    albedo = np.full((8, 8, 3), 0.4)
    albedo[0, 0] = 0.2
    albedo[0, 1] = 0.5, 0.2, 0.2
    detail = subject.detail(albedo)
    assert detail[0, 0] == pytest.approx([0.5, 0.5, 0.5], abs=1e-6)
    assert color.from_acescg(detail[0, 1] * 0.4, "srgb") == pytest.approx([0.5, 0.2, 0.2], abs=1e-6)


def test_the_tile_repeats_every_so_many_millimetres(plane):
    """The same place one tile farther is lit alike: lengths are millimetres on any mesh."""
    values = {"light_azimuth": 50, "light_elevation": 0, "distance_mm": 200}
    first = layer(plane, "entering", **values)
    second = layer(plane, "entering", **(values | {"target_mm": (pores.SIDE_MM, 0, 0)}))
    assert np.abs(first[..., 0] - second[..., 0]).max() < 0.02 * first[..., 0].mean()


@pytest.mark.parametrize(("blocked", "least", "most"), [(False, 0.5, 1.0), (True, 0.0, 0.01)])
def test_a_thin_part_glows_only_where_the_light_meets_it_first(blocked, least, most):
    """Light from behind a sheet of 1 mm; another sheet 60 mm behind takes it away."""
    corners = np.array([[-500, -500, 0], [500, -500, 0], [500, 500, 0], [-500, 500, 0]], "f4")
    corners = np.concatenate([corners, corners - [0, 0, 60]] if blocked else [corners])
    triangles = np.array([[0, 1, 2], [0, 2, 3]], "i4")
    triangles = np.concatenate([triangles, triangles + 4] if blocked else [triangles])
    sheet = Mesh(corners, np.tile(np.array([0, 0, 1], "f4"), (len(corners), 1)), None, triangles)
    surface = np.ones((1, 1, 4), "f4")
    surface[..., 3] = 1 / 32
    stage = app.open_stage(lutgen.load(), sheet, Maps(surface=surface), (160, 160))
    glow = layer(stage, "reflected", light_azimuth=180, light_elevation=0, distance_mm=300)[150:170, 150:170, 3]
    stages.release(stage)
    assert least <= glow.min() <= glow.max() <= most
