"""Any head with texture coordinates is painted where its own lips, cheeks and ears are."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from lutgen.head import builtin, mesh, paint
from lutgen.head import face as placing

SIDE = 512


def moved() -> mesh.Mesh:
    """The built-in head 12 % larger, elsewhere, of no known origin, its texture turned by a quarter."""
    shape = builtin.builtin()
    assert shape.uv is not None
    turned = np.stack([1 - shape.uv[:, 1], shape.uv[:, 0]], axis=1)
    return replace(
        shape, positions_mm=(1.12 * shape.positions_mm + [17, -80, 33]).astype("f4"), uv=turned, attribution=""
    )


def at_vertices(shape: mesh.Mesh, picture: np.ndarray) -> np.ndarray:
    assert shape.uv is not None
    u, v = np.clip((shape.uv * SIDE).astype(int), 0, SIDE - 1).T
    return picture[v, u]


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    """The built-in head and the moved one, each with its maps."""
    with pytest.MonkeyPatch.context() as patch:
        shapes = builtin.builtin(), moved()
        patch.setenv("LUTGEN_CACHE", str(tmp_path_factory.mktemp("cache")))
        patch.setattr(paint, "MAP_SIZE", SIDE)
        yield [(shape, paint.paint(shape), paint.notes(shape)) for shape in shapes]


def test_a_head_moved_and_scaled_gets_its_own_paint_back(both):
    (shape, own, _), (other, painted, said) = both
    assert said == ()
    face = (shape.positions_mm[:, 2] > 40) & (shape.positions_mm[:, 1] > -115)
    ears = (np.abs(shape.positions_mm[:, 0]) > 72) & (np.abs(shape.positions_mm[:, 1] + 7) < 40)
    for channel, where, least in ((0, face, 0.85), (2, face, 0.9), (2, ears, 0.75)):
        a, b = at_vertices(shape, own["chromophores"])[where], at_vertices(other, painted["chromophores"])[where]
        assert np.corrcoef(a[:, channel], b[:, channel])[0, 1] > least, channel
    assert paint.origin_mm(shape).tolist() == [0, 0, 0]
    assert paint.origin_mm(other) == pytest.approx([17, -80, 33], abs=2)
    lips = [at_vertices(s, maps["chromophores"])[:, 2] > 2.2 for s, maps in ((shape, own), (other, painted))]
    assert (lips[0] & lips[1]).sum() > 0.85 * (lips[0] | lips[1]).sum() > 100


def test_open_sky_is_the_same_and_thickness_grows_with_the_head(both):
    (shape, own, _), (other, painted, _) = both
    a, b = at_vertices(shape, own["surface"]), at_vertices(other, painted["surface"])
    assert np.abs(a[:, 2] - b[:, 2]).mean() < 0.03
    thin = (a[:, 3] < 0.5) & (b[:, 3] < 0.6) & (np.abs(shape.positions_mm[:, 0]) > 75)
    assert thin.sum() > 200
    assert np.median(b[thin, 3] / a[thin, 3]) == pytest.approx(1.12, abs=0.08)


def test_other_proportions_are_found_too():
    """A longer nose, a broader face and ears lower down: landmarks still meet theirs."""
    shape = builtin.builtin()
    p = shape.positions_mm.astype(float)
    y = np.interp(p[:, 1], [-200, -107.5, -65.5, -49.5, -35.5, -2.5, 106], [-210, -115, -70, -52, -34, 4, 115])
    other = replace(shape, positions_mm=np.stack([1.08 * p[:, 0], y, p[:, 2]], axis=1).astype("f4"), attribution="")
    fit = placing.place(other)
    assert fit is not None
    back = fit.into(other.positions_mm.astype(float))
    mouth = np.linalg.norm(p - [0, -66, 93], axis=1) < 30
    nose = np.linalg.norm(p - [0, -36, 108], axis=1) < 15
    ear = (np.abs(p[:, 0]) > 75) & (np.abs(p[:, 1]) < 35)
    for where, most in ((mouth, 2.0), (nose, 2.0), (ear, 4.0)):
        assert np.quantile(np.linalg.norm(back - p, axis=1)[where], 0.9) < most


def test_what_has_no_face_is_mottled_and_said_so(tmp_path, monkeypatch):
    monkeypatch.setenv("LUTGEN_CACHE", str(tmp_path))
    monkeypatch.setattr(paint, "MAP_SIZE", 128)
    ball = trimesh.creation.uv_sphere(radius=120, count=[32, 32])
    positions, triangles = np.array(ball.vertices, "f4"), np.array(ball.faces, "i4")
    around = np.arctan2(positions[:, 0], positions[:, 2]) / (2 * np.pi) + 0.5
    uv = np.stack([around, positions[:, 1] / 240 + 0.5], axis=1).astype("f4")
    shape = mesh.Mesh(positions, mesh.normals(positions, triangles), uv, triangles)
    assert placing.place(shape) is None
    maps = paint.paint(shape)
    assert "no face found" in paint.notes(shape)[0]
    assert maps["chromophores"][..., 2].max() < 2.2
    assert maps["chromophores"][..., 0].max() < 2.2
    assert np.all(np.isfinite(maps["surface"]))
    assert paint.paint(replace(shape, uv=None)) == {}
    assert paint.notes(replace(shape, uv=None)) == ()


@pytest.mark.parametrize(("scale", "lack"), [(0.0, "have no area"), (90.0, "cover the texture")])
def test_texture_coordinates_that_cannot_be_painted_by_are_said(scale, lack):
    shape = builtin.builtin()
    assert shape.uv is not None
    other = replace(shape, uv=scale * shape.uv, attribution="")
    assert paint.paint(other) == {}
    assert lack in paint.notes(other)[0]


def test_texture_coordinates_beyond_the_texture_wrap_around():
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "f4")
    triangles = np.array([[0, 1, 2], [0, 2, 3]], "i4")
    values = np.linspace(0, 1, 4)[:, None]
    inside = mesh.Mesh(square, square, square[:, :2] * 0.5, triangles)
    beyond = replace(inside, uv=inside.uv + np.array([-3, 5], "f4"))
    drawn, wrapped = (paint._in_texture(s, values, 32) for s in (inside, beyond))
    assert np.array_equal(drawn, wrapped)
    across = paint._in_texture(replace(inside, uv=inside.uv + np.array([0.75, 0], "f4")), values, 32)
    assert across[:16, :8] == pytest.approx(drawn[:16, 8:16], abs=1e-6)
