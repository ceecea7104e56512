"""What a frame costs: passes on a clock, and against a head without any of this."""

import importlib
import time

import pytest

import lutgen
from lutgen import head
from lutgen.maps import Maps
from lutgen.scene import Look

app, clock, gl, passes = (importlib.import_module(f"lutgen.viewer.{n}") for n in ("app", "clock", "gl", "passes"))
PASSES = ["shadow", "surface", "scattering", "composition"]


@pytest.fixture(scope="module")
def stage():
    made = app.open_stage(lutgen.load(), head.builtin(), Maps(), (160, 90))
    yield made
    passes.release(made)


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


def test_what_takes_longer_is_told_to_take_longer(stage):
    taken = {}
    for tier in ("off", "reference"):
        passes.draw(stage, Look(tier=tier))
        taken[tier] = stage.milliseconds["scattering"]
    assert taken["reference"] > 5 * taken["off"]


@pytest.mark.parametrize("software", [True, False])
def test_a_clock_forgets_the_last_frame(software):
    one = clock.open_clock(software)
    for name in PASSES[:2]:
        clock.start(one)
        with clock.timed(one, name):
            time.sleep(0.005)
        assert list(clock.milliseconds(one)) == [name]
        assert 5 <= clock.milliseconds(one)[name] < 1000 or not software
    clock.release(one)
    assert not clock.milliseconds(one)
    gl.check()


def test_queries_are_handed_on():
    """moderngl never deletes a query: the next clock must take those of the one before."""
    held = []
    for _ in range(3):
        one = clock.open_clock(software=False)
        for name in PASSES:
            with clock.timed(one, name):
                pass
        held.append({id(query) for query in one.queries.values()})
        assert len(held[-1]) == len(PASSES)
        clock.release(one)
    assert held[0] == held[1] == held[2]
