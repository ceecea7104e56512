"""The tile of pores: without a seam, flat on the whole, and as deep over the face as skin is there."""

import numpy as np
import pytest

from lutgen.head import complexion, hair, pores


@pytest.mark.parametrize("axis", [0, 1])
def test_the_tile_repeats_without_a_seam(axis):
    """From one line of texels to the next, the last and the first too, no net, bump or pore steps as a cut would.

    Mean square of the steps against the median line's: 2.8 at most as it is, 4.8 and 13 with a cut in a net of lines.
    """
    rng = np.random.default_rng(5)
    parts = [pores._pores(rng), *(pores._lines(rng, *net) for net in pores.LINES_MM)]
    parts += [pores._bumps(rng, *bump) for bump in pores.BUMPS_MM]
    for part in parts[1:]:
        steps = ((np.roll(part, 1, axis) - part) ** 2).mean(axis=1 - axis)
        assert steps.max() < 4 * np.median(steps)
    height, _ = pores.height_mm()
    inside, across = np.abs(np.diff(height, axis=axis)), np.abs(np.take(height, 0, axis) - np.take(height, -1, axis))
    assert across.max() <= inside.max()
    assert across.mean() <= inside.mean(axis=1 - axis).max()


def test_it_is_flat_on_the_whole_and_no_deeper_than_skin():
    height, dents = pores.height_mm()
    assert abs(height.mean()) < 1e-9
    slopes = pores.texture()[..., :2]
    assert np.abs(slopes.mean(axis=(0, 1))).max() < 1e-6
    assert 0.05 < slopes.std() < 0.2
    assert -0.25 < height.min() < height.max() < 0.15
    assert dents.max() <= 0
    wide = (dents < -0.5 * pores.PORE_DEPTH_MM[0]).mean() * pores.SIDE_MM**2  # mm^2 of pores
    count = round(pores.SIDE_MM / pores.PORE_APART_MM) ** 2
    assert 0.2 < np.sqrt(4 / np.pi * wide / count) < 0.6  # mm across, a mean pore


@pytest.mark.parametrize("channel", [0, 1])
def test_slopes_are_those_of_the_height(channel):
    height, _ = pores.height_mm()
    slope = pores.texture()[..., channel].astype(float)
    axis = 1 - channel
    step = pores.SIDE_MM / pores.TEXELS
    two = (np.roll(height, -2, axis) - height) / (2 * step)
    assert np.abs(np.roll(slope, -1, axis) - two).max() < 1e-6


def test_what_smaller_pictures_lose_of_the_slopes_they_hold_as_variance():
    """Mean square minus square of the mean: 0 for a texel, more for every coarser one, all of it in the end."""
    level, before = pores.texture().astype(float), -1e-6
    whole = level[..., 2].mean()
    for _ in range(9):
        variance = (level[..., 2] - (level[..., :2] ** 2).sum(axis=-1)).mean()
        assert variance >= before
        before = variance
        level = level.reshape(level.shape[0] // 2, 2, level.shape[1] // 2, 2, 4).mean(axis=(1, 3))
    assert level[..., 2].mean() - (level[..., :2] ** 2).sum() == pytest.approx(whole, rel=1e-3)


def test_pores_are_deep_on_the_nose_and_faint_on_lids_and_lips():
    places = np.array([[0, -36, 108], [22, -32, 84], [31, -3, 77], [0, -62, 92], [0, 50, -100]], float)
    nose, cheek, lid, lips, back = complexion.porous(places, np.array([0.0, 0, 0, 1, 0]))
    assert min(nose, cheek) > 1.5 * max(lid, lips, back)
    assert 0 <= min(nose, cheek, lid, lips, back) <= max(nose, cheek, lid, lips, back) <= 1


def patch(x: tuple[float, float], y: tuple[float, float], z: float = 85.0, step: float = 0.08) -> np.ndarray:
    """Places on a plane that faces the camera."""
    across, up = np.meshgrid(np.arange(x[0], x[1], step), np.arange(y[0], y[1], step))
    return np.stack([across, up, np.full_like(across, z)], axis=-1)


def test_freckles_are_round():
    """As far along one axis as along the other the dots resemble themselves."""
    freckles = complexion._freckles(patch((0, 60), (-40, 20)), np.ones(())).astype(float)
    assert 0.01 < (freckles > 0.1).mean() < 0.3
    alike = [np.mean(freckles * np.roll(freckles, round(0.4 / 0.08), axis)) for axis in (0, 1)]
    assert alike[0] == pytest.approx(alike[1], rel=0.1)
    assert alike[0] < 0.8 * np.mean(freckles**2)


def test_hairs_grow_on_brows_and_lids_only_and_not_the_same_on_both_sides():
    brow, cheek = hair.cover(patch((14, 34), (17, 23))), hair.cover(patch((14, 34), (-45, -25)))
    assert 0.2 < brow.mean() < 0.8
    assert brow.std() > 0.1  # single hairs
    assert cheek.max() == 0
    other = hair.cover(patch((14, 34), (17, 23)) * [-1, 1, 1])
    assert other.mean() == pytest.approx(brow.mean(), rel=0.3)
    assert np.abs(other - brow).mean() > 0.05
    below = hair.cover(patch((22, 44), (-14, -9)))
    assert below.max() > 0.4
    assert hair.cover(patch((14, 34), (17, 23), z=0.0)).max() == 0  # nothing behind the face
