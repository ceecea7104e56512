"""Pictures that hold data: read with every bit and their alpha, written with 16 bits.

Pillow keeps 8 of a color channel's 16 bits. It reads the upper byte of each; told that the bytes lie the other way
round it reads the lower one, and both together are the channel.
"""

from __future__ import annotations

import struct
import warnings
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lutgen.errors import InputError

_SWAPPED = {"16B": "16L", "16L": "16B", "16N": "16B" if np.little_endian else "16L"}
_PLANAR, _BITS = 284, 258
"""Tags of TIFF."""


@dataclass(frozen=True)
class Picture:
    """`values` [rows, columns, 1 or 3], first row on top; `alpha` [rows, columns] or None. `bits`: 8 or 16 of texels in
    0 to 1, 32 of values as they are. `chromaticities`: what an EXR says of its colors."""

    values: np.ndarray
    alpha: np.ndarray | None
    bits: int
    chromaticities: tuple[float, ...] | None = None


def read(path: Path, what: str) -> Picture:
    """A picture of any kind: EXR, or what Pillow opens; gray, palette or color, with alpha or without, of any size.

    `what` it is begins each message. InputError for anything else, and for NaN.
    """
    path = Path(path)
    if path.is_dir():
        raise InputError(f"{what} {path}: is a folder; give a picture in it")
    if not path.is_file():
        raise InputError(f"{what} {path}: there is no such file")
    if not path.stat().st_size:
        raise InputError(f"{what} {path}: the file is empty")
    found = _exr(path, what) if path.suffix.lower() == ".exr" else _pillow(path, what)
    if not np.all(np.isfinite(found.values)) or not (found.alpha is None or np.all(np.isfinite(found.alpha))):
        raise InputError(f"{what} {path}: holds NaN or infinite values; mend it")
    return found


def _exr(path: Path, what: str) -> Picture:
    from lutgen.files import exr

    try:
        part = next(iter(exr.read(path).values()))
        channels = part.channels
        layers = (name.removesuffix("R") for name in channels if name == "R" or name.endswith(".R"))
        layer = next((one for one in layers if all(one + c in channels for c in "GB")), "")
        channels = {name.removeprefix(layer): values for name, values in channels.items() if name.startswith(layer)}
        alpha = channels.get("A") if len(channels) > 1 else None
        colors = {name: values for name, values in channels.items() if alpha is None or name != "A"}
        names = [n for n in "RGB" if n in colors] if set("RGB") <= set(colors) else sorted(colors)[-1:]
        values = np.stack([colors[n].astype("f4") for n in names], axis=-1)
        if alpha is not None and alpha.shape != values.shape[:2]:
            raise ValueError
        return Picture(values, None if alpha is None else alpha.astype("f4"), 32, part.chromaticities)
    except ValueError as error:  # InputError too, which speaks of LUT sets
        raise InputError(f"{what} {path}: not a whole OpenEXR file, or its channels differ in size") from error


def _pillow(path: Path, what: str) -> Picture:
    from PIL import Image

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # 16k maps are no bombs
            with Image.open(path) as image:
                deep = [_raw_mode(tile) for tile in getattr(image, "tile", ())]
                clear = "transparency" in image.info
                if getattr(image, "tag_v2", {}).get(_PLANAR) == 2 and max(image.tag_v2.get(_BITS, (8,))) > 8:  # type: ignore
                    raise InputError(
                        f"{what} {path}: a TIFF whose channels lie one after the other; save it interleaved, or as PNG"
                    )
                image.load()
            if image.mode in ("RGB", "RGBA") and deep and all(d and d.startswith("RGB") and "16" in d for d in deep):
                return _deep(path, np.asarray(image))
        if image.mode == "F":
            return Picture(np.asarray(image, "f4")[..., None], None, 32)
        if image.mode.startswith("I"):
            values = np.asarray(image, float)[..., None]
            if values.max() > 65535 or values.min() < 0:
                raise InputError(f"{what} {path}: holds integers of 32 bits; save it with 8 or 16, or as EXR")
            return Picture((values / 65535).astype("f4"), None, 16)
        gray = image.mode in ("1", "L", "LA", "La")
        has_alpha = clear or image.mode in ("LA", "La", "PA", "RGBA", "RGBa")
        texels = np.asarray(image.convert(("LA" if gray else "RGBA") if has_alpha else ("L" if gray else "RGB")))
        return _split((texels if texels.ndim == 3 else texels[..., None]).astype("f4") / np.float32(255), has_alpha, 8)
    except InputError:
        raise
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise InputError(f"{what} {path}: not a picture that can be read ({error})") from error


def _split(texels: np.ndarray, has_alpha: bool, bits: int) -> Picture:
    return Picture(texels[..., :-1], texels[..., -1], bits) if has_alpha else Picture(texels, None, bits)


def _raw_mode(tile) -> str | None:
    """How a part of a Pillow image says that its bytes lie."""
    return tile[3] if isinstance(tile[3], str) else next((one for one in tile[3] or () if isinstance(one, str)), None)


def _other_bytes(tile):
    """The same part, told that its bytes lie the other way round."""
    raw = _raw_mode(tile) or ""
    swap = raw[:-3] + _SWAPPED.get(raw[-3:], raw[-3:])
    given = tile[3]
    arguments = swap if isinstance(given, str) else tuple(swap if one == raw else one for one in given)
    return tile._replace(args=arguments) if hasattr(tile, "_replace") else (*tile[:3], arguments)  # names: Pillow 11


def _deep(path: Path, upper: np.ndarray) -> Picture:
    """A picture of 16 bits a color channel, whose upper bytes are known."""
    from PIL import Image

    with Image.open(path) as image:
        image.tile = [_other_bytes(tile) for tile in image.tile]  # type: ignore[assignment]
        image.load()
        lower = np.asarray(image)
    values = (np.float32(256) * upper + lower) / np.float32(65535)
    return _split(values, values.shape[-1] == 4, 16)


def write_16_bit(path: Path, texels: np.ndarray) -> None:
    """Write texels in 0 to 1 [rows, columns] or [rows, columns, 3 or 4] as PNG of 16 bits a channel, clipped."""
    texels = texels if texels.ndim == 3 else texels[..., None]
    rows, columns, channels = texels.shape
    big = np.rint(np.clip(texels, 0, 1) * np.float32(65535)).astype(">u2").reshape(rows, -1).view("u1")
    lines = np.empty((rows, big.shape[1] + 1), "u1")
    lines[:, 0] = 2  # each row less the one above
    lines[0, 1:], lines[1:, 1:] = big[0], big[1:] - big[:-1]
    header = struct.pack(">IIBBBBB", columns, rows, 16, {1: 0, 3: 2, 4: 6}[channels], 0, 0, 0)
    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n")
        for kind, data in ((b"IHDR", header), (b"IDAT", zlib.compress(lines.tobytes(), 3)), (b"IEND", b"")):
            file.write(struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)))
