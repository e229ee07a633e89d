# SPDX-License-Identifier: Apache-2.0
"""How a robot stands in the view: where its body is, how its legs are bent, which feet stand."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from leg_kinematics.arrays import FloatArray
from leg_kinematics.mechanism import Posture
from leg_kinematics.robot import Leg, Robot
from leg_statics.footholds import Contact, Footholds, judge_footholds
from leg_statics.kinematics import Kinematics
from leg_statics.stance.standing import BodyPose
from leg_statics.view.terrain import Terrain, make_terrain
from leg_statics.weight import LEVEL_GRAVITY
from leg_statics.workspace import is_spatial_leg

FRICTION = 0.4  # the low end of cement
USED_CAPACITY = 0.25  # share of what the legs carry, for the loads to begin with
AROUND = 1.0  # how far the terrain goes beyond the feet, in heights of the legs
TOUCHES = 0.01  # a foot so close to the ground stands, as a share of the height of the legs
NO_OFFSET = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Setting:
    """What can be set in the view.

    Attributes:
        leg: The leg that is looked at.
        friction: Friction coefficient of the ground.
        load: Load that a foothold has to bear [N].
        mass: Mass of the robot; its centre is the origin of the base frame [kg].
        height: Height of the base frame over the map [m].
        roll: Turn of the body about x [rad].
        pitch: Turn of the body about y [rad].
        yaw: Turn of the body about z [rad].
        feet: How far each foot is from where it stands at first, forward, to the left and above
            the ground (3,), by the name of the leg [m].
    """

    leg: str
    friction: float
    load: float
    mass: float
    height: float
    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0
    feet: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)

    @property
    def pose(self) -> BodyPose:
        """Where the base frame is in the map."""
        turn = Rotation.from_euler("xyz", [self.roll, self.pitch, self.yaw])
        return BodyPose((0.0, 0.0, self.height), turn.as_matrix())


class Standing(NamedTuple):
    """How a robot stands on a terrain.

    Attributes:
        pose: Where the base frame is in the map.
        postures: The legs, by name.
        touching: Names of the legs whose feet stand on the ground.
    """

    pose: BodyPose
    postures: Mapping[str, Posture]
    touching: tuple[str, ...]


@dataclass(frozen=True)
class Playground:
    """A robot and the ground under it, with what both are measured by.

    Attributes:
        robot: The robot.
        terrain: The ground, in the frame of the map.
    """

    robot: Robot
    terrain: Terrain

    @classmethod
    def of(cls, robot: Robot, terrain: str = "level") -> Playground:
        """Return a robot on one of the terrains that have a name.

        Raises:
            UnknownNameError: If there is none of that name.
        """
        feet = np.array([_first_foot(leg) for leg in robot.legs.values()])
        unit = _unit(feet)
        reach = float(np.abs(feet[:, :2]).max()) + AROUND * unit
        return cls(robot, make_terrain(terrain, reach, unit))

    @cached_property
    def first_feet(self) -> dict[str, FloatArray]:
        """Feet of the legs in their initial postures, in the base frame (3,) [m]."""
        return {name: _first_foot(leg) for name, leg in self.robot.legs.items()}

    @cached_property
    def unit(self) -> float:
        """Height of the base over the lowest foot, by which all is drawn [m]."""
        return _unit(np.array(list(self.first_feet.values())))

    @cached_property
    def setting(self) -> Setting:
        """What is set at first: all feet on the ground and loads that they carry."""
        feet = np.array(list(self.first_feet.values()))
        above = float(np.mean(self.terrain.height(feet) - feet[:, 2]))
        height = round(max(0.0, above), 3)
        leg = next(iter(self.robot.legs))
        start = Setting(leg, FRICTION, load=0.0, mass=0.0, height=height)
        standing = self.stand(start)
        carried = [
            float(self.judge(name, standing, start).load_capacity)
            for name in self.robot.legs
            if self.robot.leg(name).mechanism.has_point_foot
        ]
        least = min((value for value in carried if 0.0 < value < math.inf), default=0.0)
        load = rounded(USED_CAPACITY * least)
        mass = rounded(USED_CAPACITY * least * len(carried) / -LEVEL_GRAVITY[2])
        return Setting(leg, FRICTION, load, mass, height)

    def foot_of(self, leg: str, setting: Setting) -> FloatArray:
        """Return where a foot is put in the map (3,) [m]."""
        ahead, aside, above = setting.feet.get(leg, NO_OFFSET)
        place = self.terrain.on_ground(self.first_feet[leg] + np.array([ahead, aside, 0.0]))
        return place + np.array([0.0, 0.0, above])

    def stand(self, setting: Setting) -> Standing:
        """Return how the robot stands as it is set; legs that cannot place a foot stay as at first.

        Those are legs with fewer than three joints, and without a point foot.
        """
        pose, postures, touching = setting.pose, {}, []
        for name, leg in self.robot.legs.items():
            if is_spatial_leg(leg.mechanism):
                foot = self.foot_of(name, setting)
                postures[name] = leg.mechanism.inverse(leg.mount.to_leg(pose.to_base(foot)))
                if setting.feet.get(name, NO_OFFSET)[2] <= 0.0:
                    touching.append(name)
            else:
                postures[name] = leg.mechanism.initial_posture
        return Standing(pose, postures, tuple(touching))

    def stand_as(
        self, joint_positions: Mapping[str, ArrayLike], contact: Mapping[str, bool]
    ) -> Standing:
        """Return how the robot stands with joints as they are told, its body level.

        Its lowest foot is on the ground under the body. Where contact is not known, that foot
        stands and those next to as low.

        Args:
            joint_positions: Actuated joints of legs by name (n,) [rad or m]; others as at first.
            contact: Whether the feet of legs stand, by name, as far as it is known.
        """
        postures = {
            name: leg.mechanism.forward(joint_positions[name])
            if name in joint_positions
            else leg.mechanism.initial_posture
            for name, leg in self.robot.legs.items()
        }
        feet = {name: self.in_base(name, posture) for name, posture in postures.items()}
        lowest = min((foot[2] for foot in feet.values() if np.isfinite(foot[2])), default=0.0)
        height = float(self.terrain.height(np.zeros(2))) - min(0.0, float(lowest))
        touching = [
            name
            for name, foot in feet.items()
            if is_spatial_leg(self.robot.leg(name).mechanism)
            and contact.get(name, bool(foot[2] - lowest <= TOUCHES * self.unit))
        ]
        return Standing(BodyPose((0.0, 0.0, height)), postures, tuple(touching))

    def in_base(self, leg: str, posture: Posture) -> FloatArray:
        """Return the foot of a posture in the base frame (3,) [m]."""
        return self.robot.leg(leg).mount.to_base(posture.foot_position[:3])

    def contact(self, leg: str, place: ArrayLike, pose: BodyPose, setting: Setting) -> Contact:
        """Return what a foot stands on at a place of the map (..., 3), in the frame of the leg."""
        mount = self.robot.leg(leg).mount
        normal = self.terrain.normal(place)
        return Contact(
            friction=setting.friction,
            normal=mount.vectors_to_leg(normal @ np.asarray(pose.rotation)),
            load=setting.load,
            gravity=mount.vectors_to_leg(LEVEL_GRAVITY @ np.asarray(pose.rotation)),
        )

    def judge(self, leg: str, standing: Standing, setting: Setting) -> Footholds:
        """Return what a leg carries where its foot is."""
        posture = standing.postures[leg]
        place = standing.pose.from_base(self.in_base(leg, posture))
        mechanism = self.robot.leg(leg).mechanism
        contact = self.contact(leg, place, standing.pose, setting)
        return judge_footholds(self.robot.leg(leg), Kinematics(mechanism, posture), contact)


def _first_foot(leg: Leg) -> FloatArray:
    return leg.mount.to_base(leg.mechanism.initial_posture.foot_position[:3])


def _unit(feet: FloatArray) -> float:
    """Return the height of the base over the lowest foot; of what hangs, its distance [m]."""
    return float(np.max(np.abs(feet[:, 2])))


def rounded(value: float) -> float:
    """Return a value rounded to two digits, as a hand would set it."""
    return float(f"{value:.1e}")
