"""The panel without a window: a scripted mouse, what it says of files, what it picks, and two LUT sets side by side."""

import importlib
from dataclasses import asdict, replace

import numpy as np
import pytest

import lutgen
from lutgen.files.texture_maps import Maps
from lutgen.head.mesh import Mesh
from lutgen.scene import light
from lutgen.scene import look as looks
from lutgen.scene.look import Look
from lutgen.skin.tissue import Skin
from lutgen.tables import recipe as recipes
from lutgen.tables.axes import Axis

_NAMES = "app", "gl", "window.imgui_draw", "window.panel", "passes", "window.picking", "stage"
app, gl, overlay, panel, passes, picking, stages = (importlib.import_module(f"lutgen.viewer.{n}") for n in _NAMES)
SIZE, HEIGHT = (96, 96), 700
FACING = Look(azimuth=0, elevation=0, distance_mm=300, melanin=0.03, hemoglobin=0.01)


@pytest.fixture(scope="module")
def other():
    """A LUT set of other axes, with a thin epidermis."""
    recipe = recipes.quality("draft")
    grid = replace(recipe.color, melanin=Axis("melanin", "1", 0.01, 0.1, 6, "log"),
                   eumelanin=Axis("eumelanin", "1", 0.7, 0.7, 1))  # fmt: skip
    return lutgen.bake(
        replace(recipe, photons=4096, color=grid, skin=Skin(0.0195, 0.7, 0.0088, epidermis_mm=0.06), seed=3)
    )


@pytest.fixture(scope="module")
def stage(other):
    """A square meter facing the camera."""
    corners = np.array([[-500, -500, 0], [500, -500, 0], [500, 500, 0], [-500, 500, 0]], "f4")
    square = Mesh(corners, np.tile(np.array([0, 0, 1], "f4"), (4, 1)), None, np.array([[0, 1, 2], [0, 2, 3]], "i4"))
    opened = app.open_stage(lutgen.load(), square, Maps(), SIZE, other)
    app.picture(opened, FACING)
    yield opened
    stages.release(opened)


class Hand:
    """Frames of a panel that a scripted mouse works."""

    def __init__(self, stage, look):
        self.stage, self.look, self.panel, self.picked = stage, look, panel.Panel(), None
        self.overlay, self.saved = overlay.open_overlay(), []
        self.color = gl.texture((600, HEIGHT), 4, "f1")
        self.target = gl.context().framebuffer([self.color])
        self.io = panel.imgui.get_io()
        self.frame()
        self.frame()

    def frame(self) -> np.ndarray:
        overlay.begin((600, HEIGHT), 1.0, 1 / 60)
        self.look = panel.build(self.panel, self.look, self.stage, ("a note",), HEIGHT, self.picked, self.saved.append)
        self.target.clear(0, 0, 0, 1)
        overlay.render(self.overlay, self.target, 1.0)
        return gl.read(self.target, kind="f1")[::-1, :, :3].astype(int)

    def press(self, x, y, to=None):
        """Press at a place and let go, there or elsewhere; one kind of event a frame, as ImGui takes them."""
        self.io.add_mouse_pos_event(x, y)
        self.frame()
        self.io.add_mouse_button_event(0, True)
        self.frame()
        self.io.add_mouse_pos_event(*(to or (x, y)))
        self.frame()
        self.frame()
        self.io.add_mouse_button_event(0, False)
        self.frame()
        self.frame()

    def close(self):
        overlay.close(self.overlay)
        gl.free(self.target, self.color)
        gl.check()


@pytest.fixture
def hand(stage):
    mouse = Hand(stage, FACING)
    yield mouse
    mouse.close()


@pytest.mark.parametrize("name", [name for name, _ in panel.SLIDERS if name])
def test_every_slider_moves_its_value_and_no_other(hand, name):
    left, top, _, bottom = hand.panel.places[name]
    before, y = asdict(hand.look), (top + bottom) / 2
    hand.press(left + 60, y, to=(left + 190, y))
    high = getattr(hand.look, name)
    hand.press(left + 60, y, to=(left - 5, y))
    assert getattr(hand.look, name) == pytest.approx(looks.RANGES[name][0])
    assert high == pytest.approx(looks.RANGES[name][1])
    assert asdict(hand.look) | {name: 0} == before | {name: 0}


