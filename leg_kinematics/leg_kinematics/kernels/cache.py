# SPDX-License-Identifier: Apache-2.0
"""Where compiled kernels are kept: a folder that only this user can write, for it gets executed."""

from __future__ import annotations

import contextlib
import fcntl
import os
import stat
import tempfile
import warnings
from collections.abc import Iterator
from pathlib import Path

from leg_kinematics.errors import DescriptionError
from leg_kinematics.files import user_path

OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
ROOT, NOBODY = 0, 65534  # sandboxes show what belongs to root outside as nobody's


def cache_folder(name: str) -> Path | None:
    """Return a folder of the cache that is safe to load from, or None, after a warning.

    The cache is below NUMBA_CACHE_DIR, XDG_CACHE_HOME or ~/.cache, the first that can be written.

    Args:
        name: Name of the folder.
    """
    roots = [os.environ.get("NUMBA_CACHE_DIR"), os.environ.get("XDG_CACHE_HOME"), "~/.cache"]
    for root in filter(None, roots):
        try:
            cache = user_path(root).resolve() / "leg_kernels"
            folder = cache / name
            cache.mkdir(mode=0o700, parents=True, exist_ok=True)
            folder.mkdir(mode=0o700, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                danger = _danger(cache, folder)
        except (OSError, DescriptionError):
            continue
        if not danger:
            return folder
        _warn(f"the kernel cache {cache} is not used: {danger}")
        return None
    _warn("no writable cache folder (set XDG_CACHE_HOME to one)")
    return None


@contextlib.contextmanager
def process_lock(folder: Path | None) -> Iterator[None]:
    """Let one process at a time compile into a folder; the others then load what it compiled.

    Without it, nodes that start together write over each other's files, and numba loads machine
    code under an index that belongs to another compilation.
    """
    if folder is None:
        yield
        return
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # closing the file gives it back
        yield
        for path in folder.rglob("*"):  # whatever this process' umask allows to others
            mode = path.stat().st_mode
            if mode & OTHERS_WRITE:
                path.chmod(stat.S_IMODE(mode) & ~OTHERS_WRITE)


def _danger(cache: Path, folder: Path) -> str:
    """Say how someone else could have put code there, and what to do; "" if nobody could."""
    user = os.geteuid()
    for path in (cache, folder, *folder.rglob("*")):
        status = path.lstat()
        if status.st_uid != user:
            return f"{path} belongs to user {status.st_uid}, not to user {user}; remove {cache}"
        if not (stat.S_ISDIR(status.st_mode) or stat.S_ISREG(status.st_mode)):
            return f"{path} is no file; remove {cache}"
        if status.st_mode & OTHERS_WRITE:
            return f"others can write {path}; remove {cache}, or `chmod -R go-w` it if all are you"
    for path in cache.parents:
        status = path.stat()
        mine = status.st_uid in (user, ROOT, NOBODY)
        if not mine or (_others_write(status) and not status.st_mode & stat.S_ISVTX):
            return f"others can exchange what is in {path}; set XDG_CACHE_HOME to your own folder"
    return ""


def _others_write(status: os.stat_result) -> bool:
    """Whether others can write a folder; the group of a user's own name has no one else in it."""
    foreign_group = status.st_gid != os.getegid()
    return bool(status.st_mode & stat.S_IWOTH or (status.st_mode & stat.S_IWGRP and foreign_group))


def _warn(reason: str) -> None:
    warnings.warn(f"{reason}; kernels compile anew in every process", stacklevel=2)
