"""The renderer's scene is the viewer's: the same pixels see the same place of the same skin, by the same curve."""

import importlib
from dataclasses import replace

import numpy as np
import pytest
from rendering import BARE, EVEN, SKY, SUN, ball, mean, opened, plane, sampled

import lutgen
from lutgen import device as ocl
from lutgen.files.texture_maps import Maps
from lutgen.head import builtin, mend, paint
from lutgen.render import device_scene, flat_walk, sample_queue
from lutgen.scene import display
from lutgen.scene import light as lighting
from lutgen.scene import look as looks
from lutgen.scene.look import Look
from lutgen.tables import expand

_NAMES = "app", "gl", "passes", "stage"
app, gl, passes, stages = (importlib.import_module(f"lutgen.viewer.{n}") for n in _NAMES)
SIZE = (96, 72)

SEEN = """
__kernel void seen(SCENE, __global float *out) {
    const scene_t scene = SCENE_HERE, *s = &scene;
    const int columns = 2 * s->view->columns, i = get_global_id(0);
    float3 d = camera_ray(s, (i % columns + 0.5f) / 2.0f, (i / columns + 0.5f) / 2.0f);
    hit_t hit = nearest(s, view3(s->view->eye), d);
    __global float *mine = out + 12 * i;
    if (hit.triangle < 0) return;
    surface_t here = surface_at(s, hit);
    put(mine, here.position);
    put(mine + 3, here.skin);
    put(mine + 6, here.detail);
    put(mine + 9, here.smooth);
}
"""
PUT = "inline void put(__global float *to, float3 v) { to[0] = v.x; to[1] = v.y; to[2] = v.z; }\n"


@pytest.fixture(scope="module")
def both():
    """The viewer's stage and the renderer's of the built-in head with a painted albedo, and the look of both."""
    shape = builtin.builtin()
    rng = np.random.default_rng(2)
    painted = Maps(**{k: v for k, v in paint.paint(shape).items() if k != "albedo"})
    given = replace(painted, albedo=0.2 + 0.3 * np.kron(rng.random((32, 32, 3)), np.ones((32, 32, 1))))
    look = looks.of_preset("brown", Look(azimuth=25, elevation=12, field_of_view=20, target_mm=(4, -20, 3)))
    shown = app.open_stage(lutgen.load(), shape, given, SIZE)
    passes.draw(shown, look)
    yield shown, opened(shape, look, SIZE, given), look
    stages.release(shown)


def test_the_same_pixels_see_the_same_skin(both, monkeypatch):
    """Depth, chromophores, painted detail and normal at the middle of each of the viewer's subpixels.

    Outlines apart (a pixel's middle is on one side for one and on the other for the other), depth to 0.02 mm; what maps
    say within what the viewer's mipmaps average, so in the median.
    """
    shown, scene, look = both
    real = ocl.source
    with monkeypatch.context() as patched:
        patched.setattr(ocl, "source", lambda *names: real(*names) + PUT + SEEN)
        kernel = device_scene.kernel(scene, "seen")
    found = np.zeros((2 * SIZE[1], 2 * SIZE[0], 12), "f4")
    out = ocl.buffer(scene.device, found)
    ocl.launch(scene.device, kernel, (found.shape[0] * found.shape[1],), *scene.arguments, out)
    found = ocl.read(scene.device, out, found)
    entering, facing, skin, _, detail = (gl.read(shown.targets["surface_buffer"], k)[::-1] for k in range(5))
    there, here = entering[..., 3] > 0, found[..., 9:].any(axis=-1)
    assert (there != here).mean() < 0.001
    same = there & here
    camera = looks.camera(look, *SIZE)
    depth = -(found[same][:, :3] @ camera.view[2, :3] + camera.view[2, 3])
    apart = np.abs(depth - entering[same][:, 3])
    assert np.quantile(apart, 0.995) < 0.02
    normal = found[same][:, 9:] @ camera.view[:3, :3].T
    assert np.quantile(np.abs(normal - facing[same][:, :3]).max(axis=1), 0.995) < 0.02
    for mine, theirs in ((found[..., 3:6], skin), (found[..., 6:9], detail)):
        ratio = mine[same] / theirs[same][:, :3]
        assert np.abs(np.median(ratio, axis=0) - 1).max() < 0.01
        assert np.quantile(np.abs(ratio - 1).max(axis=1), 0.6) < 0.05


