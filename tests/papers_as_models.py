# SPDX-License-Identifier: Apache-2.0
"""The papers' mechanisms written as robot models: URDF trees, and the points that close loops.

All joints of a model are at zero in the mechanism's initial posture, so that its links have the
axes of the leg frame there, and its joint positions are ways from that posture. Points are those of
the mechanism's linkage in that one posture; how they move is what the model is asked for.
"""

from __future__ import annotations

import json
from typing import NamedTuple

import numpy as np

from leg_kinematics import Posture, Status, load_robot

FORWARD, LEFT, UP = np.eye(3)
RIGHT = -LEFT
WIDE = 3.1  # rad or m, range of every joint
# How far an actuated joint of several goes to both sides of where it starts [rad or m].
REACH = {"parallel_drive": 0.3, "double_rhombus": 0.03, "gantry_hybrid": 0.1}
EFFORT = 'effort="100"'
# Parts whose flipping no motion of the same links reaches, or that forward does not depend on.
LEFT_OUT = {"six_bar": {"crank", "foot"}, "gantry_hybrid": {"s4"}}


class Part(NamedTuple):
    """A joint and the link it moves.

    Attributes:
        joint: Its name, that of the mechanism's joint.
        parent: The link it stands on.
        link: The link it moves.
        at: Name of the point it stands at.
        axis: Its axis in the initial posture.
        kind: Its type in a URDF.
        actuated: Whether it has an effort limit.
    """

    joint: str
    parent: str
    link: str
    at: str
    axis: np.ndarray
    kind: str = "continuous"
    actuated: bool = False


class Blueprint(NamedTuple):
    """A mechanism as a model.

    Attributes:
        parts: Its joints.
        pins: Pairs of links and the point in which they meet.
        foot: Link and point of the foot.
    """

    parts: tuple[Part, ...]
    pins: tuple[tuple[str, str, str], ...]
    foot: tuple[str, str]


def six_bar(_):
    """Return the six-bar: its crank A-B-E turns the rocker and the rod of the foot link."""
    return Blueprint(
        (
            Part("crank", "base", "crank", "A", LEFT, actuated=True),
            Part("d", "base", "rocker", "D", LEFT),
            Part("b", "crank", "coupler", "B", LEFT),
            Part("e", "crank", "rod", "E", LEFT),
            Part("c_foot", "rocker", "foot_link", "C", LEFT),
        ),
        (("coupler", "rocker", "C"), ("rod", "foot_link", "F")),
        ("foot_link", "G"),
    )


def theo_jansen(_):
    """Return Jansen's leg: two couplers turn the plate and the lower rocker."""
    return Blueprint(
        (
            Part("crank", "base", "crank", "A", LEFT, actuated=True),
            Part("d_upper", "base", "plate", "D", LEFT),
            Part("d_lower", "base", "rocker", "D", LEFT),
            Part("b_upper", "crank", "upper_coupler", "B", LEFT),
            Part("b_lower", "crank", "lower_coupler", "B", LEFT),
            Part("l", "plate", "link", "L", LEFT),
            Part("c_foot", "rocker", "foot_link", "C", LEFT),
        ),
        (
            ("upper_coupler", "plate", "U"),
            ("lower_coupler", "rocker", "C"),
            ("link", "foot_link", "F"),
        ),
        ("foot_link", "G"),
    )


