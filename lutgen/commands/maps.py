"""Melanin and hemoglobin maps from a painted or photographed albedo."""

from __future__ import annotations

import shlex
import time
from argparse import ArgumentParser, Namespace
from importlib.metadata import version
from pathlib import Path

import numpy as np

import lutgen
from lutgen.commands import Outcome, progress
from lutgen.errors import InputError, in_range
from lutgen.files import folders, texture_maps
from lutgen.fitting import NO_SKIN, albedo, albedo_to_skin, maps_folder, recolor, white_balance
from lutgen.skin import chromophores
from lutgen.skin.tissue import PRESETS
from lutgen.tables.lut_set import LutSet

EXAMPLES = (
    "lutgen maps albedo.png --out maps",
    "lutgen maps albedo.exr --out maps --format exr --balance none --exposure 0.5 --eumelanin 0.7 --target dark",
)
GAINS, STOPS = (0.01, 100.0), (-8.0, 8.0)
_OUT_OF_REACH = 0.2
"""Share of texels out of reach, above which a warning says so."""


def arguments(parser: ArgumentParser) -> None:
    """Add the albedo, its light, and the folder of maps."""
    parser.add_argument(
        "albedo", metavar="ALBEDO", help="PNG, JPEG, TIFF or EXR; clear and black texels are background"
    )
    parser.add_argument("--luts", metavar="DIR", help="LUT set (default: the one that came along)")
    parser.add_argument("--out", required=True, metavar="DIR", help="folder to make")
    parser.add_argument(
        "--format", choices=maps_folder.FORMATS, default="png", help="16 bits or float (default: %(default)s)"
    )
    parser.add_argument("--absolute", action="store_true", help="also maps of the LUT's axes instead of ratios")
    parser.add_argument(
        "--encoding", choices=albedo.ENCODINGS, help="of the albedo's values (default: srgb, EXR linear Rec. 709)"
    )
    parser.add_argument(
        "--balance", default="auto",
        help="of the light: auto, none or linear gains R,G,B, {:g} to {:g} each (default: %(default)s)".format(*GAINS),
    )  # fmt: skip
    parser.add_argument(
        "--exposure",
        help="auto or stops, {:g} to {:g} (default: auto with --balance auto, else 0)".format(*STOPS),
    )  # fmt: skip
    parser.add_argument(
        "--eumelanin", default="auto",
        help="auto or the share of the melanin, {:g} to {:g} (default: %(default)s)".format(*chromophores.EUMELANIN),
    )  # fmt: skip
    parser.add_argument(
        "--target", metavar="SKIN",
        help=f"also the albedo on another skin: {', '.join(PRESETS)}, or melanin,eumelanin,hemoglobin (default: none)",
    )  # fmt: skip
    parser.add_argument("--force", action="store_true", help="replace an existing folder of maps")
    progress.arguments(parser)


def run(options: Namespace) -> Outcome:
    """An albedo to a folder of maps."""
    start, free = light(options.balance, options.exposure)
    source = Path(options.albedo)
    out = folders.check_target(options.out, options.force, texture_maps.REPORT)
    if source.resolve().is_relative_to(out):
        raise InputError(f"out = {options.out}: holds the albedo {source}, which would go; give another folder")
    clock, seconds = time.perf_counter(), {}

    def lap(name: str) -> None:
        """Put down the seconds since the last lap."""
        nonlocal clock
        now = time.perf_counter()
        seconds[name], clock = round(now - clock, 4), now

    with progress.Progress(options) as tell:
        luts = lutgen.load(options.luts)
        eumelanin = None if options.eumelanin == "auto" else _number("eumelanin", options.eumelanin)
        candidates = albedo_to_skin.ratios_of(luts, eumelanin)
        target = None if options.target is None else target_of(luts, options.target)
        painted = albedo.read(source, options.encoding)
        lap("read")
        tell("fit the light", None)
        doubt = albedo.doubt(luts, painted)
        fit = white_balance.fitted(luts, painted.linear[painted.painted], candidates, start, free)
        lap("fit")
        tell("invert", None)
        inversion = albedo_to_skin.invert(luts, painted.linear, fit.eumelanin, fit.gain, painted.painted)
        lap("invert")
        residual = maps_folder.statistics(inversion)
        warnings = [warning for warning in (doubt, no_skin(residual, source)) if warning is not None]
        recolored = None
        if target is not None:
            tell("recolor", None)
            recolored = recolor.recolored(luts, inversion, painted.linear, target)
            lap("recolor")
        tell("write", None)
        facts = _facts(luts, painted, inversion, residual, options, target, warnings)
        with folders.whole(options.out, options.force, texture_maps.REPORT) as folder:
            layers = maps_folder.layers(luts, inversion, options.absolute)
            maps_folder.write(folder, layers, options.format, recolored, painted.alpha, facts)
            balanced = painted.linear * inversion.gain
            _preview(folder / "preview.png", luts, balanced, inversion, layers, facts, recolored)
        lap("write")
    seconds["total"] = round(sum(seconds.values()), 4)
    per_pixel = 1e6 * seconds["invert"] / inversion.painted.size
    result = {"out": str(out), **facts, "seconds": seconds, "invert_us_per_pixel": round(per_pixel, 3)}
    return result, _text(result, options), 0


def no_skin(residual: dict, source: Path) -> str | None:
    """A line about colors that few skins have, or None; InputError where half are those of none, as `fit` says it."""
    check = "are its channels in order, and is it an albedo of skin?"
    median, share = residual["delta_e00_median"], residual["out_of_reach_share"]
    if median >= NO_SKIN:
        raise InputError(
            f"albedo {source}: its colors are those of no skin (ΔE00 {median:.1f} from the nearest at the median; "
            f"allowed is below {NO_SKIN:g}); {check}"
        )
    if share < _OUT_OF_REACH:
        return None
    return f"{share:.0%} of the texels are farther than {maps_folder.REACH:g} from any skin: {check}"


