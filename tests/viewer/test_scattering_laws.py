"""What the viewer's scattering must obey, on a flat plane of known light: energy, the profile itself, little noise."""

import importlib
from dataclasses import replace

import numpy as np
import pytest

import lutgen
from lutgen import color as color_module

gl, laws = (importlib.import_module(f"lutgen.viewer.{name}") for name in ("gl", "measure.scattering_laws"))
TONES, SIDE = laws.TONES, laws.SIDE


@pytest.fixture(scope="module")
def plane():
    opened = laws.open_plane(lutgen.load())
    yield opened
    laws.release(opened)


@pytest.mark.parametrize(
    ("mm_per_pixel", "tones"), [(0.05, TONES[:: len(TONES) - 1]), (0.2, TONES), (0.5, TONES[:: len(TONES) - 1])]
)
@pytest.mark.parametrize(("taps", "allowed"), [(64, 0.009), (16, 0.03)])
def test_searchlight(plane, mm_per_pixel, tones, taps, allowed):
    """Measured .0065, .0043 and .0037 with 64 taps, .0134, .0110 and .0051 with 16; an end of the tones is worst."""
    assert max(laws.searchlight(plane, tone, mm_per_pixel, taps) for tone in tones) <= allowed


@pytest.mark.parametrize(("taps", "allowed"), [(64, 0.02), (16, 0.04)])
def test_noise_at_an_edge(plane, taps, allowed):
    """RMS within a millimetre of a half-plane's edge at 0.05 mm per pixel, worst tone and channel."""
    assert max(laws.edge_noise(plane, tone, taps) for tone in TONES) <= allowed


