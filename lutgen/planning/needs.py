"""What a scene needs of its LUTs: which skins, how right, seen at which scale, for how many bytes and seconds."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from lutgen.errors import InputError, in_range, one_of, shown, summary, whole
from lutgen.files import texture_maps
from lutgen.skin import chromophores
from lutgen.skin.tissue import PRESETS

Range = tuple[float, float]

ALLOWED_TONES: dict[str, Range] = {**chromophores.RANGES, "oxygenation": chromophores.OXYGENATION}
VARIABLE = tuple(ALLOWED_TONES)
USUAL = {name: getattr(PRESETS["light"], name) for name in VARIABLE}
"""The value of what neither the tones nor `vary` name: the default recipe's skin."""
TOLERANCE, EE_TOLERANCE, MM_PER_PIXEL = (0.02, 20.0), (0.001, 0.5), (1e-3, 1e3)
BYTES, SECONDS = (1, 2**40), (0.0, 1e6)
EE_PER_DELTA_E00 = 1 / 20
"""The usual tolerance of encircled energy: shares of .05 are about as visible as a color difference of 1."""
OWN_PIXEL = 0.56
"""A pixel's own disc, in pixels: what light does nearer than its radius a picture does not show."""


@dataclass(frozen=True)
class Needs:
    """Ranges (low, high) of a scene's skins, tolerances, millimetres per pixel, and what may be spent.

    `tolerance` (CIEDE2000) and `ee_tolerance` (encircled energy) hold for the 95th percentile of random skins of the
    scene; `bytes` and `seconds` are what the tables and the bake may take, or None.

    >>> Needs(melanin=(0.01, 0.05), hemoglobin=(0.005, 0.01)).varying
    ('melanin', 'hemoglobin')
    """

    melanin: Range = (USUAL["melanin"],) * 2
    eumelanin: Range = (USUAL["eumelanin"],) * 2
    hemoglobin: Range = (USUAL["hemoglobin"],) * 2
    oxygenation: Range = (USUAL["oxygenation"],) * 2
    tolerance: float = 0.5
    ee_tolerance: float = 0.025
    mm_per_pixel: float = 0.2
    bytes: int | None = None
    seconds: float | None = None

    __repr__ = summary

    def __post_init__(self):
        def put(name: str, value: object) -> None:
            """Set a field of the frozen record."""
            object.__setattr__(self, name, value)

        for name in VARIABLE:
            put(name, _range(name, getattr(self, name)))
        put("tolerance", in_range("tolerance", self.tolerance, *TOLERANCE, " ΔE00"))
        put("ee_tolerance", in_range("ee_tolerance", self.ee_tolerance, *EE_TOLERANCE))
        put("mm_per_pixel", in_range("mm_per_pixel", self.mm_per_pixel, *MM_PER_PIXEL))
        if self.bytes is not None:
            put("bytes", whole("bytes", self.bytes, *BYTES))
        if self.seconds is not None:
            put("seconds", in_range("seconds", self.seconds, *SECONDS))

    @property
    def varying(self) -> tuple[str, ...]:
        """What varies at run time."""
        return tuple(name for name in VARIABLE if getattr(self, name)[0] < getattr(self, name)[1])

    @property
    def oxygenations(self) -> tuple[float, ...]:
        """Where errors are looked at: the one oxygenation, or the least, the middle and the greatest."""
        low, high = self.oxygenation
        return (low,) if low == high else (low, (low + high) / 2, high)

    @property
    def from_mm(self) -> float:
        """Radius from which profiles count: a pixel's own disc, 0.01 mm at least."""
        return max(0.01, OWN_PIXEL * self.mm_per_pixel)

    def as_dict(self) -> dict:
        """Plain values."""
        return {f.name: list(v) if isinstance(v := getattr(self, f.name), tuple) else v for f in fields(self)}


def _range(name: str, low_high: object) -> Range:
    if not isinstance(low_high, tuple) or len(low_high) != 2:
        raise InputError(f"{name} = {shown(low_high)}: a pair of low and high is needed")
    low, high = (in_range(name, value, *ALLOWED_TONES[name]) for value in low_high)
    if low > high:
        raise InputError(f"{name} = {low:g}:{high:g}: low is above high; swap them")
    return low, high


def usual_ee_tolerance(tolerance: float) -> float:
    """The tolerance of encircled energy that goes with one of color, .002 to .1.

    >>> usual_ee_tolerance(0.5)
    0.025
    """
    return float(np.clip(tolerance * EE_PER_DELTA_E00, 0.002, 0.1))


