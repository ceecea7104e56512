"""Heads from files: what is read, what is guessed and said, and one line for what is not a mesh."""

import hashlib

import numpy as np
import pytest
import trimesh
from trimesh.visual import material, texture

import lutgen
from lutgen.head import mesh


def ball(scale: float, uv: bool = True) -> trimesh.Trimesh:
    """A ball about as high as a head, `scale` units per millimetre."""
    sphere = trimesh.creation.uv_sphere(radius=120 * scale, count=[16, 16])
    if uv:
        picture = material.PBRMaterial(baseColorTexture=_red_above())
        heights = (sphere.vertices[:, 2] / scale + 120) / 240
        sphere.visual = texture.TextureVisuals(np.stack([heights * 0 + 0.5, heights], axis=1), picture)
    return sphere


def _red_above():
    from PIL import Image

    pixels = np.zeros((4, 4, 3), "u1")
    pixels[:2, :, 0] = 255  # the top half
    return Image.fromarray(pixels)


@pytest.mark.parametrize("suffix", ["glb", "obj"])
@pytest.mark.parametrize(("scale", "unit"), [(1.0, "mm"), (0.1, "cm"), (0.001, "m")])
def test_units_are_guessed_and_said(tmp_path, suffix, scale, unit):
    ball(scale, uv=False).export(tmp_path / f"head.{suffix}")
    guessed = mesh.load(tmp_path / f"head.{suffix}")
    assert np.ptp(guessed.positions_mm, axis=0) == pytest.approx([240, 240, 240], rel=0.02)
    assert f"1 unit is 1 {unit}" in guessed.notes[0]
    assert "no texture coordinates" in guessed.notes[1]
    assert guessed.uv is None
    said = mesh.load(tmp_path / f"head.{suffix}", mm_per_unit=2.0)
    assert np.ptp(said.positions_mm[:, 0]) == pytest.approx(480 * scale, rel=0.02)
    assert not any("guessed" in note for note in said.notes)


def test_texture_coordinates_run_up_and_pictures_lie_bottom_row_first(tmp_path):
    ball(1.0).export(tmp_path / "head.glb")
    head = mesh.load(tmp_path / "head.glb")
    assert head.uv is not None
    top = head.positions_mm[:, 2].argmax()
    assert head.uv[top, 1] == pytest.approx(1, abs=1e-3)
    picture = head.textures["albedo"]
    assert picture[-1, 0].tolist() == [255, 0, 0]
    assert picture[0, 0].tolist() == [0, 0, 0]


def test_parts_are_merged(tmp_path):
    left, right = ball(1.0, uv=False), ball(1.0, uv=False)
    right.apply_translation([300, 0, 0])
    trimesh.Scene([left, right]).export(tmp_path / "two.glb")
    merged = mesh.load(tmp_path / "two.glb", mm_per_unit=1.0)
    assert len(merged.triangles) == 2 * len(left.faces)
    assert np.ptp(merged.positions_mm[:, 0]) == pytest.approx(540, rel=0.02)


