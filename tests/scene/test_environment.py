"""Surroundings from files: both formats say the same, even light lights as much as pi, bad pictures are one line."""

import importlib

import numpy as np
import pytest

import lutgen
from lutgen.cli import main
from lutgen.files import exr, images
from lutgen.files.texture_maps import Maps
from lutgen.head.mesh import Mesh
from lutgen.scene import environment, light, subject
from lutgen.scene.look import Look

app, gl, passes, stages = (importlib.import_module(f"lutgen.viewer.{n}") for n in ("app", "gl", "passes", "stage"))


def coded(picture: np.ndarray) -> np.ndarray:
    """RGBE bytes [rows, columns, 4], mantissas cut off as Radiance does."""
    _, exponent = np.frexp(picture.max(axis=-1))
    mantissa = np.floor(picture * np.ldexp(256.0, -exponent)[..., None])
    return np.concatenate([mantissa, exponent[..., None] + 128], axis=-1).astype("u1")


def write_hdr(path, picture: np.ndarray, runs: bool, fields: str = "FORMAT=32-bit_rle_rgbe\n"):
    rows, columns = picture.shape[:2]
    pixels = coded(picture)
    body = bytearray()
    for row in pixels:
        if not runs:
            body += row.tobytes()
            continue
        body += bytes([2, 2, columns >> 8, columns & 255])
        for plane in row.T:
            start = 0
            while start < columns:
                same = 1
                while start + same < columns and same < 127 and plane[start + same] == plane[start]:
                    same += 1
                if same > 2:
                    body += bytes([128 + same, plane[start]])
                    start += same
                else:
                    count = min(columns - start, 5)
                    body += bytes([count]) + plane[start : start + count].tobytes()
                    start += count
    path.write_bytes(f"#?RADIANCE\n# a test\n{fields}\n-Y {rows} +X {columns}\n".encode() + body)


def write_exr(path, picture: np.ndarray):
    exr.write(path, [exr.Part("all", exr.rgb(picture.astype("f4")), {})])


