"""What `mixed` absorption costs: its bias against mu_a / mu_t, beside closed forms, and on the presets.

It is that of Zhang, Human face rendering (kernels/README.md, Three ways to absorb).

With steps s drawn from mu_t, one event keeps exp(-mu_a s) of the weight, 1 / (1 + a) in the mean for a = mu_a / mu_t,
where it should keep 1 - a. So `mixed` solves a medium of albedo 1 / (1 + a) exactly. For isotropic scattering without
a change of index both reflectances are closed forms of Chandrasekhar's H-function.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lutgen import color
from lutgen.charts import drawing
from lutgen.charts.document.spectra import ABSORPTIONS, shades, spectra
from lutgen.charts.drawing import DASHES, GRAY, HUES, INK, inches
from lutgen.skin.tissue import PRESETS, Layer
from lutgen.solvers import direct

SHARES = (0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
"""Absorbed share mu_a / mu_t of the media that are walked."""


@dataclass(frozen=True)
class Biased:
    """Reflectance of one isotropic half-space: by two walks with their standard errors, and in closed form."""

    absorbed_share: float
    albedo: float
    albedo_error: float
    mixed: float
    mixed_error: float
    exact: float
    exact_mixed: float


def half_space(albedo: float) -> float:
    """Reflectance of an isotropic half-space, index 1, for light along the normal: 1 - H(1) (1 - albedo)^1/2.

    Chandrasekhar 1960, section 33; H by iterating its alternative equation, good to 1e-12.

    >>> round(half_space(0.9), 9)
    0.414947479
    """
    x, w = np.polynomial.legendre.leggauss(96)
    mu, w = (x + 1) / 2, w / 2
    root, H = np.sqrt(1 - albedo), np.ones(len(mu))
    for _ in range(400):
        H, last = 1 / (root + albedo / 2 * ((w * mu * H) / (mu[:, None] + mu)).sum(axis=1)), H
        if np.abs(H - last).max() < 1e-14:
            break
    return float(1 - root / (root + albedo / 2 * ((w * mu * H) / (1 + mu)).sum()))


def walks(photons: int, seed: int = 3) -> list[Biased]:
    """Isotropic half-spaces walked with `albedo` and with `mixed` absorption."""
    walked = []
    for a in SHARES:
        layer = [Layer(np.inf, a, 1 - a, 0.0, 1.0)]
        albedo, mixed = (direct.shares(layer, photons, seed, absorption=name) for name in ("albedo", "mixed"))
        exact = half_space(1 - a), half_space(1 / (1 + a))
        walked.append(Biased(a, albedo.diffuse, albedo.diffuse_error, mixed.diffuse, mixed.diffuse_error, *exact))
    return walked


def presets() -> dict[str, tuple[float, np.ndarray]]:
    """ΔE00 that exponential absorption costs each preset, and display colors [2, 3], exact beside biased."""
    skins = list(PRESETS.values())
    pairs = [shades(spectra(skins, name)) for name in ABSORPTIONS]
    apart = color.delta_e00(pairs[0][1], pairs[1][1])
    return {name: (float(apart[i]), np.array([pairs[0][0][i], pairs[1][0][i]])) for i, name in enumerate(PRESETS)}


def bias(folder: Path, quick: bool) -> str:
    """Draw `mixed-bias`: brightness against absorbed share beside its closed forms, and ΔE00 on the presets."""
    walked, cost = walks(50_000 if quick else 400_000), presets()
    notes = (
        "Left: isotropic half-space of index 1, light along the normal. Points: walked, bars 4 standard errors; lines: "
        "closed forms.\nRight: what it costs the presets, exact spectra, default color pipeline."
    )
    title = "The document's exponential absorption with steps from μt (`mixed`) is too bright"
    rows = [{"kind": "half-space", "preset": "", **vars(b), "delta_e00": ""} for b in walked]
    rows += [{"kind": "preset", "preset": n, "delta_e00": d} for n, (d, _) in cost.items()]
    with drawing.figure(folder, "mixed-bias", rows, (12.9, 6.0), title, notes) as drawn:
        _against_share(inches(drawn, 0.9, 1.2, 5.3, 4.0), walked)
        _on_presets(inches(drawn, 8.9, 1.2, 3.3, 4.0), cost)
    worst = max(cost, key=lambda name: cost[name][0])
    z = max(abs(b.mixed - b.exact_mixed) / b.mixed_error for b in walked)
    return f"mixed absorption costs ΔE00 up to {cost[worst][0]:.2f} ({worst}); closed form within {z:.1f} sigma"


def _against_share(axes, walked: list[Biased]) -> None:
    a = np.linspace(0.005, 0.93, 60)
    exact, mixed = (np.array([half_space(v) for v in albedo]) for albedo in (1 - a, 1 / (1 + a)))
    lines = (
        (mixed / exact, "reflectance", HUES[1], DASHES[0]),
        (1 / ((1 + a) * (1 - a)), "weight after one event,\n1 / (1 − (μa/μt)²)", HUES[0], DASHES[1]),
    )
    for y, _, hue, dash in lines:
        axes.plot(a, y, color=hue, linestyle=dash, zorder=1)
    share = [b.absorbed_share for b in walked]
    ratio = np.array([b.mixed / b.exact for b in walked])
    axes.errorbar(share, ratio, [4 * b.mixed_error / b.exact for b in walked], fmt="o", color=HUES[1], markersize=5,
                  capsize=3, linewidth=1.2, zorder=3)  # fmt: skip
    unbiased = [b.albedo / b.exact for b in walked]
    axes.errorbar(share, unbiased, [4 * b.albedo_error / b.exact for b in walked], fmt="s", color=INK, markersize=4,
                  capsize=3, linewidth=1.2, zorder=2, markerfacecolor="white")  # fmt: skip
    axes.set(xlim=(0, 0.93), ylim=(0.8, 12), yscale="log", xlabel="absorbed share of an event, μa / μt",
             ylabel="brighter than exact by this factor")  # fmt: skip
    axes.set_yticks([1, 2, 5, 10], ["1", "2", "5", "10"])
    axes.minorticks_off()
    axes.grid(axis="y")
    axes.text(0.02, 0.93, "walked with `albedo`: unbiased", color=INK, size=9, va="top")
    labels = [(float(y[-1]), words, hue) for y, words, hue, _ in lines]
    drawing.label_ends(axes, 0.93, labels, 0.1)


def _on_presets(axes, cost: dict[str, tuple[float, np.ndarray]]) -> None:
    for i, (apart, rgb) in enumerate(cost.values()):
        for k, shade in enumerate(rgb):
            axes.barh(i, 0.5, left=-1.15 + 0.5 * k, height=0.72, color=np.round(255 * shade) / 255, linewidth=0)
        axes.plot([0, apart], [i, i], color=HUES[1], linewidth=2.2)
        axes.plot(apart, i, "o", color=HUES[1], markersize=6)
        axes.text(apart + 0.2, i, f"{apart:.2f}", va="center", size=9)
    top = max(apart for apart, _ in cost.values())
    axes.set(ylim=(len(cost) - 0.4, -0.6), xlim=(-1.2, top * 1.18), xlabel="color difference ΔE00 to exact absorption")
    axes.set_yticks(range(len(cost)), list(cost))
    axes.set_xticks(range(0, int(top) + 1, 2))
    axes.spines["left"].set_visible(False)
    axes.tick_params(axis="y", length=0)
    axes.text(-0.65, -0.55, "exact | biased", color=GRAY, size=8, ha="center", va="bottom")
