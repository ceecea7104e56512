"""Slow, literal re-implementations from the papers, and reference values; nothing here calls lutgen's solvers."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from lutgen.skin.tissue import Layer

_LINES = (Path(__file__).parent / "reference_two_layer.csv").read_text().splitlines()
TWO_LAYER = list(csv.DictReader(line for line in _LINES if not line.startswith("#")))
H_FUNCTION = {0.5: 0.115225878, 0.8: 0.285254503, 0.9: 0.414947479, 0.99: 0.752720717, 0.999: 0.912845335}
"""Albedo -> reflectance of an isotropic semi-infinite medium, n 1, normal incidence (Chandrasekhar's H-function)."""
HG_075 = {0.5: 0.006995, 0.9: 0.082097, 0.99: 0.393721}
"""Albedo -> diffuse reflectance, Henyey-Greenstein g 0.75, n 1.4, semi-infinite."""


def two_layers(row: dict) -> list[Layer]:
    """The layers of one row of reference_two_layer.csv."""
    n = float(row["n"])
    return [
        Layer(float(row[thickness]), float(row[f"mua_{name}_per_mm"]), float(row[f"mus_{name}_per_mm"]),
              float(row[f"g_{name}"]), n)
        for name, thickness in (("epi", "d_epi_mm"), ("der", "d_der"))
    ]  # fmt: skip


class Xoshiro128Plus:
    """One stream of xoshiro128+ (Blackman & Vigna 2021), word by word."""

    def __init__(self, state: list[int]):
        self.s = list(state)

    def next(self) -> int:
        s = self.s
        result = (s[0] + s[3]) & 0xFFFFFFFF
        t = (s[1] << 9) & 0xFFFFFFFF
        s[2] ^= s[0]
        s[3] ^= s[1]
        s[1] ^= s[2]
        s[0] ^= s[3]
        s[2] ^= t
        s[3] = ((s[3] << 11) | (s[3] >> 21)) & 0xFFFFFFFF
        return result


def fresnel_sin_tan(cosine: float, n_from: float, n_to: float) -> float:
    """Fresnel reflectance as Zhang (Human face rendering) prints it: sines and tangents (0/0 at normal incidence)."""
    a = np.arccos(cosine)
    sine = n_from / n_to * np.sin(a)
    if sine >= 1:
        return 1.0
    b = np.arcsin(sine)
    return 0.5 * ((np.sin(a - b) / np.sin(a + b)) ** 2 + (np.tan(a - b) / np.tan(a + b)) ** 2)


def document_walk(layers: list[Layer], photons: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Steps 1 to 5 of Zhang, Human face rendering, for two layers that scatter alike, by arrays of photons, in doubles.

    Weights fall by 1 - a/t at each event, roulette (1e-4, 10) ends them, hits at the interface continue the step.
    Returns exit radius and weight of each escape, for one unit of light falling on the surface per photon.
    """
    rng = np.random.default_rng(seed)
    top, bottom = layers
    n, thickness = top.n, top.thickness_mm
    position, direction = np.zeros((photons, 3)), np.tile([0.0, 0.0, 1.0], (photons, 1))
    weight = np.full(photons, 1 - ((n - 1) / (n + 1)) ** 2)
    left = np.zeros(photons)  # what is left of the step, in mean free paths
    radius, escaped = [], []
    while len(weight):
        fresh = left == 0
        left[fresh] = -np.log(1 - rng.random(fresh.sum()))
        z, uz = position[:, 2], direction[:, 2]
        in_top = (z < thickness) | ((z == thickness) & (uz < 0))
        mu_t = np.where(in_top, top.mu_a_per_mm + top.mu_s_per_mm, bottom.mu_a_per_mm + bottom.mu_s_per_mm)
        mu_a = np.where(in_top, top.mu_a_per_mm, bottom.mu_a_per_mm)
        target = np.where(uz < 0, np.where(in_top, 0.0, thickness), np.where(in_top, thickness, np.inf))
        with np.errstate(divide="ignore", invalid="ignore"):
            to_boundary = np.where(uz == 0, np.inf, (target - z) / uz)
        hits = to_boundary * mu_t <= left
        step = np.where(hits, to_boundary, left / mu_t)
        left = np.where(hits, left - step * mu_t, 0.0)
        position += direction * step[:, None]
        position[hits, 2] = target[hits]
        surface = hits & (target == 0)
        leaves = np.zeros(len(weight), bool)
        for i in np.flatnonzero(surface):
            leaves[i] = rng.random() > fresnel_sin_tan(min(-direction[i, 2], 1 - 1e-9), n, 1.0)
        radius.append(np.hypot(position[leaves, 0], position[leaves, 1]))
        escaped.append(weight[leaves])
        direction[surface & ~leaves, 2] *= -1
        event = ~hits
        weight = np.where(event, weight * (1 - mu_a / mu_t), weight)
        direction[event] = document_scatter(direction[event], top.g, rng)
        low = event & (weight < 1e-4)
        survives = rng.random(len(weight)) <= 0.1
        weight = np.where(low & survives, weight * 10, weight)
        keep = ~leaves & ~(low & ~survives)
        position, direction, weight, left = position[keep], direction[keep], weight[keep], left[keep]
    return np.concatenate(radius), np.concatenate(escaped)


def document_scatter(direction: np.ndarray, g: float, rng: np.random.Generator) -> np.ndarray:
    """New directions by the document's formulas, its branch for dz = +1 and -1 included."""
    xi, phi = rng.random(len(direction)), 2 * np.pi * rng.random(len(direction))
    cosine = 1 - 2 * xi if g == 0 else (1 + g * g - ((1 - g * g) / (1 - g + 2 * g * xi)) ** 2) / (2 * g)
    sine = np.sqrt(np.maximum(1 - cosine**2, 0))
    x, y, z = direction.T
    across = np.sqrt(np.maximum(1 - z * z, 1e-30))
    upright = np.abs(z) > 0.99999
    new = np.column_stack(
        [
            sine * (x * z * np.cos(phi) - y * np.sin(phi)) / across + x * cosine,
            sine * (y * z * np.cos(phi) + x * np.sin(phi)) / across + y * cosine,
            -across * sine * np.cos(phi) + z * cosine,
        ]
    )
    straight = np.column_stack([sine * np.cos(phi), sine * np.sin(phi), np.sign(z) * cosine])
    return np.where(upright[:, None], straight, new)
