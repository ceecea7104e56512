"""What the kernels' own functions give: a small kernel around them, one value per lane."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lutgen import device as ocl

WIDTHS = (1, 4, 8, 16)


def wide(lanes: int) -> ocl.Device:
    """The best device, with kernels built for that many lanes."""
    return replace(ocl.choose(), lanes=lanes)


def evaluate(expression: str, *inputs: np.ndarray, lanes: int = 16, outputs: int = 1, **constants: float) -> np.ndarray:
    """Values [outputs, N] that statements assign to `out[i]` from inputs `a`, `b`, … (vf), N a multiple of 16."""
    device, count = wide(lanes), len(inputs[0])
    names = "abcdefgh"[: len(inputs)]
    parameters = ", ".join(f"__global const float *in_{name}" for name in names)
    loads = "".join(f"vf {name} = LOAD(in_{name} + i * W);\n" for name in names)
    stores = "".join(f"STORE(out[{k}], result + {k} * {count} + i * W);\n" for k in range(outputs))
    text = ocl.source("common/lanes", "common/rng", "common/optics", "common/step") + (
        "inline vu mix_lanes(vu x) { x ^= x >> 16; x *= 0x7feb352du; x ^= x >> 15; x *= 0x846ca68bu; "
        "return x ^ (x >> 16); }\n"
        f"__kernel void probe({parameters}, __global float *result) {{\n"
        f"const uint i = get_global_id(0);\nvf out[{outputs}];\n{loads}{expression}\n{stores}}}\n"
    )
    for name, value in constants.items():
        text = text.replace(
            f"${name}", f"{value:.9g}f" if "." in f"{value:.9g}" or "e" in f"{value:.9g}" else f"{value:.9g}.0f"
        )
    result = ocl.buffer(device, np.zeros((outputs, count), "f4"))
    buffers = [ocl.buffer(device, np.asarray(v, "f4")) for v in inputs]
    ocl.launch(device, ocl.kernel(device, "probe", text, {"W": lanes}), (count // lanes,), *buffers, result)
    return ocl.read(device, result, np.zeros((outputs, count), "f4"))


def draws(seed: int, wavelength: int, block: int, count: int, lanes: int = 16) -> tuple[np.ndarray, np.ndarray]:
    """Initial states [4, lanes] and the first `count` raw draws [count, lanes] of a block's streams."""
    device = wide(lanes)
    text = ocl.source("common/lanes", "common/rng") + (
        "__kernel void draw(uint seed, uint wavelength, uint block, uint count, __global uint *start, "
        "__global uint *out) {\nrng_t s = start_streams(seed, wavelength, block);\n"
        "STORE(s.x, start); STORE(s.y, start + W); STORE(s.z, start + 2 * W); STORE(s.w, start + 3 * W);\n"
        "for (uint i = 0; i < count; i++) STORE(next_bits(&s), out + i * W);\n}\n"
    )
    start, out = ocl.buffer(device, 16 * lanes), ocl.buffer(device, 4 * count * lanes)
    kernel = ocl.kernel(device, "draw", text, {"W": lanes})
    ocl.launch(device, kernel, (1,), *(np.uint32(v) for v in (seed, wavelength, block, count)), start, out)
    return ocl.read(device, start, np.zeros((4, lanes), "u4")), ocl.read(device, out, np.zeros((count, lanes), "u4"))
