# SPDX-License-Identifier: Apache-2.0
"""Files that people name: where they are, and their text if it is a file of a sensible size."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from leg_kinematics.errors import DescriptionError, KindError

_KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


def user_path(path: str | os.PathLike[str]) -> Path:
    """Return a path with `~` and `~user` written out.

    Raises:
        DescriptionError: If there is no such home, as for a user whom this machine does not know.
        KindError: If it is no path.
    """
    try:
        return Path(path).expanduser()
    except TypeError:
        raise KindError(f"a path must be text or a Path, got {type(path).__name__}") from None
    except RuntimeError:
        home = Path(path).parts[0]
        raise DescriptionError(
            f"{path}: this machine knows no home folder {home!r}; give a path without it, or set "
            "HOME"
        ) from None


def path_below(folder: str | os.PathLike[str], path: str | os.PathLike[str]) -> Path:
    """Return an absolute path in a folder, with all links and `..` followed.

    Args:
        folder: The folder; it need not exist.
        path: The path: absolute, or from the folder.

    Raises:
        DescriptionError: If it leads out of the folder, or cannot be followed.
    """
    try:
        top = user_path(folder).resolve()
        found = (top / user_path(path)).resolve()
    except (OSError, RuntimeError, ValueError) as error:  # endless links, null bytes
        raise DescriptionError(f"{str(path)!r}: cannot be followed: {error}") from None
    if not found.is_relative_to(top):
        raise DescriptionError(f"{path}: allowed: a path below {top}")
    return found


def existing_path(what: str, path: str | os.PathLike[str]) -> Path:
    """Return a path with its `~` written out.

    Args:
        what: What should be there, for the message.
        path: The path.

    Raises:
        DescriptionError: If there is nothing.
    """
    found = user_path(path)
    if not exists(found):
        raise DescriptionError(f"{what} {found} does not exist")
    return found


def exists(path: Path) -> bool:
    """Whether there is something at a path; False also for a path that cannot be one."""
    return os.path.exists(path)  # noqa: PTH110  pathlib raises where a name is too long


def read_text(path: Path, largest: int) -> str:
    """Return the text of a regular file.

    Nothing is waited for: pipes and devices, which may never end, are refused unread.

    Args:
        path: The file.
        largest: How many bytes it may have.

    Raises:
        DescriptionError: If it cannot be read, is no regular file or is larger.
    """
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            kind = _KINDS.get(stat.S_IFMT(status.st_mode), "no file")
            raise DescriptionError(f"{path}: is {kind}; allowed: a regular file")
        with path.open("rb") as file:
            content = file.read(largest + 1)
    except OSError as error:
        raise DescriptionError(f"{path}: {error.strerror}") from None
    except ValueError as error:  # a null byte in the path
        raise DescriptionError(f"{str(path)!r}: {error}") from None
    if len(content) > largest:
        size = max(status.st_size, len(content))
        raise DescriptionError(f"{path}: {size} bytes; allowed: at most {largest}")
    try:
        return content.decode()
    except UnicodeDecodeError as error:
        raise DescriptionError(
            f"{path}: byte {error.start} is no text in UTF-8 ({error.reason})"
        ) from None
