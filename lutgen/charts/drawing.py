"""Charts on disk: each as SVG, PNG and the numbers behind it as CSV; the only matplotlib import.

Figures are made without pyplot, so no display, no window and no state of the process is touched. The same numbers
give the same SVG, byte for byte: its ids are salted, and it carries no date.
"""

from __future__ import annotations

import contextlib
import csv
import errno
import io
import os
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lutgen.errors import InputError, MachineError, missing
from lutgen.tables.axes import Axis

INK, GRAY, RULE = "#1a1a1a", "#595959", "#dddddd"
HUES = ("#0072b2", "#d55e00", "#009e73", "#a0457e", "#8a6d00", "#1a1a1a")
"""Line colors that color-blind readers tell apart (after Okabe & Ito 2008), dark enough for text on white."""
DASHES = ("-", (0, (6, 2)), (0, (2, 1.5)), (0, (7, 2, 1.5, 2)), (0, (4, 1, 1, 1, 1, 1)), (0, (10, 3)))
"""A dash per hue: no line is told from another by color alone."""
DPI = 110
_STYLE = {
    "font.family": "sans-serif", "font.sans-serif": ["DejaVu Sans"], "font.size": 9.5, "axes.titlesize": 10.5,
    "axes.titlelocation": "left", "axes.labelcolor": GRAY, "axes.edgecolor": GRAY, "axes.linewidth": 0.8,
    "axes.spines.top": False, "axes.spines.right": False, "xtick.color": GRAY, "ytick.color": GRAY,
    "text.color": INK, "axes.titlecolor": INK, "grid.color": RULE, "lines.linewidth": 1.8, "svg.hashsalt": "lutgen",
}  # fmt: skip


def _matplotlib():
    try:
        import matplotlib
        import matplotlib.figure
    except ImportError as error:
        raise missing("charts need matplotlib", "charts") from error
    return matplotlib


@contextlib.contextmanager
def figure(width: float, height: float, title: str, subtitle: str = "") -> Iterator:
    """A figure of that size in inches under the house style, its title and a line of explanation at the top left."""
    matplotlib = _matplotlib()
    plain = {key: value for key, value in matplotlib.rcParamsDefault.items() if key != "backend"}
    with matplotlib.rc_context(plain | _STYLE):  # type: ignore[arg-type]
        drawn = matplotlib.figure.Figure((width, height))
        drawn.text(0.18 / width, 1 - 0.15 / height, title, size=14, va="top")
        drawn.text(0.18 / width, 1 - 0.46 / height, subtitle, color=GRAY, va="top", linespacing=1.35)
        yield drawn


def inches(drawn, left: float, top: float, width: float, height: float):
    """Axes of a figure at a place in inches from its top left corner."""
    across, down = drawn.get_size_inches()
    return drawn.add_axes((left / across, 1 - (top + height) / down, width / across, height / down))


def apart(places: Sequence[float] | np.ndarray, least: float) -> np.ndarray:
    """The places moved as little as needed for every two to be `least` apart; their order stays.

    >>> apart([0.0, 0.1, 5.0], 1.0).tolist()
    [-0.45, 0.55, 5.0]
    """
    order = np.argsort(places, kind="stable")
    groups: list[tuple[float, int]] = []  # center of what is pushed together, and how many
    for place in np.asarray(places, float)[order]:
        center, count = float(place), 1
        while groups and center - least * count / 2 < groups[-1][0] + least * groups[-1][1] / 2:
            other, more = groups.pop()
            center, count = (center * count + other * more) / (count + more), count + more
        groups.append((center, count))
    moved = np.concatenate([center + least * (np.arange(count) - (count - 1) / 2) for center, count in groups])
    return moved[np.argsort(order, kind="stable")]


def label_ends(axes, x: float, labels: Sequence[tuple[float, str, str]], least: float, size: float = 9.0) -> None:
    """Write labels (y, words, color) right of x, moved apart where they would overlap, a thin line to each curve.

    `least` is the distance between two labels in the units of a linear y axis, or in decades of a logarithmic one.
    """
    log = axes.get_yscale() == "log"
    ends = np.array([y for y, _, _ in labels])
    moved = apart(np.log10(ends) if log else ends, least)
    for (y, words, color), place in zip(labels, 10**moved if log else moved, strict=True):
        placed = {"textcoords": ("offset points", "data"), "annotation_clip": False}
        line = {"arrowstyle": "-", "color": color, "linewidth": 0.7, "shrinkA": 0, "shrinkB": 2}
        ground = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}
        axes.annotate(words, (x, y), (16, place), color=color, size=size, va="center", bbox=ground, **placed)
        axes.annotate("", (x, y), (14, place), arrowprops=line, **placed)


def strip(axes, rgb: np.ndarray, words: str = "", fill: str = INK) -> None:
    """Fill axes with display colors [N, 3] from left to right, centers at 0, 1, 2 ...; the words stand left of them."""
    exact = np.round(255 * np.asarray(rgb)).astype("u1")[None]  # imshow cuts floats off instead of rounding them
    axes.imshow(exact, aspect="auto", interpolation="nearest")
    axes.set_axis_off()
    axes.text(-0.012, 0.5, words, transform=axes.transAxes, ha="right", va="center", color=fill)


