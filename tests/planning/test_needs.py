"""What a scene needs: tones and what varies, from words, ranges and maps."""

import numpy as np
import pytest
from PIL import Image

from lutgen.errors import InputError
from lutgen.files import exr, texture_maps
from lutgen.planning import needs
from lutgen.planning.needs import Needs, scene
from lutgen.skin.chromophores import EUMELANIN, HEMOGLOBIN, MELANIN, OXYGENATION
from lutgen.skin.tissue import preset


def test_all_tones_span_what_is_allowed_and_oxygenation_stays():
    found = scene("all")
    assert (found.melanin, found.eumelanin, found.hemoglobin) == (MELANIN, EUMELANIN, HEMOGLOBIN)
    assert found.varying == ("melanin", "eumelanin", "hemoglobin")
    assert found.oxygenations == (0.7,)


def test_presets_span_what_lies_between_them():
    found = scene("dark,very-light,tan")
    light, dark = preset("very-light"), preset("dark")
    assert found.melanin == (light.melanin, dark.melanin)
    assert found.hemoglobin == (light.hemoglobin, dark.hemoglobin)
    assert found.eumelanin == (0.7, 0.7)
    assert found.varying == ("melanin", "hemoglobin")
    assert scene("tan").varying == ()


def test_what_varies_has_its_range_in_the_tones_or_else_all_that_is_allowed():
    found = scene("melanin=0.02:0.05,hemoglobin=0.01", "melanin,oxygenation")
    assert found.melanin == (0.02, 0.05)
    assert found.hemoglobin == (0.01, 0.01)
    assert found.oxygenation == OXYGENATION
    assert found.oxygenations == (0, 0.5, 1)
    assert scene("light", "hemoglobin").hemoglobin == HEMOGLOBIN
    assert scene("all", "melanin").varying == ("melanin",)
    assert scene("light,dark", "melanin,hemoglobin,eumelanin").eumelanin == EUMELANIN
    assert scene("light", "none").varying == ()


def test_a_map_multiplies_what_the_sliders_span(tmp_path):
    """A texel stands for 4 t^3; what leaves the allowed range is clamped, as the viewer does."""
    texels = np.array([[80, 161], [200, 255]], "u1")
    Image.fromarray(texels).save(tmp_path / "melanin.png")
    exr.write(tmp_path / "hemoglobin.exr", [exr.Part("map", {"Y": np.array([[0.5, 2.0]], "f4")}, {})])
    ratios = texture_maps.decode_ratio(texels / 255)
    found = scene(f"light,{tmp_path}")
    assert found.melanin == pytest.approx((0.0195 * ratios.min(), 0.0195 * ratios.max()))
    assert found.hemoglobin == pytest.approx((0.0044, 0.0176))
    assert found.eumelanin == (0.7, 0.7)
    one = scene(f"melanin=0.02:0.4,{tmp_path / 'melanin.png'}")
    assert one.melanin == pytest.approx((0.02 * ratios.min(), MELANIN[1]))
    assert one.varying == ("melanin",)


def test_the_tolerance_of_profiles_goes_with_that_of_colors():
    assert scene(tolerance=1.0).ee_tolerance == 0.05
    assert scene(tolerance=0.02).ee_tolerance == 0.002
    assert scene(tolerance=1.0, ee_tolerance=0.3).ee_tolerance == 0.3


def test_a_panel_fills_the_scene_as_random_skins_do():
    wanted = scene("melanin=0.01:0.1,hemoglobin=0.005,eumelanin=0.2:0.6")
    melanin, eumelanin, hemoglobin = needs.panel(wanted, 512)
    assert np.quantile(np.log(melanin), [0.25, 0.5, 0.75]) == pytest.approx(
        np.log(0.01) + np.log(10) * np.array([0.25, 0.5, 0.75]), abs=0.02
    )
    assert np.quantile(eumelanin, [0.25, 0.5, 0.75]) == pytest.approx([0.3, 0.4, 0.5], abs=0.01)
    assert hemoglobin == pytest.approx(0.005)


def test_a_profile_counts_from_the_own_disc_of_a_pixel():
    assert scene(mm_per_pixel=1.0).from_mm == pytest.approx(0.56)
    assert scene(mm_per_pixel=0.001).from_mm == 0.01


@pytest.mark.parametrize(
    ("tones", "vary", "limits", "said"),
    [
        ("pale", None, {}, "tones = 'pale': allowed is all, very-light"),
        ("", None, {}, "tones = '': give all, presets"),
        ("melanin=0.1:0.05", None, {}, "melanin = 0.1:0.05: low is above high; swap them"),
        ("melanin=0.1:2", None, {}, "melanin = 2: allowed is 0.001 to 0.5"),
        ("melanin=dark", None, {}, "tones: melanin = 'dark': VALUE or LOW:HIGH is needed"),
        ("melanin=0.1:", None, {}, "tones: melanin = '0.1:': VALUE or LOW:HIGH is needed"),
        ("melanin=nan", None, {}, "melanin = nan: allowed is 0.001 to 0.5"),
        ("bilirubin=1", None, {}, "tones = 'bilirubin': allowed is melanin, eumelanin, hemoglobin, oxygenation"),
        ("light,dark", "melanin", {}, "vary = melanin: the tones hold hemoglobin from 0.0088 to 0.018; add hemoglobin"),
        ("light", "freckles", {}, "vary = 'freckles': allowed is melanin"),
        ("light", None, {"tolerance": 0.0}, "tolerance = 0: allowed is 0.02 to 20 ΔE00"),
        ("light", None, {"tolerance": -1.0}, "tolerance = -1: allowed"),
        ("light", None, {"tolerance": float("nan")}, "tolerance = nan: allowed"),
        ("light", None, {"tolerance": float("inf")}, "tolerance = inf: allowed"),
        ("light", None, {"ee_tolerance": 0.0}, "ee_tolerance = 0: allowed is 0.001 to 0.5"),
        ("light", None, {"mm_per_pixel": 0.0}, "mm_per_pixel = 0: allowed is 0.001 to 1000"),
        ("light", None, {"bytes": 0}, "bytes = 0: allowed is a whole number 1 to"),
        ("light", None, {"seconds": -1.0}, "seconds = -1: allowed is 0 to"),
        ("light", None, {"seconds": float("nan")}, "seconds = nan: allowed is 0 to"),
    ],
)
def test_what_is_wrong_is_said_in_a_line(tones, vary, limits, said):
    with pytest.raises(InputError) as error:
        scene(tones, vary, **limits)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_a_wrong_map_is_said_in_a_line(tmp_path):
    with pytest.raises(InputError, match="no map of melanin, eumelanin, hemoglobin there"):
        scene(f"light,{tmp_path}")
    Image.fromarray(np.zeros((2, 2), "u1")).save(tmp_path / "skin.png")
    with pytest.raises(InputError, match="no map of melanin, eumelanin, hemoglobin there"):
        scene(f"light,{tmp_path / 'skin.png'}")
    (tmp_path / "melanin.png").write_text("no picture")
    with pytest.raises(InputError, match="not a picture that can be read"):
        scene(f"light,{tmp_path}")
    exr.write(tmp_path / "hemoglobin.exr", [exr.Part("map", {"Y": np.array([[-0.5, 2.0]], "f4")}, {})])
    (tmp_path / "melanin.png").unlink()
    with pytest.raises(InputError, match="holds no ratios of 0 or more"):
        scene(f"light,{tmp_path}")


def test_ranges_are_pairs():
    with pytest.raises(InputError, match="a pair of low and high is needed"):
        Needs(melanin=0.1)  # type: ignore[arg-type]