def test_normals_are_unit_outward_and_shared_where_corners_meet(tmp_path):
    ball(1.0).export(tmp_path / "head.glb")
    head = mesh.load(tmp_path / "head.glb", mm_per_unit=1.0)
    outward = (head.normals * head.positions_mm).sum(axis=1) / np.linalg.norm(head.positions_mm, axis=1)
    assert outward.min() > 0.97
    assert np.linalg.norm(head.normals, axis=1) == pytest.approx(np.ones(len(head.normals)), abs=1e-5)
    doubled = np.concatenate([head.positions_mm, head.positions_mm])
    again = mesh.normals(doubled.astype(float), np.concatenate([head.triangles, head.triangles + len(doubled) // 2]))
    assert np.array_equal(again[: len(doubled) // 2], again[len(doubled) // 2 :])


def test_what_is_no_mesh_is_one_line(tmp_path):
    for name, content, message in (
        ("head.stl", "", "allowed is .glb, .gltf, .obj"),
        ("broken.glb", "nothing", "cannot be read"),
        ("empty.obj", "v 0 0 0\nv 1 0 0\nv 0 1 1\n", "triangles|cannot be read"),
        ("nan.obj", "v nan 0 0\nv 1 0 0\nv 0 1 1\nf 1 2 3\n", "NaN"),
        ("flat.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "is flat"),
    ):
        path = tmp_path / name
        path.write_text(content)
        with pytest.raises(lutgen.InputError, match=message) as caught:
            mesh.load(path)
        assert name in str(caught.value)
        assert "\n" not in str(caught.value)
    with pytest.raises(lutgen.InputError, match="no such file"):
        mesh.load(tmp_path / "none.glb")
    ball(1.0, uv=False).export(tmp_path / "head.glb")
    with pytest.raises(lutgen.InputError, match="mm_per_unit = 0"):
        mesh.load(tmp_path / "head.glb", mm_per_unit=0.0)


def test_texture_coordinates_that_are_nan_are_said_and_left(tmp_path):
    sphere = ball(1.0, uv=False)
    lines = [f"v {x} {y} {z}\nvt nan nan" for x, y, z in sphere.vertices]
    lines += ["f " + " ".join(f"{k + 1}/{k + 1}" for k in face) for face in sphere.faces]
    (tmp_path / "head.obj").write_text("\n".join(lines))
    head = mesh.load(tmp_path / "head.obj", 1.0)
    assert head.uv is None
    assert "has texture coordinates that are NaN: maps, freckles" in head.notes[0]


def test_v_can_be_turned_over(tmp_path):
    ball(1.0).export(tmp_path / "head.glb")
    up, down = (mesh.load(tmp_path / "head.glb", 1.0, flip_v=flip) for flip in (False, True))
    assert up.uv is not None
    assert down.uv is not None
    assert down.uv[:, 1] == pytest.approx(1 - up.uv[:, 1])
    assert np.array_equal(down.uv[:, 0], up.uv[:, 0])
    again = mesh.of(str(tmp_path / "head.glb"), 1.0, flip_v=True).uv
    assert again is not None
    assert np.array_equal(again, down.uv)


def test_a_file_that_is_a_known_scan_is_read_as_one(tmp_path, monkeypatch):
    """Known by its content, whatever its name; pictures beside it count only if they are the scan's own."""
    ball(1.0).export(tmp_path / "some.glb")
    _red_above().save(tmp_path / "albedo.jpg")
    marks = {name: hashlib.sha256((tmp_path / name).read_bytes()).hexdigest() for name in ("some.glb", "albedo.jpg")}
    known = {
        "mm_per_unit": 2.0, "flip_v": True, "attribution": "Somebody, CC-BY",
        "files": {"head": ("x/Head.glb", marks["some.glb"]), "albedo": ("x/A.jpg", marks["albedo.jpg"]),
                  "normal": ("x/N.jpg", "0" * 64)},
    }  # fmt: skip
    plain = mesh.load(tmp_path / "some.glb", 1.0)
    monkeypatch.setattr(mesh, "SCANS", {"somebody": known})
    scan = mesh.of(str(tmp_path / "some.glb"))
    assert scan.attribution == "Somebody, CC-BY"
    assert scan.positions_mm == pytest.approx(2 * plain.positions_mm, rel=1e-5)
    assert plain.uv is not None
    assert scan.uv is not None
    assert scan.uv[:, 1] == pytest.approx(1 - plain.uv[:, 1])
    assert list(scan.textures) == ["albedo"]
    assert "normal map does not lie beside it (normal_tangent.jpg or N.jpg)" in scan.notes[0]
    assert mesh.of(str(tmp_path / "some.glb"), 3.0).positions_mm == pytest.approx(3 * plain.positions_mm, rel=1e-5)
    (tmp_path / "albedo.jpg").write_bytes(b"another picture")
    assert mesh.of(str(tmp_path / "some.glb")).textures == {}
    ball(1.1).export(tmp_path / "other.glb")
    assert mesh.of(str(tmp_path / "other.glb")).attribution == ""


def test_a_scan_offline_says_so(monkeypatch):
    import pooch

    def offline(*args, **options):
        raise ConnectionError("no route\nto host")

    monkeypatch.setattr(pooch, "retrieve", offline)
    with pytest.raises(lutgen.MachineError, match=r"LeePerrySmith.glb: cannot be fetched \(no route to host\)"):
        mesh.scan("lee-perry-smith")
    assert all(len(sha) == 64 for _, sha in mesh.SCANS["lee-perry-smith"]["files"].values())
