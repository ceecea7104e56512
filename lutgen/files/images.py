"""Pictures from files: the one place that reads them, with every bit and their alpha; and that writes 16 bits.

What holds for all of them:

* An OpenEXR file is read by OpenEXR, a Radiance picture here, anything else by Pillow.
* Integers are texels, which stand for 0 to 1; floats are values as they are.
* Of several parts or frames the first is read, of it the data window.
* Colors are the channels R, G and B, else those of the first layer that has all three; of a picture with neither, the
  last channel by name is its gray.
* Alpha is what the file holds, and colors are not divided by it.
* Chromaticities are told and nothing is converted: what a picture means is for its reader to say.

Pillow keeps 8 of a color channel's 16 bits. It reads the upper byte of each; told that the bytes lie the other way
round it reads the lower one, and both together are the channel.
"""

from __future__ import annotations

import re
import struct
import warnings
import zlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lutgen.errors import InputError

if TYPE_CHECKING:
    from lutgen.files import exr

RADIANCE = (".hdr", ".pic")
_MOST_TEXELS = 1 << 28
_SWAPPED = {"16B": "16L", "16L": "16B", "16N": "16B" if np.little_endian else "16L"}
_PLANAR, _BITS = 284, 258
"""Tags of TIFF."""


@dataclass(frozen=True)
class Image:
    """A picture as its file holds it, first row on top.

    `pixels` [rows, columns, 1 or 3 colors and, if `has_alpha`, alpha]: uint8 or uint16 texels, or floats.
    `chromaticities` of the colors (red, green, blue, white, x and y each), where the file can say them. `part`: all
    that an OpenEXR file holds, colors included.
    """

    pixels: np.ndarray
    has_alpha: bool = False
    chromaticities: tuple[float, ...] | None = None
    part: exr.Part | None = None

    @property
    def bits(self) -> int:
        """8 or 16 of texels, 32 of values as they are."""
        return 8 * self.pixels.itemsize if self.pixels.dtype.kind == "u" else 32

    @cached_property
    def values(self) -> np.ndarray:
        """Colors or gray [rows, columns, 1 or 3] as floats, texels in 0 to 1."""
        return as_floats(self.pixels[..., :-1] if self.has_alpha else self.pixels)

    @cached_property
    def alpha(self) -> np.ndarray | None:
        """Alpha [rows, columns] as floats, texels in 0 to 1; None where the picture has none."""
        return as_floats(self.pixels[..., -1]) if self.has_alpha else None


def as_floats(pixels: np.ndarray, dtype: str = "f4") -> np.ndarray:
    """Texels in 0 to 1 as floats of that type; floats as they are."""
    return (
        pixels.astype(dtype) / np.dtype(dtype).type(np.iinfo(pixels.dtype).max) if pixels.dtype.kind == "u" else pixels
    )


def read(path: Path | str, what: str, finite: bool = True, radiance: bool = False) -> Image:
    """A picture of any kind: gray, palette or color, with alpha or without, of any size.

    `what` it is begins each message. Only surroundings come as `radiance` pictures. InputError for what is no picture,
    and, where it is to be `finite`, for NaN.
    """
    path = Path(path)
    try:
        if path.is_dir():
            raise InputError("is a folder; give a picture in it")
        if not path.is_file():
            raise InputError("there is no such file")
        if not path.stat().st_size:
            raise InputError("the file is empty")
        suffix = path.suffix.lower()
        image = (_exr if suffix == ".exr" else _radiance if radiance and suffix in RADIANCE else _pillow)(path)
        if finite and not np.all(np.isfinite(image.pixels)):
            raise InputError("holds NaN or infinite values; mend it")
    except InputError as error:
        raise InputError(f"{what} {path}: {error}") from error
    return image


def _exr(path: Path) -> Image:
    """The first part of an OpenEXR file."""
    from lutgen.files import exr

    try:
        part = next(iter(exr.read(path).values()))
        layers = [name.removesuffix("R") for name in part.channels if name == "R" or name.endswith(".R")]
        whole = [layer for layer in layers if all(layer + name in part.channels for name in "GB")]
        layer = whole[0] if whole and "" not in whole else ""
        channels = {n.removeprefix(layer): values for n, values in part.channels.items() if n.startswith(layer)}
        has_alpha = "A" in channels and len(channels) > 1
        colors = sorted(name for name in channels if name != "A" or not has_alpha)
        names = [*("RGB" if set("RGB") <= set(colors) else colors[-1:]), *("A" if has_alpha else "")]
        pixels = np.stack([channels[name].astype("f4") for name in names], axis=-1)
        return Image(pixels, has_alpha, part.chromaticities, part)
    except ValueError as error:  # InputError too, which speaks of LUT sets
        raise InputError("not a whole OpenEXR file, or its channels differ in size") from error


