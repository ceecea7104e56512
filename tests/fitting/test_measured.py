"""What an instrument saw: colors in every notation, spectra from tables as people write them."""

import numpy as np
import pytest

import lutgen
from lutgen import color
from lutgen.fitting import measured

HEAD = "wavelength_nm,reflectance\n"


def written(tmp_path, text: str, encoding="utf-8"):
    path = tmp_path / "s.csv"
    path.write_bytes(text.encode(encoding))
    return path


def test_every_notation_of_one_color_is_that_color():
    linear = color.decode_srgb(np.array([0xC0, 0x95, 0x80]) / 255)
    xyz = linear @ np.linalg.inv(color.SRGB_FROM_XYZ).T
    L, a, b = color.lab(xyz)
    r, g, bl = np.array([0xC0, 0x95, 0x80]) / 255
    for text in (
        "#c09580", " #C09580", "c09580", f"srgb:{r},{g},{bl}", f"LINEAR: {linear[0]} ,{linear[1]},{linear[2]}",
        f"lab:{L},{a},{b}", f"xyz:{xyz[0]},{xyz[1]},{xyz[2]}",
    ):  # fmt: skip
        assert np.abs(measured.read(text).xyz - xyz).max() < 1e-12, text
    assert color.hex_code(color.from_xyz(xyz, "srgb")) == "#c09580"


def test_a_file_named_like_a_color_is_a_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "c09580").write_text(HEAD + "400,0.2\n500,0.3\n")
    assert measured.read("c09580").space == "spectrum"
    assert measured.read("#c09580").space == "srgb"


TABLES = {
    "plain": HEAD + "400,0.2\n500,0.3\n600,0.5\n",
    "comments and spaces": "# by hand\n\n wavelength_nm , reflectance\n# red last\n400, 0.2\n500 ,0.3\n\n600,0.5",
    "other order, other case, unsorted": "Reflectance,Wavelength_nm\n0.5,600\n0.2,400\n0.3,500\n",
    "semicolons": "wavelength_nm;reflectance\n400;0.2\n500;0.3\n600;0.5\n",
    "tabs": "wavelength_nm\treflectance\r\n400\t0.2\r\n500\t0.3\r\n600\t0.5\r\n",
    "more columns": "wavelength_nm,std,reflectance\n400,x,0.2\n500,,0.3\n600,1,0.5\n",
    "quotes": '"wavelength_nm","reflectance"\n"400","0.2"\n"500","0.3"\n"600","0.5"\n',
}


@pytest.mark.parametrize("name", TABLES)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_tables_as_people_write_them(tmp_path, name, encoding):
    found = measured.read(written(tmp_path, TABLES[name], encoding))
    assert np.array_equal(np.array(found.wavelength_nm), [400, 500, 600])
    assert np.array_equal(np.array(found.reflectance), [0.2, 0.3, 0.5])
    assert found.notes == (("columns not read: std",) if name == "more columns" else ())


BAD = {
    "": "empty; a CSV with columns wavelength_nm, reflectance is needed",
    "# nothing\n": "empty; a CSV",
    HEAD: "the spectrum is empty",
    "400,0.2\n500,0.3\n": "column wavelength_nm is missing; the header is '400, 0.2'",
    "wavelength_nm,R\n400,0.2\n": "column reflectance is missing",
    "wavelength_nm,reflectance,reflectance\n400,0.2,0.3\n": "column reflectance is twice",
    HEAD + "400,0.2\n500\n": "line 3: '500' lacks a number",
    HEAD + '# x\n400,0.2\n500,"0,3"\n': "line 4: '500,0,3' lacks a number (with a decimal point)",
    HEAD + "379.9,0.2\n500,0.3\n": "wavelength_nm = 379.9 (1 of 2 rows): allowed is 380 to 780",
    HEAD + "400,0.2\n781,0.3\n": "wavelength_nm = 781 (1 of 2 rows): allowed is 380 to 780",
    HEAD + "400,0.2\nnan,0.3\n": "wavelength_nm = nan (1 of 2 rows)",
    HEAD + "400,0.2\n400,0.3\n": "wavelength_nm = 400 stands there twice",
    HEAD + "400,nan\n500,0.3\n": "reflectance = nan at 400 nm (1 of 2 rows): allowed is 0 to 1; mend or leave out",
    HEAD + "400,inf\n500,0.3\n": "reflectance = inf at 400 nm",
    HEAD + "400,-0.01\n500,0.3\n": "reflectance = -0.01 at 400 nm",
    HEAD + "400,1.01\n500,0.3\n": "reflectance = 1.01 at 400 nm (1 of 2 rows): allowed is 0 to 1; mend",
    HEAD + "400,18\n500,35.5\n": "reflectance = 18 at 400 nm (2 of 2 rows): allowed is 0 to 1; they look like percent: "
    "divide by 100",
}  # fmt: skip


