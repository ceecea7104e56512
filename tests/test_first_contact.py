"""What a prompt or a notebook shows of the things that users hold."""

from dataclasses import replace

import lutgen
from lutgen.head import builtin
from lutgen.planning import needs, plan
from lutgen.scene.look import Look
from lutgen.tables import wavelengths


def test_a_repr_is_one_short_line():
    """What a prompt shows of each thing that users hold, arrays and all."""
    luts, fit = lutgen.load(), lutgen.fit("#b89985")
    skin = lutgen.Skin(0.0195, 0.7, 0.0088, 0.123456789, 0.0123456789, "jacques", "similarity")
    things = (
        luts, luts.color_lut, luts.profile_lut, luts.paths, luts.profile(0.02, 0.7, 0.01), luts.tissue, luts.absorbers,
        luts.color_lut.grid, luts.color_lut.grid.melanin, lutgen.Recipe(), replace(lutgen.Recipe(), skin=skin, seed=7),
        skin, lutgen.layers(skin, 550)[0], lutgen.reflectance(lutgen.layers(skin, 550)), fit, fit.data,
        builtin.builtin(), plan.least(needs.scene("light", tolerance=1.0)), needs.scene("light"), Look(),
        wavelengths.load("8"),
    )  # fmt: skip
    for thing in things:
        assert len(repr(thing)) <= 200
        assert "\n" not in repr(thing)
    assert repr(luts.color_lut).endswith("acescg=float32[16, 8, 16, 3])")
    assert eval(repr(skin), {"Skin": lutgen.Skin}) == skin
