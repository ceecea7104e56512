"""The device: how many lanes kernels are built for."""

import pytest

from lutgen import device as ocl
from lutgen.errors import InputError


@pytest.fixture
def listed_anew():
    """Devices are listed once a process; here before and after."""
    ocl.devices.cache_clear()
    yield
    ocl.devices.cache_clear()


@pytest.mark.parametrize("lanes", ocl.LANES)
def test_lanes_of_a_cpu_are_what_the_environment_says(lanes, listed_anew, monkeypatch):
    monkeypatch.setenv("LUTGEN_LANES", str(lanes))
    assert {device.lanes for device in ocl.devices() if device.kind == "cpu"} == {lanes}


@pytest.mark.parametrize("asked", ["7", "08", "wide", "32", "-8"])
def test_other_lanes_are_refused_in_one_line(asked, listed_anew, monkeypatch):
    monkeypatch.setenv("LUTGEN_LANES", asked)
    with pytest.raises(InputError, match=rf"^LUTGEN_LANES = '{asked}': allowed is 1, 4, 8, 16, or unset$"):
        ocl.devices()
