"""The bake: its error, its determinism, expansion, anchoring, profiles between nodes, recipes."""

from dataclasses import replace

import numpy as np
import pytest

import lutgen
from lutgen import color
from lutgen import device as ocl
from lutgen.skin.tissue import Chromophores, Tissue, skin_of
from lutgen.solvers import exact_totals, path_table, profiles
from lutgen.tables import bake, expand, storage, wavelengths
from lutgen.tables import recipe as recipes
from lutgen.tables.axes import Axis, Grid, default_grid

TISSUE = Tissue()
SIGMAS = 4.5  # of the largest of 1,000 to 6,000 values


def test_draft_holds_its_promise(draft):
    """Draft: at most 1.5 over 1,000 random skins against adding-doubling at 5 nm; the manifest says the same."""
    exact = exact_totals.exact_totals(TISSUE)
    found = bake.measure(draft, exact, seed=77)["color"]
    assert found["delta_e00_max"] < 1.5
    assert draft.manifest["error"]["color"]["delta_e00_max"] < 1.5


def test_standard_and_reference_hold_their_promises():
    standard = lutgen.bake("standard").manifest["error"]
    assert standard["color"]["delta_e00_max"] <= 0.4
    assert standard["color"]["delta_e00_p95"] <= 0.3
    assert standard["profile"]["ee_difference_max"] <= 0.02
    reference = lutgen.bake("reference").manifest["error"]
    assert reference["color"]["delta_e00_max"] <= 0.1


def test_color_nodes_are_exact_within_sigma(draft):
    """Every node against adding-doubling at the same wavelengths."""
    m, e, h = (v.ravel() for v in draft.color_lut.grid.nodes())
    nm = draft.paths.wavelength_nm
    exact = exact_totals.exact_totals(TISSUE)(nm, *expand.coefficients(nm, draft.absorbers, m, e, h)).T @ draft.weights
    sigma = draft.color_std_error(m, e, h)
    assert np.all(np.abs(draft.color_lut.acescg.reshape(-1, 3) - exact) < SIGMAS * sigma + 5e-5)


def test_anchored_totals_are_exact_and_keep_the_shape(draft):
    anchored = lutgen.bake({"photons": 65_536, "seed": 5, "totals": "anchored"})
    m, e, h = (v.ravel() for v in anchored.color_lut.grid.nodes())
    nm = anchored.paths.wavelength_nm
    exact = (
        exact_totals.exact_totals(TISSUE)(nm, *expand.coefficients(nm, anchored.absorbers, m, e, h)).T @ draft.weights
    )
    assert np.abs(anchored.color_lut.acescg.reshape(-1, 3) - exact).max() < 5e-5
    one, two = (luts.profile(0.05, 0.7, 0.01).encircled() for luts in (draft, anchored))
    assert np.abs(one - two).max() < 0.01


def test_profiles_between_nodes_meet_a_converged_trace():
    """50 random skins, default set, against a trace of its own with another seed: EE difference at most 0.02."""
    luts = lutgen.load()
    rule = wavelengths.load("8")
    medium, reach = bake.skin_medium(TISSUE, rule.wavelength_nm)
    truth = path_table.trace(medium, *reach, luts.paths.radius_edges_mm, 1_000_000, seed=99)
    skins = bake.random_skins(luts.profile_lut.grid, 50, 123)
    energy = np.einsum("kbp,kc->pcb", truth.evaluate(*expand.coefficients(
        rule.wavelength_nm, luts.absorbers, *skins)), luts.weights)  # fmt: skip
    found = np.array([luts.profile(*skin).energy.T for skin in zip(*skins, strict=True)])
    assert profiles.ee_difference(np.maximum(energy, 0), found, luts.paths.radius_edges_mm).max() <= 0.02


