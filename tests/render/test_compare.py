"""`lutgen compare`: what differs is found, what is noise is not, and its sigma is what repeated renders scatter by."""

import json
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from lutgen import color
from lutgen.cli import main
from lutgen.errors import InputError
from lutgen.files import exr, images
from lutgen.render import compare, compare_files, compare_picture, film
from lutgen.render.compare_files import Picture

SKIN = np.array([0.42, 0.27, 0.19])
ROWS, COLUMNS = 96, 128
# Half of the noise is light that all channels share, as of paths that miss the lamp; the rest is one wavelength's.
MIX = np.array([[0.7, 0.6, 0.0, 0.2], [0.7, 0.1, 0.6, 0.0], [0.7, 0.0, 0.1, 0.6]])


def scene(gain=1.0) -> np.ndarray:
    """Skin that is darker to the right and redder below, ACEScg."""
    x, y = np.meshgrid(np.linspace(1, 0.3, COLUMNS), np.linspace(0, 0.1, ROWS))
    return (SKIN * x[..., None] + np.array([1.0, 0.2, 0.1]) * y[..., None]) * gain


def rendered(true: np.ndarray, noise: float, seed: int, skin=None) -> Picture:
    """A picture with noise of that share of its values, and its honest covariance."""
    drawn = np.random.default_rng(seed).standard_normal((*true.shape[:2], 4)) @ MIX.T
    covariance = (noise * true)[..., None] * (noise * true)[..., None, :] * (MIX @ MIX.T)
    return Picture(f"seed {seed}", true + noise * true * drawn, covariance, skin)


def exact(true: np.ndarray) -> Picture:
    return Picture("exact", true, np.zeros((*true.shape, 3)), None)


