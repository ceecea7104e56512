"""LUT sets on disk: color.exr, profile.exr, paths.exr, preview.png and manifest.json in one folder, whole or absent."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from pathlib import Path

import numpy as np

from lutgen.color import ACESCG_FROM_XYZ
from lutgen.errors import InputError, shown
from lutgen.files import exr, folders
from lutgen.skin import chromophores
from lutgen.solvers.paths import PathTable
from lutgen.tables.axes import Axis, Grid
from lutgen.tables.lut_set import ColorLut, LutSet, ProfileLut

FORMAT = 1
EXR_FILES = ("color.exr", "profile.exr", "paths.exr")
FILES = (*EXR_FILES, "preview.png")
FACTS = ("lutgen", "recipe", "meaning", "quadrature", "trace", "optical_data", "extra_absorbers_per_mm")
"""What every EXR part repeats of the manifest, and must agree in."""

MEANING = {
    "color": "share of incident light that leaves diffusely, light collimated along the normal from air; includes the "
    "entry transmission 1 - R_specular (0.9722 at n 1.4), excludes the specular part. Multiply irradiance by "
    "T(theta)/T(0) with your own Fresnel, never by 1 - F again. At other incidence the true value moves: "
    "R(60 deg)/R(0) is 0.91 to 1.28, hemispherical/R(0) 0.92 to 1.15, most on dark skin",
    "exit_lobe": "F_t(cos) cos / (0.923 pi) at n 1.4, F_t the Fresnel transmission outward: 1.053 x Lambert head-on",
    "space": "linear, unclipped, scene-referred ACEScg (AP1 primaries, ACES white), adapted from D65 by CAT02",
    "pipelines": "default: CIE 1931 2 degree functions under the CIE D65 spectrum; source: CIE 2015 2 degree functions "
    "under equal energy, XYZ scaled to the D65 white",
    "acescg_from_xyz_d65": ACESCG_FROM_XYZ.tolist(),
    "color_exr": "strip: within a tile melanin along x, tiles along eumelanin, hemoglobin along y, first row lowest",
    "texture_coordinate": "u = (x (N - 1) + 0.5) / N with x in 0 to 1 after the axis warp; a one-node axis has u = 0.5",
    "profile_exr": "part energy: row = node (melanin fastest, then eumelanin, then hemoglobin), column = ring, "
    "normalized per channel: totals come from color.exr. Part taps: node x 64 quantiles of the widest channel, "
    "radius in mm and encircled energy per channel. Part clamped: negative share cut off per node and channel",
    "paths_exr": "Laplace table: row = wavelength x ring, column = epidermis node x dermis node; "
    "share of incident light leaving in that ring at those absorptions (Chebyshev nodes in their cube roots)",
}


def grid_entry(grid: Grid) -> dict:
    """A grid's axes as plain values."""
    return {name: asdict(getattr(grid, name)) for name in chromophores.NAMES}


def _grid(entry: dict) -> Grid:
    return Grid(**{name: Axis(**axis) for name, axis in entry.items()})


def _parts(luts: LutSet) -> dict[str, list[exr.Part]]:
    """The EXR files' images; every file carries what its numbers depend on, and no time or host."""
    facts = {key: luts.manifest[key] for key in FACTS} | {"format": FORMAT}
    N_h, N_e, N_m = luts.color_lut.grid.shape
    strip = luts.color_lut.acescg.astype("f4").reshape(N_h, N_e * N_m, 3)
    color_facts = facts | {"grid": grid_entry(luts.color_lut.grid)}
    profile = luts.profile_lut
    nodes = int(np.prod(profile.grid.shape))
    edges = profile.radius_edges_mm.tolist()
    profile_facts = facts | {"grid": grid_entry(profile.grid), "radius_edges_mm": edges}
    energy = profile.shape.astype("f4").reshape(nodes, -1, 3)
    taps = profile.taps.astype("f4").reshape(nodes, -1, 4)
    taps_channels = {"radius_mm": taps[..., 0], **exr.rgb(taps[..., 1:])}
    clamped = profile.clamped_share.astype("f4").reshape(nodes, 1, 3)
    paths = luts.paths
    K, B, E, D = paths.energy.shape
    path_facts = facts | {
        "radius_edges_mm": edges, "wavelength_nm": paths.wavelength_nm.tolist(), "nu_per_mm": paths.nu_per_mm.tolist(),
        "mu_epidermis": paths.mu_epidermis.tolist(), "mu_dermis": paths.mu_dermis.tolist(),
        "photons": paths.photons, "entry": paths.entry,
    }  # fmt: skip
    return {
        "color.exr": [exr.Part("color", exr.rgb(strip), color_facts)],
        "profile.exr": [
            exr.Part("energy", exr.rgb(energy), profile_facts),
            exr.Part("taps", taps_channels, profile_facts),
            exr.Part("clamped", exr.rgb(clamped), profile_facts),
        ],
        "paths.exr": [exr.Part("paths", {"Y": paths.energy.reshape(K * B, E * D).astype("f4")}, path_facts)],
    }


