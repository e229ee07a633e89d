"""A client for gait planners: numpy arrays in, named tuples out, exceptions for failures.

    from leg_msgs_py.client import LegClient

    with LegClient() as legs:
        print(legs.legs())
        answer = legs.inverse_kinematics("left_front", [[0.0, -0.05, -0.7], [0.0, 0.05, -0.7]])
        print(answer.joint_positions, answer.status)

`LegClient()` has a node and a thread of its own, so its calls may block anywhere, in callbacks of
other nodes too. `LegClient(node=self)` shares a node that already spins: `await` the `..._async`
methods in its callbacks, and use the blocking ones in other threads only.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from leg_msgs.msg import EffortLimits as EffortLimitsMessage
from leg_msgs.srv import (
    ComputeEfforts,
    EvaluateIndices,
    ForwardKinematics,
    GetJacobian,
    GetLegDescription,
    InverseKinematics,
    SetEffortLimits,
)
from leg_msgs_py.arrays import from_field, to_field
from leg_msgs_py.calls import Caller, CallFuture
from leg_msgs_py.errors import InvalidInputError
from leg_msgs_py.results import (
    EffortLimits,
    Efforts,
    FloatArray,
    FootPositions,
    Indices,
    Jacobians,
    JointPositions,
    LegDescription,
)
from numpy.typing import ArrayLike
from rclpy.node import Node

SERVICES = {
    "kinematics": {
        "forward_kinematics": ForwardKinematics,
        "inverse_kinematics": InverseKinematics,
        "get_jacobian": GetJacobian,
    },
    "statics": {
        "compute_efforts": ComputeEfforts,
        "evaluate_indices": EvaluateIndices,
        "get_leg_description": GetLegDescription,
        "set_effort_limits": SetEffortLimits,
    },
}


class LegClient:
    """Asks the kinematics and statics nodes of one robot.

    Every call takes points of any leading axes (..., t) and gives arrays with the same leading
    axes. Calls raise a `LegServiceError` of `leg_msgs_py.errors`: `UnknownLegError`,
    `InvalidInputError`, `TooLargeError`, `TimedOutError`, `ServerUnavailableError` and so on. Each
    has a twin that ends in `_async` and returns a future at once.

    Args:
        node: A node that spins elsewhere and is to be shared; None for a node of its own.
        namespace: Namespace of the robot's nodes, such as "robot_1"; "" for none.
        timeout: Time allowed for each call, including the wait for the server [s].
        domain_id: ROS domain if the node is its own; None for that of the environment.
    """

    def __init__(
        self,
        *,
        node: Node | None = None,
        namespace: str = "",
        timeout: float = 5.0,
        domain_id: int | None = None,
    ) -> None:
        prefix = f"/{namespace.strip('/')}" if namespace.strip("/") else ""
        self._services = {
            service: (f"{prefix}/{server}/{service}", service_type)
            for server, services in SERVICES.items()
            for service, service_type in services.items()
        }
        self._effort_limits_topic = f"{prefix}/statics/effort_limits"
        self._caller = Caller(node, timeout, domain_id)

    @property
    def node(self) -> Node:
        """The node through which the client talks."""
        return self._caller.node

    def __enter__(self) -> LegClient:
        """Return the client; leaving the block closes it."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the client."""
        self.close()

    def close(self) -> None:
        """Cancel calls under way and free what the client uses."""
        self._caller.close()

    def wait_until_ready(self, timeout: float = 30.0) -> None:
        """Wait until every service of the robot is there.

        Raises:
            ServerUnavailableError: If one is not, after `timeout` seconds.
        """
        self._caller.wait_for_servers(self._services.values(), timeout)

    # ------------------------------------------------------------------ kinematics

    def forward_kinematics(
        self, leg: str, joint_positions: ArrayLike, *, frame: str = "", assembly_mode: str = ""
    ) -> FootPositions:
        """Return where the foot is.

        Args:
            leg: Name of the leg; "" if the robot has exactly one.
            joint_positions: Actuated joints (..., n) [rad or m].
            frame: Frame wanted: the leg's own ("" or its name) or the robot's base frame.
            assembly_mode: Branch of the closed chain; "" is the default.
        """
        return self.forward_kinematics_async(
            leg, joint_positions, frame=frame, assembly_mode=assembly_mode
        ).wait()

    def forward_kinematics_async(
        self, leg: str, joint_positions: ArrayLike, *, frame: str = "", assembly_mode: str = ""
    ) -> CallFuture[FootPositions]:
        """Ask as `forward_kinematics` does; return a future."""
        joints, batch = _points("joint_positions", joint_positions)
        request = ForwardKinematics.Request(
            leg=leg, joint_positions=to_field(joints), assembly_mode=assembly_mode
        )
        request.header.frame_id = frame

        def decode(response: Any) -> FootPositions:
            status = _status(response, batch, "joint_positions", joints)
            return FootPositions(_rows(response.positions, batch), status)

        return self._call("forward_kinematics", request, decode)

    def inverse_kinematics(
        self,
        leg: str,
        positions: ArrayLike,
        *,
        frame: str = "",
        assembly_mode: str = "",
        passive_joints: bool = False,
    ) -> JointPositions:
        """Return the joint positions that put the foot somewhere.

        Args:
            leg: Name of the leg; "" if the robot has exactly one.
            positions: Foot (..., t) [m].
            frame: Frame of the positions: the leg's own ("" or its name) or the base frame.
            assembly_mode: Branch of the closed chain; "" is the default, "ALL" is every one.
            passive_joints: Whether to return the passive joints, too.
        """
        return self.inverse_kinematics_async(
            leg,
            positions,
            frame=frame,
            assembly_mode=assembly_mode,
            passive_joints=passive_joints,
        ).wait()

    def inverse_kinematics_async(
        self,
        leg: str,
        positions: ArrayLike,
        *,
        frame: str = "",
        assembly_mode: str = "",
        passive_joints: bool = False,
    ) -> CallFuture[JointPositions]:
        """Ask as `inverse_kinematics` does; return a future."""
        points, batch = _points("positions", positions)
        request = InverseKinematics.Request(
            leg=leg,
            positions=to_field(points),
            assembly_mode=assembly_mode,
            include_passive_joints=passive_joints,
        )
        request.header.frame_id = frame

        def decode(response: Any) -> JointPositions:
            modes = tuple(response.assembly_modes)
            shape = (len(modes), *batch) if assembly_mode == "ALL" else batch
            names, passive = tuple(response.joint_names), tuple(response.passive_joint_names)
            status = _status(response, shape, "positions", points)
            return JointPositions(
                from_field(response.joint_positions, (*shape, len(names))),
                status,
                names,
                modes,
                from_field(response.passive_joint_positions, (*shape, len(passive))),
                passive,
            )

        return self._call("inverse_kinematics", request, decode)

    def jacobian(
        self,
        leg: str,
        positions: ArrayLike | None = None,
        *,
        joint_positions: ArrayLike | None = None,
        frame: str = "",
        assembly_mode: str = "",
    ) -> Jacobians:
        """Return the Jacobians of poses given by foot positions or by joint positions.

        Args:
            leg: Name of the leg; "" if the robot has exactly one.
            positions: Foot (..., t) [m]; None if joint positions are given.
            joint_positions: Actuated joints (..., n) [rad or m]; None if positions are given.
            frame: Frame of positions and Jacobians: the leg's own ("" or its name) or the base's.
            assembly_mode: Branch of the closed chain; "" is the default.
        """
        return self.jacobian_async(
            leg,
            positions,
            joint_positions=joint_positions,
            frame=frame,
            assembly_mode=assembly_mode,
        ).wait()

    def jacobian_async(
        self,
        leg: str,
        positions: ArrayLike | None = None,
        *,
        joint_positions: ArrayLike | None = None,
        frame: str = "",
        assembly_mode: str = "",
    ) -> CallFuture[Jacobians]:
        """Ask as `jacobian` does; return a future."""
        if positions is not None and joint_positions is None:
            field, values = "positions", positions
        elif joint_positions is not None and positions is None:
            field, values = "joint_positions", joint_positions
        else:
            raise InvalidInputError("give either positions or joint_positions")
        points, batch = _points(field, values)
        request = GetJacobian.Request(
            leg=leg, assembly_mode=assembly_mode, **{field: to_field(points)}
        )
        request.header.frame_id = frame

        def decode(response: Any) -> Jacobians:
            names = tuple(response.joint_names)
            status = _status(response, batch, field, points)
            return Jacobians(
                from_field(response.jacobian, (*batch, -1, len(names))),
                from_field(response.angular_jacobian, (*batch, 3, len(names))),
                from_field(response.condition_number, batch),
                status,
                names,
            )

        return self._call("get_jacobian", request, decode)

    # ------------------------------------------------------------------ statics

    def evaluate_indices(
        self,
        leg: str,
        positions: ArrayLike,
        names: Sequence[str] = (),
        *,
        frame: str = "",
        assembly_mode: str = "",
    ) -> Indices:
        """Return performance indices at foot positions.

        Args:
            leg: Name of the leg; "" if the robot has exactly one.
            positions: Foot (..., t) [m].
            names: Names of the indices; none for all that the leg has.
            frame: Frame of the positions: the leg's own ("" or its name) or the base frame.
            assembly_mode: Branch of the closed chain; "" is the default.
        """
        return self.evaluate_indices_async(
            leg, positions, names, frame=frame, assembly_mode=assembly_mode
        ).wait()

    def evaluate_indices_async(
        self,
        leg: str,
        positions: ArrayLike,
        names: Sequence[str] = (),
        *,
        frame: str = "",
        assembly_mode: str = "",
    ) -> CallFuture[Indices]:
        """Ask as `evaluate_indices` does; return a future."""
        points, batch = _points("positions", positions)
        request = EvaluateIndices.Request(
            leg=leg, positions=to_field(points), assembly_mode=assembly_mode, names=list(names)
        )
        request.header.frame_id = frame

        def decode(response: Any) -> Indices:
            status = _status(response, batch, "positions", points)
            return Indices(
                from_field(response.values, (*batch, len(response.names))),
                status,
                tuple(response.names),
                tuple(response.symbols),
                tuple(response.units),
            )

        return self._call("evaluate_indices", request, decode)

    def compute_efforts(
        self,
        leg: str,
        positions: ArrayLike,
        forces: ArrayLike,
        moments: ArrayLike | None = None,
        *,
        frame: str = "",
        assembly_mode: str = "",
    ) -> Efforts:
        """Return the joint efforts that hold what the ground applies to the foot.

        Args:
            leg: Name of the leg; "" if the robot has exactly one.
            positions: Foot (..., t) [m].
            forces: Force of the ground on the foot (..., 3), or one for all (3,) [N].
            moments: Moment of the ground on the foot, likewise [N.m]; None for hard ground.
            frame: Frame of all three: the leg's own ("" or its name) or the base frame.
            assembly_mode: Branch of the closed chain; "" is the default.
        """
        return self.compute_efforts_async(
            leg, positions, forces, moments, frame=frame, assembly_mode=assembly_mode
        ).wait()

    def compute_efforts_async(
        self,
        leg: str,
        positions: ArrayLike,
        forces: ArrayLike,
        moments: ArrayLike | None = None,
        *,
        frame: str = "",
        assembly_mode: str = "",
    ) -> CallFuture[Efforts]:
        """Ask as `compute_efforts` does; return a future."""
        points, batch = _points("positions", positions)
        request = ComputeEfforts.Request(
            leg=leg,
            positions=to_field(points),
            assembly_mode=assembly_mode,
            forces=to_field(_vectors("forces", forces, batch)),
            moments=to_field([] if moments is None else _vectors("moments", moments, batch)),
        )
        request.header.frame_id = frame

        def decode(response: Any) -> Efforts:
            names = tuple(response.joint_names)
            status = _status(response, batch, "positions", points)
            return Efforts(
                from_field(response.joint_efforts, (*batch, len(names))),
                from_field(response.utilisation, batch),
                from_field(response.limiting_joint, batch, np.int32),
                status,
                names,
            )

        return self._call("compute_efforts", request, decode)

    # ------------------------------------------------------------------ robot

    def legs(self) -> tuple[str, ...]:
        """Return the names of all legs of the robot."""
        return self.legs_async().wait()

    def legs_async(self) -> CallFuture[tuple[str, ...]]:
        """Ask as `legs` does; return a future."""
        # The names come with the answer for any leg, also if there is none of that name.
        return self._caller.call(
            *self._services["get_leg_description"],
            GetLegDescription.Request(),
            lambda response: tuple(response.legs),
            check_error=lambda error: None,
        )

    def describe(self, leg: str) -> LegDescription:
        """Return what a leg is: names, frames, joints, limits, geometry.

        Args:
            leg: Name of the leg; "" if the robot has exactly one.
        """
        return self.describe_async(leg).wait()

    def describe_async(self, leg: str) -> CallFuture[LegDescription]:
        """Ask as `describe` does; return a future."""
        return self._call(
            "get_leg_description",
            GetLegDescription.Request(leg=leg),
            lambda response: LegDescription.from_message(response.description),
        )

    def set_effort_limits(
        self,
        leg: str,
        joint_names: Sequence[str],
        upper: ArrayLike,
        lower: ArrayLike | None = None,
    ) -> EffortLimits:
        """Change the effort limits of some joints of a leg; all or none.

        Args:
            leg: Name of the leg; "" if the robot has exactly one.
            joint_names: Joints to change.
            upper: Greatest efforts, >= 0, one a joint [N.m or N].
            lower: Least efforts, <= 0, one a joint [N.m or N]; None for -upper.

        Returns:
            The limits of all joints of the robot in force afterwards.
        """
        return self.set_effort_limits_async(leg, joint_names, upper, lower).wait()

    def set_effort_limits_async(
        self,
        leg: str,
        joint_names: Sequence[str],
        upper: ArrayLike,
        lower: ArrayLike | None = None,
    ) -> CallFuture[EffortLimits]:
        """Ask as `set_effort_limits` does; return a future."""
        request = SetEffortLimits.Request(
            leg=leg,
            joint_names=list(joint_names),
            lower=to_field([] if lower is None else lower),
            upper=to_field(upper),
        )
        return self._call(
            "set_effort_limits",
            request,
            lambda response: EffortLimits.from_message(response.limits),
        )

    def effort_limits(self) -> EffortLimits:
        """Return the effort limits last published; later calls return at once.

        Raises:
            ServerUnavailableError: If none are published within the time allowed.
        """
        message = self._caller.latest(self._effort_limits_topic, EffortLimitsMessage)
        return EffortLimits.from_message(message)

    def _call(self, service: str, request: Any, decode: Callable[[Any], Any]) -> CallFuture[Any]:
        return self._caller.call(*self._services[service], request, decode)


