"""What `lutgen bench` measures: the trace's speed, lanes against one lane, and bakes by stage."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

import lutgen
from lutgen import device as ocl
from lutgen.errors import MachineError
from lutgen.skin.tissue import Tissue
from lutgen.solvers import path_table
from lutgen.tables.bake import Progress, skin_medium

ROUNDS = 5
_WAVELENGTHS_NM = np.array([460.0, 550.0, 640.0])
_PHOTONS = {"lanes": 196_608, "one lane": 24_576}
FLOPS_PER_EVENT = 72
"""Operations of one step of kernels/solvers/path_table.cl outside its branch, a multiply-add counted as two."""
_CHAINS, _PEAK_ROUNDS, _PEAK_ITEMS = 12, 200_000, 64


def run(device: str | None, progress: Progress = lambda stage, tally: None) -> dict:
    """All figures, as `lutgen bench --json` prints them; `progress` is told each stage."""
    chosen = ocl.choose(device)
    progress("trace", None)
    rates = trace(chosen)
    times = bakes(device, progress)
    progress("expand", None)
    return {"trace": rates, "bake": times, "expand_s": expansion()}


def trace(chosen: ocl.Device) -> dict:
    """Rate of the walk with drawn lives: W lanes and one lane of the same source in turn, medians and their ratio."""
    widths = {"lanes": chosen, "one lane": replace(chosen, lanes=1)}
    for device in widths.values():
        _rate(device, path_table.BLOCK_PHOTONS["cpu"])  # build
    rates = {name: [] for name in widths}
    peaks = []
    for _ in range(ROUNDS):
        for name, device in widths.items():
            rates[name].append(_rate(device, _PHOTONS[name]))
        peaks.append(_peak_flops(chosen))
    events, photons = np.median(rates["lanes"], axis=0)
    ratios = [a[0] / b[0] for a, b in zip(rates["lanes"], rates["one lane"], strict=True)]
    peak = float(np.median(peaks))
    return {
        "device": chosen.name, "platform": chosen.platform, "lanes": chosen.lanes,
        "events_per_s": float(events), "photons_per_s": float(photons), "ratio_w1": float(np.median(ratios)),
        "peak_flops": peak, "flops_per_event": FLOPS_PER_EVENT, "peak_share": float(events) * FLOPS_PER_EVENT / peak,
    }  # fmt: skip


def _rate(device: ocl.Device, photons: int) -> tuple[float, float]:
    medium, _ = skin_medium(Tissue(), _WAVELENGTHS_NM)
    tally = path_table.Tally()
    start = time.perf_counter()
    path_table.walk_only(medium, photons, device, tally)
    seconds = time.perf_counter() - start
    return tally.events / seconds, tally.photons / seconds


def _peak_flops(device: ocl.Device) -> float:
    kernel = ocl.kernel(
        device, "peak", ocl.source("common/lanes", "measure/peak"), {"W": device.lanes, "CHAINS": _CHAINS}
    )
    out = ocl.buffer(device, np.zeros(_PEAK_ITEMS, "f4"))
    start = time.perf_counter()
    ocl.launch(device, kernel, (_PEAK_ITEMS,), out, np.uint32(_PEAK_ROUNDS))
    return 2.0 * device.lanes * _CHAINS * _PEAK_ROUNDS * _PEAK_ITEMS / (time.perf_counter() - start)


def bakes(device: str | None, progress: Progress = lambda stage, tally: None) -> dict:
    """Time by stage and error of a bake of each quality, as its own process with a warm kernel cache."""
    results = {}
    with tempfile.TemporaryDirectory() as folder:
        for quality in ("draft", "draft", "standard", "reference"):  # the first one warms the kernel cache
            progress(f"bake, {quality}", None)
            out = Path(folder) / f"{quality}-{len(list(Path(folder).iterdir()))}"
            command = [sys.executable, "-m", "lutgen.cli", "bake", "--quality", quality, "--out", str(out), "--json"]
            done = subprocess.run(command + (["--device", device] if device else []), capture_output=True, text=True)
            if done.returncode:
                raise MachineError(f"bake of quality {quality} failed: {done.stderr.strip().removeprefix('lutgen: ')}")
            result = json.loads(done.stdout)
            results[quality] = {"seconds": result["seconds"], "error": result["error"]}
    return results


def expansion() -> float:
    """Median seconds to re-expand the default set, color and profiles, to another oxygenation."""
    luts = lutgen.load()
    luts.expand(oxygenation=0.6)
    seconds = []
    for oxygenation in np.linspace(0.3, 0.9, 21):
        start = time.perf_counter()
        luts.expand(oxygenation=float(oxygenation))
        seconds.append(time.perf_counter() - start)
    return float(np.median(seconds))
