"""Laws of the flat walk: the LUT's color and profile on a plane, no energy from nowhere, none lost at rims."""

from dataclasses import replace

import numpy as np
import pytest
from rendering import BARE, EVEN, FRONT, PHOTONS, SKY, SUN, ball, mean, opened, plane, sampled

import lutgen
from lutgen import device as ocl
from lutgen.head.mesh import Mesh
from lutgen.render import device_scene, flat_exits, flat_walk
from lutgen.scene import light as lighting
from lutgen.scene import surface
from lutgen.scene.look import Look, of_preset
from lutgen.skin import tissue
from lutgen.skin.tissue import REFRACTIVE_INDEX
from lutgen.tables import expand

SIGMAS = 4
SKINS = "light", "dark"


def skin_of(look: Look) -> tuple[float, float, float]:
    return look.melanin, look.eumelanin, look.hemoglobin


def from_paths(luts, skin) -> tuple[np.ndarray, np.ndarray]:
    """Color [3] of a skin from a set's path table, without what the LUT's nodes round off, and its standard error."""
    mu = expand.coefficients(luts.paths.wavelength_nm, luts.absorbers, *(np.array([v]) for v in skin))
    color = luts.totals.evaluate(*mu)[:, 0, 0] @ luts.weights
    return color, np.sqrt(luts.totals.std_error(*mu)[:, 0, 0] ** 2 @ luts.weights**2)


def at_a_node(look: Look) -> Look:
    """The skin of a node of the default color LUT."""
    grid = lutgen.load().color_lut.grid
    m, e, h = (float(a.values[k]) for a, k in ((grid.melanin, 6), (grid.eumelanin, 3), (grid.hemoglobin, 5)))
    return replace(look, melanin=m, eumelanin=e, hemoglobin=h)


@pytest.mark.parametrize("preset", [*SKINS, "node"])
@pytest.mark.parametrize("light", ["sun", "sky"])
def test_a_plane_under_even_light_has_the_color_of_the_lut(preset, light):
    """Along the normal, without entry factors: 4 sigma of samples, exits and the set's paths together.

    At a node the LUT's own color; between nodes it errs by up to 0.2 ΔE00, so there that of the paths it is made of.
    """
    base = SUN if light == "sun" else SKY
    look = at_a_node(base) if preset == "node" else of_preset(preset, base)
    scene = opened(plane(), look, around=EVEN)
    walk = flat_walk.flat(scene, photons=PHOTONS)
    found, sigma = mean(sampled(scene, walk, 60)[0])
    found = found / (lighting.SUN if light == "sun" else 1)
    expected, of_paths = from_paths(scene.luts, skin_of(look))
    if preset == "node":
        expected = scene.luts.color(*skin_of(look), space="acescg")
    of_exits = np.array(walk.facts["color_std_error_acescg"])
    assert np.all(np.abs(found - expected) < SIGMAS * np.sqrt(sigma**2 + of_paths**2 + of_exits**2))
    assert np.all(sigma < 0.02 * expected)  # else the law says little


RINGS = """
__kernel void rings(SCENE, EXITS, uint samples, float3 skin, __global const float *lut_edges, __global float *sums) {
    const scene_t scene = SCENE_HERE, *s = &scene;
    const exits_t exits = EXITS_HERE;
    rng_t rng = stream(s, get_global_id(0), 0, 0);
    __global float *own = sums + get_global_id(0) * (LUT_RINGS * 6);
    for (uint i = 0; i < samples; i++) {
        int row, ring = 0;
        float2 place = draw_place(&exits, 1.0f, (i + next_uniform(&rng)) / samples, &rng, &row);
        float which = next_uniform(&rng);
        float3 color = 0.0f;
        for (int k = 0; k < WAVES; k++)
            color += ENTRY * carried(&exits, row, k, which, absorption(s, k, skin)) * color_weight(s, k);
        while (ring < LUT_RINGS - 1 && place.x >= lut_edges[ring + 1]) ring++;
        for (int c = 0; c < 3; c++) {
            float v = c == 0 ? color.x : c == 1 ? color.y : color.z;
            own[ring * 6 + c] += v;
            own[ring * 6 + 3 + c] += v * v;
        }
    }
}
"""


