"""Texture maps of a head: what each is called, how it is encoded, and how a folder of them becomes four textures.

Chromophore maps hold ratios that the sliders' values are multiplied with. As 8- or 16-bit pictures a texel t in 0 to 1
stands for the ratio 4 t^3, so that dark and light tones get equal steps (1 is t = 0.63); as EXR for the ratio itself.
Roughness and specular are ratios 2 t; occlusion is t; thickness is 32 t mm; in EXR all are values as they are.
Row 0 of every array here is the bottom of the picture, where v is 0.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lutgen import color
from lutgen.errors import InputError, summary
from lutgen.files import images

RATIO_RANGE, SURFACE_RANGE, THICKNESS_MM = 4.0, 2.0, 32.0
RATIOS = ("melanin", "eumelanin", "hemoglobin")
SURFACE = ("roughness", "specular", "occlusion", "thickness")
NAMES = (*RATIOS, *SURFACE, "normal", "albedo")
REPORT = "maps.json"
"""What `lutgen maps` says of the maps it made."""
SUFFIXES = (".exr", ".png", ".jpg", ".jpeg", ".tif", ".tiff")


@dataclass(frozen=True)
class Maps:
    """Textures for the viewer: `chromophores` ratios [.., .., 3], `surface` [.., .., 4] (roughness and specular ratio,
    occlusion, thickness / 32 mm), `normal` [.., .., 3] in 0 to 1 (a fourth channel is the depth of the pores, which are
    whole without it), `albedo` linear sRGB [.., .., 3]; None: not given. `full_contrast_melanin`: the skin's up to
    which chromophore ratios hold as they are; on darker skin they fade."""

    chromophores: np.ndarray | None = None
    surface: np.ndarray | None = None
    normal: np.ndarray | None = None
    albedo: np.ndarray | None = None
    full_contrast_melanin: float = 0.0292

    __repr__ = summary


def encode_ratio(ratio: np.ndarray) -> np.ndarray:
    """The 8-bit texel of a ratio in 0 to 4.

    >>> encode_ratio(np.array([0.0, 1.0, 4.0])).tolist()
    [0, 161, 255]
    """
    return np.round(255 * np.cbrt(np.clip(ratio, 0, RATIO_RANGE) / RATIO_RANGE)).astype("u1")


def decode_ratio(texel: np.ndarray) -> np.ndarray:
    """The ratio of a texel in 0 to 1.

    >>> round(float(decode_ratio(np.array(161 / 255))), 2)
    1.01
    """
    return RATIO_RANGE * np.asarray(texel, float) ** 3


def contrast(full_contrast_melanin: float, melanin: float) -> tuple[float, float]:
    """Exponents of melanin and hemoglobin ratios on a skin of that melanin: freckles and blotches fade on darker skin.

    >>> contrast(0.0292, 0.0195)
    (1.0, 1.0)
    """
    fade = min(full_contrast_melanin / melanin, 1.0)
    return fade**0.38, fade**0.15


def read(path: Path) -> tuple[np.ndarray, bool]:
    """A picture [rows, columns, 1 or 3 channels], first row lowest, and whether it holds values or texels 0 to 1.

    EXR and 32-bit float TIFF hold values; 8- and 16-bit pictures texels: gray, palette or color, with alpha or without,
    of any size. InputError for anything else, and for NaN.
    """
    image = images.read(path, "map")
    return image.values[::-1].astype(float), image.bits == 32


def load(folder: Path, under: Maps | None = None) -> Maps:
    """The maps that a folder holds, by name (`melanin.png`, `thickness.exr` ...); InputError where there is none.

    Each replaces that one map of `under`, the others stay: an occlusion map leaves the thickness that was there. An
    albedo takes the place of the chromophores under it, for lips and freckles are painted into it already; maps that
    `lutgen maps` made take the place of the albedo under them, which they were made of.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"maps = {folder}: there is no such folder")
    paths = {}
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() in SUFFIXES and path.stem in NAMES:
            if path.stem in paths:
                raise InputError(f"maps: {path.stem} is there twice, {paths[path.stem].name} and {path.name}; keep one")
            paths[path.stem] = path
    if not paths:
        raise InputError(f"maps = {folder}: holds none of {', '.join(NAMES)} (as {', '.join(SUFFIXES)})")
    values = {name: _decoded(name, *read(path)) for name, path in paths.items()}
    for name in values.keys() - {"normal", "albedo"}:
        if values[name].min() < 0:
            raise InputError(f"map {paths[name]}: holds negative values, down to {values[name].min():g}; mend it")
    below, melanin = under or Maps(), _melanin_of(folder)
    if melanin is not None:
        below = replace(below, albedo=None, full_contrast_melanin=melanin)
    return Maps(
        _together(values, RATIOS, None if "albedo" in values else below.chromophores),
        _together(values, SURFACE, below.surface),
        _color(values["normal"]) if "normal" in values else below.normal,
        _color(values["albedo"]) if "albedo" in values else below.albedo,
        below.full_contrast_melanin,
    )  # fmt: skip


def _melanin_of(folder: Path) -> float | None:
    """The median melanin that `lutgen maps` reports; None where the folder is not its own."""
    try:
        return float(json.loads((folder / REPORT).read_text())["skin"]["melanin"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


def ratio(path: Path) -> np.ndarray:
    """The ratios [rows, columns] that a chromophore map holds; its name says which."""
    return _decoded(Path(path).stem, *read(path))


def _decoded(name: str, values: np.ndarray, as_values: bool) -> np.ndarray:
    """What a map's texels stand for; thickness as a share of 32 mm."""
    if name in ("normal", "albedo"):
        if name == "albedo" and not as_values:
            return color.decode_srgb(values)
        return values
    values = values.mean(axis=-1)
    if as_values:
        return np.minimum(values / THICKNESS_MM, 1) if name == "thickness" else values
    return decode_ratio(values) if name in RATIOS else values * (SURFACE_RANGE if name in SURFACE[:2] else 1.0)


def _color(values: np.ndarray) -> np.ndarray:
    return np.broadcast_to(values, (*values.shape[:2], 3))


def _together(values: dict[str, np.ndarray], names: tuple[str, ...], below: np.ndarray | None) -> np.ndarray | None:
    """Maps of one texture stacked [rows, columns, channels] at the size of the largest; None where there is none.

    What is not given is what lies below, else 1.
    """
    layers = [
        values[name] if name in values else None if below is None else below[..., k] for k, name in enumerate(names)
    ]
    present = [layer for layer in layers if layer is not None]
    if not present:
        return None
    rows, columns = (max(v.shape[k] for v in present) for k in (0, 1))
    return np.stack([np.ones((rows, columns)) if v is None else resized(v, rows, columns) for v in layers], axis=-1)


def resized(values: np.ndarray, rows: int, columns: int) -> np.ndarray:
    """A map [R, C] read linearly at another size."""
    if values.shape == (rows, columns):
        return values
    down = np.clip((np.arange(rows) + 0.5) / rows * values.shape[0] - 0.5, 0, values.shape[0] - 1)
    across = np.clip((np.arange(columns) + 0.5) / columns * values.shape[1] - 0.5, 0, values.shape[1] - 1)
    by_row = np.array([np.interp(down, np.arange(values.shape[0]), values[:, k]) for k in range(values.shape[1])])
    return np.array([np.interp(across, np.arange(values.shape[1]), line) for line in by_row.T])
