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
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from leg_msgs.action import ComputeIndexMap, SearchGeometry
from leg_msgs.msg import EffortLimits as EffortLimitsMessage
from leg_msgs.srv import (
    ComputeEfforts,
    EvaluateIndices,
    ForwardKinematics,
    GetIndexMap,
    GetJacobian,
    GetLegDescription,
    InverseKinematics,
    QueryFootholds,
    QueryStepLength,
    SetEffortLimits,
)
from leg_msgs_py.arrays import from_field, to_field
from leg_msgs_py.client.calls import Caller, CallFuture
from leg_msgs_py.client.goals import GoalFuture, send_goal
from leg_msgs_py.clouds import from_cloud
from leg_msgs_py.errors import InvalidInputError, TooLargeError
from leg_msgs_py.grounds import Ground, ground_message
from leg_msgs_py.results import (
    EffortLimits,
    Efforts,
    FloatArray,
    Footholds,
    FootPositions,
    IndexCloud,
    IndexMap,
    Indices,
    Jacobians,
    JointPositions,
    LegDescription,
    MapProgress,
    SearchedGeometry,
    SearchProgress,
    StepLengths,
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
        "query_footholds": QueryFootholds,
        "query_step_length": QueryStepLength,
        "set_effort_limits": SetEffortLimits,
    },
    "maps": {
        "get_index_map": GetIndexMap,
    },
}