def scene(
    tones: str = "all", vary: str | None = None, tolerance: float = 0.5, ee_tolerance: float | None = None, **limits
) -> Needs:
    """Needs from the words of the command line; `limits` are the other fields of Needs.

    `tones`: `all`, presets, NAME=VALUE, NAME=LOW:HIGH and a map (a picture by its name, or a folder of them),
    separated by commas. Presets span what lies between them; a map multiplies that by its ratios. `vary` names what
    varies at run time: over its range in the tones, else over all that is allowed; without it, what has a range.

    >>> scene("light,dark").melanin
    (0.0195, 0.158)
    >>> scene("light", "hemoglobin").hemoglobin
    (0.001, 0.1)
    """
    parts = [part.strip() for part in tones.split(",") if part.strip()]
    named = _varied(vary)
    spans, ratios = _parts(parts, chromophores.RANGES if vary is None else named)
    ranges = {name: spans.get(name, (USUAL[name],) * 2) for name in VARIABLE}
    for name in named:
        if ranges[name][0] == ranges[name][1]:
            ranges[name] = ALLOWED_TONES[name]
    for name, (low, high) in ratios.items():
        least, most = ALLOWED_TONES[name]
        low, high = np.clip((ranges[name][0] * low, ranges[name][1] * high), least, most)
        ranges[name] = float(low), float(high)
    for name, (low, high) in ranges.items():
        if vary is not None and name not in named and low < high:
            raise InputError(
                f"vary = {vary}: the tones hold {name} from {low:g} to {high:g}; add {name}, or give it one value"
            )
    tolerance = in_range("tolerance", tolerance, *TOLERANCE, " ΔE00")
    energy = usual_ee_tolerance(tolerance) if ee_tolerance is None else ee_tolerance
    return Needs(**ranges, tolerance=tolerance, ee_tolerance=energy, **limits)


def _parts(parts: list[str], whole_of: Iterable[str]) -> tuple[dict[str, Range], dict[str, Range]]:
    """Ranges of the tones by name (`all`: everything allowed of the axes in `whole_of`), and ratios of a map."""
    spans: dict[str, Range] = {}
    ratios: dict[str, Range] = {}
    if not parts:
        raise InputError(f"tones = '': give all, presets ({', '.join(PRESETS)}), melanin=LOW:HIGH or a map")
    for part in parts:
        name, equals, value = part.partition("=")
        if part == "all":
            spans.update({key: chromophores.RANGES[key] for key in chromophores.NAMES if key in whole_of})
        elif part in PRESETS:
            skin = PRESETS[part]
            for key in chromophores.NAMES:
                low, high = spans.get(key, (np.inf, -np.inf))
                spans[key] = min(low, getattr(skin, key)), max(high, getattr(skin, key))
        elif equals:
            one_of("tones", name, VARIABLE)
            spans[name] = _range(name, _numbers(name, value))
        elif Path(part).exists():
            ratios.update(_map_ratios(Path(part)))
        else:
            raise InputError(
                f"tones = {shown(part)}: allowed is all, {', '.join(PRESETS)}, {'|'.join(VARIABLE)}=VALUE or "
                "=LOW:HIGH, a map or a folder of maps"
            )
    return spans, ratios


def _numbers(name: str, text: str) -> tuple[float, float]:
    low, colon, high = text.partition(":")
    try:
        return float(low), float(high if colon else low)
    except ValueError as error:
        raise InputError(f"tones: {name} = {shown(text)}: VALUE or LOW:HIGH is needed") from error


def _varied(vary: str | None) -> tuple[str, ...]:
    names: Iterable[str] = () if vary is None else (part.strip() for part in vary.split(","))
    return tuple(one_of("vary", name, VARIABLE) for name in names if name not in ("", "none"))


def _map_ratios(path: Path) -> dict[str, Range]:
    """Least and greatest ratio of each chromophore in a map or a folder of maps."""
    if path.is_dir():
        files = [file for file in sorted(path.iterdir()) if file.suffix.lower() in texture_maps.SUFFIXES]
        file_of_ratio = {file.stem: file for file in files if file.stem in texture_maps.RATIOS}
    else:
        file_of_ratio = {path.stem: path} if path.stem in texture_maps.RATIOS else {}
    if not file_of_ratio:
        raise InputError(
            f"tones = {path}: no map of {', '.join(texture_maps.RATIOS)} there (as {', '.join(texture_maps.SUFFIXES)})"
        )
    ratios = {}
    for name, file in file_of_ratio.items():
        values = texture_maps.ratio(file)
        if values.size == 0 or values.min() < 0:
            raise InputError(f"map {file}: holds no ratios of 0 or more; mend it")
        ratios[name] = float(values.min()), float(values.max())
    return ratios


def halton(count: int, bases: tuple[int, ...] = (2, 3, 5)) -> np.ndarray:
    """Points [count, bases] that fill the unit cube evenly (Halton 1960).

    >>> halton(3, (2,)).ravel().tolist()
    [0.5, 0.25, 0.75]
    """
    points = np.zeros((count, len(bases)))
    for column, base in enumerate(bases):
        index, weight = np.arange(1, count + 1), 1.0
        while index.any():
            weight /= base
            points[:, column] += weight * (index % base)
            index //= base
    return points


def panel(needs: Needs, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Melanin, eumelanin and hemoglobin [count] that fill a scene evenly: as random skins of a bake are drawn."""
    u = halton(count).T
    melanin, hemoglobin = (
        low * (high / low) ** u[k] for k, (low, high) in ((0, needs.melanin), (2, needs.hemoglobin))
    )  # logarithmic, as random skins are drawn
    return melanin, needs.eumelanin[0] + u[1] * (needs.eumelanin[1] - needs.eumelanin[0]), hemoglobin
