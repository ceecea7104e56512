"""The viewer's pictures: skin that follows the sliders, the same pixels every time, nothing left behind on the GPU."""

import importlib
import json
import shutil
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import gl_objects
import numpy as np
import pytest
from PIL import Image

import lutgen
from lutgen.cli import main
from lutgen.files import exr
from lutgen.files.texture_maps import Maps
from lutgen.head import builtin, paint
from lutgen.head.mesh import Mesh
from lutgen.scene import light as lighting
from lutgen.scene import look as looks
from lutgen.scene import subject
from lutgen.scene.look import Look

_NAMES = "app", "gl", "passes", "stage", "textures"
app, gl, passes, stages, textures = (importlib.import_module(f"lutgen.viewer.{n}") for n in _NAMES)
SIZE = (160, 160)
FOURFOLD = np.full((2, 2, 3), [4.0, 1.0, 1.0], "f4")
"""Ratios of a map: four times the slider's melanin."""


@pytest.fixture(scope="module")
def stage():
    shape = builtin.builtin()
    opened = app.open_stage(lutgen.load(), shape, Maps(**paint.paint(shape)), SIZE)
    yield opened
    stages.release(opened)
    gl.check()


@pytest.fixture(scope="module")
def plain():
    """A square meter facing the camera, without maps."""
    corners = np.array([[-500, -500, 0], [500, -500, 0], [500, 500, 0], [-500, 500, 0]], "f4")
    normals = np.tile(np.array([0, 0, 1], "f4"), (4, 1))
    square = Mesh(corners, normals, None, np.array([[0, 1, 2], [0, 2, 3]], "i4"))
    opened = app.open_stage(lutgen.load(), square, Maps(), SIZE)
    yield opened
    stages.release(opened)


@contextmanager
def one_map(stage, name: str, values: np.ndarray):
    """The stage with another map [rows, columns, channels] of that name."""
    own, stage.maps[name] = stage.maps[name], gl.image(values)
    yield
    stage.maps[name].release()
    stage.maps[name] = own


def face(stage, look) -> np.ndarray:
    """Mean display color of the middle of the face."""
    return app.picture(stage, look)[50:110, 60:100].reshape(-1, 3).mean(axis=0)


LOOK = Look(distance_mm=500, target_mm=(0, -20, 0), azimuth=0)


def test_melanin_darkens_and_lost_oxygen_turns_blue(stage):
    light, dark = (face(stage, replace(LOOK, melanin=m)) for m in (0.01, 0.2))
    assert np.all(dark < 0.8 * light)
    pale = replace(LOOK, melanin=0.008, hemoglobin=0.03)
    red, blue = (face(stage, replace(pale, oxygenation=o)) for o in (1.0, 0.0))
    assert red[0] - red[2] > blue[0] - blue[2] + 5


def test_the_same_look_gives_the_same_pixels(stage):
    first = app.picture(stage, LOOK)
    app.picture(stage, replace(LOOK, melanin=0.3, oxygenation=0.2, split="burley"))
    assert np.array_equal(app.picture(stage, LOOK), first)


@pytest.mark.parametrize("tier", looks.TIERS)
def test_every_tier_draws_a_face(stage, tier):
    assert face(stage, replace(LOOK, tier=tier)).min() > 20


