"""A scene on the device: head, maps, light and skin as the renderer's kernels read them (kernels/render/scene.cl)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lutgen import device as ocl
from lutgen.errors import in_range
from lutgen.files import texture_maps
from lutgen.files.texture_maps import Maps
from lutgen.head import pores
from lutgen.head.mesh import Mesh
from lutgen.render import bvh
from lutgen.scene import environment, subject, surface
from lutgen.scene import light as lighting
from lutgen.scene import look as looks
from lutgen.scene.look import Look
from lutgen.skin import chromophores
from lutgen.tables.lut_set import LutSet

PLAIN = {"chromophore": (1.0, 1.0, 1.0, 1.0), "surface": (1.0, 1.0, 1.0, 1.0), "normal": (0.5, 0.5, 1.0, 1.0),
         "detail": (1.0, 1.0, 1.0, 1.0)}  # fmt: skip
"""What stands for a map that is not given, as in the viewer; a map's missing channels are 1."""
WAVE, NU = 10, 6
"""Columns of `waves`, and which of them is the life rate."""
SCENE = (
    ("boxes", "float"), ("children", "int"), ("shapes", "float"), ("numbers", "int"),  # the tree: trace.cl
    ("view", "view_t"),
    ("vertices", "float8"),  # position, normal, texture coordinates
    ("corners", "int"),  # three per triangle
    ("chromophore_map", "half"), ("surface_map", "half"), ("normal_map", "half"), ("detail_map", "half"),
    ("pore_map", "float4"), ("environment_map", "float4"),
    ("sky", "float"),  # how bright the environment is, over an octahedron
    ("lobe_table", "float2"),  # energy of a GGX lobe over (roughness, root of the cosine)
    ("waves", "float"),  # WAVE floats per wavelength
)  # fmt: skip
"""The buffers of a scene, name and element type: parameters, arguments and `scene_t` of its kernels."""
BASE = (
    "common/lanes", "common/rng", "render/trace", "common/frame", "render/scene", "render/light",
    "render/surface_light", "render/moments",
)  # fmt: skip
TALLIES = ("CAMERA_RAYS", "PROBES", "SUN_RAYS", "SKY_RAYS", "HITS", "BACKS", "MISSES", "REJECTED", "BOUNCES", "BROKEN")
"""What kernels count: rays by kind (the first four); camera rays that met skin, and those on back faces; exits without
a surface, or on one that faces away; paths from skin to skin; samples that were not finite."""
FAINT = 0.02
"""Reflected light below this share of the scene's is not looked for with every sample."""
PIXELS = {"cpu": 64, "gpu": 1}
"""Pixels that one work-item takes in turn."""
CANDIDATES, STRIDE, SKY_CELLS, LEAST_SKY = 4, 1, 64, 0.25
"""Directions into the surroundings that one is drawn from, in which order of sine; cells along a side of the table that
they are drawn by, and what each counts at least, as a share of the mean radiance."""
SUNLIT = 0.1
"""Of light that meets skin, about what it sends on."""
STUDIO_ROWS, MOST_ROWS = 256, 1024
_LOBES = len(surface.ggx_energy())

VIEW = np.dtype(
    [(name, "f4", (3,)) for name in ("eye", "forward", "right", "up", "sun_direction", "sun_color")]
    + [(name, "f4", (3,)) for name in ("chromophores", "chromophores_low", "chromophores_high")]
    + [("turn", "f4", (2,))]
    + [(f"{name}_size", "i4", (2,)) for name in PLAIN]
    + [
        (name, "f4")
        for name in ("sun_spread", "environment", "faint", "roughness", "specular", "bumps", "entry", "pore_side_mm")
    ]
    + [(name, "i4") for name in ("columns", "rows", "pore_texels", "environment_rows", "sunny", "around", "bounces")]
    + [("seed", "u4")]
)
"""What stays the same over a picture; `view_t` in the kernels."""


