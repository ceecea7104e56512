"""What a picture of a head is made of: skin, camera, light, surface; one description for viewer and renderer.

Lengths are millimetres, angles degrees. The head looks along +z, +y is up, +x is its left.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path

import numpy as np

from lutgen.errors import InputError, cannot_write, in_range, one_of, shown, summary
from lutgen.skin import chromophores
from lutgen.skin.tissue import PRESETS, preset

TIERS = ("off", "low", "medium", "high", "reference")
"""How scattering is sampled: not at all, 8, 16 or 64 taps at most, or 64 accumulated over frames."""
SPLITS = ("none", "scattering", "burley", "set")
"""What the right half of a split view shows instead: no scattering, one light-skin Burley, or another LUT set."""
ENVIRONMENTS = ("studio", "none")
"""Surroundings without a file."""


@dataclass(frozen=True)
class Look:
    """Everything that a slider sets; `melanin`, `eumelanin` and `hemoglobin` are what the maps multiply.

    >>> Look().melanin, Look(tier="high").tier
    (0.0195, 'high')
    """

    melanin: float = 0.0195
    eumelanin: float = 0.7
    hemoglobin: float = 0.0088
    oxygenation: float = 0.7
    tier: str = "medium"
    split: str = "none"
    transmission: float = 1.0
    entry: float = 1.0
    light_azimuth: float = -30.0
    light_elevation: float = 36.0
    light: float = 4.2
    light_size: float = 1.5
    environment: float = 0.85
    environment_azimuth: float = 0.0
    roughness: float = 0.5
    specular: float = 1.0
    bumps: float = 1.0
    exposure: float = 0.0
    azimuth: float = 18.0
    elevation: float = 0.0
    distance_mm: float = 610.0
    field_of_view: float = 23.0
    target_mm: tuple[float, float, float] = (0.0, -8.0, 0.0)

    __repr__ = summary

    def __post_init__(self):
        for name, (low, high) in RANGES.items():
            object.__setattr__(self, name, in_range(name, getattr(self, name), low, high))
        one_of("tier", self.tier, TIERS)
        one_of("split", self.split, SPLITS)
        target = self.target_mm
        if not isinstance(target, (list, tuple)) or len(target) != 3:
            raise InputError(f"target_mm = {shown(target)}: three numbers are needed")
        object.__setattr__(self, "target_mm", tuple(in_range("target_mm", v, -1000, 1000) for v in target))


RANGES = {
    "melanin": chromophores.MELANIN, "eumelanin": chromophores.EUMELANIN, "hemoglobin": chromophores.HEMOGLOBIN,
    "oxygenation": chromophores.OXYGENATION, "transmission": (0, 2), "entry": (0, 1), "light_azimuth": (-180, 180),
    "light_elevation": (-90, 90), "light": (0, 20), "light_size": (0, 40), "environment": (0, 10),
    "environment_azimuth": (-180, 180),
    "roughness": (0.15, 1), "specular": (0, 2), "bumps": (0, 3), "exposure": (-8, 8), "azimuth": (-180, 180),
    "elevation": (-89, 89), "distance_mm": (40, 5000), "field_of_view": (5, 90),
}  # fmt: skip
"""Allowed values of a look's numbers."""


def of_preset(name: str, look: Look | None = None) -> Look:
    """A look with the chromophores of a preset.

    >>> of_preset("dark").melanin
    0.158
    """
    skin = preset(name)
    return replace(
        look or Look(), melanin=skin.melanin, eumelanin=skin.eumelanin, hemoglobin=skin.hemoglobin,
        oxygenation=skin.oxygenation,
    )  # fmt: skip


def changed(look: Look, values: Mapping) -> Look:
    """A look with some values replaced; an unknown name, NaN or a value out of range is an InputError.

    >>> changed(Look(), {"melanin": "0.05"}).melanin
    0.05
    """
    names = {f.name: f.type for f in fields(Look)}
    changes = {}
    for name, value in values.items():
        if name not in names:
            raise InputError(f"{name}: a look has no such value; it has {', '.join(names)}")
        if isinstance(value, str) and name in RANGES:
            try:
                value = float(value)
            except ValueError as error:
                raise InputError(f"{name} = {value!r}: a number is needed") from error
        elif isinstance(value, str) and name == "target_mm":
            value = [float(part) for part in value.split(",")] if _numeric(value) else value
        changes[name] = value
    return replace(look, **changes)


def _numeric(text: str) -> bool:
    try:
        return len([float(part) for part in text.split(",")]) == 3
    except ValueError:
        return False


def save(look: Look, path: Path) -> None:
    """Write a look as TOML."""
    lines = ["# A look of the lutgen viewer; lengths in mm, angles in degrees."]
    for name, value in asdict(look).items():
        text = f'"{value}"' if isinstance(value, str) else str(list(value) if isinstance(value, tuple) else value)
        lines.append(f"{name} = {text}")
    try:
        Path(path).write_text("\n".join(lines) + "\n", encoding="utf-8")
    except OSError as error:
        raise cannot_write("look", path, error) from error


def load(path: Path) -> Look:
    """Read a look; values that it does not name are the default's."""
    try:
        values = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"look {path}: cannot be read ({error}); give a TOML file that the viewer saved") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"look {path}: not TOML ({error})") from error
    try:
        return changed(Look(), values)
    except InputError as error:
        raise InputError(f"look {path}: {error}") from error


@dataclass(frozen=True)
class Camera:
    """View and projection matrices [4, 4] (column vectors, OpenGL clip space), eye in mm, focal length in pixels."""

    view: np.ndarray
    projection: np.ndarray
    eye_mm: np.ndarray
    focal_pixels: float = field(default=0.0)


def camera(look: Look, width: int, height: int) -> Camera:
    """The camera that orbits the look's target; `field_of_view` is vertical."""
    target = np.array(look.target_mm)
    eye = target + look.distance_mm * direction(look.azimuth, look.elevation)
    near, far = look.distance_mm / 40, look.distance_mm + 2000
    focal = 1 / np.tan(np.radians(look.field_of_view) / 2)
    projection = np.zeros((4, 4))
    projection[0, 0], projection[1, 1] = focal * height / width, focal
    projection[2, 2:] = (far + near) / (near - far), 2 * far * near / (near - far)
    projection[3, 2] = -1
    return Camera(look_at(eye, target), projection, eye, focal * height / 2)


def direction(azimuth: float, elevation: float) -> np.ndarray:
    """Unit vector at an azimuth from +z toward +x and an elevation toward +y, degrees.

    >>> direction(90.0, 0.0).round(6).tolist()
    [1.0, 0.0, 0.0]
    """
    a, e = np.radians([azimuth, elevation])
    return np.array([np.sin(a) * np.cos(e), np.sin(e), np.cos(a) * np.cos(e)])


def look_at(eye: np.ndarray, target: np.ndarray) -> np.ndarray:
    """View matrix [4, 4] from an eye to a target, +y up."""
    forward = (target - eye) / np.linalg.norm(target - eye)
    side = np.cross(forward, [0.0, 1.0, 0.0] if abs(forward[1]) < 0.999 else [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side)
    up = np.cross(side, forward)
    view = np.eye(4)
    view[:3, :3] = side, up, -forward
    view[:3, 3] = -view[:3, :3] @ eye
    return view


def light_direction(look: Look) -> np.ndarray:
    """Unit vector toward the directional light."""
    return direction(look.light_azimuth, look.light_elevation)


def sheet_looks(look: Look | None = None) -> dict[str, Look]:
    """A look for every preset."""
    return {name: of_preset(name, look) for name in PRESETS}
