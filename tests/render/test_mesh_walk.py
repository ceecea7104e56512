"""Walks over a queue against each other, the path table and adding-doubling; and what every closed surface obeys."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
import trimesh

import lutgen
from lutgen import device as ocl
from lutgen.render import distance, goal, mesh_walk, sample_queue
from lutgen.skin.tissue import Layer, Skin
from lutgen.solvers import adding_doubling, path_table
from lutgen.solvers.path_table import Medium
from lutgen.tables import bake, expand

Rate = float | np.ndarray
Place = np.ndarray | tuple[float, float, float]
N = 2**20
MU_S, G, INDEX, EPIDERMIS = 22.0, 0.78, 1.4, 0.1
EDGES = np.concatenate([[0], np.geomspace(0.01, 8, 15), [np.inf]])
ABSORBING = (2.0, 0.2)  # epidermis and dermis, 1/mm


def medium(nu: float = 0.2) -> Medium:
    one = [np.array([v]) for v in (550.0, MU_S, G, nu)]
    return Medium(one[0], one[1], one[2], one[3], EPIDERMIS, INDEX)


def entries(
    count: int, position: Place = (0, 0, 0), normal: Place = (0, 0, 1), cosine: Rate = 1.0, seed: int = 0
) -> np.ndarray:
    """Entries [count] under a surface, the direction at that cosine inside and a random azimuth."""
    made = np.zeros(count, sample_queue.ENTRY)
    made["position"], made["normal"], made["sample"] = position, normal, np.arange(count)
    n = made["normal"].astype(float)
    across = np.cross(n, np.random.default_rng(seed).normal(size=(count, 3)))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    cosine = np.broadcast_to(np.asarray(cosine, float), count)[:, None]
    made["direction"] = across * np.sqrt(1 - cosine**2) - n * cosine
    return made


def walked(given: np.ndarray, through: Medium, depths: distance.Depths | None = None, seed: int = 1, **part):
    """Exits of entries and the tally."""
    device, tally = ocl.choose(), mesh_walk.Tally()
    K = len(through.wavelength_nm)
    whole = replace(sample_queue.Part(0, len(given) // K, 0, K), **part)
    buffers = ocl.buffer(device, given), ocl.buffer(device, np.zeros(len(given), sample_queue.EXIT))
    inside = () if depths is None else tuple(distance.buffers(device, depths))
    mesh_walk.walk(through, *buffers, whole, seed, device, tally, inside)
    return ocl.read(device, buffers[1], np.zeros(len(given), sample_queue.EXIT)), tally


def weights(exits: np.ndarray, mu_epidermis: Rate = ABSORBING[0], mu_dermis: Rate = ABSORBING[1], nu: Rate = 0.2):
    """Share of its light that each exit brings, 0 where none left."""
    le, ld = (exits[name].astype(float) for name in ("path_epidermis_mm", "path_dermis_mm"))
    return np.where(ld >= 0, np.exp(-(mu_epidermis - nu) * le - (mu_dermis - nu) * ld), 0)


@dataclass(frozen=True)
class Estimate:
    mean: np.ndarray
    sigma: np.ndarray


def estimate(weight: np.ndarray) -> Estimate:
    """Mean and standard error of weights."""
    return Estimate(weight.mean(), weight.std() / np.sqrt(len(weight)))


def by_ring(weight: np.ndarray, where: np.ndarray) -> Estimate:
    """Weights' mean per ring of EDGES."""
    sums, squares = (np.histogram(where, EDGES, weights=weight**k)[0] / len(weight) for k in (1, 2))
    return Estimate(sums, np.sqrt(np.maximum(squares - sums**2, 0) / len(weight)))


def agree(a: Estimate, b: Estimate) -> bool:
    return bool(np.all(np.abs(a.mean - b.mean) <= 4 * np.hypot(a.sigma, b.sigma) + 1e-12))


def slab(thickness_mm: float, side_mm: float = 60.0, cell_mm: float | None = None) -> distance.Depths:
    """Depths under a box whose upper face is z = 0."""
    box = trimesh.creation.box((side_mm, side_mm, thickness_mm))
    shifted = np.asarray(box.vertices) - (0, 0, thickness_mm / 2)
    return distance.of_mesh(shifted, np.asarray(box.faces), EPIDERMIS, ocl.choose(), cell_mm)


@pytest.fixture(scope="module")
def under_flat_skin():
    exits, tally = walked(entries(N), medium())
    return exits, tally


