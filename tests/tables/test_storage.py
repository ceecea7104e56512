"""LUT sets on disk: round trip, whole or absent, and every way a set can be wrong."""

import errno
import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import OpenEXR
import pytest

import lutgen
from lutgen.files import exr, folders
from lutgen.tables import storage


def test_round_trip_keeps_every_float(draft, draft_dir):
    loaded = storage.load(draft_dir)
    assert np.array_equal(loaded.color_lut.acescg, draft.color_lut.acescg.astype("f4"))
    assert np.array_equal(loaded.profile_lut.shape, draft.profile_lut.shape.astype("f4"))
    assert np.array_equal(loaded.profile_lut.clamped_share, draft.profile_lut.clamped_share.astype("f4"))
    assert np.array_equal(loaded.paths.energy, draft.paths.energy)
    assert np.array_equal(loaded.paths.mu_dermis, draft.paths.mu_dermis)
    assert (loaded.color_lut.grid, loaded.profile_lut.grid) == (draft.color_lut.grid, draft.profile_lut.grid)
    assert (
        np.abs(loaded.expand(oxygenation=0.5).color_lut.acescg - draft.expand(oxygenation=0.5).color_lut.acescg).max()
        < 1e-6
    )


def test_files_are_laid_out_as_the_manifest_says(draft, draft_dir):
    """Read by OpenEXR alone: strip order, rows, taps."""
    with OpenEXR.File(str(draft_dir / "color.exr")) as image:
        strip = np.array(image.parts[0].channels["RGB"].pixels)
        header = dict(image.parts[0].header)
    N_h, N_e, N_m = draft.color_lut.grid.shape
    assert strip.shape == (N_h, N_e * N_m, 3)
    assert strip.dtype == np.float32
    assert header["compression"] == OpenEXR.ZIP_COMPRESSION
    assert header["chromaticities"] == pytest.approx((0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767))
    for h, e, m in ((0, 0, 0), (5, 2, 7), (N_h - 1, N_e - 1, N_m - 1)):
        assert np.array_equal(strip[h, e * N_m + m], draft.color_lut.acescg[h, e, m].astype("f4"))
    parts = exr.read(draft_dir / "profile.exr")
    assert list(parts) == ["energy", "taps", "clamped"]
    energy, taps = parts["energy"].stack("RGB"), parts["taps"].channels
    assert energy.shape == (np.prod(draft.profile_lut.grid.shape), 64, 3)
    assert np.abs(energy.sum(axis=1) - 1).max() < 1e-5
    radius, red = taps["radius_mm"], taps["R"]
    assert radius.shape == (len(energy), 64)
    assert np.all(np.diff(radius, axis=1) >= 0)
    assert np.abs(np.maximum.reduce([taps[c] for c in "RGB"]) - red).max() <= 1
    widest = np.minimum.reduce([taps[c] for c in "RGB"])
    assert np.median(np.abs(widest - (np.arange(64) + 0.5) / 64)) < 1e-3


def test_tables_carry_their_own_meaning(draft_dir):
    written = json.loads((draft_dir / "manifest.json").read_text())
    for name in storage.EXR_FILES:
        for part in exr.read(draft_dir / name).values():
            for key in ("recipe", "quadrature", "trace", "optical_data", "meaning", "lutgen"):
                assert part.attributes[key] == written[key]
            assert not {"host", "baked_at", "seconds"} & set(part.attributes)
    assert written["trace"]["kernel"]
    assert written["error"]["color"]["skins"] == 1000
    assert sum(path.stat().st_size for path in draft_dir.iterdir()) < 5e6


def test_existing_folders_are_kept_unless_forced(draft, draft_dir, tmp_path):
    out = tmp_path / "set"
    shutil.copytree(draft_dir, out)
    before = (out / "color.exr").read_bytes()
    with pytest.raises(lutgen.InputError, match="exists; give another folder, or --force"):
        storage.save(draft, out)
    assert (out / "color.exr").read_bytes() == before
    other = lutgen.bake({"photons": 2048, "wavelengths": "6"})
    storage.save(other, out, force=True)
    assert (out / "color.exr").read_bytes() != before
    assert [path.name for path in tmp_path.iterdir()] == ["set"]


def test_odd_names_and_links(draft, tmp_path):
    """Pattern signs in a name, a leftover of this very process number, and a link to a set."""
    storage.save(draft, tmp_path / "a[*]")
    leftover = tmp_path / f".q.partial-{os.getpid()}-00000000"
    leftover.mkdir()
    real = storage.save(draft, tmp_path / "q")
    assert not leftover.exists()
    (tmp_path / "link").symlink_to(real)
    storage.save(draft, tmp_path / "link", force=True)
    assert (tmp_path / "link").is_symlink()
    assert {path.name for path in tmp_path.iterdir()} == {"a[*]", "q", "link"}


