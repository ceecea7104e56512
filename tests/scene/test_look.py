"""Looks and cameras: values named when wrong, files that come back as they were, matrices that see the head."""

from dataclasses import asdict

import numpy as np
import pytest

import lutgen
from lutgen.scene import look as looks
from lutgen.scene.look import Look


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"melanin": float("nan")}, "melanin = nan: allowed is 0.001 to 0.5"),
        ({"hemoglobin": 0.5}, "hemoglobin = 0.5"),
        ({"tier": "ultra"}, "tier = 'ultra': allowed is off, low, medium, high, reference"),
        ({"split": "both"}, "split = 'both'"),
        ({"target_mm": (0, 1)}, "target_mm"),
        ({"melanin": "much"}, "melanin = 'much': a number is needed"),
        ({"skin": 1}, "skin: a look has no such value; it has melanin"),
    ],
)
def test_a_wrong_value_is_named(values, message):
    with pytest.raises(lutgen.InputError, match=message):
        looks.changed(Look(), values)


def test_a_look_comes_back_from_its_file(tmp_path):
    look = looks.changed(looks.of_preset("tan"), {"target_mm": "1,2,3", "azimuth": "-30", "tier": "high"})
    looks.save(look, tmp_path / "look.toml")
    assert looks.load(tmp_path / "look.toml") == look


@pytest.mark.parametrize(
    ("text", "message"),
    [("melanin = nan", "melanin = nan"), ("melanin", "not TOML"), ("color = 3", "color: a look has no such value")],
)
def test_a_wrong_file_is_named(tmp_path, text, message):
    path = tmp_path / "look.toml"
    path.write_text(text)
    with pytest.raises(lutgen.InputError, match=f"look.toml.*{message}"):
        looks.load(path)
    with pytest.raises(lutgen.InputError, match="cannot be read"):
        looks.load(tmp_path / "none.toml")


def test_every_preset_has_a_look():
    sheet = looks.sheet_looks(Look(exposure=1.0))
    assert list(sheet) == list(lutgen.PRESETS)
    for name, look in sheet.items():
        assert look.melanin == lutgen.preset(name).melanin
        assert look.exposure == 1.0


@pytest.mark.parametrize(("azimuth", "elevation"), [(0, 0), (90, 0), (-120, 40), (10, 89)])
def test_the_camera_looks_at_its_target_from_its_distance(azimuth, elevation):
    look = looks.changed(Look(), {"azimuth": azimuth, "elevation": elevation, "target_mm": (5, -7, 9)})
    camera = looks.camera(look, 640, 360)
    clip = camera.projection @ camera.view @ [5, -7, 9, 1]
    assert clip[:2] / clip[3] == pytest.approx([0, 0], abs=1e-9)
    assert clip[3] == pytest.approx(look.distance_mm)
    assert np.linalg.norm(camera.eye_mm - [5, -7, 9]) == pytest.approx(look.distance_mm)
    assert np.linalg.det(camera.view[:3, :3]) == pytest.approx(1)


def test_a_millimetre_is_as_many_pixels_as_the_focal_length_says():
    look = Look()
    camera = looks.camera(look, 640, 360)
    middle, aside = (camera.projection @ camera.view @ [*(x * camera.view[0, :3]), 1] for x in (0.0, 1.0))
    pixels = (aside[0] / aside[3] - middle[0] / middle[3]) * 640 / 2
    assert pixels == pytest.approx(camera.focal_pixels / look.distance_mm, rel=1e-6)


def test_directions():
    assert looks.direction(0, 0) == pytest.approx([0, 0, 1])
    assert looks.direction(90, 0) == pytest.approx([1, 0, 0])
    assert looks.direction(33, 90) == pytest.approx([0, 1, 0])
    assert set(asdict(Look())) >= set(looks.RANGES)
