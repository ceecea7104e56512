"""The OpenCL devices, best first."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from lutgen.commands import Outcome
from lutgen.errors import MachineError

EXAMPLES = ("lutgen devices", "lutgen devices --json")


def arguments(parser: ArgumentParser) -> None:
    """Add nothing: there is nothing to choose."""


def run(options: Namespace) -> Outcome:
    """What OpenCL offers, best first."""
    from lutgen import device as ocl

    devices = ocl.devices()
    if not devices:
        raise MachineError(f"no OpenCL device; {ocl.INSTALL_HINT}")
    rows = [
        {"index": i, "name": d.name, "platform": d.platform, "kind": d.kind, "lanes": d.lanes}
        for i, d in enumerate(devices)
    ]
    text = "\n".join(f"{r['index']}  {r['kind']}  {r['platform']}: {r['name']}  ({r['lanes']} lanes)" for r in rows)
    return {"devices": rows}, text, 0