def test_a_killed_replacement_gives_the_old_set_back(draft_dir, tmp_path):
    shutil.copytree(draft_dir, tmp_path / ".set.old-999999999-00000000")
    with pytest.raises(lutgen.InputError, match="exists"):
        folders.check_target(tmp_path / "set", force=False)
    storage.load(tmp_path / "set")


def test_what_a_living_process_writes_is_left_alone(draft, tmp_path):
    busy = tmp_path / f".set.partial-{os.getppid()}-00000000"
    busy.mkdir()
    storage.save(draft, tmp_path / "set")
    assert busy.exists()


def test_a_failed_replacement_gives_the_old_set_back(draft, draft_dir, tmp_path, monkeypatch):
    out = tmp_path / "set"
    shutil.copytree(draft_dir, out)
    rename = type(out).rename

    def fails(path, target):
        if "partial" in path.name:
            raise OSError(errno.EIO, "Input/output error")
        return rename(path, target)

    monkeypatch.setattr(type(out), "rename", fails)
    with pytest.raises(lutgen.InputError, match="cannot be written"):
        storage.save(draft, out, force=True)
    monkeypatch.undo()
    storage.load(out)
    assert [path.name for path in tmp_path.iterdir()] == ["set"]


def test_every_file_is_synced_before_the_folder_takes_its_name(draft, tmp_path, monkeypatch):
    synced, sync = [], folders._sync

    def record(path):
        synced.append(path.name)
        assert (tmp_path / "set").exists() == (path == tmp_path)
        sync(path)

    monkeypatch.setattr(folders, "_sync", record)
    storage.save(draft, tmp_path / "set")
    assert {*storage.FILES, "manifest.json", tmp_path.name} <= set(synced)


def test_force_does_not_replace_what_is_no_set(draft, tmp_path):
    precious = tmp_path / "photos"
    precious.mkdir()
    (precious / "a.jpg").write_text("x")
    with pytest.raises(lutgen.InputError, match="not written by lutgen"):
        storage.save(draft, precious, force=True)
    assert (precious / "a.jpg").exists()


@pytest.mark.parametrize("out", ["/proc/luts", "{tmp}/no/such/parent"])
def test_unwritable_folders_are_refused(draft, tmp_path, out):
    with pytest.raises(lutgen.InputError, match="out = "):
        storage.save(draft, out.format(tmp=tmp_path))


@pytest.mark.parametrize("at", ["color.exr", "profile.exr", "paths.exr"])
def test_full_disk_leaves_nothing(draft, draft_dir, tmp_path, monkeypatch, at):
    write = exr.write

    def fails(path, parts):
        if path.name == at:
            raise OSError(errno.ENOSPC, "No space left on device")
        write(path, parts)

    monkeypatch.setattr(exr, "write", fails)
    old = tmp_path / "old"
    shutil.copytree(draft_dir, old)
    for out, force in ((tmp_path / "new", False), (old, True)):
        with pytest.raises(lutgen.MachineError, match="free some space"):
            storage.save(draft, out, force)
    monkeypatch.undo()
    assert [path.name for path in tmp_path.iterdir()] == ["old"]
    storage.load(old)


def test_a_real_full_disk_is_reported(draft):
    """/dev/full is always full; OpenEXR's own message becomes an OSError."""
    with pytest.raises(OSError, match=r"/dev/full"):
        exr.write(__import__("pathlib").Path("/dev/full"), storage._parts(draft)["color.exr"])


def copy_of(draft_dir, tmp_path):
    folder = tmp_path / "copy"
    shutil.copytree(draft_dir, folder)
    return folder


@pytest.mark.parametrize("name", storage.EXR_FILES)
@pytest.mark.parametrize("kind", ["truncated", "foreign", "absent", "another bake's"])
def test_broken_files_are_named(draft_dir, tmp_path, name, kind):
    folder = copy_of(draft_dir, tmp_path)
    path = folder / name
    if kind == "truncated":
        path.write_bytes(path.read_bytes()[:-500])
    elif kind == "foreign":
        path.write_bytes(b"not an image")
    elif kind == "absent":
        path.unlink()
    else:
        other = storage.save(lutgen.bake({"photons": 2048, "wavelengths": "6"}), tmp_path / "other")
        shutil.copy(other / name, path)
    with pytest.raises(lutgen.InputError, match=name):
        storage.load(folder)


@pytest.mark.parametrize("name", storage.EXR_FILES)
def test_files_of_another_bake_are_refused_even_with_a_matching_hash(draft_dir, tmp_path, name):
    folder = copy_of(draft_dir, tmp_path)
    jacques = lutgen.bake({"photons": 2048, "skin": {"scattering": "jacques"}})
    shutil.copy(storage.save(jacques, tmp_path / "other") / name, folder / name)
    _restamp(folder, name)
    with pytest.raises(lutgen.InputError, match="is not the manifest's"):
        storage.load(folder)