def light(balance: str, exposure: str | None) -> tuple[np.ndarray, str]:
    """Gain [3] to start from, and what `white_balance.fitted` is to fit beside it, of --balance and --exposure.

    Without an exposure it is fitted where the balance is, else it is 0 stops.
    """
    gain, tint = np.ones(3), balance == "auto"
    if balance not in ("auto", "none"):
        try:
            gain = np.array([float(value) for value in balance.split(",")])
        except ValueError:
            gain = np.empty(0)
        if gain.shape != (3,):
            raise InputError(
                f"balance = {balance!r}: auto, none or three gains R,G,B are needed, for example 1.1,1,0.9"
            )
        for value in gain:
            in_range("balance", value, *GAINS)
    level = tint if exposure is None else exposure == "auto"
    if exposure not in (None, "auto"):
        gain = gain * 2 ** in_range("exposure", _number("exposure", exposure), *STOPS, " stops")
    return gain, {(True, True): "both", (True, False): "tint", (False, True): "exposure"}.get((tint, level), "nothing")


def target_of(luts: LutSet, text: str) -> tuple[float, float, float]:
    """Melanin, eumelanin and hemoglobin of a preset's name or of three numbers; InputError outside the LUT."""
    parts = text.split(",")
    if text not in PRESETS and len(parts) != 3:
        allowed = f"{', '.join(PRESETS)}, or melanin,eumelanin,hemoglobin such as 0.1,0.7,0.01"
        raise InputError(f"target = {text!r}: allowed is {allowed}")
    skin = PRESETS[text] if text in PRESETS else [_number("target", part) for part in parts]
    try:
        melanin, eumelanin, hemoglobin = luts.chromophores(skin)
        luts.color(melanin, eumelanin, hemoglobin)
    except InputError as error:
        raise InputError(f"target: {error}") from error
    return melanin, eumelanin, hemoglobin


def _number(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise InputError(f"{name} = {text!r}: a number or auto is needed") from None


def _facts(
    luts: LutSet,
    painted: albedo.Albedo,
    inversion: albedo_to_skin.Inversion,
    residual: dict,
    options: Namespace,
    target,
    warnings,
) -> dict:
    """What maps.json says besides its files."""
    stops = float(np.mean(np.log2(inversion.gain)))
    rows, columns = inversion.painted.shape
    return {
        "lutgen": version("lutgen"), "albedo": Path(options.albedo).name, "size": [columns, rows],
        "encoding": painted.encoding, "oxygenation": luts.oxygenation,
        "skin": dict(zip(texture_maps.RATIOS, inversion.skin, strict=True)),
        "gain": inversion.gain.tolist(), "exposure_stops": stops, "balance": (inversion.gain / 2**stops).tolist(),
        "target": None if target is None else dict(zip(texture_maps.RATIOS, target, strict=True))
        | {"named": options.target},
        "residual": residual, "out_of_reach_delta_e00": maps_folder.REACH, "warnings": warnings,
    }  # fmt: skip


def _preview(path: Path, luts: LutSet, balanced, inversion, layers, facts: dict, recolored) -> None:
    from lutgen.fitting import maps_preview

    residual = facts["residual"]
    words = (
        f"{facts['albedo']}, {facts['size'][0]} x {facts['size'][1]}, read as {facts['encoding']}; CIEDE2000 left: "
        f"median {residual['delta_e00_median']:.2f}, p95 {residual['delta_e00_p95']:.2f}; "
        f"out of reach {residual['out_of_reach_share']:.1%}"
    )
    name = facts["target"]["named"] if facts["target"] else ""
    maps_preview.draw(luts, balanced, inversion, layers, words, recolored, name).save(path, compress_level=3)


def _text(result: dict, options: Namespace) -> str:
    residual, skin, seconds = result["residual"], result["skin"], result["seconds"]
    sliders = " ".join(f"--set {name}={value:.4g}" for name, value in skin.items())
    lines = [
        result["out"],
        f"skin: melanin {skin['melanin']:.3g}, eumelanin {skin['eumelanin']:.2g}, hemoglobin {skin['hemoglobin']:.3g} "
        f"(median); oxygenation {result['oxygenation']:g}",
        f"light: exposure {result['exposure_stops']:+.2f} stops, balance "
        + ",".join(f"{v:.3f}" for v in result["balance"]) + f"; read as {result['encoding']}",
        f"left: ΔE00 median {residual['delta_e00_median']:.2f}, mean {residual['delta_e00_mean']:.2f}, "
        f"p95 {residual['delta_e00_p95']:.2f}, max {residual['delta_e00_max']:.1f}; "
        f"{residual['out_of_reach_share']:.2%} out of reach (above {result['out_of_reach_delta_e00']:g}), "
        f"{residual['at_edge_share']:.2%} at an end of the LUT's axes",
    ]  # fmt: skip
    if options.format == "png" and residual["beyond_png_ratio_share"] > 0:
        lines.append(
            f"{residual['beyond_png_ratio_share']:.2%} of texels have more than {texture_maps.RATIO_RANGE:g} times "
            "the median, the most that PNG holds; --format exr keeps them"
        )
    lines.append(", ".join(f"{name} {value:.2f} s" for name, value in seconds.items())
                 + f"; inverted in {result['invert_us_per_pixel']:.2f} µs a pixel")  # fmt: skip
    luts = f"{shlex.quote(options.luts)} " if options.luts else ""
    lines.append(f"see it: lutgen view {luts}--maps {shlex.quote(result['out'])} {sliders}")
    return "\n".join(lines + [f"warning: {warning}" for warning in result["warnings"]])
