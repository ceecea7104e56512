"""The only module that imports OpenEXR: float or half channels with text attributes, one or more parts a file."""

from __future__ import annotations

import contextlib
import io
import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR

from lutgen.errors import InputError

_PREFIX = "lutgen."
ACESCG = (0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767)
REC709 = (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329)
"""Chromaticities: red, green, blue, white, x and y each."""


@dataclass(frozen=True)
class Part:
    """One image: its name, channels [rows, columns] by name, attributes (any JSON value); chromaticities once read."""

    name: str
    channels: dict[str, np.ndarray]
    attributes: Mapping[str, Any]
    chromaticities: tuple[float, ...] = REC709

    def stack(self, names: str) -> np.ndarray:
        """Channels of one-letter names as one array [rows, columns, len(names)]."""
        return np.stack([self.channels[name] for name in names], axis=-1)


def rgb(image: np.ndarray) -> dict[str, np.ndarray]:
    """Channels R, G, B of an array [rows, columns, 3]."""
    return {name: np.ascontiguousarray(image[..., i]) for i, name in enumerate("RGB")}


def write(path: Path, parts: list[Part], chromaticities: tuple[float, ...] = ACESCG) -> None:
    """Write parts as ZIP scan lines; the same parts give the same bytes (no time stamp, no host)."""
    shapes = [next(iter(part.channels.values())).shape for part in parts]
    corner = np.array([max(s[1] for s in shapes) - 1, max(s[0] for s in shapes) - 1], "i4")
    images = []
    for part in parts:
        header = {
            "type": OpenEXR.scanlineimage,
            "compression": OpenEXR.ZIP_COMPRESSION,
            "chromaticities": chromaticities,
            "displayWindow": (np.zeros(2, "i4"), corner),
            **{_PREFIX + key: json.dumps(value, sort_keys=True) for key, value in part.attributes.items()},
        }
        channels = {name: np.ascontiguousarray(pixels) for name, pixels in part.channels.items()}
        images.append(OpenEXR.Part(header, channels, part.name))
    try:
        OpenEXR.File(images).write(str(path))
    except RuntimeError as error:
        raise OSError(f"{path}: {error}") from error


def read(path: Path) -> dict[str, Part]:
    """Parts of a file by name; InputError where it is not a whole OpenEXR file."""
    try:
        with _quiet(), OpenEXR.File(str(path), separate_channels=True) as image:
            parts = {}
            for part in image.parts:
                attributes = {
                    key.removeprefix(_PREFIX): json.loads(str(value))
                    for key, value in part.header.items()
                    if key.startswith(_PREFIX)
                }
                channels = {name: np.array(channel.pixels) for name, channel in part.channels.items()}
                if not channels:
                    raise ValueError("no pixels")
                primaries = part.header.get("chromaticities", REC709)  # what a file that names none has
                parts[part.name()] = Part(part.name(), channels, attributes, tuple(float(v) for v in primaries))
            if not parts:
                raise ValueError("cut short")
            return parts
    except (RuntimeError, ValueError, IndexError) as error:
        raise InputError(f"{path}: not a whole OpenEXR file of a LUT set ({error}); bake it anew") from error


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Without what OpenEXR prints about a broken file, past Python, beside what it raises or leaves out."""
    try:
        kept = os.dup(2)
    except OSError:  # no standard error at all
        yield
        return
    try:
        with contextlib.redirect_stdout(io.StringIO()), open(os.devnull, "wb") as nowhere:
            os.dup2(nowhere.fileno(), 2)
            yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
