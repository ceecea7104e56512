"""One skin: swatch, fit."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable
from dataclasses import asdict, replace
from typing import TYPE_CHECKING

from lutgen import color
from lutgen.commands import Outcome
from lutgen.errors import InputError, cannot_write, one_of
from lutgen.fitting.measured import GRAMMAR

if TYPE_CHECKING:
    from lutgen.fitting import Fit
    from lutgen.skin.tissue import Skin

_FIELDS = ("melanin", "eumelanin", "hemoglobin", "oxygenation", "epidermis_mm", "scattering", "reading",
           "saidi_a_per_mm", "saidi_b_nm4_per_mm")  # fmt: skip


def _given(options: Namespace) -> dict:
    """Fields of a skin that stand on the command line."""
    return {name: getattr(options, name) for name in _FIELDS if getattr(options, name) is not None}


def _changed(base: Skin, given: dict) -> Skin:
    """The skin with those fields; InputError for values of Saidi's law under another one."""
    skin = replace(base, **given)
    if skin.scattering != "saidi" and {"saidi_a_per_mm", "saidi_b_nm4_per_mm"} & set(given):
        raise InputError(f"saidi_*: scattering is {skin.scattering}, which has no such values; add --scattering saidi")
    return skin


def swatch(options: Namespace) -> Outcome:
    """`lutgen swatch`: one skin's spectrum and color."""
    from lutgen import device as ocl
    from lutgen import solvers
    from lutgen.skin.tissue import Skin, preset

    given = _given(options)
    if options.preset is None and "melanin" not in given:
        raise InputError("swatch: --preset or --melanin is needed; for example `lutgen swatch --preset light`")
    base = preset(options.preset) if options.preset is not None else Skin(0.0195, 0.7, 0.0088)
    skin = _changed(base, given)
    extra: dict = {"photons": options.photons, "seed": options.seed}
    if options.device is not None:
        ocl.choose(options.device)
    if options.method in ("path-table", "direct"):
        extra["device"] = options.device
    reflectance, sigma = solvers.spectrum_with_error(skin, None, options.method, **extra)
    xyz = color.spectrum_to_xyz(reflectance, options.pipeline)
    srgb = color.from_xyz(xyz, "srgb", options.pipeline)
    result = {
        "skin": asdict(skin), "method": options.method, "pipeline": options.pipeline,
        "wavelength_nm": color.tables()["wavelength_nm"].tolist(), "reflectance": reflectance.tolist(),
        "std_error": sigma.tolist(), "xyz": xyz.tolist(), "linear_srgb": srgb.tolist(),
        "lab": color.lab(xyz).tolist(), "srgb_hex": color.hex_code(srgb),
    }  # fmt: skip
    lightness, a, b = result["lab"]
    text = (
        f"{result['srgb_hex']}  L* {lightness:.2f}  a* {a:.2f}  b* {b:.2f}  "
        f"linear sRGB {srgb[0]:.4f} {srgb[1]:.4f} {srgb[2]:.4f}"
    )
    _draw(options, lambda preview: preview.draw_swatch(skin, result))
    return result, text, 0


def _draw(options: Namespace, picture: Callable) -> None:
    """Write what `picture(lutgen.preview)` draws to --png, if it is asked for."""
    if options.png is not None:
        from lutgen.tables import preview

        try:
            picture(preview).save(options.png, format="PNG")
        except OSError as error:
            raise cannot_write("png", options.png, error) from error


def fit(options: Namespace) -> Outcome:
    """`lutgen fit`: the skin of a measured spectrum or color."""
    from lutgen import fitting
    from lutgen.fitting import measured
    from lutgen.skin.tissue import Skin

    if options.measured is None:
        raise InputError(
            f"fit: a CSV's path or a color is needed: {GRAMMAR}; quote #, with which shells begin a comment"
        )
    data, given = measured.read(options.measured), _given(options)
    if options.parameters is not None:
        wanted = tuple(name.strip() for name in options.parameters.split(",") if name.strip())
    else:
        default = fitting.OF_COLOR if data.wavelength_nm is None else fitting.OF_SPECTRUM
        wanted = tuple(name for name in default if name not in given)
    for name in wanted:
        one_of("parameters", name, tuple(fitting.PARAMETERS))
        if wanted.count(name) > 1:
            raise InputError(f"parameters = {options.parameters}: {name} is there twice; name each once")
    if not wanted and options.parameters is None:
        raise InputError(f"--{', --'.join(given)}: all is fixed, nothing is left to fit; leave one of them out")
    both = [name for name in wanted if name in given]
    if both:
        raise InputError(f"{both[0]}: both fitted and fixed; drop --{both[0]}, or take it out of --parameters")
    for name in ("melanin", "hemoglobin"):
        if name not in wanted and name not in given:
            raise InputError(f"{name}: neither fitted nor fixed; add --{name} VALUE, or put it into --parameters")
    base = _changed(Skin(0.02, 0.7, 0.01), given)
    found = fitting.fit(data, wanted, base, options.specular_included, options.noise)
    result = _as_json(found, options)
    _draw(options, lambda preview: preview.draw_fit(found.skin, result))
    return result, _as_text(result), 0


def _as_json(found: Fit, options: Namespace) -> dict:
    names, data = list(found.parameters), found.data
    rows = zip(names, found.correlation.tolist(), strict=True)
    sides = {}
    for side, xyz in (("measured", data.xyz), ("model", found.xyz)):
        srgb = color.from_xyz(xyz, "srgb")
        sides[side] = {"xyz": xyz.tolist(), "lab": color.lab(xyz).tolist(), "linear_srgb": srgb.tolist(),
                       "srgb_hex": color.hex_code(srgb)}  # fmt: skip
    if data.reflectance is not None:
        sides["measured"]["reflectance"] = data.reflectance.tolist()
    sides["model"]["reflectance"] = found.reflectance.tolist()
    return {
        "parameters": found.parameters, "sigma": found.sigma,
        "correlation": {name: dict(zip(names, row, strict=True)) for name, row in rows},
        "delta_e00": found.delta_e00, "rmse": found.rmse, "notes": list(found.notes), "skin": asdict(found.skin),
        "given_as": data.space, "specular_included": options.specular_included, "noise": options.noise,
        "wavelength_nm": found.wavelength_nm.tolist(), **sides,
    }  # fmt: skip


def _as_text(result: dict) -> str:
    skin, fitted, lines = result["skin"], result["parameters"], []
    for name, value in fitted.items():
        sigma = result["sigma"][name]
        lines.append(f"{name:12}{value:.4g}" + (" at its bound" if sigma is None else f" ± {sigma:.2g}"))
    fixed = [f"{name} {skin[name]:g}" for name in _FIELDS[:4] if name not in fitted]
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