def test_expansion_is_a_bake_at_that_oxygenation(draft):
    """Other seed, so independent: color within 4 sigma of both, profiles too."""
    baked = lutgen.bake({"photons": 65_536, "seed": 6, "skin": {"oxygenation": 0.3}})
    expanded = draft.expand(oxygenation=0.3)
    skins = [v.ravel()[::7] for v in draft.color_lut.grid.nodes()]
    sigma = np.hypot(baked.color_std_error(*skins), expanded.color_std_error(*skins))
    difference = expanded.color(*skins, space="acescg") - baked.color(*skins, space="acescg")
    assert np.all(np.abs(difference) < 4 * sigma)
    one, two = (luts.profile(0.02, 0.7, 0.02) for luts in (expanded, baked))
    sigma = np.hypot(one.std_error, two.std_error)
    seen = one.energy > 8 * sigma  # normalization couples rings: compare where a ring has statistics
    assert seen.sum() > 50
    assert np.all(np.abs(one.energy - two.energy)[seen] < 4 * sigma[seen])
    assert np.abs(expanded.color(0.02, 0.7, 0.05) - draft.color(0.02, 0.7, 0.05)).max() > 0.01


def test_expansion_to_the_same_oxygenation_changes_nothing(draft):
    same = draft.expand()
    assert np.abs(same.color_lut.acescg - draft.color_lut.acescg).max() < 1e-12
    assert np.abs(same.profile_lut.shape - draft.profile_lut.shape).max() < 1e-12


def test_extra_absorbers_are_baked_in(draft):
    """An added absorber equals the same coefficient in adding-doubling."""
    nm = draft.paths.wavelength_nm
    more = draft.expand(extra_absorbers={"dermis": lambda w: 0.05 + 0.0 * w, "epidermis": 0.2})
    m, e, h = np.array([0.02]), np.array([0.7]), np.array([0.01])
    mu_e, mu_d = expand.coefficients(nm, draft.absorbers, m, e, h)
    exact = exact_totals.exact_totals(TISSUE)(nm, mu_e + 0.2, mu_d + 0.05).T @ draft.weights
    grid_error = np.abs(
        draft.color(m, e, h, "acescg") - draft.totals.evaluate(mu_e, mu_d)[:, 0].T @ draft.weights
    ).max()
    sigma = more.color_std_error(m, e, h)
    assert np.all(np.abs(more.color(m, e, h, "acescg") - exact) < SIGMAS * sigma + 2 * grid_error)
    assert more.color(0.02, 0.7, 0.01).sum() < draft.color(0.02, 0.7, 0.01).sum()


def test_a_second_expansion_keeps_what_the_first_one_added(draft):
    once = draft.expand(extra_absorbers={"dermis": 0.05})
    assert np.abs(once.expand().color_lut.acescg - once.color_lut.acescg).max() < 1e-12
    again = once.expand(oxygenation=0.5)
    both = draft.expand(oxygenation=0.5, extra_absorbers={"dermis": 0.05})
    assert np.abs(again.color_lut.acescg - both.color_lut.acescg).max() < 1e-12
    assert np.abs(again.expand(extra_absorbers={}).color_lut.acescg - draft.expand(0.5).color_lut.acescg).max() < 1e-12


def test_measured_error_sees_wrong_colors_and_shapes(draft):
    exact = exact_totals.exact_totals(TISSUE)
    pale = replace(draft, color_lut=replace(draft.color_lut, acescg=draft.color_lut.acescg * 1.1))
    assert bake.measure(pale, exact)["color"]["delta_e00_max"] > 1.5
    shifted = np.roll(draft.profile_lut.shape, 3, axis=-2)
    wide = replace(draft, profile_lut=replace(draft.profile_lut, shape=shifted))
    assert bake.measure(wide, exact)["profile"]["ee_difference_max"] > 0.05