def boxes(values: np.ndarray) -> np.ndarray:
    return values.reshape(ROWS // 4, 4, COLUMNS // 4, 4, 3).mean(axis=(1, 3))


def delta(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return color.delta_e00(*(color.lab(color.from_acescg(v, "xyz")) for v in (a, b)))


def test_without_noise_it_is_the_color_difference_of_the_boxes():
    a, b = scene(), scene(1.1) + np.array([0.01, 0, 0.02])
    found = compare.compare(exact(a), exact(b))
    expected = delta(boxes(a), boxes(b))
    assert np.allclose(found.delta_e00, expected, atol=1e-12)
    assert (found.boxes, found.most) == (expected.size, expected.max())
    assert found.mean.value == pytest.approx(expected.mean())
    assert (found.median.value, found.p95.value) == (np.median(expected), np.quantile(expected, 0.95))
    assert (found.mean.sigma, found.noise_alone, found.noise_over_sigma) == (0, (0, 0, 0), None)


def test_two_seeds_of_one_scene_do_not_differ():
    """Noise of 10 % a pixel is ΔE00 1 a box; taken off, it leaves what it said it would."""
    a, b = (rendered(scene(), 0.1, seed) for seed in (1, 2))
    found = compare.compare(a, b)
    assert delta(boxes(a.acescg), boxes(b.acescg)).mean() > 0.9
    for one, alone in zip((found.mean, found.median, found.p95), found.noise_alone, strict=True):
        assert abs(one.value - alone) < 4 * one.sigma
    assert abs(found.mean.value) < 0.25
    assert found.noise_over_sigma == pytest.approx(1, abs=0.04)  # a median of chi square with 15 degrees is 0.98
    squared = np.sign(found.delta_e00) * found.delta_e00**2
    assert abs(squared.mean()) < 4 * squared.std() / np.sqrt(squared.size)
    for bias in (found.lightness, *found.channels):
        assert abs(bias.value) < 4 * bias.sigma


def test_a_difference_under_noise_is_found():
    """A difference as large as the noise; what is not linear in Lab is left out of `e`: below 0.02 here."""
    true = delta(boxes(scene()), boxes(scene(1.05)))
    found = compare.compare(rendered(scene(), 0.1, 3), rendered(scene(1.05), 0.1, 4))
    without = compare.compare(*(Picture(p.name, p.acescg, None, None) for p in
                                   (rendered(scene(), 0.1, 3), rendered(scene(1.05), 0.1, 4))))  # fmt: skip
    squared = np.sign(found.delta_e00) * found.delta_e00**2
    assert squared.mean() == pytest.approx((true**2).mean(), abs=4 * 2 * found.mean.value * found.mean.sigma + 0.02)
    assert np.nanmean(without.delta_e00**2) > (true**2).mean() + 0.7
    assert found.lightness.value == pytest.approx(
        (color.lab(color.from_acescg(boxes(scene(1.05)), "xyz")) - color.lab(color.from_acescg(boxes(scene()), "xyz")))[
            ..., 0
        ].mean(),
        abs=4 * found.lightness.sigma,
    )
    for one in found.channels:
        assert one.value == pytest.approx(0.05, abs=4 * one.sigma)


def test_its_sigma_is_what_seeds_scatter_by():
    runs = [
        compare.compare(rendered(scene(), 0.1, 10 + k), rendered(scene(1.04), 0.1, 1010 + k)) for k in range(40)
    ]  # of 40 values a standard deviation is known to 11 %
    for name in ("mean", "median", "p95", "lightness"):
        values = [getattr(run, name).value for run in runs]
        assert np.std(values) == pytest.approx(np.mean([getattr(run, name).sigma for run in runs]), rel=0.45)
    for c in range(3):
        values = [run.channels[c].value for run in runs]
        assert np.std(values) == pytest.approx(np.mean([run.channels[c].sigma for run in runs]), rel=0.45)


def test_a_sigma_that_lies_is_seen():
    a, b = (rendered(scene(), 0.1, seed) for seed in (1, 2))
    half = [Picture(p.name, p.acescg, rendered(scene(), 0.05, 0).covariance, None) for p in (a, b)]
    found = compare.compare(*half)
    assert found.noise_over_sigma == pytest.approx(2, rel=0.1)
    assert found.mean.value > 0.3


def test_derivatives_are_those_of_lab_and_of_ciede2000():
    rng = np.random.default_rng(6)
    acescg, step = 0.02 + 0.5 * rng.random((50, 3)), 1e-5 * rng.standard_normal((50, 3))
    labs = [color.lab(color.from_acescg(v, "xyz")) for v in (acescg - step, acescg + step)]
    moved = np.einsum("nij,nj->ni", compare._lab_derivative(acescg), 2 * step)
    assert np.allclose(labs[1] - labs[0], moved, rtol=1e-4, atol=1e-9)
    lab, move = np.array([[60.0, 15, 18], [30, 12, 10], [70, 4, 20]]), 0.2 * rng.standard_normal((3, 3))
    squared = np.einsum("na,nab,nb->n", move, compare._metric(lab), move)
    assert np.sqrt(squared) == pytest.approx(color.delta_e00(lab - move / 2, lab + move / 2), rel=2e-3)


def test_only_skin_of_both_counts_and_half_a_box_of_it():
    a, b = scene(), scene(1.2)
    skin = np.ones((2, ROWS, COLUMNS))
    skin[0, :, :32] = 0
    skin[1, :6] = 0
    skin[1, 50, 60:63] = 0.5  # an outline
    b[50, 60:63] = 9
    found = compare.compare(Picture("a", a, None, skin[0]), Picture("b", b, None, skin[1]))
    assert np.isnan(found.delta_e00[:, :8]).all()
    assert np.isnan(found.delta_e00[0]).all()
    assert np.isfinite(found.delta_e00[1:, 8:]).all()  # row 1 by half
    assert found.boxes == 23 * 24
    assert found.most < 7


@pytest.mark.parametrize("size", [(10, 7), (4, 5), (3, 3)])
def test_sizes_need_not_be_multiples_of_four(size):
    a = np.full((*size, 3), 0.2)
    found = compare.compare(exact(a), exact(1.3 * a))
    assert found.delta_e00.shape == (-(-size[0] // 4), -(-size[1] // 4))
    assert found.mean.value == pytest.approx(float(delta(a[0, 0], 1.3 * a[0, 0])))


def test_brighter_than_white_is_not_clipped():
    a = np.full((8, 8, 3), 2.0)
    assert compare.compare(exact(a), exact(1.5 * a)).mean.value > 5


def write(path, acescg, chromaticities=exr.ACESCG, **more):
    channels = exr.rgb(acescg.astype("f4")) | {name: values.astype("f4") for name, values in more.items()}
    exr.write(path, [exr.Part("picture", channels, {})], chromaticities)
    return path


def write_render(path, seed: int, gain=1.0, estimates=25) -> Picture:
    """What `lutgen render` writes of noisy samples; the picture that it should be read as."""
    true = scene(gain)
    drawn = np.random.default_rng(seed).standard_normal((estimates, ROWS, COLUMNS, 4)) @ MIX.T
    samples = true * (1 + 0.5 * drawn)
    products = np.stack([(samples[..., i] * samples[..., j]).sum(axis=0) for i, j in film._PAIRS], axis=-1)
    sums = np.concatenate([samples.sum(axis=0), np.full((ROWS, COLUMNS, 1), estimates), products], axis=-1)
    film.write(film.Film(sums, estimates, 4, {"walk": "none"}), path)
    covariance = np.stack([np.stack([((samples[..., i] - samples[..., i].mean(axis=0)) * samples[..., j]).sum(axis=0)
                                     for j in range(3)], axis=-1) for i in range(3)], axis=-2)  # fmt: skip
    return Picture(
        path.name, samples.mean(axis=0), covariance / (estimates * max(estimates - 1, 1)), np.ones((ROWS, COLUMNS))
    )


def test_the_same_colors_in_acescg_rec709_and_png_do_not_differ(tmp_path):
    bytes_ = np.random.default_rng(7).integers(40, 255, (16, 16, 3), dtype="u1")
    srgb = color.decode_srgb(bytes_ / 255)
    acescg = color.from_xyz(srgb @ np.linalg.inv(color.SRGB_FROM_XYZ).T, "acescg")
    Image.fromarray(bytes_).save(tmp_path / "a.png")
    files = [tmp_path / "a.png", write(tmp_path / "b.exr", acescg), write(tmp_path / "c.exr", srgb, exr.REC709)]
    read = [compare_files.read(path) for path in files]
    for one in read[1:]:
        assert compare.compare(read[0], one).most < 1e-3


def test_every_one_of_16_bits_is_compared(tmp_path):
    encoded = np.random.default_rng(7).integers(40 << 8, 1 << 16, (16, 16, 3)) / 65535
    images.write_16_bit(tmp_path / "a.png", encoded)
    found = compare_files.read(tmp_path / "a.png")
    assert np.array_equal(found.acescg, color.to_acescg(color.decode_srgb(encoded)))
    assert found.notes[0] == "a.png: 16-bit sRGB, so a tone curve in it counts as difference"


def same(found, expected, relative: float) -> bool:
    """Whether arrays, neither None, are alike to a share of the expected one's largest value."""
    assert found is not None
    return bool(np.abs(found - expected).max() <= relative * np.abs(expected).max())


def test_what_a_file_holds_is_read(tmp_path):
    expected = write_render(tmp_path / "r.exr", 8)
    found = compare_files.read(tmp_path / "r.exr")
    assert same(found.acescg, expected.acescg, 1e-6)
    assert same(found.covariance, expected.covariance, 1e-5)  # of floats whose squares are 25 times larger
    assert np.all(found.skin == 1)
    assert found.notes == ()
    write_render(tmp_path / "one.exr", 8, estimates=1)
    assert compare_files.read(tmp_path / "one.exr").notes == ("one.exr: of one sample, so its noise is a guess",)
    true, skin = scene(), (scene()[..., 0] > 0.3).astype(float)
    sigma = {f"sigma.{name}": 0.1 * true[..., i] for i, name in enumerate("RGB")}
    found = compare_files.read(write(tmp_path / "a.exr", true, mask=skin, **sigma))
    assert same(found.covariance, 0.01 * true[..., None] ** 2 * np.eye(3), 1e-6)
    assert same(found.skin, skin, 0)
    assert "independent" in found.notes[0]
    rgba = np.zeros((8, 8, 4), "u1")
    rgba[2:6, 2:6] = 200, 150, 120, 255
    Image.fromarray(rgba).save(tmp_path / "a.png")
    shown = compare_files.read(tmp_path / "a.png").skin
    assert shown is not None
    assert shown.sum() == 16


def refused(capsys, *arguments) -> str:
    assert main(["compare", *map(str, arguments)]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    return err


def test_bad_input_is_one_line_that_names_it(tmp_path, capsys):
    good = write(tmp_path / "good.exr", scene())
    assert "gone.exr: there is no such file" in refused(capsys, good, tmp_path / "gone.exr")
    assert "small.exr is 64 x 48: pictures of one size" in refused(
        capsys, good, write(tmp_path / "small.exr", scene()[::2, ::2])
    )
    broken = scene()
    broken[5, 7, 1] = np.nan
    assert "1 NaN or infinite values, the first at row 5, column 7" in refused(
        capsys, write(tmp_path / "n.exr", broken), good
    )
    noisy = {f"sigma.{name}": np.full((ROWS, COLUMNS), np.inf) for name in "RGB"}
    assert "values in its noise" in refused(capsys, write(tmp_path / "s.exr", scene(), **noisy), good)
    assert "no pixel shows skin in both" in refused(
        capsys, write(tmp_path / "k.exr", scene(), mask=0 * scene()[..., 0]), good
    )
    thin = np.zeros((ROWS, COLUMNS))
    thin[::4] = 1
    assert "skin by half" in refused(capsys, write(tmp_path / "t.exr", scene(), mask=thin), good)
    (tmp_path / "text.png").write_text("no picture")
    (tmp_path / "text.exr").write_text("no picture")
    assert "not a picture that can be read" in refused(capsys, good, tmp_path / "text.png")
    assert "not a whole OpenEXR file" in refused(capsys, good, tmp_path / "text.exr")
    exr.write(tmp_path / "y.exr", [exr.Part("y", {"Y": np.ones((8, 8), "f4")}, {})])
    assert "R, G and B" in refused(capsys, good, tmp_path / "y.exr")
    p3 = (0.68, 0.32, 0.265, 0.69, 0.15, 0.06, 0.3127, 0.329)
    assert "other primaries" in refused(capsys, good, write(tmp_path / "p3.exr", scene(), p3))
    assert "png" in refused(capsys, good, good, "--png", tmp_path / "no" / "x.png")
    copy = write(tmp_path / "copy.exr", scene())
    before = copy.read_bytes()
    Image.new("RGB", (8, 8)).save(tmp_path / "p.png")
    assert "is one of the pictures to compare" in refused(capsys, good, tmp_path / "p.png", "--png", tmp_path / "p.png")
    assert "ending in .png is needed" in refused(capsys, good, copy, "--png", copy)
    assert copy.read_bytes() == before
    with pytest.raises(InputError, match="one size"):
        compare_files.mask(exact(scene()), exact(scene()[:4]))


def test_renders_of_one_seed_are_refused_for_their_noise_is_alike():
    a, b = (replace(rendered(scene(), 0.1, 3), seed=seed) for seed in (5, 6))
    assert compare.compare(a, b).boxes > 0
    with pytest.raises(InputError, match=r"both rendered with seed 5, .* another --seed"):
        compare.compare(a, replace(b, seed=5))


def test_over_black_no_share_is_known(tmp_path, capsys):
    black, lit = (write(tmp_path / f"{k}.exr", k * scene(), mask=1 + 0 * scene()[..., 0]) for k in (0, 1))
    assert main(["compare", str(black), str(lit)]) == 0
    assert "R unknown (A: 0), G unknown" in capsys.readouterr().out
    assert main(["compare", str(black), str(lit), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["bias"]["r"] is None


def test_the_command_prints_figures_json_and_a_picture(tmp_path, capsys):
    for seed in (1, 2):
        write_render(tmp_path / f"{seed}.exr", seed, 1 + 0.1 * seed)
    files = [str(tmp_path / "1.exr"), str(tmp_path / "2.exr")]
    assert main(["compare", *files, "--png", str(tmp_path / "x.png")]) == 0
    text = capsys.readouterr().out
    assert "ΔE00 of 768 boxes" in text
    assert main(["compare", *files, "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    found = compare.compare(*map(compare_files.read, files))
    assert said["delta_e00"]["mean"] == {"value": found.mean.value, "sigma": found.mean.sigma}
    assert f"mean {found.mean.value:.3f} ± {found.mean.sigma:.3f}" in text
    assert said["bias"]["g"]["value"] == pytest.approx(1.2 / 1.1 - 1, abs=4 * said["bias"]["g"]["sigma"])
    assert (said["size"], said["boxes"], said["notes"]) == ([COLUMNS, ROWS], 768, [])
    with Image.open(tmp_path / "x.png") as drawn:
        assert drawn.size == (3 * 384 + 64, 3 * ROWS + 120)
    write(tmp_path / "3.exr", scene(), mask=np.ones((ROWS, COLUMNS)))
    assert main(["compare", files[0], str(tmp_path / "3.exr")]) == 0
    assert "3.exr: holds no sigma, so its noise counts as difference" in capsys.readouterr().out


def test_the_picture_shows_both_and_the_map():
    a, b = scene(), scene(1.2)
    found = compare.compare(exact(a), exact(b))
    drawn = np.asarray(compare_picture.draw(exact(a), exact(b), found))
    shown = np.rint(255 * color.encode_srgb(color.from_acescg(a, "srgb")))
    assert np.array_equal(
        drawn[
            compare_picture._HEAD : compare_picture._HEAD + 3 * ROWS : 3,
            compare_picture._GAP : compare_picture._GAP + 384 : 3,
        ],
        shown,
    )
    assert np.array_equal(compare_picture._colors(np.array([0.0, 1.0, 7.0])), compare_picture._RAMP[[0, -1, -1]])
    light = compare_picture._RAMP @ [0.2126, 0.7152, 0.0722]
    assert np.all(np.diff(light) > 10)
