"""What every leg mechanism offers: the one protocol that all layers above are written against."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import Field, dataclass, field, fields
from functools import cached_property
from itertools import product
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


def twist_jacobian(mechanism: Mechanism, posture: Posture) -> FloatArray:
    """Return `jacobian` above `angular_jacobian` (..., t + 3, n): the twist of the foot's body.

    A mechanism may offer it in one pass, as a method of this name.
    """
    one_pass = getattr(mechanism, "twist_jacobian", None)
    if one_pass is not None:
        result: FloatArray = one_pass(posture)
        return result
    parts = mechanism.jacobian(posture), mechanism.angular_jacobian(posture)
    return np.concatenate(parts, axis=-2)


def inverse_with_twist(
    mechanism: Mechanism, foot_position: ArrayLike, assembly_mode: str = ""
) -> tuple[Posture, FloatArray]:
    """Return `inverse` and `twist_jacobian` of the same points.

    A mechanism may offer both in one pass, as a method of this name.
    """
    one_pass = getattr(mechanism, "inverse_with_twist", None)
    if one_pass is not None:
        result: tuple[Posture, FloatArray] = one_pass(foot_position, assembly_mode)
        return result
    posture = mechanism.inverse(foot_position, assembly_mode)
    return posture, twist_jacobian(mechanism, posture)


def forward_with_twist(
    mechanism: Mechanism, joint_positions: ArrayLike, assembly_mode: str = ""
) -> tuple[Posture, FloatArray]:
    """Return `forward` and `twist_jacobian` of the same points.

    A mechanism may offer both in one pass, as a method of this name.
    """
    one_pass = getattr(mechanism, "forward_with_twist", None)
    if one_pass is not None:
        result: tuple[Posture, FloatArray] = one_pass(joint_positions, assembly_mode)
        return result
    posture = mechanism.forward(joint_positions, assembly_mode)
    return posture, twist_jacobian(mechanism, posture)


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


class Dimensioned:
    """What the dataclasses of the mechanisms share: their fields, checked and as arrays.

    Attributes:
        joint_ranges: Pairs (lower, upper), one an actuated joint [rad or m].
        passive_joint_ranges: The same of the passive joints, as excursions.
    """

    joints: ClassVar[tuple[Joint, ...]]
    passive_joints: ClassVar[tuple[Joint, ...]]
    joint_ranges: tuple[tuple[float, float], ...]
    passive_joint_ranges: tuple[tuple[float, float], ...]

    def check_fields(self) -> None:
        """Check every field by itself.

        Raises:
            GeometryError: If a parameter is not finite, or not positive although it must be, or a
                range is reversed, NaN or missing.
        """
        for f in geometry_parameters(self):
            value = getattr(self, f.name)
            if not np.isfinite(value):
                raise GeometryError(
                    f"{f.name} ({f.metadata['symbol']}) must be finite, got {value}"
                )
            if f.metadata["positive"] and value <= 0.0:
                unit = SI_UNITS[f.metadata["dimension"]]
                raise GeometryError(
                    f"{f.name} ({f.metadata['symbol']}) must be > 0 [{unit}], got {value}"
                )
        _check_ranges("joint_ranges", self.joint_ranges, self.joints)
        _check_ranges("passive_joint_ranges", self.passive_joint_ranges, self.passive_joints)

    @cached_property
    def joint_limits(self) -> FloatArray:
        """Ranges of the actuated joints (n, 2) [rad or m]."""
        return np.array(self.joint_ranges, dtype=np.float64)

    @cached_property
    def passive_joint_limits(self) -> FloatArray:
        """Ranges of the passive joints as excursions from the initial posture (p, 2) [rad or m]."""
        return np.array(self.passive_joint_ranges, dtype=np.float64)

    @cached_property
    def _geometry(self) -> FloatArray:
        """Geometry parameters in the order of declaration (g,) [SI]."""
        return np.array([getattr(self, f.name) for f in geometry_parameters(self)])


def _check_ranges(name: str, ranges: Any, joints: Sequence[Joint]) -> None:
    array = np.asarray(ranges, dtype=np.float64)
    if array.shape != (len(joints), 2):
        raise GeometryError(
            f"{name} must be {len(joints)} pairs (lower, upper), got shape {array.shape}"
        )
    for joint, (lower, upper) in zip(joints, array, strict=True):
        if not lower <= upper:
            raise GeometryError(
                f"{name} of {joint.name}: lower {lower} must be <= upper {upper} [{joint.unit}]"
            )


def flipped_modes(default: str, parts: Sequence[str]) -> tuple[str, ...]:
    """Return the default mode and one for each set of parts assembled the other way round."""
    flips = [
        "+".join(part for part, flip in zip(parts, bits, strict=True) if flip)
        for bits in product((False, True), repeat=len(parts))
    ]
    return (default, *(f"flipped_{name}" for name in flips[1:]))


def mode_signs(mechanism: Mechanism, assembly_mode: str, parts: Sequence[str]) -> FloatArray:
    """Return -1 for each part (parts,) that a mode of `flipped_modes` flips, +1 for the others.

    Raises:
        UnknownNameError: If the mechanism has no such mode.
    """
    index, last = mode_index(mechanism, assembly_mode), len(parts) - 1
    return np.array([-1.0 if index >> (last - k) & 1 else 1.0 for k in range(last + 1)])


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