def test_pictures_are_shown_by_the_viewers_curve(both):
    """`tone` on the viewer's own radiance gives the viewer's pixels, dither and rounding apart."""
    shown, _, look = both
    for exposure in (-1.0, 0.0, 3.0):
        pixels = app.picture(shown, replace(look, exposure=exposure)).astype(float)
        radiance = gl.read(shown.targets["scattered_buffer"])
        weight = radiance[..., 3:]
        light = radiance[..., :3] / np.maximum(weight, 1) + gl.read(shown.targets["surface_buffer"], 3)[..., :3]
        displayed = np.where(weight > 0, display.shown(light[..., :3], exposure), np.nan)[::-1]
        average = displayed.reshape(SIZE[1], 2, SIZE[0], 2, 3).mean(axis=(1, 3))
        whole = np.isfinite(average).all(axis=-1)
        assert np.abs(255 * average - pixels)[whole].max() < 1.1
        beside = ~np.isfinite(displayed).reshape(SIZE[1], 2, SIZE[0], 2, 3).any(axis=(1, 3, 4))
        assert np.abs(255 * display.backdrop(*SIZE[::-1]) - pixels)[beside].max() < 1.1


def still(device, epidermis_mm: float, dermis_mm: float):
    """A walk that leaves where it entered, after paths of given lengths."""
    import pyopencl

    def walk(entries, exits, part: sample_queue.Part) -> int:
        places = (part.end - part.begin) * part.samples
        begun = ocl.read(device, entries, np.zeros(places, sample_queue.ENTRY))
        ended = np.zeros(places, sample_queue.EXIT)
        ended["position"], ended["normal"] = begun["position"], begun["normal"]
        ended["path_epidermis_mm"], ended["path_dermis_mm"] = epidermis_mm, dermis_mm
        pyopencl.enqueue_copy(device.queue, exits, ended)
        return places

    return walk


@pytest.mark.parametrize("flat", [True, False])
@pytest.mark.parametrize("light", ["sun", "sky"])
def test_stages_around_a_walk_that_stands_still(flat, light):
    """All wavelengths of a group together are the walk's own color, exactly: nothing else is random here."""
    look = SUN if light == "sun" else SKY
    scene = opened(plane(), look, around=EVEN)
    walk = sample_queue.queue_walk(scene, still(scene.device, 0.2, 1.0), {}, flat, flat_walk.REACH)
    made, counts = sampled(scene, walk, 16)
    mu = expand.coefficients(scene.luts.paths.wavelength_nm, scene.luts.absorbers, *(
        np.array([v]) for v in (look.melanin, look.eumelanin, look.hemoglobin)))  # fmt: skip
    nu = scene.luts.paths.nu_per_mm
    share = scene.luts.paths.entry * np.exp(-0.2 * (mu[0][:, 0] - nu) - (mu[1][:, 0] - nu))
    expected = share @ scene.luts.weights * (lighting.SUN if light == "sun" else 1)
    found, sigma = mean(made)
    assert np.all(np.abs(found - expected) < 4 * sigma + 2e-5)
    assert made.samples == 16
    assert counts["HITS"] == 16 * 32 * 32
    assert walk.events >= 16 * 32 * 32
    assert set(walk.seconds) == {"camera", "walk", "light"}


