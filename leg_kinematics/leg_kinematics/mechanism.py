"""What every leg mechanism offers: the one protocol that all layers above are written against."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import Field, dataclass, field, fields
from typing import Any, ClassVar, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray, StatusArray
from leg_kinematics.errors import GeometryError, UnknownNameError

Dimension = Literal["length", "angle", "ratio"]
SI_UNITS: dict[Dimension, str] = {"length": "m", "angle": "rad", "ratio": "1"}


@dataclass(frozen=True)
class Joint:
    """One joint of a mechanism.

    Attributes:
        name: Name within the mechanism, e.g. "crank_1".
        type: "revolute" or "prismatic".
    """

    name: str
    type: Literal["revolute", "prismatic"] = "revolute"

    @property
    def unit(self) -> str:
        """SI unit of the joint position."""
        return "rad" if self.type == "revolute" else "m"

    @property
    def effort_unit(self) -> str:
        """SI unit of the joint effort."""
        return "N.m" if self.type == "revolute" else "N"


class Posture(NamedTuple):
    """A solved leg: where the actuators stand, how the loops close, where the foot is.

    Attributes:
        joint_positions: Actuated joints (..., n) [rad or m].
        closure: Dependent coordinates that close the loops (..., m), named by the mechanism's
            `closure_names`; with the joint positions they fix every point of the linkage.
        foot_position: Foot in the leg frame (..., t) [m]; t = 3 for a point foot.
        status: `Status` of each point (...,).
    """

    joint_positions: FloatArray
    closure: FloatArray
    foot_position: FloatArray
    status: StatusArray


class Linkage(NamedTuple):
    """The points of a posture and the bars between them, for drawing.

    Attributes:
        names: Name of each point.
        points: Points in the leg frame (..., p, 3) [m].
        bars: Polylines as tuples of indices into `points`.
    """

    names: tuple[str, ...]
    points: FloatArray
    bars: tuple[tuple[int, ...], ...]


class Mechanism(Protocol):
    """A leg mechanism: a frozen dataclass of its geometry (SI units) with these members.

    Leg frame: z up, y the walking direction, x to the side. All arrays follow the one shape rule:
    any leading batch axes, the same leading axes back. n is the number of actuated joints, t that
    of the task coordinates: the foot's x, y, z, and for a manipulator its orientation after them.
    """

    name: ClassVar[str]
    joints: ClassVar[tuple[Joint, ...]]
    passive_joints: ClassVar[tuple[Joint, ...]]
    closure_names: ClassVar[tuple[str, ...]]
    assembly_modes: ClassVar[tuple[str, ...]]
    task_coordinates: ClassVar[tuple[str, ...]]
    task_units: ClassVar[tuple[str, ...]]

    @property
    def joint_limits(self) -> FloatArray:
        """Ranges of the actuated joints (n, 2) [rad or m]."""

    @property
    def passive_joint_limits(self) -> FloatArray:
        """Ranges of the passive joints (p, 2) [rad or m]."""

    @property
    def initial_posture(self) -> Posture:
        """The reference posture, from which excursions and assembly modes count."""

    def forward(self, joint_positions: ArrayLike, assembly_mode: str = "") -> Posture:
        """Solve for the foot: joint positions (..., n) [rad or m] to a `Posture`."""

    def inverse(self, foot_position: ArrayLike, assembly_mode: str = "") -> Posture:
        """Solve for the actuators: foot positions (..., t) [m] to a `Posture`."""

    def jacobian(self, posture: Posture) -> FloatArray:
        """J of v = J q', foot velocity from joint velocities (..., t, n)."""

    def angular_jacobian(self, posture: Posture) -> FloatArray:
        """J_omega of omega = J_omega q', angular velocity of the foot's body (..., 3, n)."""

    def passive_joint_positions(self, posture: Posture) -> FloatArray:
        """Passive joints as excursions from the initial posture (..., p) [rad or m]."""

    def linkage(self, posture: Posture) -> Linkage:
        """Points and bars of the leg in this posture."""


