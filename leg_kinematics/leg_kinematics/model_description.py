# SPDX-License-Identifier: Apache-2.0
"""Legs of robot models in a robot description: which file, which feet, and what the file lacks.

    model:
      file: solo12.urdf                     # from this file's folder, or package://<package>/<path>;
                                            # URDF, xacro or MJCF
      base: base_link                       # optional, default the first link that none carries
      closures:                             # of loops, optional; an MJCF file has its own
        - {first: {link: rod, point: [0, 0, -0.1]}, second: {link: shin, point: [0.02, 0, 0]}}
                                            # a ball; with an `axis` beside each point, a pin
      closures_file: loops.yaml             # optional, the same as "extended URDF"
      actuated: [hip, crank]                # optional, default all of a chain without loops, else
                                            # those with an effort limit
      joint_limits: {hip: [-1, 1]}          # optional, in place of the file's
      effort_limits: {hip: 40}              # optional, in place of the file's [N.m or N]
      masses: {shin: 0.3}                   # optional, in place of the file's, by link [kg]
    legs:
      left_front:
        foot: lf_foot                       # a link, or {link: lf_shin, position: [0, 0, -0.2]}
        assembly: {initial: {hip: 0.5}}     # optional, positions of joints in each assembly mode
        held: [lf_wheel]                    # optional, joints that stay at zero
        frame: left_front_leg               # optional, default <leg>_leg

Lengths and angles of the description are in its units, by default metres and radians; points and
positions are in the frames of their links. Joints have the file's names. The leg frame stands on
the first joint on the way to the foot, with the axes of the base.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from leg_kinematics.arrays import FloatArray
from leg_kinematics.bodies import LegTree
from leg_kinematics.documents import FOREIGN_NAME, PAIR, VECTOR, Document, mapping_schema
from leg_kinematics.errors import DescriptionError, GeometryError, UnknownNameError
from leg_kinematics.files import existing_path
from leg_kinematics.mechanism import Joint
from leg_kinematics.mechanisms.leg_of_tree import leg_of_tree
from leg_kinematics.mechanisms.model_leg import ModelLeg
from leg_kinematics.model.chain import place_bodies
from leg_kinematics.model.leg_tree import Foot, leg_tree, with_numbers
from leg_kinematics.model.reading import read_closures, read_model
from leg_kinematics.model.tree import Closure, ModelTree
from leg_kinematics.placed_joints import PIN_LENGTH
from leg_kinematics.robot import Body, Leg, Mount

EFFORT = {
    "description": "a number >= 0 (symmetric) or a pair [lower, upper]",
    "oneOf": [{"type": "number", "minimum": 0}, PAIR],
}
TEXT = {"type": "string", "minLength": 1, "maxLength": 1000}
TEXTS = {"type": "array", "items": TEXT, "maxItems": 1000}
MODE = {"type": "string", "pattern": r"^[A-Za-z][A-Za-z0-9_+]*$"}  # of the papers' legs, too
_END = mapping_schema({"link": TEXT, "point": VECTOR, "axis": VECTOR}, ["link", "point"])


def _by_name(schema: Mapping[str, Any]) -> dict[str, Any]:
    return {"type": "object", "maxProperties": 1000, "additionalProperties": schema}


MODEL_SCHEMA = mapping_schema(
    {
        "file": TEXT,
        "base": TEXT,
        "closures": {
            "type": "array",
            "items": mapping_schema({"first": _END, "second": _END}, ["first", "second"]),
            "maxItems": 100,
        },
        "closures_file": TEXT,
        "actuated": TEXTS,
        "joint_limits": _by_name(PAIR),
        "effort_limits": _by_name(EFFORT),
        "masses": _by_name({"type": "number", "minimum": 0}),
    },
    ["file"],
)
MODEL_LEG_SCHEMA = mapping_schema(
    {
        "foot": {
            "description": "the name of a link, or {link: name, position: [x, y, z]}",
            "oneOf": [TEXT, mapping_schema({"link": TEXT, "position": VECTOR}, ["link"])],
        },
        "assembly": {
            "type": "object",
            "minProperties": 1,
            "maxProperties": 64,
            "propertyNames": MODE,
            "additionalProperties": _by_name({"type": "number"}),
        },
        "held": TEXTS,
        "frame": FOREIGN_NAME,
    },
    ["foot"],
)


def effort_range(document: Document, joint: Joint, *where: Any) -> tuple[float, float]:
    """Return least and most effort of a joint in a description.

    Raises:
        DescriptionError: If no effort is not between them.
    """
    value = document.node(*where)
    lower, upper = value if isinstance(value, Sequence) else (-value, value)
    if not lower <= 0.0 <= upper:
        message = f"{[lower, upper]}: must be lower <= 0 <= upper [{joint.effort_unit}]"
        raise document.error(message, *where)
    return float(lower), float(upper)


class ModelDescription:
    """What a description says of its model.

    Attributes:
        tree: The robot of the file, with the description's masses and closures.
        base: Name of the link that carries the legs.
    """

    def __init__(self, document: Document, units: Mapping[str, float]) -> None:
        """Read the model.

        Raises:
            DescriptionError: If there is a mistake in the description or in the model.
        """
        self.document = document
        self.units = units
        entry = document.node("model")
        path = model_path(document, entry["file"], "file")
        tree = read_model(path)
        tree = replace(tree, links=self._with_masses(tree))
        self._motors = ""
        closures = [*tree.closures, *(self._closure(tree, k) for k in range(self._count(entry)))]
        if "closures_file" in entry:
            extended = model_path(document, entry["closures_file"], "closures_file")
            loops, self._motors = read_closures(extended, tree)
            closures += loops
        self.tree = replace(tree, closures=tuple(closures))
        self.base = entry.get("base", tree.root)
        if self.base not in tree.links:
            raise self._unknown("link", self.base, tree.links, "model", "base")
        self._joints = {joint.name: joint for joint in tree.joints.values()}
        for key in ("joint_limits", "effort_limits"):
            for name in entry.get(key, {}):
                self._check_joint(name, "model", key, name)
        for k, name in enumerate(entry.get("actuated", [])):
            self._check_joint(name, "model", "actuated", k)

    def leg(self, name: str) -> Leg:
        """Return a leg of the model.

        Raises:
            DescriptionError: If the chain makes no leg, or an effort limit is missing.
        """
        mechanism, tree = self.mechanism(name)
        missing = [j.name for j in tree.joints if j.name in mechanism.actuated and j.effort is None]
        if missing:
            raise self.document.error(
                f"no effort limit of {', '.join(missing)}: give them in model.effort_limits",
                *("legs", name),
            )
        efforts = {joint.name: joint.effort for joint in tree.joints}
        return Leg(
            name=name,
            leg_type=name,
            mechanism=mechanism,
            mount=Mount(np.array(tree.origin), np.eye(3)),
            frame=self.document.node("legs", name).get("frame", f"{name}_leg"),
            joint_names=mechanism.actuated,
            passive_joint_names=mechanism.closure_names,
            effort_limits=np.array([efforts[joint] for joint in mechanism.actuated]),
        )

    def body(self) -> Body | None:
        """Return mass and centre of the robot, each leg in its initial posture.

        None if the file does not tell the masses of a leg, or no mass at all. Links that no leg
        moves are where all joints at zero put them.
        """
        legs = [
            self.mechanism(name)
            for name, leg in self.document.root["legs"].items()
            if "foot" in leg
        ]
        frames = self.tree.frames(self.base)
        carried = {
            link
            for _, chain in legs
            for joint in chain.joints
            for link in self.tree.below(self._joints[joint.name].child)
        }
        parts = [
            (link.mass, frames[name][1] + frames[name][0] @ link.centre)
            for name, link in self.tree.links.items()
            if name in frames and name not in carried and link.mass is not None
        ]
        parts += [
            (mass, np.array(chain.origin) + centre)
            for leg, chain in legs
            for mass, centre in _masses(chain, np.array(leg.postures[0][1]))
        ]
        mass = sum(m for m, _ in parts)
        if not 0.0 < mass < np.inf:
            return None
        x, y, z = (float(sum(m * centre[k] for m, centre in parts) / mass) for k in range(3))
        return Body(float(mass), (x, y, z))

    def mechanism(self, name: str) -> tuple[ModelLeg, LegTree]:
        """Return the mechanism of a leg, which may lack effort limits, and its chain.

        Raises:
            DescriptionError: If the chain makes no leg.
        """
        entry = self.document.node("legs", name)
        foot = entry["foot"]
        position = (0.0, 0.0, 0.0)
        if isinstance(foot, Mapping):
            x, y, z = (v * self.units["length"] for v in foot.get("position", (0, 0, 0)))
            position, foot = (x, y, z), foot["link"]
        try:
            tree = leg_tree(self.tree, self.base, Foot(str(foot), position), entry.get("held", ()))
            tree = self._with_limits(tree)
            present = {joint.name for joint in tree.joints}
            driven = [joint for joint in self._actuated() if joint in present]
            return leg_of_tree(tree, driven, self._assembly(name)), tree
        except (GeometryError, UnknownNameError) as error:
            raise self.document.error(str(error), "legs", name) from None

    def _actuated(self) -> list[str]:
        """Return the names of the actuated joints; none if nothing is told."""
        if self._motors:
            return [name for name in self._joints if self._motors in name]
        return list(self.document.node("model").get("actuated", ()))

    def _assembly(self, name: str) -> dict[str, dict[str, float]]:
        told: dict[str, dict[str, float]] = {}
        for mode, values in self.document.node("legs", name).get("assembly", {}).items():
            told[str(mode)] = {}
            for joint, value in values.items():
                self._check_joint(joint, "legs", name, "assembly", mode, joint)
                told[str(mode)][str(joint)] = float(value) * self._scale(joint)
        return told

    def _with_limits(self, tree: LegTree) -> LegTree:
        entry = self.document.node("model")
        ranges, efforts = {}, {}
        for joint in tree.joints:
            if joint.name in entry.get("joint_limits", {}):
                where = ("model", "joint_limits", joint.name)
                lower, upper = self.document.node(*where)
                if not lower < upper:
                    raise self.document.error(f"{[lower, upper]}: lower must be < upper", *where)
                scale = self._scale(joint.name)
                ranges[joint.name] = (lower * scale, upper * scale)
            if joint.name in entry.get("effort_limits", {}):
                where = ("model", "effort_limits", joint.name)
                efforts[joint.name] = effort_range(
                    self.document, Joint(joint.name, joint.type), *where
                )
        return with_numbers(tree, ranges, efforts)

    def _with_masses(self, tree: ModelTree) -> dict[str, Any]:
        links = dict(tree.links)
        for name, mass in self.document.node("model").get("masses", {}).items():
            if name not in links:
                raise self._unknown("link", name, links, "model", "masses", name)
            links[name] = links[name]._replace(mass=float(mass))
        return links

    def _count(self, entry: Mapping[str, Any]) -> int:
        return len(entry.get("closures", ()))

    def _closure(self, tree: ModelTree, k: int) -> Closure:
        where = ("model", "closures", k)
        ends = []
        for side in ("first", "second"):
            end = self.document.node(*where, side)
            if end["link"] not in tree.links:
                raise self._unknown("link", end["link"], tree.links, *where, side, "link")
            points = [np.array(end["point"], dtype=np.float64) * self.units["length"]]
            if "axis" in end:
                axis = np.array(end["axis"], dtype=np.float64)
                if not axis.any():
                    raise self.document.error("an axis must not be zero", *where, side, "axis")
                points.append(points[0] + PIN_LENGTH * axis / np.linalg.norm(axis))
            ends.append((str(end["link"]), np.array(points)))
        (first, one), (second, other) = ends
        if len(one) != len(other):
            raise self.document.error("an axis must stand at both points or at none", *where)
        return Closure(first, one, second, other, str(self.document.error("", *where)).rstrip(": "))

    def _scale(self, joint: str) -> float:
        """Return the unit of a joint's position."""
        return self.units["length" if self._joints[joint].type == "prismatic" else "angle"]

    def _check_joint(self, name: str, *where: Any) -> None:
        if name not in self._joints:
            movable = [n for n, joint in self._joints.items() if joint.type != "fixed"]
            raise self._unknown("joint", name, movable, *where)

    def _unknown(self, kind: str, name: str, allowed: Any, *where: Any) -> DescriptionError:
        return self.document.error(str(UnknownNameError(kind, str(name), allowed)), *where)


