"""Values per preset: the engines' own formulas give our radius and albedo back, and pre-integration obeys its laws."""

import importlib

import numpy as np
import pytest

from lutgen.exports import openpbr, preintegrated
from lutgen.files import exr
from lutgen.solvers import burley

MaterialX = importlib.import_module("MaterialX")


def test_materialx_validates_the_document(tmp_path, source):
    openpbr.write(source, tmp_path)
    document = MaterialX.createDocument()
    MaterialX.readFromXmlFile(document, str(tmp_path / "skin.mtlx"))
    valid, message = document.validate()
    assert valid, message
    surfaces = document.getNodes("open_pbr_surface")
    assert len(surfaces) == len(document.getMaterialNodes()) == len(source.presets)
    for surface, preset in zip(surfaces, source.presets, strict=True):
        radius, scale = (np.atleast_1d(np.array(_tuple(surface.getInputValue(f"subsurface_radius{end}"))))
                         for end in ("", "_scale"))  # fmt: skip
        assert 10 * radius * scale == pytest.approx(openpbr.mean_free_path_mm(preset), rel=1e-6)


def _tuple(value):
    return value if isinstance(value, float) else value.asTuple()


def test_openpbrs_medium_has_our_albedo(source):
    """Albedo of a semi-infinite medium of isotropic events by van de Hulst's fit, which the inversion inverts."""
    for preset in source.presets:
        color = openpbr.subsurface_color(preset)
        s = np.sqrt(1 - openpbr.single_scattering_albedo(color))
        assert (1 - s) * (1 - 0.139 * s) / (1 + 1.17 * s) == pytest.approx(color, abs=1e-3)
        assert color * 0.9722222 == pytest.approx(np.clip(preset.linear_srgb, 0, 1), abs=1e-6)


def test_openpbrs_mean_free_path_gives_our_radius(source):
    """Christensen & Burley's own direction: d = mean free path / s(A)."""
    for preset in source.presets:
        A = openpbr.subsurface_color(preset)
        d = openpbr.mean_free_path_mm(preset) / (1.85 - A + 7 * np.abs(A - 0.8) ** 3)
        half = [
            np.interp(0.5, burley.encircled(np.geomspace(1e-4, 50, 4000), v), np.geomspace(1e-4, 50, 4000)) for v in d
        ]
        assert half == pytest.approx(1.55 * preset.burley_d_mm, rel=5e-3)


def test_a_sphere_keeps_the_light_that_falls_on_it(source):
    """Scattering moves light and makes none: over the sphere the mean of the shade is that of max(0, N.L), 1/4."""
    x, w = np.polynomial.legendre.leggauss(200)
    for preset in source.presets:
        for curvature in (0.01, 0.1, 0.25):
            shade = preintegrated.shaded(preset.rings, preset.edges_mm, x, np.array(curvature))
            assert w @ shade / 2 == pytest.approx(np.full(3, 0.25), abs=2e-4)


def test_a_plane_is_lambert_and_narrow_profiles_stay_sharp(source):
    preset = source.presets[0]
    n_dot_l = np.linspace(-1, 1, 101)
    flat = preintegrated.shaded(preset.rings, preset.edges_mm, n_dot_l, np.array(0.0))
    assert flat == pytest.approx(np.repeat(np.maximum(n_dot_l, 0)[:, None], 3, axis=1), abs=1e-9)
    round_ = preintegrated.shaded(preset.rings, preset.edges_mm, np.array(-0.1), np.array(0.2))
    assert round_[0] > round_[1] > round_[2] > 0  # red goes farthest around the edge
    assert np.all(np.diff(preintegrated.shaded(preset.rings, preset.edges_mm, n_dot_l, np.array(0.2)), axis=0) >= -1e-9)


def test_shade_against_points_strewn_on_a_sphere(source):
    """Brute force: a million points of a sphere, the profile looked up by chord."""
    preset, curvature = source.presets[1], 0.15
    i = np.arange(1_000_000) + 0.5
    z, turn = 1 - 2 * i / len(i), i * 2.399963229728653
    points = np.stack([np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z], axis=1)
    edges = preset.edges_mm
    density = preset.rings / (np.pi * np.diff(edges**2))[:, None]
    for angle in (0.6, 1.5, 1.9):
        here = np.array([np.sin(angle), 0, np.cos(angle)])
        chord = np.linalg.norm(points - here, axis=1) / curvature
        far = chord > 0.2  # nearer, points are too few: the exact share goes to the place itself
        ring = np.clip(np.searchsorted(edges, chord[far]) - 1, 0, len(edges) - 2)
        area = 4 * np.pi / curvature**2 / len(i)
        lit = np.maximum(points[far, 2], 0)
        near = np.array([np.interp(0.2, edges, np.concatenate([[0], np.cumsum(preset.rings[:, c])])) for c in range(3)])
        total = near + density[ring].sum(axis=0) * area
        brute = (near * max(here[2], 0) + (density[ring] * lit[:, None]).sum(axis=0) * area) / total
        shade = preintegrated.shaded(preset.rings, edges, np.array(here[2]), np.array(curvature))
        assert shade == pytest.approx(brute, abs=4e-3)


def test_transmission_falls_with_thickness_and_is_all_at_none(source):
    for preset in source.presets:
        thin = preintegrated.through(preset.rings, preset.edges_mm, np.linspace(0, 32, 200))
        assert thin[0] == pytest.approx([1, 1, 1])
        assert np.all(np.diff(thin, axis=0) <= 1e-12)
        assert thin[-1].max() < 0.01
        assert np.all(thin[3, 0] > thin[3, 1:])


def test_tables_are_written_as_stated(tmp_path, source):
    report = preintegrated.write(source, tmp_path)
    preset = source.presets[0]
    table = next(iter(exr.read(tmp_path / f"shade_{preset.name}.exr").values())).stack("RGB")
    assert table.shape == (64, 128, 3)
    assert table.dtype == np.float16
    assert table[0] == pytest.approx(np.repeat(np.maximum(np.linspace(-1, 1, 128), 0)[:, None], 3, axis=1), abs=1e-3)
    assert 0 < report.error[preset.name]["shade"]["largest"] < 0.01