def double_rhombus(point):
    """Return the double rhombus; a slide along O I keeps the foot's body on its diagonal."""
    along = {pins: direction(point(pins[1]) - point(pins[0])) for pins in ("BA", "CD", "KL")}
    diagonal = direction(point("I"))
    return Blueprint(
        (
            Part("swing_axis", "base", "frame", "O", FORWARD),
            Part("hip_upper_crank", "frame", "upper_crank", "O", RIGHT),
            Part("hip_lower_crank", "frame", "lower_crank", "O", RIGHT),
            Part("f", "upper_crank", "front_bar", "F", RIGHT),
            Part("e", "lower_crank", "rear_bar", "E", RIGHT),
            Part("h", "rear_bar", "lower_front", "H", RIGHT),
            Part("j", "front_bar", "lower_rear", "J", RIGHT),
            Part("turning", "frame", "guide", "O", RIGHT),
            Part("sliding", "guide", "foot_body", "I", diagonal, "prismatic"),
            Part("upper_pin_b", "frame", "upper_barrel", "B", RIGHT),
            Part(
                "upper_cylinder", "upper_barrel", "upper_rod", "A", along["BA"], "prismatic", True
            ),
            Part("lower_pin_c", "frame", "lower_barrel", "C", RIGHT),
            Part(
                "lower_cylinder", "lower_barrel", "lower_rod", "D", along["CD"], "prismatic", True
            ),
            Part("swing_pin_body", "base", "swing_barrel", "K", FORWARD),
            Part(
                "swing_cylinder", "swing_barrel", "swing_rod", "L", along["KL"], "prismatic", True
            ),
        ),
        (
            ("front_bar", "rear_bar", "G"),
            ("lower_front", "lower_rear", "I"),
            ("lower_front", "foot_body", "I"),
            ("upper_rod", "upper_crank", "A"),
            ("lower_rod", "lower_crank", "D"),
            ("swing_rod", "frame", "L"),
        ),
        ("foot_body", "I"),
    )


def parallel_drive(point):
    """Return the parallel drive: two rods with ball joints, a platform, the pantograph's bars."""

    def universal(k, crank, link, end):
        return (
            Part(f"u{k}_along", crank, f"cross_{k}", f"U{k}", RIGHT),
            Part(f"u{k}_across", f"cross_{k}", link, f"U{k}",
                 across(RIGHT, point(end) - point(f"U{k}"))),
        )  # fmt: skip

    return Blueprint(
        (
            *(Part(f"crank_{k}", "base", f"crank_{k}", f"R_D{k}", RIGHT, actuated=True)
              for k in (1, 2, 3)),
            *universal(1, "crank_1", "rod_1", "S1"),
            *universal(2, "crank_2", "rod_2", "S2"),
            *universal(3, "crank_3", "platform", "G"),
            Part("hip_swing", "base", "plane", "H", FORWARD),
            Part("hip_thigh", "plane", "thigh", "H", RIGHT),
            Part("r1", "thigh", "lever", "R1", RIGHT),
            Part("r3", "thigh", "link", "R3", RIGHT),
            Part("r2", "lever", "shank", "R2", RIGHT),
        ),
        (
            ("rod_1", "platform", "S1"),
            ("rod_2", "platform", "S2"),
            ("lever", "platform", "S"),
            ("link", "shank", "R5"),
        ),
        ("shank", "C"),
    )  # fmt: skip


def gantry_hybrid(point):
    """Return the gantry manipulator without the shaft that turns its tool.

    Its hinge A'B' stays along the rails, so that it moves as on two slides.
    """
    return Blueprint(
        (
            Part("s2", "base", "carriage", "O'", LEFT, "prismatic", True),
            Part("s1", "carriage", "slide_a", "A''", FORWARD, "prismatic", True),
            Part("s3", "carriage", "slide_b", "B''", FORWARD, "prismatic", True),
            Part("s4", "carriage", "slide_c", "C''", FORWARD, "prismatic", True),
            Part("along", "carriage", "stage", "O''", FORWARD, "prismatic"),
            Part("above", "stage", "hinge", "O''", UP, "prismatic"),
            Part("bar_a_slide", "slide_a", "bar_a", "A''", RIGHT),
            Part("bar_b_slide", "slide_b", "bar_b", "B''", RIGHT),
            Part("platform_hinge", "hinge", "platform", "O''", FORWARD),
            Part("rod_slide_along", "slide_c", "cross", "C''", FORWARD),
            Part("rod_slide_across", "cross", "rod", "C''",
                 across(FORWARD, point("C'") - point("C''"))),
        ),
        (("bar_a", "hinge", "A'"), ("bar_b", "hinge", "B'"), ("rod", "platform", "C'")),
        ("platform", "O''"),
    )  # fmt: skip


def direction(vector):
    """Return the unit vector along another."""
    return vector / np.linalg.norm(vector)