def _masses(leg: LegTree, q: FloatArray) -> Iterator[tuple[float, FloatArray]]:
    """Yield mass and centre in the leg frame of each body of a leg at joint positions (N,)."""
    bodies = len(leg.joints) + 1
    rotations, origins = np.zeros((bodies, 3, 3)), np.zeros((bodies, 3))
    place_bodies(leg.chain, q, rotations, origins, np.zeros((bodies - 1, 3)))
    for k, joint in enumerate(leg.joints, start=1):
        yield joint.mass, origins[k] + rotations[k] @ joint.centre


def model_path(document: Document, file: str, key: str) -> Path:
    """Return the path of a file that a description names.

    Raises:
        DescriptionError: If there is none.
    """
    try:
        if file.startswith("package://"):
            package, _, rest = file.removeprefix("package://").partition("/")
            return _in_package(package, rest)
        return existing_path("model", document.path.resolve().parent / Path(file).expanduser())
    except (DescriptionError, RuntimeError) as error:
        raise document.error(str(error), "model", key) from None


def _in_package(package: str, rest: str) -> Path:
    prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    prefixes += os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep)
    tried = [
        Path(prefix, *middle, package, rest)
        for prefix in filter(None, prefixes)
        for middle in (("share",), ())
    ]
    for path in tried:
        if path.is_file():
            return path
    raise DescriptionError(
        f"package://{package}/{rest} is not below AMENT_PREFIX_PATH or ROS_PACKAGE_PATH"
    )
