# SPDX-License-Identifier: Apache-2.0
"""Writes a robot as URDF: a tree whose loops are cut.

Joints have the robot's names and the mechanisms' zeros and senses, so that joint states need no
conversion. With all joints at zero the links of a leg have the axes of its leg frame; a leg's loops
need not close there.
"""

from __future__ import annotations

import math
import warnings
from xml.etree.ElementTree import Element

import numpy as np

from leg_kinematics.arrays import FloatArray
from leg_kinematics.bodies import LegJoint
from leg_kinematics.export.named_legs import UNLIMITED, Bar, NamedLeg, named_legs
from leg_kinematics.export.xml_text import add, document, is_bounded
from leg_kinematics.robot import Robot

UNBOUNDED = 100.0  # m, range of a slide that nothing bounds; URDF wants one
COMMENT = (
    "Loops are cut: the description beside this file tells which points coincide. "
    "Moments of inertia are those of balls."
)


def urdf_text(robot: Robot) -> str:
    """Return a robot as URDF.

    Raises:
        NotSupportedError: If a mechanism does not tell its bodies.
    """
    root = Element("robot", name=robot.name)
    add(root, "link", name=robot.base_frame)
    for leg in named_legs(robot):
        _add_leg(root, robot.base_frame, leg)
    return document(root, COMMENT)


def _add_leg(root: Element, base: str, leg: NamedLeg) -> None:
    bars: dict[str, list[Bar]] = {}
    for name, bar in leg.bars():
        bars.setdefault(name, []).append(bar)
    for number, name in enumerate(leg.links):
        link = add(root, "link", name=name)
        if number:
            _add_inertia(link, leg, leg.tree.joints[number - 1])
        for bar in bars.get(name, ()):
            _add_visual(link, bar, leg.bar_radius)
    add(root, "link", name=leg.foot)
    mount = leg.leg.mount
    _add_fixed(root, base, leg.links[0], mount.position, _rpy(mount.rotation))
    for k, joint in enumerate(leg.tree.joints):
        _add_joint(root, leg, k, joint)
    foot = leg.tree
    _add_fixed(root, leg.links[foot.foot_body], leg.foot, foot.foot_point, (0.0, 0.0, 0.0))


def _rpy(rotation: FloatArray) -> FloatArray:
    """Return the angles about the fixed x, then y, then z axis (3,) [rad]."""
    from scipy.spatial.transform import Rotation  # slow to import

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # where the angles are not unique any will do
        angles: FloatArray = Rotation.from_matrix(rotation).as_euler("xyz")
    return angles


def _add_inertia(link: Element, leg: NamedLeg, joint: LegJoint) -> None:
    if math.isfinite(joint.mass):
        inertial = add(link, "inertial")
        add(inertial, "origin", xyz=joint.centre)
        add(inertial, "mass", value=joint.mass)
        moments = dict.fromkeys(("ixx", "iyy", "izz"), leg.inertia(joint.mass))
        add(inertial, "inertia", **moments, ixy=0.0, ixz=0.0, iyz=0.0)


def _add_visual(link: Element, bar: Bar, radius: float) -> None:
    way = bar.end - bar.start
    visual = add(link, "visual")
    rpy = (0.0, math.atan2(math.hypot(way[0], way[1]), way[2]), math.atan2(way[1], way[0]))
    add(visual, "origin", xyz=0.5 * (bar.start + bar.end), rpy=rpy)
    geometry = add(visual, "geometry")
    add(geometry, "cylinder", radius=radius, length=float(np.linalg.norm(way)))


def _add_joint(root: Element, leg: NamedLeg, k: int, joint: LegJoint) -> None:
    name, limits = leg.joint_names[k], joint.limits
    bounded = is_bounded(joint.type, limits)
    kind = joint.type if bounded or joint.type == "prismatic" else "continuous"
    element = add(root, "joint", name=name, type=kind)
    add(element, "parent", link=leg.links[joint.parent])
    add(element, "child", link=leg.links[k + 1])
    add(element, "origin", xyz=joint.offset)
    add(element, "axis", xyz=joint.axis)
    effort = min(max(map(abs, leg.efforts.get(name, (0.0, 0.0)))), UNLIMITED)
    if kind == "continuous":
        add(element, "limit", effort=effort, velocity=0.0)
    else:
        lower, upper = limits if bounded else (-UNBOUNDED, UNBOUNDED)
        add(element, "limit", lower=lower, upper=upper, effort=effort, velocity=0.0)


def _add_fixed(root: Element, parent: str, child: str, xyz: object, rpy: object) -> None:
    element = add(root, "joint", name=f"{child}.fixed", type="fixed")
    add(element, "parent", link=parent)
    add(element, "child", link=child)
    add(element, "origin", xyz=xyz, rpy=rpy)  # type: ignore[arg-type]
