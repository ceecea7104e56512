"""Chromophores and tissue against the reference table's own columns, and their allowed ranges."""

from dataclasses import fields

import numpy as np
import pytest
from reference import TWO_LAYER

import lutgen
from lutgen.skin import chromophores, tissue

READINGS = {"A": "reduced", "B": "similarity", "C": "literal"}


@pytest.mark.parametrize("row", TWO_LAYER, ids=lambda r: f"{r['reading']}-{r['wavelength_nm']}-{r['f_mel']}")
def test_coefficients_are_those_of_the_reference_table(row):
    nm, melanin, ratio, blood, oxygenation = (
        float(row[k]) for k in ("wavelength_nm", "f_mel", "f_eumel", "f_blood", "sO2")
    )
    # One row has no melanin: outside Skin's range.
    mu_s, g = tissue.scattering(tissue.Tissue(reading=READINGS[row["reading"]]), nm)
    mu_a = {"epi": chromophores.epidermis(nm, melanin, ratio), "der": chromophores.dermis(nm, blood, oxygenation)}
    for name, value in mu_a.items():
        # The table prints eight digits.
        assert float(value) == pytest.approx(float(row[f"mua_{name}_per_mm"]), rel=1e-7)
        assert float(mu_s) == pytest.approx(float(row[f"mus_{name}_per_mm"]), rel=1e-7)
        assert float(g) == pytest.approx(float(row[f"g_{name}"]), abs=1e-9)


def test_layers_are_made_of_the_coefficients():
    skin = lutgen.Skin(0.013, 0.7, 0.005)
    epidermis, dermis = lutgen.layers(skin, 450)
    assert (epidermis.thickness_mm, dermis.thickness_mm, epidermis.n, dermis.n) == (0.1, np.inf, 1.4, 1.4)
    assert epidermis.mu_a_per_mm == pytest.approx(1.2804129, rel=1e-7)
    assert dermis.mu_a_per_mm == pytest.approx(0.32200577, rel=1e-7)
    assert epidermis.mu_s_per_mm == dermis.mu_s_per_mm == pytest.approx(36.910224, rel=1e-7)


def test_a_skin_is_its_chromophores_and_its_tissue():
    skin = lutgen.Skin(0.013, 0.4, 0.005, 0.6, 0.2, "saidi", "literal", 3.0, 5e10, 1.45)
    assert skin.chromophores == tissue.Chromophores(0.013, 0.4, 0.005)
    assert skin.tissue == tissue.Tissue(0.6, 0.2, "saidi", "literal", 3.0, 5e10, 1.45)
    assert tissue.skin_of(skin.chromophores, skin.tissue) == skin
    assert tissue.skin_of(lutgen.preset("dark").chromophores, skin.tissue) != skin
    assert tuple(field.name for field in fields(tissue.Chromophores)) == chromophores.NAMES


def test_files_hold_the_refractive_index_only_where_it_is_another():
    keys = ["melanin", "eumelanin", "hemoglobin", "oxygenation", "epidermis_mm", "scattering", "reading",
            "saidi_a_per_mm", "saidi_b_nm4_per_mm"]  # fmt: skip
    assert list(tissue.plain(lutgen.preset("dark"))) == keys
    other = tissue.plain(lutgen.Skin(0.02, 0.7, 0.01, refractive_index=1.45))
    assert list(other) == [*keys, "refractive_index"]
    assert lutgen.Skin(**other).refractive_index == 1.45


def test_the_refractive_index_is_that_of_every_layer():
    skin = lutgen.Skin(0.02, 0.7, 0.01, refractive_index=1.5)
    assert [layer.n for layer in lutgen.layers(skin, 550)] == [1.5, 1.5]
    assert lutgen.reflectance(lutgen.layers(skin, 550)).specular == pytest.approx(0.04, abs=1e-12)


def test_source_law_is_twice_bashkatov():
    nm = np.linspace(380, 780, 41)
    assert np.allclose(chromophores.scattering_source(nm), 2 * chromophores.scattering_bashkatov(nm), rtol=1e-14)


def test_saidi_keeps_both_fitted_values_as_parameters():
    neonate = tissue.Tissue(scattering="saidi", saidi_a_per_mm=3.0, saidi_b_nm4_per_mm=5e10)
    expected = 3.0 * (1 - 1.745e-3 * 500 + 9.843e-7 * 500**2) + 5e10 / 500**4
    assert float(tissue.reduced_scattering(neonate, 500.0)) == pytest.approx(expected, rel=1e-14)


def test_donner_halves_the_dermis_and_no_path_table_takes_it():
    skin = lutgen.Skin(0.02, 0.7, 0.01, scattering="donner")
    epidermis, dermis = lutgen.layers(skin, 500)
    assert dermis.mu_s_per_mm == epidermis.mu_s_per_mm / 2
    with pytest.raises(lutgen.InputError, match="adding-doubling"):
        lutgen.reflectance([epidermis, dermis], method="path-table")
    assert 0 < lutgen.reflectance([epidermis, dermis]).diffuse < 1


def test_blood_factor_is_that_of_prahl():
    assert pytest.approx(5.35485e-4, rel=1e-6) == chromophores.BLOOD_FACTOR


def test_ranges_enclose_every_allowed_skin_and_are_reached():
    rng = np.random.default_rng(0)
    nm = np.arange(380.0, 781.0, 5.0)
    m, e, h, s = (rng.uniform(low, high, 4000) for low, high in (
        chromophores.MELANIN, chromophores.EUMELANIN, chromophores.HEMOGLOBIN, chromophores.OXYGENATION))  # fmt: skip
    epidermis = chromophores.epidermis(nm[:, None], m, e)
    dermis = chromophores.dermis(nm[:, None], h, s)
    for values, (low, high) in ((epidermis, chromophores.epidermis_range(nm)), (dermis, chromophores.dermis_range(nm))):
        assert np.all(values.min(axis=1) >= low * (1 - 1e-12))
        assert np.all(values.max(axis=1) <= high * (1 + 1e-12))
        assert np.all(values.max(axis=1) > 0.9 * high)


@pytest.mark.parametrize(
    ("field", "value"),
    [("melanin", 0.0), ("melanin", 0.6), ("eumelanin", -0.1), ("hemoglobin", 0.2), ("oxygenation", 1.1),
     ("epidermis_mm", 0.0), ("refractive_index", 0.9), ("melanin", float("nan")), ("scattering", "mie"),
     ("reading", "wrong")],
)  # fmt: skip
def test_skin_out_of_range_names_parameter_value_and_range(field, value):
    fields: dict = {"melanin": 0.02, "eumelanin": 0.7, "hemoglobin": 0.01} | {field: value}
    with pytest.raises(lutgen.InputError, match=rf"^{field} = .*allowed is"):
        lutgen.Skin(**fields)


@pytest.mark.parametrize("field", ["thickness_mm", "mu_a_per_mm", "mu_s_per_mm", "g", "n"])
def test_layer_refuses_nan(field):
    values = {"thickness_mm": 1.0, "mu_a_per_mm": 1.0, "mu_s_per_mm": 10.0, "g": 0.8, "n": 1.4} | {field: float("nan")}
    with pytest.raises(lutgen.InputError, match=field):
        lutgen.Layer(**values)


def test_presets_have_the_slugs_that_commands_name():
    assert list(lutgen.PRESETS) == [
        "very-light", "light", "intermediate", "tan", "brown", "dark",
        "source-caucasian", "source-asian", "source-african",
    ]  # fmt: skip
    with pytest.raises(lutgen.InputError, match="very-light"):
        lutgen.preset("pale")
