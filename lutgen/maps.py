"""Texture maps of a head: what each is called, how it is encoded, and how a folder of them becomes four textures.

Chromophore maps hold ratios that the sliders' values are multiplied with. As 8- or 16-bit pictures a texel t in 0 to 1
stands for the ratio 4 t^3, so that dark and light tones get equal steps (1 is t = 0.63); as EXR for the ratio itself.
Roughness and specular are ratios 2 t; occlusion is t; thickness is 32 t mm; in EXR all are values as they are.
Row 0 of every array here is the bottom of the picture, where v is 0.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lutgen.errors import InputError

RATIO_RANGE, SURFACE_RANGE, THICKNESS_MM = 4.0, 2.0, 32.0
RATIOS = ("melanin", "eumelanin", "hemoglobin")
SURFACE = ("roughness", "specular", "occlusion", "thickness")
NAMES = (*RATIOS, *SURFACE, "normal", "albedo")
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


def read(path: Path) -> tuple[np.ndarray, bool]:
    """A picture [rows, columns, 1 or 3 channels], first row lowest, and whether it holds values or texels 0 to 1.

    EXR and 32-bit float TIFF hold values; 8- and 16-bit pictures texels: gray, palette or color, with alpha or without,
    of any size. InputError for anything else, and for NaN.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"map {path}: there is no such file")
    values, given = (_exr(path), True) if path.suffix.lower() == ".exr" else _picture(path)
    if not np.all(np.isfinite(values)):
        raise InputError(f"map {path}: holds NaN or infinite values; mend it")
    return values[::-1], given


def _exr(path: Path) -> np.ndarray:
    from lutgen import exr

    try:
        channels = next(iter(exr.read(path).values())).channels
        names = [n for n in "RGB" if n in channels] if set("RGB") <= set(channels) else sorted(channels)[-1:]
        return np.stack([channels[n].astype(float) for n in names], axis=-1)
    except ValueError as error:  # InputError too, which speaks of LUT sets
        raise InputError(f"map {path}: not a whole OpenEXR file, or its channels differ in size") from error


def _picture(path: Path) -> tuple[np.ndarray, bool]:
    from PIL import Image

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # 16k maps are no bombs
            with Image.open(path) as image:
                image.load()
        if image.mode == "F":
            return np.asarray(image, float)[..., None], True
        if image.mode.startswith("I"):
            values = np.asarray(image, float)[..., None]
            if values.max() > 65535 or values.min() < 0:
                raise InputError(f"map {path}: holds integers of 32 bits; save it with 8 or 16, or as EXR")
            return values / 65535, False
        if image.mode in ("1", "L", "LA"):
            return np.asarray(image.convert("L"), float)[..., None] / 255, False
        return np.asarray(image.convert("RGB"), float) / 255, False
    except InputError:
        raise
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise InputError(f"map {path}: not a picture that can be read ({error})") from error


def load(folder: Path, under: Maps | None = None) -> Maps:
    """The maps that a folder holds, by name (`melanin.png`, `thickness.exr` ...); InputError where there is none.

    Each replaces that one map of `under`, the others stay: an occlusion map leaves the thickness that was there. An
    albedo takes the place of the chromophores under it, for lips and freckles are painted into it already.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"maps = {folder}: there is no such folder")
    found = {}
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() in SUFFIXES and path.stem in NAMES:
            if path.stem in found:
                raise InputError(f"maps: {path.stem} is there twice, {found[path.stem].name} and {path.name}; keep one")
            found[path.stem] = path
    if not found:
        raise InputError(f"maps = {folder}: holds none of {', '.join(NAMES)} (as {', '.join(SUFFIXES)})")
    values = {name: _decoded(name, *read(path)) for name, path in found.items()}
    for name in values.keys() - {"normal", "albedo"}:
        if values[name].min() < 0:
            raise InputError(f"map {found[name]}: holds negative values, down to {values[name].min():g}; mend it")
    below = under or Maps()
    return Maps(
        _together(values, RATIOS, None if "albedo" in values else below.chromophores),
        _together(values, SURFACE, below.surface),
        _color(values["normal"]) if "normal" in values else below.normal,
        _color(values["albedo"]) if "albedo" in values else below.albedo,
        below.full_contrast_melanin,
    )  # fmt: skip


def ratio(path: Path) -> np.ndarray:
    """The ratios [rows, columns] that a chromophore map holds; its name says which."""
    return _decoded(Path(path).stem, *read(path))


def _decoded(name: str, values: np.ndarray, given: bool) -> np.ndarray:
    """What a map's texels stand for; thickness as a share of 32 mm."""
    if name in ("normal", "albedo"):
        if name == "albedo" and not given:
            return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
        return values
    values = values.mean(axis=-1)
    if given:
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
