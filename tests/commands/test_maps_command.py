"""`lutgen maps`: what it writes is what it found, another skin keeps the detail, bad input is one line."""

import json
import re

import numpy as np
import pytest
from PIL import Image

import lutgen
from lutgen import cli, color
from lutgen.files import exr, images, texture_maps
from lutgen.fitting import maps_folder
from lutgen.skin.tissue import PRESETS

SIDE = 128
TO_XYZ = np.linalg.inv(color.SRGB_FROM_XYZ).T


@pytest.fixture(scope="module")
def luts():
    return lutgen.load()


def field(low: float, high: float, seed: int, side: int = SIDE) -> np.ndarray:
    """Random values of broad, finer and no correlation, even in logarithm."""
    rng = np.random.default_rng(seed)
    share = 0.5 * texture_maps.resized(rng.random((5, 5)), side, side) + 0.3 * texture_maps.resized(
        rng.random((30, 30)), side, side
    )
    return low * (high / low) ** (share + 0.2 * rng.random((side, side)))


@pytest.fixture(scope="module")
def painted(luts):
    """Melanin, hemoglobin and color [R, C, 3] of a face that no one has."""
    m, h = field(0.012, 0.06, 1), field(0.005, 0.02, 2)
    return m, h, luts.color(m, 0.7, h)


def save(path, linear, alpha=None):
    """A 16-bit sRGB PNG, or a float EXR."""
    if path.suffix == ".exr":
        channels = exr.rgb(linear.astype("f4")) | ({} if alpha is None else {"A": alpha.astype("f4")})
        exr.write(path, [exr.Part("a", channels, {})], exr.REC709)
    else:
        encoded = color.encode_srgb(linear)
        images.write_16_bit(path, encoded if alpha is None else np.dstack([encoded, alpha]))
    return path


def run(capsys, *arguments):
    status = cli.main(["maps", *(str(a) for a in arguments)])
    out, err = capsys.readouterr()
    return status, out, err


def report_of(capsys, *arguments) -> dict:
    status, out, err = run(capsys, *arguments, "--json")
    assert (status, err) == (0, "")
    return json.loads(out)


def value(folder, name: str) -> np.ndarray:
    """What a map's texels stand for, first row on top."""
    (path,) = folder.glob(f"{name}.*")
    picture = images.read(path, "map")
    texels = picture.values[..., 0]
    if picture.bits == 32:
        return texels
    return {"residual": 32 * texels, "out_of_reach": texels}.get(name, 4 * texels.astype(float) ** 3)


def shown(luts, melanin, eumelanin, hemoglobin) -> np.ndarray:
    """The LUT's color, its ends included: 16 bits fall a hair beyond them."""
    grid = luts.color_lut.grid
    axes = grid.axes[::-1]
    return luts.color(*(np.clip(v, a.low, a.high) for v, a in zip((melanin, eumelanin, hemoglobin), axes, strict=True)))


def lab(linear):
    return color.lab(np.asarray(linear, float) @ TO_XYZ)


