"""The surface's optics: one text in OpenCL and in GLSL, against NumPy in double precision."""

import importlib

import numpy as np
import pytest

from lutgen import device as ocl
from lutgen.scene import surface
from lutgen.skin.tissue import specular

gl = importlib.import_module("lutgen.viewer.gl")
COUNT = 4096
SMALL = 32 * np.finfo("f4").eps
"""Relative: some twenty float operations, none of which cancels but those below."""
EXPRESSIONS = {
    "fresnel": "fresnel(nv)", "entry": "entry_factor(nv)", "recovery": "recovery(F0, energy)",
    "share": "lobe_share(energy)", "exit": "exit_factor(energy, rough)", "ggx": "ggx(n, v, l, rough)",
    "lobes": "specular_lobes(n, v, l, rough, rough2, energy, energy2)",
}  # fmt: skip
OPENCL = """
__kernel void values(__global const float4 *inputs, __global float *out) {
    const int i = get_global_id(0);
    const float4 a = inputs[3 * i], b = inputs[3 * i + 1], c = inputs[3 * i + 2];
    const float nv = a.x, rough = a.y, rough2 = rough * SECOND_LOBE;
    const float2 energy = b.xy, energy2 = b.zw;
    const float3 n = (float3)(0.0f, 0.0f, 1.0f), v = (float3)(sqrt(1.0f - nv * nv), 0.0f, nv), l = c.xyz;
    out[i] = VALUE;
}
"""
GLSL = """#version 330
SURFACE
uniform sampler2D inputs;
out vec4 pixel;
void main() {
    int i = int(gl_FragCoord.x);
    vec4 a = texelFetch(inputs, ivec2(0, i), 0), b = texelFetch(inputs, ivec2(1, i), 0);
    vec4 c = texelFetch(inputs, ivec2(2, i), 0);
    float nv = a.x, rough = a.y, rough2 = rough * SECOND_LOBE;
    vec2 energy = b.xy, energy2 = b.zw;
    vec3 n = vec3(0.0, 0.0, 1.0), v = vec3(sqrt(1.0 - nv * nv), 0.0, nv), l = c.xyz;
    pixel = vec4(VALUE);
}
"""


@pytest.fixture(scope="module")
def samples() -> np.ndarray:
    """Cosine of the view, roughness; energies of both lobes; direction of the light [N, 3, 4] in float."""
    rng = np.random.default_rng(11)
    light = rng.standard_normal((COUNT, 3))
    light /= np.linalg.norm(light, axis=1, keepdims=True)
    light[:, 2] = np.abs(light[:, 2])
    whole, second = rng.uniform(0.3, 1, (2, COUNT))
    columns = (
        rng.uniform(0.01, 1, COUNT), rng.uniform(0.15, 1, COUNT), *np.zeros((2, COUNT)), whole,
        whole * rng.uniform(0, 0.4, COUNT), second, second * rng.uniform(0, 0.4, COUNT), *light.T, np.zeros(COUNT),
    )  # fmt: skip
    return np.stack(columns, axis=1).reshape(COUNT, 3, 4).astype("f4")