def ring_energy(scene, found: flat_exits.Exits, monkeypatch, samples: int = 4096, items: int = 64):
    """Energy of exits that the kernel draws, per ring of the set's profiles [rings, 3], and its standard error."""
    real = ocl.source
    with monkeypatch.context() as patched:
        patched.setattr(ocl, "source", lambda *names: real(*names) + RINGS)
        edges = scene.luts.paths.radius_edges_mm.astype("f4")
        kernel = device_scene.kernel(
            scene, "rings", "render/exit_surface", "render/exits",
            ANGLES=len(found.cosines), CELLS=found.drawn.shape[1], DRAWS=flat_walk.DRAWS,
            SECTORS=flat_exits.SECTORS, QUANTILES=flat_exits.QUANTILES, LEAST_COSINE=float(found.cosines[0]), REACH=1.5,
            LUT_RINGS=len(edges) - 1,
        )  # fmt: skip
    sums = np.zeros((items, len(edges) - 1, 2, 3), "f4")
    out = ocl.buffer(scene.device, sums)
    skin = np.array([*scene.view["chromophores"], 0], "f4")
    ocl.launch(scene.device, kernel, (items,), *scene.arguments, *flat_exits.buffers(scene.device, found),
               np.uint32(samples), skin, ocl.buffer(scene.device, edges), out)  # fmt: skip
    per_item = ocl.read(scene.device, out, sums).astype(float)[:, :, 0] / samples
    return per_item.mean(axis=0), per_item.std(axis=0, ddof=1) / np.sqrt(items)


@pytest.mark.parametrize("preset", SKINS)
def test_exits_lie_where_the_profile_has_them(preset, monkeypatch):
    """Energy per ring of exits drawn along the normal, which by reciprocity is what leaves under a small disc of light:
    4 sigma of draws, exits and the set's paths; encircled energy too, at every radius."""
    look = of_preset(preset, SUN)
    scene = opened(plane(), look)
    edges, skin = scene.luts.paths.radius_edges_mm, skin_of(look)
    found = flat_exits.trace(scene.device, scene.luts, skin, PHOTONS, 3, edges=edges)
    drawn, sigma = ring_energy(scene, found, monkeypatch)
    mu = expand.coefficients(scene.luts.paths.wavelength_nm, scene.luts.absorbers, *(np.array([v]) for v in skin))
    expected = scene.luts.paths.evaluate(*mu)[:, :, 0].T @ scene.luts.weights
    of_paths = np.sqrt((scene.luts.paths.std_error(*mu)[:, :, 0] ** 2).T @ scene.luts.weights**2)
    of_exits = found.rings(scene.luts, skin)[1]
    whole = np.sqrt(sigma**2 + of_paths**2 + of_exits**2)
    assert np.all(np.abs(drawn - expected) < SIGMAS * whole + 1e-7)
    within = np.abs(np.cumsum(drawn - expected, axis=0))
    assert np.all(within < SIGMAS * np.sqrt(np.cumsum(whole**2, axis=0)) + 1e-6)
    assert within.max() < 0.02 * expected.sum(axis=0).max()


def test_rings_of_the_renderer_are_fine_enough(monkeypatch):
    """Its own rings, read at the profile's radii: encircled energy within 1 % of all light."""
    look = of_preset("light", SUN)
    scene = opened(plane(), look)
    found = flat_exits.trace(scene.device, scene.luts, skin_of(look), PHOTONS, 3)
    drawn, _ = ring_energy(scene, found, monkeypatch)
    profile = scene.luts.profile(*skin_of(look)).energy
    apart = np.cumsum(drawn / drawn.sum(axis=0), axis=0) - np.cumsum(profile / profile.sum(axis=0), axis=0)
    assert np.abs(apart).max() < 0.01


