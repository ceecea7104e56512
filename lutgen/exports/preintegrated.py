"""Pre-integrated skin: light on a sphere by N.L and curvature, and light through a thin part by its thickness.

After Penner & Borshukov 2011, "Pre-integrated skin shading", but over the whole sphere and with our own profiles: on a
sphere the area within a chord of length r is the flat area within r, so a ring's energy keeps its meaning.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lutgen.exports.resampled import MADE, Preset, Report, Source, difference
from lutgen.files import exr
from lutgen.solvers import profiles
from lutgen.tables.shader_axes import texel

SIZE = (128, 64)
"""Texels along N.L and along curvature."""
CURVATURE_PER_MM = 0.25
THICKNESS_MM, THICKNESSES = 32.0, 256


def shaded(energy: np.ndarray, edges: np.ndarray, n_dot_l: np.ndarray, curvature_per_mm: np.ndarray) -> np.ndarray:
    """Irradiance after scattering [..., 3] on spheres under a directional light of 1, relative to the color.

    `energy` [B, 3] and `edges` [B + 1] in mm as a profile has them; `n_dot_l` and `curvature_per_mm` broadcast. What
    would leave beyond the sphere's far side is left out and the rest scaled to sum to 1.
    """
    n_dot_l, curvature = np.broadcast_arrays(np.asarray(n_dot_l, float), np.asarray(curvature_per_mm, float))
    parts = 4
    within = (np.arange(parts) + 0.5) / parts
    radius = (edges[:-1, None] + np.diff(edges)[:, None] * within).ravel()
    weight = np.repeat(energy / energy.sum(axis=0) / parts, parts, axis=0)
    chord = 0.5 * radius * curvature[..., None]  # sine of half the angle that the ring is away
    here = chord < 1
    half = np.arcsin(np.minimum(chord, 1))
    sine = np.sqrt(np.maximum(1 - n_dot_l**2, 0))[..., None]
    a, b = n_dot_l[..., None] * np.cos(2 * half), sine * np.sin(2 * half)
    dark = np.arccos(np.clip(-a / np.maximum(b, 1e-12), -1, 1))
    partly = (a * dark + b * np.sin(dark)) / np.pi  # mean of max(0, a + b cos) around the ring
    lit = np.where(a >= b, a, np.where(a <= -b, 0, partly))
    return (np.where(here, lit, 0) @ weight) / np.maximum(here.astype(float) @ weight, 1e-12)


def through(energy: np.ndarray, edges: np.ndarray, thickness_mm: np.ndarray) -> np.ndarray:
    """Share of the light [..., 3] that comes through a part of a thickness: all that would travel farther than that."""
    return 1 - np.stack([np.interp(thickness_mm, edges, P) for P in profiles.encircled(energy.T)], axis=-1)


def texels(preset: Preset) -> tuple[np.ndarray, np.ndarray]:
    """The table [64, 128, 3] over curvature and N.L, and transmission [256, 3] over thickness, in linear Rec. 709."""
    energy, edges = preset.rings, preset.edges_mm
    n_dot_l = np.linspace(-1, 1, SIZE[0])
    curvature = np.linspace(0, CURVATURE_PER_MM, SIZE[1])
    table = shaded(energy, edges, n_dot_l, curvature[:, None])
    return table, through(energy, edges, THICKNESS_MM * np.linspace(0, 1, THICKNESSES) ** 3)


def write(source: Source, folder: Path) -> Report:
    """Write two strips per preset into a folder."""
    error = {}
    rng = np.random.default_rng(0)
    for preset in source.presets:
        table, thin = texels(preset)
        tables = {f"shade_{preset.name}.exr": table, f"transmission_{preset.name}.exr": thin[None]}
        for name, values in tables.items():
            note = {"space": "linear Rec. 709", "skin": list(preset.skin)}
            exr.write(folder / name, [exr.Part("table", exr.rgb(values.astype("f2")), note)], exr.REC709)
        x, y = rng.random((2, 1000))
        read = _bilinear(table.astype("f2").astype(float), x, y)
        energy, edges = preset.rings, preset.edges_mm
        exact = shaded(energy, edges, 2 * x - 1, CURVATURE_PER_MM * y)
        line = thin.astype("f2").astype(float)
        read_thin = np.stack([np.interp(x, np.linspace(0, 1, THICKNESSES), line[:, c]) for c in range(3)], axis=-1)
        exact_thin = through(energy, edges, THICKNESS_MM * x**3)
        error[preset.name] = {"shade": difference(read, exact), "transmission": difference(read_thin, exact_thin)}
    shade, thin_off = (max(off[k]["largest"] for off in error.values()) for k in ("shade", "transmission"))
    n, m, k = *SIZE, THICKNESSES
    return Report((
        f"shade_PRESET.exr: {n} x {m}, N.L and curvature. transmission_PRESET.exr: {k} x 1, thickness.",
        "Half float, linear Rec. 709, ZIP. Sample bilinearly, clamped, without mips.",
        f"u = {texel('(N.L + 1) / 2', n)}; v = {texel(f'c / {CURVATURE_PER_MM}', m)};",
        "row 0 is a plane; curvature c in 1/mm: length(fwidth(normal)) / length(fwidth(position in mm)).",
        f"Transmission: u = {texel(f'pow(thickness / {THICKNESS_MM:g} mm, 1/3)', k)}.",
        "shade * color of the preset * light is what leaves; 1 is a plane that the light hits head-on.",
        "transmission * color * light on the far side adds what comes through ears and nostrils.",
        "Made from the preset's own profile, integrated over a sphere of each curvature.",
        f"Error it adds: shade {shade:.2g}, transmission {thin_off:.2g} at most at 1000 places (texels, half floats).",
        MADE,
    ), error)  # fmt: skip


def _bilinear(table: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """What a texture gives [N, 3] at coordinates [N] in 0 to 1 between the centers of its outer texels."""
    px, py = x * (table.shape[1] - 1), y * (table.shape[0] - 1)
    i, j = np.minimum(px.astype(int), table.shape[1] - 2), np.minimum(py.astype(int), table.shape[0] - 2)
    fx, fy = (px - i)[:, None], (py - j)[:, None]
    low, high = ((1 - fx) * table[k, i] + fx * table[k, i + 1] for k in (j, j + 1))
    return (1 - fy) * low + fy * high
