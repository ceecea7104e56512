"""Pictures that explain themselves: preview.png of a LUT set, and the swatch of one skin; Pillow and NumPy only."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from PIL import Image

from lutgen import color
from lutgen.skin import chromophores
from lutgen.skin.tissue import PRESETS, Skin
from lutgen.solvers import profiles
from lutgen.tables.axes import Axis, Grid
from lutgen.tables.canvas import GRAY, INK, OVERSAMPLE, PAPER, RULE, Box, Canvas
from lutgen.tables.lut_set import LutSet

WIDTH, HEIGHT = 1200, 760
MARKED = ("very-light", "light", "intermediate", "tan", "brown", "dark")
CURVES = ("very-light", "intermediate", "dark")
RADIUS_MM = (0.001, 10.0)
CHANNELS = (("R", "#d1401f", (), 0.3), ("G", "#2f9e44", (9, 4), 0.5), ("B", "#1c3a94", (2.5, 3), 0.7))
"""Per channel: letter, color (lightness 49, 58 and 28), dash and gap in pixels, encircled energy where it is named."""
_CHART = (336, 52, 776, 340)
"""Place of a chart of reflectance on a picture of one skin."""


def _percent(share: float) -> str:
    return f"{100 * share:.3g} %"


def _ticks(canvas: Canvas, axis: Axis, length: float, upright: bool) -> list[tuple[float, str]]:
    """Round values of a chromophore axis at their texture coordinates: its ends first, then what fits between."""
    wanted = [axis.low, axis.high, *(m * 10.0**d for m in (1, 5, 2, 3, 4, 6, 8) for d in range(0, -5, -1))]
    kept: list[tuple[float, str]] = []
    for place, words in ((float(axis.coordinate(v)), _percent(v)) for v in wanted if axis.low <= v <= axis.high):
        room = [16 if upright else canvas.measure(words + other, 11) / 2 + 8 for _, other in kept]
        if all(abs(place - other) * length >= need for (other, _), need in zip(kept, room, strict=True)):
            kept.append((place, words))
    return kept


def tile_boxes(grid: Grid) -> list[tuple[int, tuple[int, int, int, int]]]:
    """The tiles of the color chart: eumelanin node and place (left, top, right, bottom) in pixels of preview.png.

    Up to three: the lowest eumelanin ratio, the one nearest the presets' (or the middle one), the highest. Texture
    coordinate u of melanin lies at left + u (right - left), v of hemoglobin at bottom - v (bottom - top).
    """
    last = grid.eumelanin.count - 1
    middle = int(np.abs(grid.eumelanin.values - PRESETS[MARKED[0]].eumelanin).argmin())
    shown = sorted({0, middle if 0 < middle < last else (last + 1) // 2, last})
    return [(e, _column(i, len(shown), 150, 386)) for i, e in enumerate(shown)]


def _column(i: int, count: int, top: int, bottom: int) -> tuple[int, int, int, int]:
    width = (1110 - 30 * count) // count
    return 96 + i * (width + 30), top, 96 + i * (width + 30) + width, bottom


def draw(luts: LutSet) -> Image.Image:
    """Picture of a LUT set: its color table as a chart, the presets in it, and three diffuse profiles.

    RGB, 1200 x 760 pixels. Colors are display sRGB; each cell of the chart is one stored node.
    """
    canvas = Canvas(WIDTH, HEIGHT)
    _header(canvas, luts)
    _color_chart(canvas, luts)
    canvas.text(24, 456, "Light that leaves within a radius of where it entered", 16)
    canvas.text(WIDTH - 24, 456, "share of each channel's total, linear ACEScg", 12, GRAY, "rs")
    for i, name in enumerate(CURVES):
        _profile_chart(canvas, luts, name, _column(i, 3, 522, 706), first=i == 0)
    return canvas.image.reduce(OVERSAMPLE)


def _header(canvas: Canvas, luts: LutSet) -> None:
    facts, skin = luts.manifest, luts.manifest["recipe"]["skin"]
    canvas.text(24, 40, f"Skin lookup tables, lutgen {facts['lutgen']}", 22)
    baked = [
        f"{facts['trace']['photons_per_wavelength']:,} photons per wavelength",
        f"{len(facts['quadrature']['wavelength_nm'])} wavelengths", f"{facts['recipe']['totals']} totals",
        f"oxygenation {_percent(skin['oxygenation'])}", f"epidermis {skin['epidermis_mm']:g} mm",
        f"{skin['scattering']} scattering",
    ]  # fmt: skip
    extra = any(np.any(values) for values in facts["extra_absorbers_per_mm"].values())
    canvas.text(24, 62, ", ".join(baked + ["extra absorbers"] * extra), 13, GRAY)
    if facts.get("error"):
        error = facts["error"]["color"]
        words = f"E00 of colors: max {error['delta_e00_max']:.3f}, p95 {error['delta_e00_p95']:.3f}"
        canvas.text(WIDTH - 24, 40, words, 16, anchor="rs")
        x = WIDTH - 25 - canvas.measure(words, 16)  # Pillow's font lacks the delta
        canvas.line([(x - 10, 39.5), (x - 5.5, 29.5), (x - 1, 39.5), (x - 10, 39.5), (x - 5.5, 29.5)], width=1.3)
        canvas.text(WIDTH - 24, 62, f"{error['skins']:,} skins against {error['compared_with']}", 13, GRAY, "rs")
    canvas.line([(24, 76), (WIDTH - 24, 76)], RULE)


def _display(luts: LutSet, acescg: np.ndarray) -> np.ndarray:
    """Bytes [..., 3] of display sRGB of linear ACEScg [..., 3], clipped."""
    return np.rint(255 * color.encode_srgb(color.from_acescg(acescg, "srgb", luts.pipeline))).astype(np.uint8)


def _color_chart(canvas: Canvas, luts: LutSet) -> None:
    grid = luts.color_lut.grid
    marked = {n: PRESETS[n] for n in MARKED if _inside(grid, PRESETS[n])}
    canvas.text(24, 104, "Color of skin lit along its normal", 16)
    note = "one cell per stored node, shown in sRGB" + ("; circles: presets, eumelanin ratio 0.7" if marked else "")
    canvas.text(WIDTH - 24, 104, note, 12, GRAY, "rs")
    tiles = tile_boxes(grid)
    nearest = min(tiles, key=lambda tile: abs(grid.eumelanin.values[tile[0]] - PRESETS[MARKED[0]].eumelanin))[0]
    for i, (e, box) in enumerate(tiles):
        left, top, right, bottom = box
        canvas.text(left, top - 9, f"eumelanin ratio {grid.eumelanin.values[e]:.3g}", 13)
        row = ((np.arange(bottom - top) + 0.5) * grid.hemoglobin.count / (bottom - top)).astype(int)
        column = ((np.arange(right - left) + 0.5) * grid.melanin.count / (right - left)).astype(int)
        cells = _display(luts, luts.color_lut.acescg[:, e])[row[::-1, None], column]
        tile = Image.fromarray(cells.repeat(OVERSAMPLE, axis=0).repeat(OVERSAMPLE, axis=1))
        canvas.image.paste(tile, (left * OVERSAMPLE, top * OVERSAMPLE))
        x_ticks = _ticks(canvas, grid.melanin, right - left, upright=False)
        y_ticks = [] if i else _ticks(canvas, grid.hemoglobin, bottom - top, upright=True)
        labels = "melanin (melanosomes in epidermis)", "" if i else "hemoglobin (blood in dermis)"
        canvas.frame(box, x_ticks, y_ticks, *labels)
        _mark(canvas, grid, box, marked if e == nearest else {})


def _clamped(grid: Grid, skin: Skin) -> tuple[float, ...]:
    """Melanin, eumelanin and hemoglobin of the nearest skin within the grid's axes."""
    axes = grid.axes[::-1]
    return tuple(min(max(getattr(skin, axis.name), axis.low), axis.high) for axis in axes)


