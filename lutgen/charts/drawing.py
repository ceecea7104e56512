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
from pathlib import Path

import numpy as np

from lutgen.errors import InputError, MachineError

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
        raise MachineError('charts need matplotlib, which is missing: pip install "lutgen[charts]"') from error
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
        axes.annotate(words, (x, y), (16, place), color=color, size=size, va="center", **placed)
        axes.annotate("", (x, y), (14, place), arrowprops=line, **placed)


def strip(axes, rgb: np.ndarray, words: str = "", fill: str = INK) -> None:
    """Fill axes with display colors [N, 3] from left to right, centers at 0, 1, 2 ...; the words stand left of them."""
    exact = np.round(255 * np.asarray(rgb)).astype("u1")[None]  # imshow cuts floats off instead of rounding them
    axes.imshow(exact, aspect="auto", interpolation="nearest")
    axes.set_axis_off()
    axes.text(-0.012, 0.5, words, transform=axes.transAxes, ha="right", va="center", color=fill)


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
