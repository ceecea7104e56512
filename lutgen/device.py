"""The only module that imports pyopencl: finds a device, splices and builds kernels, shares structs with them."""

from __future__ import annotations

import atexit
import os
import shutil
import site
import sys
import tempfile
import warnings
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from types import ModuleType

import numpy as np

from lutgen.errors import InputError, MachineError, shown

INSTALL_HINT = (
    'install a CPU runtime with `pip install "lutgen[cpu]"` (x86-64 Linux), Debian\'s `pocl-opencl-icd`, '
    "or your GPU vendor's OpenCL driver"
)
LANES = (1, 4, 8, 16)
"""Widths that kernels are built for."""
_BUILD_OPTIONS = ["-cl-mad-enable"]  # not -cl-fast-relaxed-math: its Newton steps are slower than the divider


@dataclass(frozen=True)
class Device:
    """An OpenCL device with its queue; `lanes` is the vector width W that kernels are built for (1 on a GPU)."""

    name: str
    platform: str
    kind: str
    lanes: int
    context: object
    queue: object


def _register_pip_runtime() -> None:
    """Let the loader find Intel's CPU runtime from pip, which registers itself nowhere: preload it, point to it."""
    if "OCL_ICD_FILENAMES" in os.environ or "OCL_ICD_VENDORS" in os.environ:
        return
    driver = next((path for path in _pip_drivers() if path.exists()), None)
    if driver is None:
        return
    import ctypes

    try:
        for name in ("libintlc.so.5", "libimf.so", "libirng.so", "libsvml.so", "libtbb.so.12"):
            ctypes.CDLL(str(driver.parent / name), mode=ctypes.RTLD_GLOBAL)
        vendors = Path(tempfile.mkdtemp(prefix="lutgen-icd-"))
        atexit.register(shutil.rmtree, vendors, ignore_errors=True)
        for source in Path("/etc/OpenCL/vendors").glob("*.icd"):
            (vendors / source.name).write_text(source.read_text())
        (vendors / "intel-cpu-pip.icd").write_text(f"{driver}\n")
    except OSError:
        return
    os.environ["OCL_ICD_VENDORS"] = str(vendors)


def _pip_drivers() -> list[Path]:
    """Where pip puts Intel's driver: the environment's lib folder, or the user's."""
    return [Path(root) / "lib" / "libintelocl.so" for root in (sys.prefix, site.getuserbase())]


@cache
def _opencl() -> ModuleType:
    _register_pip_runtime()
    try:
        import pyopencl
    except ImportError as error:
        raise MachineError(f"pyopencl does not load ({error}); {INSTALL_HINT}") from error
    return pyopencl


def _lanes(cl: ModuleType, device) -> int:
    """What a CPU's vector unit holds (16 with AVX-512, 8 with AVX2), or LUTGEN_LANES; 1 on a GPU."""
    if not device.type & cl.device_type.CPU:
        return 1
    asked = os.environ.get("LUTGEN_LANES", "")
    if not asked:
        return max(width for width in LANES if width <= max(device.native_vector_width_float, 4))
    if asked not in map(str, LANES):
        raise InputError(f"LUTGEN_LANES = {shown(asked)}: allowed is {', '.join(map(str, LANES))}, or unset")
    return int(asked)


@cache
def devices() -> tuple[Device, ...]:
    """Every OpenCL device, best first: GPUs, then PoCL, then other CPU runtimes; empty where there is none."""
    cl = _opencl()
    opencl_devices = []
    with suppress(cl.Error):
        for platform in cl.get_platforms():
            with suppress(cl.Error):  # one broken driver must not hide the others
                opencl_devices += platform.get_devices()
    kinds = {cl.device_type.GPU: "gpu", cl.device_type.CPU: "cpu"}
    ranked = []
    for device in opencl_devices:
        kind = next((name for flag, name in kinds.items() if device.type & flag), "other")
        rank = 0 if kind == "gpu" else 1 if "Portable" in device.platform.name else 2
        ranked.append((rank, len(ranked), device, kind))
    return tuple(
        Device(d.name.strip(), d.platform.name.strip(), kind, _lanes(cl, d), d, None)
        for _, _, d, kind in sorted(ranked)
    )


