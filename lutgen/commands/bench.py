"""Speed of the trace, and time and error of a bake by stage."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

import lutgen
from lutgen.commands import Outcome, device_options, progress
from lutgen.errors import InputError

EXAMPLES = ("lutgen bench --device 0", "lutgen bench --viewer --size 1280x720")
VIEWER_SIZE = "640x360"


def arguments(parser: ArgumentParser) -> None:
    """Add what is timed."""
    parser.add_argument("--viewer", action="store_true", help="instead: milliseconds of a frame by pass and tier")
    parser.add_argument(
        "--size", metavar="WxH",
        help=f"with --viewer: width x height in pixels, 16 to 4096 each way (default: {VIEWER_SIZE})",
    )  # fmt: skip
    device_options.arguments(parser)
    progress.arguments(parser)


def run(options: Namespace) -> Outcome:
    """Events per second, lanes against one lane, and a bake by stage; or the viewer's frames."""
    if options.viewer:
        return _viewer(options)
    if options.size is not None:
        raise InputError(f"size = {options.size}: only frames have a size; add --viewer")
    from lutgen.tables import bench

    with progress.Progress(options) as tell:
        result = bench.run(options.device, tell)
    trace, bakes = result["trace"], result["bake"]
    text = (
        f"trace on {trace['device']}: {trace['events_per_s'] / 1e9:.2f} G events/s, "
        f"{trace['photons_per_s'] / 1e6:.2f} M photons/s, {trace['lanes']} lanes are {trace['ratio_w1']:.1f} × one; "
        f"{100 * trace['peak_share']:.0f} % of the measured multiply-add peak\n"
        + "\n".join(
            f"{quality}: {bake['seconds']['total']:.2f} s, ΔE00 max {bake['error']['color']['delta_e00_max']:.3f}, "
            f"p95 {bake['error']['color']['delta_e00_p95']:.3f}; "
            + ", ".join(f"{name} {value:.2f}" for name, value in bake["seconds"].items() if name != "total")
            for quality, bake in bakes.items()
        )
        + f"\nexpansion to another oxygenation: {1000 * result['expand_s']:.1f} ms"
    )
    return result, text, 0


def _viewer(options: Namespace) -> Outcome:
    """Milliseconds of the built-in head by pass and tier, and over the same head without LUT and scattering."""
    from lutgen.scene import subject, viewer

    timing = viewer.viewer("measure.timing")
    size = subject.size_of(options.size or VIEWER_SIZE)
    with progress.Progress(options) as tell:
        tell("viewer", None)
        result = timing.report(
            lutgen.load(), *subject.model(None, None, None), size, progress=lambda name: tell(name, None)
        )
    return result, _table(result), 0


def _table(result: dict) -> str:
    """Costs by pass and tier as text."""
    width, height = result["size"]
    passes = list(next(iter(result["tiers"].values()))["milliseconds"])
    lines = [
        f"{result['renderer']}, {width} x {height}, medians of {result['rounds']} rounds in turn, milliseconds",
        f"{'':10}{'taps':>8}" + "".join(f"{name:>13}" for name in (*passes, "frame")) + f"{'over plain':>13}",
    ]
    for cost in (result["plain"], *result["tiers"].values()):
        taps = f"{cost['frames']} x {cost['taps']}" if cost["frames"] > 1 else f"{cost['taps']}"
        times = [cost["milliseconds"].get(name) for name in passes] + [cost["total"]]
        cells = "".join(f"{'-':>13}" if ms is None else f"{ms:13.1f}" for ms in times)
        lines.append(f"{cost['name']:10}{taps:>8}{cells}{cost['ratio']:13.2f}")
    lines.append(
        f"plain: the same head with a color texture, no LUT, no scattering; another oxygenation reaches the GPU in "
        f"{result['oxygenation_ms']:.1f} ms; LUT textures {result['lut_bytes'] / 1e6:.2f} MB"
    )
    return "\n".join(lines)