def across(axis, bar):
    """Return the second axis of a universal joint, about which a bar turns towards the first."""
    return direction(np.cross(bar, axis))


BLUEPRINTS = {
    make.__name__: make
    for make in (parallel_drive, double_rhombus, six_bar, theo_jansen, gantry_hybrid)
}


def load_model(folder, mechanism, posture):
    """Write a mechanism as a URDF and a robot description beside it, and load its leg.

    Args:
        folder: Where to.
        mechanism: The mechanism.
        posture: Its posture from which the model starts.
    """
    rest = mechanism.initial_posture
    linkage = mechanism.linkage(rest)
    places = dict(zip(linkage.names, linkage.points, strict=True))
    blueprint = BLUEPRINTS[mechanism.name](places.__getitem__)
    at = {"base": np.zeros(3)} | {part.link: places[part.at] for part in blueprint.parts}

    def of(link, point):
        return {"link": link, "point": (places[point] - at[link]).tolist()}

    joints = [
        f'<joint name="{part.joint}" type="{part.kind}"><parent link="{part.parent}"/>'
        f'<child link="{part.link}"/><origin xyz="{numbers(at[part.link] - at[part.parent])}"/>'
        f'<axis xyz="{numbers(part.axis)}"/>'
        f'<limit lower="{-WIDE}" upper="{WIDE}" {EFFORT if part.actuated else ""}/></joint>'
        for part in blueprint.parts
    ]
    links = [f'<link name="{link}"/>' for link in at]
    (folder / "leg.urdf").write_text(f'<robot name="leg">{"".join([*links, *joints])}</robot>')
    foot = of(*blueprint.foot)
    start = ways(mechanism, posture, blueprint)
    names, reach = [joint.name for joint in mechanism.joints], REACH.get(mechanism.name)
    description = {
        "name": mechanism.name,
        "base_frame": "base",
        "model": {
            "file": "leg.urdf",
            "closures": [
                {"first": of(one, point), "second": of(other, point)}
                for one, other, point in blueprint.pins
            ],
            "actuated": names,
            "joint_limits": {
                name: [start[name] - reach, start[name] + reach] for name in names if reach
            },
        },
        "legs": {
            "leg": {
                "foot": {"link": foot["link"], "position": foot["point"]},
                "assembly": {"initial": start},
            }
        },
    }
    (folder / "robot.yaml").write_text(json.dumps(description))
    return load_robot(folder / "robot.yaml").leg("leg")


def numbers(vector):
    """Return a vector as an attribute."""
    return " ".join(map(repr, vector.tolist()))


def common_modes(mechanism):
    """Return a posture of each mode that the same rigid links have."""
    rest, found = mechanism.initial_posture, {}
    tried = np.random.default_rng(0).uniform(
        *np.clip(mechanism.joint_limits, -WIDE, WIDE).T, (3000, len(rest.joint_positions))
    )
    for mode in mechanism.assembly_modes:
        if LEFT_OUT.get(mechanism.name, set()) & set(mode.removeprefix("flipped_").split("+")):
            continue
        near = mechanism.inverse(rest.foot_position[None], mode)
        if near.status[0] != Status.OK:
            near = mechanism.forward(tried, mode)
        ok = np.flatnonzero(near.status == Status.OK)
        if len(ok):
            way = np.abs(near.joint_positions[ok] - rest.joint_positions).max(axis=-1)
            found[mode] = Posture(*(field[ok[np.argmin(way)]] for field in near))
    return found


def moves(mechanism, posture):
    """Return how far the actuated joints are from the initial posture (..., n)."""
    return posture.joint_positions - mechanism.initial_posture.joint_positions


def ways(mechanism, posture, blueprint):
    """Return how far the joints of a model are from the initial posture, by name."""
    rest = mechanism.initial_posture
    moved = moves(mechanism, posture)
    passive = mechanism.passive_joint_positions(posture) - mechanism.passive_joint_positions(rest)
    found = dict(zip((j.name for j in mechanism.joints), moved.tolist(), strict=True))
    found |= dict(zip((j.name for j in mechanism.passive_joints), passive.tolist(), strict=True))
    return {part.joint: found[part.joint] for part in blueprint.parts if part.joint in found}
