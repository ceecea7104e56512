"""What takes seconds to make, kept in the user's cache under the hash of what it was made from."""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path

import numpy as np


def folder() -> Path:
    """Where entries lie: LUTGEN_CACHE, else the user's cache folder."""
    own = os.environ.get("LUTGEN_CACHE")
    base = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA") or Path.home() / ".cache"
    return Path(own) if own else Path(base) / "lutgen"


def load_or_make(
    name: str, modules: tuple[str, ...], make: Callable[[], dict[str, np.ndarray]], *arrays: np.ndarray
) -> dict[str, np.ndarray]:
    """Arrays by name that `make` gives, from the cache where the sources of `modules` and `arrays` are the same.

    A cache that is damaged or cannot be written costs only time.
    """
    digest = hashlib.sha256("".join((files("lutgen") / f"{module}.py").read_text() for module in modules).encode())
    for array in arrays:
        digest.update(f"{array.shape}{array.dtype}".encode() + np.ascontiguousarray(array).tobytes())
    path = folder() / f"{name}-{digest.hexdigest()[:16]}.npz"
    with contextlib.suppress(Exception), np.load(path) as entry:  # any damage: make it again
        return {key: entry[key] for key in entry.files}
    fresh: dict = make()
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        with partial.open("wb") as file:
            np.savez(file, **fresh)
        partial.replace(path)
    return fresh
