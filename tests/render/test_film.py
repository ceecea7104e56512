"""Pictures that grow: the same sums however launches are cut, honest noise, a file that a later run goes on with."""

from dataclasses import replace

import numpy as np
import pytest
from rendering import PHOTONS, SUN, ball, opened, sampled

import lutgen
from lutgen import color
from lutgen.render import film, flat_walk, goal, progressive

LOOK = replace(SUN, environment=0.85, target_mm=(0, 0, 0), distance_mm=500, light_azimuth=40.0, specular=1)
LIGHT_SUN = replace(LOOK, light=3.0)


@pytest.fixture(scope="module")
def scene():
    return opened(ball(80.0), LIGHT_SUN)


@pytest.fixture(scope="module")
def walk(scene):
    return flat_walk.flat(scene, photons=PHOTONS)


def test_sums_do_not_depend_on_how_launches_are_cut(scene, walk, monkeypatch):
    whole, counts = sampled(scene, walk, 105)
    monkeypatch.setattr(progressive, "LAUNCH_SECONDS", 0.002)
    cut, again = sampled(scene, walk, 105)
    assert np.array_equal(whole.sums, cut.sums)
    assert counts == again
    assert whole.samples == 105


def test_a_run_that_goes_on_is_one_run(scene, walk, tmp_path):
    """From the file, in single precision: means to 1e-6 of the picture's."""
    straight, _ = sampled(scene, walk, 60)
    first, _ = sampled(scene, walk, 25)
    film.write(first, tmp_path / "a.exr")
    found = film.read(tmp_path / "a.exr")
    assert found.samples == 25
    made, _, _ = progressive.render(scene, walk, found, progressive.Goal(60), lambda one, noise: None)
    assert made.samples == 60
    assert np.abs(made.rgb - straight.rgb).max() < 1e-6 * straight.rgb.max()
    assert np.abs(made.sigma() - straight.sigma()).max() < 1e-4 * straight.sigma().max()
    done, _, _ = progressive.render(scene, walk, made, progressive.Goal(60), lambda one, noise: None)
    assert np.array_equal(done.sums, made.sums)


def test_the_stated_error_is_the_error_between_seeds(walk):
    """Over pixels, the difference of two renders over both sigmas has variance 1; its color difference is the noise."""
    made = []
    for seed in (1, 2):
        stage = opened(ball(80.0), LIGHT_SUN, (64, 64), seed=seed)
        made.append(sampled(stage, replace(walk, scene=stage), 100)[0])
    one, two = made
    inside = (one.mask == 1) & (two.mask == 1) & (one.sigma().min(axis=-1) > 0)
    apart = (one.rgb - two.rgb)[inside] / np.hypot(one.sigma(), two.sigma())[inside]
    count = len(apart)
    assert count > 500
    assert np.abs((apart**2).mean(axis=0) - 1).max() < 0.25  # 20 estimates a pixel: Student's t has variance 19 / 17
    assert np.abs(apart.mean(axis=0)).max() < 4 / np.sqrt(count)
    labs = [color.lab(color.from_acescg(v.rgb[inside], "xyz")) for v in made]
    assert color.delta_e00(*labs).mean() / np.sqrt(2) == pytest.approx(film.noise_delta_e(one), rel=0.12)


def test_noise_falls_with_samples_and_is_unknown_of_one(scene, walk):
    one, _ = sampled(scene, walk, 5)
    assert film.noise_delta_e(one) == np.inf
    assert np.all(np.isfinite(one.sigma()))
    assert np.allclose(one.sigma(), one.rgb, atol=1e-6)
    few, many = (film.noise_delta_e(sampled(scene, walk, n)[0]) for n in (50, 200))
    assert 1.6 < few / many < 2.5
    made, _, noise = progressive.render(
        scene, walk, film.empty(scene.size, walk.group, {}), progressive.Goal(noise=2.5), lambda made, noise: None
    )
    assert noise <= 2.5
    assert made.samples < 10_000


def test_a_noise_that_is_met_already_asks_for_nothing(scene, walk):
    made, _, noise = progressive.render(
        scene, walk, film.empty(scene.size, walk.group, {}), progressive.Goal(noise=2.5), lambda made, noise: None
    )
    again, tally, same = progressive.render(scene, walk, made, progressive.Goal(noise=2.5), lambda made, noise: None)
    assert (again.samples, tally.rays, same) == (made.samples, 0, noise)


def test_noise_of_a_head_smaller_than_its_pixels_is_known(scene, walk):
    made, _ = sampled(scene, walk, 50)
    part = replace(made, sums=made.sums * np.array([0.3] * 4 + [0.09] * 6))
    assert film.noise_delta_e(part) > 0.1


def test_it_stops_by_time_and_when_told_and_saves_what_it_has(scene, walk):
    saved = []
    start = film.empty(scene.size, walk.group, {})
    made, tally, _ = progressive.render(
        scene, walk, start, progressive.Goal(seconds=0.1), lambda made, noise: saved.append(made.samples)
    )
    assert saved == [made.samples]
    assert made.samples >= 5
    assert tally.rays == sum(tally.counts[name] for name in ("CAMERA_RAYS", "PROBES", "SUN_RAYS", "SKY_RAYS")) > 0
    asked = []

    def stopped() -> bool:
        asked.append(1)
        return len(asked) > 2

    made, _, _ = progressive.render(scene, walk, start, progressive.Goal(10**6), lambda *a: None, stopped)
    assert 10 <= made.samples < 10**6


def test_files_are_saved_meanwhile(scene, walk, monkeypatch):
    monkeypatch.setattr(progressive, "SAVE_SECONDS", 0.0)
    monkeypatch.setattr(progressive, "LAUNCH_SECONDS", 0.002)
    saved = []
    start = film.empty(scene.size, walk.group, {})
    progressive.render(scene, walk, start, progressive.Goal(200), lambda made, noise: saved.append(made.samples))
    assert len(saved) > 2
    assert saved == sorted(saved)
    assert saved[-1] == 200


def test_a_file_is_whole_or_as_it_was(scene, walk, tmp_path, monkeypatch):
    made, _ = sampled(scene, walk, 10)
    out = tmp_path / "a.exr"
    film.write(made, out)
    before = out.read_bytes()

    def full(*args, **more):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(film.exr, "write", full)
    with pytest.raises(lutgen.MachineError, match="No space left"):
        film.write(made, out)
    assert out.read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["a.exr"]


def test_what_is_no_render_is_one_line(tmp_path):
    from lutgen.files import exr

    exr.write(tmp_path / "a.exr", [exr.Part("x", exr.rgb(np.zeros((4, 4, 3), "f4")), {})])
    (tmp_path / "b.exr").write_bytes(b"nothing")
    for name in ("a.exr", "b.exr"):
        with pytest.raises(lutgen.InputError, match=r"not a whole picture of `lutgen render`; give another name"):
            film.read(tmp_path / name)


def test_goals_are_read_and_checked():
    assert goal.goal_of(None, None, None).samples == goal.DEFAULT_SAMPLES
    assert goal.goal_of(None, "90", None).seconds == 90
    assert goal.goal_of(7, "1.5h", 0.5) == goal.Goal(7, 5400, 0.5)
