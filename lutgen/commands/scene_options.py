"""A head, its light and its look, as view, sheet and render take them."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import lutgen
from lutgen.errors import InputError
from lutgen.files.texture_maps import Maps
from lutgen.head import mesh
from lutgen.scene import look as looks
from lutgen.scene import subject
from lutgen.scene.look import Look
from lutgen.skin.tissue import PRESETS
from lutgen.tables import storage
from lutgen.tables.lut_set import LutSet


@dataclass(frozen=True)
class Scene:
    """What the options describe; `surroundings` [R, 2 R, 3] is None for the studio, `notes` are about the head."""

    luts: LutSet
    head: mesh.Mesh
    maps: Maps
    surroundings: np.ndarray | None
    notes: tuple[str, ...]


def arguments(parser: ArgumentParser, size: str) -> None:
    """Add the set, the head, its maps, its light, its look, and the picture's size, by default `size`."""
    parser.add_argument("dir", nargs="?", metavar="LUT_DIR", help="LUT set (default: the one that came along)")
    parser.add_argument("--mesh", metavar="FILE", help="GLB, glTF, OBJ or lee-perry-smith (default: the built-in head)")
    parser.add_argument(
        "--mm-per-unit", type=float,
        help="millimetres per unit of the mesh, {:g} to {:g} (default: a guess)".format(*mesh.MM_PER_UNIT),
    )  # fmt: skip
    parser.add_argument("--flip-v", action="store_true", help="turn the mesh's texture coordinates upside down")
    parser.add_argument(
        "--maps", metavar="DIR",
        help="texture maps by name, melanin.png, normal.png, ..., or none (default: the head's own)",
    )  # fmt: skip
    parser.add_argument(
        "--albedo", choices=subject.ALBEDO, default="recolor",
        help="a painted albedo: recolor it or invert it to maps (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--environment", default="studio", metavar="NAME",
        help="studio, none or an equirectangular .exr or .hdr (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument("--normalize-environment", action="store_true", help="as bright on average as the studio")
    parser.add_argument(
        "--look", metavar="FILE", help="look that the viewer saved, in TOML (default: the one it opens with)"
    )
    parser.add_argument(
        "--preset", choices=PRESETS, metavar="NAME",
        help=f"chromophores of a preset: {', '.join(PRESETS)} (default: the look's)",
    )  # fmt: skip
    parser.add_argument(
        "--set", action="append", default=[], metavar="NAME=VALUE",
        help="one value of the look, again for another; a value out of range says the range (default: the look's)",
    )  # fmt: skip
    parser.add_argument(
        "--size", metavar="WxH",
        help=f"width x height in pixels, 16 to {subject.MAX_SIDE} each way (default: {size})",
    )  # fmt: skip


def look_of(options: Namespace) -> Look:
    """The look that --look, --preset and --set give, in that order."""
    look = looks.load(Path(options.look)) if options.look else Look()
    if options.preset is not None:
        look = looks.of_preset(options.preset, look)
    values = {}
    for text in options.set:
        name, equals, value = text.partition("=")
        if not equals:
            raise InputError(f"--set {text}: NAME=VALUE is needed, for example melanin=0.05")
        values[name.strip().replace("-", "_")] = value.strip()
    return looks.changed(look, values)


def scene_of(options: Namespace, look: Look) -> Scene:
    """The scene that the options describe."""
    luts = lutgen.load() if options.dir is None else storage.load(Path(options.dir))
    surroundings = subject.surroundings_of(options.environment, options.normalize_environment)
    head, maps = subject.model(options.mesh, options.mm_per_unit, options.maps, options.flip_v)
    notes = head.notes
    if options.albedo == "invert":
        maps, doubts = subject.inverted(luts, maps, look.eumelanin)
        notes = (*notes, *doubts)
    credit = () if head.attribution in ("", "built-in") else (head.attribution,)
    return Scene(luts, head, maps, surroundings, (*notes, *credit))
