"""How a shader reads the exported textures, written once in GLSL and turned into the other dialects.

`lutgen_color` fetches a 3-D texture of colors at a skin; `lutgen_ring` reads, at a quantile of the widest channel, the
radius in mm and the encircled energy of red, green and blue: the weight of a ring between two radii is the difference.
"""

from __future__ import annotations

import re
import textwrap

import numpy as np

from lutgen import color
from lutgen.exports.resampled import Source, difference
from lutgen.solvers import profiles
from lutgen.tables import expand, shader_axes

QUANTILES = 64

_COLOR = """
// Diffuse color in linear Rec. 709 of a skin; `lut` is a 3-D texture: x melanin, y eumelanin, z hemoglobin.
vec3 lutgen_color(sampler3D lut, vec3 skin) {
    return textureLod(lut, lutgen_color_coordinates(skin), 0.0).rgb;
}
"""
_RING = """
// Radius in mm (x) and encircled energy of red, green, blue (yzw) at a quantile of a skin's widest channel.
vec4 lutgen_ring(sampler2D profile, float quantile, vec3 skin) {
    vec3 count = vec3(lutgen_profile_COUNT), at = lutgen_profile_coordinates(skin) * count - 0.5;
    vec3 low = clamp(floor(at), vec3(0.0), max(count - 2.0, vec3(0.0))), along = clamp(at - low, 0.0, 1.0);
    float column = clamp(quantile * QUANTILES - 0.5, 0.0, QUANTILES - 1.0), first = min(floor(column), QUANTILES - 2.0);
    vec4 sum = vec4(0.0);
    for (int corner = 0; corner < 8; corner++) {
        vec3 step_up = vec3(float(corner & 1), float((corner >> 1) & 1), float((corner >> 2) & 1));
        vec3 node = min(low + step_up, count - 1.0), part = mix(1.0 - along, along, step_up);
        int row = int(node.x + count.x * (node.y + count.y * node.z) + 0.5);
        vec4 left = texelFetch(profile, ivec2(int(first), row), 0);
        vec4 right = texelFetch(profile, ivec2(int(first) + 1, row), 0);
        sum += part.x * part.y * part.z * mix(left, right, column - first);
    }
    return sum;
}
"""


def text(source: Source, dialect: str) -> str:
    """The functions in `glsl` (ES 3), `gdshader` or `hlsl`; `lutgen_color` reads the set's own grid."""
    color_axes, profile_axes = (
        shader_axes.grid_functions(grid, prefix, dialect)
        for grid, prefix in ((source.grid, "lutgen_color"), (source.luts.profile_lut.grid, "lutgen_profile"))
    )
    body = (_COLOR + _RING).replace("QUANTILES", f"{QUANTILES}.0")
    return f"{color_axes}\n{profile_axes}\n" + (_hlsl(body) if dialect == "hlsl" else body)


def custom_node(source: Source, name: str) -> str:
    """The code of an Unreal Custom node that does what the function lutgen_NAME does (`color` or `ring`).

    Its inputs are that function's parameters. The code is pasted into a function: macros and statements, no function.
    """
    functions = text(source, "hlsl")
    body = re.search(rf"^\w+ lutgen_{name}\([^)]*\) \{{\n(.*?)^\}}", functions, re.DOTALL | re.MULTILINE)
    assert body, name
    table = "color" if name == "color" else "profile"
    macros = [line for line in functions.splitlines() if line.startswith(f"#define lutgen_{table}_")]
    return "\n".join([*macros, textwrap.dedent(body[1])])


def _hlsl(body: str) -> str:
    """HLSL of a text in GLSL: its types, its names, textures as objects.

    A texture's sampler is named as Unreal's Custom node names that of an input.
    """
    body = re.sub(r"\b(i?)vec(\d)\b", lambda m: ("int" if m[1] else "float") + m[2], body)
    body = body.replace("mix(", "lerp(")
    body = body.replace("sampler3D lut", "Texture3D lut, SamplerState lutSampler")
    body = body.replace("sampler2D profile", "Texture2D profile")
    body = re.sub(r"textureLod\(lut, (.*), 0\.0\)", r"lut.SampleLevel(lutSampler, \1, 0.0)", body)
    body = re.sub(r"texelFetch\(profile, int2\((.*?), row\), 0\)", r"profile.Load(int3(\1, row, 0))", body)
    return re.sub(r"float(\d)\((-?[\d.]+)\)", lambda m: f"float{m[1]}({', '.join([m[2]] * int(m[1]))})", body)


def profile_texels(source: Source) -> np.ndarray:
    """The profile texture [nodes, 64, 4]: radius in mm, encircled energy R, G, B in linear Rec. 709.

    Row = node, melanin fastest, then eumelanin, then hemoglobin; column k at quantile (k + 0.5) / 64 of the widest
    channel. Rings that Rec. 709 makes negative are 0, and the rest is scaled to sum to 1.
    """
    lut = source.luts.profile_lut
    totals = source.luts.color(*lut.grid.nodes(), space="acescg")
    energy = color.from_acescg(lut.shape * totals[..., None, :], "srgb", source.luts.pipeline)
    shapes, _ = expand.normalized(energy)
    return profiles.taps(shapes.reshape(-1, *shapes.shape[3:]), lut.radius_edges_mm, profiles.even_quantiles(QUANTILES))


def half_error(source: Source, colors: np.ndarray, texels: np.ndarray) -> tuple[dict, str]:
    """What half floats add to colors [N_h, N_e, N_m, 3] of the set's own nodes and to profile texels [nodes, 64, 4], as
    values and as a line of a README."""
    error = {"color": source.color_error(source.grid, colors), "profile": difference(texels.astype("f2"), texels)}
    color_off, profile_off = (error[name]["largest"] for name in ("color", "profile"))
    line = f"color {color_off:.2g}, radius in mm or encircled energy {profile_off:.2g} at most."
    return error, f"Error it adds (half floats): {line}"