def test_the_truth_is_the_profile_around_a_point(plane):
    """A disc much smaller than the profile spreads as the profile itself does, one much larger keeps its middle."""
    for tone in ("very-light", "dark"):
        profile = plane.luts.profile(*laws.chromophores(tone))
        radii = np.arange(30, 120)
        image = laws.blurred_disc(plane, tone, 0.05, radius=2.0) / (4 * np.pi)
        shares = laws.encircled(image, SIDE / 2, SIDE / 2, radii)
        exact = np.cumsum(profile.energy, axis=0) / profile.energy.sum(axis=0)
        expected = np.stack(
            [np.interp(0.05 * radii, profile.radius_edges_mm[1:], exact[:, c]) for c in range(3)], axis=1
        )
        assert np.abs(shares - expected).max() < 0.003
        wide = laws.blurred_disc(plane, tone, 0.5, radius=60.0)
        assert wide[SIDE // 2, SIDE // 2] == pytest.approx(1, abs=0.002)
        across = laws.blurred_edge(plane, tone, 0.2)
        assert across + across[::-1] == pytest.approx(1, abs=1e-9)
        assert across[0] == pytest.approx(1, abs=0.02)
        beside = laws.blurred_disc(plane, tone, 0.05, radius=1.0)
        assert np.array_equal(beside, beside[::-1])
        assert np.array_equal(beside, beside[:, ::-1])


@pytest.mark.parametrize("taps", [0, 8, 16, 64])
def test_even_light_gives_the_color(plane, taps):
    for tone in TONES:
        skin = laws.chromophores(tone)
        out = laws.scattered(plane, 1.0, skin, 0.2, taps)
        assert np.abs(out / plane.luts.color(*skin, space="acescg") - 1).max() < 0.005


def fetched(plane, skins):
    """What a shader reads from the color LUT for skins [N, 3], N a multiple of 100."""
    uploaded = plane.tables
    source = "#version 330\n" + gl.splice("lut.glsl", {"functions.glsl": uploaded.functions}) + (
        "uniform sampler2D skins; out vec4 pixel;"
        "void main() { pixel = vec4(skin_color(texelFetch(skins, ivec2(gl_FragCoord.xy), 0).rgb), 1.0); }"
    )  # fmt: skip
    context, rows = gl.context(), len(skins) // 100
    program = context.program(vertex_shader=gl.splice("screen.vert.glsl"), fragment_shader=source)
    corners = context.buffer(np.array([-1, -1, 3, -1, -1, 3], "f4").tobytes())
    array = context.vertex_array(program, [(corners, "2f", "corner")])
    values = gl.texture((100, rows), 3, "f4", np.ascontiguousarray(skins, "f4").tobytes())
    out = gl.texture((100, rows), 4, "f4")
    target = context.framebuffer([out])
    gl.bind(program, lut_color=uploaded.color, skins=values)
    target.use()
    array.render()
    colors = gl.read(target)[..., :3].reshape(-1, 3)
    gl.free(program, corners, array, values, out, target)
    gl.check()
    return colors


def test_a_shader_fetches_what_numpy_interpolates(plane):
    rng, grid = np.random.default_rng(4), plane.luts.color_lut.grid
    axes = grid.axes[::-1]
    skins = np.stack([a.low + (a.high - a.low) * rng.random(10_000) ** 2 for a in axes], axis=1).astype("f4")
    expected = grid.interpolate(plane.luts.color_lut.acescg, *skins.astype(float).T)
    assert np.abs(fetched(plane, skins) - expected).max() <= 1e-3
    nodes = np.stack([v.ravel() for v in grid.nodes()], axis=1)[:2000]
    exact = plane.luts.color_lut.acescg.reshape(-1, 3)[:2000]
    assert np.abs(fetched(plane, nodes) / exact - 1).max() <= 2.0**-11


def display(light, color):
    """Display values [SIDE, SIDE, 3], 0 to 1, of light relative to a skin's ACEScg color."""
    linear = np.clip(color_module.from_acescg(light * color, "srgb"), 0, 1)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


@pytest.fixture(scope="module")
def forced(plane):
    """The same plane with a gather that takes its taps however small the profile is."""
    source, changed = (
        gl.splice("gather.frag.glsl", {"functions.glsl": plane.tables.functions}),
        "LEAST_FOOTPRINT = 0.0;",
    )
    context, old = gl.context(), "LEAST_FOOTPRINT = 0.25;"
    assert source.count(old) == 1
    program = context.program(vertex_shader=gl.splice("screen.vert.glsl"), fragment_shader=source.replace(old, changed))
    array = context.vertex_array(program, [(plane.gather.corners, "2f", "corner")])
    yield replace(plane, gather=gl.Pass(program, array, plane.gather.corners))
    gl.free(array, program)


def worst_change(plane, forced, tone, r99_pixels, taps):
    """Largest difference of display values that a forced gather makes to the plain picture of a disc, and the scale."""
    skin, light = laws.chromophores(tone), laws.disc()[..., None] * np.ones(3)
    color = plane.luts.color(*skin, space="acescg")
    scale = float(np.max(plane.luts.profile(*skin).radius_mm(0.99))) / r99_pixels
    changes = []
    for frame in range(3):
        full = laws.scattered(forced, light, skin, scale, taps, frame) / color
        changes += [np.abs(display(gain * full, color) - display(gain * light, color)).max() for gain in (1, 3)]
    return max(changes), scale


def test_no_taps_where_they_would_not_show(plane, forced):
    """Level of detail: below r99 = 1/4 pixel none are taken, and all 64 would change no display value by 1/255.

    Measured: 0.51/255 at 1/4 pixel, 4 to 5 at a third, 18 at a half: a pixel beside the disc is black, where the
    display's curve is steepest.
    """
    light = laws.disc()[..., None] * np.ones(3)
    for tone in TONES:
        skin = laws.chromophores(tone)
        color = plane.luts.color(*skin, space="acescg")
        change, scale = worst_change(plane, forced, tone, 0.249, 64)
        assert 0 < change < 1 / 255
        assert laws.scattered(plane, light, skin, scale, 64) / color == pytest.approx(light, abs=1e-5)
        change, scale = worst_change(plane, forced, tone, 0.5, 64)
        assert change > 1 / 255
        full, kept = (laws.scattered(gathering, light, skin, scale, 64) for gathering in (forced, plane))
        assert np.array_equal(full, kept)  # above the limit nothing is left out


def test_a_gather_of_pixels_cannot_tell_what_lies_within_one(plane, forced):
    """Not taking taps is no farther from the truth than taking them: what is left is the pixel's size.

    A profile of r99 = 1/4 pixel blurs a disc's edge by 4 to 5/255 of full light (7 at a half), which light kept by the
    pixel cannot show, with any taps.
    """
    for tone in ("very-light", "dark"):
        skin, light = laws.chromophores(tone), laws.disc()[..., None] * np.ones(3)
        _, scale = worst_change(plane, forced, tone, 0.249, 64)
        true = laws.blurred_disc(plane, tone, scale)
        color = plane.luts.color(*skin, space="acescg")
        full = np.mean([laws.scattered(forced, light, skin, scale, 64, f) for f in range(16)], axis=0) / color
        assert np.abs(light - true).max() < np.abs(full - true).max() + 0.1 / 255
        assert np.abs(light - true).max() < 5.5 / 255


def test_what_another_skin_scatters_changes_only_there(plane):
    light = np.repeat(laws.disc(radius=20.0)[..., None], 3, axis=-1) + 0.01
    plain = np.broadcast_to(np.array(laws.chromophores("light")), (SIDE, SIDE, 3)).copy()
    changed = plain.copy()
    square = np.zeros((SIDE, SIDE), bool)
    square[100:150, 110:160] = True
    changed[square, 2] = 0.05
    before, after = (laws.scattered(plane, light, skins, 0.2, 16) for skins in (plain, changed))
    assert np.array_equal(before[~square], after[~square])
    ratio = after[square] / before[square]
    assert ratio[:, 1].max() < 0.9
    color = plane.luts.color(*changed[120, 130], space="acescg") / plane.luts.color(*plain[120, 130], space="acescg")
    assert np.abs(ratio / color - 1).max() > 0.01  # not the color alone: the profile too