def _inside(grid: Grid, skin: Skin) -> bool:
    return _clamped(grid, skin) == (skin.melanin, skin.eumelanin, skin.hemoglobin)


def _mark(canvas: Canvas, grid: Grid, box: Box, skins: dict[str, Skin]) -> None:
    """Circle skins in a tile and name each at the end of a leader, wherever nothing else stands."""
    left, top, right, bottom = box
    x_of = {n: left + float(grid.melanin.coordinate(s.melanin)) * (right - left) for n, s in skins.items()}
    y_of = {n: bottom - float(grid.hemoglobin.coordinate(s.hemoglobin)) * (bottom - top) for n, s in skins.items()}
    taken = [(n, (x_of[n] - 6, y_of[n] - 6, x_of[n] + 6, y_of[n] + 6)) for n in skins]
    labels = {}
    for name in sorted(skins, key=lambda n: -x_of[n]):
        x, y, width = x_of[name], y_of[name], canvas.measure(name, 11) + 8
        start = min(max(x - 6, left + 3), right - 3 - width)
        for end in (y - rise for rise in (*range(24, 200, 16), *range(-24, -200, -16))):
            label = (start, end - 7, start + width, end + 7)
            leader = (round(x), y + 5, round(x) + 1, end) if end > y else (round(x), end, round(x) + 1, y - 5)
            free = not any(other != name and (_overlap(label, b) or _overlap(leader, b)) for other, b in taken)
            if free and top + 2 < label[1] and label[3] < bottom - 2:
                taken += [(name, label), (name, leader)]
                labels[name] = label
                canvas.box(leader, INK, outline=PAPER)
                break
    for name, label in labels.items():
        canvas.pen.rounded_rectangle([v * OVERSAMPLE for v in label], 3 * OVERSAMPLE, PAPER, INK, 1)
        canvas.text(label[0] + 4, (label[1] + label[3]) / 2, name, 11, anchor="lm")
    for name in skins:
        for r, ink, width in ((5.5, INK, 3), (4.5, PAPER, 1.5)):
            circle = (x_of[name] - r, y_of[name] - r, x_of[name] + r, y_of[name] + r)
            canvas.pen.ellipse([v * OVERSAMPLE for v in circle], outline=ink, width=round(width * OVERSAMPLE))


