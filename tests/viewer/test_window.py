"""The real window on a virtual screen: what a user's mouse and keys do to the face, seen in the screen's own pixels."""

import ctypes
import importlib
import json
import os
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import lutgen
from lutgen.cli import main
from lutgen.scene import look as looks
from lutgen.scene.look import Look

panel, window = (importlib.import_module(f"lutgen.viewer.{name}") for name in ("window.panel", "window.window"))
WIDTH, HEIGHT = 320, 360
WATCHED = """
import importlib, json, sys
from dataclasses import asdict
import glfw
from lutgen.cli import main
wait = glfw.wait_events_timeout
glfw.wait_events_timeout = lambda seconds: wait(0.05)  # frames that nothing asked for come sooner
panel = importlib.import_module("lutgen.viewer.window.panel")
build = panel.build
def watched(one, look, stage, *others):
    look = build(one, look, stage, *others)
    typing = panel.imgui.get_io().want_text_input
    print(json.dumps({"places": one.places, "look": asdict(look), "size": stage.size, "typing": typing}), flush=True)
    return look
panel.build = watched
sys.exit(main(sys.argv[1:]))
"""


def _resources(display: str, text: bytes) -> None:
    """Set a screen's resources, as a desktop does that knows its monitor's dots."""
    x = ctypes.CDLL("libX11.so.6")
    x.XOpenDisplay.restype, x.XDefaultRootWindow.restype = ctypes.c_void_p, ctypes.c_ulong
    opened = ctypes.c_void_p(x.XOpenDisplay(display.encode()))
    root, manager, string = ctypes.c_ulong(x.XDefaultRootWindow(opened)), ctypes.c_ulong(23), ctypes.c_ulong(31)
    x.XChangeProperty(opened, root, manager, string, 8, 0, text, len(text))
    x.XCloseDisplay(opened)


