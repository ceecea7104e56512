"""Reflectance spectrum -> XYZ -> linear RGB, Lab and the CIEDE2000 difference; NumPy only.

Two pipelines turn a spectrum into XYZ under D65. `default`: CIE 1931 2 degree functions under the D65 spectrum.
`source`: that of Zhang, Human face rendering: CIE 2015 2 degree functions under equal energy, XYZ scaled to the D65
white (0.9505, 1, 1.089) and that document's four-digit matrix (lutgen/README.md, Color). LUTs hold ACEScg (AP1
primaries, ACES white, CAT02).
"""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import numpy as np

from lutgen.errors import InputError, one_of

PIPELINES = ("default", "source")
SPACES = ("srgb", "acescg", "xyz")
WHITE_D65 = np.array([0.3127, 0.3290])
_WHITE_ACES = np.array([0.32168, 0.33767])
_PRIMARIES_SRGB = np.array([[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]])
_PRIMARIES_AP1 = np.array([[0.713, 0.293], [0.165, 0.830], [0.128, 0.044]])
_CAT02 = np.array([[0.7328, 0.4296, -0.1624], [-0.7036, 1.6975, 0.0061], [0.0030, 0.0136, 0.9834]])
_SOURCE_WHITE = np.array([0.9505, 1.0, 1.089])
_SOURCE_SRGB_FROM_XYZ = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])


def _white_xyz(xy: np.ndarray) -> np.ndarray:
    return np.array([xy[0], xy[1], 1 - xy.sum()]) / xy[1]


def _rgb_from_xyz(primaries: np.ndarray, white: np.ndarray) -> np.ndarray:
    columns = np.column_stack([_white_xyz(p) for p in primaries])
    return np.linalg.inv(columns * np.linalg.solve(columns, _white_xyz(white)))


def _adapt(source: np.ndarray, target: np.ndarray) -> np.ndarray:
    gain = (_CAT02 @ _white_xyz(target)) / (_CAT02 @ _white_xyz(source))
    return np.linalg.inv(_CAT02) @ (gain[:, None] * _CAT02)


