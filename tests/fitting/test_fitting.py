"""Fits: skins come back from their own spectra, sigma covers noise, and what the data cannot tell is said."""

from itertools import product

import numpy as np
import pytest
from scipy.optimize import least_squares as scipy_least_squares

import lutgen
from lutgen import color, fitting
from lutgen.fitting import least_squares, measured, nearest
from lutgen.skin.tissue import specular
from lutgen.solvers import exact_totals

NM = np.arange(400.0, 701, 10)
SPECULAR = specular(1.4)
NAMES = ("melanin", "hemoglobin", "oxygenation", "eumelanin")
CLASSES = ("very-light", "light", "intermediate", "tan", "brown", "dark")


@pytest.fixture(scope="module")
def exact():
    return exact_totals.exact_totals(lutgen.Skin(0.02, 0.7, 0.01))


def random_skins(count: int, seed: int, melanin=(0.001, 0.5), hemoglobin=(0.001, 0.1), ratio=(0.0, 1.0)):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        m, h = (float(np.exp(rng.uniform(*np.log(ends)))) for ends in (melanin, hemoglobin))
        e, o = rng.uniform(ratio[0], ratio[1], 2)
        yield lutgen.Skin(m, float(e), h, float(o))


def of(exact, skin: lutgen.Skin, nm=NM) -> np.ndarray:
    return exact_totals.spectra(exact, nm, [skin.melanin], skin.eumelanin, skin.hemoglobin, skin.oxygenation)[0]


def off(found: fitting.Fit, skin: lutgen.Skin) -> float:
    """The largest error of a fitted parameter: relative for melanin and hemoglobin, of the two ratios as it is."""
    return max(
        abs(value - getattr(skin, name)) / (getattr(skin, name) if name in nearest.CUBE_ROOT else 1)
        for name, value in found.parameters.items()
    )


def sigmas(found: fitting.Fit) -> list[float]:
    """All sigma, in the parameters' order; empty where a parameter has none."""
    values = [value for value in found.sigma.values() if value is not None]
    return values if len(values) == len(found.sigma) else []


def test_skins_come_back_from_the_solvers_own_spectra():
    """Independent of the table: adding-doubling with 16 nodes; within 1 %, four parameters, the whole range."""
    for skin in random_skins(12, seed=1):
        assert off(lutgen.fit((NM, lutgen.spectrum(skin, NM)), NAMES), skin) < 0.01


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_skins_come_back_from_spectra(exact, count):
    for skin in random_skins(25, seed=count):
        found = lutgen.fit((NM, of(exact, skin)), NAMES[:count], skin)
        assert off(found, skin) < 1e-6
        assert found.delta_e00 < 1e-4
        assert found.rmse is not None
        assert found.rmse < 1e-7


def test_skins_come_back_from_their_colors(exact):
    nm, weights = color.xyz_weights()
    for skin in random_skins(25, seed=5):
        xyz = of(exact, skin, nm) @ weights
        found = lutgen.fit("xyz:" + ",".join(repr(float(v)) for v in xyz), base=skin)
        assert off(found, skin) < 1e-3  # CIELAB of the darkest is 1e-6 of its unit
        assert found.rmse is None


def test_other_skins_can_be_fitted_too():
    for base in (
        lutgen.Skin(0.05, 0.7, 0.01, epidermis_mm=0.06), lutgen.Skin(0.05, 0.7, 0.01, scattering="donner"),
        lutgen.Skin(0.05, 0.3, 0.01, scattering="saidi", saidi_a_per_mm=9),
        lutgen.Skin(0.05, 0.7, 0.01, reading="literal"),
    ):  # fmt: skip
        nm = NM[::3]
        found = lutgen.fit((nm, lutgen.spectrum(base, nm)), base=base)
        assert off(found, base) < 0.01
        assert found.skin.epidermis_mm == base.epidermis_mm
        assert found.skin.scattering == base.scattering


def test_the_surface_is_added_where_the_data_have_it(exact):
    skin = lutgen.preset("dark")
    assert pytest.approx(lutgen.reflectance(lutgen.layers(skin, 550)).specular, abs=1e-9) == SPECULAR
    data = NM, of(exact, skin) + SPECULAR
    with_it, without = (lutgen.fit(data, specular_included=flag) for flag in (True, False))
    assert off(with_it, skin) < 1e-6
    assert off(without, skin) > 0.1
    assert np.abs(with_it.reflectance - data[1]).max() < 1e-7
    lab = ",".join(repr(float(v)) for v in color.lab(data[1] @ measured.color_weights(NM)))
    assert off(lutgen.fit("lab:" + lab, specular_included=True), skin) < 0.05  # 400 to 700 nm against all


