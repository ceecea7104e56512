"""preview.png and the swatch: colors stand where the axes say, and every shape of grid can be drawn."""

import numpy as np
import pytest
from PIL import Image

from lutgen import color
from lutgen.skin.tissue import Skin, preset
from lutgen.solvers import profiles
from lutgen.solvers.paths import PathTable
from lutgen.tables import preview
from lutgen.tables.axes import Axis, Grid, default_grid
from lutgen.tables.lut_set import ColorLut, LutSet, ProfileLut

MANIFEST = {
    "lutgen": "0.1.0",
    "recipe": {
        "pipeline": "default",
        "totals": "monte-carlo",
        "skin": {"oxygenation": 0.7, "epidermis_mm": 0.1, "scattering": "source"},
    },
    "quadrature": {"wavelength_nm": [450.0, 550.0, 650.0]},
    "trace": {"photons_per_wavelength": 4096},
    "extra_absorbers_per_mm": {},
    "error": {
        "color": {"delta_e00_max": 0.3, "delta_e00_p95": 0.2, "skins": 1000, "compared_with": "adding-doubling at 5 nm"}
    },
}
NO_PATHS = PathTable(*(np.empty(0) for _ in range(6)), photons=1, entry=1.0)  # a picture needs none


def luts_over(grid: Grid, cells: np.ndarray, **manifest) -> LutSet:
    """A set with those colors [N_h, N_e, N_m, 3] and, at every node, rings that hold 1 : 2 : 3 ... of the light."""
    edges = profiles.ring_edges(16)
    rings = np.broadcast_to(np.arange(1.0, 17)[:, None] / 136, (*grid.shape, 16, 3))
    profile = ProfileLut(grid, edges, rings, np.zeros((*grid.shape, 3)))
    return LutSet(ColorLut(grid, cells), profile, NO_PATHS, MANIFEST | manifest)


def random_cells(grid: Grid) -> np.ndarray:
    return np.random.default_rng(0).uniform(0, 1, (*grid.shape, 3))


def axes(melanin: tuple, eumelanin: tuple, hemoglobin: tuple) -> Grid:
    """A grid of (low, high, count, spacing) per axis."""
    named = zip(("melanin", "eumelanin", "hemoglobin"), (melanin, eumelanin, hemoglobin), strict=True)
    return Grid(*(Axis(name, "1", *values) for name, values in named))


ONE_MELANIN = (0.02, 0.02, 1, "linear")
ONE_EUMELANIN = (0.3, 0.3, 1, "linear")
ONE_HEMOGLOBIN = (0.01, 0.01, 1, "linear")
# None covers the presets' eumelanin ratio, 0.7, so no mark stands on a node.
GRIDS = {
    "cbrt": axes((0.001, 0.5, 16, "cbrt"), (0.0, 0.6, 8, "linear"), (0.001, 0.1, 16, "cbrt")),
    "log and power": axes((0.01, 0.2, 33, "log"), (0.0, 0.5, 2, "linear"), (0.001, 0.1, 7, "power:0.4")),
    "linear": axes((0.0123, 0.0456, 5, "linear"), (0.8, 1.0, 3, "linear"), (0.02, 0.03, 11, "linear")),
    "one tile": axes((0.001, 0.5, 200, "cbrt"), ONE_EUMELANIN, (0.001, 0.1, 100, "cbrt")),
    "one melanin": axes(ONE_MELANIN, (0.0, 0.6, 4, "linear"), (0.001, 0.1, 8, "cbrt")),
    "one hemoglobin": axes((0.001, 0.5, 16, "cbrt"), (0.0, 0.6, 4, "linear"), ONE_HEMOGLOBIN),
    "one node": axes(ONE_MELANIN, ONE_EUMELANIN, ONE_HEMOGLOBIN),
}


@pytest.mark.parametrize("grid", GRIDS.values(), ids=GRIDS.keys())
def test_each_node_has_its_color_at_its_texture_coordinate(grid):
    luts = luts_over(grid, random_cells(grid))
    picture = preview.draw(luts)
    assert picture.size == (preview.WIDTH, preview.HEIGHT)
    pixels = np.asarray(picture, int)
    srgb = color.encode_srgb(color.from_acescg(luts.color_lut.acescg, "srgb"))
    for e, (left, top, right, bottom) in preview.tile_boxes(grid):
        x = (left + grid.melanin.coordinate(grid.melanin.values) * (right - left)).astype(int)
        y = np.ceil(bottom - grid.hemoglobin.coordinate(grid.hemoglobin.values) * (bottom - top)).astype(int) - 1
        off = np.abs(pixels[y[:, None], x] - 255 * srgb[:, e])
        assert off.max() < 1  # a byte rounds by a half


