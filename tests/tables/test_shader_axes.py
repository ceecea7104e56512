"""The axes as shaders and pages have them: the emitted text, run here, is `Axis.warp`, `unwarp` and `coordinate`."""

import math
import re
from types import SimpleNamespace

import numpy as np
import pytest

from lutgen.tables import shader_axes
from lutgen.tables.axes import Axis

LANGUAGES = ("glsl", "gdshader", "hlsl", "js", "text")
AXES = (
    *(Axis("melanin", "1", 0.001, 0.5, 16, spacing) for spacing in ("linear", "cbrt", "log", "power:0.5", "power:0.2")),
    Axis("eumelanin", "1", 0.0, 1.0, 8), Axis("hemoglobin", "1", 0.02, 0.02, 1),
)  # fmt: skip


def mix(a, b, t):
    return a + (b - a) * t


def clamp(x, low, high):
    return min(max(x, low), high)


FUNCTIONS = {name: getattr(math, name) for name in ("log", "exp", "pow", "sqrt")}


def run(expression: str, language: str, **values) -> float:
    """A number that an expression gives by the functions that its language has, and no others."""
    named = {"Math": SimpleNamespace(**FUNCTIONS)} if language == "js" else dict(FUNCTIONS)
    named |= {"clamp": clamp, "lerp" if language == "hlsl" else "mix": mix}
    return eval(expression, {"__builtins__": {}}, named | values)


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("axis", AXES, ids=lambda axis: f"{axis.name}-{axis.spacing}")
def test_the_text_is_the_axis(axis, language):
    """To 9 digits: each constant is rounded by 5e-10 of itself, the power's times the logarithm of what it is of."""
    for t in np.linspace(0, 1, 11):
        value = float(axis.unwarp(np.array(t)))
        if axis.count > 1:
            assert run(shader_axes.warp(axis, "v", language), language, v=value) == pytest.approx(t, abs=2e-8)
        assert run(shader_axes.unwarp(axis, "t", language), language, t=t) == pytest.approx(value, rel=2e-8)
        coordinate = run(shader_axes.coordinate(axis, "v", language), language, v=value)
        assert coordinate == pytest.approx(float(axis.coordinate(value)), abs=2e-8)


@pytest.mark.parametrize("axis", AXES, ids=lambda axis: f"{axis.name}-{axis.spacing}")
def test_a_coordinate_is_clamped(axis):
    for value in (axis.low / 2, 2 * axis.high):
        coordinate = run(shader_axes.coordinate(axis, "v"), "glsl", v=value)
        assert coordinate == pytest.approx(float(axis.coordinate(value)), abs=2e-8)


def test_a_shaders_numbers_have_a_point():
    """`pow(value, 3)` is no GLSL."""
    for text in (shader_axes.coordinate(AXES[-2], "v"), shader_axes.unwarp(AXES[1], "t")):
        numbers = re.findall(r"[\d.]+", text)
        assert len(numbers) > 2
        assert all("." in digits for digits in numbers)