@pytest.mark.parametrize("text", BAD)
def test_bad_tables_are_named_in_one_line(tmp_path, text):
    with pytest.raises(lutgen.InputError) as error:
        measured.read(written(tmp_path, text))
    assert BAD[text] in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("srgb:0.5,0.5", "three numbers with commas are needed"),
        ("lab:50,0,x", "three numbers with commas are needed"),
        ("lab:101,0,0", "color lab: L = 101: allowed is 0 to 100"),
        ("linear:0.5,-0.1,0.2", "color linear: g = -0.1: allowed is 0 to 1"),
        ("srgb:0.5,nan,0.2", "color srgb: g = nan"),
        ("xyz:40,38,30", "color xyz: X = 40: allowed is 0 to 1.1"),
        ("#xyzxyz", "six hexadecimal digits are needed"),
        ("cmyk:1,2,3", "'cmyk:1,2,3': cannot be read"),
        (7, "measured = 7: a CSV's path, a color or"),
        (([400, 500], [0.1]), "two equal lists are needed"),
        (([], []), "the spectrum is empty"),
        ((["red"], [0.1]), "wavelength_nm = ['red']: a number or an array of numbers is needed"),
    ],
)
def test_bad_input_is_named(given, message):
    with pytest.raises(lutgen.InputError) as error:
        measured.read(given)
    assert message in str(error.value)


def test_pictures_and_folders_are_no_tables(tmp_path):
    (tmp_path / "picture.png").write_bytes(b"\x89PNG\r\n\x1a\n\xff\xfe\xfd")
    for path, message in ((tmp_path / "picture.png", "not text in UTF-8"), (tmp_path, "cannot be read")):
        with pytest.raises(lutgen.InputError, match=message):
            measured.read(path)


def test_color_weights_hold_the_ends_and_lose_no_light():
    """White stays white from any sampling; a straight spectrum keeps its color where the samples span the table."""
    nm5, weights = color.xyz_weights(5)
    rng = np.random.default_rng(0)
    samplings = [nm5, np.arange(400.0, 701, 10), np.arange(380.0, 781), np.array([550.0]), np.array([420.0, 650.0])]
    samplings += [np.sort(rng.uniform(380, 780, n)) for n in (3, 40, 500)]
    for nm in samplings:
        found = measured.color_weights(nm)
        assert np.abs(found.sum(axis=0) - weights.sum(axis=0)).max() < 1e-12
        assert found.min() >= 0
    assert np.array_equal(measured.color_weights(nm5), weights)
    slope = (nm5 - 380) / 400
    for nm in (np.arange(380.0, 781, 10), np.arange(380.0, 781)):
        ends = 1e-4  # a dense sampling averages half a window at 380 and 780 nm, where the weights are near 0
        assert np.abs((nm - 380) / 400 @ measured.color_weights(nm) - slope @ weights).max() < ends
    held = np.interp(nm5, [420, 650], [0.2, 0.6])
    assert (
        np.abs(np.array([0.2, 0.6]) @ measured.color_weights(np.array([420.0, 650.0])) - held @ weights).max() < 1e-12
    )


def test_dense_samples_are_averaged():
    """With 1 nm samples the color's noise is that of about five samples a node, not of one."""
    few, many = (measured.color_weights(np.arange(380.0, 781, step)) for step in (5, 1))
    assert np.sqrt((many**2).sum() / (few**2).sum()) == pytest.approx(1 / np.sqrt(5), rel=0.1)
