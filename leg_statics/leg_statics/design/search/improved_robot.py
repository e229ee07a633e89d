# SPDX-License-Identifier: Apache-2.0
"""A robot's description with other dimensions for its legs of one mechanism."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap

from leg_kinematics.description import UNITS
from leg_kinematics.documents import Document
from leg_kinematics.geometry import geometry_parameters
from leg_kinematics.mechanisms import MECHANISMS


def improved_robot(
    description: Document, leg_type: str, changes: Mapping[str, float], name: str, comment: str
) -> str:
    """Return a robot description (YAML) in which all legs of a mechanism have new dimensions.

    Every leg whose type has the same mechanism as the changed one takes the new type; mounts, joint
    names and legs of other mechanisms stay.

    Args:
        description: The robot as it is.
        leg_type: The leg type from which the new one differs.
        changes: New dimensions by name [SI].
        name: Name of the new leg type.
        comment: What to write at the top.
    """
    root = _plain(description.root)
    types, legs = root["leg_types"], root["legs"]
    mechanism = types[leg_type]["mechanism"]
    dimensions = {
        f.name: f.metadata["dimension"] for f in geometry_parameters(MECHANISMS[mechanism])
    }
    units = {key: UNITS[key][unit] for key, unit in root["units"].items()} | {"ratio": 1.0}
    geometry = {key: value / units[dimensions[key]] for key, value in changes.items()}
    dimensioned = CommentedMap({**types[leg_type]["geometry"], **geometry})
    dimensioned.fa.set_block_style()
    new = {**types[leg_type], "geometry": dimensioned}
    replaced = {key for key, other in types.items() if other["mechanism"] == mechanism}
    root["leg_types"] = {
        name: new,
        **{key: other for key, other in types.items() if key not in replaced},
    }
    for leg in legs.values():
        if leg["type"] in replaced:
            leg["type"] = name
    text = io.StringIO()
    text.writelines(f"# {line}\n" for line in comment.splitlines())
    yaml = YAML()
    yaml.default_flow_style = None  # what holds no mapping or list fits in one line
    yaml.dump(root, text)
    return text.getvalue()


def _plain(root: Any) -> Any:
    """Return a document as plain mappings, lists and numbers: no anchors, merges, comments."""
    return json.loads(json.dumps(root))