def _points(field: str, values: ArrayLike) -> tuple[FloatArray, tuple[int, ...]]:
    """Return points (..., k) as an array, and their leading axes."""
    try:
        points = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"{field} must be an array of numbers: {error}") from None
    if points.ndim == 0:
        raise InvalidInputError(f"{field} must have shape (..., k), got a single number")
    if points.shape == (0,):
        return points, (0,)  # no points at all, not one point of no coordinates
    return points, points.shape[:-1]


def _vectors(field: str, values: ArrayLike, batch: tuple[int, ...]) -> FloatArray:
    """Return one vector (3,) for all points, or one for each (..., 3)."""
    vectors, _ = _points(field, values)
    try:
        return vectors if vectors.ndim == 1 else np.broadcast_to(vectors, (*batch, 3))
    except ValueError:
        raise InvalidInputError(
            f"{field} must have shape (3,) or {(*batch, 3)}, got {vectors.shape}"
        ) from None


def _rows(field: Any, batch: tuple[int, ...]) -> FloatArray:
    """Return points (..., k); an empty batch does not tell k, which is 3 for a leg."""
    count = math.prod(batch)
    rows: FloatArray = from_field(field, (*batch, len(field) // count if count else 3))
    return rows


def _status(response: Any, batch: tuple[int, ...], field: str, points: FloatArray) -> Any:
    """Return the status of every point, checked to be as many as were asked for."""
    if len(response.status) != math.prod(batch):
        raise InvalidInputError(
            f"{field}: the last axis must be the leg's coordinates, got shape {points.shape}"
        )
    return from_field(response.status, batch, np.uint8)
