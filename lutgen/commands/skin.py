"""One skin: swatch."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import asdict, replace

from lutgen import color
from lutgen.commands import Outcome
from lutgen.errors import InputError, cannot_write


def swatch(options: Namespace) -> Outcome:
    """`lutgen swatch`: one skin's spectrum and color."""
    from lutgen import device as ocl
    from lutgen import solvers
    from lutgen.tissue import Skin, preset

    fields = ("melanin", "eumelanin", "hemoglobin", "oxygenation", "epidermis_mm", "scattering", "reading",
              "saidi_a_per_mm", "saidi_b_nm4_per_mm")  # fmt: skip
    given = {name: getattr(options, name) for name in fields if getattr(options, name) is not None}
    if options.preset is None and "melanin" not in given:
        raise InputError("swatch: --preset or --melanin is needed; for example `lutgen swatch --preset light`")
    base = preset(options.preset) if options.preset is not None else Skin(0.0195, 0.7, 0.0088)
    skin = replace(base, **given)
    if skin.scattering != "saidi" and {"saidi_a_per_mm", "saidi_b_nm4_per_mm"} & set(given):
        raise InputError(f"saidi_*: scattering is {skin.scattering}, which has no such values; add --scattering saidi")
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
    if options.png is not None:
        from lutgen import preview

        try:
            preview.draw_swatch(skin, result).save(options.png, format="PNG")
        except OSError as error:
            raise cannot_write("png", options.png, error) from error
    return result, text, 0
