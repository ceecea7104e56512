"""Axes: value to coordinate and back, cell order, interpolation, and bad axes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lutgen
from lutgen.tables.axes import Axis, Grid, default_grid

SPACINGS = ["linear", "cbrt", "log", "power:0.6"]


@pytest.mark.parametrize("spacing", SPACINGS)
@pytest.mark.parametrize("count", [2, 7, 16])
def test_nodes_and_coordinates_are_inverse(spacing, count):
    axis = Axis("melanin", "1", 0.001, 0.5, count, spacing)
    values = axis.values
    assert (values[0], values[-1]) == (0.001, 0.5)
    assert np.all(np.diff(values) > 0)
    assert np.abs(axis.position(values) - np.arange(count)).max() < 1e-9
    assert np.abs(axis.coordinate(values) - (np.arange(count) + 0.5) / count).max() < 1e-9


@settings(derandomize=True, max_examples=100)
@given(st.sampled_from(SPACINGS), st.floats(0, 1), st.floats(0.001, 0.5))
def test_warp_and_unwarp_are_inverse_both_ways(spacing, t, value):
    """Each step rounds by 1e-16 of a number below 1, or of a logarithm below 7."""
    axis = Axis("melanin", "1", 0.001, 0.5, 7, spacing)
    assert float(axis.warp(axis.unwarp(t))) == pytest.approx(t, abs=1e-14)
    assert float(axis.unwarp(axis.warp(value))) == pytest.approx(value, abs=1e-14)
    assert axis.unwarp(np.float32(t)).dtype == np.float32


@settings(derandomize=True, max_examples=100)
@given(st.sampled_from(SPACINGS), st.integers(2, 40), st.floats(0.001, 0.5))
def test_coordinate_is_the_stated_formula(spacing, count, value):
    axis = Axis("melanin", "1", 0.001, 0.5, count, spacing)
    warp = {"linear": lambda x: x, "cbrt": np.cbrt, "log": np.log, "power:0.6": lambda x: x**0.6}[spacing]
    t = (warp(value) - warp(0.001)) / (warp(0.5) - warp(0.001))
    assert float(axis.coordinate(value)) == pytest.approx((t * (count - 1) + 0.5) / count, abs=1e-12)


def test_values_outside_clamp_to_the_ends():
    axis = default_grid(16, 8, 16).melanin
    assert axis.coordinate([-1.0, 9.0]).tolist() == pytest.approx([0.5 / 16, 15.5 / 16])


def test_a_fixed_parameter_has_one_node_in_the_middle():
    axis = Axis("eumelanin", "1", 0.7, 0.7, 1)
    assert axis.values.tolist() == [0.7]
    assert float(axis.coordinate(0.7)) == 0.5


def test_interpolation_is_exact_for_trilinear_functions_and_at_nodes():
    grid = Grid(
        Axis("melanin", "1", 0.01, 0.5, 4), Axis("eumelanin", "1", 0.0, 1.0, 3), Axis("hemoglobin", "1", 0.01, 0.1, 5)
    )
    m, e, h = grid.nodes()
    cells = np.stack([m * e * h, m + 2 * e - h], axis=-1)
    rng = np.random.default_rng(0)
    x = rng.uniform([0.01, 0, 0.01], [0.5, 1, 0.1], (50, 3)).T
    found = grid.interpolate(cells, *x)
    assert np.abs(found - np.stack([x[0] * x[1] * x[2], x[0] + 2 * x[1] - x[2]], axis=-1)).max() < 1e-12
    assert np.abs(grid.interpolate(cells, m, e, h) - cells).max() < 1e-15


def test_cell_order_is_hemoglobin_eumelanin_melanin():
    grid = default_grid(3, 2, 4)
    m, e, h = grid.nodes()
    assert m.shape == (4, 2, 3)
    assert m[0, 0].tolist() == grid.melanin.values.tolist()
    assert e[0, :, 0].tolist() == [0, 1]
    assert h[:, 0, 0].tolist() == grid.hemoglobin.values.tolist()


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ((0.5, 0.001, 4), "low = 0.5 is above high = 0.001"),
        ((0.001, 0.5, 0), "count = 0: allowed is a whole number 1 to 256"),
        ((0.001, 0.5, 1), "count = 1 with low = 0.001 and high = 0.5"),
        ((0.1, 0.1, 3), "count = 3 with low = 0.1 and high = 0.1"),
        ((0.001, 0.5, 2.5), "count = 2.5"),
        ((0.0, 0.5, 4), "melanin axis: low = 0: allowed is 0.001 to 0.5"),
        ((0.001, 0.7, 4), "melanin axis: high = 0.7: allowed is 0.001 to 0.5"),
        ((float("nan"), 0.5, 4), "melanin axis: low = nan"),
        ((0.001, 0.5, 4, "square"), "spacing = 'square': allowed is linear, cbrt, log, power:p"),
        ((0.001, 0.5, 4, "power:7"), "spacing = 'power:7'"),
    ],
)
def test_bad_axes_are_named(values, message):
    with pytest.raises(lutgen.InputError, match=message):
        Axis("melanin", "1", *values)


def test_log_axis_cannot_start_at_zero():
    with pytest.raises(lutgen.InputError, match="log spacing needs a low above 0"):
        Axis("eumelanin", "1", 0.0, 1.0, 4, "log")
