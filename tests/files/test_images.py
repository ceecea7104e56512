"""Pictures that hold data: an independent library's 16 bits are read to the last one, and ours are read by it."""

import numpy as np
import OpenImageIO
import pytest
from PIL import Image

import lutgen
from lutgen.files import exr, images


def texels(channels: int) -> np.ndarray:
    return np.random.default_rng(channels).integers(0, 65536, (19, 23, channels)).astype("u2")


def foreign(path, values: np.ndarray, **attributes) -> None:
    spec = OpenImageIO.ImageSpec(values.shape[1], values.shape[0], values.shape[2], "uint16")
    for name, value in {"oiio:UnassociatedAlpha": 1, **attributes}.items():
        spec[name.replace("_", ":")] = value
    out = OpenImageIO.ImageOutput.create(str(path))
    assert out is not None
    out.open(str(path), spec)
    out.write_image(values)
    out.close()


@pytest.mark.parametrize("channels", [3, 4])
@pytest.mark.parametrize(
    ("name", "attributes"),
    [("a.png", {}), ("a.tif", {"compression": "none"}), ("a.tif", {"compression": "zip"}),
     ("a.tif", {"compression": "lzw"})],
)  # fmt: skip
def test_every_one_of_16_bits_is_read(tmp_path, channels, name, attributes):
    values = texels(channels)
    foreign(tmp_path / name, values, **attributes)
    image = images.read(tmp_path / name, "map")
    assert image.bits == 16
    assert np.array_equal(np.rint(image.values * 65535), values[..., :3])
    if channels == 4:
        assert image.alpha is not None
        assert np.array_equal(np.rint(image.alpha * 65535), values[..., 3])
    else:
        assert image.alpha is None


def test_channels_one_after_the_other_are_refused(tmp_path):
    foreign(tmp_path / "a.tif", texels(3), planarconfig="separate")
    with pytest.raises(lutgen.InputError, match="map .*save it interleaved"):
        images.read(tmp_path / "a.tif", "map")


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_16_bits_are_written(tmp_path, channels):
    values = texels(channels)
    shares = values / np.float32(65535)
    images.write_16_bit(tmp_path / "a.png", shares[..., 0] if channels == 1 else shares)
    hints = OpenImageIO.ImageSpec()
    hints["oiio:UnassociatedAlpha"] = 1
    file = OpenImageIO.ImageInput.open(str(tmp_path / "a.png"), hints)
    assert file is not None
    assert file.spec().format == "uint16"
    assert np.asarray(file.read_image("uint16")).tolist() == values.tolist()
    file.close()
    images.write_16_bit(tmp_path / "b.png", np.array([[-1.0, 2.0]]))
    assert images.read(tmp_path / "b.png", "map").values.ravel().tolist() == [0, 1]


@pytest.mark.parametrize("mode", ["LA", "RGBA", "P"])
def test_alpha_is_read(tmp_path, mode):
    image = Image.new("RGBA", (4, 3), (10, 20, 30, 255))
    image.putpixel((1, 2), (0, 0, 0, 0))
    if mode == "P":
        palette = Image.new("P", (4, 3), 1)
        palette.putpalette([0, 0, 0, 10, 20, 30])
        palette.putpixel((1, 2), 0)
        palette.save(tmp_path / "a.png", transparency=0)
    else:
        image.convert(mode).save(tmp_path / "a.png")
    read = images.read(tmp_path / "a.png", "map")
    assert read.alpha is not None
    assert read.alpha[2, 1] == 0
    assert (read.alpha > 0).sum() == 11
    assert read.values.shape == (3, 4, 1 if mode == "LA" else 3)


def test_alpha_of_exr_is_read(tmp_path):
    color, alpha = np.full((2, 3, 3), 0.5, "f4"), np.eye(2, 3, dtype="f4")
    exr.write(tmp_path / "a.exr", [exr.Part("a", exr.rgb(color) | {"A": alpha}, {})])
    image = images.read(tmp_path / "a.exr", "map")
    assert image.bits == 32
    assert np.array_equal(image.values, color)
    assert image.alpha is not None
    assert np.array_equal(image.alpha, alpha)


def test_a_layer_of_exr_is_a_color(tmp_path):
    texels = np.random.default_rng(0).random((2, 3, 3)).astype("f4")
    channels = {f"albedo.{name}": texels[..., i].copy() for i, name in enumerate("RGB")} | {"Z": texels[..., 0].copy()}
    exr.write(tmp_path / "a.exr", [exr.Part("a", channels, {})], exr.REC709)
    image = images.read(tmp_path / "a.exr", "map")
    assert np.array_equal(image.values, texels)
    assert image.chromaticities == pytest.approx(exr.REC709)


def test_plain_channels_come_before_layers_and_the_first_part_before_others(tmp_path):
    plain, layer, other = (np.full((2, 3, 3), value, "f4") for value in (0.2, 0.5, 0.8))
    channels = exr.rgb(plain) | {f"Albedo.{name}": layer[..., i].copy() for i, name in enumerate("RGB")}
    exr.write(tmp_path / "a.exr", [exr.Part("a", channels, {}), exr.Part("b", exr.rgb(other), {})])
    image = images.read(tmp_path / "a.exr", "map")
    assert np.array_equal(image.values, plain)
    assert image.part is not None
    assert len(image.part.channels) == 6


def test_a_cut_exr_is_one_line_and_openexr_says_nothing_beside_it(tmp_path, capfd):
    exr.write(
        tmp_path / "a.exr", [exr.Part("a", exr.rgb(np.random.default_rng(0).random((64, 64, 3)).astype("f4")), {})]
    )
    whole = (tmp_path / "a.exr").read_bytes()
    for size in (100, 500, len(whole) // 2, len(whole) - 10):
        (tmp_path / "b.exr").write_bytes(whole[:size])
        with pytest.raises(lutgen.InputError, match=r"map .*b.exr: not a whole OpenEXR file"):
            images.read(tmp_path / "b.exr", "map")
    assert capfd.readouterr() == ("", "")


def test_alpha_that_is_no_number_and_a_folder_are_one_line(tmp_path):
    channels = exr.rgb(np.full((2, 3, 3), 0.5, "f4")) | {"A": np.full((2, 3), np.nan, "f4")}
    exr.write(tmp_path / "a.exr", [exr.Part("a", channels, {})])
    with pytest.raises(lutgen.InputError, match="holds NaN"):
        images.read(tmp_path / "a.exr", "map")
    with pytest.raises(lutgen.InputError, match="is a folder"):
        images.read(tmp_path, "map")


def test_nothing_is_one_line(tmp_path):
    (tmp_path / "a.png").write_bytes(b"")
    with pytest.raises(lutgen.InputError, match="map .*a.png: the file is empty"):
        images.read(tmp_path / "a.png", "map")
