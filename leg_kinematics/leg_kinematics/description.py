# SPDX-License-Identifier: Apache-2.0
"""Robot descriptions: YAML in the units of its author to a `Robot` in SI, with every mistake named.

A file has this form (lengths and angles in the units it states, efforts in N.m or N):

    name: hexapod
    base_frame: base_link
    units: {length: mm, angle: deg}
    body: {mass: 120, center_of_mass: [0, 0, 50]}       # optional, of all the robot [kg]
    leg_types:
      initial:
        mechanism: parallel_drive
        geometry: {crank_spacing: 276, ...}             # every parameter of the mechanism
        joint_limits: {crank_1: [-21, 21], ...}
        passive_joint_limits: {u1_along: [-45, 45], ...}  # of excursions from the initial posture
        effort_limits: {crank_1: 150, crank_2: [-150, 120], ...}
        masses: {H-R3: 2.5, R1-R2: {mass: 1.2, at: 0.4}, S: 0.3}  # optional [kg], see below
    legs:
      left_front:
        type: initial
        mount: {position: [500, 250, 0], rpy: [0, 0, 0]}  # rpy optional, default no rotation
        mirrored: true                                  # optional, default false
        frame: left_front_leg                           # optional, default <leg>_leg
        joint_names: {crank_1: lf_motor_1, ...}         # optional, default <leg>_<joint>
        drives: {crank_1: {scale: -1, zero: 5}, ...}    # optional, see below

What a drive tells in joint states is the joint position in rad or m, unless `drives` says
otherwise: position = scale · (told - zero). `scale` (default 1) is a number without unit, negative
for a drive that counts the other way round; `zero` (default 0) is what the drive tells at joint
position zero, in the file's unit of the joint. Efforts are divided by the scale. Limits, services
and maps speak of the joints themselves.

The `mass` of the body counts for stances; of a robot model that tells its masses it is optional.

Masses are on bars, named by the two points of the linkage that are their ends, at `at` of the way
from the first to the second (default 0.5, the middle), or at single points. With them the weight of
the leg counts in every load problem.

Legs of a robot model need no leg type; see `leg_kinematics.model_description`:

    name: solo12
    base_frame: base_link
    model: {file: solo12.urdf}
    legs:
      FL: {foot: FL_FOOT}
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from itertools import starmap
from pathlib import Path
from typing import Any

import numpy as np

from leg_kinematics.arrays import FloatArray
from leg_kinematics.documents import (
    FOREIGN_NAME,
    NAME,
    NUMBER,
    PAIR,
    VECTOR,
    Document,
    mapping_schema,
    named_schema,
    shared_files,
)
from leg_kinematics.errors import (
    DescriptionError,
    GeometryError,
    NotSupportedError,
    UnknownNameError,
)
from leg_kinematics.files import existing_path, exists, user_path
from leg_kinematics.geometry import geometry_parameters
from leg_kinematics.mechanism import Excursion, Joint, Mechanism
from leg_kinematics.mechanisms import MECHANISMS
from leg_kinematics.mechanisms.weighed import BarMass
from leg_kinematics.mirrored import Mirrored
from leg_kinematics.model_description import (
    EFFORT,
    MODEL_LEG_SCHEMA,
    MODEL_SCHEMA,
    ModelDescription,
    effort_range,
)
from leg_kinematics.robot import Body, Drives, Leg, Mount, Robot

MASS = {"type": "number", "minimum": 0}
BAR_MASSES = {
    "type": "object",
    "maxProperties": 1000,
    "additionalProperties": {
        "description": "a number >= 0 [kg] or {mass: number, at: 0 .. 1}",
        "oneOf": [
            MASS,
            mapping_schema(
                {"mass": MASS, "at": {"type": "number", "minimum": 0, "maximum": 1}}, ["mass"]
            ),
        ],
    },
}
MOST_LEGS = 64  # and leg types

UNITS = {
    "length": {"m": 1.0, "cm": 0.01, "mm": 0.001},
    "angle": {"rad": 1.0, "deg": math.pi / 180.0},
    "ratio": {"1": 1.0},
}

LEG_TYPES = named_schema(
    {
        "type": "object",
        "properties": {"mechanism": {"enum": list(MECHANISMS)}},
        "required": ["mechanism"],
    },
    MOST_LEGS,
)
BODY = mapping_schema(
    {"mass": {**NUMBER, "exclusiveMinimum": 0}, "center_of_mass": VECTOR}, ["mass"]
)
TYPED_LEG = mapping_schema(
    {
        "type": NAME,
        "mount": mapping_schema({"position": VECTOR, "rpy": VECTOR}, ["position"]),
        "mirrored": {"type": "boolean"},
        "frame": FOREIGN_NAME,
        "joint_names": {"type": "object"},
        "drives": {"type": "object"},
    },
    ["type", "mount"],
)


def _check_robot(document: Document) -> None:
    """Check all of a description but what depends on mechanisms and models.

    Raises:
        DescriptionError: If anything in it is wrong.
    """
    root = document.root
    legs = root.get("legs") if isinstance(root, Mapping) else None
    of_model = {n for n, leg in (legs or {}).items() if _is_of_model(leg)} if _is_map(legs) else ()
    typed = not of_model or len(of_model) < len(legs or ())
    document.check(
        mapping_schema(
            {
                "name": NAME,
                "base_frame": FOREIGN_NAME,
                "units": mapping_schema(
                    {k: {"enum": list(UNITS[k])} for k in ("length", "angle")}, ["length", "angle"]
                ),
                "body": BODY,
                "model": MODEL_SCHEMA,
                "leg_types": LEG_TYPES,
                "legs": {
                    **named_schema(TYPED_LEG, MOST_LEGS),
                    "properties": dict.fromkeys(of_model, MODEL_LEG_SCHEMA),
                },
            },
            [
                *("name", "base_frame", "legs"),
                *(("units", "leg_types") if typed else ()),
                *(("model",) if of_model else ()),
            ],
        )
    )


def _is_map(value: Any) -> bool:
    return isinstance(value, Mapping)


def _is_of_model(leg: Any) -> bool:
    """Whether an entry of `legs` names a foot of the model, and not a leg type."""
    return isinstance(leg, Mapping) and "foot" in leg


def _leg_type_schema(mechanism: Mechanism) -> dict[str, Any]:
    """Return the schema of a leg type, made from the fields and joints of such a mechanism."""
    geometry = {
        f.name: {**NUMBER, "exclusiveMinimum": 0} if f.metadata["positive"] else NUMBER
        for f in geometry_parameters(mechanism)
    }
    joints = [j.name for j in mechanism.joints]
    excursions = [e.name for e in mechanism.excursions]
    return mapping_schema(
        {
            "mechanism": {"const": mechanism.name},
            "geometry": mapping_schema(geometry, list(geometry)),
            "joint_limits": mapping_schema(dict.fromkeys(joints, PAIR), joints),
            "passive_joint_limits": mapping_schema(dict.fromkeys(excursions, PAIR), excursions),
            "effort_limits": mapping_schema(dict.fromkeys(joints, EFFORT), joints),
            "masses": BAR_MASSES,
        },
        ["mechanism", "geometry", "joint_limits", "passive_joint_limits", "effort_limits"],
    )


def load_robot(source: str | os.PathLike[str]) -> Robot:
    """Load a robot description.

    Args:
        source: Path of a YAML file, or the name of a robot that ships with `leg_bringup`.

    Raises:
        DescriptionError: If the file is missing or wrong; the message names, for every mistake,
            file, line, path of the key, the value and what is allowed.
    """
    return robot_from_document(Document(find_robot_file(source)))


def load_leg_types(source: str | os.PathLike[str]) -> dict[str, Leg]:
    """Load each leg type of a description as a leg of that name, at the base frame's origin.

    Args:
        source: Path of a YAML file, or the name of a robot that ships with `leg_bringup`.

    Raises:
        DescriptionError: If the file is missing or wrong.
    """
    return leg_types_of(Document(find_robot_file(source)))


def leg_types_of(document: Document) -> dict[str, Leg]:
    """Build a leg of each leg type of a parsed description, in place of the legs it has.

    Raises:
        DescriptionError: If anything in it is wrong.
    """
    _check_robot(document)
    mount = {"position": [0.0, 0.0, 0.0], "rpy": [0.0, 0.0, 0.0]}
    of_model = {n: leg for n, leg in document.root["legs"].items() if _is_of_model(leg)}
    document.root["legs"] = of_model | {
        name: {"type": name, "mount": mount} for name in document.root.get("leg_types", {})
    }
    return dict(robot_from_document(document).legs)


def find_robot_file(source: str | os.PathLike[str]) -> Path:
    """Return the path of a description given by path or by the name of a shipped robot.

    Raises:
        DescriptionError: If there is no such file; the message lists the shipped robots.
    """
    path = user_path(source)
    if path.name and (path.suffix in (".yaml", ".yml") or exists(path)):
        return existing_path("robot description", path)
    shipped = shared_files("leg_bringup", "robots", ".yaml")
    if str(source) not in shipped:
        raise DescriptionError(
            f"no robot named {str(source)!r}; shipped robots: {', '.join(sorted(shipped))}; "
            "or give the path of a YAML file"
        )
    return shipped[str(source)]


def robot_from_document(document: Document) -> Robot:
    """Build a robot from a parsed description.

    Raises:
        DescriptionError: If anything in it is wrong.
    """
    _check_robot(document)
    root = document.root
    types = root.get("leg_types", {})
    for name, leg_type in types.items():
        document.check(_leg_type_schema(MECHANISMS[leg_type["mechanism"]]()), "leg_types", name)
    of_units = root.get("units", {"length": "m", "angle": "rad"})
    units = {k: UNITS[k][v] for k, v in of_units.items()} | {"ratio": 1.0}
    mechanisms = {name: _mechanism(document, name, units) for name in types}
    model = ModelDescription(document, units) if "model" in root else None
    legs = {
        name: model.leg(name)
        if model and _is_of_model(entry)
        else _leg(document, name, mechanisms, units)
        for name, entry in root["legs"].items()
    }
    _check_unique_joints(document, legs)
    body = model.body() if model else None
    if "body" in root:
        center = root["body"].get("center_of_mass", (0.0, 0.0, 0.0))
        x, y, z = (float(v) * units["length"] for v in center)
        body = Body(float(root["body"]["mass"]), (x, y, z))
    return Robot(root["name"], root["base_frame"], legs, body)


def _mechanism(document: Document, name: str, units: Mapping[str, float]) -> Any:
    leg_type = document.node("leg_types", name)
    mechanism = MECHANISMS[leg_type["mechanism"]]
    example = mechanism()
    geometry = {
        f.name: float(leg_type["geometry"][f.name]) * units[f.metadata["dimension"]]
        for f in geometry_parameters(mechanism)
    }

    def ranges(key: str, joints: Sequence[Joint | Excursion]) -> tuple[tuple[float, float], ...]:
        pairs = []
        for joint in joints:
            scale = units[joint.dimension]
            lower, upper = leg_type[key][joint.name]
            if lower > upper:
                message = f"{[lower, upper]}: lower must be <= upper"
                raise document.error(message, "leg_types", name, key, joint.name)
            pairs.append((lower * scale, upper * scale))
        return tuple(pairs)

    masses = leg_type.get("masses", {})
    try:
        found = mechanism(
            **geometry,
            joint_ranges=ranges("joint_limits", example.joints),
            passive_joint_ranges=ranges("passive_joint_limits", example.excursions),
            **({"bar_masses": tuple(starmap(_bar_mass, masses.items()))} if masses else {}),
        )
    except GeometryError as error:
        message = f"cannot be assembled: {error}"
        raise document.error(message, "leg_types", name, "geometry") from None
    if masses:
        try:
            found.loads()
        except (GeometryError, UnknownNameError) as error:
            raise document.error(str(error), "leg_types", name, "masses") from None
    return found


def _bar_mass(bar: str, value: Any) -> BarMass:
    """Return the mass that a description gives a bar or a point."""
    entry = value if isinstance(value, Mapping) else {"mass": value}
    return BarMass(tuple(bar.split("-")), float(entry["mass"]), float(entry.get("at", 0.5)))


def _effort_limits(document: Document, leg_type: str, joints: Sequence[Joint]) -> FloatArray:
    where = ("leg_types", leg_type, "effort_limits")
    return np.array([effort_range(document, joint, *where, joint.name) for joint in joints])


def _leg(
    document: Document, name: str, mechanisms: Mapping[str, Any], units: Mapping[str, float]
) -> Leg:
    entry = document.node("legs", name)
    leg_type = entry["type"]
    if leg_type not in mechanisms:
        message = f"unknown leg type {leg_type!r}; allowed: {', '.join(mechanisms)}"
        raise document.error(message, "legs", name, "type")
    original = mechanisms[leg_type]
    joints = [joint.name for joint in original.joints]
    joint_names = entry.get("joint_names", {})
    if joint_names:
        schema = mapping_schema(dict.fromkeys(joints, FOREIGN_NAME), ())
        document.check(schema, "legs", name, "joint_names")
    try:
        mechanism: Any = Mirrored(original) if entry.get("mirrored", False) else original
    except NotSupportedError as error:
        raise document.error(str(error), "legs", name, "mirrored") from None
    mount = entry["mount"]
    from scipy.spatial.transform import Rotation  # slow to import, and only needed here

    rpy = np.array(mount.get("rpy", (0.0, 0.0, 0.0)), dtype=np.float64)
    rotation = Rotation.from_euler("xyz", rpy * units["angle"])
    return Leg(
        name=name,
        leg_type=leg_type,
        mechanism=mechanism,
        mount=Mount(
            np.array(mount["position"], dtype=np.float64) * units["length"], rotation.as_matrix()
        ),
        frame=entry.get("frame", f"{name}_leg"),
        joint_names=tuple(joint_names.get(joint, f"{name}_{joint}") for joint in joints),
        passive_joint_names=tuple(f"{name}_{joint.name}" for joint in original.passive_joints),
        effort_limits=_effort_limits(document, leg_type, original.joints),
        drives=_drives(document, name, original.joints, units),
    )


def _drives(
    document: Document, leg: str, joints: Sequence[Joint], units: Mapping[str, float]
) -> Drives | None:
    """Return what the drives of a leg tell, if the description says anything of it."""
    entry = document.node("legs", leg).get("drives")
    if not entry:
        return None
    drive = mapping_schema({"scale": NUMBER, "zero": NUMBER}, ())
    schema = mapping_schema({joint.name: drive for joint in joints}, ())
    document.check(schema, "legs", leg, "drives")
    scale, zero = np.ones(len(joints)), np.zeros(len(joints))
    for k, joint in enumerate(joints):
        told = entry.get(joint.name, {})
        scale[k] = told.get("scale", 1.0)
        zero[k] = told.get("zero", 0.0) * units[joint.dimension]
        if scale[k] == 0.0:
            message = "0: the scale of a drive must not be 0"
            raise document.error(message, "legs", leg, "drives", joint.name, "scale")
    return Drives(scale, zero)


def _check_unique_joints(document: Document, legs: Mapping[str, Leg]) -> None:
    owner: dict[str, str] = {}
    for leg in legs.values():
        for joint in (*leg.joint_names, *leg.passive_joint_names):
            if joint in owner:
                message = f"joint name {joint!r} is already used by leg {owner[joint]!r}"
                raise document.error(message, "legs", leg.name)
            owner[joint] = leg.name