def test_split_views_differ_on_the_right_only(stage):
    whole = app.picture(stage, LOOK).astype(int)
    for split in ("scattering", "burley"):
        halves = app.picture(stage, replace(LOOK, split=split)).astype(int)
        assert np.array_equal(halves[:, : SIZE[0] // 2], whole[:, : SIZE[0] // 2])
        assert np.abs(halves - whole)[:, SIZE[0] // 2 :].max() > 4


def linear(stage, look) -> np.ndarray:
    """Scattered light [H, W, 3] before exposure, ACEScg."""
    app.picture(stage, look)
    return gl.read(stage.targets["scattered_buffer"])[..., :3]


@pytest.mark.parametrize("tier", ["off", "high"])
def test_a_plane_under_even_light_has_the_color_of_the_lut(plain, tier):
    """Without the entry factor a directional light of irradiance pi along the normal gives the LUT's own color."""
    look = Look(entry=0, environment=0, light=np.pi, light_azimuth=0, light_elevation=0, azimuth=0, elevation=0,
                distance_mm=300, tier=tier, transmission=0)  # fmt: skip
    radiance = linear(plain, look)[140:180, 140:180]
    expected = lutgen.load().color(look.melanin, look.eumelanin, look.hemoglobin, space="acescg") * lighting.SUN
    assert np.abs(radiance / expected - 1).max() < 0.005


def test_where_the_sky_is_hidden_light_comes_from_skin(plain):
    """Half under even light L, half under skin that itself lies half open, c L / 2: together c L (1 / 2 + c / 4)."""
    surface = np.ones((1, 1, 4), "f4")
    surface[..., 2] = 0.5
    look = Look(entry=0, light=0, azimuth=0, specular=0, distance_mm=300, environment=1, transmission=0)
    c = lutgen.load().color(look.melanin, look.eumelanin, look.hemoglobin, space="acescg")
    stages.set_environment(plain, np.full((8, 16, 3), 0.6))
    with one_map(plain, "surface", surface):
        even = linear(plain, look)[140:180, 140:180]
        behind = linear(plain, replace(look, light=4.0, light_azimuth=180, light_elevation=0))[160, 160]
    stages.set_environment(plain, None)
    assert np.abs(even / (0.6 * c * (1 / 2 + c / 4)) - 1).max() < 0.01  # harmonics of 8 rows
    assert behind - even[20, 20] == pytest.approx(c * c / 4 * lighting.SUN / np.pi, rel=0.01)


def test_an_exr_holds_the_radiance_behind_the_picture(plain, stage, tmp_path):
    """Light of irradiance pi along the normal leaves a plane with the LUT's color, whatever the exposure."""
    look = Look(entry=0, environment=0, light=np.pi, light_azimuth=0, light_elevation=0, azimuth=0, elevation=0,
                distance_mm=300, exposure=3, transmission=0, specular=0, tier="reference")  # fmt: skip
    app.screenshot(plain, look, tmp_path / "plane.EXR")
    view = exr.read(tmp_path / "plane.EXR")["view"]
    expected = lutgen.load().color(look.melanin, look.eumelanin, look.hemoglobin, space="acescg") * lighting.SUN
    assert np.abs(view.stack("RGB")[70:90, 70:90] / expected - 1).max() < 0.005
    assert np.all(view.channels["mask"] == 1)
    assert view.attributes["look"]["exposure"] == 3
    app.screenshot(stage, LOOK, tmp_path / "face.exr")
    face = exr.read(tmp_path / "face.exr")["view"]
    skin, shown = face.channels["mask"], app.picture(stage, LOOK) @ np.array([0.2126, 0.7152, 0.0722])
    light = lutgen.color.encode_srgb(face.stack("RGB") @ np.array([0.2126, 0.7152, 0.0722]))
    assert np.array_equal(np.unique(skin), [0, 0.25, 0.5, 0.75, 1])
    assert np.corrcoef(light[skin == 1], shown[skin == 1])[0, 1] > 0.98
    assert np.all(face.stack("RGB")[skin == 0] == 0)
    with pytest.raises(lutgen.InputError, match=r"picture = .*no.x\.exr: cannot be written"):
        app.screenshot(stage, LOOK, tmp_path / "no" / "x.exr")


def test_a_painted_albedo_is_recolored():
    """What `detail` adds is the ratio to the median in ACEScg, as `LutSet.recolor` has it; gray stays gray."""
    luts, rng = lutgen.load(), np.random.default_rng(1)
    albedo = luts.color(0.01 + 0.02 * rng.random((16, 16)), 0.7, 0.004 + 0.02 * rng.random((16, 16)))
    acescg = lutgen.color.from_xyz(albedo @ np.linalg.inv(lutgen.color.SRGB_FROM_XYZ).T, "acescg")
    expected = acescg / np.median(acescg, axis=(0, 1))
    assert subject.detail(albedo) == pytest.approx(expected, rel=1e-9)
    gray = subject.detail(np.repeat(0.2 + 0.6 * rng.random((8, 8, 1)), 3, axis=-1))
    assert np.ptp(gray, axis=-1).max() < 1e-9
    with pytest.raises(lutgen.InputError, match="albedo is black throughout"):
        subject.detail(np.zeros((4, 4, 3)))


def test_thin_parts_let_light_through(plain):
    """Lit from behind, a thin sheet glows red and a thick one does not."""
    look = Look(environment=0, light=10, light_azimuth=180, light_elevation=0, azimuth=0, elevation=0, distance_mm=300)
    seen = []
    for thickness in (1.0, 31.0):
        surface = np.ones((1, 1, 4), "f4")
        surface[..., 3] = thickness / 32
        with one_map(plain, "surface", surface):
            seen.append(linear(plain, look)[160, 160])
    assert seen[0][0] > 5 * seen[0][2] > 0
    assert seen[1].max() < 0.01 * seen[0][0]


def test_maps_change_the_skin_where_they_are(plain):
    base = linear(plain, Look(azimuth=0, elevation=0, distance_mm=300))
    with one_map(plain, "chromophores", FOURFOLD):
        darker = linear(plain, Look(azimuth=0, elevation=0, distance_mm=300))
    again = linear(plain, Look(azimuth=0, elevation=0, distance_mm=300))
    assert np.all(darker[100:200, 100:200] < 0.9 * base[100:200, 100:200])
    assert np.array_equal(again, base)


def test_maps_fade_on_skin_darker_than_they_were_painted_for(plain):
    """By the power .38 of how much darker: a ratio of 4 at half of full contrast's melanin is 4^(2^-.38)."""
    look = Look(melanin=0.04, azimuth=0, elevation=0, distance_mm=300, tier="off", transmission=0)
    melanin = {}
    with one_map(plain, "chromophores", FOURFOLD):
        for full in (0.04, 0.02):
            plain.full_contrast_melanin = full
            linear(plain, look)
            melanin[full] = gl.read(plain.targets["surface_buffer"], attachment=2)[160, 160, 0]
    plain.full_contrast_melanin = 0.0292
    assert melanin[0.04] == pytest.approx(0.16, rel=2e-3)
    assert melanin[0.02] == pytest.approx(0.04 * 4 ** (0.5**0.38), rel=2e-3)


def test_oxygenation_reaches_the_textures_in_time(stage):
    """50 ms from slider to texture are promised; the expansion and the upload are timed by `lutgen bench --viewer`."""
    passes.set_oxygenation(stage, 0.2)
    color, _, _ = textures.tables(lutgen.load().expand(oxygenation=0.2))
    held = np.frombuffer(stage.sides["none"].textures.color.read(), "f4").reshape(color.shape)
    assert np.abs(held - color).max() < 1e-6
    passes.set_oxygenation(stage, 0.7)


def test_nothing_is_left_on_the_gpu():
    """Objects of a stage that was opened, drawn, resized and released; queries are handed on, not made again."""
    shape, luts = builtin.builtin(), lutgen.load()
    before = gl_objects.alive()
    for _ in range(2):
        stage = app.open_stage(luts, shape, Maps(), (32, 32))
        app.picture(stage, Look(split="burley"))
        stages.resize(stage, (48, 16))
        assert app.picture(stage, Look()).shape == (16, 48, 3)
        assert {kind for kind, _ in gl_objects.alive() - before} >= {*gl_objects.KINDS} - {"Query"}
        stages.release(stage)
        assert gl_objects.alive() - before == set()


@pytest.mark.parametrize("kind", gl_objects.KINDS)
def test_a_lost_object_is_seen(kind):
    """What the check after every test of the viewer would find: an object whose only reference went away."""
    context, before = gl.context(), gl_objects.orphans()
    kept = [context.program("#version 330\nvoid main() { gl_Position = vec4(0); }", "#version 330\nvoid main() {}")]
    make = {
        "Texture": lambda: gl.texture((2, 2)), "Buffer": lambda: context.buffer(reserve=4),
        "Framebuffer": lambda: context.framebuffer([kept.append(gl.texture((2, 2))) or kept[-1]]),
        "Program": lambda: context.program("#version 330\nvoid main() { gl_Position = vec4(1); }"),
        "VertexArray": lambda: context.vertex_array(kept[0], []),
        "Renderbuffer": lambda: context.renderbuffer((2, 2)), "Query": _begun_query,
    }  # fmt: skip
    thing = make[kind]()
    assert gl_objects.orphans() == before
    name = getattr(thing, "glo", 0)
    del thing
    lost = gl_objects.orphans() - before
    assert {lost_kind for lost_kind, _ in lost} == {kind}
    for lost_kind, number in lost:
        assert name in (0, number)
        gl_objects.delete(lost_kind, number)
    gl.free(*kept)


def test_a_pending_error_is_seen():
    gl.context().enable_direct(0xBAD)
    with pytest.raises(lutgen.MachineError, match="OpenGL: GL_INVALID_ENUM"):
        gl.check()
    gl.check()


def _begun_query():
    query = gl.context().query(time=True)
    with query:
        pass
    return query


def test_screenshot_and_sheet_commands(tmp_path, capsys):
    out = tmp_path / "view.png"
    assert (
        main(["view", "--screenshot", str(out), "--size", "96x64", "--preset", "dark", "--set", "azimuth=30", "--json"])
        == 0
    )
    said = json.loads(capsys.readouterr().out)
    assert said["size"] == [96, 64]
    assert said["look"]["melanin"] == lutgen.preset("dark").melanin
    with Image.open(out) as picture:
        assert picture.size == (96, 64)
    assert main(["sheet", "--out", str(tmp_path / "sheet.png"), "--size", "48x48"]) == 0
    with Image.open(tmp_path / "sheet.png") as picture:
        assert picture.size == (144, 144)


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (["--set", "melanin=nan"], 2, "melanin = nan"),
        (["--set", "melanin"], 2, "NAME=VALUE is needed"),
        (["--preset", "pale"], 2, "preset = 'pale'"),
        (["--mesh", "none.glb"], 2, "none.glb: there is no such file"),
        (["--maps", "nowhere"], 2, "maps = nowhere: there is no such folder"),
        (["--size", "9x9"], 2, "allowed is 16 to 4096"),
        (["--size", "wide"], 2, "for example 640x360"),
        (["--look", "none.toml"], 2, "look none.toml: cannot be read"),
        (["nowhere"], 2, "nowhere"),
        (["--environment", "beach"], 2, "environment = beach: allowed is studio, none or a file ending in"),
        (["--albedo", "paint"], 2, "albedo = 'paint': allowed is recolor, invert"),
        (["--set", "environment_azimuth=200"], 2, "environment_azimuth = 200: allowed is -180 to 180"),
    ],
)
def test_bad_input_is_one_line(arguments, status, message, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["view", "--screenshot", "out.png", *arguments]) == status
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out.png").exists()


def test_a_set_of_another_version_is_one_line(tmp_path, capsys):
    folder = tmp_path / "old"
    shutil.copytree(Path(lutgen.__file__).parent.parent / "luts" / "default", folder)
    facts = json.loads((folder / "manifest.json").read_text())
    (folder / "manifest.json").write_text(json.dumps(facts | {"format": 99}))
    for arguments in ([str(folder)], ["--compare", str(folder)]):
        assert main(["view", "--screenshot", str(tmp_path / "out.png"), *arguments]) == 2
        error = capsys.readouterr().err
        assert "format = 99" in error
        assert "bake it anew" in error
        assert error.count("\n") == 1
    assert not (tmp_path / "out.png").exists()


def test_generated_maps_lie_under_the_meshs_own_and_these_under_a_folders(tmp_path, monkeypatch):
    pixel = np.full((1, 1, 3), 9, "u1")
    square = Mesh(np.eye(4, 3, dtype="f4"), np.eye(4, 3, dtype="f4"), np.eye(4, 2, dtype="f4"), np.array([[0, 1, 2]]))
    painted = {"chromophores": np.full((2, 2, 3), 2.0), "surface": np.full((2, 2, 4), 0.5), "normal": pixel}
    monkeypatch.setattr(paint, "paint", lambda shape: dict(painted))
    monkeypatch.setattr(paint, "notes", lambda shape: ("painted",))
    monkeypatch.setattr(paint, "origin_mm", lambda shape: np.array([1.0, 2.0, 3.0]))
    textures_given = {}
    monkeypatch.setattr(
        subject.mesh, "of", lambda *given: replace(square, textures=textures_given, notes=(str(given),))
    )
    shape, maps = subject.model("a.glb", 2.0, None, True)
    assert shape.notes == ("('a.glb', 2.0, True)", "painted")
    assert np.array_equal(shape.positions_mm, np.eye(4, 3) - [1, 2, 3])
    assert maps.albedo is None
    assert maps.chromophores is not None
    assert maps.chromophores[0, 0, 0] == 2
    textures_given |= {"albedo": np.full((1, 1, 3), 188, "u1"), "normal": pixel + 1}
    _, maps = subject.model("a.glb", None, None)
    assert maps.chromophores is None  # it is in the albedo already
    assert maps.albedo is not None
    assert maps.normal is not None
    assert maps.albedo[0, 0, 0] == pytest.approx(0.503, abs=1e-3)
    assert maps.normal[0, 0, 0] == 10
    assert np.all(maps.surface == 0.5)
    Image.fromarray(np.full((1, 1), 255, "u1")).save(tmp_path / "occlusion.png")
    Image.new("RGB", (1, 1), (128, 128, 255)).save(tmp_path / "normal.png")
    _, maps = subject.model("a.glb", None, str(tmp_path))
    assert maps.surface is not None
    assert maps.normal is not None
    assert maps.surface[0, 0].tolist() == [0.5, 0.5, 1.0, 0.5]
    assert maps.normal[0, 0, 2] == 1
    assert maps.albedo is not None
    _, maps = subject.model("a.glb", None, subject.NO_MAPS)
    assert maps == Maps()


def test_a_head_without_texture_coordinates_is_drawn_and_said(tmp_path, capsys):
    import trimesh

    trimesh.creation.icosphere(2, 120).export(tmp_path / "ball.glb")
    out = tmp_path / "out.png"
    assert main(["view", "--screenshot", str(out), "--size", "64x48", "--mesh", str(tmp_path / "ball.glb"),
                 "--albedo", "invert"]) == 0  # fmt: skip
    said = capsys.readouterr().out
    assert "ball.glb has no texture coordinates: maps, freckles" in said
    assert "no albedo to invert" in said
    assert out.exists()


def test_without_opengl_the_line_says_what_to_install(monkeypatch):
    import moderngl

    def refuse(**options):
        raise Exception("no display\nat all")

    monkeypatch.setattr(gl, "_CONTEXTS", [])
    monkeypatch.setattr(moderngl, "create_context", refuse)
    with pytest.raises(lutgen.MachineError, match=r"no OpenGL 3.3 \(no display at all\).*apt-get install -y libegl1"):
        gl.context()
