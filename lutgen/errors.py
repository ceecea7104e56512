"""The two ways to fail: what the user gave is wrong (exit status 2), or the machine cannot do it (exit status 1)."""

from __future__ import annotations

import errno
import operator
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np


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


def missing(needed: str, extra: str) -> MachineError:
    """What to raise where an optional package is not there: `needed` says what needs which, `extra` brings it.

    >>> raise missing("charts need matplotlib", "charts")
    Traceback (most recent call last):
    ...
    lutgen.errors.MachineError: charts need matplotlib, which is missing: pip install "lutgen[charts]"
    """
    return MachineError(f'{needed}, which is missing: pip install "lutgen[{extra}]"')


def shown(value: object) -> str:
    """A value's repr, shortened to one line."""
    try:
        text = " ".join(repr(value).split())
    except ValueError:  # an integer of thousands of digits
        text = f"a {type(value).__name__} too long to print"
    return text if len(text) <= 60 else text[:57] + "..."


def summary(self) -> str:
    """The repr of a dataclass in a line of at most 200 characters: arrays by type and shape, no fields at defaults.

    >>> import lutgen
    >>> lutgen.preset("light")
    Skin(melanin=0.0195, eumelanin=0.7, hemoglobin=0.0088)
    """
    from dataclasses import MISSING, fields  # loads `inspect`, which no command needs before its work

    told = []
    for field in fields(self):
        value, factory = getattr(self, field.name), field.default_factory
        default = field.default if factory is MISSING else factory()
        if isinstance(shape := getattr(value, "shape", None), tuple) and hasattr(value, "dtype"):
            told.append(f"{field.name}={value.dtype}{list(shape)}" if shape else f"{field.name}={value.item()}")
        elif type(value) is not type(default) or value != default:
            told.append(f"{field.name}={shown(value)}")
    text = ", ".join(told)
    return f"{type(self).__name__}({text if len(text) <= 180 else text[:177] + '...'})"


def in_range(name: str, value: object, low: float, high: float, unit: str = "") -> float:
    """Return `value` as a float in [low, high]; raise InputError that names it otherwise (NaN included)."""
    try:
        if isinstance(value, (bool, str, bytes)):
            raise TypeError
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{name} = {shown(value)}: a number in {low:g} to {high:g}{unit} is needed") from None
    if not low <= number <= high:
        raise InputError(f"{name} = {number:g}: allowed is {low:g} to {high:g}{unit}")
    return number


def one_of(name: str, value: object, allowed: tuple[str, ...] | list[str]) -> str:
    """Return `value` if it is one of `allowed`; raise InputError that lists them otherwise."""
    if not isinstance(value, str) or value not in allowed:
        raise InputError(f"{name} = {shown(value)}: allowed is {', '.join(allowed)}")
    return str(value)


def whole(name: str, value: object, low: int, high: int) -> int:
    """Return `value` as an int if it is a whole number in [low, high]; raise InputError that names it otherwise."""
    try:
        number = operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        number = None
    if number is None or isinstance(value, bool) or not low <= number <= high:
        raise InputError(f"{name} = {shown(value)}: allowed is a whole number {low} to {high}")
    return number


def numbers(name: str, value: object) -> np.ndarray:
    """Return `value` as an array of floats; raise InputError that names it where it holds anything else."""
    import numpy as np  # here: an error of the command line must not take the time to import it

    try:
        return np.asarray(value, float)
    except (TypeError, ValueError):
        raise InputError(f"{name} = {shown(value)}: a number or an array of numbers is needed") from None


def cannot_write(name: str, path: str | Path, error: OSError) -> InputError | MachineError:
    """What to raise where writing failed: MachineError for a full disk, InputError for a path that does not take it."""
    reason = error.strerror or str(error)
    if error.errno in (errno.ENOSPC, errno.EDQUOT) or "No space left" in str(error):
        return MachineError(f"{name} = {path}: cannot be written ({reason}); free some space")
    return InputError(f"{name} = {path}: cannot be written ({reason}); choose another place")