class Screen:
    """A virtual screen whose pixels lie in a file, and a viewer in it that tells each frame's look."""

    def __init__(self, folder: Path, arguments: list[str], dots_per_inch: int = 96):
        reading, writing = os.pipe()
        command = ["Xvfb", "-displayfd", str(writing), "-screen", "0", "900x500x24", "-fbdir", str(folder), "-noreset"]
        self.server = subprocess.Popen([*command, "-nolisten", "tcp"], pass_fds=[writing], stderr=subprocess.DEVNULL)
        os.close(writing)
        with os.fdopen(reading) as display:
            self.environment = os.environ | {"DISPLAY": f":{display.readline().strip()}"}
        if dots_per_inch != 96:
            _resources(self.environment["DISPLAY"], f"Xft.dpi:\t{dots_per_inch}\n".encode())
        self.pixels = folder / "Xvfb_screen0"
        self.viewer = subprocess.Popen(
            [sys.executable, "-c", WATCHED, *arguments], env=self.environment, stdout=subprocess.PIPE, text=True
        )
        self.frames: list[dict] = []
        self.listener = threading.Thread(target=self._listen)
        self.listener.start()
        self.until(lambda frame: len(self.frames) > 3)

    def _listen(self) -> None:
        assert self.viewer.stdout is not None
        for line in self.viewer.stdout:
            told = json.loads(line)
            if "places" in told:
                self.frames.append(told)

    def until(self, holds, seconds: float = 60) -> dict:
        """The first frame of which that holds; the picture is that of a frame whose successors are alike."""
        end = time.monotonic() + seconds
        while time.monotonic() < end and self.viewer.poll() is None:
            if self.frames and holds(self.frames[-1]):
                return self.frames[-1]
            time.sleep(0.05)
        raise AssertionError(f"not seen in {seconds} s; the viewer {self.viewer.poll()}, {self.frames[-1:]}")

    def do(self, *words) -> None:
        """One xdotool command."""
        subprocess.run(["xdotool", *map(str, words)], env=self.environment, check=True)

    def drag(self, start, end) -> None:
        """Press at a place, move to another in steps as a hand does, let go once a frame has seen the last."""
        self.do("mousemove", *(round(v) for v in start), "mousedown", 1)
        for k in range(1, 6):
            self.do("mousemove", *(round(a + (b - a) * k / 5) for a, b in zip(start, end, strict=True)))
            time.sleep(0.05)
        seen = len(self.frames)
        self.until(lambda _: len(self.frames) > seen + 2)
        self.do("mouseup", 1)

    def slide(self, name: str, share: float) -> float:
        """Drag a slider from its middle to a share of its length; the value where it comes to rest."""
        left, top, right, bottom = self.frames[-1]["places"][name]
        right = min(right, left + panel.SLIDER)  # its name stands beside it
        start, end = (left + 0.5 * (right - left), left + share * (right - left))
        self.drag((start, (top + bottom) / 2), (end, (top + bottom) / 2))
        self.rest()
        return self.frames[-1]["look"][name]

    def rest(self) -> None:
        """Wait until some frames in a row show the same; the first of them is on the screen by then."""
        seen = len(self.frames)
        self.until(lambda _: len(self.frames) > seen + 8 and all(f == self.frames[-1] for f in self.frames[-6:]))

    def picture(self, left: int = panel.WIDTH, width: int = WIDTH, height: int = HEIGHT) -> np.ndarray:
        """The face as the screen shows it [height, width, 3], once it no longer changes."""
        self.rest()
        return self._read()[:height, left : left + width]

    def _read(self) -> np.ndarray:
        raw = self.pixels.read_bytes()
        header = np.frombuffer(raw[:100], ">u4")  # X window dump: sizes and the color map come before the pixels
        height, row, start = header[5], header[12], header[0] + 12 * header[19]
        screen = np.frombuffer(raw, "u1", height * row, start).reshape(height, row // 4, 4)
        return screen[..., 2::-1].astype(int)

    def close(self) -> int:
        """Press escape; the viewer's exit status."""
        self.do("key", "Escape")
        return self.viewer.wait(30)

    def kill(self) -> None:
        """End what still runs."""
        for process in (self.viewer, self.server):
            process.kill()
            process.wait()
        self.listener.join()
        if self.viewer.stdout is not None:
            self.viewer.stdout.close()


LOOK = {"distance_mm": 420, "azimuth": 0, "elevation": 0, "target_mm": "0,-30,0", "tier": "low"}
SET = [text for name, value in LOOK.items() for text in ("--set", f"{name}={value}")]


@pytest.fixture(scope="module")
def screen(tmp_path_factory):
    folder = tmp_path_factory.mktemp("screen")
    opened = Screen(folder, ["view", "--size", f"{WIDTH}x{HEIGHT}", "--json", *SET])
    try:
        yield opened
        assert opened.close() == 0  # any OpenGL error pending would have ended it with 1
    finally:
        opened.kill()


def middle(picture: np.ndarray) -> np.ndarray:
    return picture[120:240, 110:210].reshape(-1, 3).mean(axis=0)


def test_the_window_shows_the_pixels_of_a_screenshot(screen, tmp_path):
    out = tmp_path / "view.png"
    assert main(["view", "--screenshot", str(out), "--size", f"{WIDTH}x{HEIGHT}", *SET]) == 0
    with Image.open(out) as image:
        assert np.array_equal(screen.picture(), np.asarray(image).astype(int))


def test_dragging_melanin_darkens_the_face(screen):
    before = middle(screen.picture())
    assert screen.slide("melanin", 0.75) > 0.05
    assert np.all(middle(screen.picture()) < 0.8 * before)
    assert screen.slide("melanin", 0.15) < 0.01


def lips(picture: np.ndarray) -> np.ndarray:
    """Mean color of the mouth's lighter half: the red of the lips without the slit between them."""
    mouth = picture[235:275, 130:190].reshape(-1, 3)
    bright = mouth.sum(axis=1)
    return mouth[bright > np.median(bright)].mean(axis=0)


def test_without_oxygen_the_lips_turn_blue(screen):
    red = lips(screen.picture())
    assert screen.slide("oxygenation", 0.02) < 0.1
    blue = lips(screen.picture())
    assert blue[0] - blue[2] < red[0] - red[2] - 5  # the same pixels but for the blood: there is no noise
    assert blue[0] / blue[1] < red[0] / red[1] - 0.02
    assert screen.slide("oxygenation", 0.7) > 0.6


def test_the_mouse_turns_moves_and_nears_the_head_and_turns_the_light(screen):
    place = (panel.WIDTH + 160, 180)
    before = screen.frames[-1]["look"]
    screen.drag(place, (place[0] + 50, place[1] + 10))
    turned = screen.until(lambda f: f["look"]["azimuth"] == pytest.approx(before["azimuth"] - 20))
    assert turned["look"]["elevation"] == pytest.approx(before["elevation"] + 4)
    screen.do("mousemove", *place, "click", 4)
    screen.until(lambda f: f["look"]["distance_mm"] == pytest.approx(0.9 * before["distance_mm"]))
    screen.do("keydown", "shift")
    screen.drag(place, (place[0] + 30, place[1]))
    screen.do("keyup", "shift")
    screen.until(lambda f: f["look"]["target_mm"] != before["target_mm"])
    screen.do("keydown", "ctrl")
    screen.drag(place, (place[0] - 50, place[1]))
    screen.do("keyup", "ctrl")
    screen.until(lambda f: f["look"]["light_azimuth"] == pytest.approx(before["light_azimuth"] - 20))
    screen.do("key", "r")
    screen.until(lambda f: f["look"]["azimuth"] == 0 and f["look"]["distance_mm"] == LOOK["distance_mm"])


def test_keys_and_a_typed_value(screen):
    screen.do("mousemove", panel.WIDTH + 160, 180)
    screen.do("key", "3", "key", "5")
    screen.until(lambda f: f["look"]["tier"] == "reference")
    screen.do("key", "s", "key", "k", "key", "question", "key", "p")
    frame = screen.until(lambda f: f["look"]["split"] == "scattering" and f["look"]["melanin"] != Look().melanin)
    assert frame["look"]["melanin"] in {s.melanin for s in lutgen.PRESETS.values()}
    left, top, _, bottom = frame["places"]["hemoglobin"]
    screen.do("mousemove", round(left + 20), round((top + bottom) / 2), "keydown", "ctrl", "click", 1, "keyup", "ctrl")
    screen.until(lambda f: f["typing"])
    screen.do("key", "ctrl+a", "type", "0.05")
    screen.do("key", "Return")
    screen.until(lambda f: f["look"]["hemoglobin"] == pytest.approx(0.05))
    assert screen.frames[-1]["look"]["tier"] == "reference"  # the digits went to the field, not to the shortcuts
    screen.do("mousemove", panel.WIDTH + 160, 180)
    screen.until(lambda f: not f["typing"])
    screen.do("key", "r", "key", "k", "key", "question")
    screen.until(lambda f: f["look"]["split"] == "none")


def test_another_size_shows_the_whole_face(screen):
    name = subprocess.run(["xdotool", "search", "--name", "lutgen"], env=screen.environment, capture_output=True)
    number = name.stdout.split()[0].decode()
    before = screen.picture()
    screen.do("windowsize", number, panel.WIDTH + WIDTH // 2, HEIGHT // 2)
    screen.until(lambda f: f["size"] == [WIDTH // 2, HEIGHT // 2])
    half = screen.picture()[: HEIGHT // 2, : WIDTH // 2]
    assert np.abs(half - before.reshape(HEIGHT // 2, 2, WIDTH // 2, 2, 3).mean(axis=(1, 3))).mean() < 4
    screen.do("windowsize", number, panel.WIDTH + WIDTH, HEIGHT)
    screen.until(lambda f: f["size"] == [WIDTH, HEIGHT])
    assert np.array_equal(screen.picture(), before)


def test_on_a_screen_of_many_dots_everything_is_as_large(tmp_path):
    """192 dots per inch: the picture has twice the pixels each way, the panel keeps its size in units."""
    screen = Screen(tmp_path, ["view", "--size", "140x120", "--json", *SET], 192)
    try:
        assert screen.frames[-1]["size"] == [280, 240]
        out = tmp_path / "view.png"
        assert main(["view", "--screenshot", str(out), "--size", "280x240", *SET]) == 0
        screen.do("mousemove", 1, 1)
        shown = screen.picture(2 * panel.WIDTH, 280, 240)
        with Image.open(out) as image:
            assert np.array_equal(shown, np.asarray(image).astype(int))
        left, top, _, bottom = screen.frames[-1]["places"]["melanin"]
        screen.do("mousemove", round(2 * (left + 100)), round(top + bottom), "click", 1)
        screen.until(lambda f: f["look"]["melanin"] > 0.03)
        assert screen.close() == 0
    finally:
        screen.kill()


def test_without_a_display_the_line_says_what_to_do():
    environment = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    done = subprocess.run([sys.executable, "-m", "lutgen.cli", "view"], env=environment, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr.startswith("lutgen: no display for a window")
    assert "--screenshot FILE needs none" in done.stderr
    assert done.stderr.count("\n") == 1


def test_what_the_mouse_does_to_a_look():
    look = Look()
    assert window.turned(look, -1000, 0).azimuth == pytest.approx(look.azimuth + 400 - 360)
    assert window.turned(look, 0, 1000).elevation == 89
    assert window.relit(look, 0, -1000).light_elevation == 90
    assert window.zoomed(look, 100).distance_mm == looks.RANGES["distance_mm"][0]
    facing = replace(look, azimuth=0, elevation=0, target_mm=(0, 0, 0))
    moved = window.panned(facing, 10, 0, 360)
    per_pixel = 2 * facing.distance_mm * np.tan(np.radians(facing.field_of_view / 2)) / 360
    assert moved.target_mm == pytest.approx((-10 * per_pixel, 0, 0))
