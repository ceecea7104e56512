"""Melanin, hemoglobin, ... of a measured spectrum or color, with uncertainties."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from lutgen import color, fitting
from lutgen.commands import Outcome, png_options, skin_options
from lutgen.errors import InputError, one_of
from lutgen.fitting import BASE, Fit, measured
from lutgen.skin.tissue import plain

EXAMPLES = (
    "lutgen fit '#c09584'",
    "lutgen fit lab:62,10,18 --eumelanin 0.8 --png fit.png",
    "lutgen fit spectrum.csv --specular-included --parameters melanin,hemoglobin,oxygenation",
)


def arguments(parser: ArgumentParser) -> None:
    """Add what was measured, and what of the skin is fitted or fixed."""
    parser.add_argument(
        "measured", nargs="?", metavar="SPECTRUM.csv|COLOR",
        help="CSV with columns wavelength_nm and reflectance (0 to 1), 380 to 780 nm; or '#rrggbb' (quoted), "
        "srgb:r,g,b (0 to 1, encoded), linear:r,g,b (linear sRGB), lab:L,a,b or xyz:X,Y,Z, under D65 (no default)",
    )  # fmt: skip
    parser.add_argument(
        "--parameters", metavar="NAME[,NAME...]",
        help=f"what is fitted, of {', '.join(fitting.PARAMETERS)} "
        "(default: the first three of a spectrum, two of a color); all else is fixed by the options below",
    )  # fmt: skip
    parser.add_argument("--specular-included", action="store_true", help="the surface's reflection is in the data")
    spectrum, of_color = ("{:g} to {:g}".format(*fitting.NOISE[name]) for name in ("spectrum", "color"))
    parser.add_argument(
        "--noise", type=float,
        help=f"standard deviation of each reflectance, {spectrum} (default: what is left says it), or of the "
        f"color in ΔE00, {of_color} (default: 1)",
    )  # fmt: skip
    png_options.arguments(parser, "a picture of data and model")
    skin_options.arguments(
        parser, BASE, melanin="fitted", hemoglobin="fitted",
        oxygenation=f"fitted of a spectrum, else {BASE.oxygenation:g}",
    )  # fmt: skip


def run(options: Namespace) -> Outcome:
    """The skin of a measured spectrum or color."""
    if options.measured is None:
        raise InputError(
            f"fit: a CSV's path or a color is needed: {measured.GRAMMAR}; quote #, with which shells begin a comment"
        )
    data, fixed = measured.read(options.measured), skin_options.parameters(options)
    if options.parameters is not None:
        wanted = tuple(name.strip() for name in options.parameters.split(",") if name.strip())
    else:
        usual = fitting.OF_COLOR if data.wavelength_nm is None else fitting.OF_SPECTRUM
        wanted = tuple(name for name in usual if name not in fixed)
    for name in wanted:
        one_of("parameters", name, tuple(fitting.PARAMETERS))
        if wanted.count(name) > 1:
            raise InputError(f"parameters = {options.parameters}: {name} is there twice; name each once")
    if not wanted and options.parameters is None:
        raise InputError(f"--{', --'.join(fixed)}: all is fixed, nothing is left to fit; leave one of them out")
    both = [name for name in wanted if name in fixed]
    if both:
        raise InputError(f"{both[0]}: both fitted and fixed; drop --{both[0]}, or take it out of --parameters")
    for name in ("melanin", "hemoglobin"):
        if name not in wanted and name not in fixed:
            raise InputError(f"{name}: neither fitted nor fixed; add --{name} VALUE, or put it into --parameters")
    base = skin_options.changed(BASE, fixed)
    solution = fitting.fit(data, wanted, base, options.specular_included, options.noise)
    result = _as_json(solution, options)
    png_options.write(options, lambda preview: preview.draw_fit(solution.skin, result))
    return result, _as_text(result), 0


def _as_json(solution: Fit, options: Namespace) -> dict:
    names, data = list(solution.parameters), solution.data
    rows = zip(names, solution.correlation.tolist(), strict=True)
    sides = {}
    for side, xyz in (("measured", data.xyz), ("model", solution.xyz)):
        srgb = color.from_xyz(xyz, "srgb")
        sides[side] = {"xyz": xyz.tolist(), "lab": color.lab(xyz).tolist(), "linear_srgb": srgb.tolist(),
                       "srgb_hex": color.hex_code(srgb)}  # fmt: skip
    if data.reflectance is not None:
        sides["measured"]["reflectance"] = data.reflectance.tolist()
    sides["model"]["reflectance"] = solution.reflectance.tolist()
    return {
        "parameters": solution.parameters, "sigma": solution.sigma,
        "correlation": {name: dict(zip(names, row, strict=True)) for name, row in rows},
        "delta_e00": solution.delta_e00, "rmse": solution.rmse, "notes": list(solution.notes),
        "skin": plain(solution.skin), "given_as": data.space, "specular_included": options.specular_included,
        "noise": options.noise, "wavelength_nm": solution.wavelength_nm.tolist(), **sides,
    }  # fmt: skip


def _as_text(result: dict) -> str:
    skin, fitted, lines = result["skin"], result["parameters"], []
    for name, value in fitted.items():
        sigma = result["sigma"][name]
        lines.append(f"{name:12}{value:.4g}" + (" at its bound" if sigma is None else f" ± {sigma:.2g}"))
    fixed = [f"{name} {skin[name]:g}" for name in skin_options.FIELDS[:4] if name not in fitted]
    fixed += [
        f"epidermis {skin['epidermis_mm']:g} mm",
        f"{skin['scattering']} scattering",
        f"{skin['reading']} reading",
    ]
    lines.append(f"fixed: {', '.join(fixed)}")
    nm = result["wavelength_nm"]
    left = f"ΔE00 {result['delta_e00']:.2f}"
    if result["rmse"] is not None:
        left += f", RMSE {result['rmse']:.4f} over {len(nm)} wavelengths, {nm[0]:g} to {nm[-1]:g} nm"
    elif result["noise"] is None:
        left += "; ±: at a noise of ΔE00 1 in the color"
    lines.append(f"{left}; measured {result['measured']['srgb_hex']}, model {result['model']['srgb_hex']}")
    return "\n".join([*lines, *(f"note: {note}" for note in result["notes"])])
