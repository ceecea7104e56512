"""The panel beside the face: sliders, presets, split view, what is under the cursor, what a frame costs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from imgui_bundle import imgui

from lutgen import color
from lutgen.errors import InputError, MachineError
from lutgen.scene import look as looks
from lutgen.scene.look import Look
from lutgen.skin.tissue import PRESETS

from ..passes import TAPS
from ..stage import Stage
from .picking import Picked

WIDTH, SLIDER, _PICK_WIDTH = 300, 126, 260
SLIDERS = (
    ("melanin", "%.4f"), ("eumelanin", "%.2f"), ("hemoglobin", "%.4f"), ("oxygenation", "%.2f"), (None, ""),
    ("light", "%.2f"), ("light_azimuth", "%.0f"), ("light_elevation", "%.0f"), ("light_size", "%.1f"),
    ("environment", "%.2f"), ("environment_azimuth", "%.0f"), (None, ""),
    ("roughness", "%.2f"), ("specular", "%.2f"), ("bumps", "%.2f"),
    ("transmission", "%.2f"), ("exposure", "%.2f"),
)  # fmt: skip
"""Values of a look that have a slider, and how each is shown."""
SHORTCUTS = (
    "left drag: turn the head", "ctrl + left drag: turn the light", "right or shift drag: move",
    "wheel: nearer, farther",
    "1 to 5: scattering tier", "S: split view", "P: next preset", "K: pick under the cursor", "R: start again",
    "ctrl + click on a slider: type", "?: this list", "Esc: close",
)  # fmt: skip
SIDES = {
    "scattering": ("scattering", "none"), "burley": ("each tone's profile", "one light-skin Burley"),
    "set": ("LUT set A", "LUT set B"),
}  # fmt: skip
"""What the halves of each split view show."""
_CHANNELS = ((235, 96, 84), (96, 205, 110), (96, 150, 245))


@dataclass
class Panel:
    """What the panel itself remembers, and where each slider lies in the window (left, top, right, bottom)."""

    path: str = "look.toml"
    said: str = ""
    shortcuts: bool = False
    picking: bool = False
    places: dict[str, tuple[float, float, float, float]] = field(default_factory=dict)


def splits(stage: Stage) -> tuple[str, ...]:
    """The split views that a stage can show."""
    return tuple(name for name in looks.SPLITS if name != "set" or "set" in stage.sides)


def build(
    panel: Panel, look: Look, stage: Stage, notes: tuple[str, ...], height: float, picked: Picked | None,
    save_picture: Callable[[Path], None],
) -> Look:  # fmt: skip
    """Lay out the panel of one frame; the look as the user has changed it."""
    imgui.set_next_window_pos((0, 0))
    imgui.set_next_window_size((WIDTH, height))
    flags = imgui.WindowFlags_.no_resize | imgui.WindowFlags_.no_move | imgui.WindowFlags_.no_collapse
    imgui.begin("lutgen", None, flags)
    try:
        look = _sliders(panel, _presets(look))
        imgui.separator()
        for name, allowed in (("tier", looks.TIERS), ("split", splits(stage))):
            moved, k = imgui.combo(name, allowed.index(getattr(look, name)), list(allowed))
            if moved:
                look = replace(look, **{name: allowed[k]})
        look = _file(panel, look, save_picture)
    except (InputError, MachineError) as error:
        panel.said = str(error)
    if panel.said:
        imgui.text_wrapped(panel.said)
    imgui.separator()
    _cost(look, stage)
    _, panel.picking = imgui.checkbox("pick under the cursor (K)", panel.picking)
    imgui.separator()
    for note in (*notes, *(SHORTCUTS if panel.shortcuts else ("? lists the shortcuts",))):
        imgui.text_wrapped(note)
    imgui.end()
    right, height = imgui.get_io().display_size
    if panel.picking:
        _picked(picked, right)
    if look.split != "none":
        _labels(look, right, height)
    return look


def _labels(look: Look, right: float, height: float) -> None:
    """A line between the halves of a split view, and what each shows."""
    draw, middle, white = imgui.get_background_draw_list(), (WIDTH + right) / 2, imgui.IM_COL32(230, 230, 230, 255)
    draw.add_line((middle, 0), (middle, height), imgui.IM_COL32(230, 230, 230, 90))
    mine, other = SIDES[look.split]
    draw.add_text((middle - imgui.calc_text_size(mine).x - 8, height - 20), white, mine)
    draw.add_text((middle + 8, height - 20), white, other)


def _presets(look: Look) -> Look:
    edge = imgui.get_cursor_screen_pos().x + imgui.get_content_region_avail().x
    spacing, padding = imgui.get_style().item_spacing.x, imgui.get_style().frame_padding.x
    imgui.push_id("presets")  # "light" is a slider too
    for i, name in enumerate(PRESETS):
        if i and imgui.get_item_rect_max().x + spacing + imgui.calc_text_size(name).x + 2 * padding < edge:
            imgui.same_line()
        if imgui.small_button(name):
            look = looks.of_preset(name, look)
    imgui.pop_id()
    return look


def _sliders(panel: Panel, look: Look) -> Look:
    imgui.push_item_width(SLIDER)
    for name, shown in SLIDERS:
        if name is None:
            imgui.separator()
            continue
        low, high = looks.RANGES[name]
        kind = imgui.SliderFlags_.logarithmic if name in ("melanin", "hemoglobin") else imgui.SliderFlags_.none
        moved, value = imgui.slider_float(name.replace("_", " "), getattr(look, name), low, high, shown, kind)
        panel.places[name] = *imgui.get_item_rect_min(), *imgui.get_item_rect_max()
        if moved:
            look = replace(look, **{name: float(np.clip(value, low, high))})
    imgui.pop_item_width()
    return look


def _file(panel: Panel, look: Look, save_picture: Callable[[Path], None]) -> Look:
    _, panel.path = imgui.input_text("look", panel.path)
    save = imgui.small_button("save")
    imgui.same_line()
    load = imgui.small_button("load")
    imgui.same_line()
    picture = imgui.small_button("save picture")
    path = Path(panel.path)
    if save:
        looks.save(look, path)
        panel.said = f"saved {path}"
    if load:
        look, panel.said = looks.load(path), f"loaded {path}"
    if picture:
        save_picture(path.with_suffix(".png"))
        panel.said = f"saved {path.with_suffix('.png')}"
    return look


def _cost(look: Look, stage: Stage) -> None:
    """Milliseconds of each pass, taps, and the LUT set's bytes."""
    spent = stage.milliseconds
    if spent:
        imgui.text_wrapped(", ".join(f"{name} {value:.1f}" for name, value in spent.items()) + " ms")
        imgui.text(f"{sum(spent.values()):.1f} ms on the GPU")
    imgui.text(f"at most {TAPS[look.tier]} taps a pixel; LUTs {stage.sides['none'].textures.bytes / 1e6:.2f} MB")