@pytest.mark.parametrize("kind", ["png", "exr"])
def test_what_is_written_is_what_the_albedo_needs(capsys, tmp_path, luts, painted, kind):
    """Pigment and blood come back; the residual is that of the color which the maps give from the balanced albedo."""
    m, h, albedo = painted
    noise = 0.05 if kind == "exr" else 0.01  # PNG holds ratios up to 4
    albedo = albedo * (1 + noise * np.random.default_rng(3).standard_normal(albedo.shape))
    out = tmp_path / "out"
    source = save(tmp_path / f"a.{kind}", albedo)
    report = report_of(capsys, source, "--out", out, "--format", kind, "--balance", "none",
                       "--eumelanin", 0.7)  # fmt: skip
    assert report["gain"] == [1, 1, 1]
    skin = report["skin"]
    chromophores = [skin[name] * value(out, name) for name in texture_maps.RATIOS]
    assert np.median(chromophores[0] / m) == pytest.approx(1, abs=0.02)
    assert np.median(chromophores[2] / h) == pytest.approx(1, abs=0.02)
    left = color.delta_e00(lab(shown(luts, *chromophores)), lab(albedo))
    held = (chromophores[0] < 3.99 * skin["melanin"]) & (chromophores[2] < 3.99 * skin["hemoglobin"]) | (kind == "exr")
    assert np.mean(held) == pytest.approx(1 - report["residual"]["beyond_png_ratio_share"] * (kind == "png"), abs=1e-3)
    assert value(out, "residual")[held] == pytest.approx(left[held], abs=0.02)
    assert report["residual"]["delta_e00_median"] == pytest.approx(np.median(left), abs=0.01)
    assert report["residual"]["delta_e00_p95"] == pytest.approx(np.quantile(left, 0.95), abs=0.01)
    assert report["residual"]["texels"] == left.size
    missed = value(out, "out_of_reach")
    assert np.mean(missed == 1) == pytest.approx(np.mean(left > report["out_of_reach_delta_e00"]), abs=1e-3)
    facts = json.loads((out / "maps.json").read_text())
    assert facts["skin"] == skin
    assert set(facts["files"]) | {"maps.json"} == {path.name for path in out.iterdir()}


@pytest.mark.parametrize("kind", ["png", "exr"])
def test_the_viewer_reads_the_maps_as_they_are(capsys, tmp_path, luts, painted, kind):
    """Sliders at the stated skin times the ratios give the albedo's colors, and nothing fades."""
    m, _, albedo = painted
    report = report_of(capsys, save(tmp_path / "a.exr", albedo), "--out", tmp_path / "out", "--format", kind)
    assert report["skin"]["eumelanin"] == 0.7
    under = texture_maps.Maps(albedo=np.ones((2, 2, 3)))
    maps = texture_maps.load(tmp_path / "out", under)
    assert maps.albedo is None  # it is what the maps were made of
    assert maps.full_contrast_melanin == report["skin"]["melanin"] == pytest.approx(np.median(m), rel=0.01)
    assert maps.chromophores is not None
    skin = maps.chromophores * [report["skin"][name] for name in texture_maps.RATIOS]
    apart = color.delta_e00(lab(shown(luts, *np.moveaxis(skin, -1, 0))), lab(albedo[::-1]))
    assert apart.max() < 0.3


def test_absolute_maps_lie_on_the_axes_of_the_lut(capsys, tmp_path, luts, painted):
    m, h, albedo = painted
    albedo = save(tmp_path / "a.exr", albedo)
    report_of(capsys, albedo, "--out", tmp_path / "png", "--absolute")
    report_of(capsys, albedo, "--out", tmp_path / "exr", "--absolute", "--format", "exr")
    for axis, values in ((luts.color_lut.grid.melanin, m), (luts.color_lut.grid.hemoglobin, h)):
        texels = images.read(tmp_path / "png" / f"{axis.name}_absolute.png", "map").values[..., 0]
        as_is = images.read(tmp_path / "exr" / f"{axis.name}_absolute.exr", "map").values[..., 0]
        assert np.quantile(np.abs(as_is / values - 1), 0.95) < 0.02
        last = axis.count - 1
        assert (texels * last + 0.5) / axis.count == pytest.approx(axis.coordinate(as_is), abs=1e-4)


