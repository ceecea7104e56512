"""What a frame costs: passes on a clock, and against a head without any of this."""

import importlib
import json
import time
from dataclasses import replace

import numpy as np
import pytest

import lutgen
from lutgen.cli import main
from lutgen.files.texture_maps import Maps
from lutgen.head import builtin, paint
from lutgen.scene import look as looks
from lutgen.scene.look import Look

app, clock, gl, passes, plain, timing, stages = (
    importlib.import_module(f"lutgen.viewer.{n}")
    for n in ("app", "measure.clock", "gl", "passes", "measure.plain", "measure.timing", "stage")
)
PASSES = ["shadow", "surface", "scattering", "composition"]


@pytest.fixture(scope="module")
def stage():
    opened = app.open_stage(lutgen.load(), builtin.builtin(), Maps(), (160, 90))
    yield opened
    stages.release(opened)


def test_passes_are_timed_and_add_up_to_the_frame(stage):
    shares = []
    for _ in range(6):
        since = time.perf_counter()
        passes.draw(stage, Look())
        gl.context().finish()
        wall = 1000 * (time.perf_counter() - since)
        assert list(stage.milliseconds) == PASSES
        assert min(stage.milliseconds.values()) > 0
        shares.append(sum(stage.milliseconds.values()) / wall)
    assert max(shares) <= 1
    if clock.is_software():  # on a GPU the frame waits for the processor too; here the first one compiles shaders
        assert max(shares) > 0.8


def test_the_shadow_is_cast_again_only_where_the_light_moved(stage):
    look = Look(light_azimuth=70.0)
    first = app.picture(stage, look)
    stage.targets["shadow_buffer"].clear(depth=0.0)  # all in shadow, until it is cast again
    dark = app.picture(stage, look)
    assert dark.mean() < first.mean() - 2
    assert np.array_equal(
        app.picture(stage, replace(look, melanin=0.1)), app.picture(stage, replace(look, melanin=0.1))
    )
    assert np.array_equal(app.picture(stage, look), dark)
    app.picture(stage, replace(look, light_azimuth=71.0))
    assert np.array_equal(app.picture(stage, look), first)
    stages.resize(stage, (96, 64))
    stages.resize(stage, (160, 90))
    assert np.array_equal(app.picture(stage, look), first)


def test_what_takes_longer_is_told_to_take_longer(stage):
    taken = {}
    for tier in ("off", "reference"):
        passes.draw(stage, Look(tier=tier))
        taken[tier] = stage.milliseconds["scattering"]
    assert taken["reference"] > 5 * taken["off"]


@pytest.mark.parametrize("software", [True, False])
def test_a_clock_forgets_the_last_frame(software):
    timer = clock.open_clock(software)
    for name in PASSES[:2]:
        clock.start(timer)
        with clock.timed(timer, name):
            time.sleep(0.005)
        assert list(clock.milliseconds(timer)) == [name]
        assert 5 <= clock.milliseconds(timer)[name] < 1000 or not software
    clock.release(timer)
    assert not clock.milliseconds(timer)
    gl.check()


def test_queries_are_handed_on():
    """moderngl never deletes a query: the next clock must take those of the one before."""
    held = []
    for _ in range(3):
        timer = clock.open_clock(software=False)
        for name in PASSES:
            with clock.timed(timer, name):
                pass
        held.append({id(query) for query in timer.queries.values()})
        assert len(held[-1]) == len(PASSES)
        clock.release(timer)
    assert held[0] == held[1] == held[2]


@pytest.fixture(scope="module")
def painted():
    """The built-in head with its maps: freckles, blotches, thin ears."""
    shape = builtin.builtin()
    stage = app.open_stage(lutgen.load(), shape, Maps(**paint.paint(shape)), (160, 160))
    yield stage
    stages.release(stage)


@pytest.mark.parametrize("preset", ["light", "tan", "dark"])
def test_a_plain_head_is_the_same_picture_without_scattering(painted, preset):
    """What the bench divides by draws the head, its maps and its lights; only translucency and scattering are gone.

    The colors lie in 8 bits, and are filtered after the LUT instead of before: a display value or two, more only where
    the maps change within a pixel (hairs).
    """
    look = looks.of_preset(preset, replace(Look(), tier="off", transmission=0.0, distance_mm=500.0))
    game = plain.open_plain(painted, look)
    plain.draw(painted, game, look)
    assert list(painted.milliseconds) == ["shadow", "surface", "composition"]
    drawn = passes.pixels(painted).astype(int)
    plain.release(game)
    expected = app.picture(painted, look).astype(int)
    assert np.abs(drawn - expected).mean() < 0.5
    assert np.percentile(np.abs(drawn - expected), 95) <= 2
    other = app.picture(painted, replace(look, melanin=1.2 * look.melanin)).astype(int)
    assert np.abs(other - expected).mean() > 0.5


