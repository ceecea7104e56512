"""The two ways to fail: what the user gave is wrong (exit status 2), or the machine cannot do it (exit status 1)."""

import operator


class InputError(ValueError):
    """A parameter, file or option is wrong; the message names it, its value, what is allowed and what to do.

    >>> import lutgen
    >>> lutgen.preset("pale")
    Traceback (most recent call last):
    ...
    lutgen.errors.InputError: preset = 'pale': allowed is very-light, light, intermediate, tan, brown, dark, ...
    """


class MachineError(RuntimeError):
    """The machine lacks something (OpenCL, disk space); the message names it and says what to install or free.

    >>> import lutgen
    >>> issubclass(lutgen.MachineError, RuntimeError)
    True
    """


def in_range(name: str, value: object, low: float, high: float, unit: str = "") -> float:
    """Return `value` as a float in [low, high]; raise InputError that names it otherwise (NaN included)."""
    if isinstance(value, bool) or (not isinstance(value, (int, float)) and not hasattr(value, "__float__")):
        raise InputError(f"{name} = {value!r}: a number in {low:g} to {high:g}{unit} is needed")
    number = float(value)  # type: ignore[arg-type]
    if not low <= number <= high:
        raise InputError(f"{name} = {number:g}: allowed is {low:g} to {high:g}{unit}")
    return number


def one_of(name: str, value: object, allowed: "tuple[str, ...] | list[str]") -> str:
    """Return `value` if it is one of `allowed`; raise InputError that lists them otherwise."""
    if value not in allowed:
        raise InputError(f"{name} = {value!r}: allowed is {', '.join(allowed)}")
    return str(value)


def whole(name: str, value: object, low: int, high: int) -> int:
    """Return `value` if it is a whole number in [low, high]; raise InputError that names it otherwise."""
    try:
        number = operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        number = None
    if number is None or isinstance(value, bool) or not low <= number <= high:
        raise InputError(f"{name} = {value!r}: allowed is a whole number {low} to {high}")
    return number