def test_light_is_found_given_and_given_back(capsys, tmp_path, painted):
    """What is printed, given by hand, gives the same; a tint is not fitted where there is said to be none."""
    albedo = save(tmp_path / "a.exr", painted[2] * [0.8, 1.0, 1.35] * 1.3)
    out = tmp_path / "out"
    fitted = report_of(capsys, albedo, "--out", out, "--eumelanin", 0.7)
    assert fitted["residual"]["delta_e00_median"] < 1
    assert 1.1 < fitted["balance"][0] / fitted["balance"][2] < 1.35 / 0.8  # redder light is like more blood
    assert np.prod(fitted["balance"]) == pytest.approx(1)
    again = report_of(capsys, albedo, "--out", out, "--force", "--eumelanin", 0.7, "--exposure",
                      fitted["exposure_stops"], "--balance", ",".join(map(str, fitted["balance"])))  # fmt: skip
    assert again["gain"] == pytest.approx(fitted["gain"])
    assert again["residual"]["delta_e00_mean"] == pytest.approx(fitted["residual"]["delta_e00_mean"], abs=1e-3)
    plain = report_of(capsys, albedo, "--out", out, "--force", "--balance", "none")
    assert plain["gain"] == [1, 1, 1]
    assert plain["residual"]["delta_e00_median"] > fitted["residual"]["delta_e00_median"] + 2
    brighter = report_of(capsys, albedo, "--out", out, "--force", "--balance", "none", "--exposure", "-1")
    assert brighter["gain"] == [0.5, 0.5, 0.5]
    scaled = report_of(capsys, albedo, "--out", out, "--force", "--balance", "none", "--exposure", "auto")["gain"]
    assert np.ptp(scaled) == pytest.approx(0)
    tinted = report_of(capsys, albedo, "--out", out, "--force", "--exposure", "0")
    assert tinted["exposure_stops"] == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("preset", ["very-light", "dark", "source-african"])
@pytest.mark.parametrize("kind", ["png", "exr"])
def test_another_skin_has_its_own_tone_and_the_albedos_detail(capsys, tmp_path, luts, painted, preset, kind):
    """The middle is the target's color; alpha and background stay; a hair of a color that no skin has is about as dark
    beside its skin as it was."""
    albedo, alpha = painted[2].copy(), np.ones((SIDE, SIDE))
    albedo[20:24, 40:60] *= 0.3 * np.array([0.8, 1.0, 1.2])
    alpha[:10], albedo[:10] = 0, 0.25
    alpha[10] = 0.5
    skin, out = PRESETS[preset], tmp_path / "out"
    report_of(capsys, save(tmp_path / "a.exr", albedo, alpha), "--out", out, "--format", kind, "--target", preset,
         "--eumelanin", 0.7, "--balance", "none")  # fmt: skip
    recolored = images.read(out / f"recolored.{kind}", "map")
    assert recolored.alpha == pytest.approx(alpha, abs=1e-4)
    linear = recolored.values if kind == "exr" else color.decode_srgb(recolored.values)
    assert np.all(np.isfinite(linear))
    assert linear[:10] == pytest.approx(albedo[:10], rel=1e-3)
    goal = luts.color(skin.melanin, skin.eumelanin, skin.hemoglobin)
    middle = np.median(linear[10:].reshape(-1, 3), axis=0)
    assert color.delta_e00(lab(middle), lab(goal)) < 1
    y = [(v @ TO_XYZ)[..., 1] for v in (albedo, linear)]
    before, after = (np.median(v[20:24, 40:60]) / np.median(v[20:24, 62:82]) for v in y)
    assert after == pytest.approx(before, rel=0.3)
    inside = np.s_[30:]
    assert np.corrcoef(np.log(y[0][inside]).ravel(), np.log(y[1][inside]).ravel())[0, 1] > 0.85


def test_an_albedo_on_its_own_skin_stays_as_it_is(capsys, tmp_path, painted):
    albedo = save(
        tmp_path / "a.exr", painted[2] * (1 + 0.1 * np.random.default_rng(1).standard_normal((SIDE, SIDE, 3)))
    )
    painted_rgb = images.read(albedo, "map").values
    first = report_of(capsys, albedo, "--out", tmp_path / "out", "--format", "exr")
    skin = ",".join(str(v) for v in first["skin"].values())
    report_of(capsys, albedo, "--out", tmp_path / "out", "--format", "exr", "--force", "--target", skin)
    recolored = images.read(tmp_path / "out" / "recolored.exr", "map").values
    assert color.delta_e00(lab(recolored), lab(painted_rgb * first["gain"])).max() < 0.3


