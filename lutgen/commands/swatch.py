"""Color and spectrum of one skin."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from lutgen import color, solvers
from lutgen.commands import Outcome, device_options, png_options, skin_options
from lutgen.errors import InputError
from lutgen.skin.tissue import PRESETS, Skin, plain, preset
from lutgen.solvers.paths import PHOTONS, SEEDS

EXAMPLES = (
    "lutgen swatch --preset dark --png dark.png",
    "lutgen swatch --melanin 0.03 --hemoglobin 0.01 --method path-table --json",
)
BASE = Skin(0.0195, 0.7, 0.0088)
"""What has the parameters that neither a preset nor an option names."""


def arguments(parser: ArgumentParser) -> None:
    """Add what says which skin, and how it is computed."""
    parser.add_argument(
        "--preset", choices=PRESETS, metavar="NAME", help=f"skin to begin with: {', '.join(PRESETS)} (default: none)"
    )
    parser.add_argument(
        "--pipeline", choices=color.PIPELINES, default="default",
        help="to a color by this package's way, or that of Zhang, Human face rendering (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--method", choices=solvers.METHODS, default="adding-doubling", help="solver (default: %(default)s)"
    )
    photons, seeds = "{} to {}".format(*PHOTONS), "{} to {}".format(*SEEDS)
    parser.add_argument(
        "--photons", type=int, default=100_000,
        help=f"photons per wavelength of path-table and direct, {photons} (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--seed", type=int, default=0, help=f"seed of their random streams, {seeds} (default: %(default)s)"
    )
    png_options.arguments(parser, "a picture of the color")
    skin_options.arguments(parser, BASE, "the preset's, else {}", melanin="the preset's")
    device_options.arguments(parser)


def run(options: Namespace) -> Outcome:
    """One skin's spectrum and color."""
    from lutgen import device as ocl

    values = skin_options.parameters(options)
    if options.preset is None and "melanin" not in values:
        raise InputError("swatch: --preset or --melanin is needed; for example `lutgen swatch --preset light`")
    skin = skin_options.changed(preset(options.preset) if options.preset is not None else BASE, values)
    extra: dict = {"photons": options.photons, "seed": options.seed}
    if options.device is not None:
        ocl.choose(options.device)
    if options.method in ("path-table", "direct"):
        extra["device"] = options.device
    reflectance, sigma = solvers.spectrum_with_error(skin, None, options.method, **extra)
    xyz = color.spectrum_to_xyz(reflectance, options.pipeline)
    srgb = color.from_xyz(xyz, "srgb", options.pipeline)
    result = {
        "skin": plain(skin), "method": options.method, "pipeline": options.pipeline,
        "wavelength_nm": color.tables()["wavelength_nm"].tolist(), "reflectance": reflectance.tolist(),
        "std_error": sigma.tolist(), "xyz": xyz.tolist(), "linear_srgb": srgb.tolist(),
        "lab": color.lab(xyz).tolist(), "srgb_hex": color.hex_code(srgb),
    }  # fmt: skip
    lightness, a, b = result["lab"]
    text = (
        f"{result['srgb_hex']}  L* {lightness:.2f}  a* {a:.2f}  b* {b:.2f}  "
        f"linear sRGB {srgb[0]:.4f} {srgb[1]:.4f} {srgb[2]:.4f}"
    )
    png_options.write(options, lambda preview: preview.draw_swatch(skin, result))
    return result, text, 0
