"""Charts on disk, and what every one of them repeats: each as SVG, PNG and its numbers as CSV; the only matplotlib.

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
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

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


def silent(stage: str, tally: object) -> None:
    """Progress that no one hears."""


@contextlib.contextmanager
def figure(folder: Path, name: str, rows: Sequence, size: tuple[float, float], title: str, notes: str = "") -> Iterator:
    """A figure of that size in inches under the house style, its title and lines of explanation at the top left.

    Once drawn it is written as NAME.svg and NAME.png, its rows (dicts or dataclasses) as NAME.csv: their fields in
    order of appearance, empty where a row has none.
    """
    matplotlib = _matplotlib()
    plain = {key: value for key, value in matplotlib.rcParamsDefault.items() if key != "backend"}
    with matplotlib.rc_context(plain | _STYLE):  # type: ignore[arg-type]
        drawn = matplotlib.figure.Figure(size)
        write(drawn, 0.18, 0.15, title, size=14, va="top")
        write(drawn, 0.18, 0.46, notes, color=GRAY, va="top", linespacing=1.35)
        yield drawn
        _save(drawn, folder, name, [row if isinstance(row, dict) else asdict(row) for row in rows])


def inches(drawn, left: float, top: float, width: float, height: float):
    """Axes of a figure at a place in inches from its top left corner."""
    across, down = drawn.get_size_inches()
    return drawn.add_axes((left / across, 1 - (top + height) / down, width / across, height / down))


def write(drawn, left: float, top: float, words: str, **style: Any) -> None:
    """Write on a figure at a place in inches from its top left corner."""
    across, down = drawn.get_size_inches()
    drawn.text(left / across, 1 - top / down, words, **style)


def ground(pad: float) -> dict:
    """White behind words (`bbox`), that many points wider than they are."""
    return {"facecolor": "white", "edgecolor": "none", "pad": pad}


def leader(color: str, width: float = 0.7, end: float = 4, **style: Any) -> dict:
    """A thin line (`arrowprops`) from words to what they name, ending so many points before it."""
    return {"arrowstyle": "-", "color": color, "linewidth": width, "shrinkA": 0, "shrinkB": end} | style


def note(axes, words: str, point: tuple[float, float], points: tuple[float, float], **style: Any) -> None:
    """Write beside a point of the data, so many points right of it and above."""
    axes.annotate(words, point, points, textcoords="offset points", **style)


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
        axes.annotate(words, (x, y), (16, place), color=color, size=size, va="center", bbox=ground(0.8), **placed)
        axes.annotate("", (x, y), (14, place), arrowprops=leader(color, end=2), **placed)


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
    for i, heat in enumerate(maps):
        axes = inches(drawn, 0.95 + 4.0 * (i % 3), top + 3.1 * (i // 3), 3.35, 1.75)
        meshes.append(_cells(axes, heat, ends))
        axes.set_title(heat.title, pad=29)
        axes.text(0, 1.03, heat.words, transform=axes.transAxes, va="bottom", color=GRAY, size=8.5, linespacing=1.3)
        for side, axis in (("x", heat.x), ("y", heat.y)):
            if side == "x" or i % 3 == 0 or axis.name != maps[i - 1].y.name:
                axes.set(**{f"{side}label": axis.name + ("" if axis.unit == "1" else f" ({axis.unit})")})
            if axis.spacing == "log":
                places = [v for k in range(-4, 3) for v in (10.0**k, 3 * 10.0**k) if axis.low <= v <= axis.high]
                words = [f"{100 * v:g} %" if axis.unit == "volume fraction" else f"{v:g}" for v in places]
                axes.set(**{f"{side}ticks": places, f"{side}ticklabels": words})
        axes.minorticks_off()
    place = inches(drawn, 12.45, top, 0.2, 3.1 * ((len(maps) - 1) // 3) + 1.75)
    drawn.colorbar(meshes[0], cax=place, label=label, extend="both")


def _cells(axes, heat: HeatMap, ends: tuple[float, float]):
    """Draw a map without its words; what a color bar is made of."""
    axes.set(xscale=heat.x.spacing, yscale=heat.y.spacing)
    x, y = heat.x.values, heat.y.values
    style = {"norm": "log", "vmin": ends[0], "vmax": ends[1], "cmap": "viridis", "rasterized": True}
    mesh = axes.pcolormesh(x, y, np.clip(heat.values, *ends), **style)
    change = np.diff(np.pad(heat.hatched, ((1, 1), (0, 0))).astype(int), axis=0).T  # 1 where a run starts, -1 behind it
    (column, low), (_, high) = np.nonzero(change == 1), np.nonzero(change == -1)
    style = {"fill": False, "linewidth": 0, "edgecolor": (0.1, 0.1, 0.1, 0.6), "hatch": "///", "align": "edge"}
    axes.bar(x[column], y[high] - y[low], np.diff(x)[column], y[low], **style)
    axes.plot(*_borders(heat.hatched, x, y), color=INK, linewidth=0.8)
    for color, width in (("white", 4.0), (INK, 1.9)):
        axes.plot(*_borders(heat.outlined, x, y), color=color, linewidth=width, solid_capstyle="projecting")
    axes.set(xlim=x[[0, -1]], ylim=y[[0, -1]])
    return mesh


def _save(drawn, folder: Path, name: str, rows: list[dict]) -> None:
    written = io.StringIO()
    table = csv.DictWriter(written, dict.fromkeys(key for row in rows for key in row), lineterminator="\n")
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


def draw_all(out: Path, charts: Mapping[str, Callable[[Path], str]], progress: Callable) -> dict[str, str]:
    """Draw charts into the folder `out`, which appears whole or not at all; what each shows in a line, by its name.

    Raises InputError where `out` holds something, MachineError without matplotlib.
    """
    shown = {}
    with folder(out) as partial:
        for name, chart in charts.items():
            progress(name, None)
            shown[name] = chart(partial)
    return shown
