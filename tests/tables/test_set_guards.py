"""Guards of LUT sets that statistical tests are too wide to see: precision of files, gamut, pipelines, variances."""

import os

import numpy as np
import pytest

import lutgen
from lutgen import color
from lutgen.tables import expand, storage


def test_profile_tails_are_stored_as_floats(draft, draft_dir):
    """Half floats go subnormal below 6e-5: files keep floats, and far rings keep their relative accuracy."""
    shape = draft.profile_lut.shape
    tail = (shape > 1e-30) & (shape < 6e-5)
    assert tail.sum() > 100
    assert np.abs(storage.load(draft_dir).profile_lut.shape[tail] / shape[tail] - 1).max() < 1e-6


def test_out_of_gamut_light_is_clamped_in_acescg_and_its_share_stored():
    """Far rings are nearly pure red: negative in sRGB, never negative in a LUT."""
    luts = lutgen.load()
    assert (luts.profile_lut.shape >= 0).all()
    dark = luts.profile(0.158, 0.7, 0.05)
    assert color.from_acescg(dark.energy, "srgb").min() < 0
    energy = np.array([[[1.0, 0.5, -0.004], [0.0, 0.5, 0.404]]])
    shape, share = expand.normalized(energy)
    assert shape.min() == 0
    assert shape.sum(axis=1) == pytest.approx(np.ones((1, 3)))
    assert share[0].tolist() == pytest.approx([0, 0, 0.004 / 0.404])


def test_a_set_of_the_source_pipeline_answers_in_it():
    """sRGB by the document's four-digit matrix, for colors, profiles and recoloring alike."""
    skin = (0.02, 0.7, 0.01)
    luts = lutgen.bake({"photons": 65_536, "pipeline": "source", "totals": "anchored"})
    expected = color.from_xyz(luts.color(*skin, space="xyz"), "srgb", "source")
    assert luts.color(*skin) == pytest.approx(expected, abs=1e-12)
    assert luts.profile(*skin, space="srgb").total == pytest.approx(expected, abs=1e-12)
    assert np.abs(expected - color.from_xyz(luts.color(*skin, space="xyz"), "srgb")).max() > 1e-5
    assert np.abs(expected - lutgen.linear_srgb(lutgen.Skin(*skin), pipeline="source")).max() < 0.005


def test_variances_add_with_squared_weights(draft):
    """Wavelengths are independent. Exact, where a scatter of 24 bakes allows 58 %."""
    skin = (0.05, 0.7, 0.01)
    mu = expand.coefficients(draft.paths.wavelength_nm, draft.absorbers, *(np.array([v]) for v in skin))
    total, rings = (table.std_error(*mu)[:, :, 0] ** 2 for table in (draft.totals, draft.paths))
    weights = draft.weights
    for variance, std_error in ((total, draft.color_std_error(*skin)), (rings, draft.profile(*skin).std_error)):
        expected = np.sqrt(sum(v[:, None] * w**2 for v, w in zip(variance, weights, strict=True)))
        assert std_error == pytest.approx(expected, rel=1e-12)


def test_files_and_folders_are_synced_by_the_system(draft, tmp_path, monkeypatch):
    synced, fsync = [], os.fsync

    def record(handle):
        synced.append(os.path.basename(os.readlink(f"/proc/self/fd/{handle}")))
        fsync(handle)

    monkeypatch.setattr(os, "fsync", record)
    storage.save(draft, tmp_path / "set")
    assert {*storage.FILES, "manifest.json"} <= set(synced)
    assert synced[-2].startswith(".set.partial-")
    assert synced[-1] == tmp_path.name