def test_oblique_light_stays_shallow():
    """Of light that enters at 60 degrees .91 to 1.28 times as much leaves as along the normal (luts/README.md,
    What a value means), the more the more is absorbed; its exits lie ahead of where it entered."""
    luts, skin = lutgen.load(), (0.0439, 0.7, 0.0093)
    found = flat_exits.trace(ocl.choose(), luts, skin, PHOTONS)
    inside = np.sqrt(1 - 0.75 / 1.96)
    near = np.abs(found.cosines - inside).argmin()
    colors = [found.color(luts, skin, a) for a in (near, -1)]
    ratio = colors[0][0] / colors[1][0]
    sigma = np.hypot(*(one / color for color, one in colors))
    assert np.all(ratio > 0.91 - SIGMAS * sigma)
    assert np.all(ratio < 1.28 + SIGMAS * sigma)
    assert ratio[2] > ratio[0] + SIGMAS * np.hypot(sigma[0], sigma[2])
    cells = found.energy.reshape(len(found.cosines), -1, flat_exits.SECTORS, len(luts.weights))
    ahead, behind = cells[0, :, 0].sum(), cells[0, :, -1].sum()
    assert ahead > 1.2 * behind
    even = cells[-1].sum(axis=(0, 2))
    assert np.abs(even / even.mean() - 1).max() < SIGMAS / np.sqrt(even.mean() * PHOTONS)


def test_rims_lose_nothing():
    """A small ball under an even sky: exits miss it, and it is as bright as a large one that looks the same."""
    colors = []
    for radius in (1.0, 100.0):
        look = replace(SKY, target_mm=(0, 0, 0), distance_mm=40 * radius, field_of_view=5.0)
        scene = opened(ball(radius), look, around=EVEN, bounces=0)
        made, counts = sampled(scene, flat_walk.flat(scene, photons=PHOTONS), 100)
        colors.append(mean(made))
        if radius == 1:
            assert counts["MISSES"] > 0.03 * counts["PROBES"]
    (small, one), (large, two) = colors
    assert np.all(np.abs(small - large) < SIGMAS * np.hypot(one, two) + 0.002 * large)


def bowl() -> Mesh:
    """The inside of a ball of 100 mm that is open toward +z."""
    whole = ball(100.0, inward=True)
    front = whole.positions_mm[whole.triangles][:, :, 2].max(axis=1) > 20
    return replace(whole, triangles=whole.triangles[~front])


def test_skin_lights_skin_and_never_more_than_the_sky():
    """A bowl under an even sky: what skin sends to skin brightens it, and nothing outshines the sky."""
    look = replace(SKY, distance_mm=600, melanin=0.001, hemoglobin=0.001, field_of_view=12.0)
    found = []
    for bounces in (0, 1, 6):
        scene = opened(bowl(), look, around=EVEN, bounces=bounces)
        made, counts = sampled(scene, flat_walk.flat(scene, photons=PHOTONS), 20)
        found.append(mean(made)[0])
        assert (counts["BOUNCES"] > 0) == (bounces > 0)
    assert np.all(found[0] < 0.9 * found[1])
    assert np.all(found[1] < found[2])
    assert np.all(found[2] < 1)


@pytest.mark.parametrize("specular", [0.0, 1.0])
@pytest.mark.parametrize("walk", ["flat", "flat-full"])
def test_sunlit_skin_lights_skin_without_surroundings(walk, specular):
    """A bowl lit by the sun alone is as bright as under a sky too faint to see, and brighter than without bounces."""
    look = replace(SUN, light_azimuth=50.0, distance_mm=600, field_of_view=12.0, melanin=0.001, specular=specular)
    found = []
    for environment, bounces in ((0.0, 3), (1e-5, 3), (0.0, 0)):
        scene = opened(bowl(), replace(look, environment=environment), around=EVEN, bounces=bounces)
        found.append(mean(sampled(scene, flat_walk.WALKS[walk](scene, 0), 160)[0]))
    (dark, one), (faint, two), (alone, three) = found
    assert np.all(np.abs(dark - faint) < SIGMAS * np.hypot(one, two))
    assert np.all(dark > alone + SIGMAS * np.hypot(one, three))
    assert np.all(np.hypot(one, two) < 0.03 * dark)


def corner(side: float = 40_000.0) -> Mesh:
    """A floor and a wall that meet at a right angle in the x axis, open toward +y and +z.

    A wall of 400 mm lacks 3 % of what it mirrors: nearly grazing light, from above its upper end.
    """
    p = np.array([[-1, 0, 0], [1, 0, 0], [-1, 0, 1], [1, 0, 1], [-1, 0, 0], [1, 0, 0], [-1, 1, 0], [1, 1, 0]], "f4")
    normals = np.repeat(np.array([[0, 1, 0], [0, 0, 1]], "f4"), 4, axis=0)
    return Mesh(p * side, normals, None, np.array([[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6]], "i4"))


