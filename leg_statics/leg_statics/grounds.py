# SPDX-License-Identifier: Apache-2.0
"""Grounds by name: the range of static friction that each offers to the foot."""

from __future__ import annotations

import os
from dataclasses import dataclass

from leg_kinematics.documents import NUMBER, Document, mapping_schema, named_schema, shared_files
from leg_kinematics.errors import UnknownNameError
from leg_kinematics.files import existing_path

GROUNDS_SCHEMA = mapping_schema(
    {
        "grounds": named_schema(
            mapping_schema(
                {
                    "friction": {
                        "type": "array",
                        "items": {**NUMBER, "minimum": 0},
                        "minItems": 2,
                        "maxItems": 2,
                    }
                },
                ["friction"],
            )
        )
    },
    ["grounds"],
)


@dataclass(frozen=True)
class Ground:
    """A kind of ground.

    Attributes:
        name: Its name.
        friction_low: Smallest static friction coefficient to count on.
        friction_high: Largest one that was measured.
    """

    name: str
    friction_low: float
    friction_high: float


@dataclass(frozen=True)
class Grounds:
    """The grounds that a planner may name."""

    by_name: dict[str, Ground]

    def find(self, name: str) -> Ground:
        """Return a ground.

        Raises:
            UnknownNameError: If there is none of that name.
        """
        try:
            return self.by_name[name]
        except (KeyError, TypeError):  # what has no hash is no name
            raise UnknownNameError("ground", name, self.by_name) from None


def load_grounds(source: str | os.PathLike[str] = "grounds") -> Grounds:
    """Load a grounds file.

    Args:
        source: Path of a YAML file; by default the one that ships with `leg_bringup`.

    Raises:
        DescriptionError: If the file is missing or wrong.
    """
    shipped = shared_files("leg_bringup", ".", "grounds.yaml")
    document = Document(shipped.get(str(source)) or existing_path("grounds file", source))
    document.check(GROUNDS_SCHEMA)
    grounds = {}
    for name, entry in document.root["grounds"].items():
        low, high = (float(value) for value in entry["friction"])
        if low > high:
            message = f"{[low, high]}: the low end must be <= the high end"
            raise document.error(message, "grounds", name, "friction")
        grounds[name] = Ground(name, low, high)
    return Grounds(grounds)
