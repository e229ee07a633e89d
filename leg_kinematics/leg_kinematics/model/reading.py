# SPDX-License-Identifier: Apache-2.0
"""Reads a robot model, whichever of the known kinds of file it is."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from leg_kinematics.documents import Document, mapping_schema
from leg_kinematics.errors import DescriptionError
from leg_kinematics.model.mjcf import read_mjcf
from leg_kinematics.model.tree import FRAME, Closure, ModelTree
from leg_kinematics.model.urdf import expanded_xacro, read_urdf, read_xml

BALL, WELD = ("3d", "3D"), ("6d", "6D")
_PAIRS = {
    "type": "array",
    "items": {"type": "array", "items": {"type": "string"}, "minItems": 2, "maxItems": 2},
    "maxItems": 100,
}
EXTENDED_URDF = {
    **mapping_schema({}, []),
    "properties": {
        "closed_loop": _PAIRS,
        "type": {"type": "array", "items": {"enum": [*BALL, *WELD]}, "maxItems": 100},
        "name_mot": {"type": "string", "minLength": 1},
    },
    "required": ["closed_loop", "type"],
    "additionalProperties": True,
}


def read_model(path: Path) -> ModelTree:
    """Read a URDF, xacro or MJCF file.

    Raises:
        DescriptionError: If it is none or anything in it is wrong.
    """
    if path.suffix == ".xacro":
        return read_urdf(path, expanded_xacro(path))
    tag = read_xml(path).tag
    if tag == "robot":
        return read_urdf(path)
    if tag == "mujoco":
        return read_mjcf(path)
    raise DescriptionError(f"{path}: a <{tag}> file; allowed: <robot> (URDF), <mujoco> (MJCF)")


def read_closures(path: Path, tree: ModelTree) -> tuple[list[Closure], str]:
    """Read the loops of an "extended URDF": a YAML file beside the URDF of its tree.

    Its `closed_loop` lists pairs of links whose frames coincide, and `type` says how: "3d" in a
    point (a ball), "6d" in a frame (a weld). Joints with `name_mot` in their names are actuated.

    Returns:
        The loops, and `name_mot`, "" if it is not told.

    Raises:
        DescriptionError: If anything in it is wrong.
    """
    document = Document(path)
    document.check(EXTENDED_URDF)
    pairs, kinds = document.root["closed_loop"], document.root["type"]
    if len(pairs) != len(kinds):
        message = f"{len(kinds)} types of {len(pairs)} loops; allowed: one each"
        raise document.error(message, "type")
    closures = []
    for k, (pair, kind) in enumerate(zip(pairs, kinds, strict=True)):
        for link in pair:
            if link not in tree.links:
                message = f"unknown link {link!r}; allowed: {', '.join(tree.links)}"
                raise document.error(message, "closed_loop", k)
        points = np.zeros((1, 3)) if kind in BALL else FRAME
        closures.append(Closure(pair[0], points, pair[1], points, f"{path}: closed_loop {k}"))
    return closures, str(document.root.get("name_mot", ""))