def test_the_refractive_index_is_that_of_the_base():
    skin = lutgen.Skin(0.05, 0.7, 0.01, refractive_index=1.5)
    data = NM, lutgen.spectrum(skin, NM) + 0.04
    assert off(lutgen.fit(data, base=skin, specular_included=True), skin) < 1e-3
    assert off(lutgen.fit(data, specular_included=True), skin) > 0.05


def test_order_does_not_matter(exact):
    data, some = of(exact, lutgen.preset("tan")) + 0.01 * np.sin(NM / 30), np.random.default_rng(0).permutation(len(NM))
    one = lutgen.fit((NM, data), ("oxygenation", "melanin", "hemoglobin"))
    two = lutgen.fit((NM[some], data[some]))
    assert one.parameters == two.parameters
    assert list(one.parameters) == list(NAMES[:3])


def misfit(exact, name: str, nm=NM) -> np.ndarray:
    """A preset's spectrum with the surface's reflection, off by a smooth 3 % as measured skin is from the model."""
    return of(exact, lutgen.preset(name), nm) * (1 + 0.03 * np.sin((nm - 400) / 55)) + SPECULAR


@pytest.mark.parametrize("name", CLASSES)
def test_more_parameters_leave_less(exact, name):
    """Two leave a color within ΔE00 1.7 in spite of a misfit like measured skin's; more of them leave no more."""
    left = []
    for count in (2, 3, 4):
        data = misfit(exact, name)
        found = lutgen.fit((NM, data), NAMES[:count], specular_included=True)
        assert found.delta_e00 < 1.7
        off_color = color.metric(color.lab(found.data.xyz)) @ (color.lab(found.xyz) - color.lab(found.data.xyz))
        shape = 116 * (np.cbrt(found.reflectance) - np.cbrt(data))
        left.append(float(off_color @ off_color + np.mean(shape**2)))
    assert left[1] <= left[0] * (1 + 1e-9)
    assert left[2] <= left[1] * (1 + 1e-9)


def test_scipy_finds_no_better_skin(exact):
    """Trust-region descents from four points end no lower, also where one start of ours, or two, would end too high."""
    rough = [
        (lutgen.Skin(0.42, 0.473, 0.0474, 0.00978), 61.2, 5.33),
        (lutgen.Skin(0.373, 1, 0.0234, 0.711), 35.9, 3.62),
    ]
    data = [np.clip(of(exact, skin) * (1 + 0.2 * np.sin((NM - 400) / period + at)), 0, 1) for skin, period, at in rough]
    for values in (*data, misfit(exact, "very-light"), misfit(exact, "dark")):
        task = nearest.problem(measured.spectrum(NM, values), NAMES, lutgen.preset("light"))
        ours = float((task.residual(nearest.solve(task)[None]) ** 2).sum())
        for h, e in product((0.1, 0.9), repeat=2):
            start, bounds = task.low + np.array([0.5, h, 0.5, e]) * (task.high - task.low), (task.low, task.high)
            other = scipy_least_squares(lambda q, t=task: t.residual(q[None])[0], start, bounds=bounds)
            assert ours <= 2 * other.cost * (1 + 1e-6)


def pulls(exact, count: int, noise: str, seeds: int = 100) -> np.ndarray:
    """(Found - true) / sigma [seeds, count] of random skins under noise of 0.002, or of 1 % of each reflectance."""
    found, rng = [], np.random.default_rng(3)
    for skin in random_skins(seeds, 4, (0.01, 0.2), (0.004, 0.03), (0.4, 0.8)):
        clean = of(exact, skin)
        noisy = clean + rng.normal(size=len(NM)) * (0.01 * clean if noise == "relative" else 0.002)
        fit = lutgen.fit((NM, noisy), NAMES[:count], skin, noise=0.002 if noise == "stated" else None)
        sigma = sigmas(fit)
        if sigma:  # a parameter at its bound has none
            found.append([(fit.parameters[n] - getattr(skin, n)) / s for n, s in zip(NAMES, sigma, strict=False)])
    assert len(found) > 0.9 * seeds
    return np.array(found)


@pytest.mark.parametrize("noise", ["constant", "relative", "stated"])
@pytest.mark.parametrize("count", [2, 3])
def test_sigma_covers_the_noise(exact, count, noise):
    """Pulls have mean 0 and spread 1, within four standard errors of each over 100 seeds."""
    found = pulls(exact, count, noise)
    assert np.all(np.abs(found.mean(axis=0)) < 4 / np.sqrt(len(found)))
    spread = 1 if noise == "stated" else np.sqrt(29 / 27) * 1.05  # Student's t, and few residuals weigh most
    assert np.all(np.abs(found.std(axis=0) / spread - 1) < 4 / np.sqrt(2 * len(found)))