def test_expansion_beyond_the_paths_is_refused(draft):
    with pytest.raises(lutgen.InputError, match=r"dermis absorption = .* the stored paths cover"):
        draft.expand(extra_absorbers={"dermis": 1000.0})
    with pytest.raises(lutgen.InputError, match=r"oxygenation = 1.5: allowed is 0 to 1"):
        draft.expand(oxygenation=1.5)
    with pytest.raises(lutgen.InputError, match="finite coefficients of 0 or more"):
        draft.expand(extra_absorbers={"dermis": -1.0})
    with pytest.raises(lutgen.InputError, match="unknown layer 'fat'"):
        draft.expand(extra_absorbers={"fat": 1.0})


def test_same_recipe_gives_the_same_bytes_however_it_is_split(tmp_path):
    recipe = {"photons": 7 * path_table.BLOCK_PHOTONS["cpu"], "wavelengths": "6"}  # 42 blocks
    sets = [
        storage.save(lutgen.bake(recipe, blocks_per_launch=size), tmp_path / str(size)) for size in (42, 21, 6)
    ]  # 1, 2 and 7 launches
    for name in storage.EXR_FILES:
        assert len({(folder / name).read_bytes() for folder in sets}) == 1
    other = storage.save(lutgen.bake(recipe | {"seed": 1}), tmp_path / "other")
    assert (other / "color.exr").read_bytes() != (sets[0] / "color.exr").read_bytes()


def test_profile_energy_sums_to_the_color(draft):
    profile = draft.profile(0.07, 0.5, 0.02)
    assert profile.total == pytest.approx(draft.color(0.07, 0.5, 0.02, space="acescg"), abs=1e-12)
    srgb = draft.profile(0.07, 0.5, 0.02, space="srgb")
    assert srgb.total == pytest.approx(draft.color(0.07, 0.5, 0.02), abs=1e-12)


def test_profiles_narrow_as_skin_darkens(draft):
    radii = np.array([draft.profile(m, 0.7, 0.01).radius_mm(0.5) for m in (0.01, 0.05, 0.2, 0.5)])
    assert np.all(np.diff(radii, axis=0) < 0)
    assert np.all(np.diff(radii[:, ::-1], axis=1) > 0)  # red farther than green farther than blue


def test_recolor_keeps_detail(draft):
    base, target = lutgen.preset("light"), (0.2, 0.7, 0.015)
    albedo = draft.color(0.0195, 0.7, 0.0088) * np.linspace(0.5, 1.2, 5)[:, None]
    found = draft.recolor(albedo, base, target)
    assert np.allclose(found, draft.color(*target) * np.linspace(0.5, 1.2, 5)[:, None])
    for arguments, message in (
        ((np.ones((4, 2)), base, target), "last axis"),
        (([1, 1, 1], "light", target), "a Skin or"),
        (([1, 1, 1], (0.1, 0.2), target), "a Skin or"),
        (([1, 1, 1], base, replace(base, oxygenation=0.2)), "oxygenation = 0.2: these LUTs hold 0.7; expand"),
    ):
        with pytest.raises(lutgen.InputError, match=message):
            draft.recolor(*arguments)


def test_color_spaces_are_those_of_color(draft):
    xyz = draft.color(0.02, 0.7, 0.01, space="xyz")
    assert draft.color(0.02, 0.7, 0.01) == pytest.approx(color.from_xyz(xyz, "srgb"), abs=1e-12)
    assert np.abs(draft.color(0.02, 0.7, 0.01) - lutgen.linear_srgb(lutgen.Skin(0.02, 0.7, 0.01))).max() < 0.01


def test_chromophores_outside_the_axes_are_refused(draft):
    for values, message in (((0.6, 0.7, 0.01), "melanin = 0.6: these LUTs cover 0.001 to 0.5"),
                            ((0.02, 0.7, [0.01, np.nan]), "hemoglobin = nan")):  # fmt: skip
        with pytest.raises(lutgen.InputError, match=message):
            draft.color(*values)
    for values, message in ((("a", 0.7, 0.01), "melanin = 'a'"), (([0.1] * 3, 0.7, [0.01] * 2), "must broadcast")):
        with pytest.raises(lutgen.InputError, match=message):
            draft.color(*values)
    for extra in ([1], {"dermis": "a"}):
        with pytest.raises(lutgen.InputError, match="extra_absorbers"):
            draft.expand(extra_absorbers=extra)
    with pytest.raises(lutgen.InputError, match="space = 'hsv'"):
        draft.color(0.02, 0.7, 0.01, space="hsv")


