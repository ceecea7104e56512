"""For three.js and plain WebGL2: the color LUT as a 3-D KTX2, the profiles as a 2-D one, GLSL, and a page that runs."""

from __future__ import annotations

import base64
import io
import json
import zlib
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path

import numpy as np
from PIL import Image

from lutgen.color import encode_srgb
from lutgen.exports import lookup
from lutgen.exports.ktx2 import UNSPECIFIED, ktx2
from lutgen.exports.resampled import MADE, MEANING, Report, Source
from lutgen.files import texture_maps
from lutgen.head import builtin, paint
from lutgen.tables import shader_axes

COLOR, PROFILE, CHUNK, PAGE = "skin_color.ktx2", "skin_profile.ktx2", "skin.glsl", "skin.html"
_PRECISION = "precision highp float;\nprecision highp int;\nprecision highp sampler2D;\nprecision highp sampler3D;\n"
"""OpenGL ES has no default for a 3-D sampler."""
SHADERS = (
    "head.vert",
    "head.frag",
    "shadow.vert",
    "shadow.frag",
    "screen.vert",
    "row.frag",
    "gather.frag",
    "finish.frag",
)
"""Of the page."""
_JPEG = {"format": "JPEG", "quality": 85, "subsampling": 0}


def write(source: Source, folder: Path) -> Report:
    """Write both textures, the GLSL and the page into a folder."""
    color = _color(source)
    table = lookup.profile_texels(source)
    profile = table.astype("f2")
    formulas = shader_axes.formulas(source.grid)
    notes = {"KTXwriter": f"lutgen {version('lutgen')}", "lutgen.axes": json.dumps(formulas)}
    written = {
        COLOR: ktx2(color, notes | {"lutgen.space": "linear Rec. 709; x melanin, y eumelanin, z hemoglobin"}),
        PROFILE: ktx2(
            profile, notes | {"lutgen.columns": "radius mm, encircled energy R, G, B; row = node"}, UNSPECIFIED
        ),
        CHUNK: (_PRECISION + lookup.text(source, "glsl")).encode(),
    }
    for name, content in written.items():
        (folder / name).write_bytes(content)
    (folder / PAGE).write_text(page(source, written), encoding="utf-8")

    error, error_line = lookup.half_error(source, color[..., :3], table)
    N_h, N_e, N_m = source.grid.shape
    counts = source.luts.profile_lut.grid.shape[::-1]
    axes = "; ".join(formula.removeprefix("t = ") for formula in formulas.values())
    return Report((
        f"{COLOR}: 3-D, {N_m} x {N_e} x {N_h}, RGBA half. {PROFILE}: 2-D. {CHUNK}: GLSL that reads both.",
        f"{PAGE}: all of it in one page, with sliders, in plain WebGL2; open it from the disk, it needs no network.",
        "three.js: new KTX2Loader().detectSupport(renderer).loadAsync(...); LinearFilter, clamped.",
        f"Color: linear Rec. 709, unclipped; x melanin, y eumelanin, z hemoglobin: u = {shader_axes.texel('t', 'N')},",
        f"t = {axes}.",
        f"Profile: column k: quantile (k + 0.5) / {lookup.QUANTILES}; row: node of {' x '.join(map(str, counts))}; "
        "radius mm, encircled energy.",
        *MEANING,
        error_line,
        MADE,
    ), error)  # fmt: skip


def _color(source: Source) -> np.ndarray:
    """The texture [N_h, N_e, N_m, 4] in half floats; alpha is 1."""
    own = source.own_colors("srgb")
    return np.concatenate([own, np.ones((*own.shape[:3], 1))], axis=-1).astype("f2")