def radius(exits: np.ndarray) -> np.ndarray:
    return np.hypot(exits["position"][:, 0], exits["position"][:, 1]).astype(float)


def test_the_flat_walk_is_the_path_table(under_flat_skin):
    """Albedo and energy in every ring, both estimates' sigma counted; and the albedo is the exact one."""
    exits, tally = under_flat_skin
    assert tally.entered == N
    assert tally.unfinished == tally.lost == 0
    assert np.all(exits["position"][:, 2] == 0)
    stack = [Layer(EPIDERMIS, ABSORBING[0], MU_S, G, INDEX), Layer(np.inf, ABSORBING[1], MU_S, G, INDEX)]
    sums, squares, _ = path_table.ring_sums(stack, EDGES, N, 3)
    table = Estimate(sums / N, np.sqrt((squares / N - (sums / N) ** 2) / N))
    w = weights(exits)
    assert agree(by_ring(w, radius(exits)), table)
    exact = lutgen.reflectance(stack).diffuse / medium().entry
    assert agree(estimate(w), Estimate(np.array(exact), np.array(0.0)))


def test_a_thick_slab_by_the_walk_inside_is_flat_skin(under_flat_skin):
    """Albedo, energy in every ring, mean paths in both layers and mean cosine of the exits."""
    flat, (found, tally) = under_flat_skin[0], walked(entries(N), medium(), slab(30.0, 80.0, 0.5))
    assert tally.lost == tally.unfinished == 0
    one, other = weights(found), weights(flat)
    assert agree(estimate(one), estimate(other))
    assert agree(by_ring(one, radius(found)), by_ring(other, radius(flat)))
    for value in (lambda e: e["path_epidermis_mm"], lambda e: e["path_dermis_mm"], lambda e: e["direction"][:, 2]):
        assert agree(estimate(one * value(found)), estimate(other * value(flat)))
    left = found["path_dermis_mm"] >= 0
    assert np.abs(found["position"][left, 2]).max() < 1e-3
    assert np.abs(np.linalg.norm(found["direction"][left], axis=1) - 1).max() < 1e-5
    assert found["direction"][left, 2].min() > 0


@pytest.mark.parametrize("thickness_mm", [1.0, 3.0])
def test_slabs_with_an_epidermis_on_both_faces_are_three_layers_of_adding_doubling(thickness_mm):
    """What leaves above and below, against the exact solution of epidermis, dermis, epidermis; nothing at the sides."""
    skin = Layer(EPIDERMIS, ABSORBING[0], MU_S, G, INDEX)
    inner = Layer(thickness_mm - 2 * EPIDERMIS, ABSORBING[1], MU_S, G, INDEX)
    exact = lutgen.reflectance([skin, inner, skin])
    exits, tally = walked(entries(N), medium(), slab(thickness_mm))
    assert tally.lost == tally.unfinished == 0
    w, up = weights(exits) * medium().entry, exits["normal"][:, 2]
    assert agree(estimate(w * (up > 0.5)), Estimate(np.array(exact.diffuse), np.array(0.0)))
    assert agree(estimate(w * (up < -0.5)), Estimate(np.array(exact.transmitted), np.array(0.0)))
    assert np.all(w[np.abs(up) < 0.5] < 1e-6)


