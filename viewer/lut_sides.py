"""The sides of a split view: each a LUT set on the GPU with the pass that reads it."""

from __future__ import annotations

from dataclasses import dataclass, replace

from lutgen.tables.lut_set import LutSet

from . import gl, textures

_LIGHT_SKIN = (0.0127, 0.7, 0.0077)


@dataclass
class Side:
    """A LUT set as it is stored, as it is shown (at the look's oxygenation), on the GPU, and the pass that reads it."""

    luts: LutSet
    shown: LutSet
    textures: textures.LutTextures
    gather: gl.Pass


def upload(luts: LutSet) -> Side:
    """A side that shows a set as it is stored."""
    uploaded = textures.upload(luts)
    return Side(luts, luts, uploaded, gl.full_screen("gather.frag.glsl", {"functions.glsl": uploaded.functions}))


def one_burley(plain: Side) -> Side:
    """The same side with one Burley, fitted to very light skin, in place of every tone's profile."""
    rings, within = textures.burley_tables(plain.luts, _LIGHT_SKIN)
    return replace(plain, textures=replace(plain.textures, rings=gl.volume(rings), encircled=gl.volume(within)))


def expand(side: Side, oxygenation: float) -> None:
    """Expand a side's LUTs from their stored paths to another oxygenation and upload them."""
    luts = side.luts
    side.shown = luts if oxygenation == luts.oxygenation else luts.expand(oxygenation=oxygenation)
    textures.rewrite(side.textures, *textures.tables(side.shown))


def release(sides: dict[str, Side]) -> None:
    """Free everything that sides hold, what they share once."""
    tables = [side.textures for side in sides.values()]
    volumes = {id(volume): volume for t in tables for volume in (t.color, t.rings, t.encircled)}
    gathers = {id(side.gather): side.gather for side in sides.values()}
    gl.free(*volumes.values(), *(part for g in gathers.values() for part in (g.array, g.program, g.corners)))
