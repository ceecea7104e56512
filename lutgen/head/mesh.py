"""Heads from files: glTF, GLB and OBJ as triangles in millimetres, with normals, texture coordinates and pictures."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from lutgen.errors import InputError, MachineError, in_range, missing, summary
from lutgen.files import images

SUFFIXES = (".glb", ".gltf", ".obj")
HEAD_MM, BUST_MM = 250.0, 380.0
MM_PER_UNIT = (1e-6, 1e6)
_LEE = "https://raw.githubusercontent.com/mrdoob/three.js/r187/examples/models/gltf/LeePerrySmith/"
SCANS = {
    "lee-perry-smith": {
        "attribution": "Infinite, 3D Head Scan by Lee Perry-Smith, www.triplegangers.com, CC-BY 3.0",
        "mm_per_unit": 47.5,
        "flip_v": True,  # its coordinates are v-up though glTF's are v-down
        "files": {
            "head": (_LEE + "LeePerrySmith.glb", "402b8a8ac9f03232e6d64b5962929703a069daf99d3c49ac8eb0e48bedc9c576"),
            "albedo": (_LEE + "Map-COL.jpg", "e976d73b31407f8d0967412bf468019ed26a5d5a32cf5811aabff7e816458a65"),
            "normal": (
                _LEE + "Infinite-Level_02_Tangent_SmoothUV.jpg",
                "36925e51ad9b324b94e8faf4692da1b4132809f2762bb8d5bd549ffd215d4ca6",
            ),
        },
    }
}  # fmt: skip
"""Scans that are fetched by name and known again by content: where from, with which SHA-256, and whom to name."""
_SHORT_NAMES = {"albedo": "albedo.jpg", "normal": "normal_tangent.jpg"}


@dataclass(frozen=True)
class Mesh:
    """Positions in mm [V, 3], normals [V, 3], texture coordinates [V, 2] (v up) or None, triangles [T, 3].

    `textures`: pictures [rows, columns, 3] by name, first row lowest. `notes`: what was guessed or is missing.
    """

    positions_mm: np.ndarray
    normals: np.ndarray
    uv: np.ndarray | None
    triangles: np.ndarray
    textures: dict[str, np.ndarray] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    attribution: str = ""

    __repr__ = summary


def of(name: str, mm_per_unit: float | None = None, flip_v: bool = False) -> Mesh:
    """The scan of that name or the head of that file; a file that is a known scan is read as the scan is.

    A known scan brings its own scale unless one is given, and its own direction of v.
    """
    if name in SCANS:
        return scan(name)
    path = Path(name)
    mark = _sha256(path) if path.is_file() else ""
    known = next((entry for entry in SCANS.values() if entry["files"]["head"][1] == mark), None)
    return load(path, mm_per_unit, flip_v) if known is None else _scanned(known, path, mm_per_unit)


def load(path: Path, mm_per_unit: float | None = None, flip_v: bool = False) -> Mesh:
    """A head of a file; without `mm_per_unit` its height decides, and a note says so.

    `flip_v` is for files whose v runs the other way than their format's.

    Raises InputError for a file that is missing, of another kind, broken, without triangles or with NaN.
    """
    path = Path(path)
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"mesh {path}: allowed is {', '.join(SUFFIXES)}")
    if not path.is_file():
        raise InputError(f"mesh {path}: there is no such file")
    if mm_per_unit is not None:
        mm_per_unit = in_range("mm_per_unit", mm_per_unit, *MM_PER_UNIT)
    whole = _read(path)
    positions = np.asarray(whole.vertices, float)
    triangles = np.asarray(whole.faces, "i4")
    if not len(triangles):
        raise InputError(f"mesh {path}: holds no triangles")
    if not np.all(np.isfinite(positions)):
        raise InputError(f"mesh {path}: holds NaN or infinite positions; export it anew")
    low, high = positions.min(axis=0), positions.max(axis=0)
    if not np.all(high > low):
        raise InputError(f"mesh {path}: is flat, {high[0] - low[0]:g} x {high[1] - low[1]:g} x {high[2] - low[2]:g}")
    notes = []
    if mm_per_unit is None:
        mm_per_unit, note = _guess(high - low)
        notes.append(note)
    uv, lack = _coordinates(whole)
    if uv is None:
        notes.append(f"{path.name} {lack}: maps, freckles, occlusion and thickness are left out; unwrap it")
    elif flip_v:
        uv[:, 1] = 1 - uv[:, 1]
    positions = (positions - (low + high) / 2) * mm_per_unit
    return Mesh(
        positions.astype("f4"), normals(positions, triangles), uv, triangles, _pictures(whole), tuple(notes)
    )  # fmt: skip


def _coordinates(whole) -> tuple[np.ndarray | None, str]:
    """Texture coordinates [V, 2], or None and what is wrong with them."""
    uv = getattr(whole.visual, "uv", None)
    if uv is None or len(uv) != len(whole.vertices):
        return None, "has no texture coordinates"
    if not np.all(np.isfinite(uv)):
        return None, "has texture coordinates that are NaN"
    return np.asarray(uv, "f4").copy(), ""


def _read(path: Path):
    try:
        import trimesh
    except ImportError as error:
        raise missing("meshes need trimesh", "view") from error
    try:
        scene = trimesh.load(path, process=False)
        parts = list(scene.geometry.values()) if isinstance(scene, trimesh.Scene) else [scene]
        parts = [part for part in parts if isinstance(part, trimesh.Trimesh)]
        if not parts:
            raise InputError(f"mesh {path}: holds no triangles")
        if len(parts) == 1 and not isinstance(scene, trimesh.Scene):
            return parts[0]
        return scene.to_mesh() if isinstance(scene, trimesh.Scene) else parts[0]
    except InputError:
        raise
    except Exception as error:  # trimesh's readers raise whatever their parsers do
        raise InputError(f"mesh {path}: cannot be read ({type(error).__name__}: {error})") from error


def _guess(extent: np.ndarray) -> tuple[float, str]:
    """Millimetres per unit of a head or bust of that extent [3]: known units first, else by its height."""
    bust = extent[0] > 1.2 * extent[1] or extent[1] > 1.8 * extent[2]
    expected = BUST_MM if bust else HEAD_MM
    for unit, scale in (("mm", 1.0), ("cm", 10.0), ("m", 1000.0), ("inch", 25.4)):
        if 0.6 < extent[1] * scale / expected < 1.6:
            return scale, f"guessed the unit: 1 unit is 1 {unit} ({extent[1] * scale:.0f} mm high); else --mm-per-unit"
    scale = expected / float(extent[1])
    return scale, f"guessed the size: 1 unit is {scale:.3g} mm ({expected:.0f} mm high); else --mm-per-unit"


def _pictures(whole) -> dict[str, np.ndarray]:
    """Pictures of a mesh's material, 8-bit, first row lowest."""
    material = getattr(whole.visual, "material", None)
    named = {"albedo": ("baseColorTexture", "image"), "normal": ("normalTexture",)}
    pictures = {}
    for name, attributes in named.items():
        picture = next((p for p in (getattr(material, a, None) for a in attributes) if p is not None), None)
        if picture is not None:
            pictures[name] = np.asarray(picture.convert("RGB"))[::-1].copy()
    return pictures