def test_a_baked_color_is_the_luts(painted):
    look = Look(melanin=0.03, oxygenation=0.4)
    game = plain.open_plain(painted, look)
    held = np.frombuffer(game.albedo.read(), "u1").reshape(*game.albedo.size[::-1], 4)[..., :3] / 255
    ratio = np.frombuffer(painted.maps["chromophores"].read(), "f2").astype(float).reshape(*held.shape[:2], -1)
    plain.release(game)
    fade = passes.skin_of(painted, look)["contrast"]
    rows = slice(None, None, 37), slice(None, None, 41)
    m, e, h = (look.melanin * ratio[rows][..., 0] ** fade[0], look.eumelanin * ratio[rows][..., 1],
               look.hemoglobin * ratio[rows][..., 2] ** fade[1])  # fmt: skip
    expected = lutgen.load().expand(oxygenation=0.4).color(m, e, h, space="acescg")
    assert np.abs(held[rows] - expected).max() < 0.5 / 255 + 2e-3
    assert held[rows].std(axis=(0, 1)).min() > 0.005  # blotches and freckles are in it


def test_tiers_take_turns_with_plain_frames(painted, monkeypatch):
    drawn = []
    monkeypatch.setattr(plain, "draw", lambda *_: drawn.append("plain"))
    monkeypatch.setattr(passes, "draw", lambda stage, look: drawn.append(look.tier))
    monkeypatch.setattr(timing, "_frame", lambda stage, draw: draw() or {"surface": 1.0 + len(drawn)})
    timing.costs(painted, Look(), ("off", "low", "high"), rounds=2)
    assert drawn == [name for first in (["off", "low", "high"], ["low", "high", "off"], ["high", "off", "low"])
                     for name in ["plain", *(n for tier in first for n in (tier, "plain"))]]  # fmt: skip


def test_a_ratio_is_a_frame_over_the_plain_ones_beside_it(painted, monkeypatch):
    """A machine that gets slower all the time: the frames' own times double, their ratios stay."""
    speed = iter(1 + 0.05 * np.arange(99))

    monkeypatch.setattr(plain, "draw", lambda *_: 1.0)
    monkeypatch.setattr(passes, "draw", lambda *_: 3.0)
    monkeypatch.setattr(timing, "_frame", lambda stage, draw: {"surface": next(speed) * draw()})
    game, (off,) = timing.costs(painted, Look(), ("off",), rounds=9)
    assert off.ratio == pytest.approx(3, rel=1e-9)
    assert off.ratios == pytest.approx((3, 3), rel=1e-9)
    assert game.ratio == 1


def test_bench_prints_passes_tiers_and_ratios(capsys, monkeypatch):
    monkeypatch.setattr(timing, "ROUNDS", 2)
    assert main(["bench", "--viewer", "--json", "--size", "96x64"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["size"] == [96, 64]
    assert list(told["tiers"]) == list(looks.TIERS)
    assert list(told["plain"]["milliseconds"]) == [name for name in PASSES if name != "scattering"]
    for tier, cost in told["tiers"].items():
        assert list(cost["milliseconds"]) == PASSES
        assert cost["taps"] == passes.TAPS[tier]
        assert cost["ratios"][0] <= cost["ratio"] <= cost["ratios"][1]
        assert cost["total"] > 0
    assert told["tiers"]["reference"]["frames"] == passes.REFERENCE_FRAMES
    assert told["oxygenation_ms"] > 0
    monkeypatch.setattr(timing, "report", lambda *_, progress: told)
    assert main(["bench", "--viewer"]) == 0
    table = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in table[2:8]] == ["plain", *looks.TIERS]
    assert table[4].split()[-1] == f"{told['tiers']['low']['ratio']:.2f}"


@pytest.mark.parametrize(("arguments", "message"), [
    (["--size", "640x360"], "add --viewer"), (["--viewer", "--size", "9x9"], "allowed is 16 to 4096"),
])  # fmt: skip
def test_a_bad_size_is_one_line(arguments, message, capsys):
    assert main(["bench", *arguments]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