def cells_shown(picture: np.ndarray) -> float:
    """How far the slopes of a picture [R, C] repeat at the cells of the low frequencies (32 a side) and at their
    harmonics: the most there over the root mean square nearby. 3.2 happens once in 500 such places by chance."""
    most = 0.0
    for axis in (0, 1):
        steps = np.abs(np.diff(picture, n=2, axis=axis)).mean(axis=1 - axis)
        power = np.abs(np.fft.rfft(steps - steps.mean()))
        for cells in (32, 64, 96):
            seam = round(cells * len(steps) / picture.shape[axis])
            near = np.r_[power[seam - 15 : seam - 2], power[seam + 3 : seam + 16]]
            most = max(most, power[seam - 1 : seam + 2].max() / np.sqrt(np.mean(near**2)))
    return most


@pytest.mark.parametrize("preset", ["dark", "source-african"])
def test_dark_skin_shows_neither_cells_nor_blotches(capsys, tmp_path, luts, preset):
    """Light skin with grain, as a camera has it, moved to dark skin: its luminance varies over its mean no more than
    it did, coarse and fine, and no cells show. Nor do they in maps of skin as dark, whose blood color hardly tells."""
    side, skin = 256, PRESETS[preset]
    across = np.linspace(0, 1, side)
    grain = np.random.default_rng(7).standard_normal((side, side, 3))
    m, h = 1.15**across, 10 ** (across[:, None] - 0.5) * 1.5 ** np.sin(12 * across)
    light = luts.color(0.015 * m, 0.7, 0.009 * h**0.3) * (1 + 0.02 * grain)
    light = np.rint(255 * color.encode_srgb(light)).astype("u1")
    Image.fromarray(light).save(tmp_path / "a.png")
    report_of(capsys, tmp_path / "a.png", "--out", tmp_path / "out", "--format", "exr", "--target", preset)
    dark = images.read(tmp_path / "out" / "recolored.exr", "map").values
    before, after = (np.log((v @ TO_XYZ)[..., 1]) for v in (color.decode_srgb(light / 255), dark))
    assert np.std(after) < 1.1 * np.std(before)
    coarse = [v.reshape(16, 16, 16, 16).mean(axis=(1, 3)) for v in (before, after)]
    assert np.std(coarse[1]) < 1.1 * np.std(coarse[0])
    for channel in np.moveaxis(np.log(np.maximum(dark, 1e-5)), -1, 0):
        assert cells_shown(channel) < 3.2
    albedo = save(tmp_path / "b.exr", luts.color(skin.melanin * m, 0.7, 0.012 * h) * (1 + 0.002 * grain))
    report_of(capsys, albedo, "--out", tmp_path / "maps", "--format", "exr", "--eumelanin", 0.7, "--balance", "none")
    for name in ("melanin", "hemoglobin"):
        assert cells_shown(np.log(value(tmp_path / "maps", name))) < 3.2


@pytest.mark.parametrize("name", ["light", "brown"])
def test_the_wrong_encoding_is_noticed_and_the_right_one_is_not_doubted(capsys, tmp_path, luts, name):
    skin = PRESETS[name]
    m, h = (v * field(0.7, 1.4, seed, 48) for v, seed in ((skin.melanin, 5), (skin.hemoglobin, 6)))
    linear = luts.color(m, 0.7, h)
    right = [save(tmp_path / "a.png", linear), save(tmp_path / "a.exr", linear)]
    wrong = [save(tmp_path / "b.exr", color.encode_srgb(linear)), save(tmp_path / "b.png", color.decode_srgb(linear))]
    more = ("--out", tmp_path / "out", "--force", "--eumelanin", 0.7, "--balance", "none")
    for path in right:
        assert report_of(capsys, path, *more)["warnings"] == []
    for path, advice in zip(wrong, ("srgb", "linear"), strict=True):
        (warning,) = report_of(capsys, path, *more)["warnings"]
        assert f"--encoding {advice}" in warning
        assert report_of(capsys, path, *more, "--encoding", advice)["warnings"] == []
    status, text, _ = run(capsys, wrong[0], *more)
    assert status == 0
    assert "\nwarning: read as linear" in text