def choose(name: str | int | None = None) -> Device:
    """Open the device whose index or part of name or platform is given, else LUTGEN_DEVICE's, else the best.

    Raises MachineError where there is no OpenCL, InputError where nothing matches.
    """
    source = "device" if name not in (None, "") else "LUTGEN_DEVICE"
    wanted = str(name) if source == "device" else os.environ.get("LUTGEN_DEVICE", "")
    available = devices()
    if not available:
        raise MachineError(f"no OpenCL device; {INSTALL_HINT}")
    if wanted.isdigit():
        matches = available[int(wanted) : int(wanted) + 1]
    else:
        matches = [d for d in available if wanted.lower() in f"{d.platform} {d.name}".lower()]
    if not matches:
        listed = ", ".join(f"{i} ({d.platform}: {d.name})" for i, d in enumerate(available))
        raise InputError(f"{source} = {wanted!r}: no device matches; allowed is an index or part of a name of {listed}")
    return _open(matches[0])


@cache
def _open(device: Device) -> Device:
    cl = _opencl()
    with _reported(device):
        context = cl.Context([device.context])
        return replace(device, context=context, queue=cl.CommandQueue(context))


@contextmanager
def _reported(device: Device):
    """OpenCL's own errors (out of memory, a lost device) as MachineErrors of one line."""
    cl = _opencl()
    try:
        yield
    except cl.Error as error:
        raise MachineError(f"device {device.name}: {str(error).strip().splitlines()[0]}") from error


def source(*names: str) -> str:
    """The text of kernel files, one after the other (PoCL breaks on include paths with spaces)."""
    return "\n".join((files("lutgen.kernels") / f"{name}.cl").read_text() for name in names)


@cache
def struct_source(device: Device, structs: tuple[tuple[str, np.dtype], ...]) -> str:
    """C declarations of the host's record types; raises where the device lays them out differently."""
    from pyopencl.tools import match_dtype_to_c_struct

    declarations = []
    for name, dtype in structs:
        with _quiet():
            matched, declaration = match_dtype_to_c_struct(device.context.devices[0], name, dtype)  # type: ignore[attr-defined]
        if matched != dtype:
            raise MachineError(f"device {device.name}: struct {name} has another layout there; choose another device")
        declarations.append(declaration)
    return "\n".join(declarations)


@cache
def _build(device: Device, text: str, constants: tuple[tuple[str, int], ...]):
    cl = _opencl()
    options = [*_BUILD_OPTIONS, *(f"-D{key}={value}" for key, value in constants)]
    try:
        with _quiet():
            return cl.Program(device.context, text).build(options)
    except cl.Error as error:
        line = next((line for line in str(error).splitlines() if "error" in line.lower()), str(error))
        raise MachineError(f"device {device.name}: kernel does not build: {line.strip()}") from error


@contextmanager
def _quiet():
    """Compilers' remarks are no news to a user."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


@cache
def _kernel(device: Device, entry: str, text: str, constants: tuple[tuple[str, int], ...]):
    return getattr(_build(device, text, constants), entry)


def kernel(device: Device, entry: str, text: str, constants: dict[str, int]):
    """Build (once per process) and return a kernel of `text` by its name."""
    return _kernel(device, entry, text, tuple(sorted(constants.items())))


def buffer(device: Device, data: np.ndarray | int):
    """A device buffer holding a copy of an array, or of that many uninitialized bytes."""
    cl = _opencl()
    flags = cl.mem_flags
    with _reported(device):
        if isinstance(data, (int, np.integer)):
            return cl.Buffer(device.context, flags.READ_WRITE, int(data))
        return cl.Buffer(device.context, flags.READ_WRITE | flags.COPY_HOST_PTR, hostbuf=np.ascontiguousarray(data))


def clear(device: Device, target, size: int) -> None:
    """Set the first bytes of a device buffer to zero."""
    with _reported(device):
        _opencl().enqueue_fill_buffer(device.queue, target, np.zeros(1, "u1"), 0, size)


def launch(device: Device, compiled, shape: tuple[int, ...], *arguments) -> None:
    """Run a kernel over a global size and wait for it."""
    local = (1,) * len(shape) if device.kind == "cpu" else None
    with _reported(device):
        compiled(device.queue, shape, local, *arguments)
        device.queue.finish()  # type: ignore[attr-defined]


def read(device: Device, source_buffer, like: np.ndarray) -> np.ndarray:
    """Copy a device buffer into the given array and return it."""
    with _reported(device):
        _opencl().enqueue_copy(device.queue, like, source_buffer)
    return like
