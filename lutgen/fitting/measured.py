"""What an instrument saw of a skin: a reflectance spectrum from a CSV, or a color."""

from __future__ import annotations

import csv
import io
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lutgen import color
from lutgen.errors import InputError, numbers, shown, summary
from lutgen.skin.chromophores import WAVELENGTH_NM

COLUMNS = ("wavelength_nm", "reflectance")
GRAMMAR = "#rrggbb, srgb:r,g,b (0 to 1, encoded), linear:r,g,b (linear sRGB), lab:L,a,b or xyz:X,Y,Z (Y of white 1)"
_RANGES = {
    "srgb": ((0, 1),) * 3, "linear": ((0, 1),) * 3, "lab": ((0, 100), (-150, 150), (-150, 150)), "xyz": ((0, 1.1),) * 3,
}  # fmt: skip
_HEX = re.compile(r"#?([0-9a-fA-F]{6})")
_SPACE = re.compile(r"\s*([a-zA-Z]+)\s*:(.*)", re.DOTALL)


@dataclass(frozen=True)
class Measured:
    """A color under D65 and, where it was measured, the reflectance [n] at ascending wavelengths [n] in nm.

    `xyz` [3] relative to white. `space`: what it was given as, `spectrum` or a color's. `notes`: what was not read.
    """

    xyz: np.ndarray
    space: str
    wavelength_nm: np.ndarray | None = None
    reflectance: np.ndarray | None = None
    notes: tuple[str, ...] = ()

    __repr__ = summary


def read(source) -> Measured:
    """Read a CSV's path, a color in words (GRAMMAR) or a pair (wavelengths in nm [n], reflectance [n]).

    Raises InputError that names what is wrong.

    >>> read("lab:65,12,17").xyz.round(3).tolist()
    [0.358, 0.34, 0.251]
    """
    if isinstance(source, Measured):
        return source
    if isinstance(source, (str, Path)):
        text = str(source)
        if not text.strip():
            raise InputError(f"measured = {text!r}: a CSV's path or a color is needed: {GRAMMAR}")
        code, named = _HEX.fullmatch(text.strip()), _SPACE.fullmatch(text)
        if code and (text.strip().startswith("#") or not Path(text).exists()):
            return of_color("srgb", np.array(list(bytes.fromhex(code[1]))) / 255)
        if named and named[1].lower() in _RANGES:
            return of_color(named[1].lower(), _three(text, named[2]))
        if text.strip().startswith("#"):
            raise InputError(f"color = {shown(text)}: six hexadecimal digits are needed; allowed is {GRAMMAR}")
        return _from_csv(Path(text))
    try:
        nm, reflectance = source
    except (TypeError, ValueError):
        raise InputError(f"measured = {shown(source)}: a CSV's path, a color or (wavelength_nm, reflectance)") from None
    return spectrum(nm, reflectance)


def spectrum(wavelength_nm, reflectance, notes: tuple[str, ...] = (), where: str = "") -> Measured:
    """A measured spectrum, sorted; InputError for NaN, values outside 0 to 1, wavelengths outside 380 to 780 or twice.

    >>> spectrum([700, 400], [0.5, 0.2]).wavelength_nm.tolist()
    [400.0, 700.0]
    """
    nm, values = numbers("wavelength_nm", wavelength_nm), numbers("reflectance", reflectance)
    if nm.ndim != 1 or nm.shape != values.shape:
        raise InputError(f"{where}wavelength_nm {nm.shape} and reflectance {values.shape}: two equal lists are needed")
    if not len(nm):
        raise InputError(f"{where}the spectrum is empty: rows of wavelength_nm and reflectance are needed")
    order = np.argsort(nm, kind="stable")
    nm, values = nm[order], values[order]
    low, high = WAVELENGTH_NM
    outside = ~((nm >= low) & (nm <= high))
    if outside.any():
        raise InputError(
            f"{where}wavelength_nm = {nm[outside][0]:g} ({outside.sum()} of {len(nm)} rows): "
            f"allowed is {low:g} to {high:g}; leave the others out"
        )
    twice = np.diff(nm) == 0
    if twice.any():
        raise InputError(
            f"{where}wavelength_nm = {nm[1:][twice][0]:g} stands there twice: one value each; average them"
        )
    wrong = ~((values >= 0) & (values <= 1))
    if wrong.any():
        wrong_nm, worst = nm[wrong][0], np.nanmax(values) if np.isfinite(values).any() else np.nan
        percent = np.all(values >= 0) and 2 < worst <= 100
        advice = "they look like percent: divide by 100" if percent else "mend or leave out such rows"
        raise InputError(
            f"{where}reflectance = {values[wrong][0]:g} at {wrong_nm:g} nm ({wrong.sum()} of {len(nm)} rows): allowed "
            f"is 0 to 1; {advice}"
        )
    return Measured(values @ color_weights(nm), "spectrum", nm, values, notes)


