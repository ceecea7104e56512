"""What the machine can: devices, bench."""

from __future__ import annotations

from argparse import Namespace

from lutgen.commands import Outcome, pictures
from lutgen.errors import InputError, MachineError


def devices(options: Namespace) -> Outcome:
    """`lutgen devices`: what OpenCL offers, best first."""
    from lutgen import device as ocl

    found = ocl.devices()
    if not found:
        raise MachineError(f"no OpenCL device; {ocl.INSTALL_HINT}")
    rows = [
        {"index": i, "name": d.name, "platform": d.platform, "kind": d.kind, "lanes": d.lanes}
        for i, d in enumerate(found)
    ]
    text = "\n".join(f"{r['index']}  {r['kind']}  {r['platform']}: {r['name']}  ({r['lanes']} lanes)" for r in rows)
    return {"devices": rows}, text, 0


def bench(options: Namespace) -> Outcome:
    """`lutgen bench`: events per second, lanes against one lane, and a bake by stage; or the viewer's frames."""
    if options.viewer:
        return pictures.bench(options)
    if options.size is not None:
        raise InputError(f"size = {options.size}: only frames have a size; add --viewer")
    from lutgen.tables import bench as benchmark

    result = benchmark.run(options.device)
    trace, baked = result["trace"], result["bake"]
    text = (
        f"trace on {trace['device']}: {trace['events_per_s'] / 1e9:.2f} G events/s, "
        f"{trace['photons_per_s'] / 1e6:.2f} M photons/s, {trace['lanes']} lanes are {trace['ratio_w1']:.1f} × one; "
        f"{100 * trace['peak_share']:.0f} % of the measured multiply-add peak\n"
        + "\n".join(
            f"{quality}: {run['seconds']['total']:.2f} s, ΔE00 max {run['error']['color']['delta_e00_max']:.3f}, "
            f"p95 {run['error']['color']['delta_e00_p95']:.3f}; "
            + ", ".join(f"{name} {value:.2f}" for name, value in run["seconds"].items() if name != "total")
            for quality, run in baked.items()
        )
        + f"\nexpansion to another oxygenation: {1000 * result['expand_s']:.1f} ms"
    )
    return result, text, 0