@pytest.mark.parametrize("name", storage.EXR_FILES)
@pytest.mark.parametrize("kind", ["truncated", "foreign"])
def test_broken_images_are_refused_even_with_a_matching_hash(draft_dir, tmp_path, name, kind):
    folder = copy_of(draft_dir, tmp_path)
    path = folder / name
    if kind == "truncated":
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    else:
        exr.write(path, [exr.Part("other", {"Y": np.zeros((2, 2), "f4")}, {})])
    _restamp(folder, name)
    with pytest.raises(lutgen.InputError, match="bake it anew"):
        storage.load(folder)


def _restamp(folder, name):
    facts = json.loads((folder / "manifest.json").read_text())
    facts["files"][name] = hashlib.sha256((folder / name).read_bytes()).hexdigest()
    (folder / "manifest.json").write_text(json.dumps(facts))


@pytest.mark.parametrize(
    "change",
    [
        lambda facts: facts["color_grid"]["melanin"].update(high=0.4),
        lambda facts: facts["profile_grid"]["hemoglobin"].update(count=9),
        lambda facts: facts["recipe"].update(seed=99),
        lambda facts: facts["quadrature"]["wavelength_nm"].__setitem__(0, 1.0),
        lambda facts: facts.pop("color_grid"),
        lambda facts: facts.update(format=99),
        lambda facts: facts.pop("files"),
        lambda facts: facts.update(files=[]),
        lambda facts: facts.update(format=True),
        lambda facts: facts.update(error="none"),
        lambda facts: facts.pop("trace"),
        lambda facts: facts.pop("extra_absorbers_per_mm"),
        lambda facts: facts["trace"].update(seed=7),
        lambda facts: facts.update(extra_absorbers_per_mm=3),
    ],
)
def test_manifest_and_images_that_disagree_are_refused(draft_dir, tmp_path, change):
    folder = copy_of(draft_dir, tmp_path)
    facts = json.loads((folder / "manifest.json").read_text())
    change(facts)
    (folder / "manifest.json").write_text(json.dumps(facts))
    with pytest.raises(lutgen.InputError, match="bake it anew"):
        storage.load(folder)


def test_folders_without_a_set_are_named(tmp_path):
    with pytest.raises(lutgen.InputError, match="no LUT set there"):
        storage.load(tmp_path)
    (tmp_path / "manifest.json").write_text("{broken")
    with pytest.raises(lutgen.InputError, match="cannot be read"):
        storage.load(tmp_path)


SAVER = """
import os, sys, lutgen
from lutgen.tables import preview, storage
luts = lutgen.load()
for out in sys.stdin:
    child = os.fork()
    if not child:
        storage.save(luts, out.strip())
        while True:
            storage.save(luts, out.strip(), force=True)
    print(child, flush=True)
    print(os.waitpid(child, 0)[0], flush=True)
"""
"""Forks a process for each folder that it reads, which saves there again and again; says when that one has ended."""


def test_killed_at_any_moment_a_set_is_whole_or_absent(tmp_path):
    """50 saves in a process that is killed at moments spread over two saves; then the next bake clears what is left."""
    rng = np.random.default_rng(0)
    whole = absent = 0
    command = [sys.executable, "-c", SAVER]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1) as saver:
        assert saver.stdin
        assert saver.stdout
        for attempt in range(50):
            folder = tmp_path / f"kill-{attempt}"
            folder.mkdir()
            out = folder / "set"
            saver.stdin.write(f"{out}\n")
            process = int(saver.stdout.readline())  # the first save begins
            time.sleep(float(rng.uniform(0, 0.4)))
            os.kill(process, signal.SIGKILL)
            assert int(saver.stdout.readline()) == process
            if out.exists():
                storage.load(out)
                whole += 1
            else:
                absent += 1
            folders.check_target(out, force=True)
            assert {path.name for path in folder.iterdir()} <= {"set"}
    assert whole
    assert absent


def test_a_killed_bake_leaves_nothing_or_a_whole_set(tmp_path):
    """The command itself, killed at moments from its imports to after its end, into the same folder each time."""
    out = tmp_path / "set"
    command = [sys.executable, "-m", "lutgen.cli", "bake", "--quality", "draft", "--force", "--out", str(out)]
    for delay in np.linspace(0.05, 1.6, 8):
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        time.sleep(float(delay))
        process.send_signal(signal.SIGKILL)
        process.wait()
        if out.exists():
            storage.load(out)
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    storage.load(out)
    assert [path.name for path in tmp_path.iterdir()] == ["set"]
