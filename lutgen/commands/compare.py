"""Two pictures: compare."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import asdict
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING

from lutgen.commands import Outcome
from lutgen.errors import InputError
from lutgen.files import folders

if TYPE_CHECKING:
    from lutgen.render.compare import Difference


def compare(options: Namespace) -> Outcome:
    """`lutgen compare`: how far B is from A, without their noise."""
    from lutgen.render import compare as difference
    from lutgen.render import compare_files, compare_picture

    if options.png is not None:
        folders.check_file("png", options.png, ".png")
        if any(Path(options.png).resolve() == Path(one).resolve() for one in (options.a, options.b)):
            raise InputError(f"png = {options.png}: is one of the pictures to compare; give another name")
    a, b = compare_files.read(options.a), compare_files.read(options.b)
    found = difference.compare(a, b)
    if options.png is not None:
        with folders.whole_file("png", options.png) as partial:
            compare_picture.draw(a, b, found).save(partial, format="PNG")
    names = "mean", "median", "p95"
    result = {
        "a": options.a, "b": options.b, "size": list(a.acescg.shape[1::-1]), "boxes": found.boxes,
        "delta_e00": {name: asdict(getattr(found, name)) for name in names}
        | {"max": found.most, "noise_alone": dict(zip(names, found.noise_alone, strict=True))},
        "bias": {"lightness": asdict(found.lightness)}
        | {name: asdict(one) if isfinite(one.value) else None for name, one in zip("rgb", found.channels, strict=True)},
        "noise_over_sigma": found.noise_over_sigma, "notes": list(found.notes),
    }  # fmt: skip
    return result, _text(found), 0


def _text(found: Difference) -> str:
    """The figures as a user reads them."""
    figures = {"mean": found.mean, "median": found.median, "p95": found.p95}
    shown = ", ".join(f"{name} {one.value:.3f} ± {one.sigma:.3f}" for name, one in figures.items())
    shares = ", ".join(
        f"{name} {100 * one.value:+.2f} ± {100 * one.sigma:.2f} %" if isfinite(one.value) else f"{name} unknown (A: 0)"
        for name, one in zip("RGB", found.channels, strict=True)
    )
    lines = [
        f"ΔE00 of {found.boxes} boxes, noise taken off: {shown}, most {found.most:.3f}",
        f"B over A: L* {found.lightness.value:+.3f} ± {found.lightness.sigma:.3f}, {shares}",
    ]
    if found.noise_over_sigma is not None:
        alone = ", ".join(f"{name} {v:.3f}" for name, v in zip(figures, found.noise_alone, strict=True))
        lines.append(f"noise alone would leave {alone}; within boxes it is {found.noise_over_sigma:.2f} × its sigma")
    return "\n".join([*lines, *found.notes])