def test_tiles_span_the_eumelanin_axis_and_hold_the_one_nearest_the_presets():
    assert [e for e, _ in preview.tile_boxes(default_grid(16, 8, 16))] == [0, 5, 7]
    assert [e for e, _ in preview.tile_boxes(GRIDS["linear"])] == [0, 1, 2]
    assert [e for e, _ in preview.tile_boxes(GRIDS["one tile"])] == [0]


def test_low_hemoglobin_is_at_the_bottom_and_low_melanin_at_the_left():
    grid = default_grid(16, 8, 16)
    m, _, h = grid.nodes()
    cells = np.stack([m / m.max(), h / h.max(), 0 * h], axis=-1)
    pixels = np.asarray(preview.draw(luts_over(grid, cells)), int)
    _, (left, top, right, bottom) = preview.tile_boxes(grid)[0]
    red, green = pixels[top:bottom, left:right, 0], pixels[top:bottom, left:right, 1]
    assert green[-1, 0] < green[0, 0]
    assert red[-1, 0] < red[-1, -1]


def test_presets_are_circled_where_they_belong_and_nowhere_else():
    grid = default_grid(16, 8, 16)
    pixels = np.asarray(preview.draw(luts_over(grid, np.full((*grid.shape, 3), 0.3))), int)
    for e, (left, top, right, bottom) in preview.tile_boxes(grid):
        marks = np.ptp(pixels[top:bottom, left:right].reshape(-1, 3), axis=0).any()
        assert marks == (e == 5)
        if e == 5:
            for skin in map(preset, preview.MARKED):
                x = left + grid.melanin.coordinate(skin.melanin) * (right - left)
                y = bottom - grid.hemoglobin.coordinate(skin.hemoglobin) * (bottom - top)
                ring = pixels[int(y), int(x) + 3 : int(x) + 6].mean(axis=-1)
                assert ring.max() > 200  # the white of a circle on gray


def test_a_missing_error_leaves_its_corner_empty():
    grid = default_grid(4, 2, 4)
    told, untold = (
        np.asarray(preview.draw(luts_over(grid, random_cells(grid), **more)), int)[:70, 850:]
        for more in ({}, {"error": None})
    )
    assert told.min() < 100
    assert untold.min() == 255


def test_the_picture_is_deterministic():
    luts = luts_over(default_grid(4, 2, 4), random_cells(default_grid(4, 2, 4)))
    assert preview.draw(luts).tobytes() == preview.draw(luts).tobytes()


def result_of(linear_srgb: list[float], sigma: float) -> dict:
    """What `lutgen swatch` hands over, with a made-up spectrum."""
    nm = np.arange(380.0, 781, 5)
    return {
        "wavelength_nm": nm.tolist(),
        "reflectance": (0.1 + 0.4 * (nm - 380) / 400).tolist(),
        "std_error": (np.full_like(nm, sigma)).tolist(),
        "linear_srgb": linear_srgb,
        "srgb_hex": color.hex_code(linear_srgb),
        "lab": [63.7, 8.4, 17.1],
        "method": "path-table",
        "pipeline": "default",
    }


@pytest.mark.parametrize("linear_srgb", [[0.45, 0.29, 0.2], [1.2, 0.5, -0.01]])
def test_swatch_shows_the_color(linear_srgb):
    picture = preview.draw_swatch(preset("light"), result_of(linear_srgb, 0.0))
    assert "#" + bytes(np.asarray(picture)[100, 100]).hex() == color.hex_code(linear_srgb)


def test_swatch_shades_the_standard_error_only_where_there_is_one():
    def band(sigma: float) -> int:
        picture: Image.Image = preview.draw_swatch(Skin(0.1, 0.5, 0.02), result_of([0.4, 0.3, 0.2], sigma))
        return int((np.asarray(picture) == 0xC9).all(axis=-1).sum())

    assert band(0.0) < 200  # edges of letters happen on the same gray
    assert band(0.02) > 5000


def test_swatch_of_black_and_of_saidi_skin_can_be_drawn():
    black = result_of([0.0, 0.0, 0.0], 0.0) | {"reflectance": [0.0] * 81}
    assert preview.draw_swatch(Skin(0.5, 1.0, 0.1, scattering="saidi"), black).size == (800, 400)