def test_sigma_of_a_color_covers_its_noise(exact):
    nm, weights = color.xyz_weights()
    rng, found = np.random.default_rng(6), []
    for skin in random_skins(100, 7, (0.01, 0.2), (0.006, 0.03), (0.7, 0.7)):
        lab = color.lab(of(exact, skin, nm) @ weights)
        noisy = lab + np.linalg.solve(color.metric(lab), rng.normal(0, 0.3, 3))
        fit = lutgen.fit("lab:" + ",".join(map(str, noisy)), noise=0.3)
        found.append([(fit.parameters[n] - getattr(skin, n)) / s for n, s in zip(NAMES, sigmas(fit), strict=False)])
    found = np.array(found)
    assert np.all(np.abs(found.mean(axis=0)) < 0.4)
    assert np.all(np.abs(found.std(axis=0) - 1) < 4 / np.sqrt(200))


def test_sigma_does_not_shrink_with_more_samples_of_the_same_misfit(exact):
    """Four times as many samples of noise halve sigma; of a smooth misfit they say nothing new."""
    few, many = np.arange(400.0, 701, 10), np.arange(400.0, 701, 2.5)
    smooth = [lutgen.fit((nm, misfit(exact, "tan", nm)), specular_included=True) for nm in (few, many)]
    assert all(any("misfit rather than noise" in note for note in found.notes) for found in smooth)
    rng, clean = np.random.default_rng(8), [of(exact, lutgen.preset("tan"), nm) for nm in (few, many)]
    noisy = [
        [lutgen.fit((nm, one + rng.normal(0, 0.003, len(nm)))) for _ in range(10)]
        for nm, one in zip((few, many), clean, strict=True)
    ]
    few_noise, many_noise = (np.sqrt(np.mean([np.square(sigmas(f)) for f in found], axis=0)) for found in noisy)
    assert np.all(np.abs(many_noise / few_noise - 0.5) < 0.125)
    assert np.all(np.array(sigmas(smooth[1])) / sigmas(smooth[0]) > 0.7)


def test_covariance_is_that_of_a_straight_line():
    """Ordinary least squares: the textbook's sigma with stated noise, and on average without, few values or many."""
    rng = np.random.default_rng(9)
    for count in (8, 60):
        slope = np.column_stack([np.ones(count), np.linspace(-1, 1, count)])
        solution = np.linalg.pinv(slope)
        truth = 0.3**2 * np.linalg.inv(slope.T @ slope)
        assert np.allclose(least_squares.covariance(solution, slope, np.zeros(count), 0.3)[0], truth)
        covariances = []
        for _ in range(400):
            data = rng.normal(0, 0.3, count)
            values, alike = least_squares.covariance(solution, slope, data - slope @ (solution @ data), None)
            covariances.append(values * (1 - alike) / (1 + alike))
        spread = np.std(covariances, axis=0) / np.sqrt(len(covariances))
        # Intercept against slope is a sum of `count` products that cancel: with one variance for all, what is left of
        # them is rounding alone, which has no spread to be held against.
        size = np.sqrt(np.outer(np.diag(truth), np.diag(truth)))
        rounding = 4 * count * np.finfo(float).eps * size
        assert np.all(np.abs(np.mean(covariances, axis=0) - truth) < 4 * spread + rounding)


def test_a_parameter_at_its_bound_has_no_sigma(exact):
    skin = lutgen.Skin(0.03, 0.7, 0.01, oxygenation=1.0)
    noisy = of(exact, skin) + 0.002 * np.cos(NM)
    found = next(
        f
        for f in (lutgen.fit((NM, noisy + s * (NM > 600))) for s in np.linspace(0, 0.02, 9))
        if None in f.sigma.values()
    )
    assert found.sigma["oxygenation"] is None
    assert found.parameters["oxygenation"] in (0.0, 1.0)
    assert found.correlation[2].tolist() == [0, 0, 0]
    assert found.sigma["melanin"] is not None
    assert any(note.startswith("oxygenation is at its bound 1: it has no sigma") for note in found.notes)


def test_what_a_color_cannot_tell_is_said():
    found = lutgen.fit("lab:62,10,18", ("melanin", "hemoglobin", "eumelanin"))
    assert any("eumelanin is hardly determined" in note and "against melanin" in note for note in found.notes)
    assert sigmas(found)[2] > fitting.UNSURE
    assert not lutgen.fit("lab:62,10,18").notes


