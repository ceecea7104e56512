"""Folders and files that are there whole or not at all: written beside the target, synced, renamed."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from lutgen.errors import InputError, cannot_write, shown

MARK = "manifest.json"
"""What a folder that `force` may replace holds."""


@contextmanager
def whole(out: str | Path, force: bool = False, mark: str = MARK) -> Iterator[Path]:
    """A folder to write into that becomes `out` when the block ends well; nothing is left of it when it does not.

    With `force` an old folder that holds `mark` is first moved aside, then deleted. Raises InputError where `out`
    exists or cannot be written, MachineError on a full disk.
    """
    target = check_target(out, force, mark)
    partial, old = (_sibling(target, kind) for kind in ("partial", "old"))
    try:
        partial.mkdir()
        yield partial
        for path in (*partial.rglob("*"), partial):
            _sync(path)
        if target.exists():
            target.rename(old)
        partial.rename(target)
        _sync(target.parent)
    except OSError as error:
        raise cannot_write("out", out, error) from error
    finally:
        if old.exists() and not target.exists():
            old.rename(target)
        for leftover in (partial, old):
            shutil.rmtree(leftover, ignore_errors=True)


def check_file(name: str, path: str | Path, suffix: str) -> Path:
    """The path; InputError that names the option, before any work, where such a file cannot be written there."""
    path = Path(path)
    if path.suffix.lower() != suffix:
        raise InputError(f"{name} = {path}: the name of a file ending in {suffix} is needed")
    if path.is_dir():
        raise InputError(f"{name} = {path}: is a folder; give the name of a file ending in {suffix}")
    if not path.parent.is_dir():
        raise InputError(f"{name} = {path}: there is no folder {path.parent}; make it first")
    if not os.access(path.parent, os.W_OK | os.X_OK) or (path.exists() and not os.access(path, os.W_OK)):
        raise InputError(f"{name} = {path}: cannot be written; choose another place")
    return path


@contextmanager
def whole_file(name: str, out: str | Path) -> Iterator[Path]:
    """A file to write that becomes `out` when the block ends well; else `out` is as it was.

    Raises InputError, which names the option `name`, where `out` cannot be written, MachineError on a full disk.
    """
    target = Path(os.path.realpath(out))
    partial = target.with_name(f".{target.name[:150]}.{os.getpid()}-{secrets.token_hex(4)}{target.suffix}")
    try:
        yield partial
        _sync(partial)
        partial.replace(target)
    except OSError as error:
        raise cannot_write(name, out, error) from error
    finally:
        partial.unlink(missing_ok=True)


def check_target(out: str | Path, force: bool, mark: str = MARK) -> Path:
    """The real folder to write to; InputError, before any work, where a set cannot go there.

    Clears what killed bakes left, and brings back a set whose replacement was killed between its two renames.
    """
    if not str(out):
        raise InputError("out = '': the name of a folder is needed")
    try:
        target = Path(os.path.realpath(out))
        if len(os.fsencode(target.name)) > 200:
            raise InputError(f"out = {shown(str(out))}: the name is too long; allowed are 200 bytes")
        if target.parent.is_dir():
            _clear_leftovers(target)
        if target.exists():
            if not force:
                raise InputError(f"out = {out}: exists; give another folder, or --force to replace it")
            if not target.is_dir() or (any(target.iterdir()) and not (target / mark).exists()):
                raise InputError(
                    f"out = {out}: was not written by lutgen (it holds no {mark}), so --force does not replace it; "
                    "give another folder"
                )
        if not target.parent.is_dir():
            raise InputError(f"out = {out}: there is no folder {target.parent}; make it first")
        if not os.access(target.parent, os.W_OK | os.X_OK):
            raise InputError(f"out = {out}: folder {target.parent} cannot be written; choose another folder")
    except OSError as error:
        raise cannot_write("out", shown(str(out)), error) from error
    return target


def _clear_leftovers(target: Path) -> None:
    for leftover in list(target.parent.iterdir()):
        kind, _, rest = leftover.name.removeprefix(f".{target.name}.").partition("-")
        process = rest.partition("-")[0]
        if leftover.name.startswith(f".{target.name}.") and kind in ("partial", "old") and process.isdigit():
            if _running(int(process)):
                continue
            if kind == "old" and not target.exists():
                leftover.rename(target)
            else:
                shutil.rmtree(leftover, ignore_errors=True)


def _running(process: int) -> bool:
    """Whether another process of that number lives; one of this number is an earlier one's (containers reuse them)."""
    if process == os.getpid():
        return False
    if os.name == "nt":
        return True  # os.kill(process, 0) would interrupt it there; what it left stays
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True


def _sibling(target: Path, kind: str) -> Path:
    return target.parent / f".{target.name}.{kind}-{os.getpid()}-{secrets.token_hex(4)}"


def _sync(path: Path) -> None:
    """Flush a file or folder to disk; Windows wants files open for writing and has no such call for folders."""
    if os.name == "nt" and path.is_dir():
        return
    handle = os.open(path, os.O_RDWR if os.name == "nt" else os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
