"""Scene-linear ACEScg to what a display shows, as the viewer's last pass does it (viewer/shaders/compose.frag.glsl)."""

from __future__ import annotations

import numpy as np

from lutgen import color

_SHOULDER, _DESATURATION = 0.76, 0.15
_CENTER, _EDGE = np.array([0.030, 0.033, 0.038]), np.array([0.0045, 0.0048, 0.0060])


def shown(acescg: np.ndarray, exposure: float = 0.0) -> np.ndarray:
    """Display sRGB [..., 3] in 0 to 1 of linear ACEScg [..., 3] at an exposure in stops.

    Colors outside sRGB go toward gray, which keeps the hue of pure red light; then Khronos' PBR Neutral curve, under
    whose shoulder colors stay what they are.

    >>> shown(np.array([[0.18, 0.18, 0.18], [50.0, 0.0, 0.0]])).round(3).tolist()
    [[0.41, 0.41, 0.41], [1.0, 0.955, 0.958]]
    """
    linear = color.from_acescg(np.asarray(acescg, float) * 2.0**exposure, "srgb")
    gray, least = np.maximum(linear @ color.LUMINANCE, 0)[..., None], linear.min(axis=-1, keepdims=True)
    outside = (least < 0) & (gray > least)
    mixed = gray + (linear - gray) * (gray / np.where(outside, gray - least, 1))
    return color.encode_srgb(_neutral(np.where(outside, mixed, linear)))


def _neutral(c: np.ndarray) -> np.ndarray:
    low = c.min(axis=-1, keepdims=True)
    c = c - np.where(low < 0.08, low - 6.25 * low * low, 0.04)
    peak, room = c.max(axis=-1, keepdims=True), 1 - _SHOULDER
    above = peak >= _SHOULDER
    top = np.where(above, 1 - room * room / np.where(above, peak + room - _SHOULDER, 1), 0)
    squeezed = c * top / np.where(above, peak, 1)
    gray = 1 - 1 / (_DESATURATION * (peak - top) + 1)
    return np.where(above, squeezed + (top - squeezed) * gray, c)


def backdrop(rows: int, columns: int) -> np.ndarray:
    """What the viewer shows behind a head [rows, columns, 3], display sRGB, first row on top."""
    y, x = ((n - np.arange(n) - 0.5) / n for n in (rows, columns))
    t = np.clip(np.hypot(x[None] - 0.5, y[:, None] - 0.55) / 0.75, 0, 1)[..., None]
    return color.encode_srgb(_CENTER + (_EDGE - _CENTER) * t * t * (3 - 2 * t))


def picture(acescg: np.ndarray, mask: np.ndarray, exposure: float = 0.0) -> np.ndarray:
    """8-bit sRGB [rows, columns, 3] of a picture that is black beside the head, before the viewer's backdrop.

    `mask` [rows, columns]: the share of each pixel that the head covers.
    """
    share = mask[..., None]
    skin = shown(np.where(share > 0, acescg / np.where(share > 0, share, 1), 0), exposure)
    return np.rint(255 * (skin * share + backdrop(*mask.shape) * (1 - share))).astype("u1")
