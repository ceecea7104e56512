"""Packages that only some commands need: imported there, or a line that says what to install."""

from __future__ import annotations

import importlib
from types import ModuleType

from lutgen.errors import missing


def viewer(module: str) -> ModuleType:
    """A module of the viewer, which needs packages that a bake does not; MachineError where one is missing."""
    try:
        return importlib.import_module(f"lutgen.viewer.{module}")
    except ImportError as error:
        if (error.name or "").startswith("lutgen"):
            raise
        raise missing(f"the viewer needs {error.name}", "view") from error