def _overlap(a: Box, b: Box) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def _profile_chart(canvas: Canvas, luts: LutSet, name: str, box: Box, first: bool) -> None:
    """Encircled energy of a preset, clamped to the profile LUT's axes, against radius, per ACEScg channel."""
    lut = luts.profile_lut
    skin = _clamped(lut.grid, PRESETS[name])
    within = profiles.encircled(lut.grid.interpolate(lut.shape, *skin).T)
    left, top, right, bottom = box
    patch = _display(luts, luts.color_lut.grid.interpolate(luts.color_lut.acescg, *skin))
    canvas.box((left, top - 40, left + 30, top - 10), "#" + bytes(patch).hex(), GRAY)
    values = "" if _inside(lut.grid, PRESETS[name]) else "nearest: "
    values += f"melanin {_percent(skin[0])}, hemoglobin {_percent(skin[2])}, eumelanin {skin[1]:.3g}"
    canvas.text(left + 38, top - 29, name, 13)
    canvas.text(left + 38, top - 12, values, 11, GRAY)
    x_ticks = [(i / 4, f"{10.0 ** (i - 3):g}") for i in range(5)]
    y_ticks = [(i / 4, f"{25 * i} %" if first else "") for i in range(5)]
    names = "radius around the point of entry (mm)", "light within the radius" if first else ""
    canvas.frame(box, x_ticks, y_ticks, *names, grid=True)
    log_r, ends = np.log(lut.radius_edges_mm[1:]), np.log(RADIUS_MM)
    nodes = np.concatenate([ends[:1], log_r[(log_r > ends[0]) & (log_r < ends[1])], ends[1:]])
    x = left + (nodes - ends[0]) / np.ptp(ends) * (right - left)
    shares = [np.interp(nodes, log_r, P[1:]) for P in within]
    for (_, ink, dash, _), share in zip(CHANNELS, shares, strict=True):
        canvas.line(np.column_stack([x, bottom - share * (bottom - top)]), ink, 2, dash)
    for (letter, ink, _, level), share in zip(CHANNELS, shares, strict=True):
        x_named = float(np.clip(np.interp(level, share, x), left + 10, right - 10))
        canvas.text(x_named, bottom - level * (bottom - top), letter, 13, ink, "mm", halo=PAPER)
    r50 = (f"{c[0]} {np.interp(0.5, P, lut.radius_edges_mm):.2g}" for c, P in zip(CHANNELS, within, strict=True))
    canvas.text(right, top - 29, f"half within {', '.join(r50)} mm", 11, GRAY, "rs")


def draw_swatch(skin: Skin, result: dict) -> Image.Image:
    """Picture of one skin: color, hex code, L*a*b*, parameters and reflectance spectrum; RGB, 800 x 400 pixels.

    `result` is what `lutgen swatch --json` prints; the band around the spectrum is two standard errors each way.
    """
    canvas = Canvas(800, 400)
    linear = np.asarray(result["linear_srgb"], float)
    shown = np.rint(255 * color.encode_srgb(linear)).astype(np.uint8)
    canvas.box((24, 24, 244, 184), "#" + bytes(shown).hex(), GRAY)
    canvas.text(24, 212, result["srgb_hex"], 18)
    canvas.text(244, 212, "sRGB" if np.all((linear >= 0) & (linear <= 1)) else "clipped to sRGB", 12, GRAY, "rs")
    L, a, b = result["lab"]
    fitted = f" {skin.saidi_a_per_mm:g}, {skin.saidi_b_nm4_per_mm:.3g}" if skin.scattering == "saidi" else ""
    lines = [
        f"L* {L:.1f}   a* {a:.1f}   b* {b:.1f}", "",
        f"melanin {_percent(skin.melanin)}", f"eumelanin ratio {skin.eumelanin:.3g}",
        f"hemoglobin {_percent(skin.hemoglobin)}", f"oxygenation {_percent(skin.oxygenation)}",
        f"epidermis {skin.epidermis_mm:g} mm", f"{skin.scattering} scattering{fitted}, {skin.reading} reading",
        f"{result['method']}, {result['pipeline']} pipeline",
    ]  # fmt: skip
    for i, words in enumerate(lines):
        canvas.text(24, 236 + 18 * i - 8 * (i > 1), words, 12, GRAY if i else INK)
    nm, reflectance, sigma = (np.asarray(result[key], float) for key in ("wavelength_nm", "reflectance", "std_error"))
    place = _reflectance_chart(canvas, nm, float((reflectance + 2 * sigma).max()), "diffuse reflectance")
    if sigma.any():
        canvas.text(_CHART[2], _CHART[1] - 10, "band: two standard errors each way", 11, GRAY, "rs")
        outline = np.concatenate([place(reflectance + 2 * sigma), place(reflectance - 2 * sigma)[::-1]])
        canvas.pen.polygon([tuple(p) for p in outline * OVERSAMPLE], "#c9c9c9")
    canvas.line(place(reflectance), INK, 1.5)
    return canvas.image.reduce(OVERSAMPLE)


