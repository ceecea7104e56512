"""Inverting an albedo: what the LUT colors is found again, white balance is mended, noise does not blotch dark skin."""

import numpy as np
import pytest

import lutgen
from lutgen import color
from lutgen.files import texture_maps
from lutgen.files.texture_maps import Maps
from lutgen.fitting import albedo_to_skin, skin_colors
from lutgen.scene import subject

SIDE = 96


@pytest.fixture(scope="module")
def luts():
    return lutgen.load()


def between(low: float, high: float, seed: int) -> np.ndarray:
    """Random values of broad and fine variation, evenly spread in logarithm."""
    rng = np.random.default_rng(seed)
    return low * (high / low) ** (
        0.7 * texture_maps.resized(rng.random((9, 9)), SIDE, SIDE) + 0.3 * rng.random((SIDE, SIDE))
    )


@pytest.mark.parametrize("eumelanin", [0.2, 0.7])
@pytest.mark.parametrize("melanin", [(0.003, 0.05), (0.02, 0.15), (0.1, 0.3)])
def test_pigment_and_blood_come_back(luts, melanin, eumelanin):
    """Within 5 % for 95 % of texels, at most half a color difference left; measured .3 %, 1.7 % and .10 at worst."""
    m, h = between(melanin[0], melanin[1], 1), between(0.003, 0.05, 2)
    inversion = albedo_to_skin.invert(luts, luts.color(m, eumelanin, h), eumelanin=eumelanin)
    assert np.quantile(np.abs(inversion.melanin / m - 1), 0.95) < 0.05
    assert np.quantile(np.abs(inversion.hemoglobin / h - 1), 0.95) < 0.05
    assert inversion.residual.max() < 0.5
    assert np.all(inversion.gain == 1)
    assert inversion.skin == pytest.approx((np.median(m), eumelanin, np.median(h)), rel=0.02)


def lab(linear):
    return color.lab(linear @ np.linalg.inv(color.SRGB_FROM_XYZ).T)


@pytest.mark.parametrize("melanin", [(0.002, 0.06), (0.03, 0.2), (0.1, 0.45)])
@pytest.mark.parametrize("seed", [11, 12, 13])
def test_all_of_the_lut_comes_back_as_far_as_color_tells(luts, melanin, seed):
    """Blood over its whole axis. Color tells where 5 % more of either changes it by .1 (half of what the LUT is right
    to, p95 .19 from adding-doubling) and by more than 8 bits do, where it has 8: then 95 % lie within 5 %. Measured
    without bits: melanin .6 %, blood 4.2 % on the darkest and 1.3 % elsewhere. Through 8 bits no blood is told so well,
    but none is lost: its median stays."""
    m, h = between(melanin[0], melanin[1], seed), between(0.001, 0.1, seed + 40)
    exact = luts.color(m, 0.7, h)
    coded = color.decode_srgb(np.rint(255 * color.encode_srgb(exact)) / 255)
    more = [luts.color(np.minimum(1.05 * m, 0.5), 0.7, h), luts.color(m, 0.7, np.minimum(1.05 * h, 0.1))]
    shows = [color.delta_e00(lab(changed), lab(exact)) for changed in more]
    for albedo in (exact, coded):
        lost = color.delta_e00(lab(albedo), lab(exact))
        told = max(0.1, float(np.quantile(lost, 0.95)))
        inversion = albedo_to_skin.invert(luts, albedo, eumelanin=0.7, gain=(1, 1, 1))
        assert inversion.residual.max() <= max(0.5, lost.max())
        for values, truth, seen in ((inversion.melanin, m, shows[0]), (inversion.hemoglobin, h, shows[1])):
            wrong = np.abs(values / truth - 1)[seen > told]
            assert not wrong.size or np.quantile(wrong, 0.95) < 0.05
        assert np.median(inversion.hemoglobin / h) == pytest.approx(1, abs=0.05)
        assert np.mean(shows[0] > told) > (0.1 if albedo is exact else 0)
    assert np.mean(shows[1] > 0.1) > 0.1


def test_differences_weighed_as_ciede2000_does(luts):
    """Small ones about skin, within 3 %."""
    rng = np.random.default_rng(8)
    skins = luts.color(0.002 * 200 ** rng.random(500), 0.7, 0.002 * 40 ** rng.random(500))
    colors = skin_colors.coded(skins)
    step = 0.3 * rng.standard_normal(colors.shape).astype("f4")
    offset = np.array([16, 0, 0])
    size = np.linalg.norm(skin_colors.seen(skin_colors.metric(colors + step / 2), step), axis=0)
    assert size == pytest.approx(color.delta_e00(colors.T - offset, (colors + step).T - offset), rel=0.03, abs=2e-3)


def test_positions_and_values_are_inverse(luts):
    grid = luts.color_lut.grid
    for axis in grid.axes[::-1]:
        at = np.linspace(0, axis.count - 1, 50)
        assert axis.position(axis.value(at)) == pytest.approx(at, abs=1e-6)


def test_the_kind_of_melanin_is_found(luts):
    m, h = between(0.02, 0.1, 1), between(0.003, 0.05, 2)
    for e in (0.0, luts.color_lut.grid.eumelanin.values[4], 1.0):
        inversion = albedo_to_skin.invert(luts, luts.color(m, e, h))
        assert inversion.eumelanin == pytest.approx(e)
        assert np.median(inversion.residual) < 0.1