def test_the_panel_is_drawn_and_stays_on_its_side(hand):
    shown = hand.frame()
    assert (shown[:, : panel.WIDTH].max(axis=2) > 200).mean() > 0.01  # letters
    assert shown[:, panel.WIDTH + 1 :].max() == 0
    hand.panel.picking = True
    hand.frame()
    assert (hand.frame()[:, panel.WIDTH + 1 :].max(axis=2) > 200).sum() > 100  # "no skin under the cursor"
    hand.panel.shortcuts, hand.look = True, replace(hand.look, split="set")
    assert hand.frame()[:, panel.WIDTH + 1 :].max() > 200


def test_looks_are_saved_loaded_and_errors_said(hand, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    press = {"save": False, "load": False, "save picture": False}
    real = panel.imgui.small_button
    monkeypatch.setattr(panel.imgui, "small_button", lambda label: press.pop(label, None) or real(label))
    press["save"] = True
    hand.frame()
    assert looks.load(tmp_path / "look.toml") == hand.look
    assert hand.panel.said == "saved look.toml"
    kept = hand.look
    hand.look = replace(kept, melanin=0.2)
    press["load"] = True
    hand.frame()
    assert hand.look == kept
    press["save picture"] = True
    hand.frame()
    assert [str(path) for path in hand.saved] == ["look.png"]
    for content, message in (("melanin = nan", "melanin = nan"), ("what", "not TOML"), ("skin = 1", "no such value")):
        (tmp_path / "look.toml").write_text(content)
        press["load"] = True
        hand.frame()
        assert message in hand.panel.said
        assert hand.look == kept
    hand.panel.path = "nowhere/look.toml"
    press["save"] = True
    hand.frame()
    assert "nowhere" in hand.panel.said


def test_the_panel_says_what_a_frame_costs(hand, monkeypatch):
    said = []
    for name in ("text", "text_wrapped"):
        monkeypatch.setattr(panel.imgui, name, said.append)
    hand.look = replace(hand.look, tier="high")
    hand.frame()
    told = "; ".join(said)
    for name, spent in hand.stage.milliseconds.items():
        assert spent > 0
        assert f"{name} {spent:.1f}" in told
    assert list(hand.stage.milliseconds) == ["shadow", "surface", "scattering", "composition"]
    assert f"at most 64 taps a pixel; LUTs {hand.stage.sides['none'].textures.bytes / 1e6:.2f} MB" in told
    assert "a note" in said


def test_preset_buttons_set_the_skin(hand, monkeypatch):
    real = panel.imgui.small_button
    monkeypatch.setattr(panel.imgui, "small_button", lambda label: real(label) or label == "dark")
    hand.frame()
    dark = lutgen.preset("dark")
    assert (hand.look.melanin, hand.look.hemoglobin) == (dark.melanin, dark.hemoglobin)
    assert hand.look.distance_mm == FACING.distance_mm


def test_what_is_picked_is_the_skin_there(stage):
    """Its spectrum against adding-doubling within the table's own noise, its profile and color those of the set."""
    app.picture(stage, FACING)
    picked = picking.pick(stage, FACING, 40, 50)
    assert (picked.melanin, picked.eumelanin, picked.hemoglobin) == pytest.approx((0.03, 0.7, 0.01), rel=1e-6)
    luts = lutgen.load()
    skin = Skin(0.03, 0.7, 0.01)
    exact = lutgen.spectrum(skin, picked.wavelength_nm)
    assert picked.reflectance == pytest.approx(exact, abs=4e-3)
    assert picked.linear_srgb == pytest.approx(luts.color(0.03, 0.7, 0.01), rel=1e-5)
    assert picked.profile.energy == pytest.approx(luts.profile(0.03, 0.7, 0.01).energy, rel=1e-5)
    assert picked.thickness_mm == 32
    assert picking.pick(stage, FACING, -1, 50) is None
    assert picking.pick(stage, FACING, 40, SIZE[1]) is None


def test_picking_knows_where_the_picture_is(stage):
    """A chromophore map of two halves, one above the other: rows count from the top."""
    ratios = np.ones((8, 1, 3), "f4")
    ratios[4:] = 2.0  # the upper half, where v is large
    corners = np.array([[-500, -500, 0], [500, -500, 0], [500, 500, 0], [-500, 500, 0]], "f4")
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], "f4")
    square = Mesh(corners, np.tile(np.array([0, 0, 1], "f4"), (4, 1)), uv, np.array([[0, 1, 2], [0, 2, 3]], "i4"))
    opened = app.open_stage(lutgen.load(), square, Maps(chromophores=ratios), SIZE)
    look = replace(FACING, distance_mm=3000, melanin=0.02)
    app.picture(opened, look)
    upper, lower = (picking.pick(opened, look, 48, y) for y in (15, 80))
    assert upper.melanin > lower.melanin == pytest.approx(0.02, rel=1e-3)
    far = replace(look, distance_mm=5000)
    app.picture(opened, far)
    assert picking.pick(opened, far, 2, 2) is None
    stages.release(opened)


