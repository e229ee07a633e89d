# SPDX-License-Identifier: Apache-2.0
"""What is drawn and said of a robot that stands: all of it computed by the library, for any page.

playground = Playground.of(load_robot("hexapod"), "rough")
scene = make_scene(playground, playground.stand(playground.setting), playground.setting)
scene.shapes["left_front/linkage"], scene.leg
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray
from leg_kinematics.mechanism import Posture
from leg_kinematics.model.solved import joint_places
from leg_kinematics.robot import Leg
from leg_kinematics.status import Status
from leg_statics.efforts import utilisation
from leg_statics.footholds import Footholds, Verdict, evaluate_footholds
from leg_statics.force_shapes import EDGES, force_polytope, friction_cone
from leg_statics.stance.region import SupportRegion, support_region
from leg_statics.stance.stances import Load, Stances, StanceVerdict, evaluate_stances
from leg_statics.stance.standing import robot_stance
from leg_statics.view import colours
from leg_statics.view.readings import Reading, percent, place_text, quantity, words
from leg_statics.view.shapes import Arrows, Lines, Mesh, Points, Shape, is_empty
from leg_statics.view.standing import Playground, Setting, Standing
from leg_statics.weight import weight_efforts
from leg_statics.workspace import is_spatial_leg, workspace_bounds

CANDIDATES = 33  # along each side of the grid
STEEL = np.array([0.35, 0.38, 0.42])
RED = np.array([0.85, 0.2, 0.15])
GREEN = np.array([0.1, 0.6, 0.35])
BLUE = np.array([0.15, 0.4, 0.85])
ORANGE = np.array([0.9, 0.55, 0.1])
EARTH = np.array([0.6, 0.55, 0.46])
BODY = np.array([0.55, 0.6, 0.68])

# Sizes as shares of the height of the robot's legs.
BAR, JOINT, THIN, FOOT, CANDIDATE = 0.018, 0.055, 0.006, 0.06, 0.022
CONE, FORCE = 0.25, 0.4  # height of a cone; length of the force that a leg carries at first
LARGEST_SET = 6.0  # a force set beyond that is left out: there the structure carries nearly alone
STEEPEST_CONE = 4.0  # friction as which a cone of rougher ground is drawn
LIFT = 0.012  # over the ground, of what lies on it


class Scene(NamedTuple):
    """What is drawn and said.

    Attributes:
        shapes: What is drawn, by name; names of a leg begin with "<leg>/".
        leg: What is said of the leg that is looked at.
        stance: What is said of the robot as a whole.
    """

    shapes: Mapping[str, Shape]
    leg: tuple[Reading, ...]
    stance: tuple[Reading, ...]


def make_scene(
    playground: Playground,
    standing: Standing,
    setting: Setting,
    used: Mapping[str, ArrayLike] | None = None,
) -> Scene:
    """Return what is drawn and said of a robot.

    Args:
        playground: The robot and its ground.
        standing: How it stands.
        setting: Friction, loads, and the leg that is looked at.
        used: Shares of their limits that joints exert, or one for all, by the name of the leg; by
            default those of the forces of the stance that use the actuators least.
    """
    stance = _stand(playground, standing, setting)
    shares = stance.shares if used is None else used
    shapes: dict[str, Shape] = {
        "body": _body(playground, standing),
        "candidates": _candidates(playground, standing, setting),
        **_region(playground, standing, stance),
    }
    for name in playground.robot.legs:
        for kind, shape in _leg(playground, standing, setting, name, shares.get(name, np.nan)):
            shapes[f"{name}/{kind}"] = shape
    return Scene(
        {name: shape for name, shape in shapes.items() if not is_empty(shape)},
        tuple(_told_of_leg(playground, standing, setting)),
        tuple(_told_of_stance(playground, stance)),
    )


def ask(
    playground: Playground, standing: Standing, setting: Setting, place: ArrayLike
) -> dict[str, tuple[Reading, ...]]:
    """Return what each leg that reaches a place would carry there, by name.

    Args:
        playground: The robot and its ground.
        standing: How it stands.
        setting: Friction and load.
        place: A place on the ground (3,) [m].
    """
    answers = {}
    for name, leg in playground.robot.legs.items():
        if not is_spatial_leg(leg.mechanism):
            continue
        found = _footholds(playground, standing, setting, name, np.asarray(place))
        if found.verdict != Verdict.REACH:
            answers[name] = tuple(_told_of_foothold(found, leg.joint_names))
    return answers


# --------------------------------------------------------------------------- the stance


class _Stance(NamedTuple):
    """Evaluation of the stance of the legs whose feet stand; None of what there is not."""

    legs: tuple[str, ...]
    answer: Stances | None
    region: SupportRegion | None
    shares: dict[str, FloatArray]


def _stand(playground: Playground, standing: Standing, setting: Setting) -> _Stance:
    """Return the stance of the legs that stand and have a posture."""
    legs = tuple(name for name in standing.touching if standing.postures[name].status == Status.OK)
    if not legs or setting.mass <= 0.0:
        return _Stance(legs, None, None, {})
    feet = {name: _foot(playground, standing, name) for name in legs}
    normal = playground.terrain.normal(np.array(list(feet.values())))
    stance = robot_stance(playground.robot, feet, setting.friction, standing.pose, normal=normal)
    load = Load(setting.mass, standing.pose.position)
    answer = evaluate_stances(stance, load)
    shares = {}
    for k, name in enumerate(legs):
        limits = playground.robot.leg(name).effort_limits
        efforts = answer.joint_efforts[k, : len(limits)]
        shares[name] = utilisation(efforts[:, None], limits[:, None])[0]
    return _Stance(legs, answer, support_region(stance, load), shares)


def _told_of_stance(playground: Playground, stance: _Stance) -> Iterator[Reading]:
    if stance.answer is None or stance.region is None:
        yield Reading("stance", "no leg with three actuators stands on the ground")
        return
    answer = stance.answer
    verdict = StanceVerdict(int(answer.verdict))
    count = len(stance.legs)
    feet = "1 foot" if count == 1 else f"{count} feet"
    yield Reading("stance", f"{feet}: {words(verdict.name)}")
    yield Reading("load factor", quantity(float(answer.load_factor), "", 2))
    if answer.limiting_leg >= 0:
        leg = stance.legs[int(answer.limiting_leg)]
        joint = int(answer.limiting_joint)
        what = words(StanceVerdict(int(answer.limit)).name)
        where = playground.robot.leg(leg).joint_names[joint] if joint >= 0 else leg
        yield Reading("limited by", f"{what}: {where}")
    yield Reading("largest share in the stance", percent(float(answer.utilisation)))
    yield Reading("margin of the centre of mass", quantity(float(stance.region.margin), "m", 3))


def _region(playground: Playground, standing: Standing, stance: _Stance) -> dict[str, Shape]:
    """Return support region, centre of mass and forces of a stance."""
    unit = playground.unit
    center = np.asarray(standing.pose.position, dtype=np.float64)
    shapes: dict[str, Shape] = {}
    if stance.answer is None or stance.region is None:
        return shapes
    feet = np.array([_foot(playground, standing, name) for name in stance.legs])
    level = float(feet[:, 2].max()) + LIFT * unit
    border = np.array(stance.region.vertices)
    if np.isfinite(border).all():
        border[:, 2] = level
        shapes["support_region"] = _fan(border, BLUE, 0.35)
        shapes["support_border"] = Lines(_ring(border), BLUE, THIN * unit)
    below = np.array([center[0], center[1], level])
    shapes["center_of_mass"] = Lines(np.array([[center, below]]), RED, THIN * unit)
    force = np.asarray(stance.answer.force)
    if np.isfinite(force).all():
        ends = np.stack([feet, feet + _force_scale(playground) * force], axis=1)
        shapes["forces"] = Arrows(ends, ORANGE, 2.0 * THIN * unit)
    return shapes


# --------------------------------------------------------------------------- a leg


def _leg(
    playground: Playground,
    standing: Standing,
    setting: Setting,
    name: str,
    shares: ArrayLike,
) -> Iterator[tuple[str, Shape]]:
    """Yield the shapes of a leg; those that its posture has."""
    unit = playground.unit
    leg, posture = playground.robot.leg(name), standing.postures[name]
    ends = standing.pose.from_base(leg.segments(posture))
    if not np.isfinite(ends).all():  # out of reach: where the foot should be
        wanted = playground.foot_of(name, setting)
        yield "foot", Points(wanted[None], RED[None], FOOT * unit)
        return
    bad = posture.status != Status.OK
    yield "linkage", Lines(ends, RED if bad else STEEL, BAR * unit)
    places = standing.pose.from_base(leg.mount.to_base(_joint_places(leg, posture)))
    shade = np.broadcast_to(colours.of_utilisation(shares), places.shape)
    yield "joints", Points(places, shade, JOINT * unit)
    foot = _foot(playground, standing, name)
    yield "foot", Points(foot[None], (RED if bad else STEEL)[None], FOOT * unit)
    if bad or not leg.mechanism.has_point_foot:
        return
    rim = friction_cone(min(setting.friction, STEEPEST_CONE), playground.terrain.normal(foot))
    yield "friction_cone", _cone(foot, foot + CONE * unit * rim)
    corners = _force_set(playground, standing, name)
    if corners is not None:
        yield "force_set", Lines(corners[np.array(EDGES)], BLUE, THIN * unit)


def _joint_places(leg: Leg, posture: Posture) -> FloatArray:
    """Return where the actuated joints of a leg are in its frame (n, 3) [m]."""
    tree = leg.mechanism.body_tree()
    places = joint_places(tree.chain, leg.mechanism.tree_positions(posture))
    numbers = {joint.name: k for k, joint in enumerate(tree.joints)}
    return np.asarray(places)[[numbers[joint.name] for joint in leg.mechanism.joints]]


def _force_set(playground: Playground, standing: Standing, name: str) -> FloatArray | None:
    """Return the corners of the forces that the actuators hold, drawn at the foot (8, 3) [m]."""
    leg, posture = playground.robot.leg(name), standing.postures[name]
    jacobian = leg.mechanism.jacobian(posture)
    if jacobian.shape != (3, 3):
        return None
    gravity = playground.contact(name, np.zeros(3), standing.pose, playground.setting).gravity
    assert gravity is not None
    weight = weight_efforts(leg.mechanism, posture, gravity)
    corners = _force_scale(playground) * force_polytope(jacobian, leg.effort_limits, weight)
    if not np.abs(corners).max() < LARGEST_SET * playground.unit:
        return None
    turn = np.asarray(standing.pose.rotation)
    return _foot(playground, standing, name) + leg.mount.vectors_to_base(corners) @ turn.T


def _force_scale(playground: Playground) -> float:
    """Return the length of a force [m/N]: what the legs bear at first is drawn a good length."""
    return FORCE * playground.unit / max(4.0 * playground.setting.load, 1e-9)


def _told_of_leg(playground: Playground, standing: Standing, setting: Setting) -> Iterator[Reading]:
    leg = playground.robot.leg(setting.leg)
    posture = standing.postures[setting.leg]
    foot = _foot(playground, standing, setting.leg)
    if not np.isfinite(foot).all():
        foot = playground.foot_of(setting.leg, setting)
    yield Reading("foot", place_text(foot))
    if not leg.mechanism.has_point_foot:
        yield Reading("posture", words(Status(int(posture.status)).name))
        return
    found = playground.judge(setting.leg, standing, setting)
    yield from _told_of_foothold(found, leg.joint_names)


def _told_of_foothold(found: Footholds, joint_names: tuple[str, ...]) -> Iterator[Reading]:
    yield Reading("verdict", words(Verdict(int(found.verdict)).name))
    yield Reading("load capacity", quantity(float(found.load_capacity), "N"))
    yield Reading("rated friction", quantity(float(found.rated_friction_full), "", 3))
    worst = int(found.limiting_joint)
    joint = f" ({joint_names[worst]})" if worst >= 0 else ""
    yield Reading("largest share of a limit", percent(float(found.utilisation)) + joint)


def _foot(playground: Playground, standing: Standing, name: str) -> FloatArray:
    """Return the foot of a leg in the map (3,) [m]."""
    return standing.pose.from_base(playground.in_base(name, standing.postures[name]))


# --------------------------------------------------------------------------- candidates


def _candidates(playground: Playground, standing: Standing, setting: Setting) -> Points:
    """Return places on the ground within reach of the leg that is looked at, with their colours."""
    leg = playground.robot.leg(setting.leg)
    if not is_spatial_leg(leg.mechanism):
        return Points(np.empty((0, 3)), np.empty((0, 3)), CANDIDATE)
    box = np.array(list(itertools.product(*workspace_bounds(leg.mechanism))))
    corners = standing.pose.from_base(leg.mount.to_base(box))
    low, high = corners[:, :2].min(axis=0), corners[:, :2].max(axis=0)
    x, y = (np.linspace(low[k], high[k], CANDIDATES) for k in (0, 1))
    grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    places = playground.terrain.on_ground(grid)
    found = _footholds(playground, standing, setting, setting.leg, places)
    shown = found.verdict != Verdict.REACH
    shades = colours.of_footholds(found.verdict, found.load_capacity)
    lifted = places + np.array([0.0, 0.0, LIFT * playground.unit])
    return Points(lifted[shown], shades[shown], CANDIDATE * playground.unit)


def _footholds(
    playground: Playground, standing: Standing, setting: Setting, name: str, places: FloatArray
) -> Footholds:
    """Return what a leg would carry at places of the map (..., 3)."""
    leg, pose = playground.robot.leg(name), standing.pose
    feet = leg.mount.to_leg(pose.to_base(places))
    return evaluate_footholds(leg, feet, playground.contact(name, places, pose, setting))


# --------------------------------------------------------------------------- forms


def _body(playground: Playground, standing: Standing) -> Lines:
    """Return a line around the places where the legs are mounted, through the base's origin."""
    mounts = np.array([leg.mount.position for leg in playground.robot.legs.values()])
    around = mounts[np.argsort(np.arctan2(mounts[:, 1], mounts[:, 0]), kind="stable")]
    places = standing.pose.from_base(around)
    spokes = np.stack([np.broadcast_to(standing.pose.position, places.shape), places], axis=1)
    return Lines(np.concatenate([_ring(places), spokes]), BODY, 1.4 * BAR * playground.unit)


def ground(playground: Playground) -> Mesh:
    """Return the terrain as it is drawn."""
    vertices, faces = playground.terrain.triangles()
    return Mesh(vertices, faces, EARTH, 1.0)


def _cone(apex: FloatArray, rim: FloatArray) -> Mesh:
    """Return the side of a cone."""
    after = np.roll(np.arange(len(rim)), -1)
    faces = np.stack([np.zeros(len(rim), int), 1 + np.arange(len(rim)), 1 + after], axis=-1)
    return Mesh(np.concatenate([apex[None], rim]), faces, GREEN, 0.35)


def _fan(border: FloatArray, colour: FloatArray, opacity: float) -> Mesh:
    """Return a convex polygon."""
    corner = np.arange(1, len(border) - 1)
    faces = np.stack([np.zeros_like(corner), corner, corner + 1], axis=-1)
    return Mesh(border, faces, colour, opacity)


def _ring(places: FloatArray) -> FloatArray:
    """Return the pieces of a closed line through places (m, 3)."""
    return np.stack([places, np.roll(places, -1, axis=0)], axis=1)