def test_stages_follow_light_from_skin_to_skin():
    """Inside a closed ball every ray into the sky meets skin: as often as bounces are allowed, and no light comes."""
    look = replace(SKY, target_mm=(0, 0, 0), distance_mm=40, specular=0)
    scene = opened(ball(100.0, inward=True), look, (16, 16), around=EVEN)
    walk = sample_queue.queue_walk(scene, still(scene.device, 0.0, 0.0), {}, False, flat_walk.REACH)
    made, counts = sampled(scene, walk, 8)
    assert made.rgb.max() == 0
    assert counts["BOUNCES"] == 3 * counts["HITS"]


def test_a_mesh_is_mended_and_its_oddities_said():
    good, notes = mend.outward(ball(100.0))
    assert notes == ()
    again = mend.outward(replace(good, triangles=good.triangles[:, ::-1]))[0]
    assert np.array_equal(np.sort(again.triangles, axis=1), np.sort(good.triangles, axis=1))
    outward = (again.normals * again.positions_mm).sum(axis=1)
    assert outward.min() > 0
    flipped, notes = mend.outward(ball(100.0, inward=True))
    assert "clockwise" in notes[0]
    assert (flipped.normals * flipped.positions_mm).sum(axis=1).min() > 0
    thin = np.concatenate([good.triangles, [[0, 0, 1], [5, 6, 5]]]).astype("i4")
    fixed, notes = mend.outward(replace(good, triangles=thin))
    assert np.array_equal(fixed.triangles, good.triangles)
    assert notes == (f"2 of {len(thin)} triangles have no area: left out",)
    with pytest.raises(lutgen.InputError, match="no triangle has an area"):
        mend.outward(replace(good, triangles=thin[-2:]))
    assert mend.outward(plane(300.0))[1] == ()
    for size in (2.0, 2000.0):
        assert "check --mm-per-unit" in mend.outward(ball(size))[1][0]


def test_no_pixel_is_nan_whatever_the_mesh_and_light():
    """Triangles without area, doubled ones, normals of length 0, light from behind, a sun as wide as may be, and
    samples that would not be finite are counted instead."""
    shape = ball(80.0, 16)
    rough = replace(
        shape, triangles=np.concatenate([shape.triangles, shape.triangles[:40], [[0, 0, 0], [3, 3, 9]]]).astype("i4"),
        normals=np.where(np.arange(len(shape.normals))[:, None] % 5 == 0, 0, shape.normals).astype("f4"),
    )  # fmt: skip
    for light in ({"light_azimuth": 180.0}, {"light_size": 40.0, "light_elevation": 90.0}, {"light": 20.0}):
        look = replace(Look(target_mm=(0, 0, 0), distance_mm=400, bumps=3, roughness=0.15), **light)
        scene = opened(rough, look, around=EVEN)
        made, counts = sampled(scene, flat_walk.flat(scene, photons=4096), 10)
        assert np.all(np.isfinite(made.sums))
        assert counts["BROKEN"] == 0
        assert made.mask.max() == 1
    for radiance in (np.inf, 1e25):  # the second is finite, its square is not
        blazing = EVEN.copy()
        blazing[1, 3] = radiance
        scene = opened(shape, replace(SKY, target_mm=(0, 0, 0)), around=blazing)
        made, counts = sampled(scene, flat_walk.flat(scene, photons=4096), 10)
        assert np.all(np.isfinite(made.sums))
        assert counts["BROKEN"] > 0
    broken = replace(shape, positions_mm=np.where(shape.positions_mm > 79.9, np.nan, shape.positions_mm).astype("f4"))
    scene = opened(broken, replace(SUN, target_mm=(0, 0, 0)))
    assert np.all(np.isfinite(sampled(scene, flat_walk.flat(scene, photons=4096), 10)[0].sums))


def test_the_camera_must_stand_outside():
    for shape, look in ((ball(100.0), replace(BARE, distance_mm=40)), (plane(), replace(BARE, azimuth=180))):
        scene = opened(shape, replace(look, target_mm=(0, 0, 0)))
        with pytest.raises(lutgen.InputError, match=r"the camera sees \d+ % back faces: it is inside the head"):
            sampled(scene, flat_walk.flat(scene, photons=4096), 5)
