"""KTX 2.0 files of one level, uncompressed: 2-D or 3-D, half or float RGBA, with a data format descriptor.

Layout: Khronos KTX File Format Specification 2.0.4; the descriptor: Khronos Data Format Specification 1.4, section 3.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping

import numpy as np

IDENTIFIER = b"\xabKTX 20\xbb\r\n\x1a\n"
VK_FORMATS = {"f2": 97, "f4": 109}
"""VK_FORMAT_R16G16B16A16_SFLOAT and VK_FORMAT_R32G32B32A32_SFLOAT, by the kind of the texels."""
RGBSDA, LINEAR, BT709, UNSPECIFIED = 1, 1, 1, 0
_ALPHA, _SIGNED_FLOAT = 15, 0xC0
_HEADER = 80 + 24
"""Bytes before the descriptor: the header with its index, and the index of one level."""


def ktx2(texels: np.ndarray, notes: Mapping[str, str], primaries: int = BT709) -> bytes:
    """The file of texels [H, W, 4] or [D, H, W, 4], half or float, first row at v = 0; `notes` are its text metadata.

    `primaries` is UNSPECIFIED for what is no color.
    """
    kind = f"f{texels.dtype.itemsize}"
    depth, height, width = (0, *texels.shape[:2]) if texels.ndim == 3 else texels.shape[:3]
    data = np.ascontiguousarray(texels, f"<{kind}").tobytes()
    size = texels.dtype.itemsize
    descriptor, metadata = _descriptor(size, primaries), _metadata(notes)
    notes_at = _HEADER + len(descriptor)
    start = -(-(notes_at + len(metadata)) // (4 * size)) * 4 * size  # aligned to whole texels
    head = struct.pack("<9I", VK_FORMATS[kind], size, width, height, depth, 0, 1, 1, 0)
    index = struct.pack("<4I2Q", _HEADER, len(descriptor), notes_at, len(metadata), 0, 0)
    level = struct.pack("<3Q", start, len(data), len(data))
    before = IDENTIFIER + head + index + level + descriptor + metadata
    return before.ljust(start, b"\0") + data


def _descriptor(size: int, primaries: int) -> bytes:
    """A basic block of version 1.3 that says: red, green, blue, alpha, each a signed float of `size` bytes."""
    samples = b"".join(
        struct.pack("<HBBIff", 8 * size * place, 8 * size - 1, channel | _SIGNED_FLOAT, 0, -1.0, 1.0)
        for place, channel in enumerate((0, 1, 2, _ALPHA))
    )
    block = struct.pack(
        "<IHH4B4B8B", 0, 2, 24 + len(samples), RGBSDA, primaries, LINEAR, 0, *(0,) * 4, 4 * size, *(0,) * 7
    )
    return struct.pack("<I", 4 + len(block) + len(samples)) + block + samples


def _metadata(notes: Mapping[str, str]) -> bytes:
    """Keys and values, each ended by a zero, sorted by key and padded to 4 bytes."""
    out = b""
    for key in sorted(notes):
        entry = key.encode() + b"\0" + notes[key].encode() + b"\0"
        out += struct.pack("<I", len(entry)) + entry + b"\0" * (-len(entry) % 4)
    return out