def save(luts: LutSet, out: str | Path, force: bool = False, notes: dict | None = None) -> Path:
    """Write a set to the folder `out`; it is there whole or not at all. `notes` (times, host) go into the manifest.

    Raises InputError where `out` exists or cannot be written, MachineError on a full disk.

    >>> import lutgen, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     out = lutgen.save(lutgen.load().expand(oxygenation=0.4), f"{folder}/pale")
    ...     lutgen.load(out).oxygenation
    0.4
    """
    with folders.whole(out, force) as partial:
        for name, parts in _parts(luts).items():
            exr.write(partial / name, parts)
        from lutgen.tables import preview  # Pillow stays off the path of those who only load

        preview.draw(luts).save(partial / "preview.png")
        hashes = {name: _sha256(partial / name) for name in FILES}
        manifest = luts.manifest | {"format": FORMAT, "files": hashes} | (notes or {})
        (partial / "manifest.json").write_text(json.dumps(manifest, indent=1) + "\n", encoding="utf-8")
    return Path(out)


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def load(path: str | Path) -> LutSet:
    """Load and verify a set's folder; InputError where a file is missing, truncated, foreign or of another bake.

    >>> import lutgen
    >>> lutgen.load().color_lut.grid.shape
    (16, 8, 16)
    """
    if not isinstance(path, (str, Path)):
        raise InputError(f"path = {shown(path)}: the folder of a LUT set is needed")
    folder = Path(path)
    manifest = read_manifest(folder)
    try:
        images = {}
        for name in EXR_FILES:
            verify(folder, name, manifest)
            images[name] = exr.read(folder / name)
            for part in images[name].values():
                for key in FACTS:
                    if part.attributes[key] != manifest[key]:
                        raise ValueError(f"the {key} of {name} is not the manifest's")
        return _assemble(images, manifest)
    except InputError as error:
        raise InputError(
            f"{error}" if str(error).startswith(str(folder)) else f"{folder}: {error}; bake it anew"
        ) from error
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        raise InputError(f"{folder}: manifest and EXR files disagree ({error}); bake it anew") from error


def read_manifest(folder: Path) -> dict:
    """A set's manifest; InputError where the folder holds none that this version understands."""
    try:
        manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise InputError(f"{folder}: no LUT set there (no manifest.json); bake one with `lutgen bake`") from error
    except (OSError, ValueError) as error:
        raise InputError(f"{folder}: manifest.json cannot be read ({error}); bake it anew") from error
    version = manifest.get("format") if isinstance(manifest, dict) else None
    if type(version) is not int or version != FORMAT:
        raise InputError(f"{folder}: manifest format = {shown(version)}: this version reads {FORMAT}; bake it anew")
    missing = [key for key in (*FACTS, "color_grid", "profile_grid", "error", "files") if key not in manifest]
    if missing or not isinstance(manifest["files"], dict) or not isinstance(manifest["error"], (dict, type(None))):
        raise InputError(
            f"{folder}: manifest.json lacks {', '.join(missing) or 'files or error as tables'}; bake it anew"
        )
    return manifest


def verify(folder: Path, name: str, manifest: dict) -> None:
    """Raise InputError unless a file of the set is the one that its manifest names."""
    try:
        digest = _sha256(folder / name)
    except OSError as error:
        raise InputError(f"{folder / name}: cannot be read ({error.strerror}); bake the set anew") from error
    if digest != manifest["files"].get(name):
        raise InputError(f"{folder / name}: is not the file that manifest.json names (SHA-256 differs); bake it anew")


def _assemble(images: dict[str, dict[str, exr.Part]], manifest: dict) -> LutSet:
    strip = images["color.exr"]["color"]
    energy, clamped = (images["profile.exr"][name] for name in ("energy", "clamped"))
    stored = images["paths.exr"]["paths"]
    for part, key in ((strip, "color_grid"), (energy, "profile_grid")):
        if part.attributes["grid"] != manifest[key]:
            raise ValueError(f"the axes of {part.name} are not the manifest's {key}")
    color_grid, profile_grid = _grid(manifest["color_grid"]), _grid(manifest["profile_grid"])
    facts = stored.attributes
    mu_e, mu_d = np.array(facts["mu_epidermis"]), np.array(facts["mu_dermis"])
    edges = np.array(facts["radius_edges_mm"])
    paths = PathTable(
        np.array(facts["wavelength_nm"]), np.array(facts["nu_per_mm"]), edges, mu_e, mu_d,
        stored.channels["Y"].reshape(len(mu_e), len(edges) - 1, mu_e.shape[1], mu_d.shape[1]),
        facts["photons"], facts["entry"],
    )  # fmt: skip
    profile = ProfileLut(
        profile_grid, edges,
        energy.stack("RGB").reshape(*profile_grid.shape, len(edges) - 1, 3),
        clamped.stack("RGB").reshape(*profile_grid.shape, 3),
    )  # fmt: skip
    return LutSet(ColorLut(color_grid, strip.stack("RGB").reshape(*color_grid.shape, 3)), profile, paths, manifest)