def expected(samples: np.ndarray, n: float) -> dict[str, np.ndarray]:
    """The same values in double precision."""
    first, energies, light = np.moveaxis(samples.astype(float), 1, 0)
    nv, rough = first[:, 0], first[:, 1]
    energy, energy2, light = energies[:, :2], energies[:, 2:], light[:, :3]
    view = np.stack([np.sqrt(1 - nv**2), 0 * nv, nv], axis=1)
    half = view + light
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    f0, means = specular(n), surface.exit_means(n)

    def recovery(e: np.ndarray) -> np.ndarray:
        return 1 + f0 * (1 / e[:, 0] - 1)

    def ggx(roughness: np.ndarray) -> np.ndarray:
        """Trowbridge-Reitz by its tangent, masking by Smith's Lambda."""
        alpha, cosine, nl = roughness**2, half[:, 2], light[:, 2]
        density = alpha**2 / (np.pi * cosine**4 * (alpha**2 + 1 / cosine**2 - 1) ** 2)
        masking = 1 / (1 + surface._smith(nv, alpha) + surface._smith(nl, alpha))
        return density * masking / (4 * nv)

    second = ggx(surface.SECOND_LOBE * rough) * recovery(energy2)
    both = (1 - surface.SECOND_WEIGHT) * ggx(rough) * recovery(energy) + surface.SECOND_WEIGHT * second
    return {
        "fresnel": surface.fresnel(nv, n), "entry": surface.entry_factor(nv, n), "recovery": recovery(energy),
        "share": surface.lobe_share(energy, n),
        "exit": (1 - surface.lobe_share(energy, n)) / np.interp(rough, np.linspace(0, 1, len(means)), means),
        "ggx": ggx(rough), "lobes": surface.fresnel((view * half).sum(axis=1), n) * both,
    }  # fmt: skip


def by_opencl(expression: str, samples: np.ndarray, n: float) -> np.ndarray:
    device = ocl.choose()
    compiled = ocl.kernel(device, "values", surface.opencl(n) + OPENCL.replace("VALUE", expression), {})
    values = np.zeros(len(samples), "f4")
    out = ocl.buffer(device, values)
    ocl.launch(device, compiled, (len(samples),), ocl.buffer(device, samples), out)
    return ocl.read(device, out, values)


def by_glsl(expression: str, samples: np.ndarray, n: float) -> np.ndarray:
    context = gl.context()
    text = GLSL.replace("SURFACE", surface.glsl(n)).replace("VALUE", expression)
    program = context.program(vertex_shader=gl.splice("screen.vert.glsl"), fragment_shader=text)
    corners = context.buffer(np.array([-1, -1, 3, -1, -1, 3], "f4").tobytes())
    array = context.vertex_array(program, [(corners, "2f", "corner")])
    inputs, out = gl.texture((3, len(samples)), 4, "f4", samples.tobytes()), gl.texture((len(samples), 1), 4, "f4")
    target = context.framebuffer([out])
    target.use()
    gl.bind(program, inputs=inputs)
    array.render()
    values = gl.read(target)[0, :, 0].copy()
    gl.free(target, out, inputs, array, corners, program)
    return values


@pytest.mark.parametrize("n", [1.33, 1.4, 1.5])
@pytest.mark.parametrize("by", [by_opencl, by_glsl])
@pytest.mark.parametrize("name", EXPRESSIONS)
def test_either_language_has_the_surface_of_numpy(samples, name, by, n):
    """To float rounding: a lobe divides by d^2, d = 1 - (n.h)^2 (1 - a^2), which cancels down to a^2 at its peak.

    The shaders' masking has 1e-6 in its denominator, that grazing light stays finite.
    """
    exact, first, light = expected(samples, n)[name], samples[:, 0].astype(float), samples[:, 2, :3].astype(float)
    tolerance = np.full(COUNT, SMALL)
    if name in ("ggx", "lobes"):
        nv, rough = first[:, 0], first[:, 1] * (surface.SECOND_LOBE if name == "lobes" else 1)
        half = light + np.stack([np.sqrt(1 - nv**2), 0 * nv, nv], axis=1)
        cosine = half[:, 2] / np.linalg.norm(half, axis=1)
        tolerance = SMALL / (1 - cosine**2 * (1 - rough**4)) + 1e-6 / (2 * nv * light[:, 2])
    assert np.all(np.abs(by(EXPRESSIONS[name], samples, n) / exact - 1) <= tolerance)


def test_a_surface_without_a_step_of_the_index_is_none():
    """At n = 1 all enters and leaves at normal incidence; Schlick's curve still rises to 1 at grazing."""
    assert specular(1.0) == 0
    assert surface.entry_factor(np.array([1.0]), 1.0) == 1
    assert surface.fresnel(np.array([0.0]), 1.0) == 1
