"""Recipes: TOML -> frozen dataclass; an error names the key, the value and what is allowed.

A recipe starts from a quality and overrides what it names. luts/bake.toml is the commented default.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path

from lutgen.color import PIPELINES
from lutgen.errors import InputError, one_of, shown, summary, whole
from lutgen.skin import chromophores
from lutgen.skin.tissue import Skin, Tissue, plain, require_one_scatterer
from lutgen.solvers.paths import PHOTONS, SEEDS
from lutgen.tables import wavelengths
from lutgen.tables.axes import Grid, default_grid

TOTALS = ("monte-carlo", "anchored")
RINGS = (8, 16, 32, 64, 128, 256)


@dataclass(frozen=True)
class Recipe:
    """Everything a bake depends on; `photons` are per wavelength, `skin` is all but the three LUT axes.

    Of a Skin the tissue is taken.

    >>> Recipe().photons
    524288
    """

    photons: int = 524_288
    wavelengths: str = "8"
    seed: int = 0
    totals: str = "monte-carlo"
    pipeline: str = "default"
    rings: int = 64
    color: Grid = field(default_factory=lambda: default_grid(16, 8, 16))
    profile: Grid = field(default_factory=lambda: default_grid(16, 4, 8))
    skin: Tissue = field(default_factory=Tissue)

    __repr__ = summary

    def __post_init__(self):
        object.__setattr__(self, "photons", whole("photons", self.photons, *PHOTONS))
        object.__setattr__(self, "seed", whole("seed", self.seed, *SEEDS))
        one_of("wavelengths", self.wavelengths, wavelengths.NAMES)
        one_of("totals", self.totals, TOTALS)
        one_of("pipeline", self.pipeline, PIPELINES)
        if isinstance(self.rings, bool) or not isinstance(self.rings, int) or self.rings not in RINGS:
            raise InputError(f"rings = {shown(self.rings)}: allowed is {', '.join(map(str, RINGS))}")
        if isinstance(self.skin, Skin):
            object.__setattr__(self, "skin", self.skin.tissue)
        require_one_scatterer(self.skin)

    def as_dict(self) -> dict:
        """The recipe as nested plain values, as the manifest and TOML hold it."""
        grids = {
            name: {axis: {key: value for key, value in asdict(getattr(grid, axis)).items() if key in _AXIS_KEYS}
                   for axis in chromophores.NAMES}
            for name, grid in (("color", self.color), ("profile", self.profile))
        }  # fmt: skip
        return {key: getattr(self, key) for key in _TOP_KEYS} | {"skin": plain(self.skin)} | grids


_AXIS_KEYS = ("low", "high", "count", "spacing")
_SKIN_KEYS = tuple(field.name for field in fields(Tissue))
_TOP_KEYS = ("photons", "wavelengths", "seed", "totals", "pipeline", "rings")

QUALITIES = {
    "draft": Recipe(photons=65_536),
    "standard": Recipe(),
    "reference": Recipe(
        photons=1_048_576, wavelengths="12", totals="anchored",
        color=default_grid(32, 16, 16), profile=default_grid(32, 4, 16),
    ),
}  # fmt: skip


def quality(name: str) -> Recipe:
    """The recipe of a quality: draft, standard or reference.

    >>> quality("reference").totals
    'anchored'
    """
    return QUALITIES[one_of("quality", name, tuple(QUALITIES))]


def from_dict(values: Mapping, base: Recipe | None = None) -> Recipe:
    """A recipe of nested plain values over a base (standard); unknown keys and bad values are InputErrors.

    >>> from_dict({"photons": 4096, "color": {"melanin": {"count": 8}}}).color.melanin.count
    8
    """
    base = base or Recipe()
    _known("recipe", values, (*_TOP_KEYS, "skin", "color", "profile"))
    changes: dict = {key: values[key] for key in _TOP_KEYS if key in values}
    if "wavelengths" in changes:
        changes["wavelengths"] = str(changes["wavelengths"])
    skin = _table("skin", values)
    _known("skin", skin, _SKIN_KEYS)
    changes["skin"] = replace(base.skin, **skin)
    for name in ("color", "profile"):
        axes = _table(name, values)
        _known(name, axes, chromophores.NAMES)
        grid = getattr(base, name)
        changed = {}
        for axis in axes:
            keys = _table(axis, axes, f"{name}.{axis}")
            _known(f"{name}.{axis}", keys, _AXIS_KEYS)
            changed[axis] = replace(getattr(grid, axis), **keys)
        changes[name] = replace(grid, **changed)
    return replace(base, **changes)


def toml(recipe: Recipe) -> str:
    """The recipe as TOML, every key; `load` reads the same recipe back.

    >>> from_dict(tomllib.loads(toml(quality("draft")))) == quality("draft")
    True
    """
    values = recipe.as_dict()
    tables = {"skin": values.pop("skin")}
    for name in ("color", "profile"):
        tables |= {f"{name}.{axis}": keys for axis, keys in values.pop(name).items()}
    lines = [_line(key, value) for key, value in values.items()]
    for name, keys in tables.items():
        lines += ["", f"[{name}]", *(_line(key, value) for key, value in keys.items())]
    return "\n".join(lines) + "\n"


def _line(key: str, value: object) -> str:
    return f'{key} = "{value}"' if isinstance(value, str) else f"{key} = {value!r}"


def _table(name: str, values: Mapping, where: str | None = None) -> Mapping:
    table = values.get(name, {})
    if not isinstance(table, Mapping):
        raise InputError(f"{where or name} = {shown(table)}: a table of keys is needed")
    return table


def _known(where: str, values: Mapping, allowed: tuple[str, ...]) -> None:
    for key in values:
        if key not in allowed:
            raise InputError(f"{where}: unknown key {key!r}: allowed is {', '.join(allowed)}")


def load(path: str | Path, base: Recipe | None = None) -> Recipe:
    """The recipe in a TOML file, over a base."""
    try:
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"recipe {path}: cannot be read ({error}); give a TOML file like luts/bake.toml") from error
    try:
        values = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"recipe {path}: not TOML ({error})") from error
    try:
        return from_dict(values, base)
    except InputError as error:
        raise InputError(f"recipe {path}: {error}") from error


def coerce(recipe: Recipe | Mapping | str | Path | None) -> Recipe:
    """A recipe from what `lutgen.bake` accepts: a Recipe, nested values, a TOML path, a quality, or nothing."""
    if recipe is None:
        return Recipe()
    if isinstance(recipe, Recipe):
        return recipe
    if isinstance(recipe, Mapping):
        return from_dict(recipe)
    if not isinstance(recipe, (str, Path)):
        raise InputError(f"recipe = {shown(recipe)}: a Recipe, a table of keys, a TOML path or a quality is needed")
    return QUALITIES[str(recipe)] if str(recipe) in QUALITIES else load(recipe)