@dataclass(frozen=True)
class DeviceScene:
    """One head, skin and light on a device; `buffers` by the names of SCENE."""

    device: ocl.Device
    luts: LutSet
    shape: Mesh
    view: np.ndarray
    buffers: dict[str, Any]
    width: int

    @property
    def arguments(self) -> tuple:
        """What a kernel's SCENE takes."""
        return tuple(self.buffers[name] for name, _ in SCENE)

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows of the picture."""
        return int(self.view["columns"]), int(self.view["rows"])


def open_scene(
    device: ocl.Device, luts: LutSet, shape: Mesh, given: Maps, look: Look, size: tuple[int, int],
    around: np.ndarray | None = None, seed: int = 0, bounces: int = 3, tree: bvh.Bvh | None = None,
) -> DeviceScene:  # fmt: skip
    """Upload a head, its maps, a skin and its light; InputError where the LUT set does not cover the look's skin.

    `around` is radiance as of `environment.read`; None: the studio. Light reflected from skin to skin is followed
    `bounces` times. `tree`: the head's own, of `tree_of`, where several scenes show one head.
    """
    grid = luts.color_lut.grid
    for axis in grid.axes[::-1]:
        in_range(axis.name, getattr(look, axis.name), axis.low, axis.high)
    if look.oxygenation != luts.oxygenation:
        luts = luts.expand(oxygenation=look.oxygenation)
    tree = tree_of(device, shape) if tree is None else tree
    textures = {name: _texels(values, PLAIN[name]) for name, values in _named(given, look).items()}
    radiance = _surroundings(around)
    view = _view(luts, look, size, textures, radiance, seed, bounces)
    uv = np.zeros((len(shape.positions_mm), 2)) if shape.uv is None else shape.uv
    arrays = {
        "boxes": tree.boxes, "children": tree.children, "shapes": tree.triangles, "numbers": tree.numbers, "view": view,
        "vertices": np.concatenate([shape.positions_mm, shape.normals, uv], axis=1).astype("f4"),
        "corners": shape.triangles.astype("i4"), **{f"{name}_map": textures[name] for name in PLAIN},
        "pore_map": pores.texture(), "environment_map": radiance, "sky": _sky(radiance[..., :3], look),
        "lobe_table": surface.ggx_energy().astype("f4"), "waves": waves(luts, look.oxygenation),
    }  # fmt: skip
    return DeviceScene(
        device, luts, shape, view, {name: ocl.buffer(device, arrays[name]) for name, _ in SCENE}, tree.width
    )


def tree_of(device: ocl.Device, shape: Mesh) -> bvh.Bvh:
    """The tree over a head's triangles, as wide as the device's lanes."""
    return bvh.build(shape.positions_mm, shape.triangles, max(device.lanes, 4))


def items(scene: DeviceScene, pixels: int) -> int:
    """Work-items that take that many pixels."""
    return -(-pixels // _pixels(scene))


def _pixels(scene: DeviceScene) -> int:
    return PIXELS["gpu" if scene.device.kind == "gpu" else "cpu"]


def _scene_source() -> str:
    """What kernels call the table of buffers: SCENE, SCENE_HERE and scene_t."""
    parameters = ", ".join(f"__global const {element} *restrict {name}" for name, element in SCENE)
    fields = " ".join(f"__global const {element} *{name};" for name, element in SCENE)
    here = ", ".join(name for name, _ in SCENE)
    return f"#define SCENE {parameters}\n#define SCENE_HERE {{{here}}}\ntypedef struct {{ {fields} }} scene_t;\n"


def kernel(scene: DeviceScene, entry: str, *names: str, structs: tuple = (), **constants: float):
    """A built kernel over the scene: of the files named and those that they build on, one lane per work-item."""
    fixed = {
        "W": 1, "WIDTH": scene.width, "WAVES": len(scene.luts.weights), "LOBES": _LOBES,
        "ENTRY": scene.luts.paths.entry,
        **{name: number for number, name in enumerate(TALLIES)}, "TALLIES": len(TALLIES),
        "PIXELS": _pixels(scene), "CANDIDATES": CANDIDATES, "STRIDE": STRIDE, "SKY_CELLS": SKY_CELLS,
        "TURN_COSINE": float(np.cos(2 * np.pi / CANDIDATES)), "TURN_SINE": float(np.sin(2 * np.pi / CANDIDATES)),
    }  # fmt: skip
    text = (
        ocl.struct_source(scene.device, (("view_t", VIEW), *structs))
        + _scene_source()
        + surface.opencl(scene.luts.manifest["trace"]["n"])
        + ocl.source(*BASE, *names)
    )
    whole = {name: value for name, value in (fixed | constants).items() if isinstance(value, int)}
    reals = {name: value for name, value in (fixed | constants).items() if isinstance(value, float)}
    return ocl.kernel(scene.device, entry, "".join(f"#define {n} {v:.9e}f\n" for n, v in reals.items()) + text, whole)


def waves(luts: LutSet, oxygenation: float) -> np.ndarray:
    """What each wavelength [K, 10] absorbs with, how fast lives end, and its ACEScg weight; columns as in scene.cl."""
    nm, extra = luts.paths.wavelength_nm, luts.absorbers
    one, none = np.ones_like(nm), np.zeros_like(nm)
    absorbed = (
        *(chromophores.epidermis(nm, melanin, eu) for melanin, eu in ((one, one), (one, none), (none, one))),
        chromophores.dermis(nm, one, oxygenation), extra.epidermis, extra.dermis, luts.paths.nu_per_mm,
    )  # fmt: skip
    return np.concatenate([np.stack(absorbed, axis=1), luts.weights], axis=1).astype("f4")


def _named(given: Maps, look: Look) -> dict[str, np.ndarray | None]:
    """Maps by the kernels' names; the contrast of chromophores on the look's skin is in their ratios.

    The viewer raises what it has read between texels, here the texels are raised: `pow` costs a fifth of a picture.
    """
    textures = subject.textures_of(given)
    named = {name: textures.get("chromophores" if name == "chromophore" else name) for name in PLAIN}
    ratios = named["chromophore"]
    if ratios is not None:
        melanin, hemoglobin = texture_maps.contrast(given.full_contrast_melanin, look.melanin)
        named["chromophore"] = ratios.astype("f4") ** np.array([melanin, 1.0, hemoglobin], "f4")
    return named


def _texels(values: np.ndarray | None, plain: tuple[float, ...]) -> np.ndarray:
    """A map as half floats [rows, columns, 4], 8-bit texels as 0 to 1."""
    if values is None:
        return np.array([[plain]], "f2")
    layers = values[..., None] if values.ndim == 2 else values
    whole = np.ones((*layers.shape[:2], 4), "f2")
    whole[..., : layers.shape[2]] = layers / 255 if layers.dtype == np.uint8 else layers
    return whole


def _surroundings(around: np.ndarray | None) -> np.ndarray:
    """Radiance [rows, 2 rows, 4] of the surroundings, the studio's where none are given."""
    if around is None:
        ways, _ = environment.directions(STUDIO_ROWS)
        radiance = lighting.studio(ways.reshape(-1, 3)).reshape(*ways.shape)
    else:
        radiance = environment.resampled(around, MOST_ROWS) if len(around) > MOST_ROWS else around
    return np.concatenate([radiance, np.zeros((*radiance.shape[:2], 1))], axis=-1).astype("f4")