def _picked(picked: Picked | None, right: float) -> None:
    """A window at the top right: the picked skin in numbers, its spectrum and its profile."""
    imgui.set_next_window_pos((right - _PICK_WIDTH - 10, 10))
    imgui.set_next_window_size((_PICK_WIDTH, 0))
    flags = imgui.WindowFlags_.no_decoration | imgui.WindowFlags_.no_inputs
    imgui.begin("picked", None, flags)
    if picked is None:
        imgui.text("no skin under the cursor")
    else:
        _skin(picked)
        top = np.ceil(picked.reflectance.max() * 5) / 5
        nm = picked.wavelength_nm
        _plot(
            f"reflectance to {top:.1f}, 400 to 700 nm", (nm - 400) / 300, [(picked.reflectance / top, (230, 230, 230))]
        )
        edges, within = picked.profile.radius_edges_mm[1:], picked.profile.encircled()[1:]
        along = np.log10(edges / 0.01) / 3
        keep = (along >= 0) & (along <= 1)
        curves = [(within[keep, c], tint) for c, tint in enumerate(_CHANNELS)]
        _plot("light within r, 0.01 to 10 mm (log)", along[keep], curves)
    imgui.end()


def _skin(picked: Picked) -> None:
    imgui.text(f"melanin {picked.melanin:.4f}  eumelanin {picked.eumelanin:.2f}")
    thick = f"{picked.thickness_mm:.1f} mm thick" if picked.thickness_mm < 31.5 else "thick"
    imgui.text(f"hemoglobin {picked.hemoglobin:.4f}  {thick}")
    shown = color.encode_srgb(picked.linear_srgb)
    imgui.color_button("diffuse color", (*shown, 1.0))
    imgui.same_line()
    imgui.text("sRGB " + " ".join(f"{255 * v:.0f}" for v in shown))


def _plot(title: str, x: np.ndarray, curves: list[tuple[np.ndarray, tuple[int, int, int]]]) -> None:
    """Curves over x, both in 0 to 1, in a box of the window's width."""
    imgui.text(title)
    left, top = imgui.get_cursor_screen_pos()
    width, height = _PICK_WIDTH - 16.0, 90.0
    draw = imgui.get_window_draw_list()
    draw.add_rect((left, top), (left + width, top + height), imgui.IM_COL32(110, 110, 110, 255))
    for y, tint in curves:
        points = [imgui.ImVec2(left + width * float(u), top + height * (1 - float(np.clip(v, 0, 1))))
                  for u, v in zip(x, y, strict=True)]  # fmt: skip
        for a, b in pairwise(points):
            draw.add_line(a, b, imgui.IM_COL32(*tint, 255), 1.5)
    imgui.dummy((width, height + 4))