def test_trades_are_named_and_are_what_noise_makes(exact):
    """Dark skin hardly shows its blood: under noise its melanin and hemoglobin err together as `correlation` says."""
    clean, rng, seeds = of(exact, lutgen.preset("dark")), np.random.default_rng(10), 100
    skin = lutgen.preset("dark")
    noisy = (clean + rng.normal(0, 0.0003, len(NM)) for _ in range(seeds))
    found = [lutgen.fit((NM, data), NAMES[:2], skin, noise=0.0003) for data in noisy]
    r = float(np.corrcoef(np.array([list(f.parameters.values()) for f in found]).T)[0, 1])
    said = found[0].correlation[0, 1]
    assert abs(r - said) < 4 * (1 - said**2) / np.sqrt(seeds)
    assert abs(said) > fitting.TRADE_OFF
    assert f"melanin and hemoglobin trade off (correlation {said:.2f}): " in found[0].notes[0]
    light = lutgen.fit((NM, of(exact, lutgen.preset("tan"))), NAMES[:2], noise=0.002)
    assert any("trade off" in note for note in light.notes) == (abs(light.correlation[0, 1]) > fitting.TRADE_OFF)


def test_little_range_is_said(exact):
    skin = lutgen.preset("tan")
    for nm, said in ((np.arange(500.0, 651, 10), True), (NM, False)):
        found = lutgen.fit((nm, of(exact, skin, nm)))
        assert any("less than the eye sees" in note for note in found.notes) == said
        assert off(found, skin) < 1e-6


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ("#ffffff", "measured color #ffffff: no skin has it; the nearest of the model, #d2c9bb, is ΔE00 13.6 away"),
        ("#00ff00", "no skin has it"),
        ("#000000", "no skin has it"),
        ((NM, np.where((NM // 10) % 2, 0.55, 0.21)), "no skin has it"),
        ((NM, np.zeros_like(NM)), "measured spectrum: no skin has it; the nearest of the model is a lightness L* of"),
    ],
)
def test_what_no_skin_has_is_refused(data, message):
    with pytest.raises(lutgen.InputError) as error:
        lutgen.fit(data)
    assert message in str(error.value)
    assert "(allowed is 10)" in str(error.value)


def test_a_color_flagged_wrong_is_pointed_out():
    """Encoded values of light skin, called linear, are a white that no skin has."""
    (note, *_) = lutgen.fit("linear:0.72,0.58,0.48").notes
    assert "no skin of the model has this color" in note
    assert "; read as srgb: " in note
    assert "read as" not in lutgen.fit("lab:62,25,25").notes[0]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: lutgen.fit("#b89985", "melanin"), "parameters = 'm': allowed is melanin, hemoglobin"),
        (lambda: lutgen.fit("#b89985", ()), "parameters = '': each once is needed"),
        (lambda: lutgen.fit("#b89985", ("melanin", "melanin")), "each once is needed"),
        (lambda: lutgen.fit("#b89985", NAMES), "a color has three numbers, which tell three at most"),
        (
            lambda: lutgen.fit("#b89985", base="light"),  # pyright: ignore
            "base = 'light': a lutgen.Skin is needed",
        ),
        (lambda: lutgen.fit("#b89985", noise=0), "noise = 0: allowed is 0.001 to 20"),
        (lambda: lutgen.fit((NM, NM / 2000), noise=0.5), "noise = 0.5: allowed is 1e-06 to 0.1"),
        (lambda: lutgen.fit((NM[:3], NM[:3] / 2000)), "3 wavelengths: 3 parameters need at least 4"),
        (lambda: lutgen.fit((NM[:2], NM[:2] / 2000), noise=0.01), "2 wavelengths: 3 parameters need at least 3"),
    ],
)
def test_bad_input_is_named(call, message):
    with pytest.raises(lutgen.InputError) as error:
        call()
    assert message in str(error.value)


def test_descents_stay_in_their_box_and_end_at_the_least():
    """Rosenbrock's valley with its end inside the box, and cut off by it (then the least lies on the wall)."""

    def valley(x):
        return np.column_stack([10 * (x[:, 1] - x[:, 0] ** 2), 1 - x[:, 0]])

    start = np.array([-1.2, 0.9])
    inside = least_squares.minimize(valley, start, np.array([-2.0, -2]), np.array([2.0, 2]))
    assert np.abs(inside - 1).max() < 1e-8
    wall = least_squares.minimize(valley, np.array([-1.2, 0.4]), np.array([-2.0, -2]), np.array([0.5, 2]))
    assert wall == pytest.approx([0.5, 0.25], abs=1e-8)
    assert wall[0] == 0.5
