"""Guards and exact laws that statistical tests are too wide to see; each answers a mutation that survived."""

import os

import numpy as np
import pytest

import lutgen
from lutgen import color
from lutgen import device as ocl
from lutgen.charts.stability.probing import evaluate
from lutgen.skin.tissue import Layer
from lutgen.solvers import adding_doubling, path_table
from lutgen.tables import expand, storage


# test_path_table.py
def test_tabulate_sums_every_record_once_in_its_ring_to_the_unit():
    """A made-up bank of two wavelengths, 5 and 2 blocks: weights of a few units, radii on the edges and between."""
    device = ocl.choose()
    rings, slices, blocks, size = 4, 3, (5, 2), path_table.block_photons(device)
    edges = np.array([0.0, 1.0, 2.0, 4.0, 8.0], "f4")
    rng = np.random.default_rng(2)
    bank = np.zeros((sum(blocks), size, 3), "f4")
    bank[..., 0] = rng.choice(np.array([0.0, 0.5, 1.0, 1.5, 2.0, 3.9, 4.0, 7.0, 9.0], "f4"), bank.shape[:2])
    units = rng.integers(0, 8, bank.shape[:2]) + rng.choice([0.25, 0.75], bank.shape[:2])  # to be rounded
    bank[..., 1] = -np.log(units * 2.0**-30)  # whole path; none of it in the epidermis
    results = np.zeros(sum(blocks), path_table.RESULT)
    results["escaped"] = rng.integers(1, size, sum(blocks))
    nodes = np.concatenate([np.zeros((2, path_table.NODES_E)), np.ones((2, path_table.NODES_D))], axis=1).astype("f4")
    sums = np.zeros((2, slices, rings, path_table.NODES_E, path_table.NODES_D), "i8")
    out = ocl.buffer(device, sums)
    inputs = [ocl.buffer(device, v) for v in (bank, results, np.array([0, 5, 7], "u4"), nodes, edges)]
    ocl.launch(device, path_table.tabulate_kernel(device, rings, slices), (2 * slices, 1), *inputs, out)
    found = ocl.read(device, out, sums).sum(axis=1)
    expected = np.zeros((2, rings))
    for block, (rows, unit) in enumerate(zip(bank, units, strict=True)):
        ring = np.clip(np.searchsorted(edges, rows[:, 0], side="right") - 1, 0, rings - 1)
        kept = slice(0, results["escaped"][block])
        expected[int(block >= 5)] += np.bincount(ring[kept], np.rint(unit[kept]), rings)
    assert np.array_equal(found, np.broadcast_to(expected[..., None, None], found.shape))


# test_failure_modes.py (import re)
def test_a_horizontal_direction_gives_finite_numbers():
    """uz = 0 exactly comes once in some 1e8 steps: there the walk's own function."""
    found = evaluate(
        "slope_t slope = slope_of(a); out[0] = slope.per_depth * 0.0f; out[1] = slope.inverse;",
        np.array([0.0, -0.0, 1e-30, -1e-12] * 4), outputs=2,
    )  # fmt: skip
    assert np.array_equal(found[0], np.zeros(16))
    assert found[1] == pytest.approx(np.ones(16), abs=1e-6)


# test_path_table.py
def test_structs_of_another_layout_are_refused(monkeypatch):
    import pyopencl.tools

    match = pyopencl.tools.match_dtype_to_c_struct

    def pads(device, name, dtype):
        return np.dtype([*((field, dtype[field]) for field in dtype.names), ("padding", "u4")]), match(
            device, name, dtype
        )[1]

    monkeypatch.setattr(pyopencl.tools, "match_dtype_to_c_struct", pads)
    structs = (("odd_t", np.dtype([("a", "f4"), ("b", "f4")])),)  # a name of its own: declarations are cached
    with pytest.raises(lutgen.MachineError, match="another layout"):
        ocl.struct_source(ocl.choose(), structs)


# test_adding_doubling.py
def test_an_absorbing_slab_obeys_beer_and_lambert_in_every_direction():
    """Nearly one mean free path at grazing, where the thin slab's series would show."""
    cosine, weight = adding_doubling.directions([1.0, 1.4])
    thickness = 0.9 * float(cosine.min())
    R, T = adding_doubling.layer_matrices(thickness, np.array(1.0), np.array(0.0), np.array(0.0), cosine, weight)
    assert np.abs(R).max() < 1e-14
    assert np.diag(T) == pytest.approx(np.exp(-thickness / cosine), rel=1e-10)


def test_moments_kept_are_the_best_for_forward_scattering():
    """g = .9 at 16 nodes against 64: 6e-7 with 1.5 moments per direction, 9e-6 with 1, 5e-5 with 2."""
    layers = [Layer(np.inf, 0.5, 100, 0.9, 1.4)]
    assert abs(diffuse(layers) - diffuse(layers, nodes=64)) < 2e-6


def diffuse(layers, **options):  # test_adding_doubling.py has it
    return adding_doubling.stack(layers, **options)[0]


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
    for variance, found in ((total, draft.color_std_error(*skin)), (rings, draft.profile(*skin).std_error)):
        expected = np.sqrt(sum(v[:, None] * w**2 for v, w in zip(variance, weights, strict=True)))
        assert found == pytest.approx(expected, rel=1e-12)


# On what reaches the kernel, not on `_sync` (a `_sync` that does nothing passes today's test)
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