def _radiance(path: Path) -> Image:
    """A Radiance picture of the kind `-Y rows +X columns` in RGBE (Ward 1991), its exposure undone."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror or error})") from error
    head, gap, body = data.partition(b"\n\n")
    if not data.startswith((b"#?RADIANCE", b"#?RGBE")) or not gap:
        raise InputError("not a Radiance picture (it would begin with #?RADIANCE)")
    fields = re.findall(r"^\s*(FORMAT|EXPOSURE)\s*=\s*(\S+)", head.decode("latin-1"), re.MULTILINE)
    size = re.match(rb"-Y (\d{1,6}) \+X (\d{1,6})\n", body)
    if size is None or any(name == "FORMAT" and value != "32-bit_rle_rgbe" for name, value in fields):
        raise InputError("only RGBE rows from the top left are read (32-bit_rle_rgbe, -Y rows +X columns)")
    rows, columns = (int(n) for n in size.groups())
    if not 0 < rows * columns <= _MOST_TEXELS:
        raise InputError(f"{rows} rows of {columns} are too few or too many")
    try:
        exposure = float(np.prod([float(value) for name, value in fields if name == "EXPOSURE"]))
        coded = _radiance_rows(np.frombuffer(body, "u1", offset=size.end()), rows, columns)
    except (ValueError, IndexError) as error:
        raise InputError(f"not a whole Radiance picture ({error})") from error
    scale = np.where(coded[..., 3:] > 0, np.ldexp(1.0, coded[..., 3:].astype(int) - 136), 0.0)
    mantissa = coded[..., :3] + 0.5  # they were cut off, not rounded
    return Image(mantissa * scale / (exposure if exposure > 0 else 1.0))


def _radiance_rows(data: np.ndarray, rows: int, columns: int) -> np.ndarray:
    """Coded pixels [rows, columns, 4]: flat, or each row's four planes as runs and literals."""
    mark = [2, 2, columns >> 8, columns & 255]
    if not (8 <= columns < 32768 and data[:4].tolist() == mark):
        if len(data) < 4 * rows * columns:
            raise ValueError(f"{len(data)} bytes for {rows} rows of {columns}")
        flat = data[: 4 * rows * columns].reshape(rows, columns, 4)
        if np.any(np.all(flat[..., :3] == 1, axis=-1)):
            raise ValueError("runs of the old kind; save it anew")
        return flat
    coded = np.empty((rows, 4 * columns), "u1")
    start = 0
    for row in coded:
        if data[start : start + 4].tolist() != mark:
            raise ValueError("a row does not begin as it must")
        start, filled = start + 4, 0
        while filled < 4 * columns:
            count = int(data[start])
            run = count > 128
            count -= 128 if run else 0
            values = data[start + 1 : start + 2] if run else data[start + 1 : start + 1 + count]
            if count == 0 or len(values) != (1 if run else count) or filled + count > 4 * columns:
                raise ValueError("it ends early or its runs overlap")
            row[filled : filled + count] = values
            filled, start = filled + count, start + 1 + len(values)
    return coded.reshape(rows, 4, columns).transpose(0, 2, 1)


def _pillow(path: Path) -> Image:
    """Whatever Pillow opens: 8 bits of a channel, 16 of gray and of color, 32 of a gray float."""
    import PIL.Image

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", PIL.Image.DecompressionBombWarning)  # 16k maps are no bombs
            with PIL.Image.open(path) as picture:
                raw_modes = [_raw_mode(tile) for tile in getattr(picture, "tile", ())]
                tags = getattr(picture, "tag_v2", {})
                if tags.get(_PLANAR) == 2 and max(tags.get(_BITS, (8,))) > 8:
                    raise InputError("a TIFF whose channels lie one after the other; save it interleaved, or as PNG")
                picture.load()
            if picture.mode in ("RGB", "RGBA") and raw_modes and all(_is_deep(raw) for raw in raw_modes):
                return _deep(path, np.asarray(picture))
        if picture.mode == "F":
            return Image(np.asarray(picture, "f4")[..., None])
        if picture.mode.startswith("I"):
            gray = np.asarray(picture)[..., None]
            if gray.max() > 65535 or gray.min() < 0:
                raise InputError("holds integers of 32 bits; save it with 8 or 16, or as EXR")
            return Image(gray.astype("u2"))
        colors = "L" if picture.mode in ("1", "L", "LA", "La") else "RGB"
        has_alpha = picture.has_transparency_data
        texels = np.asarray(picture.convert(colors + "A" if has_alpha else colors))
        return Image(texels if texels.ndim == 3 else texels[..., None], has_alpha)
    except InputError:
        raise
    except (OSError, ValueError, SyntaxError, PIL.Image.DecompressionBombError) as error:
        raise InputError(f"not a picture that can be read ({error})") from error


def _raw_mode(tile) -> str:
    """How a tile of a Pillow image says that its bytes lie."""
    arguments = tile[3]
    return arguments if isinstance(arguments, str) else next((a for a in arguments or () if isinstance(a, str)), "")


def _is_deep(raw_mode: str) -> bool:
    return raw_mode.startswith("RGB") and "16" in raw_mode


def _swapped(tile):
    """The same tile, told that its bytes lie the other way round."""
    raw, arguments = _raw_mode(tile), tile[3]
    swapped = raw[:-3] + _SWAPPED.get(raw[-3:], raw[-3:])
    arguments = swapped if isinstance(arguments, str) else tuple(swapped if a == raw else a for a in arguments)
    return tile._replace(args=arguments) if hasattr(tile, "_replace") else (*tile[:3], arguments)  # names: Pillow 11


def _deep(path: Path, upper: np.ndarray) -> Image:
    """A color picture of 16 bits a channel, whose upper bytes are known."""
    import PIL.Image

    with PIL.Image.open(path) as picture:
        picture.tile = [_swapped(tile) for tile in picture.tile]  # type: ignore[assignment]
        picture.load()
        lower = np.asarray(picture)
    return Image(upper.astype("u2") << 8 | lower, has_alpha=upper.shape[-1] == 4)


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