def test_pick_and_picture_follow_the_oxygenation(stage):
    blue = replace(FACING, oxygenation=0.1)
    app.picture(stage, blue)
    picked = picking.pick(stage, blue, 48, 48)
    expected = lutgen.load().expand(oxygenation=0.1).color(0.03, 0.7, 0.01)
    assert picked.linear_srgb == pytest.approx(expected, rel=1e-5)
    app.picture(stage, FACING)


def scattered(stage, look) -> np.ndarray:
    app.picture(stage, look)
    return gl.read(stage.targets["scattered_buffer"])[::-1, :, :3]


def test_another_set_shades_the_right_half(stage, other):
    """Even light without the entry factor: each half has its own set's color, though the sets' axes differ."""
    look = replace(FACING, entry=0, environment=0, light=np.pi, light_azimuth=0, light_elevation=0, transmission=0)
    halves = scattered(stage, replace(look, split="set"))
    for luts, columns in ((lutgen.load(), slice(20, 80)), (other, slice(110, 170))):
        color = luts.color(look.melanin, look.eumelanin, look.hemoglobin, space="acescg") * light.SUN
        assert np.abs(halves[60:120, columns] / color - 1).max() < 0.005
    blue = scattered(stage, replace(look, split="set", oxygenation=0.2))
    color = other.expand(oxygenation=0.2).color(0.03, 0.7, 0.01, space="acescg") * light.SUN
    assert np.abs(blue[60:120, 110:170] / color - 1).max() < 0.005
    right = picking.pick(stage, replace(look, split="set", oxygenation=0.2), 80, 48)
    assert right.linear_srgb == pytest.approx(other.expand(oxygenation=0.2).color(0.03, 0.7, 0.01), rel=1e-5)


def test_a_look_outside_the_sets_is_refused(stage):
    with pytest.raises(lutgen.InputError, match=r"melanin = 0.2: allowed is 0.01 to 0.1"):
        app.picture(stage, replace(FACING, melanin=0.2, split="set"))
    assert panel.splits(stage) == looks.SPLITS
    alone = replace(FACING, split="set")
    sides, stage.sides = stage.sides, {"none": stage.sides["none"]}
    try:
        assert "set" not in panel.splits(stage)
        with pytest.raises(lutgen.InputError, match="--compare DIR"):
            app.picture(stage, alone)
    finally:
        stage.sides = sides
    app.picture(stage, FACING)


def test_frames_added_one_by_one_are_the_whole(stage):
    look = replace(FACING, tier="reference", light_elevation=40)
    whole = scattered(stage, look)
    for frame in range(passes.frames(look)):
        passes.draw(stage, look, frame)
    assert np.array_equal(gl.read(stage.targets["scattered_buffer"])[::-1, :, :3], whole)
