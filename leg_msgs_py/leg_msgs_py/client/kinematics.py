# SPDX-License-Identifier: Apache-2.0
"""Where the foot is, what the joints are, and the Jacobians between them."""

from __future__ import annotations

from typing import Any, NamedTuple

from leg_msgs.srv import ForwardKinematics, GetJacobian, InverseKinematics
from leg_msgs_py.arrays import FloatArray, StatusArray, from_field, to_field
from leg_msgs_py.client.inputs import points
from leg_msgs_py.client.questions import Request, question
from leg_msgs_py.errors import InvalidInputError
from leg_msgs_py.frames import Frame, put_frame
from numpy.typing import ArrayLike


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
        excursions: How far passive joints are from the initial pose (..., e) [rad or m], which
            limits bound; (..., 0) unless asked for.
        excursion_names: Names of the excursions (e), empty unless asked for.
    """

    joint_positions: FloatArray
    status: StatusArray
    joint_names: tuple[str, ...]
    assembly_modes: tuple[str, ...]
    passive_joint_positions: FloatArray
    passive_joint_names: tuple[str, ...]
    excursions: FloatArray
    excursion_names: tuple[str, ...]


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


@question("kinematics", ForwardKinematics)
def forward_kinematics(
    leg: str, joint_positions: ArrayLike, *, frame: Frame | str = "", assembly_mode: str = ""
) -> Request[FootPositions]:
    """Return where the foot is.

    Args:
        leg: Name of the leg; "" if the robot has exactly one.
        joint_positions: Actuated joints (..., n) [rad or m].
        frame: Frame wanted: the leg's own ("" or its name), the base frame, or a `Frame`.
        assembly_mode: Branch of the closed chain; "" is the default.
    """
    joints = points("joint_positions", joint_positions)
    request = ForwardKinematics.Request(
        leg=leg, joint_positions=to_field(joints.values), assembly_mode=assembly_mode
    )
    put_frame(request, frame)

    def decode(response: Any) -> FootPositions:
        status = joints.status(response)
        # Without points the response does not tell t, which is 3 for a leg.
        coordinates = len(response.positions) // status.size if status.size else 3
        positions = from_field(response.positions, (*joints.batch, coordinates))
        return FootPositions(positions=positions, status=status)

    return Request(request, decode, joints)


@question("kinematics", InverseKinematics)
def inverse_kinematics(
    leg: str,
    positions: ArrayLike,
    *,
    frame: Frame | str = "",
    assembly_mode: str = "",
    passive_joints: bool = False,
) -> Request[JointPositions]:
    """Return the joint positions that put the foot somewhere.

    Args:
        leg: Name of the leg; "" if the robot has exactly one.
        positions: Foot (..., t) [m].
        frame: Frame of the positions: the leg's own ("" or its name), the base frame, or a `Frame`.
        assembly_mode: Branch of the closed chain; "" is the default, "ALL" is every one.
        passive_joints: Whether to return the passive joints and their excursions, too.
    """
    feet = points("positions", positions)
    request = InverseKinematics.Request(
        leg=leg,
        positions=to_field(feet.values),
        assembly_mode=assembly_mode,
        include_passive_joints=passive_joints,
    )
    put_frame(request, frame)

    def decode(response: Any) -> JointPositions:
        modes = tuple(response.assembly_modes)
        status = feet.status(response, (len(modes),) if assembly_mode == "ALL" else ())
        names = tuple(response.joint_names)
        passive, excursions = tuple(response.passive_joint_names), tuple(response.excursion_names)
        return JointPositions(
            joint_positions=from_field(response.joint_positions, (*status.shape, len(names))),
            status=status,
            joint_names=names,
            assembly_modes=modes,
            passive_joint_positions=from_field(
                response.passive_joint_positions, (*status.shape, len(passive))
            ),
            passive_joint_names=passive,
            excursions=from_field(response.excursions, (*status.shape, len(excursions))),
            excursion_names=excursions,
        )

    return Request(request, decode, feet)


@question("kinematics", GetJacobian)
def jacobian(
    leg: str,
    positions: ArrayLike | None = None,
    *,
    joint_positions: ArrayLike | None = None,
    frame: Frame | str = "",
    assembly_mode: str = "",
) -> Request[Jacobians]:
    """Return the Jacobians of poses given by foot positions or by joint positions.

    Args:
        leg: Name of the leg; "" if the robot has exactly one.
        positions: Foot (..., t) [m]; None if joint positions are given.
        joint_positions: Actuated joints (..., n) [rad or m]; None if positions are given.
        frame: Frame of positions and Jacobians: the leg's own ("" or its name), the base frame, or
            a `Frame`.
        assembly_mode: Branch of the closed chain; "" is the default.
    """
    if positions is not None and joint_positions is None:
        poses = points("positions", positions)
    elif joint_positions is not None and positions is None:
        poses = points("joint_positions", joint_positions)
    else:
        raise InvalidInputError("give either positions or joint_positions")
    request = GetJacobian.Request(
        leg=leg, assembly_mode=assembly_mode, **{poses.field: to_field(poses.values)}
    )
    put_frame(request, frame)

    def decode(response: Any) -> Jacobians:
        status = poses.status(response)
        names = tuple(response.joint_names)
        return Jacobians(
            jacobian=from_field(response.jacobian, (*poses.batch, -1, len(names))),
            angular_jacobian=from_field(response.angular_jacobian, (*poses.batch, 3, len(names))),
            condition_number=from_field(response.condition_number, poses.batch),
            status=status,
            joint_names=names,
        )

    return Request(request, decode, poses)