def test_every_color_of_no_skin_is_marked(capsys, tmp_path, painted):
    albedo = painted[2].copy()
    albedo[:16, :16] = [0.1, 0.2, 0.8]
    albedo[:16, 16:32] = [0.001, 0.002, 0.001]
    report = report_of(capsys, save(tmp_path / "a.png", albedo), "--out", tmp_path / "out", "--balance", "none")
    missed = value(tmp_path / "out", "out_of_reach")
    assert np.all(missed[:16, :16] == 1)
    assert np.all(missed[:16, 16:32] > 0)
    assert report["residual"]["out_of_reach_share"] == pytest.approx(np.mean(missed == maps_folder.BEYOND))
    assert np.mean(missed[16:] > 0) < 0.01


def test_an_albedo_in_acescg_is_read_as_it_says(capsys, tmp_path, luts, painted):
    linear = painted[2].astype("f4")
    acescg = color.from_xyz(linear @ np.linalg.inv(color.SRGB_FROM_XYZ).T, "acescg").astype("f4")
    skins = []
    for name, texels, primaries in (("s", linear, exr.REC709), ("a", acescg, exr.ACESCG)):
        path = tmp_path / f"{name}.exr"
        exr.write(path, [exr.Part("a", exr.rgb(texels), {})], primaries)
        skins.append(list(report_of(capsys, path, "--out", tmp_path / name)["skin"].values()))
    assert skins[0] == pytest.approx(skins[1], rel=0.01)
    p3 = (0.68, 0.32, 0.265, 0.69, 0.15, 0.06, 0.3127, 0.329)
    exr.write(tmp_path / "p3.exr", [exr.Part("a", exr.rgb(linear), {})], p3)
    status, _, err = run(capsys, tmp_path / "p3.exr", "--out", tmp_path / "p3")
    assert status == 2
    assert "has other primaries than Rec. 709 and ACEScg" in err