def test_colors_off_the_gamut_are_told_and_met_as_nearly_as_can_be(luts):
    """The residual is CIEDE2000's from the color that the maps would give; hardly any skin is nearer."""
    rng = np.random.default_rng(3)
    albedo = luts.color(0.02, 0.7, 0.01) * (0.8 + 0.4 * rng.random((8, 8, 3)))
    inversion = albedo_to_skin.invert(luts, albedo, eumelanin=0.7, gain=(1, 1, 1))
    to_xyz = np.linalg.inv(color.SRGB_FROM_XYZ).T
    painted, shown = (color.lab(c @ to_xyz) for c in (albedo, luts.color(inversion.melanin, 0.7, inversion.hemoglobin)))
    assert inversion.residual == pytest.approx(color.delta_e00(shown, painted), abs=0.02)
    m, h = (a.values for a in (luts.color_lut.grid.melanin, luts.color_lut.grid.hemoglobin))
    nodes = color.lab(luts.color(m, 0.7, h[:, None]) @ to_xyz).reshape(-1, 1, 1, 3)
    assert np.all(inversion.residual <= color.delta_e00(nodes, painted).min(axis=0) + 0.1)


def test_a_tint_is_balanced_away_and_stated(luts):
    """As far as it is no tint that skin can have: redder light is like more blood."""
    m, h = between(0.015, 0.03, 1), between(0.008, 0.015, 2)
    plain = luts.color(m, 0.7, h)
    tint = np.array([0.8, 1.0, 1.35])
    inversion = albedo_to_skin.invert(luts, plain * tint, eumelanin=0.7)
    assert np.median(inversion.residual) < 1.5
    assert 1.2 < inversion.gain[0] / inversion.gain[2] < 1.35 / 0.8
    left = albedo_to_skin.invert(luts, plain * tint, eumelanin=0.7, gain=(1, 1, 1))
    assert np.median(left.residual) > 5


def test_noise_does_not_blotch_dark_skin(luts, monkeypatch):
    """Where color says little about blood, texels are held to their surroundings; on light skin they are free."""
    rng = np.random.default_rng(5)
    noise = 1 + 0.02 * rng.standard_normal((SIDE, SIDE, 3))

    def spread(melanin: float) -> float:
        albedo = luts.color(np.full((SIDE, SIDE), melanin), 0.7, 0.01) * noise
        return float(np.std(np.log(albedo_to_skin.invert(luts, albedo, eumelanin=0.7).hemoglobin)))

    light, dark = spread(0.02), spread(0.4)
    monkeypatch.setattr(skin_colors, "_HOLD", 0.0)
    assert spread(0.02) == pytest.approx(light, rel=0.1)
    assert dark < 0.6 * spread(0.4)


def test_ratios_have_median_1_keep_detail_and_little_of_the_low_frequencies(luts):
    m = np.full((SIDE, SIDE), 0.03)
    m[:, SIDE // 2 :] *= 1.5  # baked light
    m[40:44, 10:14] *= 3.0  # a mole
    albedo = luts.color(m, 0.7, 0.01)
    albedo[:8] = 0  # background
    inversion = albedo_to_skin.invert(luts, albedo, eumelanin=0.7)
    ratios = albedo_to_skin.ratios(inversion)
    assert ratios.shape == (SIDE, SIDE, 3)
    assert np.all(ratios[:8] == 1)
    assert np.all(ratios[..., 1] == 1)
    inside = ratios[8:]
    assert np.median(inside[..., 0]) == pytest.approx(1, abs=0.02)
    step = np.median(ratios[60:, 60:, 0]) / np.median(ratios[60:, :30, 0])
    assert step == pytest.approx(1.5 ** albedo_to_skin.LOW_KEPT[0], rel=0.05)
    assert ratios[42, 12, 0] / np.median(ratios[60:, :30, 0]) > 1.6
    whole = albedo_to_skin.ratios(inversion, (1.0, 1.0))
    assert np.median(whole[60:, 60:, 0]) / np.median(whole[60:, :30, 0]) == pytest.approx(1.5, rel=0.01)


@pytest.mark.parametrize(
    ("albedo", "message"),
    [
        (np.zeros((4, 4, 3)), "black throughout"),
        (np.full((4, 4, 3), np.nan), "NaN"),
        (np.full((4, 4, 3), -1.0), "negative"),
        (np.ones((4, 4)), r"has shape \(4, 4\)"),
        ("paint", "a number or an array"),
    ],
)
def test_what_is_no_albedo_is_one_line(luts, albedo, message):
    with pytest.raises(lutgen.InputError, match=message):
        albedo_to_skin.invert(luts, albedo)
    with pytest.raises(lutgen.InputError, match="eumelanin = 2"):
        albedo_to_skin.invert(luts, np.ones((2, 2, 3)), eumelanin=2)


def test_a_head_takes_inverted_maps_and_keeps_given_ones(luts):
    m = between(0.02, 0.1, 1)
    albedo = luts.color(m, 0.7, 0.01)
    painted = np.ones((4, 4, 3))
    painted[..., 2] = 2.5
    maps, notes = subject.inverted(luts, Maps(chromophores=painted, albedo=albedo), 0.7)
    assert maps.albedo is None
    assert maps.chromophores is not None
    assert np.all(maps.chromophores[..., 2] == 2.5)
    assert np.corrcoef(np.log(maps.chromophores[..., 0]).ravel(), np.log(m).ravel())[0, 1] > 0.6
    assert "albedo inverted: median melanin 0.04" in notes[0]
    assert maps.full_contrast_melanin == pytest.approx(np.median(m), rel=0.02)
    kept, notes = subject.inverted(luts, Maps(), 0.7)
    assert kept == Maps()
    assert "no albedo to invert" in notes[0]