def page(source: Source, written: dict[str, bytes]) -> str:
    """The page as HTML, everything inside: shaders, textures as they were written, and the built-in head."""
    template = files("lutgen.exports").joinpath("templates")
    shape = builtin.builtin()
    painted = paint.paint(shape)
    arrays, facts = _mesh(shape, painted["surface"][..., 2])
    packed = {COLOR: written[COLOR], PROFILE: written[PROFILE], **arrays}
    constants = (
        f"const float INDEX = {source.refractive_index:.9g}, ENTRY = {source.entry:.9g}, F0 = 1.0 - ENTRY;\n"
        f"const int QUANTILES = {lookup.QUANTILES};"
    )
    data = {
        "packed": {name: _text(zlib.compress(content, 9)) for name, content in packed.items()},
        "pictures": {"pigments": _text(_pigments(painted)), "bumps": _text(_jpeg(painted["normal"][::2, ::2, :3]))},
        "mesh": facts, "quantiles": lookup.QUANTILES,
        "presets": {preset.name: preset.skin for preset in source.presets},
        "swatches": {preset.name: _eight_bit(preset.linear_srgb) for preset in source.presets},
        "shaders": {name: template.joinpath(f"{name}.glsl").read_text(encoding="utf-8") for name in SHADERS},
        "chunk": written[CHUNK].decode() + f"\n{constants}\n",
    }  # fmt: skip
    text = template.joinpath("page.html").read_text(encoding="utf-8")
    script = "\n".join(template.joinpath(name).read_text(encoding="utf-8") for name in ("gl.js", "page.js"))
    safe = json.dumps(data).replace("</", "<\\/")  # else a text in it could end the script element
    script = script.replace('"AXES"', shader_axes.javascript(source.grid)).replace('"DATA"', safe)
    return text.replace("/*SCRIPT*/", script)


def _eight_bit(linear_srgb: np.ndarray) -> list[int]:
    return np.round(255 * encode_srgb(np.clip(linear_srgb, 0, 1))).astype(int).tolist()


def _mesh(shape, open_sky: np.ndarray) -> tuple[dict[str, bytes], dict]:
    """The head's arrays, one number after the other and as differences, which pack to a third; how to undo that.

    `open_sky` [rows, columns] is the map that each vertex takes its share of the sky from.
    """
    p, n = np.asarray(shape.positions_mm, float), np.asarray(shape.normals, float)
    low, span = p.min(axis=0), np.ptp(p, axis=0)
    positions = np.round((p - low) / span * 65535).astype("u2")
    corners = np.round(np.asarray(shape.uv, float) * 65535).astype("u2")
    facing = np.round(n * 127).astype("i1")
    u, v = np.minimum((shape.uv * open_sky.shape).astype(int).T, open_sky.shape[0] - 1)
    sky = np.round(255 * np.clip(open_sky[v, u].astype(float), 0, 1)).astype("u1")
    index = shape.triangles.astype("u2").ravel()  # the head has fewer than 65,536 vertices
    order = {"positions": positions, "corners": corners, "facing": facing, "sky": sky[:, None], "index": index[:, None]}
    arrays = {name: np.diff(values, axis=0, prepend=values.dtype.type(0)).T.tobytes() for name, values in order.items()}
    return arrays, {"vertices": len(p), "corners": len(index), "low": low.tolist(), "span": span.tolist()}


def _pigments(painted: dict) -> bytes:
    """Ratios of melanin and hemoglobin as maps hold them, and half the ratio of roughness, in one picture."""
    ratios, surface = (painted[name][::2, ::2].astype(float) for name in ("chromophores", "surface"))
    rough = np.round(np.clip(surface[..., 0] / texture_maps.SURFACE_RANGE, 0, 1) * 255).astype("u1")
    return _jpeg(
        np.stack([texture_maps.encode_ratio(ratios[..., 0]), texture_maps.encode_ratio(ratios[..., 2]), rough], axis=-1)
    )


def _jpeg(picture: np.ndarray) -> bytes:
    out = io.BytesIO()
    Image.fromarray(picture).save(out, **_JPEG)
    return out.getvalue()


def _text(content: bytes) -> str:
    return base64.b64encode(content).decode()
