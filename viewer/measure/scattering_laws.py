"""What scattering must obey, on a flat plane of known light: the gather pass alone, and what it should give.

The plane faces the camera from so far away that every pixel is equally large. Light enters as a disc or a half-plane;
what should leave is that light blurred by the skin's own radial profile, computed here from the profile's rings, not
from the tables that the shader reads.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cache

import moderngl
import numpy as np

from lutgen.skin.tissue import preset
from lutgen.tables.lut_set import LutSet

from .. import gl, textures

TONES = ("very-light", "light", "intermediate", "tan", "brown", "dark")
SIDE = 256
"""Pixels of the plane along x and y."""
DISC = 6.0
"""Radius in pixels of the searchlight's disc."""
PLACES = range(16)
"""Places of the disc: one for each pixel of the gather's 4 x 4 pattern."""
EDGE_MM_PER_PIXEL = 0.05
_DEPTH_MM = 1e5
_PARTS = 24  # a ring of a profile is spread over so many radii
_FINE = 8  # points along a pixel's side that its mean is taken over


@dataclass(frozen=True)
class Plane:
    """A gather pass with its tables, inputs and target, and what has been worked out about its LUT set."""

    luts: LutSet
    tables: textures.LutTextures
    gather: gl.Pass
    inputs: dict[str, moderngl.Texture]
    light: moderngl.Texture
    target: moderngl.Framebuffer
    expected: dict = field(default_factory=dict)


def open_plane(luts: LutSet) -> Plane:
    """A plane of a LUT set's skins."""
    tables = textures.upload(luts)
    gather = gl.full_screen("gather.frag.glsl", {"functions.glsl": tables.functions})
    names = "entering", "facing", "skin", "behind", "detail"
    inputs = {name: gl.texture((SIDE, SIDE), 4, "f4") for name in names}
    light = gl.texture((SIDE, SIDE), 4, "f4")
    return Plane(luts, tables, gather, inputs, light, gl.context().framebuffer([light]))


def release(plane: Plane) -> None:
    """Free everything that the plane holds on the GPU."""
    tables, law = plane.tables, plane.gather
    gl.free(plane.target, plane.light, *plane.inputs.values(), tables.color, tables.rings, tables.encircled, law.array,
            law.program, law.corners)  # fmt: skip


def one_burley(luts: LutSet, tone: str = TONES[0]) -> tuple[moderngl.Texture3D, moderngl.Texture3D]:
    """Tables of rings and of encircled energy where one Burley, fitted to one tone, stands for all."""
    rings, within = textures.burley_tables(luts, chromophores(tone))
    return gl.volume(rings), gl.volume(within)


def chromophores(tone: str) -> tuple[float, float, float]:
    """Melanin, eumelanin and hemoglobin of a preset."""
    skin = preset(tone)
    return skin.melanin, skin.eumelanin, skin.hemoglobin


def scattered(
    plane: Plane, light: np.ndarray | float, skins, mm_per_pixel: float, taps: int, frame: int = 0,
    tables: tuple[moderngl.Texture3D, moderngl.Texture3D] | None = None,
) -> np.ndarray:  # fmt: skip
    """Light [SIDE, SIDE, 3] that leaves where `light` enters, the skin's color in it, first row lowest.

    `skins`: melanin, eumelanin, hemoglobin of all pixels or of each; `tables`: rings and encircled energy of another
    profile than the set's.
    """
    flat = np.ones((SIDE, SIDE, 4), "f4")
    entering, facing, skin, behind = flat.copy(), flat.copy(), flat.copy(), np.zeros_like(flat)
    entering[..., :3], entering[..., 3] = light, _DEPTH_MM
    facing[..., :3] = 0, 0, 1
    skin[..., :3], skin[..., 3] = skins, 32.0
    for texture, values in zip(plane.inputs.values(), (entering, facing, skin, behind, flat), strict=True):
        texture.write(values.tobytes())
    program, (rings, within) = plane.gather.program, tables or (plane.tables.rings, plane.tables.encircled)
    gl.bind(program, lut_color=plane.tables.color, lut_rings=rings, lut_encircled=within, **plane.inputs)
    gl.put(program, focal=_DEPTH_MM / mm_per_pixel, center=(SIDE / 2, SIDE / 2), taps=taps, frame=frame,
           sun=(0.0, 0.0, 0.0))  # fmt: skip
    gl.context().enable_only(moderngl.NOTHING)
    plane.target.use()
    plane.gather.array.render()
    gl.check()
    return gl.read(plane.target)[..., :3] * np.pi


@cache
def disc(x: float = SIDE / 2, y: float = SIDE / 2, radius: float = DISC) -> np.ndarray:
    """Coverage [SIDE, SIDE] of a disc around (x, y), in pixels."""
    place = (np.arange(SIDE * _FINE) + 0.5) / _FINE
    inside = np.hypot(place[None] - x, place[:, None] - y) < radius
    return inside.reshape(SIDE, _FINE, SIDE, _FINE).mean(axis=(1, 3))


def half_plane() -> np.ndarray:
    """Coverage [SIDE, SIDE] of the left half."""
    return np.repeat((np.arange(SIDE) < SIDE / 2)[None].astype(float), SIDE, axis=0)