class LegClient:
    """Asks the kinematics, statics and maps nodes of one robot.

    Every call takes points of any leading axes (..., t) and gives arrays with the same leading
    axes. Calls raise a `LegServiceError` of `leg_msgs_py.errors`: `UnknownLegError`,
    `InvalidInputError`, `TooLargeError`, `TimedOutError`, `ServerUnavailableError` and so on. Each
    has a twin that ends in `_async` and returns a future at once.

    Args:
        node: A node that spins elsewhere and is to be shared; None for a node of its own.
        namespace: Namespace of the robot's nodes, such as "robot_1"; "" for none.
        timeout: Time allowed for each call, including the wait for the server [s].
        domain_id: ROS domain if the node is its own; None for that of the environment.
        max_points: Points accepted in one call, as the nodes' parameter of this name: more are
            refused here, before they are sent.
    """

    def __init__(
        self,
        *,
        node: Node | None = None,
        namespace: str = "",
        timeout: float = 5.0,
        domain_id: int | None = None,
        max_points: int = 1_000_000,
    ) -> None:
        self._max_points = max_points
        prefix = f"/{namespace.strip('/')}" if namespace.strip("/") else ""
        self._services = {
            service: (f"{prefix}/{server}/{service}", service_type)
            for server, services in SERVICES.items()
            for service, service_type in services.items()
        }
        self._map_action = (f"{prefix}/maps/compute_index_map", ComputeIndexMap)
        self._search_action = (f"{prefix}/designs/search_geometry", SearchGeometry)
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
        joints, batch = self._points("joint_positions", joint_positions)
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
        points, batch = self._points("positions", positions)
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
        points, batch = self._points(field, values)
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
        points, batch = self._points("positions", positions)
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
        points, batch = self._points("positions", positions)
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

    # ------------------------------------------------------------------ planning

    def query_footholds(
        self,
        leg: str,
        positions: ArrayLike,
        ground: Ground | str | float,
        load: float = 0.0,
        *,
        moment: ArrayLike = (0.0, 0.0, 0.0),
        any_direction_moment: float = 0.0,
        bias_efforts: ArrayLike = (),
        frame: str = "",
        efforts: bool = False,
    ) -> Footholds:
        """Return what the leg can carry at candidate footholds.

        Args:
            leg: Name of the leg; "" if the robot has exactly one.
            positions: Candidates (..., 3) [m].
            ground: The ground: its name, its friction coefficient, or a `Ground` with a normal.
            load: Force normal to the ground that has to be borne [N].
            moment: Moment of the ground on the foot (3,) [N.m]; zero on hard ground.
            any_direction_moment: Further horizontal moment of unknown direction [N.m].
            bias_efforts: Efforts that the actuators exert anyway (n,) [N.m or N]; () for none.
            frame: Frame of all vectors: the leg's own ("" or its name) or the base frame.
            efforts: Whether to return joint efforts and forces, too.
        """
        return self.query_footholds_async(
            leg,
            positions,
            ground,
            load,
            moment=moment,
            any_direction_moment=any_direction_moment,
            bias_efforts=bias_efforts,
            frame=frame,
            efforts=efforts,
        ).wait()

    def query_footholds_async(
        self,
        leg: str,
        positions: ArrayLike,
        ground: Ground | str | float,
        load: float = 0.0,
        *,
        moment: ArrayLike = (0.0, 0.0, 0.0),
        any_direction_moment: float = 0.0,
        bias_efforts: ArrayLike = (),
        frame: str = "",
        efforts: bool = False,
    ) -> CallFuture[Footholds]:
        """Ask as `query_footholds` does; return a future."""
        points, batch = self._points("positions", positions)
        request = QueryFootholds.Request(
            leg=leg,
            positions=to_field(points),
            ground=ground_message(ground),
            required_load=_number("load", load),
            required_moment=_vector("moment", moment),
            any_direction_moment=_number("any_direction_moment", any_direction_moment),
            bias_efforts=to_field(_points("bias_efforts", bias_efforts)[0]),
            include_efforts=efforts,
        )
        request.header.frame_id = frame

        def decode(response: Any) -> Footholds:
            status = _status(response, batch, "positions", points)
            names = tuple(response.joint_names)
            return Footholds(
                from_field(response.verdict, batch, np.uint8),
                status,
                from_field(response.load_capacity, batch),
                from_field(response.rated_friction, batch),
                from_field(response.rated_friction_full, batch),
                from_field(response.friction_margin, batch),
                from_field(response.utilisation, batch),
                from_field(response.limiting_joint, batch, np.int32),
                from_field(response.ranking, dtype=np.int32),
                response.best,
                response.friction_coefficient,
                names,
                from_field(response.joint_efforts, (*batch, len(names))),
                from_field(response.forces, (*batch, 3 if efforts else 0)),
            )

        return self._call("query_footholds", request, decode)

    def query_step_length(
        self,
        legs: str | Sequence[str],
        heights: ArrayLike,
        ground: Ground | str | float,
        load: float = 0.0,
        *,
        lateral_offsets: ArrayLike = (),
        direction: ArrayLike = (0.0, 0.0, 0.0),
        moment: ArrayLike = (0.0, 0.0, 0.0),
        any_direction_moment: float = 0.0,
        by_rated_friction: bool = False,
        frame: str = "",
    ) -> StepLengths:
        """Return how far the next step may go, of each leg and of all together.

        Args:
            legs: Name of a leg, or names of several; () for all.
            heights: z of the ground in the frame (...,) [m]; -0.8 if the body is 0.8 m above it.
            ground: The ground: its name, its friction coefficient, or a `Ground` with a normal.
            load: Force normal to the ground that each leg has to bear [N].
            lateral_offsets: Distance of each leg's line from the origin of its own frame, to the
                right of the walking direction (L,), or one for all [m]; () for none.
            direction: Walking direction, horizontal (3,) of any length; zero is forward.
            moment: Moment of the ground on the foot (3,) [N.m]; zero on hard ground.
            any_direction_moment: Further horizontal moment of unknown direction [N.m].
            by_rated_friction: Whether a point is feasible where the ground offers the rated
                friction, whatever the load.
            frame: Frame of all vectors: "" is the leg's own for one leg, the base for several.
        """
        return self.query_step_length_async(
            legs,
            heights,
            ground,
            load,
            lateral_offsets=lateral_offsets,
            direction=direction,
            moment=moment,
            any_direction_moment=any_direction_moment,
            by_rated_friction=by_rated_friction,
            frame=frame,
        ).wait()

    def query_step_length_async(
        self,
        legs: str | Sequence[str],
        heights: ArrayLike,
        ground: Ground | str | float,
        load: float = 0.0,
        *,
        lateral_offsets: ArrayLike = (),
        direction: ArrayLike = (0.0, 0.0, 0.0),
        moment: ArrayLike = (0.0, 0.0, 0.0),
        any_direction_moment: float = 0.0,
        by_rated_friction: bool = False,
        frame: str = "",
    ) -> CallFuture[StepLengths]:
        """Ask as `query_step_length` does; return a future."""
        values = np.asarray(heights, dtype=np.float64)
        request = QueryStepLength.Request(
            legs=[legs] if isinstance(legs, str) else list(legs),
            heights=to_field(values),
            lateral_offsets=to_field(lateral_offsets),
            direction=_vector("direction", direction),
            ground=ground_message(ground),
            required_load=_number("load", load),
            required_moment=_vector("moment", moment),
            any_direction_moment=_number("any_direction_moment", any_direction_moment),
            criterion=QueryStepLength.Request.RATED_FRICTION
            if by_rated_friction
            else QueryStepLength.Request.CAPACITY,
        )
        request.header.frame_id = frame

        def decode(response: Any) -> StepLengths:
            batch = (len(response.legs), *values.shape)
            profile = (*batch, response.profile_points)
            return StepLengths(
                tuple(response.legs),
                from_field(response.lengths, batch),
                from_field(response.starts, (*batch, 3)),
                from_field(response.ends, (*batch, 3)),
                from_field(response.start_limits, batch, np.uint8),
                from_field(response.end_limits, batch, np.uint8),
                from_field(response.load_capacity, profile),
                from_field(response.rated_friction, profile),
                from_field(response.common_lengths, values.shape),
                from_field(response.limiting_leg, values.shape, np.int32),
                response.best_height,
                response.friction_coefficient,
            )

        return self._call("query_step_length", request, decode)

    # ------------------------------------------------------------------ maps

    def index_map(
        self,
        leg: str,
        height: float,
        resolution: float,
        layers: Sequence[str] = (),
        ground: Ground | str | float = 0.0,
    ) -> IndexMap:
        """Return indices over a horizontal plane of a leg's workspace.

        Args:
            leg: Name of the leg; "" if the robot has exactly one.
            height: z of the plane in the leg's own frame [m].
            resolution: Spacing of the grid [m].
            layers: Names of indices, or "load_capacity"; none for all that the leg has.
            ground: The ground, for the layer "load_capacity".
        """
        return self.index_map_async(leg, height, resolution, layers, ground).wait()

    def index_map_async(
        self,
        leg: str,
        height: float,
        resolution: float,
        layers: Sequence[str] = (),
        ground: Ground | str | float = 0.0,
    ) -> CallFuture[IndexMap]:
        """Ask as `index_map` does; return a future."""
        request = GetIndexMap.Request(
            leg=leg,
            height=_number("height", height),
            resolution=_number("resolution", resolution),
            layers=list(layers),
            ground=ground_message(ground),
        )

        def decode(response: Any) -> IndexMap:
            names = tuple(response.layers)
            shape = (response.ny, response.nx)
            return IndexMap(
                response.x0 + response.resolution * np.arange(response.nx),
                response.y0 + response.resolution * np.arange(response.ny),
                response.height,
                names,
                tuple(response.symbols),
                tuple(response.units),
                from_field(response.values, (*shape, len(names))),
                from_field(response.status, shape, np.uint8),
            )

        return self._call("get_index_map", request, decode)

    def compute_index_map(
        self,
        leg: str,
        resolution: float,
        layers: Sequence[str] = (),
        ground: Ground | str | float = 0.0,
        *,
        frame: str = "",
        on_progress: Callable[[MapProgress], None] = lambda progress: None,
    ) -> IndexCloud:
        """Return indices over the whole workspace of a leg.

        The client's timeout does not count for the work, but for the node's silence.

        Args:
            leg: Name of the leg; "" if the robot has exactly one.
            resolution: Spacing of the grid [m].
            layers: Names of indices, or "load_capacity"; none for all that the leg has.
            ground: The ground, for the layer "load_capacity".
            frame: Frame of the points: the leg's own ("" or its name) or the base frame.
            on_progress: Called in the client's thread now and then; what it raises ends the work.
        """
        return self.compute_index_map_async(
            leg, resolution, layers, ground, frame=frame, on_progress=on_progress
        ).wait()

    def compute_index_map_async(
        self,
        leg: str,
        resolution: float,
        layers: Sequence[str] = (),
        ground: Ground | str | float = 0.0,
        *,
        frame: str = "",
        on_progress: Callable[[MapProgress], None] = lambda progress: None,
    ) -> GoalFuture[IndexCloud]:
        """Ask as `compute_index_map` does; return a future.

        Its `cancel` stops the work; `wait` then raises a `CancelledError` that has what was
        computed until then as its `partial`.
        """
        goal = ComputeIndexMap.Goal(
            leg=leg,
            resolution=_number("resolution", resolution),
            layers=list(layers),
            ground=ground_message(ground),
        )
        goal.header.frame_id = frame

        def decode(result: Any) -> IndexCloud:
            positions, fields = from_cloud(result.cloud)
            names = tuple(result.layers)
            columns = [fields[name] for name in names if name in fields]
            values = np.stack(columns, axis=-1) if columns else np.empty((len(positions), 0))
            return IndexCloud(
                positions,
                names,
                tuple(result.units),
                values.astype(np.float64),
                result.cloud.header.frame_id,
                result.fraction,
                result.elapsed,
            )

        def tell(feedback: Any) -> None:
            on_progress(
                MapProgress(
                    feedback.fraction,
                    feedback.elapsed,
                    feedback.remaining,
                    tuple(feedback.layers),
                    from_field(feedback.best),
                    from_field(feedback.best_positions, (-1, 3)),
                )
            )

        return send_goal(self._caller, self._map_action, goal, decode, tell)

    # ------------------------------------------------------------------ designs

    def search_geometry(
        self,
        study: str | os.PathLike[str],
        folder: str | os.PathLike[str] = "",
        *,
        on_progress: Callable[[SearchProgress], None] = lambda progress: None,
    ) -> SearchedGeometry:
        """Search for better dimensions of a leg; the designs node does it.

        The client's timeout does not count for the work, but for the node's silence.

        Args:
            study: Text of a study file (YAML), or the file's path as a `Path`.
            folder: Where results go, on the machine of the node; a search of this study that
                stopped there goes on. "" for a new folder of the node's choice.
            on_progress: Called in the client's thread now and then; what it raises ends the work.
        """
        return self.search_geometry_async(study, folder, on_progress=on_progress).wait()

    def search_geometry_async(
        self,
        study: str | os.PathLike[str],
        folder: str | os.PathLike[str] = "",
        *,
        on_progress: Callable[[SearchProgress], None] = lambda progress: None,
    ) -> GoalFuture[SearchedGeometry]:
        """Ask as `search_geometry` does; return a future.

        Its `cancel` stops the work; `wait` then raises a `CancelledError` that has what was found
        until then as its `partial`.
        """
        text = study if isinstance(study, str) else Path(study).read_text(encoding="utf-8")
        goal = SearchGeometry.Goal(study=text, folder=str(folder))

        def decode(result: Any) -> SearchedGeometry:
            parameters, objectives = tuple(result.parameters), tuple(result.objectives)
            return SearchedGeometry(
                parameters,
                from_field(result.best_parameters, (-1, len(parameters))),
                objectives,
                from_field(result.best_objectives, (-1, len(objectives))),
                result.robot,
                result.folder,
                result.evaluated,
                result.feasible,
                result.elapsed,
            )

        def tell(feedback: Any) -> None:
            on_progress(
                SearchProgress(
                    feedback.evaluated,
                    feedback.total,
                    feedback.rate,
                    feedback.elapsed,
                    feedback.remaining,
                    tuple(feedback.objectives),
                    from_field(feedback.best),
                )
            )

        return send_goal(self._caller, self._search_action, goal, decode, tell)

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

    def _points(self, field: str, values: ArrayLike) -> tuple[FloatArray, tuple[int, ...]]:
        """Return points (..., k) as an array, and their leading axes, if they are not too many."""
        points, batch = _points(field, values)
        if math.prod(batch) > self._max_points:
            raise TooLargeError(
                f"{field}: {math.prod(batch)} points; allowed: at most {self._max_points} at once "
                "(max_points of the client, and parameter max_points of the nodes)"
            )
        return points, batch

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


def _number(field: str, value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"{field} must be a number: {error}") from None


def _vector(field: str, value: ArrayLike) -> FloatArray:
    """Return one vector (3,)."""
    vector, _ = _points(field, value)
    if vector.shape != (3,):
        raise InvalidInputError(f"{field} must have shape (3,), got {vector.shape}")
    return vector


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