@pytest.mark.parametrize(("walk", "samples"), [("flat", 800), ("flat-full", 1600)])
def test_skin_mirrors_skin_that_mirrors_the_sky(walk, samples):
    """At 45 degrees into a corner of smooth dark skin under an even sky the floor mirrors what the wall mirrors of the
    sky, F^2, and what it scatters, which looks like the floor; and scatters what the wall mirrors: the wall is half of
    its sky, seen from the wall's normal at cosines z with density 4 / pi sqrt(1 - z^2). Lobes have a width, over which
    F is convex, and light goes to and fro more often: 1.4 % at most, measured to 0.15 %."""
    z = (np.arange(4096) + 0.5) / 4096
    f, of_wall = (
        surface.fresnel(np.array([np.sqrt(0.5)]), REFRACTIVE_INDEX)[0],
        np.mean(surface.fresnel(z, REFRACTIVE_INDEX) * np.sqrt(1 - z**2)) * 4 / np.pi,
    )
    look = replace(FRONT, entry=0, environment=1, light=0, elevation=45, target_mm=(0, 0, 0), roughness=0.15,
                   field_of_view=5.0, melanin=0.5, hemoglobin=0.1)  # fmt: skip
    found = []
    for specular in (0.0, 1.0):
        scene = opened(corner(), replace(look, specular=specular), (16, 16), around=EVEN)
        found.append(mean(sampled(scene, flat_walk.WALKS[walk](scene, 0), samples)[0]))
    (plain, one), (shiny, two) = found
    seen, expected = shiny - plain, f * (f + plain) + plain * of_wall
    assert np.all(np.abs(seen - expected) < SIGMAS * np.hypot(one, two) + 0.02 * expected)
    assert np.all(np.hypot(one, two) < 0.1 * expected)


@pytest.mark.parametrize("azimuth", [0.0, 70.0])
@pytest.mark.parametrize("roughness", [0.2, 0.6])
def test_an_even_sky_is_reflected_as_the_viewer_has_it(azimuth, roughness):
    """The lobes' directions are drawn; their mean weight is the table's share of both lobes."""
    table, count = surface.ggx_energy(), len(surface.ggx_energy()) - 1
    f0, c = tissue.specular(REFRACTIVE_INDEX), np.cos(np.radians(azimuth))

    def share(r: float) -> float:
        i, x = min(int(r * count), count - 1), np.sqrt(c) * count
        rows = table[i] + (r * count - i) * (table[i + 1] - table[i])
        whole, part = (np.interp(x, np.arange(count + 1), rows[:, k]) for k in (0, 1))
        return float((f0 * (whole - part) + part) * (1 + f0 * (1 / whole - 1)))

    expected = (1 - surface.SECOND_WEIGHT) * share(roughness) + surface.SECOND_WEIGHT * share(
        max(roughness * surface.SECOND_LOBE, 0.1)
    )
    look = replace(FRONT, entry=0, environment=1, light=0, azimuth=azimuth, roughness=roughness, field_of_view=5.0)
    means = []
    for specular in (1.0, 0.0):
        scene = opened(plane(4000.0), replace(look, specular=specular), around=EVEN, bounces=0)
        means.append(mean(sampled(scene, flat_walk.flat(scene, photons=PHOTONS), 200)[0]))
    (one, a), (two, b) = means
    assert np.all(np.abs(one - two - expected) < SIGMAS * np.hypot(a, b) + 0.0015)


def test_no_light_is_black_and_other_oxygenation_is_blue():
    scene = opened(plane(), replace(BARE, light=0, environment=0))
    made, counts = sampled(scene, flat_walk.flat(scene, photons=PHOTONS), 5)
    assert made.rgb.max() == 0
    assert counts["SUN_RAYS"] == counts["SKY_RAYS"] == 0
    hues = []
    for oxygenation in (1.0, 0.0):
        look = replace(SUN, melanin=0.008, hemoglobin=0.03, oxygenation=oxygenation)
        scene = opened(plane(), look)
        hues.append(mean(sampled(scene, flat_walk.flat(scene, photons=PHOTONS), 20)[0])[0])
    assert hues[0][0] / hues[0][2] > 1.05 * hues[1][0] / hues[1][2]
