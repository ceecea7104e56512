"""What a LUT set holds."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path

from lutgen.commands import Outcome
from lutgen.tables import storage

EXAMPLES = ("lutgen info my-luts",)


def arguments(parser: ArgumentParser) -> None:
    """Add the set."""
    parser.add_argument("dir", metavar="DIR", help="folder of the LUT set")


def run(options: Namespace) -> Outcome:
    """The manifest, in words."""
    folder = Path(options.dir)
    luts = storage.load(folder)
    facts = luts.manifest
    lines = [f"{folder.absolute()}: LUT set of lutgen {facts['lutgen']}, {facts['recipe']['totals']} totals"]
    for name, grid in (("color", luts.color_lut.grid), ("profile", luts.profile_lut.grid)):
        axes = (f"{a.name} {a.low:g} to {a.high:g} ({a.count}, {a.spacing})" for a in reversed(grid.axes))
        lines.append(f"{name}: {', '.join(axes)}")
    nm = ", ".join(f"{w:g}" for w in facts["quadrature"]["wavelength_nm"])
    rings = len(luts.paths.radius_edges_mm) - 1
    lines.append(f"profiles: {rings} rings to {luts.paths.radius_edges_mm[-1]:g} mm")
    lines.append(f"skin: {', '.join(f'{key} {value}' for key, value in facts['recipe']['skin'].items())}")
    lines.append(f"wavelengths: {nm} nm; {facts['trace']['photons_per_wavelength']} photons each, "
                 f"seed {facts['trace']['seed']}, on {facts['trace']['device']}")  # fmt: skip
    if facts["error"]:
        error = facts["error"]["color"]
        lines.append(
            f"color: ΔE00 max {error['delta_e00_max']:.3f}, p95 {error['delta_e00_p95']:.3f} "
            f"against {error['compared_with']}"
        )
    else:
        lines.append("color: expanded from stored paths, its error not measured")
    sizes = {name: (folder / name).stat().st_size for name in storage.EXR_FILES}
    lines += [f"{name}: {size / 1000:.0f} kB" for name, size in sizes.items()]
    return facts | {"bytes": sizes}, "\n".join(lines), 0