def inverse_with_jacobians(
    mechanism: Mechanism, foot_position: ArrayLike, assembly_mode: str = ""
) -> tuple[Posture, FloatArray, FloatArray]:
    """Return `inverse`, `jacobian` and `angular_jacobian` of the same points.

    A mechanism may offer all three in one pass as a method of this name.
    """
    one_pass = getattr(mechanism, "inverse_with_jacobians", None)
    if one_pass is not None:
        result: tuple[Posture, FloatArray, FloatArray] = one_pass(foot_position, assembly_mode)
        return result
    posture = mechanism.inverse(foot_position, assembly_mode)
    return posture, mechanism.jacobian(posture), mechanism.angular_jacobian(posture)


def parameter(doc: str, symbol: str, dimension: Dimension, default: float) -> Any:
    """Declare a geometry parameter of a mechanism dataclass.

    Args:
        doc: What it measures.
        symbol: The paper's symbol.
        dimension: "length" or "ratio" (must be > 0), or "angle".
        default: Default value in SI units.
    """
    return _parameter(doc, symbol, dimension, default, positive=dimension != "angle")


def offset(doc: str, symbol: str, default: float) -> Any:
    """Declare a geometry parameter that is a signed length (it may be zero or negative)."""
    return _parameter(doc, symbol, "length", default, positive=False)


def _parameter(
    doc: str, symbol: str, dimension: Dimension, default: float, *, positive: bool
) -> Any:
    metadata = {"doc": doc, "symbol": symbol, "dimension": dimension, "positive": positive}
    return field(default=default, metadata=metadata)


def geometry_parameters(mechanism: Any) -> tuple[Field[Any], ...]:
    """Return the fields of a mechanism (class or instance) that are geometry parameters."""
    return tuple(f for f in fields(mechanism) if "dimension" in f.metadata)


def geometry_values(mechanism: Any) -> FloatArray:
    """Return the geometry parameters of a mechanism in declaration order (g,) [SI]."""
    return np.array([getattr(mechanism, f.name) for f in geometry_parameters(mechanism)])


def check_geometry(mechanism: Any) -> None:
    """Check every geometry parameter by itself.

    Raises:
        GeometryError: If one is not finite, or is a length or ratio that is not positive.
    """
    for f in geometry_parameters(mechanism):
        value = getattr(mechanism, f.name)
        if not np.isfinite(value):
            raise GeometryError(f"{f.name} ({f.metadata['symbol']}) must be finite, got {value}")
        if f.metadata["positive"] and value <= 0.0:
            unit = SI_UNITS[f.metadata["dimension"]]
            raise GeometryError(
                f"{f.name} ({f.metadata['symbol']}) must be > 0 [{unit}], got {value}"
            )


def check_limits(name: str, limits: Any, joints: Sequence[Joint]) -> FloatArray:
    """Return joint ranges as an array (len(joints), 2).

    Args:
        name: Name of the field for the error message.
        limits: Pairs (lower, upper), one a joint, with lower ≤ upper.
        joints: The joints they belong to.

    Raises:
        GeometryError: If the number of pairs differs, or a pair is reversed or NaN.
    """
    array = np.asarray(limits, dtype=np.float64)
    if array.shape != (len(joints), 2):
        raise GeometryError(
            f"{name} must be {len(joints)} pairs (lower, upper), got shape {array.shape}"
        )
    for joint, (lower, upper) in zip(joints, array, strict=True):
        if not lower <= upper:
            raise GeometryError(
                f"{name} of {joint.name}: lower {lower} must be <= upper {upper} [{joint.unit}]"
            )
    return array


def mode_index(mechanism: Mechanism, assembly_mode: str) -> int:
    """Return the index of an assembly mode; "" is the first one, the default.

    Raises:
        UnknownNameError: If the mechanism has no such mode.
    """
    if not assembly_mode:
        return 0
    try:
        return mechanism.assembly_modes.index(assembly_mode)
    except ValueError:
        raise UnknownNameError("assembly mode", assembly_mode, mechanism.assembly_modes) from None
