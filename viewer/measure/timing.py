"""What a frame costs: each tier by pass, and over the same head without LUT and scattering."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np

from lutgen.files.texture_maps import Maps
from lutgen.head.mesh import Mesh
from lutgen.scene import look as looks
from lutgen.scene.look import Look
from lutgen.tables.lut_set import LutSet

from .. import app, gl, passes
from ..stage import Stage, release
from . import plain

ROUNDS = 5


@dataclass(frozen=True)
class Cost:
    """Medians over rounds of one way to draw a frame.

    `ratio`: its frame over the mean of the plain frames drawn just before and after it, `ratios` its least and most.
    """

    name: str
    taps: int
    frames: int
    milliseconds: dict[str, float]
    total: float
    ratio: float
    ratios: tuple[float, float]


def report(
    luts: LutSet, shape: Mesh, maps: Maps, size: tuple[int, int], progress: Callable[[str], None] = lambda name: None
) -> dict:
    """What `lutgen bench --viewer --json` prints of a head, its maps and a LUT set."""
    stage = app.open_stage(luts, shape, maps, size)
    try:
        game, tiers = costs(stage, Look(), rounds=ROUNDS, progress=progress)
        return {
            "renderer": gl.context().info["GL_RENDERER"], "size": list(size), "rounds": ROUNDS, "plain": asdict(game),
            "tiers": {cost.name: asdict(cost) for cost in tiers}, "oxygenation_ms": oxygenation(stage),
            "lut_bytes": stage.sides["none"].textures.bytes,
        }  # fmt: skip
    finally:
        release(stage)


def costs(
    stage: Stage,
    look: Look,
    tiers: Sequence[str] = looks.TIERS,
    rounds: int = ROUNDS,
    progress: Callable[[str], None] = lambda name: None,
) -> tuple[Cost, list[Cost]]:
    """Cost of a look drawn plain, and of each tier.

    Plain frames and tiers alternate, and the tiers' order turns from round to round, so that a machine that slows
    down and recovers does not favor one of them. One round of everything comes first and does not count.
    """
    game = plain.open_plain(stage, look)
    looks = {tier: replace(look, tier=tier) for tier in tiers}
    taken: dict[str, list[dict[str, float]]] = {name: [] for name in ("plain", *tiers)}
    ratios: dict[str, list[float]] = {tier: [] for tier in tiers}
    try:
        for k in range(rounds + 1):
            progress(f"viewer: round {k} of {rounds}")
            before = _frame(stage, lambda: plain.draw(stage, game, look))
            for i in range(len(tiers)):
                tier = tiers[(i + k) % len(tiers)]
                tier_ms = _frame(stage, lambda t=tier: passes.draw(stage, looks[t]))
                plain_ms = _frame(stage, lambda: plain.draw(stage, game, look))
                if k:
                    taken[tier].append(tier_ms)
                    taken["plain"].append(plain_ms)
                    ratios[tier].append(2 * sum(tier_ms.values()) / (sum(before.values()) + sum(plain_ms.values())))
                before = plain_ms
    finally:
        plain.release(game)
    drawn = [_cost(tier, passes.TAPS[tier], passes.frames(looks[tier]), taken[tier], ratios[tier]) for tier in tiers]
    return _cost("plain", 0, 1, taken["plain"], [1.0]), drawn


def _frame(stage: Stage, draw: Callable[[], None]) -> dict[str, float]:
    stage.cast = None  # as if the light moved
    draw()
    gl.context().finish()
    return stage.milliseconds


def _cost(name: str, taps: int, frames: int, rounds: list[dict[str, float]], ratios: list[float]) -> Cost:
    each = {key: float(np.median([passes_ms[key] for passes_ms in rounds])) for key in rounds[0]}
    total = float(np.median([sum(passes_ms.values()) for passes_ms in rounds]))
    return Cost(name, taps, frames, each, total, float(np.median(ratios)), (min(ratios), max(ratios)))


def oxygenation(stage: Stage, rounds: int = ROUNDS) -> float:
    """Median milliseconds from another oxygenation to its LUTs on the GPU: expansion, tables and upload together."""
    before, taken = stage.oxygenation, []
    for value in np.linspace(0.3, 0.9, rounds + 1):
        since = time.perf_counter()
        passes.set_oxygenation(stage, float(value))
        gl.context().finish()
        taken.append(1000 * (time.perf_counter() - since))
    if before is not None:
        passes.set_oxygenation(stage, before)
    return float(np.median(taken[1:]))
