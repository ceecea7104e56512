"""How a shader finds a value in the tables: the warp of an axis as text, in each language that reads them.

`Axis.warp`, `Axis.unwarp` and `Axis.coordinate` are the same over arrays; every shader, page and file header takes its
formula from here.
"""

from __future__ import annotations

from lutgen.tables.axes import Axis, Grid

_SPELLING = {
    "glsl": {}, "gdshader": {}, "hlsl": {"mix": "lerp", "vec3": "float3"},
    "js": {name: f"Math.{name}" for name in ("log", "exp", "pow", "sqrt")}, "text": {},
}  # fmt: skip
"""What a language calls otherwise than GLSL; `text` is for people, in headers and README files."""


def warp(axis: Axis, value: str, language: str = "glsl") -> str:
    """Expression of t in 0 to 1 of a value within the axis; 0.5, the center of its texel, for a fixed parameter.

    >>> warp(Axis("melanin", "1", 0.001, 0.5, 16, "cbrt"), "m"), warp(Axis("eumelanin", "1", 0.0, 1.0, 8), "e")
    ('(pow(m, 0.333333333) - 0.1) / 0.693700526', '(e - 0.0) / 1.0')
    """
    if axis.count == 1:
        return "0.5"
    p, (a, b) = axis.exponent, axis.ends
    named = {0.0: ("log", value), 0.5: ("sqrt", value)}.get(p, ("pow", value, _number(p, language)))
    even = value if p == 1 else _call(language, *named)
    return f"({even} - {_number(a, language)}) / {_number(b - a, language)}"


def unwarp(axis: Axis, t: str, language: str = "glsl") -> str:
    """Expression of the value at t in 0 to 1.

    >>> unwarp(Axis("melanin", "1", 0.001, 0.5, 16, "cbrt"), "t", "js")
    'Math.pow(0.1 + 0.693700526 * t, 3)'
    """
    if axis.count == 1:
        return _number(axis.low, language)
    p, (a, b) = axis.exponent, axis.ends
    even = f"{_number(a, language)} + {_number(b - a, language)} * {t}"
    if p == 1:
        return even
    return _call(language, "exp", even) if p == 0 else _call(language, "pow", even, _number(1 / p, language))


def texel(t: str, count: int | str) -> str:
    """Expression of the texture coordinate of t in 0 to 1: its ends are the centers of the outer texels.

    >>> texel("t", 16), texel("t", "n")
    ('(t * 15 + 0.5) / 16', '(t * (n - 1) + 0.5) / n')
    """
    last = f"({count} - 1)" if isinstance(count, str) else count - 1
    return f"({t} * {last} + 0.5) / {count}"


def coordinate(axis: Axis, value: str, language: str = "glsl") -> str:
    """Expression of the texture coordinate of a value, clamped to the axis.

    >>> coordinate(Axis("eumelanin", "1", 0.0, 1.0, 8), "v", "hlsl")
    'lerp(0.0625, 0.9375, (clamp(v, 0.0, 1.0) - 0.0) / 1.0)'
    """
    if axis.count == 1:
        return "0.5"
    ends = (_number(float(axis.coordinate(end)), language) for end in (axis.low, axis.high))
    clamped = _call(language, "clamp", value, _number(axis.low, language), _number(axis.high, language))
    return _call(language, "mix", *ends, warp(axis, clamped, language))


def axis_function(axis: Axis, prefix: str, language: str = "glsl") -> str:
    """Function PREFIX_NAME(value): the texture coordinate of a value, clamped to the axis; in HLSL a macro.

    >>> print(axis_function(Axis("melanin", "1", 0.5, 0.5, 1), "color"))
    float color_melanin(float value) { return 0.5; }
    """
    return _function(language, f"float {prefix}_{axis.name}", "float value", coordinate(axis, "value", language))


def grid_functions(grid: Grid, prefix: str, language: str = "glsl") -> str:
    """Where a skin (melanin, eumelanin, hemoglobin) lies in a texture over a grid.

    Counts of nodes PREFIX_COUNT, a function PREFIX_AXIS(value) per axis, and PREFIX_coordinates(skin) of all three; in
    HLSL macros, for an engine may paste the text into a function, where none can be defined.

    >>> from lutgen.tables.axes import default_grid
    >>> print(grid_functions(default_grid(4, 3, 2), "color").splitlines()[0])
    const ivec3 color_COUNT = ivec3(4, 3, 2);
    """
    axes = grid.axes[::-1]
    counts = ", ".join(str(axis.count) for axis in axes)
    count = f"#define {prefix}_COUNT int3({counts})" if language == "hlsl" else (
        f"const ivec3 {prefix}_COUNT = ivec3({counts});")  # fmt: skip
    places = [f"{prefix}_{axis.name}((skin).{letter})" for axis, letter in zip(axes, "xyz", strict=True)]
    coordinates = _function(language, f"vec3 {prefix}_coordinates", "vec3 skin", _call(language, "vec3", *places))
    return "\n".join([count, *(axis_function(axis, prefix, language) for axis in axes), coordinates])


def javascript(grid: Grid) -> str:
    """An object by axis name: its ends `low` and `high`, and the functions `warp` and `unwarp` between value and t.

    >>> from lutgen.tables.axes import default_grid
    >>> print(javascript(default_grid(4, 3, 2)).splitlines()[2])
      eumelanin: { low: 0, high: 1, warp: (value) => (value - 0) / 1, unwarp: (t) => 0 + 1 * t },
    """
    lines = [
        f"  {axis.name}: {{ low: {_number(axis.low, 'js')}, high: {_number(axis.high, 'js')}, "
        f"warp: (value) => {warp(axis, 'value', 'js')}, unwarp: (t) => {unwarp(axis, 't', 'js')} }},"
        for axis in grid.axes[::-1]
    ]
    return "\n".join(["{", *lines, "}"])


def formulas(grid: Grid) -> dict[str, str]:
    """The warp of each axis by its name, as headers, README files and metadata state it.

    >>> from lutgen.tables.axes import default_grid
    >>> formulas(default_grid(4, 3, 2))["melanin"]
    't = (pow(melanin, 0.333333333) - 0.1) / 0.693700526'
    """
    return {
        axis.name: f"t = {warp(axis, axis.name, 'text')}"
        + f" ({axis.name} is {axis.low:.9g} throughout)" * (axis.count == 1)
        for axis in grid.axes[::-1]
    }


def _number(value: float, language: str) -> str:
    """A number to single precision; a shader's has a point even where it is whole."""
    digits = f"{value:.9g}"
    return digits if language in ("js", "text") or "." in digits or "e" in digits else f"{digits}.0"


def _call(language: str, function: str, *arguments: str) -> str:
    return f"{_SPELLING[language].get(function, function)}({', '.join(arguments)})"


def _function(language: str, head: str, parameter: str, expression: str) -> str:
    """A function `head` (type and name) of one parameter (type and name) that returns an expression."""
    if language == "hlsl":
        return f"#define {head.split()[1]}({parameter.split()[1]}) {expression}"
    return f"{head}({parameter}) {{ return {expression}; }}"
