"""Every command; the only place that reads argv, prints or exits."""

from __future__ import annotations

import argparse
import io
import json
import os
import sys

from lutgen import errors

DEFAULT_OUT = "lutgen-luts"
_SPECTRUM = "wavelength_nm and reflectance (0 to 1), 380 to 780 nm"
_COLOR = (
    "'#rrggbb' (quoted), srgb:r,g,b (0 to 1, encoded), linear:r,g,b (linear sRGB), lab:L,a,b or xyz:X,Y,Z, under D65"
)


class _Parser(argparse.ArgumentParser):
    """A parser whose errors are one line."""

    def error(self, message: str):
        """Raise what `main` prints in one line."""
        raise errors.InputError(f"{self.prog}: {message}; `{self.prog} --help` lists what is allowed")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="lutgen", description="Lookup tables for real-time skin shading, baked by Monte Carlo.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND", parser_class=_Parser)

    bake = commands.add_parser("bake", help="bake a LUT set into a folder")
    bake.add_argument("recipe", nargs="?", help="TOML file; see luts/bake.toml (default: the quality as it is)")
    bake.add_argument("--out", default=DEFAULT_OUT, metavar="DIR", help=f"folder to make (default: {DEFAULT_OUT})")
    bake.add_argument("--quality", default="standard", help="draft, standard or reference: what the recipe starts from")
    bake.add_argument("--photons", type=int, help="photons per wavelength")
    bake.add_argument("--wavelengths", help="6, 8, 12, 10nm or 5nm")
    bake.add_argument("--seed", type=int, help="seed of the random streams")
    bake.add_argument("--force", action="store_true", help="replace an existing LUT set")
    bake.set_defaults(run="lutgen.commands.sets.bake")

    swatch = commands.add_parser("swatch", help="color and spectrum of one skin")
    swatch.add_argument("--preset", help="very-light, light, intermediate, tan, brown, dark, source-caucasian, …")
    swatch.add_argument("--pipeline", default="default", help="default or source")
    swatch.add_argument(
        "--method", default="adding-doubling", help="adding-doubling, path-table, direct, dipole or multipole"
    )
    swatch.add_argument("--photons", type=int, default=100_000, help="per wavelength, for Monte Carlo")
    swatch.add_argument("--seed", type=int, default=0)
    swatch.add_argument("--png", metavar="FILE", help="write a picture of the color")
    swatch.set_defaults(run="lutgen.commands.skin.swatch")

    fit = commands.add_parser(
        "fit", help="melanin, hemoglobin, ... of a measured spectrum or color, with uncertainties"
    )
    fit.add_argument(
        "measured", nargs="?", metavar="SPECTRUM.csv|COLOR", help=f"CSV with columns {_SPECTRUM}; or {_COLOR}"
    )
    fit.add_argument(
        "--parameters",
        metavar="NAME[,NAME...]",
        help="what is fitted, of melanin, hemoglobin, oxygenation, eumelanin "
        "(default: the first three of a spectrum, two of a color); all else is fixed by the options below",
    )
    fit.add_argument("--specular-included", action="store_true", help="the surface's reflection is in the data")
    fit.add_argument(
        "--noise",
        type=float,
        help="standard deviation of each reflectance (default: what is left says it), or of the "
        "color in ΔE00 (default: 1)",
    )
    fit.add_argument("--png", metavar="FILE", help="write a picture of data and model")
    fit.set_defaults(run="lutgen.commands.skin.fit")

    for command in (swatch, fit):
        for name in ("melanin", "eumelanin", "hemoglobin", "oxygenation", "epidermis-mm"):
            command.add_argument(f"--{name}", type=float)
        command.add_argument("--scattering", help="source, bashkatov, jacques, saidi or donner")
        command.add_argument("--saidi-a-per-mm", type=float, help="Saidi's fitted A (default: 5.7)")
        command.add_argument("--saidi-b-nm4-per-mm", type=float, help="Saidi's fitted B (default: 8.4e10)")
        command.add_argument("--reading", help="reduced, similarity or literal")

    info = commands.add_parser("info", help="what a LUT set holds")
    info.add_argument("dir", metavar="DIR")
    info.set_defaults(run="lutgen.commands.sets.info")

    devices = commands.add_parser("devices", help="the OpenCL devices, best first")
    devices.set_defaults(run="lutgen.commands.machine.devices")

    check = commands.add_parser("check", help="verify a LUT set: files, axes, laws, 100 nodes against adding-doubling")
    check.add_argument("dir", metavar="DIR")
    check.set_defaults(run="lutgen.commands.sets.check")

    bench = commands.add_parser("bench", help="speed of the trace, and time and error of a bake by stage")
    bench.add_argument("--viewer", action="store_true", help="instead: milliseconds of a frame by pass and tier")
    bench.add_argument("--size", default=None, help="with --viewer: pixels (default: 640x360)")
    bench.set_defaults(run="lutgen.commands.machine.bench")

    figures = commands.add_parser("figures", help="the source document's results as charts and tables")
    figures.add_argument("--out", required=True, metavar="DIR", help="folder to make")
    figures.set_defaults(run="lutgen.commands.charts.figures")

    chart = commands.add_parser("chart", help="speed against accuracy of every method and setting, as charts")
    stability = commands.add_parser("stability", help="where each method errs beyond its promise, as maps and a table")
    for command in (chart, stability):
        command.add_argument("--out", required=True, metavar="DIR", help="folder to make")
        command.add_argument("--quick", action="store_true", help="in under a minute: fewer photons, coarser maps")
    chart.set_defaults(run="lutgen.commands.charts.chart")
    stability.set_defaults(run="lutgen.commands.charts.stability")

    view = commands.add_parser("view", help="a window with a face shaded from a LUT set, or a picture of it")
    sheet = commands.add_parser("sheet", help="a picture of every preset on a head")
    render = commands.add_parser("render", help="a head by Monte Carlo: the truth that the viewer is compared with")
    for command in (view, sheet, render):
        command.add_argument("dir", nargs="?", metavar="LUT_DIR", help="LUT set (default: the one that came along)")
        command.add_argument("--mesh", metavar="FILE", help="GLB, glTF, OBJ or lee-perry-smith (default: built-in)")
        command.add_argument("--mm-per-unit", type=float, help="millimetres per unit of the mesh (default: a guess)")
        command.add_argument("--flip-v", action="store_true", help="turn the mesh's texture coordinates upside down")
        command.add_argument(
            "--maps", metavar="DIR", help="texture maps by name: melanin.png, normal.png, ...; or none"
        )
        command.add_argument("--albedo", default="recolor", help="a painted albedo: recolor it or invert it to maps")
        command.add_argument(
            "--environment", default="studio", metavar="NAME", help="studio, none or an equirectangular .exr or .hdr"
        )
        command.add_argument("--normalize-environment", action="store_true", help="as bright on average as the studio")
        command.add_argument("--look", metavar="FILE", help="look that the viewer saved (TOML)")
        command.add_argument("--preset", help="chromophores of a preset: light, dark, ...")
        command.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="one value of the look")
        command.add_argument("--size", default=None, help="pixels: 640x360")
    for command in (view, sheet):
        command.add_argument("--compare", metavar="DIR", help="another LUT set, the right half with --set split=set")
    view.add_argument("--screenshot", metavar="FILE", help="picture to write instead of a window; .exr: linear")
    view.set_defaults(run="lutgen.commands.pictures.view")
    sheet.add_argument("--out", required=True, metavar="FILE", help="PNG to write")
    sheet.set_defaults(run="lutgen.commands.pictures.sheet")

    render.add_argument(
        "--walk", default="flat",
        help="flat: as if the skin were flat where light enters (default); flat-full: the same without its tables; "
        "mesh: inside the head, which must be closed",
    )  # fmt: skip
    render.add_argument("--spp", type=int, help="samples a pixel (default: 256 where neither time nor noise is given)")
    render.add_argument("--time", metavar="60s", help="stop after so long: 60s, 5m, 1h")
    render.add_argument("--noise", type=float, help="stop where a pixel's noise is this ΔE00 on average")
    render.add_argument("--out", required=True, metavar="FILE.exr", help="picture to write, or to go on with")
    render.add_argument("--png", metavar="FILE", help="also as the viewer would show it")
    render.add_argument("--seed", type=int, default=0, help="of the random streams")
    render.add_argument("--force", action="store_true", help="replace a picture of other options")
    render.set_defaults(run="lutgen.commands.render.render")

    export = commands.add_parser("export", help="a LUT set in the form that engines open")
    export.add_argument("dir", nargs="?", metavar="LUT_DIR", help="LUT set (default: the one that came along)")
    export.add_argument(
        "--to", required=True, metavar="TARGET[,TARGET...]", help="cube, exr, unreal, unity, ... or all"
    )
    export.add_argument("--out", required=True, metavar="DIR", help="folder to make, with one folder a target")
    export.add_argument("--size", type=int, help="nodes along each axis of a cube (default: 31 for the default set)")
    export.add_argument("--force", action="store_true", help="replace an existing folder")
    export.set_defaults(run="lutgen.commands.sets.export")

    maps = commands.add_parser("maps", help="melanin and hemoglobin maps from a painted or photographed albedo")
    maps.add_argument("albedo", metavar="ALBEDO", help="PNG, JPEG, TIFF or EXR; clear and black texels are background")
    maps.add_argument("--luts", metavar="DIR", help="LUT set (default: the one that came along)")
    maps.add_argument("--out", required=True, metavar="DIR", help="folder to make")
    maps.add_argument("--format", default="png", help="png (16 bits) or exr (float)")
    maps.add_argument("--absolute", action="store_true", help="also maps of the LUT's axes instead of ratios")
    maps.add_argument("--encoding", help="srgb or linear (default: srgb, EXR linear Rec. 709)")
    maps.add_argument("--balance", default="auto", help="auto, none or linear gains R,G,B")
    maps.add_argument("--exposure", help="auto or stops (default: auto with --balance auto, else 0)")
    maps.add_argument("--eumelanin", default="auto", help="auto or the ratio")
    maps.add_argument("--target", help="also the albedo on another skin: a preset or melanin,eumelanin,hemoglobin")
    maps.add_argument("--force", action="store_true", help="replace an existing folder of maps")
    maps.set_defaults(run="lutgen.commands.maps.maps_of")

    compare = commands.add_parser("compare", help="how far two pictures of a scene are apart, without their noise")
    compare.add_argument("a", metavar="A", help="EXR that `lutgen render` or `lutgen view` wrote, or any picture")
    compare.add_argument("b", metavar="B", help="picture of the same size")
    compare.add_argument("--png", metavar="FILE", help="write A, B and the map of differences side by side")
    compare.set_defaults(run="lutgen.commands.compare.compare")

    plan = commands.add_parser("plan", help="the least model that a scene needs, its predicted error and cost")
    plan.add_argument("--tolerance", type=float, default=0.5, help="ΔE00 of colors, 95th percentile (default: 0.5)")
    plan.add_argument("--ee-tolerance", type=float, help="EE difference of profiles (default: a 20th of --tolerance)")
    plan.add_argument(
        "--tones", default="all", help="all, PRESET, melanin=LOW:HIGH, a map or a folder of maps, separated by commas"
    )
    plan.add_argument("--vary", metavar="NAME[,NAME...]", help="what varies at run time: melanin, oxygenation, ...")
    plan.add_argument("--mm-per-pixel", type=float, default=0.2, help="how near the skin is seen (default: 0.2)")
    plan.add_argument("--bytes", type=int, help="what the tables may take")
    plan.add_argument("--seconds", type=float, help="what the bake may take")
    plan.add_argument("--write", metavar="FILE", help="recipe to write, which `lutgen bake FILE` takes")
    plan.add_argument("--force", action="store_true", help="replace an existing recipe")
    plan.add_argument("--verify", action="store_true", help="bake it and set measured beside predicted errors")
    plan.add_argument("--explain", action="store_true", help="say in five lines why each choice is the least")
    plan.set_defaults(run="lutgen.commands.plan.plan")

    for command in (bake, swatch, bench, plan, render):
        command.add_argument("--device", help="index or part of a name that `lutgen devices` lists")
    for command in commands.choices.values():
        command.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    return parser


def _fail(message: str, status: int) -> int:
    print(f"lutgen: {' '.join(message.split())}", file=sys.stderr)
    return status


def main(arguments: list[str] | None = None) -> int:
    """Run a command and return its exit status: 0, 2 for bad input, 1 where the machine fails."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal that cannot show a sign must not fail a bake
    try:
        options = _parser().parse_args(arguments)
        module, _, function = options.run.rpartition(".")
        from importlib import import_module

        result, text, status = getattr(import_module(module), function)(options)
        print(json.dumps(result) if options.json else text, flush=True)
        return status
    except errors.InputError as error:
        return _fail(str(error), 2)
    except BrokenPipeError:
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115 - the reader left; say nothing at exit either
        return 1
    except (errors.MachineError, MemoryError, OSError) as error:
        return _fail(str(error) or "out of memory", 1)
    except KeyboardInterrupt:
        print("lutgen: interrupted; nothing was written", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
