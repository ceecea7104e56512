"""How far two pictures of a scene are apart, without their noise."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from dataclasses import asdict
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING

from lutgen.commands import Outcome
from lutgen.errors import InputError
from lutgen.files import folders

if TYPE_CHECKING:
    from lutgen.render.compare import Difference


EXAMPLES = ("lutgen compare render.exr view.exr --png difference.png",)


def arguments(parser: ArgumentParser) -> None:
    """Add the two pictures, and one of their difference."""
    parser.add_argument("a", metavar="A", help="EXR that `lutgen render` or `lutgen view` wrote, or any picture")
    parser.add_argument("b", metavar="B", help="picture of the same size")
    parser.add_argument(
        "--png", metavar="FILE", help="write A, B and the map of differences side by side (default: none)"
    )


def run(options: Namespace) -> Outcome:
    """How far B is from A."""
    from lutgen.render import compare, compare_files, compare_picture

    if options.png is not None:
        folders.check_file("png", options.png, ".png")
        if any(Path(options.png).resolve() == Path(picture).resolve() for picture in (options.a, options.b)):
            raise InputError(f"png = {options.png}: is one of the pictures to compare; give another name")
    a, b = compare_files.read(options.a), compare_files.read(options.b)
    difference = compare.compare(a, b)
    if options.png is not None:
        with folders.whole_file("png", options.png) as partial:
            compare_picture.draw(a, b, difference).save(partial, format="PNG")
    names = "mean", "median", "p95"
    channels = zip("rgb", difference.channels, strict=True)
    result = {
        "a": options.a, "b": options.b, "size": list(a.acescg.shape[1::-1]), "boxes": difference.boxes,
        "delta_e00": {name: asdict(getattr(difference, name)) for name in names}
        | {"max": difference.most, "noise_alone": dict(zip(names, difference.noise_alone, strict=True))},
        "bias": {"lightness": asdict(difference.lightness)}
        | {name: asdict(bias) if isfinite(bias.value) else None for name, bias in channels},
        "noise_over_sigma": difference.noise_over_sigma, "notes": list(difference.notes),
    }  # fmt: skip
    return result, _text(difference), 0


def _text(difference: Difference) -> str:
    """The figures as a user reads them."""
    figures = {"mean": difference.mean, "median": difference.median, "p95": difference.p95}
    errors = ", ".join(f"{name} {figure.value:.3f} ± {figure.sigma:.3f}" for name, figure in figures.items())
    shares = ", ".join(
        f"{name} {100 * bias.value:+.2f} ± {100 * bias.sigma:.2f} %"
        if isfinite(bias.value)
        else f"{name} unknown (A: 0)"
        for name, bias in zip("RGB", difference.channels, strict=True)
    )
    lines = [
        f"ΔE00 of {difference.boxes} boxes, noise taken off: {errors}, most {difference.most:.3f}",
        f"B over A: L* {difference.lightness.value:+.3f} ± {difference.lightness.sigma:.3f}, {shares}",
    ]
    if difference.noise_over_sigma is not None:
        noise = ", ".join(f"{name} {value:.3f}" for name, value in zip(figures, difference.noise_alone, strict=True))
        lines.append(
            f"noise alone would leave {noise}; within boxes it is {difference.noise_over_sigma:.2f} × its sigma"
        )
    return "\n".join([*lines, *difference.notes])