def draw_fit(skin: Skin, result: dict) -> Image.Image:
    """Picture of a fit: both colors, what is left, parameters with sigma and both spectra; RGB, 800 x 400 pixels.

    `result` is what `lutgen fit --json` prints.
    """
    canvas = Canvas(800, 400)
    sides = [result[side] for side in ("measured", "model")]
    for i, (side, words) in enumerate(zip(sides, ("measured", "model"), strict=True)):
        left = 24 + 110 * i
        canvas.box((left, 24, left + 110, 164), side["srgb_hex"], GRAY)
        canvas.text(left, 184, side["srgb_hex"], 14)
        canvas.text(left, 200, words, 12, GRAY)
    rmse = "" if result["rmse"] is None else f", RMSE {_percent(result['rmse'])}"
    canvas.text(24, 224, f"CIEDE2000 {result['delta_e00']:.2f}{rmse}", 12)
    for i, name in enumerate((*chromophores.NAMES, "oxygenation")):
        scale, unit = (1, "") if name == "eumelanin" else (100, " %")
        sigma = result["sigma"].get(name)
        how = "at its bound" if name in result["sigma"] else "fixed"
        words = f"{name} {scale * getattr(skin, name):.3g}{unit} "
        words += how if sigma is None else f"± {scale * sigma:.2g}{unit}"
        canvas.text(24, 246 + 18 * i, words, 12, INK if name in result["sigma"] else GRAY)
    canvas.text(24, 318, f"epidermis {skin.epidermis_mm:g} mm", 12, GRAY)
    canvas.text(24, 336, f"{skin.scattering} scattering, {skin.reading} reading", 12, GRAY)
    curves = [np.asarray(side["reflectance"], float) for side in sides if "reflectance" in side]
    place = _reflectance_chart(canvas, np.asarray(result["wavelength_nm"], float), float(np.max(curves)), "reflectance")
    canvas.line(place(curves[-1]), INK, 1.5)
    if len(curves) > 1:
        for x, y in place(curves[0])[:: 1 + len(curves[0]) // 100]:
            canvas.pen.ellipse(
                [OVERSAMPLE * v for v in (x - 2.5, y - 2.5, x + 2.5, y + 2.5)], outline="#d1401f", width=2
            )
    said = ["line: model", *["circles: measured"] * (len(curves) - 1)]
    said += ["specular included"] * result["specular_included"]
    canvas.text(_CHART[2], _CHART[1] - 10, ", ".join(said), 11, GRAY, "rs")
    return canvas.image.reduce(OVERSAMPLE)


def _reflectance_chart(
    canvas: Canvas, nm: np.ndarray, highest: float, label: str
) -> Callable[[np.ndarray], np.ndarray]:
    """Frame of a chart; what it returns gives the points [n, 2] of reflectance [n] at these wavelengths."""
    left, top, right, bottom = _CHART
    highest = max(highest, 1e-4)
    step = next(s for s in (m * 10.0**d for d in range(-5, 1) for m in (1, 2, 5)) if highest <= 5 * s)
    count = int(np.ceil(highest / step))
    span = max(float(np.ptp(nm)), 1.0)
    y_ticks = [(i / count, _percent(i * step)) for i in range(count + 1)]
    every = next(s for s in (50, 20, 10, 5, 2, 1, span) if span >= 2 * s or s == span)
    x_ticks = [
        ((v - nm[0]) / span, f"{v:g}") for v in np.arange(np.ceil(nm[0] / every) * every, nm[0] + span + 0.5, every)
    ]
    canvas.frame(_CHART, x_ticks, y_ticks, "wavelength (nm)", label, grid=True)
    x = left + (nm - nm[0]) / span * (right - left)
    return lambda values: np.column_stack([x, bottom - np.maximum(values, 0) * (bottom - top) / (count * step)])