def test_colors_of_no_skin_are_refused_and_many_of_them_are_said(capsys, tmp_path, painted):
    blue = painted[2][..., ::-1].copy()
    status, out, err = run(
        capsys, save(tmp_path / "b.png", np.full((8, 8, 3), [0.02, 0.05, 0.9])), "--out", tmp_path / "b"
    )
    assert (status, out) == (2, "")
    assert "its colors are those of no skin (ΔE00 " in err
    assert not (tmp_path / "b").exists()
    some = painted[2].copy()
    some[: len(some) // 3] = blue[: len(some) // 3]
    report = report_of(capsys, save(tmp_path / "c.png", some), "--out", tmp_path / "c", "--balance", "none")
    assert any("farther than 5 from any skin" in line for line in report["warnings"])
    assert not any(
        "farther" in w
        for w in report_of(capsys, save(tmp_path / "d.png", painted[2]), "--out", tmp_path / "d")["warnings"]
    )


def test_where_to_see_it_names_the_set_and_can_be_pasted(capsys, tmp_path, luts, painted):
    folder = lutgen.save(luts, tmp_path / "my set")
    out = tmp_path / "my maps"
    assert cli.main(["maps", str(save(tmp_path / "a.png", painted[2])), "--out", str(out), "--luts", str(folder)]) == 0
    assert f"lutgen view '{folder}' --maps '{out}' --set" in capsys.readouterr().out


@pytest.mark.parametrize("shape", [(1, 1), (3, 200), (70, 9)])
def test_any_size_and_an_expanded_set(capsys, tmp_path, luts, shape):
    folder = lutgen.save(luts.expand(oxygenation=0.95), tmp_path / "luts")
    out = tmp_path / "out"
    albedo = save(tmp_path / "a.png", np.broadcast_to(luts.color(0.02, 0.7, 0.01), (*shape, 3)))
    report = report_of(capsys, albedo, "--out", out, "--luts", folder, "--target", "0.1,0.7,0.01")
    assert report["oxygenation"] == 0.95
    assert report["size"] == [shape[1], shape[0]]
    assert value(out, "melanin").shape == shape
    with Image.open(out / "preview.png") as picture:
        assert picture.size[0] == 1200


def _bytes(path, data: bytes):
    path.write_bytes(data)
    return path


GOOD = np.full((4, 4, 3), 0.3) * [1, 0.6, 0.45]
BAD = {
    "no such file": lambda p: p / "a.png",
    "the file is empty": lambda p: _bytes(p / "a.png", b""),
    "not a picture that can be read": lambda p: _bytes(p / "a.png", b"no picture at all"),
    "not a whole OpenEXR file": lambda p: _bytes(p / "a.exr", b"v/1\x01 broken"),
    "holds NaN": lambda p: save(p / "a.exr", np.where(np.eye(4)[..., None] > 0, np.nan, GOOD)),
    "holds negative values, down to -0.25": lambda p: save(p / "a.exr", GOOD - np.array([0, 0, 0.385])),
    "is black throughout": lambda p: save(p / "a.png", GOOD * 0),
    "is clear throughout": lambda p: save(p / "a.png", GOOD, np.zeros((4, 4))),
    "is gray; melanin": lambda p: save(p / "a.png", np.full((4, 4, 3), 0.3)),
    "is gray; .* give a color picture": lambda p: _gray(p / "a.png"),
}


def _gray(path):
    Image.new("L", (4, 4), 120).save(path)
    return path


@pytest.mark.parametrize("message", BAD)
def test_what_is_no_albedo_is_one_line(capsys, tmp_path, message):
    status, out, err = run(capsys, BAD[message](tmp_path), "--out", tmp_path / "out")
    assert (status, out) == (2, "")
    assert len(err.splitlines()) == 1
    assert err.startswith("lutgen: albedo ")
    assert re.search(message, err)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--balance", "1,2"], "balance = '1,2': auto, none or three gains"),
        (["--balance", "warm"], "balance = 'warm'"),
        (["--balance", "1,nan,1"], "balance = nan: allowed is 0.01 to 100"),
        (["--exposure", "bright"], "exposure = 'bright': a number or auto"),
        (["--exposure", "40"], "exposure = 40: allowed is -8 to 8 stops"),
        (["--eumelanin", "2"], "eumelanin = 2: allowed is 0 to 1"),
        (["--eumelanin", "some"], "eumelanin = 'some'"),
        (["--format", "tga"], "format = 'tga': allowed is png, exr"),
        (["--encoding", "log"], "encoding = 'log': allowed is srgb, linear"),
        (["--target", "pale"], "target = 'pale': allowed is very-light"),
        (["--target", "0.9,0.7,0.01"], "target: melanin = 0.9: these LUTs cover 0.001 to 0.5"),
        (["--target", "0.1,x,0.01"], "target = 'x'"),
        (["--luts", "nowhere"], "nowhere"),
    ],
)
def test_what_is_no_option_is_one_line(capsys, tmp_path, options, message):
    status, out, err = run(capsys, save(tmp_path / "a.png", GOOD), "--out", tmp_path / "out", *options)
    assert (status, out) == (2, "")
    assert len(err.splitlines()) == 1
    assert message in err
    assert not (tmp_path / "out").exists()


def test_only_maps_are_replaced_and_never_the_albedo(capsys, tmp_path):
    albedo = save(tmp_path / "a.png", GOOD)
    out = tmp_path / "out"
    report_of(capsys, albedo, "--out", out)
    status, _, err = run(capsys, albedo, "--out", out)
    assert status == 2
    assert "exists; give another folder, or --force" in err
    inside = save(out / "painted.png", GOOD)
    status, _, err = run(capsys, inside, "--out", out, "--force")
    assert status == 2
    assert "holds the albedo" in err
    assert inside.exists()
    other = tmp_path / "luts"
    other.mkdir()
    (other / "manifest.json").write_text("{}")
    status, _, err = run(capsys, albedo, "--out", other, "--force")
    assert status == 2
    assert "holds no maps.json" in err
    assert (other / "manifest.json").exists()
