"""What the exports for Unreal and Unity share: the layout of their textures, limits, errors, and files as they are."""

from __future__ import annotations

import re
import textwrap
from importlib.resources import files

import numpy as np

from lutgen.errors import InputError
from lutgen.exports import lookup
from lutgen.exports.resampled import AXES, POINTS, Source, difference, trilinear, warped
from lutgen.solvers import profiles
from lutgen.tables import expand

LIMIT = 16384
"""Texels along a side of a texture, in both engines."""
N = 1.4
"""Refractive index of skin; Unreal's default is 1.55."""


def slices(cells: np.ndarray) -> np.ndarray:
    """An image [N_e, N_h N_m, C] of cells [N_h, N_e, N_m, C]: a tile per hemoglobin from left to right, in it melanin
    along x and eumelanin along y, row 0 the lowest."""
    return cells.transpose(1, 0, 2, 3).reshape(cells.shape[1], -1, cells.shape[-1])


def fits(engine: str, what: str, image: np.ndarray) -> np.ndarray:
    """The image, or InputError where a side is longer than the engine takes."""
    height, width = image.shape[:2]
    if max(width, height) > LIMIT:
        advice = f"allowed is {LIMIT} a side; bake a set with fewer nodes"
        raise InputError(f"{engine}: the {what} texture is {width} x {height} texels: {advice}")
    return image


def rgba(image: np.ndarray) -> dict[str, np.ndarray]:
    """Channels R, G, B, A of an array [rows, columns, 4]."""
    return {name: np.ascontiguousarray(image[..., i]) for i, name in enumerate("RGBA")}


def errors(source: Source, half: np.ndarray, texels: np.ndarray) -> tuple[dict, float]:
    """What an export adds: of half cells [N_h, N_e, N_m, 3] against the set's colors at random skins, of profile texels
    [nodes, 64, 4], and of Burley's shape per preset; and the largest EE difference of the last."""
    read = trilinear(half.astype(float), source.coordinates(source.skins))
    burley = {p.name: {"d_mm": p.burley_d_mm.tolist(), "burley_ee_difference": p.burley_difference.tolist()}
              for p in source.presets}  # fmt: skip
    color = difference(read, source.luts.color(*source.skins.T))
    worst = max((max(one["burley_ee_difference"]) for one in burley.values()), default=0.0)
    return {"color": color, "rings": ring_error(source, texels), "presets": burley}, worst


def ring_error(source: Source, texels: np.ndarray, skins: int = POINTS // 10) -> dict:
    """Difference of the encircled energy that a shader reads from profile texels [nodes, 64, 4] from the set's own,
    over radii of 0.01 mm and more, at random skins."""
    grid, points = source.luts.profile_lut.grid, source.skins[:skins]
    ends = np.array([[getattr(grid, name).low, getattr(grid, name).high] for name in AXES]).T
    points = np.clip(points, *ends)
    t = np.stack([warped(getattr(grid, name), points[:, k]) for k, name in enumerate(AXES)], axis=1)
    read = trilinear(texels.reshape(*grid.shape, -1).astype(float), t).reshape(skins, -1, 4)
    off = []
    for rings, point in zip(read, points, strict=True):
        profile = source.luts.profile(*point, space="srgb")
        shape, _ = expand.normalized(profile.energy)
        P, edges = profiles.encircled(shape.T), profile.radius_edges_mm
        far = rings[rings[:, 0] >= profiles.COMPARED_FROM_MM]
        exact = np.stack([np.interp(far[:, 0], edges, P[c]) for c in range(3)], axis=1)
        off.append(np.abs(far[:, 1:] - exact).ravel())
    return difference(np.concatenate(off), np.array(0.0))


def custom_node(functions: str, name: str) -> str:
    """The code of an Unreal Custom node that does what the HLSL function `name` does, with its parameters as inputs.

    The code is pasted into a function, where none can be defined: axes become macros, the function its statements.
    """
    axis = r"float (\w+)\(float value\) \{\s*(?:value = (clamp\(.*\));\s*)?return (.*);\s*\}"
    macros = re.sub(axis, _macro, functions)
    found = re.search(rf"^\w+ {name}\([^)]*\) \{{\n(.*?)^\}}", functions, re.DOTALL | re.MULTILINE)
    if not found:
        raise ValueError(f"{name}: not a function of the text")
    body = textwrap.dedent(found[1])
    used = {word for word in re.findall(r"\w+", body) if word.startswith("lutgen_")}
    head = [line for line in macros.splitlines() if line.startswith("#define") and re.split(r"[ (]", line)[1] in used]
    return "\n".join([*head, body])


def _macro(axis: re.Match) -> str:
    """An axis function (its name, its clamped value, what it returns) as a macro."""
    return f"#define {axis[1]}(value) " + re.sub(r"\bvalue\b", axis[2] or "value", axis[3])


def hlsl(source: Source, note: str, more: str = "") -> str:
    """An include file with the shader functions, guarded; `note` is a comment, `more` follows the functions."""
    head = "".join(f"// {line}\n" for line in note.splitlines())
    body = lookup.text(source, "hlsl").strip()
    return f"{head}#ifndef LUTGEN_INCLUDED\n#define LUTGEN_INCLUDED\n\n{body}\n{more}\n#endif\n"


def template(name: str) -> str:
    """The text of a file of lutgen/exports/templates, which is copied into exports as it is."""
    return (files("lutgen.exports") / "templates" / name).read_text(encoding="utf-8")
