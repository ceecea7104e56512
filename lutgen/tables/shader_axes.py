"""Shader text made from the axes, so that value and texture coordinate are related in one place; no OpenGL here."""

from __future__ import annotations

import numpy as np

from lutgen.tables.axes import Axis, Grid


def axis_function(axis: Axis, prefix: str) -> str:
    """GLSL `float PREFIX_NAME(float value)`: the texture coordinate of a value, clamped to the axis.

    >>> from lutgen.tables.axes import Axis
    >>> print(axis_function(Axis("melanin", "1", 0.5, 0.5, 1), "color"))
    float color_melanin(float value) { return 0.5; }
    """
    name = f"float {prefix}_{axis.name}(float value)"
    if axis.count == 1:
        return f"{name} {{ return 0.5; }}"
    low, high = (float(axis.coordinate(end)) for end in (axis.low, axis.high))
    ends = np.array([axis.low, axis.high])
    p = axis.exponent
    a, b = np.log(ends) if p == 0 else ends**p
    warped = "log(value)" if p == 0 else "value" if p == 1 else f"pow(value, {_number(p)})"
    return (
        f"{name} {{\n"
        f"    value = clamp(value, {_number(axis.low)}, {_number(axis.high)});\n"
        f"    return mix({_number(low)}, {_number(high)}, ({warped} - {_number(a)}) / {_number(b - a)});\n"
        "}"
    )


def grid_functions(grid: Grid, prefix: str) -> str:
    """The functions of a grid's axes, and their counts as PREFIX_COUNT (melanin, eumelanin, hemoglobin).

    >>> from lutgen.tables.axes import default_grid
    >>> print(grid_functions(default_grid(4, 3, 2), "color").splitlines()[0])
    const ivec3 color_COUNT = ivec3(4, 3, 2);
    """
    axes = grid.melanin, grid.eumelanin, grid.hemoglobin
    counts = ", ".join(str(axis.count) for axis in axes)
    return "\n".join([f"const ivec3 {prefix}_COUNT = ivec3({counts});", *(axis_function(a, prefix) for a in axes)])


def _number(value: float) -> str:
    text = f"{float(value):.9g}"
    return text if any(c in text for c in ".e") else f"{text}.0"