def color_weights(wavelength_nm: np.ndarray) -> np.ndarray:
    """XYZ weights [n, 3] of a spectrum sampled at ascending wavelengths [n]: linear between them, its ends held.

    Holding the ends gives their weight to what was not measured (ASTM E308). Where three samples or more lie within
    5 nm of a node of the color table, they are averaged.

    >>> nm, weights = color.xyz_weights(5)
    >>> bool(np.allclose(color_weights(nm), weights))
    True
    """
    nm5, weights = color.xyz_weights(5)
    above = np.clip(np.searchsorted(wavelength_nm, nm5), 1, max(len(wavelength_nm) - 1, 1))
    below, above = above - 1, np.minimum(above, len(wavelength_nm) - 1)
    gap = np.maximum(wavelength_nm[above] - wavelength_nm[below], 1e-300)
    share = np.clip((nm5 - wavelength_nm[below]) / gap, 0, 1)
    across = np.zeros((len(nm5), len(wavelength_nm)))
    row = np.arange(len(nm5))
    across[row, below] += 1 - share
    across[row, above] += share
    near = np.maximum(1 - np.abs(nm5[:, None] - wavelength_nm) / 5, 0)
    dense = (near > 0).sum(axis=1) > 2
    if dense.any():
        near = near[dense] * np.gradient(wavelength_nm)
        across[dense] = near / near.sum(axis=1, keepdims=True)
    return across.T @ weights


def _three(text: str, cells: str) -> np.ndarray:
    try:
        values = np.array([float(cell) for cell in cells.split(",")])
    except ValueError:
        values = np.empty(0)
    if len(values) != 3:
        raise InputError(f"color = {shown(text)}: three numbers with commas are needed; allowed is {GRAMMAR}")
    return values


def of_color(space: str, values: np.ndarray) -> Measured:
    """A color [3] in the space `srgb` (encoded, 0 to 1), `linear`, `lab` or `xyz`; InputError outside its range.

    >>> of_color("linear", np.ones(3)).xyz.round(4).tolist()
    [0.9505, 1.0, 1.0891]
    """
    for letter, value, (low, high) in zip({"lab": "Lab", "xyz": "XYZ"}.get(space, "rgb"), values, _RANGES[space],
                                          strict=True):  # fmt: skip
        if not low <= value <= high:
            advice = "; divide by 255, or write #rrggbb" if space == "srgb" and 1 < values.max() <= 255 else ""
            raise InputError(f"color {space}: {letter} = {value:g}: allowed is {low:g} to {high:g}{advice}")
    if space == "lab":
        return Measured(color.from_lab(values), space)
    if space == "xyz":
        return Measured(values, space)
    linear = color.decode_srgb(values) if space == "srgb" else values
    return Measured(color.to_xyz(linear), space)


def _from_csv(path: Path) -> Measured:
    """The spectrum in a CSV; `#` starts a comment, commas, semicolons or tabs part columns, other columns are noted."""
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(
            f"{path}: not text in UTF-8; save it as a CSV in UTF-8 with columns {', '.join(COLUMNS)}"
        ) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(
            f"{shown(str(path))}: cannot be read ({reason}); a CSV's path or a color is needed: {GRAMMAR}"
        ) from None
    kept = [(i, line) for i, line in enumerate(text.splitlines(), 1) if line.strip() and line.strip()[0] != "#"]
    if not kept:
        raise InputError(f"{path}: empty; a CSV with columns {', '.join(COLUMNS)} is needed")
    part = next((mark for mark in "\t;" if mark in kept[0][1]), ",")
    try:
        lines = io.StringIO("\n".join(line for _, line in kept))
        header, *rows = csv.reader(lines, delimiter=part, skipinitialspace=True)
    except csv.Error as error:
        raise InputError(f"{path}: no CSV ({error}); columns {', '.join(COLUMNS)} are needed") from None
    names = [name.strip().lower() for name in header]
    for column in COLUMNS:
        if names.count(column) != 1:
            fault = "twice" if names.count(column) else "missing"
            raise InputError(f"{path}: column {column} is {fault}; the header is {shown(', '.join(header))}")
    places = [names.index(column) for column in COLUMNS]
    values = []
    for (line, _), row in zip(kept[1:], rows, strict=False):
        try:
            values.append([float(row[place]) for place in places])
        except (ValueError, IndexError):
            raise InputError(
                f"{path}, line {line}: {shown(part.join(row))} lacks a number (with a decimal point) in a column"
            ) from None
    extra = [name for name in names if name and name not in COLUMNS]
    notes = (f"columns not read: {', '.join(extra)}",) if extra else ()
    nm, reflectance = np.array(values).reshape(-1, 2).T
    return spectrum(nm, reflectance, notes, f"{path}: ")