def test_a_lossless_sphere_loses_nothing_and_its_mean_path_is_that_of_its_volume():
    """Under even light from all sides the mean path is 4 n^2 V / (S T), whatever scatters inside (Blanco & Fournier
    2003; T: hemispherical transmission into the sphere): surface, epidermis and refraction all err in it."""
    R, count = 2.5, 2**18
    made = trimesh.creation.icosphere(5, R)
    depths = distance.of_mesh(np.asarray(made.vertices), np.asarray(made.faces), EPIDERMIS, ocl.choose(), 0.25)
    rng = np.random.default_rng(4)
    way = rng.normal(size=(count, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    cosines = np.sqrt((np.arange(4096) + 0.5) / 4096)
    passed = 1 - adding_doubling.fresnel(cosines, 1.0, INDEX)
    outside = rng.choice(cosines, count, p=passed / passed.sum())
    inside = np.sqrt(1 - (1 - outside**2) / INDEX**2)
    exits, tally = walked(entries(count, way * R, way, inside), medium(1e-7), depths)
    assert tally.lost == 0
    assert 1 - tally.escaped / tally.entered < 1e-4
    path = exits["path_epidermis_mm"].astype(float) + exits["path_dermis_mm"]
    exact = 4 * INDEX**2 * made.volume / (made.area * passed.mean())
    assert (
        abs(path.mean() - exact) < 4 * path.std() / np.sqrt(count) + 0.003 * exact
    )  # .3 %: see kernels/render/anchors.cl


def test_clear_skin_is_a_pane_of_glass():
    """Without scattering light crosses a slab straight, bends back as it leaves, and its path is the chord."""
    cosine = 0.8
    given = entries(4096, cosine=cosine)
    clear = Medium(*(np.array([v]) for v in (550.0, 1e-4, G, 1e-6)), epidermis_mm=EPIDERMIS, n=INDEX)
    exits, _ = walked(given, clear, slab(1.0))
    down = exits["normal"][:, 2] < -0.5  # some are mirrored inside, once or more often
    first = down & (exits["path_epidermis_mm"] + exits["path_dermis_mm"] < 2)
    assert first.sum() > 3500
    chord, along = 1 / cosine, given["direction"][first, :2]
    assert np.abs(exits["path_epidermis_mm"][first] - 2 * EPIDERMIS / cosine).max() < 2e-3
    assert np.abs(exits["path_dermis_mm"][first] - (chord - 2 * EPIDERMIS / cosine)).max() < 2e-3
    assert np.abs(exits["position"][first, :2] - chord * along).max() < 2e-3
    assert np.abs(exits["direction"][first, :2] - INDEX * along).max() < 1e-4
    assert np.abs(exits["direction"][first, 2] + np.sqrt(1 - INDEX**2 * (1 - cosine**2))).max() < 1e-4


def test_light_that_comes_in_at_60_degrees_leaves_as_adding_doubling_says():
    """The ratio to normal incidence on dark skin at the quadrature's node nearest 60 degrees; .91 to 1.28 over all
    skin (luts/README.md, What a value means)."""
    layers = lutgen.layers(lutgen.preset("dark"), 450.0)
    base, _ = adding_doubling.directions([1.0, INDEX])
    air = np.sqrt(np.maximum(1 - INDEX**2 * (1 - base**2), 0))
    node = int(np.argmin(np.abs(air - 0.5)))
    exact = adding_doubling.stack(layers, incident=node)[0]
    top, bottom = layers
    one = [np.array([v]) for v in (450.0, top.mu_s_per_mm, top.g, bottom.mu_a_per_mm)]
    exits, _ = walked(entries(N, cosine=base[node]), Medium(one[0], one[1], one[2], one[3], top.thickness_mm, INDEX))
    entry = 1 - adding_doubling.fresnel(air[node : node + 1], 1.0, INDEX)[0]
    w = entry * weights(exits, top.mu_a_per_mm, bottom.mu_a_per_mm, bottom.mu_a_per_mm)
    assert agree(estimate(w), Estimate(np.array(exact), np.array(0.0)))
    assert exact / lutgen.reflectance(layers).diffuse > 1.1


def test_all_wavelengths_of_a_queue_give_the_sets_color():
    """Samples stratified over the set's wavelengths: the color at a node of its grid, the set's own sigma counted."""
    luts = lutgen.load()
    axes = luts.color_lut.grid
    skin = [axis.values[axis.count // 3] for axis in (axes.melanin, axes.eumelanin, axes.hemoglobin)]
    nm, weight = luts.paths.wavelength_nm, luts.weights
    through, _ = bake.skin_medium(Skin(*skin), nm)
    K = len(nm)
    exits, _ = walked(entries(2**16 * K), through)
    mu = expand.coefficients(nm, luts.absorbers, *(np.array([v]) for v in skin))
    w = weights(exits.reshape(-1, K), mu[0][:, 0], mu[1][:, 0], through.nu_per_mm) * through.entry
    found = Estimate(w.mean(axis=0) @ weight, np.sqrt((w.std(axis=0) ** 2 / len(w)) @ weight**2))
    wanted = luts.color(*skin, space="acescg")
    assert agree(found, Estimate(wanted, luts.color_std_error(*skin)))


@pytest.mark.parametrize("preset", ["light", "dark"])
@pytest.mark.parametrize("inside", [False, True])
def test_full_walks_have_the_profile_of_the_set(inside, preset):
    """Energy of every ring of the set's profiles, under flat skin or inside a thick slab, and within every radius; by
    reciprocity what a camera along the normal sees of a small disc under light from a whole hemisphere."""
    luts, skin = lutgen.load(), lutgen.preset(preset)
    edges, nm, weight = luts.paths.radius_edges_mm, luts.paths.wavelength_nm, luts.weights
    through, _ = bake.skin_medium(skin, nm)
    K, count = len(nm), 2**17
    exits, tally = walked(entries(count * K), through, slab(40.0, 120.0, 0.5) if inside else None)
    assert tally.unfinished == 0
    assert tally.lost < 1e-5 * count * K
    mu = expand.coefficients(
        nm, luts.absorbers, *(np.array([getattr(skin, name)]) for name in ("melanin", "eumelanin", "hemoglobin"))
    )
    exits = exits.reshape(count, K)
    w = weights(exits, mu[0][:, 0], mu[1][:, 0], through.nu_per_mm) * through.entry
    where = np.stack([radius(exits[:, k]) for k in range(K)], axis=1)
    sums, squares = (
        np.stack([np.histogram(where[:, k], edges, weights=w[:, k] ** power)[0] / count for k in range(K)], axis=1)
        for power in (1, 2)
    )
    sigma = np.sqrt(np.maximum(squares - sums**2, 0) / count @ weight**2)
    wanted = luts.paths.evaluate(*mu)[:, :, 0].T @ weight
    of_paths = np.sqrt((luts.paths.std_error(*mu)[:, :, 0] ** 2).T @ weight**2)
    whole, off = np.hypot(sigma, of_paths), sums @ weight - wanted
    assert np.all(np.abs(off) < 4 * whole + 1e-7)
    assert np.all(np.abs(np.cumsum(off, axis=0)) < 4 * np.sqrt(np.cumsum(whole**2, axis=0)) + 1e-6)
    assert np.sqrt(np.sum(whole**2, axis=0)).max() < 0.01 * wanted.sum(axis=0).max()  # else the law says little


def test_no_two_blocks_share_a_stream_however_large_the_picture():
    """The largest picture in the smallest blocks, first and last estimates and turns."""
    through, pixels = medium(), 4096 * 4096
    last = goal.SAMPLES[1] - 1
    keys = []
    for begin in (0, 2**20, pixels - 1024):
        for first in (0, 1, 2**15, last):
            for turn in (0, 15):
                table = mesh_walk.jobs(through, sample_queue.Part(begin, begin + 1024, first, 1, turn), 0, 128)
                keys += zip(table["wavelength"].tolist(), table["block"].tolist(), strict=True)
    assert len(keys) == 3 * 4 * 2 * 8
    assert len(set(keys)) == len(keys)


def test_exits_do_not_depend_on_how_a_picture_was_cut():
    """Blocks of pixels, estimates and turns have streams of their own; empty places have no exit."""
    device = ocl.choose()
    size, K = mesh_walk.block(device), 2
    two = Medium(np.array([550.0, 600.0]), np.full(2, MU_S), np.full(2, G), np.full(2, 0.1), EPIDERMIS, INDEX)
    given = entries(3 * size * 2 * K)
    given["sample"][::7] = sample_queue.EMPTY
    whole, tally = walked(given, two, begin=0, end=3 * size, samples=2 * K)
    assert tally.entered == np.sum(given["sample"] != sample_queue.EMPTY)
    assert np.all(whole["path_dermis_mm"][::7] < 0)
    by_pixel = given.reshape(3 * size, 2, K)
    cut = [walked(by_pixel[:size].ravel(), two, begin=0, end=size, samples=2 * K)[0]]
    halves = []
    for k in (0, 1):
        half = np.ascontiguousarray(by_pixel[size:, k]).ravel()
        halves += [walked(half, two, begin=size, end=3 * size, first=k * K)[0].reshape(2 * size, K)]
    joined = np.stack(halves, axis=1)
    assert np.concatenate([*cut, joined.ravel()]).tobytes() == whole.tobytes()
    found = whole["path_dermis_mm"]
    others = [walked(given, two, begin=0, end=3 * size, samples=2 * K, turn=1)[0]["path_dermis_mm"]]
    others += [walked(given, two, None, 2, begin=0, end=3 * size, samples=2 * K)[0]["path_dermis_mm"]]
    others += [found.reshape(-1, 2, K)[:, ::-1].ravel(), found.reshape(-1, K)[:, ::-1].ravel()]
    for other in others:  # another turn, seed, estimate and wavelength
        both = (found >= 0) & (other >= 0)
        assert both.sum() > 1000
        assert np.mean(found[both] == other[both]) < 0.01
