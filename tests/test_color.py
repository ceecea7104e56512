"""Color against colour-science, and both pipelines' traps."""

import colour
import numpy as np
import pytest

import lutgen
from lutgen import color
from lutgen.tables import make_color

NM = np.arange(380, 781, 5)


def skin_spectra():
    return np.array([lutgen.spectrum(lutgen.preset(name)) for name in ("very-light", "dark", "source-african")])


def test_tables_are_what_the_script_makes():
    made = make_color.columns()
    for name, column in color.tables().items():
        assert np.allclose(column, made[name], rtol=1e-8, atol=1e-12), name


def test_xyz_is_colour_sciences():
    """colour-science integrates every nm; skin spectra every 5 nm differ by 2e-5 at most."""
    for spectrum in skin_spectra():
        shape = colour.SpectralShape(380, 780, 5)
        expected = colour.sd_to_XYZ(
            colour.SpectralDistribution(spectrum, NM),
            colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(shape),
            colour.SDS_ILLUMINANTS["D65"].copy().align(shape), method="Integration",
        ) / 100  # fmt: skip
        assert np.abs(color.spectrum_to_xyz(spectrum) - expected).max() < 2e-5


def test_matrices_are_colour_sciences():
    xyz = np.random.default_rng(0).random((50, 3))
    srgb = colour.XYZ_to_sRGB(xyz, apply_cctf_encoding=False)
    assert np.abs(color.from_xyz(xyz, "srgb") - srgb).max() < 4e-4  # its matrix has four digits
    d65 = colour.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"]["D65"]
    ap1 = colour.XYZ_to_RGB(xyz, colour.RGB_COLOURSPACES["ACEScg"], d65, "CAT02")
    assert np.abs(color.from_xyz(xyz, "acescg") - ap1).max() < 1e-6


def test_lab_and_delta_e_are_colour_sciences():
    rng = np.random.default_rng(1)
    d65 = colour.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"]["D65"]
    xyz = rng.random((500, 3))
    assert np.abs(color.lab(xyz) - colour.XYZ_to_Lab(xyz, d65)).max() < 1e-9
    one = rng.uniform([0, -100, -100], [100, 100, 100], (2000, 3))
    two = rng.uniform([0, -100, -100], [100, 100, 100], (2000, 3))
    two[:200] = one[:200] + rng.normal(0, 0.5, (200, 3))
    one[200:220, 1:] = 0
    assert np.abs(color.delta_e00(one, two) - colour.delta_E(one, two, method="CIE 2000")).max() < 1e-9


def test_encoding_and_hex_are_those_of_srgb():
    linear = np.linspace(-0.2, 1.2, 99)
    assert np.abs(color.encode_srgb(linear) - colour.cctf_encoding(np.clip(linear, 0, 1), function="sRGB")).max() < 1e-7
    assert color.hex_code([2.0, -1.0, 0.0]) == "#ff0000"


def test_white_is_white_in_both_pipelines():
    """Trap: the D65 white under the 2015 functions is (0.9476, 1, 1.0754) unless XYZ is rescaled.

    10 nm sums miss the white by 9e-4.
    """
    for pipeline in color.PIPELINES:
        for n in (81, 41):
            xyz = color.spectrum_to_xyz(np.ones(n), pipeline)
            assert np.abs(xyz - [0.9505, 1.0, 1.089]).max() < 1e-3
            assert np.abs(color.from_xyz(xyz, "srgb", pipeline) - 1).max() < 1.5e-3
            assert np.abs(color.from_xyz(xyz, "acescg") - 1).max() < 1.5e-3


def test_pipelines_differ_on_the_documents_skins_by_what_the_readme_states():
    """lutgen/README.md, Color."""
    for name, expected in (("source-caucasian", 1.5), ("source-asian", 1.3), ("source-african", 0.7)):
        spectrum = lutgen.spectrum(lutgen.preset(name))
        labs = [color.lab(color.spectrum_to_xyz(spectrum, pipeline)) for pipeline in color.PIPELINES]
        assert float(color.delta_e00(*labs)) == pytest.approx(expected, abs=0.05)  # stated with one digit


def test_linear_srgb_is_unclipped_and_in_the_pipeline_asked_for():
    skin = lutgen.preset("light")
    default, source = (lutgen.linear_srgb(skin, pipeline=p) for p in color.PIPELINES)
    assert np.abs(default - source).max() > 1e-3
    red = color.from_xyz(color.spectrum_to_xyz((NM > 620).astype(float)), "srgb")
    assert red.min() < 0


def test_acescg_goes_back_by_the_pipelines_own_matrix():
    xyz = np.random.default_rng(3).random((20, 3))
    for pipeline in color.PIPELINES:
        for space in color.SPACES:
            found = color.from_acescg(color.from_xyz(xyz, "acescg"), space, pipeline)
            assert np.abs(found - color.from_xyz(xyz, space, pipeline)).max() < 1e-12


def test_measured_presets_have_the_lightness_order_of_their_names():
    lightness = [float(color.lab(color.spectrum_to_xyz(lutgen.spectrum(skin)))[0]) for skin in lutgen.PRESETS.values()][
        :6
    ]
    assert np.all(np.diff(lightness) < -3)


def test_bad_color_input_is_named():
    for call, message in (
        (lambda: color.xyz_weights(3), "step_nm = 3: allowed is 5 or 10"),
        (lambda: color.xyz_weights(5, "cie"), "pipeline = 'cie': allowed is default, source"),
        (lambda: color.from_xyz([1, 1, 1], "rgb"), "space = 'rgb': allowed is srgb, acescg, xyz"),
        (lambda: color.spectrum_to_xyz(np.ones(7)), "reflectance has 7 wavelengths"),
    ):
        with pytest.raises(lutgen.InputError, match=message.replace("(", r"\(")):
            call()


def test_the_metric_is_the_difference_of_near_colors_and_lab_goes_back():
    rng = np.random.default_rng(4)
    for lab in rng.uniform([1, -60, -60], [100, 60, 60], (30, 3)):
        for step in rng.normal(0, 0.005, (5, 3)):
            length = np.linalg.norm(color.metric(lab) @ step)
            assert length == pytest.approx(float(color.delta_e00(lab, lab + step)), rel=0.01)
    xyz = rng.random((4, 5, 3)) ** 4
    assert np.abs(color.from_lab(color.lab(xyz)) - xyz).max() < 1e-12
    assert np.abs(color.encode_srgb(color.decode_srgb(xyz)) - xyz).max() < 1e-9