def scene_of(rows: int = 16) -> np.ndarray:
    """A dim gradient with a bright patch: runs, literals and a range of exponents."""
    ways, _ = environment.directions(rows)
    picture = 0.2 + 0.1 * ways[..., 1:2] * np.array([1.0, 0.5, 0.25])
    picture[: rows // 3, rows // 2 : rows // 2 + 3] = 40.0, 30.0, 20.0
    return picture


@pytest.mark.parametrize("runs", [True, False])
def test_a_radiance_picture_comes_back(tmp_path, runs):
    picture = scene_of()
    write_hdr(tmp_path / "a.hdr", picture, runs)
    values = images.read(tmp_path / "a.hdr", "environment", radiance=True).values
    assert np.abs(values / picture - 1).max() < 0.5 / 64  # half of a mantissa's last step, in the darkest channel
    write_hdr(tmp_path / "b.hdr", picture, runs, "EXPOSURE=2\nFORMAT=32-bit_rle_rgbe\nEXPOSURE= 4.0\n")
    assert images.read(tmp_path / "b.hdr", "environment", radiance=True).values == pytest.approx(values / 8)


def test_both_formats_give_the_same_light_in_acescg(tmp_path):
    picture = scene_of()
    write_hdr(tmp_path / "a.hdr", picture, True)
    write_exr(tmp_path / "a.exr", picture)
    from_hdr, from_exr = (environment.read(tmp_path / name) for name in ("a.hdr", "a.exr"))
    assert np.abs(from_hdr / from_exr - 1).max() < 0.01
    assert environment.mean_radiance(from_hdr) == pytest.approx(environment.mean_radiance(from_exr), rel=5e-3)
    gray = np.full((4, 8, 3), 0.37)
    write_exr(tmp_path / "gray.exr", gray)
    assert environment.read(tmp_path / "gray.exr") == pytest.approx(gray, rel=1e-6)


def test_directions_and_their_angles():
    ways, angle = environment.directions(64)
    assert angle.sum() == pytest.approx(4 * np.pi)
    assert (ways * angle[..., None]).sum(axis=(0, 1)) == pytest.approx(np.zeros(3), abs=1e-9)
    assert ways[0, 0, 1] > 0.99
    assert ways[32, 64, 2] < -0.99  # the middle of the picture lies behind the head
    assert ways[32, 96, 0] > 0.99  # right of it lies the head's left


def test_blurring_keeps_even_light_and_the_mean():
    for level in environment.blurred(np.full((10, 20, 3), 0.8)):
        assert level == pytest.approx(np.full(level.shape, 0.8))
    levels = environment.blurred(scene_of(64))
    assert [len(level) for level in levels] == [256, 128, 64, 32, 16, 8, 4, 2]
    means = [environment.mean_radiance(level) for level in levels]
    assert means == pytest.approx([environment.mean_radiance(scene_of(64))] * 8, rel=0.05)
    peaks = [level.max() for level in levels]
    assert np.all(np.diff(peaks) <= 1e-9)
    assert peaks[-1] < 0.2 * peaks[0]


@pytest.fixture(scope="module")
def plain():
    """A square meter facing the camera, without maps."""
    corners = np.array([[-500, -500, 0], [500, -500, 0], [500, 500, 0], [-500, 500, 0]], "f4")
    square = Mesh(corners, np.tile(np.array([0, 0, 1], "f4"), (4, 1)), None, np.array([[0, 1, 2], [0, 2, 3]], "i4"))
    opened = app.open_stage(lutgen.load(), square, Maps(), (64, 64))
    yield opened
    stages.release(opened)
    gl.check()


LOOK = Look(entry=0, light=0, environment=1, azimuth=0, elevation=0, distance_mm=300, tier="off", transmission=0)


def seen(stage, **values) -> tuple[np.ndarray, np.ndarray]:
    """Scattered and reflected light [3] in the middle of a frame, ACEScg."""
    from dataclasses import replace

    app.picture(stage, replace(LOOK, **values))
    scattered = gl.read(stage.targets["scattered_buffer"])[64, 64, :3]
    return scattered, gl.read(stage.targets["surface_buffer"], attachment=3)[64, 64, :3]


@pytest.mark.parametrize("kind", ["exr", "hdr"])
def test_even_surroundings_of_radiance_1_light_like_irradiance_pi(plain, tmp_path, kind):
    """Then a skin shows the LUT's own color, and what it reflects does not depend on its place in the picture."""
    even = np.full((8, 16, 3), 1.0)
    (write_exr if kind == "exr" else lambda p, v: write_hdr(p, v, True))(tmp_path / f"even.{kind}", even)
    stages.set_environment(plain, subject.surroundings_of(str(tmp_path / f"even.{kind}")))
    expected = lutgen.load().color(LOOK.melanin, LOOK.eumelanin, LOOK.hemoglobin, space="acescg")
    mirrored = []
    for turn in (0, 77):
        for elevation in (0, 20):
            scattered, reflected = seen(plain, environment_azimuth=turn, elevation=elevation)
            assert np.abs(scattered / expected - 1).max() < 0.006
            if not elevation:
                mirrored.append(reflected)
    assert mirrored[0] == pytest.approx(mirrored[1], rel=1e-3)
    assert 0.02 < mirrored[0].min() <= mirrored[0].max() < 0.05  # Fresnel of skin head-on, .028, and what lies rougher
    stages.set_environment(plain, None)


def test_surroundings_turn_with_the_look(plain):
    """Light from the head's left reaches a face turned forward when it is turned by -90 degrees, its mirror too."""
    ways, _ = environment.directions(32)
    lamp = np.where((ways @ [1.0, 0, 0] > 0.9)[..., None], [5.0, 4.0, 3.0], 0.01)
    stages.set_environment(plain, lamp)
    by_turn = {turn: seen(plain, environment_azimuth=turn) for turn in (-90, 0, 90, 180)}
    for part in range(2):
        front = by_turn[-90][part]
        assert all(np.all(front > 5 * by_turn[turn][part]) for turn in (0, 90, 180))
    assert by_turn[-90][0][0] / by_turn[-90][0][2] > 5 / 3
    stages.set_environment(plain, None)


def test_no_surroundings_are_dark_and_the_studio_comes_back(plain):
    before = seen(plain)
    stages.set_environment(plain, subject.surroundings_of("none"))
    assert max(part.max() for part in seen(plain)) == 0
    stages.set_environment(plain, subject.surroundings_of("studio"))
    assert np.array_equal(seen(plain), before)


def test_normalizing_makes_a_file_as_bright_as_the_studio(tmp_path):
    write_exr(tmp_path / "a.exr", 300 * scene_of())
    radiance = subject.surroundings_of(str(tmp_path / "a.exr"), normalized=True)
    assert radiance is not None
    assert environment.mean_radiance(radiance) == pytest.approx(light.studio_mean())


@pytest.mark.parametrize(
    ("name", "picture", "message"),
    [
        ("a.exr", np.ones((4, 9, 3)), "is 9 x 4; a picture of all around is twice as wide as high"),
        ("a.hdr", np.ones((8, 8, 3)), "is 8 x 8; a picture"),
        ("a.exr", np.full((4, 8, 3), np.nan), "holds NaN or infinite"),
        ("a.exr", np.full((4, 8, 3), -0.5), "negative values, down to -0.5"),
        ("a.exr", np.full((4, 8, 3), 1e20), "holds a radiance of 1e+20; allowed is 0 to 1e+09"),
        ("a.png", None, "allowed is studio, none or a file ending in .exr, .hdr, .pic"),
        ("none.exr", None, "there is no such file"),
        ("broken.exr", b"nothing", "not a whole OpenEXR file"),
        ("broken.hdr", b"nothing", "not a Radiance picture"),
        ("xyz.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 4 +X 8\n", "only RGBE rows"),
        ("side.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n+X 8 -Y 4\n", "only RGBE rows"),
        ("short.hdr", b"#?RADIANCE\n\n-Y 4 +X 8\n\2\2\0\10\210\0", "not a whole Radiance picture"),
        ("flat.hdr", b"#?RADIANCE\n\n-Y 4 +X 8\n1234", "not a whole Radiance picture (4 bytes"),
        ("huge.hdr", b"#?RADIANCE\n\n-Y 99999 +X 199998\n", "too few or too many"),
        ("gray.exr", "Y", "has channels Y; R, G and B are needed"),
    ],
)
def test_bad_surroundings_are_one_line(tmp_path, capsys, monkeypatch, name, picture, message):
    monkeypatch.chdir(tmp_path)
    if isinstance(picture, bytes):
        (tmp_path / name).write_bytes(picture)
    elif isinstance(picture, str):
        exr.write(tmp_path / name, [exr.Part("all", {"Y": np.ones((4, 8), "f4")}, {})])
    elif picture is not None:
        (write_exr if name.endswith("exr") else lambda p, v: write_hdr(p, v, True))(tmp_path / name, picture)
    assert main(["view", "--screenshot", "out.png", "--environment", name]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert name in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out.png").exists()