def test_fixed_axes_and_other_settings_bake(tmp_path):
    fixed = Axis("eumelanin", "1", 0.7, 0.7, 1)
    grid = Grid(default_grid(4, 2, 3).melanin, fixed, default_grid(4, 2, 3).hemoglobin)
    recipe = replace(recipes.Recipe(), photons=4096, color=grid, profile=grid, pipeline="source", rings=32,
                     skin=Tissue(epidermis_mm=0.06, scattering="jacques", reading="similarity", refractive_index=1.5),
                     totals="anchored")  # fmt: skip
    luts = storage.load(storage.save(lutgen.bake(recipe), tmp_path / "set"))
    assert luts.color_lut.acescg.shape == (3, 1, 4, 3)
    assert luts.profile_lut.shape.shape == (3, 1, 4, 32, 3)
    assert recipes.from_dict(luts.manifest["recipe"]) == recipe
    assert (luts.tissue, luts.manifest["trace"]["n"], round(luts.paths.entry, 9)) == (recipe.skin, 1.5, 0.96)
    tone = Chromophores(*(float(axis.values[0]) for axis in grid.axes[::-1]))
    skin = skin_of(tone, recipe.skin)
    # Quadrature of 8 wavelengths errs by 2e-4; an index of 1.4 anywhere would make colors 4e-2 brighter.
    node = luts.color(*luts.chromophores(skin))
    assert np.abs(node - lutgen.linear_srgb(skin, pipeline="source")).max() < 1e-3
    with pytest.raises(lutgen.InputError, match=r"refractive_index = 1.4: these LUTs hold 1.5"):
        luts.chromophores(replace(skin, refractive_index=1.4))


def test_of_a_skin_a_recipe_takes_the_tissue():
    skin = lutgen.preset("dark")
    assert recipes.Recipe(skin=skin) == recipes.Recipe()
    assert "refractive_index" not in recipes.Recipe().as_dict()["skin"]


def test_donner_scattering_is_refused_with_the_method_that_takes_it():
    with pytest.raises(lutgen.InputError, match="adding-doubling"):
        lutgen.bake({"skin": {"scattering": "donner"}})


def test_default_recipe_file_is_the_standard_quality():
    path = lutgen.default_luts().parent / "bake.toml"
    assert recipes.load(path) == recipes.quality("standard") == recipes.Recipe()
    assert recipes.load(path, recipes.quality("reference")) == recipes.Recipe()  # it names every key


