"""What the client's calls return: named tuples of numpy arrays.

Arrays have the leading axes (...) of the points asked for; `status` holds `leg_msgs/PointStatus`
constants, and points that are not OK have NaN where the service's comments say so.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from leg_msgs_py.arrays import from_field
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
StatusArray = NDArray[np.uint8]


class FootPositions(NamedTuple):
    """Answer of `forward_kinematics`.

    Attributes:
        positions: Foot (..., t) [m], in the frame asked for; t task coordinates, x, y, z for a leg.
        status: Status of each point (...,).
    """

    positions: FloatArray
    status: StatusArray


class JointPositions(NamedTuple):
    """Answer of `inverse_kinematics`; with assembly mode "ALL" every array has a first axis M more.

    Attributes:
        joint_positions: Actuated joints (..., n) [rad or m].
        status: Status of each point (...,).
        joint_names: Names of the actuated joints (n).
        assembly_modes: The modes that were solved (M).
        passive_joint_positions: Passive joints (..., p) [rad or m], (..., 0) unless asked for.
        passive_joint_names: Names of the passive joints (p), empty unless asked for.
    """

    joint_positions: FloatArray
    status: StatusArray
    joint_names: tuple[str, ...]
    assembly_modes: tuple[str, ...]
    passive_joint_positions: FloatArray
    passive_joint_names: tuple[str, ...]


class Jacobians(NamedTuple):
    """Answer of `jacobian`.

    Attributes:
        jacobian: J of v = J q' (..., t, n).
        angular_jacobian: J_omega of omega = J_omega q' (..., 3, n).
        condition_number: Condition number of J (...,).
        status: Status of each point (...,).
        joint_names: Names of the actuated joints (n).
    """

    jacobian: FloatArray
    angular_jacobian: FloatArray
    condition_number: FloatArray
    status: StatusArray
    joint_names: tuple[str, ...]


class Indices(NamedTuple):
    """Answer of `evaluate_indices`.

    Attributes:
        values: Values (..., K) in the order of `names`.
        status: Status of each point (...,).
        names: Names of the indices (K).
        symbols: The literature's symbols (K).
        units: SI units (K).
    """

    values: FloatArray
    status: StatusArray
    names: tuple[str, ...]
    symbols: tuple[str, ...]
    units: tuple[str, ...]


class Efforts(NamedTuple):
    """Answer of `compute_efforts`.

    Attributes:
        joint_efforts: Efforts of the actuators (..., n) [N.m or N].
        utilisation: Largest effort / effort limit over the joints (...,), 1 = at the limit.
        limiting_joint: Index of the joint with that utilisation (...,); -1 where there is none.
        status: Status of each point (...,).
        joint_names: Names of the actuated joints (n).
    """

    joint_efforts: FloatArray
    utilisation: FloatArray
    limiting_joint: NDArray[np.int32]
    status: StatusArray
    joint_names: tuple[str, ...]


class EffortLimits(NamedTuple):
    """Effort limits in force of all joints of the robot.

    Attributes:
        joint_names: Names of the joints.
        lower: Least efforts, <= 0 [N.m or N].
        upper: Greatest efforts, >= 0 [N.m or N].
    """

    joint_names: tuple[str, ...]
    lower: FloatArray
    upper: FloatArray

    @classmethod
    def from_message(cls, message: Any) -> EffortLimits:
        """Return the content of a `leg_msgs/EffortLimits`."""
        lower, upper = from_field(message.lower), from_field(message.upper)
        return cls(tuple(message.joint_names), lower, upper)


class GeometryParameter(NamedTuple):
    """One dimension of a mechanism.

    Attributes:
        symbol: The literature's symbol.
        value: Value [unit].
        unit: "m", "rad" or "1".
    """

    symbol: str
    value: float
    unit: str


class LegDescription(NamedTuple):
    """Answer of `describe`; the comments of `leg_msgs/LegDescription` say more.

    Attributes:
        robot: Name of the robot.
        leg: Name of the leg.
        leg_type: Name of its type in the robot description.
        mechanism: Name of its mechanism.
        base_frame: Name of the robot's base frame.
        leg_frame: Name of the leg's own frame.
        mount_position: Origin of the leg frame in the base frame (3,) [m].
        mount_orientation: Quaternion x, y, z, w of the leg frame in the base frame (4,).
        mirrored: Whether this leg is its leg type mirrored in x.
        joint_names: Names of the actuated joints (n).
        joint_types: "revolute" or "prismatic" (n).
        joint_units: Units of position (n).
        joint_limits: Least and greatest position (n, 2) [rad or m].
        effort_units: Units of effort (n).
        effort_limits: Least and greatest effort (n, 2) [N.m or N].
        passive_joint_names: Names of the passive joints (p).
        passive_joint_limits: Least and greatest excursion (p, 2) [rad or m].
        task_coordinates: Names of the foot's coordinates (t).
        task_units: Their units (t).
        assembly_modes: Names of the branches of the closed chain; the first is the default.
        initial_foot_position: Foot in the initial pose, in the leg's own frame (3,) [m].
        geometry: The mechanism's dimensions by name.
        index_names: Names that `evaluate_indices` accepts.
    """

    robot: str
    leg: str
    leg_type: str
    mechanism: str
    base_frame: str
    leg_frame: str
    mount_position: FloatArray
    mount_orientation: FloatArray
    mirrored: bool
    joint_names: tuple[str, ...]
    joint_types: tuple[str, ...]
    joint_units: tuple[str, ...]
    joint_limits: FloatArray
    effort_units: tuple[str, ...]
    effort_limits: FloatArray
    passive_joint_names: tuple[str, ...]
    passive_joint_limits: FloatArray
    task_coordinates: tuple[str, ...]
    task_units: tuple[str, ...]
    assembly_modes: tuple[str, ...]
    initial_foot_position: FloatArray
    geometry: dict[str, GeometryParameter]
    index_names: tuple[str, ...]

    @classmethod
    def from_message(cls, message: Any) -> LegDescription:
        """Return the content of a `leg_msgs/LegDescription`."""
        origin, turn = message.mount.position, message.mount.orientation

        def pairs(lower: Any, upper: Any) -> FloatArray:
            return np.stack([from_field(lower), from_field(upper)], axis=-1)

        parameters = zip(
            message.geometry_symbols, message.geometry_values, message.geometry_units, strict=True
        )
        return cls(
            robot=message.robot,
            leg=message.leg,
            leg_type=message.leg_type,
            mechanism=message.mechanism,
            base_frame=message.base_frame,
            leg_frame=message.leg_frame,
            mount_position=np.array([origin.x, origin.y, origin.z]),
            mount_orientation=np.array([turn.x, turn.y, turn.z, turn.w]),
            mirrored=message.mirrored,
            joint_names=tuple(message.joint_names),
            joint_types=tuple(message.joint_types),
            joint_units=tuple(message.joint_position_units),
            joint_limits=pairs(message.joint_position_lower, message.joint_position_upper),
            effort_units=tuple(message.joint_effort_units),
            effort_limits=pairs(message.joint_effort_lower, message.joint_effort_upper),
            passive_joint_names=tuple(message.passive_joint_names),
            passive_joint_limits=pairs(message.passive_joint_lower, message.passive_joint_upper),
            task_coordinates=tuple(message.task_coordinates),
            task_units=tuple(message.task_units),
            assembly_modes=tuple(message.assembly_modes),
            initial_foot_position=np.array(message.initial_foot_position),
            geometry={
                name: GeometryParameter(*parameter)
                for name, parameter in zip(message.geometry_names, parameters, strict=True)
            },
            index_names=tuple(message.index_names),
        )