def _borders(cells: np.ndarray, x_edges: np.ndarray, y_edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The borders of the cells [Y, X] that are set: x and y of line pieces, each ended by NaN."""
    row, column = np.nonzero(np.diff(np.pad(cells, ((0, 0), (1, 1))), axis=1))
    upright = x_edges[[column, column]], y_edges[[row, row + 1]]
    row, column = np.nonzero(np.diff(np.pad(cells, ((1, 1), (0, 0))), axis=0))
    level = x_edges[[column, column + 1]], y_edges[[row, row]]
    pieces = (np.concatenate([a, b], axis=1) for a, b in zip(upright, level, strict=True))
    x, y = (np.pad(ends, ((0, 1), (0, 0)), constant_values=np.nan).T.ravel() for ends in pieces)
    return x, y


@dataclass(frozen=True)
class HeatMap:
    """Cells [Y, X] between the nodes of two axes: what colors them, which are outlined and which are hatched."""

    title: str
    words: str
    x: Axis
    y: Axis
    values: np.ndarray
    outlined: np.ndarray
    hatched: np.ndarray


def heat_maps(drawn, maps: Sequence[HeatMap], top: float, ends: tuple[float, float], label: str) -> None:
    """Draw maps, three in a row from `top` inches on, in one logarithmic color scale with its bar at their right."""
    meshes = []
    for i, one in enumerate(maps):
        axes = inches(drawn, 0.95 + 4.0 * (i % 3), top + 3.1 * (i // 3), 3.35, 1.75)
        meshes.append(_cells(axes, one, ends))
        axes.set_title(one.title, pad=29)
        axes.text(0, 1.03, one.words, transform=axes.transAxes, va="bottom", color=GRAY, size=8.5, linespacing=1.3)
        for side, axis in (("x", one.x), ("y", one.y)):
            if side == "x" or i % 3 == 0 or axis.name != maps[i - 1].y.name:
                axes.set(**{f"{side}label": axis.name + ("" if axis.unit == "1" else f" ({axis.unit})")})
            if axis.spacing == "log":
                places = [v for k in range(-4, 3) for v in (10.0**k, 3 * 10.0**k) if axis.low <= v <= axis.high]
                words = [f"{100 * v:g} %" if axis.unit == "volume fraction" else f"{v:g}" for v in places]
                axes.set(**{f"{side}ticks": places, f"{side}ticklabels": words})
        axes.minorticks_off()
    place = inches(drawn, 12.45, top, 0.2, 3.1 * ((len(maps) - 1) // 3) + 1.75)
    drawn.colorbar(meshes[0], cax=place, label=label, extend="both")


def _cells(axes, one: HeatMap, ends: tuple[float, float]):
    """Draw a map without its words; what a color bar is made of."""
    axes.set(xscale=one.x.spacing, yscale=one.y.spacing)
    x, y = one.x.values, one.y.values
    style = {"norm": "log", "vmin": ends[0], "vmax": ends[1], "cmap": "viridis", "rasterized": True}
    mesh = axes.pcolormesh(x, y, np.clip(one.values, *ends), **style)
    change = np.diff(np.pad(one.hatched, ((1, 1), (0, 0))).astype(int), axis=0).T  # 1 where a run starts, -1 behind it
    (column, low), (_, high) = np.nonzero(change == 1), np.nonzero(change == -1)
    style = {"fill": False, "linewidth": 0, "edgecolor": (0.1, 0.1, 0.1, 0.6), "hatch": "///", "align": "edge"}
    axes.bar(x[column], y[high] - y[low], np.diff(x)[column], y[low], **style)
    axes.plot(*_borders(one.hatched, x, y), color=INK, linewidth=0.8)
    for color, width in (("white", 4.0), (INK, 1.9)):
        axes.plot(*_borders(one.outlined, x, y), color=color, linewidth=width, solid_capstyle="projecting")
    axes.set(xlim=x[[0, -1]], ylim=y[[0, -1]])
    return mesh


def save(drawn, folder: Path, name: str, rows: Sequence[dict]) -> None:
    """Write a figure as NAME.svg and NAME.png and its rows (all with the same keys) as NAME.csv."""
    written = io.StringIO()
    table = csv.DictWriter(written, list(rows[0]), lineterminator="\n")
    table.writeheader()
    table.writerows({key: f"{v:.6g}" if isinstance(v, float) else v for key, v in row.items()} for row in rows)
    svg, png = io.BytesIO(), io.BytesIO()
    drawn.savefig(svg, format="svg", metadata={"Date": None})
    drawn.savefig(png, format="png", dpi=DPI, metadata={"Software": None})
    contents = {"svg": svg.getvalue(), "png": png.getvalue(), "csv": written.getvalue().encode()}
    for kind, content in contents.items():
        partial = folder / f".{name}.{kind}.partial"
        partial.write_bytes(content)
        partial.replace(folder / f"{name}.{kind}")


@contextlib.contextmanager
def folder(out: Path) -> Iterator[Path]:
    """A folder to write into that becomes `out` when all went well, and vanishes otherwise.

    Raises InputError, before any work, where `out` is a file or a folder with something in it, or cannot be made.
    """
    _matplotlib()
    if out.is_symlink() or (out.exists() and (not out.is_dir() or any(out.iterdir()))):
        raise InputError(f"out = {out}: exists and is not an empty folder; give another one")
    parent = out.absolute().parent
    if not parent.is_dir():
        raise InputError(f"out = {out}: there is no folder {parent}; make it first")
    partial = parent / f".{out.absolute().name}.partial-{os.getpid()}"
    try:
        partial.mkdir()
        yield partial
        if out.exists():
            out.rmdir()
        partial.rename(out)
    except OSError as error:
        full = error.errno in (errno.ENOSPC, errno.EDQUOT)
        kind, advice = (MachineError, "free some space") if full else (InputError, "choose another folder")
        raise kind(f"out = {out}: cannot be written ({error.strerror or error}); {advice}") from error
    finally:
        shutil.rmtree(partial, ignore_errors=True)
