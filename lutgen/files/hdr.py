"""Radiance pictures (.hdr, .pic): run-length coded or flat RGBE to linear floats (Ward 1991)."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from lutgen.errors import InputError

_MOST = 1 << 28


def read(path: Path) -> np.ndarray:
    """Linear RGB [rows, columns, 3] of a Radiance picture, first row on top, its exposure undone.

    Raises InputError for what is no whole picture of the kind `-Y rows +X columns` in RGBE.
    """
    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
    head, found, body = data.partition(b"\n\n")
    if not data.startswith((b"#?RADIANCE", b"#?RGBE")) or not found:
        raise InputError(f"{path}: not a Radiance picture (it would begin with #?RADIANCE)")
    fields = re.findall(r"^\s*(FORMAT|EXPOSURE)\s*=\s*(\S+)", head.decode("latin-1"), re.MULTILINE)
    size = re.match(rb"-Y (\d{1,6}) \+X (\d{1,6})\n", body)
    if size is None or any(name == "FORMAT" and value != "32-bit_rle_rgbe" for name, value in fields):
        raise InputError(f"{path}: only RGBE rows from the top left are read (32-bit_rle_rgbe, -Y rows +X columns)")
    rows, columns = (int(n) for n in size.groups())
    if not 0 < rows * columns <= _MOST:
        raise InputError(f"{path}: {rows} rows of {columns} are too few or too many")
    try:
        exposure = float(np.prod([float(value) for name, value in fields if name == "EXPOSURE"]))
        coded = _rows(np.frombuffer(body, "u1", offset=size.end()), rows, columns)
    except (ValueError, IndexError) as error:
        raise InputError(f"{path}: not a whole Radiance picture ({error})") from error
    scale = np.where(coded[..., 3:] > 0, np.ldexp(1.0, coded[..., 3:].astype(int) - 136), 0.0)
    return (coded[..., :3] + 0.5) * scale / (exposure if exposure > 0 else 1.0)  # + 0.5: mantissas were cut off


def _rows(data: np.ndarray, rows: int, columns: int) -> np.ndarray:
    """Coded pixels [rows, columns, 4]: flat, or each row's four planes as runs and literals."""
    mark = [2, 2, columns >> 8, columns & 255]
    if not (8 <= columns < 32768 and data[:4].tolist() == mark):
        if len(data) < 4 * rows * columns:
            raise ValueError(f"{len(data)} bytes for {rows} rows of {columns}")
        flat = data[: 4 * rows * columns].reshape(rows, columns, 4)
        if np.any(np.all(flat[..., :3] == 1, axis=-1)):
            raise ValueError("runs of the old kind; save it anew")
        return flat
    out = np.empty((rows, 4 * columns), "u1")
    at = 0
    for row in out:
        if data[at : at + 4].tolist() != mark:
            raise ValueError("a row does not begin as it must")
        at, filled = at + 4, 0
        while filled < 4 * columns:
            count = int(data[at])
            run = count > 128
            count -= 128 if run else 0
            values = data[at + 1 : at + 2] if run else data[at + 1 : at + 1 + count]
            if count == 0 or len(values) != (1 if run else count) or filled + count > 4 * columns:
                raise ValueError("it ends early or its runs overlap")
            row[filled : filled + count] = values
            filled, at = filled + count, at + 1 + len(values)
    return out.reshape(rows, 4, columns).transpose(0, 2, 1)