def _sky(radiance: np.ndarray, look: Look) -> np.ndarray:
    """Mean radiance [64, 64] of the surroundings by cells of an octahedron, unfolded with the sky in the middle.

    Skin may be there instead: none is less than a share of the mean, or of what sunlit skin sends.
    """
    finer = np.repeat(np.repeat(radiance, k := -(-STUDIO_ROWS // len(radiance)), axis=0), k, axis=1)
    ways, angle = environment.directions(len(finer))
    p = ways / np.abs(ways).sum(axis=-1, keepdims=True)
    x, z = (np.where(p[..., 1] < 0, np.copysign(1 - np.abs(p[..., 2 - i]), p[..., i]), p[..., i]) for i in (0, 2))
    column, row = (np.minimum((0.5 + 0.5 * v) * SKY_CELLS, SKY_CELLS - 1).astype(int) for v in (x, z))
    cell = (row * SKY_CELLS + column).ravel()
    light = look.environment * np.bincount(cell, (finer.mean(axis=-1) * angle).ravel(), SKY_CELLS**2)
    mean = light / np.maximum(np.bincount(cell, angle.ravel(), SKY_CELLS**2), 1e-9)
    least = LEAST_SKY * max(mean.mean(), SUNLIT * look.light / np.pi)
    return np.maximum(mean, max(least, 1e-20)).astype("f4")


def _view(
    luts: LutSet, look: Look, size: tuple[int, int], textures: Mapping, radiance: np.ndarray, seed: int, bounces: int
) -> np.ndarray:  # fmt: skip
    camera = looks.camera(look, *size)
    side, up, back = camera.view[:3, :3]
    grid = luts.color_lut.grid
    axes = grid.axes[::-1]
    turn = np.radians(look.environment_azimuth)
    values = {
        "eye": camera.eye_mm, "forward": -back, "right": side / camera.projection[0, 0],
        "up": up / camera.projection[1, 1], "sun_direction": looks.light_direction(look),
        "sun_color": look.light * lighting.SUN, "sun_spread": 2 * np.sin(np.radians(look.light_size) / 2) ** 2,
        "chromophores": [getattr(look, a.name) for a in axes], "chromophores_low": [a.low for a in axes],
        "chromophores_high": [a.high for a in axes],
        "turn": (np.cos(turn), np.sin(turn)), "environment": look.environment,
        "faint": FAINT * (look.light / np.pi + look.environment * float(radiance[..., :3].mean())) + 1e-20,
        "roughness": look.roughness, "specular": look.specular, "bumps": look.bumps, "entry": look.entry,
        "pore_side_mm": pores.SIDE_MM, "columns": size[0], "rows": size[1], "pore_texels": pores.TEXELS,
        "environment_rows": len(radiance), "sunny": look.light > 0, "bounces": bounces,
        "around": (look.environment > 0 and radiance[..., :3].any()) or (look.light > 0 and bounces > 0), "seed": seed,
    }  # fmt: skip
    for name in PLAIN:
        values[f"{name}_size"] = textures[name].shape[1::-1]
    view = np.zeros((), VIEW)
    for name, value in values.items():
        view[name] = value
    return view