def _points(plane: Plane, tone: str, mm_per_pixel: float) -> tuple[np.ndarray, np.ndarray]:
    """Radii [P] in pixels that stand for a tone's profile, and their shares [P, 3]."""
    profile = plane.luts.profile(*chromophores(tone))
    edges, energy = profile.radius_edges_mm, profile.energy
    rho = edges[:-1, None] + np.diff(edges)[:, None] * (np.arange(_PARTS) + 0.5) / _PARTS
    return rho.ravel() / mm_per_pixel, np.repeat(energy / energy.sum(axis=0), _PARTS, axis=0) / _PARTS


def blurred_disc(plane: Plane, tone: str, mm_per_pixel: float, radius: float = DISC) -> np.ndarray:
    """What should leave [SIDE, SIDE, 3] of a disc of light 1 in the middle, relative to the skin's color.

    A ring of radius p around a point r from the center lies in the disc where r^2 + p^2 - 2 r p cos < a^2. Where the
    profile ends within some pixels the disc's edge stays sharp, so radii are dense there.
    """
    rho, share = _points(plane, tone, mm_per_pixel)
    r = np.concatenate([np.linspace(1e-3, 2 * radius, 600), np.linspace(2 * radius, SIDE, 600)[1:]])
    cosine = (r[:, None] ** 2 + rho**2 - radius**2) / (2 * r[:, None] * rho)
    density = (np.arccos(np.clip(cosine, -1, 1)) / np.pi) @ share
    half = (np.arange(SIDE // 2 * _FINE) + 0.5) / _FINE
    distance = np.hypot(half[None], half[:, None])
    quarter = np.stack([np.interp(distance, r, density[:, c]) for c in range(3)], axis=-1)
    quarter = quarter.reshape(SIDE // 2, _FINE, SIDE // 2, _FINE, 3).mean(axis=(1, 3))
    upper = np.concatenate([quarter[:, ::-1], quarter], axis=1)
    return np.concatenate([upper[::-1], upper], axis=0)


def blurred_edge(plane: Plane, tone: str, mm_per_pixel: float) -> np.ndarray:
    """What should leave [SIDE, 3] across the edge of a lit left half-plane, relative to the skin's color."""
    rho, share = _points(plane, tone, mm_per_pixel)
    fine = (np.arange(SIDE * _FINE) + 0.5) / _FINE - SIDE / 2
    lit = np.arccos(np.clip(fine[:, None] / rho, -1, 1)) / np.pi @ share
    return lit.reshape(SIDE, _FINE, 3).mean(axis=1)


def encircled(image: np.ndarray, x: float, y: float, radii: np.ndarray) -> np.ndarray:
    """Light [R, 3] of an image within whole radii in pixels around (x, y)."""
    place = np.arange(SIDE) + 0.5
    ring = np.ceil(np.hypot(place[None] - x, place[:, None] - y)).astype(int).ravel()
    parts = np.stack([np.bincount(ring, image[..., c].ravel(), SIDE) for c in range(3)], axis=1)
    return np.cumsum(parts, axis=0)[radii]


def searchlight(
    plane: Plane, tone: str, mm_per_pixel: float, taps: int, frames: int = 1, places: Iterable[int] = PLACES,
    tables: tuple[moderngl.Texture3D, moderngl.Texture3D] | None = None,
) -> float:  # fmt: skip
    """Largest difference of encircled energy of a disc's light, of any radius and channel, at the worst place.

    Places are those of the disc in the gather's pattern. It averages over pixels, so that noise hardly counts:
    `edge_noise` tells that.
    """
    radii, middle = np.arange(1, SIDE // 2 - 4), disc()
    key = "searchlight", tone, mm_per_pixel
    if key not in plane.expected:
        ideal = blurred_disc(plane, tone, mm_per_pixel) / (np.pi * DISC**2)
        plane.expected[key] = encircled(ideal, SIDE / 2, SIDE / 2, radii)
    skin = chromophores(tone)
    whole = plane.luts.color(*skin, space="acescg") * middle.sum()
    worst = 0.0
    for place in places:
        down, right = place // 4, place % 4
        light = np.roll(middle, (down, right), axis=(0, 1))[..., None]
        out = np.mean([scattered(plane, light, skin, mm_per_pixel, taps, f, tables) for f in range(frames)], axis=0)
        shares = encircled(out / whole, SIDE / 2 + right, SIDE / 2 + down, radii)
        worst = max(worst, float(np.abs(shares - plane.expected[key]).max()))
    return worst


def edge_noise(
    plane: Plane, tone: str, taps: int, frames: int = 1, mm_per_pixel: float = EDGE_MM_PER_PIXEL,
    tables: tuple[moderngl.Texture3D, moderngl.Texture3D] | None = None,
) -> float:  # fmt: skip
    """RMS error within a millimetre of the edge of a lit half-plane, of the worst channel, full light being 1."""
    key = "edge", tone, mm_per_pixel
    if key not in plane.expected:
        plane.expected[key] = blurred_edge(plane, tone, mm_per_pixel)
    skin, light = chromophores(tone), half_plane()[..., None]
    out = np.mean([scattered(plane, light, skin, mm_per_pixel, taps, f, tables) for f in range(frames)], axis=0)
    off = out / plane.luts.color(*skin, space="acescg") - plane.expected[key]
    near = np.abs(np.arange(SIDE) + 0.5 - SIDE / 2) < 1 / mm_per_pixel
    rows = slice(SIDE // 4, -SIDE // 4)
    return float(np.sqrt((off[rows, near] ** 2).mean(axis=(0, 1))).max())