SRGB_FROM_XYZ = _rgb_from_xyz(_PRIMARIES_SRGB, WHITE_D65)
ACESCG_FROM_XYZ = _rgb_from_xyz(_PRIMARIES_AP1, _WHITE_ACES) @ _adapt(WHITE_D65, _WHITE_ACES)
"""Linear ACEScg from XYZ under D65: CAT02 to the ACES white, then AP1 primaries."""
XYZ_FROM_SRGB, XYZ_FROM_ACESCG = np.linalg.inv(SRGB_FROM_XYZ), np.linalg.inv(ACESCG_FROM_XYZ)
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Y of linear sRGB as displays and tone curves take it (ITU-R BT.709), to four digits."""


@cache
def tables() -> dict[str, np.ndarray]:
    """CIE functions and D65 every 5 nm from 380 to 780 nm, by column name.

    >>> tables()["wavelength_nm"].shape
    (81,)
    """
    lines = (files("lutgen") / "color_tables.csv").read_text().splitlines()[1:]
    values = np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]]).T
    return dict(zip(lines[0].split(","), values, strict=True))


def xyz_weights(step_nm: int = 5, pipeline: str = "default") -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths in nm [n] of a regular grid (5 or 10 nm) and the XYZ weight of each [n, 3].

    XYZ under D65 of a reflectance spectrum is `reflectance @ weights`; Y of a perfect reflector is 1.

    >>> nm, weights = xyz_weights(10)
    >>> nm.shape, [round(float(v), 4) for v in weights.sum(axis=0)]
    ((41,), [0.9502, 1.0, 1.0881])
    """
    one_of("pipeline", pipeline, PIPELINES)
    if step_nm not in (5, 10):
        raise InputError(f"step_nm = {step_nm!r}: allowed is 5 or 10")
    table = tables()
    pick = slice(None, None, step_nm // 5)
    observer = "cie_1931" if pipeline == "default" else "cie_2015"
    weights = np.column_stack([table[f"{observer}_{axis}"][pick] for axis in "xyz"])
    if pipeline == "default":
        weights = weights * table["d65"][pick, None]
        return table["wavelength_nm"][pick], weights / weights[:, 1].sum()
    return table["wavelength_nm"][pick], weights / weights.sum(axis=0) * _SOURCE_WHITE


def spectrum_to_xyz(reflectance, pipeline: str = "default") -> np.ndarray:
    """XYZ [..., 3] under D65 of reflectance [..., 81] every 5 nm from 380 nm, or [..., 41] every 10 nm.

    >>> [round(float(v), 4) for v in spectrum_to_xyz(np.ones(81))]
    [0.9504, 1.0, 1.0888]
    """
    reflectance = np.asarray(reflectance, float)
    steps = {81: 5, 41: 10}
    if reflectance.shape[-1] not in steps:
        raise InputError(f"reflectance has {reflectance.shape[-1]} wavelengths: allowed is 81 (5 nm) or 41 (10 nm)")
    return reflectance @ xyz_weights(steps[reflectance.shape[-1]], pipeline)[1]


def from_xyz(xyz, space: str, pipeline: str = "default") -> np.ndarray:
    """Linear, unclipped values [..., 3] in `srgb`, `acescg` or `xyz` of XYZ [..., 3] under D65.

    >>> [round(float(v), 3) for v in from_xyz([0.9505, 1.0, 1.089], "srgb")]
    [1.0, 1.0, 1.0]
    """
    return np.asarray(xyz, float) @ _matrix(space, pipeline).T


def to_xyz(linear_srgb) -> np.ndarray:
    """XYZ [..., 3] under D65 of linear sRGB [..., 3].

    >>> [round(float(v), 4) for v in to_xyz([1, 1, 1])]
    [0.9505, 1.0, 1.0891]
    """
    return np.asarray(linear_srgb, float) @ XYZ_FROM_SRGB.T


def to_acescg(linear_srgb) -> np.ndarray:
    """Linear ACEScg [..., 3] of linear sRGB [..., 3].

    >>> [round(float(v), 3) for v in to_acescg([1, 0, 0])]
    [0.613, 0.07, 0.02]
    """
    return from_xyz(to_xyz(linear_srgb), "acescg")


def from_acescg(acescg, space: str, pipeline: str = "default") -> np.ndarray:
    """Linear, unclipped values [..., 3] in `srgb`, `acescg` or `xyz` of ACEScg values [..., 3].

    >>> [round(float(v), 3) for v in from_acescg([0.5, 0.5, 0.5], "srgb")]
    [0.5, 0.5, 0.5]
    """
    if space == "acescg":
        return np.asarray(acescg, float)
    return np.asarray(acescg, float) @ (_matrix(space, pipeline) @ XYZ_FROM_ACESCG).T


def _matrix(space: str, pipeline: str) -> np.ndarray:
    srgb = SRGB_FROM_XYZ if one_of("pipeline", pipeline, PIPELINES) == "default" else _SOURCE_SRGB_FROM_XYZ
    return {"srgb": srgb, "acescg": ACESCG_FROM_XYZ, "xyz": np.eye(3)}[one_of("space", space, SPACES)]


def encode_srgb(linear) -> np.ndarray:
    """Display-encoded sRGB in 0 to 1 of linear sRGB, clipped first, in single precision where it is (IEC 61966-2-1).

    >>> round(float(encode_srgb(0.18)), 4)
    0.4614
    """
    linear = np.clip(_floats(linear), 0, 1)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def decode_srgb(encoded) -> np.ndarray:
    """Linear sRGB of display-encoded values of 0 or more, in single precision where they are (IEC 61966-2-1).

    >>> round(float(decode_srgb(0.4614)), 3)
    0.18
    """
    encoded = _floats(encoded)
    return np.where(encoded <= 0.04045, encoded / 12.92, (np.maximum(encoded + 0.055, 0) / 1.055) ** 2.4)


def _floats(values) -> np.ndarray:
    values = np.asarray(values)
    return values if values.dtype == np.float32 else values.astype(float)


def hex_code(linear_srgb) -> str:
    """The #rrggbb code of one linear sRGB color [3].

    >>> hex_code([1, 0.5, 0])
    '#ffbc00'
    """
    return "#" + "".join(f"{round(float(value) * 255):02x}" for value in encode_srgb(linear_srgb))


def lab(xyz) -> np.ndarray:
    """CIE L*a*b* [..., 3] of XYZ [..., 3] under the D65 white.

    >>> [round(float(v), 2) for v in lab([0.3, 0.3, 0.2])]
    [61.65, 5.72, 20.21]
    """
    ratio = np.asarray(xyz, float) / _white_xyz(WHITE_D65)
    delta = 6 / 29
    f = np.where(ratio > delta**3, np.cbrt(ratio), ratio / (3 * delta**2) + 4 / 29)
    return np.stack([116 * f[..., 1] - 16, 500 * (f[..., 0] - f[..., 1]), 200 * (f[..., 1] - f[..., 2])], axis=-1)


def from_lab(lab_) -> np.ndarray:
    """XYZ [..., 3] under the D65 white of CIE L*a*b* [..., 3].

    >>> from_lab(lab([0.3, 0.3, 0.2])).round(6).tolist()
    [0.3, 0.3, 0.2]
    """
    L, a, b = np.moveaxis(np.asarray(lab_, float), -1, 0)
    f = ((L + 16) / 116)[..., None] + np.stack([a / 500, np.zeros_like(a), -b / 200], axis=-1)
    delta = 6 / 29
    return np.where(f > delta, f**3, 3 * delta**2 * (f - 4 / 29)) * _white_xyz(WHITE_D65)


def delta_e00(lab_1, lab_2) -> np.ndarray:
    """CIEDE2000 color difference [...] of two L*a*b* arrays [..., 3] (Sharma, Wu & Dalal 2005).

    >>> round(float(delta_e00([50, 2.6772, -79.7751], [50, 0, -82.7485])), 4)
    2.0425
    """
    single = all(
        getattr(lab, "dtype", None) == np.float32 for lab in (lab_1, lab_2)
    )  # stays so: 1e-5 off, twice as fast
    l1, a1, b1 = np.moveaxis(np.asarray(lab_1, "f4" if single else "f8"), -1, 0)
    l2, a2, b2 = np.moveaxis(np.asarray(lab_2, "f4" if single else "f8"), -1, 0)
    mean_chroma7 = ((np.hypot(a1, b1) + np.hypot(a2, b2)) / 2) ** 7
    stretch = 1.5 - 0.5 * np.sqrt(mean_chroma7 / (mean_chroma7 + 25.0**7))
    a1, a2 = a1 * stretch, a2 * stretch
    c1, c2 = np.hypot(a1, b1), np.hypot(a2, b2)
    h1, h2 = np.degrees(np.arctan2(b1, a1)) % 360, np.degrees(np.arctan2(b2, a2)) % 360
    gray = c1 * c2 == 0
    turn = (h2 - h1 + 180) % 360 - 180
    turn = np.where(np.abs(h2 - h1) == 180, h2 - h1, turn)
    dh = 2 * np.sqrt(c1 * c2) * np.sin(np.radians(np.where(gray, turn * 0, turn)) / 2)
    apart = np.abs(h1 - h2) > 180
    mean_h = np.where(apart, (h1 + h2 + np.where(h1 + h2 < 360, 360, -360)) / 2, (h1 + h2) / 2)
    mean_h = np.where(gray, h1 + h2, mean_h)
    mean_l, mean_c = (l1 + l2) / 2, (c1 + c2) / 2
    weight = (
        1
        - 0.17 * np.cos(np.radians(mean_h - 30))
        + 0.24 * np.cos(np.radians(2 * mean_h))
        + 0.32 * np.cos(np.radians(3 * mean_h + 6))
        - 0.20 * np.cos(np.radians(4 * mean_h - 63))
    )
    s_l = 1 + 0.015 * (mean_l - 50) ** 2 / np.sqrt(20 + (mean_l - 50) ** 2)
    s_c, s_h = 1 + 0.045 * mean_c, 1 + 0.015 * mean_c * weight
    rotation = (
        -2 * np.sqrt(mean_c**7 / (mean_c**7 + 25.0**7)) * np.sin(np.radians(60 * np.exp(-(((mean_h - 275) / 25) ** 2))))
    )
    terms = (l2 - l1) / s_l, (c2 - c1) / s_c, dh / s_h
    return np.sqrt(np.maximum(sum(t**2 for t in terms) + rotation * terms[1] * terms[2], 0))


def metric(lab_) -> np.ndarray:
    """Matrix [3, 3] that takes small L*a*b* differences from one color [3] to vectors as long as their CIEDE2000.

    >>> float(np.linalg.norm(metric([60, 12, 17]) @ [0.1, 0.2, -0.1]).round(2))
    0.23
    >>> float(delta_e00([60, 12, 17], [60.1, 12.2, 16.9]).round(2))
    0.23
    """
    lab_, step = np.asarray(lab_, float), 1e-3 * np.eye(3) / 2
    plus, minus = (delta_e00(lab_ + step[:, None] + sign * step, lab_) ** 2 for sign in (1, -1))
    return np.linalg.cholesky((plus - minus) / 1e-6).T
