# SPDX-License-Identifier: Apache-2.0
"""Legs as robot models that tests are made with: three joints in a row, and a five-bar."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from leg_kinematics.mechanisms.leg_of_tree import leg_of_tree
from leg_kinematics.model.leg_tree import Foot, leg_tree
from leg_kinematics.model.tree import Closure
from leg_kinematics.model.urdf import read_urdf


def link(name, mass=0.5, centre="0 0 -0.1"):
    """Return a link with a mass."""
    inertia = '<inertia ixx="1" iyy="1" izz="1" ixy="0" iyz="0" ixz="0"/>'
    inside = f'<origin xyz="{centre}"/><mass value="{mass}"/>{inertia}'
    return f'<link name="{name}"><inertial>{inside}</inertial></link>'


def joint(name, parent, child, at, axis="0 1 0", limits=(-1.5, 1.5), effort=40.0, kind="revolute"):
    """Return a joint; effort None is no actuator."""
    lower, upper = limits
    force = "" if effort is None else f'effort="{effort}"'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{at}"/><axis xyz="{axis}"/>'
        f'<limit lower="{lower}" upper="{upper}" {force} velocity="1"/></joint>'
    )


def urdf(*elements):
    """Return the tree of a URDF with these elements."""
    return read_urdf(Path("test.urdf"), f'<robot name="r">{"".join(elements)}</robot>')


SERIAL = urdf(
    *('<link name="base"/>', link("hip_link"), link("thigh_link"), link("shin", 0.2)),
    '<link name="toe"/>',
    joint("hip", "base", "hip_link", "0.3 0.1 0", axis="1 0 0", limits=(-0.8, 0.9)),
    joint("thigh", "hip_link", "thigh_link", "0.05 0.08 0", limits=(-1.2, 1.0)),
    joint("knee", "thigh_link", "shin", "0 0 -0.25", limits=(0.3, 2.4)),
    '<joint name="ankle" type="fixed"><parent link="shin"/><child link="toe"/>'
    '<origin xyz="0.01 0.0 -0.28"/></joint>',
)
# Two cranks side by side turn a pair of rods that meet; the foot is on the longer rod.
FIVE_BAR = urdf(
    *('<link name="base"/>', link("hip_link"), link("rear_crank"), link("front_crank")),
    *(link("shin"), link("rod", 0.3)),
    joint("hip", "base", "hip_link", "0.3 0.1 0", axis="1 0 0", limits=(-0.6, 0.6)),
    joint("thigh", "hip_link", "rear_crank", "-0.05 0.05 -0.02", limits=(-0.5, 0.9)),
    joint("knee", "rear_crank", "shin", "0 0 -0.15", limits=(-3.5, 3.5), effort=None),
    joint("crank", "hip_link", "front_crank", "0.05 0.05 -0.02", limits=(-0.9, 0.5)),
    joint("rod_pin", "front_crank", "rod", "0 0 -0.15", limits=(-3.5, 3.5), effort=None),
)
MEET = Closure("shin", np.array([[0.0, 0.0, -0.2]]), "rod", np.array([[0.0, 0.0, -0.2]]), "here")
FIVE_BAR_ASSEMBLY = {
    "initial": {"thigh": 0.6, "crank": -0.6, "knee": -1.0, "rod_pin": 1.0},
    "folded": {"thigh": 0.6, "crank": -0.6, "knee": 3.2, "rod_pin": 3.0},
}


def serial_leg():
    """Return a leg whose hip rolls and pitches and whose knee bends."""
    tree = leg_tree(SERIAL, "base", Foot("toe"))
    return leg_of_tree(tree, assembly={"initial": {"thigh": -0.5, "knee": 1.1}})


def five_bar():
    """Return a leg whose knee is driven through a five-bar."""
    closed = type(FIVE_BAR)(FIVE_BAR.name, FIVE_BAR.links, FIVE_BAR.joints, (MEET,), FIVE_BAR.place)
    tree = leg_tree(closed, "base", Foot("shin", (0.0, 0.0, -0.3)))
    return leg_of_tree(tree, assembly=FIVE_BAR_ASSEMBLY)


MODEL_LEGS = {"serial model": serial_leg(), "five-bar model": five_bar()}
