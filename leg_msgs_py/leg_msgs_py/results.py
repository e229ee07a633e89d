"""What the client's calls return: named tuples of numpy arrays.

Arrays have the leading axes (...) of the points asked for; `status` holds `leg_msgs/PointStatus`
constants, and points that are not OK have NaN where the service's comments say so.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from leg_msgs.msg import FootholdVerdict
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


class Footholds(NamedTuple):
    """Answer of `query_footholds`.

    Attributes:
        verdict: A `leg_msgs/FootholdVerdict` constant each (...,); 0 is feasible.
        status: Status of the poses alone (...,).
        load_capacity: Greatest force normal to the ground (...,) [N].
        rated_friction: mu_e = |F_y| / |F_z| (...,).
        rated_friction_full: The same with both horizontal components (...,).
        friction_margin: friction_coefficient - rated_friction (...,).
        utilisation: Largest effort / effort limit at the required load (...,), 1 = at the limit.
        limiting_joint: Index of the joint with that utilisation (...,); -1 where there is none.
        ranking: Flat indices of the feasible candidates, best first.
        best: The first of them; -1 if no candidate is feasible.
        friction_coefficient: Friction coefficient that was used.
        joint_names: Names of the actuated joints (n); empty unless efforts were asked for.
        joint_efforts: Efforts that hold the required load (..., n) [N.m or N].
        forces: Ground reaction that uses the actuators least (..., 3) [N].
    """

    verdict: NDArray[np.uint8]
    status: StatusArray
    load_capacity: FloatArray
    rated_friction: FloatArray
    rated_friction_full: FloatArray
    friction_margin: FloatArray
    utilisation: FloatArray
    limiting_joint: NDArray[np.int32]
    ranking: NDArray[np.int32]
    best: int
    friction_coefficient: float
    joint_names: tuple[str, ...]
    joint_efforts: FloatArray
    forces: FloatArray

    @property
    def feasible(self) -> NDArray[np.bool_]:
        """Whether the leg carries the required load (...,)."""
        return np.asarray(self.verdict == FootholdVerdict.FEASIBLE)


class StepLengths(NamedTuple):
    """Answer of `query_step_length` for L legs and heights (...,).

    Attributes:
        legs: Names of the legs (L).
        lengths: Step length of each leg (L, ...) [m]; 0 where no point is feasible.
        starts: Rear ends (L, ..., 3) [m]; NaN where there is none.
        ends: Front ends (L, ..., 3) [m].
        start_limits: `leg_msgs/FootholdVerdict` just behind the rear ends (L, ...).
        end_limits: The same just before the front ends (L, ...).
        load_capacity: Load capacity along the stances (L, ..., P) [N].
        rated_friction: mu_e along them (L, ..., P).
        common_lengths: The step that all legs can make together (...,) [m].
        limiting_leg: Index of the leg with the shortest step (...,).
        best_height: Flat index of the longest common step; -1 if there is none.
        friction_coefficient: Friction coefficient that was used.
    """

    legs: tuple[str, ...]
    lengths: FloatArray
    starts: FloatArray
    ends: FloatArray
    start_limits: NDArray[np.uint8]
    end_limits: NDArray[np.uint8]
    load_capacity: FloatArray
    rated_friction: FloatArray
    common_lengths: FloatArray
    limiting_leg: NDArray[np.int32]
    best_height: int
    friction_coefficient: float


class IndexMap(NamedTuple):
    """Answer of `index_map`: layers over a plane of the leg's own frame.

    Attributes:
        x: Grid coordinates along x (nx,) [m].
        y: Grid coordinates along y (ny,) [m].
        height: z of the plane [m].
        layers: Names of the layers (K).
        symbols: The literature's symbols (K).
        units: SI units (K).
        values: Values (ny, nx, K); NaN outside the workspace.
        status: Status of each point (ny, nx).
    """

    x: FloatArray
    y: FloatArray
    height: float
    layers: tuple[str, ...]
    symbols: tuple[str, ...]
    units: tuple[str, ...]
    values: FloatArray
    status: StatusArray

    def layer(self, name: str) -> FloatArray:
        """Return the values of one layer (ny, nx)."""
        return self.values[..., self.layers.index(name)]


class IndexCloud(NamedTuple):
    """Answer of `compute_index_map`: layers at the N grid points within the workspace.

    Attributes:
        positions: The points (N, 3) [m].
        layers: Names of the layers (K).
        units: SI units (K).
        values: Values (N, K), to single precision; NaN where a layer is not defined.
        frame: Frame of the points.
        fraction: Share of the workspace that is covered, less than 1 if it was cancelled.
        elapsed: Time that the work took [s].
    """

    positions: FloatArray
    layers: tuple[str, ...]
    units: tuple[str, ...]
    values: FloatArray
    frame: str
    fraction: float
    elapsed: float

    def layer(self, name: str) -> FloatArray:
        """Return the values of one layer (N,)."""
        return self.values[:, self.layers.index(name)]


class MapProgress(NamedTuple):
    """Progress of `compute_index_map`.

    Attributes:
        fraction: Share of the workspace computed so far, 0 to 1.
        elapsed: Time since the goal was accepted [s].
        remaining: Estimated time until the end [s]; NaN while it is not known.
        layers: Names of the layers (K).
        best: Best value of each layer so far (K,).
        best_positions: Where it is (K, 3) [m].
    """

    fraction: float
    elapsed: float
    remaining: float
    layers: tuple[str, ...]
    best: FloatArray
    best_positions: FloatArray


class SearchedGeometry(NamedTuple):
    """Answer of `search_geometry`: the M designs that no other beats in every objective.

    Attributes:
        parameters: Names of the dimensions that were varied (P).
        best_parameters: Dimensions of these designs (M, P) [SI].
        objectives: Names of the objectives (K).
        best_objectives: Objectives of these designs (M, K) [SI].
        robot: Robot description (YAML) with the winner's dimensions; "" if no design is feasible.
        folder: Where all results are, on the machine of the node.
        evaluated: Number of designs evaluated.
        feasible: How many of them can be assembled and keep all constraints.
        elapsed: Time that the work took [s].
    """

    parameters: tuple[str, ...]
    best_parameters: FloatArray
    objectives: tuple[str, ...]
    best_objectives: FloatArray
    robot: str
    folder: str
    evaluated: int
    feasible: int
    elapsed: float


class SearchProgress(NamedTuple):
    """Progress of `search_geometry`.

    Attributes:
        evaluated: Designs evaluated so far.
        total: Designs that will be evaluated.
        rate: Designs evaluated in a second [1/s].
        elapsed: Time since the goal was accepted [s].
        remaining: Estimated time until the end [s]; NaN while it is not known.
        objectives: Names of the objectives (K).
        best: Best value of each objective so far (K,); NaN while there is none.
    """

    evaluated: int
    total: int
    rate: float
    elapsed: float
    remaining: float
    objectives: tuple[str, ...]
    best: FloatArray


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
