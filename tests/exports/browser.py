"""Node, npm's packages and Debian's Chromium for the tests of what browsers and Godot open."""

import json
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np

from lutgen.exports import lookup

WEB = Path(__file__).parent / "web"


def node(script: str, *arguments, timeout: float = 240):
    """What a script of web/ prints as JSON; it fails with the script's last words, or after `timeout` seconds."""
    _install()
    chromium = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    assert chromium, "the tests need Chromium: apt-get install chromium"
    command = ["node", WEB / script, *map(str, arguments)]
    done = subprocess.run(
        command, env=os.environ | {"CHROMIUM": chromium}, capture_output=True, text=True, timeout=timeout
    )
    assert done.returncode == 0, done.stderr[-4000:]
    return json.loads(done.stdout)


def _install() -> None:
    """Packages of tests/exports/web/package.json, once; without their scripts, which would unpack demos."""
    wanted = json.loads((WEB / "package.json").read_text())["dependencies"]
    if all((WEB / "node_modules" / name / "package.json").is_file() for name in wanted):
        return
    assert shutil.which("npm"), "the tests need Node.js: apt-get install nodejs npm"
    flags = "--no-package-lock --ignore-scripts --legacy-peer-deps --no-audit --no-fund --loglevel=error"
    done = subprocess.run(["npm", "install", *flags.split()], cwd=WEB, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr[-4000:]


def rings(source, quantiles: np.ndarray) -> np.ndarray:
    """Radius in mm and encircled energy R, G, B [N, 4] that a shader must read at quantiles [N] of `source.skins`."""
    lut = source.luts.profile_lut
    table = lut.grid.interpolate(lookup.profile_texels(source).reshape(*lut.grid.shape, 64, 4), *source.skins.T)
    column = np.clip(64 * quantiles - 0.5, 0, 63)
    first = np.minimum(column.astype(int), 62)
    rows, along = np.arange(len(table)), (column - first)[:, None]
    return (1 - along) * table[rows, first] + along * table[rows, first + 1]
