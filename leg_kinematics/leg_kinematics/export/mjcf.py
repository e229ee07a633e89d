# SPDX-License-Identifier: Apache-2.0
"""Writes a robot as MJCF, with its loops, its actuators and their force ranges.

The base is fixed in the world; a `<freejoint/>` in its body lets the robot fall and walk. The key
"initial" is the initial posture of all legs.
"""

from __future__ import annotations

import math
from xml.etree.ElementTree import Element

from leg_kinematics.bodies import LegJoint
from leg_kinematics.export.named_legs import NamedLeg, named_legs
from leg_kinematics.export.xml_text import add, document, is_bounded
from leg_kinematics.robot import Robot

COMMENT = (
    "Bodies without a mass of their own are given the least that MuJoCo computes with (boundmass). "
    "Moments of inertia are those of balls. A freejoint in the first body frees the robot."
)
LEAST_MASS, LEAST_INERTIA = 1e-3, 1e-5  # kg, kg.m²


def mjcf_text(robot: Robot) -> str:
    """Return a robot as MJCF.

    Raises:
        NotSupportedError: If a mechanism does not tell its bodies.
    """
    root = Element("mujoco", model=robot.name)
    add(root, "compiler", angle="radian", boundmass=LEAST_MASS, boundinertia=LEAST_INERTIA)
    base = add(add(root, "worldbody"), "body", name=robot.base_frame)
    equality, actuators = add(root, "equality"), add(root, "actuator")
    positions: list[float] = []
    for leg in named_legs(robot):
        positions += _add_leg(base, leg)
        for k, (first, second) in enumerate(leg.closures):
            sites = [f"{leg.leg.name}_loop_{k}_{side}" for side in ("first", "second")]
            for site, end in zip(sites, (first, second), strict=True):
                add(_body(base, end.link), "site", name=site, pos=end.point)
            add(equality, "connect", site1=sites[0], site2=sites[1])
        for name, effort in leg.efforts.items():
            motor = add(actuators, "motor", name=name, joint=name)
            if all(map(math.isfinite, effort)):
                motor.attrib |= {"forcelimited": "true", "forcerange": f"{effort[0]} {effort[1]}"}
    add(add(root, "keyframe"), "key", name="initial", qpos=positions)
    return document(root, COMMENT)


def _add_leg(base: Element, leg: NamedLeg) -> list[float]:
    """Add the bodies of a leg and return its initial joint positions in the order of MuJoCo's."""
    from scipy.spatial.transform import Rotation  # slow to import

    mount = leg.leg.mount
    x, y, z, w = Rotation.from_matrix(mount.rotation).as_quat()
    frame = add(base, "body", name=leg.links[0], pos=mount.position, quat=(w, x, y, z))
    bodies = [frame]
    for k, joint in enumerate(leg.tree.joints):
        body = add(bodies[joint.parent], "body", name=leg.links[k + 1], pos=joint.offset)
        _add_joint(body, leg.joint_names[k], joint)
        if math.isfinite(joint.mass):
            moment = leg.inertia(joint.mass)
            add(body, "inertial", pos=joint.centre, mass=joint.mass, diaginertia=(moment,) * 3)
        bodies.append(body)
    for link, bar in leg.bars():
        ends = (*bar.start, *bar.end)
        add(
            bodies[leg.links.index(link)],
            "geom",
            type="capsule",
            fromto=ends,
            size=leg.bar_radius,
            mass=0.0,
            contype="0",
            conaffinity="0",
        )
    foot = bodies[leg.tree.foot_body]
    add(foot, "site", name=leg.foot, pos=leg.tree.foot_point, size=2.0 * leg.bar_radius)
    initial = next(iter(leg.assembly.values()))
    return [initial[str(joint.get("name"))] for joint in frame.iter("joint")]


def _add_joint(body: Element, name: str, joint: LegJoint) -> None:
    kind = "hinge" if joint.type == "revolute" else "slide"
    element = add(body, "joint", name=name, type=kind, axis=joint.axis)
    if is_bounded(joint.type, joint.limits):
        lower, upper = joint.limits
        element.attrib |= {"limited": "true", "range": f"{lower!r} {upper!r}"}


def _body(base: Element, name: str) -> Element:
    return next(body for body in base.iter("body") if body.get("name") == name)
