"""Pictures to compare: what `lutgen render` and `lutgen view` write, any other EXR, or an 8-bit picture."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lutgen import color
from lutgen.errors import InputError
from lutgen.files import exr, images
from lutgen.render import film as rendered

COVERED = 0.99
"""Share of a pixel that must be skin for it to count: outlines, which every renderer filters in its own way, do not."""


@dataclass(frozen=True)
class Picture:
    """Linear ACEScg [rows, columns, 3], covariance of its noise [rows, columns, 3, 3] or None, share of skin or None.

    `notes`: what was taken for granted. `seed`: of the render that it is.
    """

    name: str
    acescg: np.ndarray
    covariance: np.ndarray | None
    skin: np.ndarray | None
    notes: tuple[str, ...] = ()
    seed: int | None = None


def read(path: Path | str) -> Picture:
    """A picture from its file, first row on top.

    EXR: R, G and B linear, in ACEScg where the file says so, else Rec. 709; `mask`, or else A, the share of skin; noise
    from the moments that `lutgen render` keeps, or from `sigma.R`, `sigma.G`, `sigma.B` as if channels erred each by
    itself. Texels of 8 or 16 bits: sRGB, A the share of skin. Raises InputError for a file that is missing or no
    picture, and for NaN or infinite values.
    """
    path = Path(path)
    image = images.read(path, "picture", finite=False)
    picture = _linear(image, path) if image.bits == 32 else _display(image, path.name)
    for what, values in (("", picture.acescg), (" in its noise", picture.covariance), (" in its mask", picture.skin)):
        broken = np.zeros((1, 1), bool) if values is None else ~np.isfinite(values)
        if broken.any():
            row, column = np.argwhere(broken)[0][:2]
            raise InputError(
                f"picture {path}: holds {int(broken.sum())} NaN or infinite values{what}, the first at row {row}, "
                f"column {column}; render it anew"
            )
    return picture


def _linear(image: images.Image, path: Path) -> Picture:
    """A picture of floats."""
    part = image.part or exr.Part("", {"Y": image.values[..., 0]}, {})  # of floats Pillow reads gray ones only
    channels = part.channels
    shapes = {values.shape for values in channels.values()}
    if not set("RGB") <= set(channels) or len(shapes) != 1:
        raise InputError(f"picture {path}: has channels {', '.join(channels)}; R, G and B of one size are needed")
    rgb = part.stack("RGB").astype("f8")
    skin = next((channels[name].astype("f8") for name in ("mask", "A") if name in channels), None)
    if np.allclose(part.chromaticities, exr.ACESCG, atol=1e-4):
        covariance, notes = _noise(part, rgb, path)
        seed = part.attributes.get("render", {}).get("recipe", {}).get("seed")
        return Picture(path.name, rgb, covariance, skin, notes, seed)
    if not np.allclose(part.chromaticities, exr.REC709, atol=1e-4):
        raise InputError(f"picture {path}: has other primaries than ACEScg and Rec. 709; convert it")
    return Picture(path.name, color.to_acescg(rgb), None, skin)


def _noise(part: exr.Part, rgb: np.ndarray, path: Path) -> tuple[np.ndarray | None, tuple[str, ...]]:
    """Covariance of a picture's pixels, and what has to be said about it."""
    if "render" in part.attributes:
        render = rendered.read(path)
        guessed = (f"{path.name}: of one sample, so its noise is a guess",)
        return render.covariance(), () if render.estimates > 1 else guessed
    names = [f"sigma.{name}" for name in "RGB"]
    if not set(names) <= set(part.channels):
        return None, ()
    sigma = np.stack([part.channels[name] for name in names], axis=-1).astype("f8")
    covariance = np.zeros((*sigma.shape, 3))
    covariance[..., range(3), range(3)] = sigma**2
    return covariance, (f"{path.name}: noise of its channels is taken to be independent",)


def _display(image: images.Image, name: str) -> Picture:
    """A picture of texels, as a display shows it."""
    srgb = images.as_floats(image.pixels, "f8")
    colors = np.broadcast_to(srgb[..., :-1] if image.has_alpha else srgb, (*srgb.shape[:2], 3))
    note = f"{name}: {image.bits}-bit sRGB, so a tone curve in it counts as difference"
    skin = srgb[..., -1] if image.has_alpha else None
    return Picture(name, color.to_acescg(color.decode_srgb(colors)), None, skin, (note,))


def mask(a: Picture, b: Picture) -> tuple[np.ndarray, tuple[str, ...]]:
    """Pixels [rows, columns] that both show skin in, and what has to be said about them.

    Without a mask in either, all pixels that are black in neither. Raises InputError where the sizes differ or no pixel
    is left.
    """
    if a.acescg.shape != b.acescg.shape:
        sizes = [f"{picture.name} is {picture.acescg.shape[1]} x {picture.acescg.shape[0]}" for picture in (a, b)]
        raise InputError(f"{sizes[0]}, {sizes[1]}: pictures of one size are needed; render one of them anew")
    masks = [picture.skin >= COVERED for picture in (a, b) if picture.skin is not None]
    notes = ()
    if not masks:
        masks = [np.any(picture.acescg != 0, axis=-1) for picture in (a, b)]
        notes = ("no mask in either: every pixel that is not black counts",)
    both = np.logical_and.reduce(masks)
    if not both.any():
        raise InputError(f"{a.name}, {b.name}: no pixel shows skin in both; nothing to compare")
    return both, notes