def normals(positions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Unit normals [V, 3], of corners at the same place together, weighted by area."""
    _, same = np.unique(np.round(positions, 5), axis=0, return_inverse=True)
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    faces = np.cross(b - a, c - a)
    total = np.zeros((same.max() + 1, 3))
    for k in range(3):
        np.add.at(total, same[triangles[:, k]], faces)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    unit = np.where(length > 0, total / np.where(length > 0, length, 1), [0.0, 0.0, 1.0])
    return unit[same].astype("f4")


def scan(name: str) -> Mesh:
    """A scan that is fetched once by its address and SHA-256, with its attribution; MachineError where offline."""
    known = SCANS[name]
    paths = {part: _fetch(*source) for part, source in known["files"].items()}
    return _scanned(known, paths["head"], None, {part: path for part, path in paths.items() if part != "head"})


def _scanned(known: dict, path: Path, mm_per_unit: float | None, pictures: dict[str, Path] | None = None) -> Mesh:
    """A known scan from its file, with its pictures from where they are said to be or from beside it."""
    shape = load(path, known["mm_per_unit"] if mm_per_unit is None else mm_per_unit, known["flip_v"])
    textures, notes = {}, list(shape.notes)
    for part, short in _SHORT_NAMES.items():
        url, mark = known["files"][part]
        beside = [path.parent / name for name in (short, Path(url).name)]
        places = beside if pictures is None else [pictures[part]]
        place = next((p for p in places if p.is_file() and _sha256(p) == mark), None)
        if place is None:
            notes.append(f"the scan's {part} map does not lie beside it ({short} or {Path(url).name}): left out")
            continue
        textures[part] = images.read(place, "picture").pixels[::-1].copy()
    return replace(shape, textures=textures, notes=tuple(notes), attribution=known["attribution"])


def _sha256(path: Path) -> str:
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error


def _fetch(url: str, sha256: str) -> Path:
    try:
        import pooch
    except ImportError as error:
        raise missing("fetching needs pooch", "view") from error
    try:
        name = Path(url).name
        return Path(
            pooch.retrieve(url, f"sha256:{sha256}", fname=name, path=pooch.os_cache("lutgen"), progressbar=False)
        )
    except Exception as error:  # pooch passes on what requests and the disk raise
        reason = " ".join(str(error).split())[:120]
        raise MachineError(f"{url}: cannot be fetched ({reason}); get it yourself and give --mesh FILE") from error
