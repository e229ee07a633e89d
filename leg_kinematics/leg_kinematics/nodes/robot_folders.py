# SPDX-License-Identifier: Apache-2.0
"""Which robot descriptions a node reads for others: shipped ones, and those in certain folders.

Whoever is in the network may name a robot. Without these bounds a node would tell them, by its
answers, what is in any file of its machine.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from leg_kinematics.documents import shared_files
from leg_kinematics.errors import DescriptionError
from leg_kinematics.files import path_below

SUFFIXES = (".yaml", ".yml")


def find_allowed_robot(source: str, folders: Sequence[str]) -> Path:
    """Return the description of a shipped robot, or one in a folder.

    Args:
        source: Name of a shipped robot, or path of a YAML file: absolute, or from a folder.
        folders: Folders that descriptions may be in, at any depth; links do not lead out of them.

    Raises:
        DescriptionError: If it is neither; the message does not tell whether there is such a file.
    """
    shipped = shared_files("leg_bringup", "robots", ".yaml")
    if source in shipped:
        return shipped[source]
    for folder in folders:
        try:
            path = path_below(folder, source)
        except DescriptionError:
            continue
        if path.suffix in SUFFIXES and path.exists():
            return path
    raise DescriptionError(
        f"no robot {source!r}; shipped robots: {', '.join(sorted(shipped))}; or give the path of a "
        f"YAML file below {', '.join(folders)} (parameter robot_folders)"
    )