def test_default_set_is_what_its_recipe_bakes():
    """Another seed: within 4.5 of both sigmas at every node; and the set's recipe is bake.toml's."""
    stored = lutgen.load()
    recipe = recipes.load(lutgen.default_luts().parent / "bake.toml")
    assert stored.manifest["recipe"] == recipe.as_dict()
    same_lanes = ocl.choose().lanes == stored.manifest["trace"]["lanes"]
    assert not same_lanes or stored.manifest["trace"]["kernel"] == path_table.kernel_hash(ocl.choose())
    baked = lutgen.bake(replace(recipe, seed=recipe.seed + 1))
    skins = [v.ravel() for v in stored.color_lut.grid.nodes()]
    sigma = np.hypot(stored.color_std_error(*skins), baked.color_std_error(*skins))
    assert np.all(np.abs(stored.color_lut.acescg - baked.color_lut.acescg).reshape(-1, 3) < 4 * sigma + 1e-6)
    for skin in list(zip(*(v.ravel() for v in stored.profile_lut.grid.nodes()), strict=True))[::31]:
        one, two = (luts.profile(*skin) for luts in (stored, baked))
        sigma = np.hypot(one.std_error, two.std_error)
        counted = one.energy > 8 * sigma  # a normal law needs some exits in the ring
        assert np.all(np.abs(one.energy - two.energy)[counted] < 4 * sigma[counted] + 1e-7)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"photon": 5}, "unknown key 'photon': allowed is photons"),
        ({"photons": 0}, "photons = 0: allowed is a whole number 1 to 2147483647"),
        ({"photons": 2**31}, "photons = 2147483648"),
        ({"photons": 1e5}, "photons = 100000.0"),
        ({"seed": -1}, "seed = -1: allowed"),
        ({"wavelengths": "7"}, "wavelengths = '7': allowed is 6, 8, 12, 10nm, 5nm"),
        ({"totals": "exact"}, "totals = 'exact': allowed is monte-carlo, anchored"),
        ({"pipeline": "srgb"}, "pipeline = 'srgb'"),
        ({"rings": 60}, "rings = 60: allowed is 8, 16"),
        ({"skin": {"thickness": 1}}, "skin: unknown key 'thickness'"),
        ({"skin": {"oxygenation": 2}}, "oxygenation = 2: allowed is 0 to 1"),
        ({"skin": {"scattering": "mie"}}, "scattering = 'mie'"),
        ({"skin": 3}, "skin = 3: a table"),
        ({"color": {"blood": {}}}, "color: unknown key 'blood'"),
        ({"color": {"melanin": {"n": 4}}}, "color.melanin: unknown key 'n'"),
        ({"color": {"melanin": {"low": 0.5, "high": 0.1}}}, "low = 0.5 is above high = 0.1"),
        ({"profile": {"melanin": {"count": 1}}}, "count = 1 with low"),
        ({"color": {"melanin": {"count": 0}}}, "count = 0"),
        ({"color": {"melanin": {"spacing": ["cbrt"]}}}, "spacing = \\['cbrt'\\]"),
        ({"color": {"melanin": {"low": "0.1"}}}, "low = '0.1': a number in"),
        ({"rings": 64.0}, "rings = 64.0"),
        ({"skin": {"oxygenation": 10**400}}, "oxygenation = 1000.*: a number in 0 to 1 is needed"),
        ({"skin": {"oxygenation": True}}, "oxygenation = True"),
        ({"skin": {"scattering": "saidi", "saidi_a_per_mm": 0, "saidi_b_nm4_per_mm": 0}}, "hardly scatters"),
        ({"photons": 1, "totals": "anchored"}, "photons = 1: too few for anchored totals"),
        (5, "recipe = 5: a Recipe"),
    ],
)
def test_bad_recipes_name_key_value_and_what_is_allowed(values, message):
    with pytest.raises(lutgen.InputError, match=message):
        lutgen.bake(values)


def test_unreadable_recipes_are_named(tmp_path):
    broken = tmp_path / "broken.toml"
    broken.write_text("photons = = 3")
    with pytest.raises(lutgen.InputError, match=r"broken.toml: not TOML"):
        lutgen.bake(broken)
    broken.write_text("a = " + "[" * 3000)
    with pytest.raises(lutgen.InputError, match=r"broken.toml: not TOML"):
        lutgen.bake(broken)
    with pytest.raises(lutgen.InputError, match="cannot be read"):
        lutgen.bake(tmp_path / "absent.toml")


def test_numpy_numbers_are_numbers(tmp_path):
    luts = lutgen.bake({"photons": np.int64(2048), "wavelengths": "6", "skin": {"oxygenation": np.float32(0.5)}})
    assert storage.load(storage.save(luts, tmp_path / "x")).oxygenation == 0.5


def test_unknown_device_is_named_with_those_there_are():
    with pytest.raises(lutgen.InputError, match=r"device = 'abacus': no device matches; allowed is an index"):
        lutgen.bake({"photons": 1}, device="abacus")
