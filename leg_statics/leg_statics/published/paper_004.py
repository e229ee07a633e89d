# SPDX-License-Identifier: Apache-2.0
"""Yu, Chen, Ma: kinematics and simulation of a 4-DOF hybrid manipulator (received August 2006).

The paper prints its dimensions and a motion of 5 s, and shows the results as curves only: figure 4
the displacements of the drives, figure 5 the output shaft's angular velocity and acceleration.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from leg_kinematics.arrays import FloatArray
from leg_kinematics.mechanism import Posture
from leg_kinematics.mechanisms.gantry_hybrid import GantryHybrid
from leg_kinematics.mechanisms.universal_joints import OutputMotion
from leg_kinematics.status import Status
from leg_statics.published.comparison import Comparison, compare_claim

PAPER = "004"

# Section 5: dimensions [m].
EXAMPLE_GEOMETRY = {
    "platform_half_width": 0.100,
    "slide_a_start": 0.15025,
    "slide_b_start": 0.15025,
    "slide_c_start": 0.10308,
    "rail_c_left": 0.200,
    "platform_arm": 0.150,
    "shaft_base_left": 0.100,
    "shaft_platform_left": 0.080,
    "bar_a_length": 0.255,
    "bar_b_length": 0.255,
    "rod_c_length": 0.275,
}
DURATION = 5.0  # s

# Section 5: the motion x = -10 t, y = 10 t, z = 250 + 2 sin(pi t) [mm], beta = 5° sin(pi t) and the
# input shaft's 120° sin(2 t), which is printed as gamma.
FEED = 0.010  # m/s
HEIGHT, HEIGHT_SWING = 0.250, 0.002  # m
TILT_SWING = math.radians(5.0)
SWING_RATE = math.pi  # rad/s
INPUT_SWING, INPUT_RATE = math.radians(120.0), 2.0  # rad, rad/s

# Ends of the axes of figure 5.
FIGURE_5_VELOCITY = math.radians(300.0)  # rad/s
FIGURE_5_ACCELERATION = math.radians(500.0)  # rad/s²


class ExampleMotion(NamedTuple):
    """The prescribed motion at some times.

    Attributes:
        position: Platform x, y, z, beta (..., 4) [m, rad].
        velocity: Their rates (..., 4) [m/s, rad/s].
        acceleration: Their second derivatives (..., 4) [m/s², rad/s²].
        input_angle: Angle theta of the input shaft (...) [rad].
        input_velocity: Its rate (...) [rad/s].
        input_acceleration: Its second derivative (...) [rad/s²].
    """

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    input_angle: FloatArray
    input_velocity: FloatArray
    input_acceleration: FloatArray


class DriveMotion(NamedTuple):
    """What the four drives do in the example.

    Attributes:
        posture: The postures (...).
        velocity: Rates of s1, s2, s3, s4 (..., 4) [m/s].
        acceleration: Their second derivatives (..., 4) [m/s²].
    """

    posture: Posture
    velocity: FloatArray
    acceleration: FloatArray


def example_manipulator() -> GantryHybrid:
    """Return the manipulator of the example."""
    return GantryHybrid(**EXAMPLE_GEOMETRY)  # type: ignore[arg-type]


def example_times(count: int = 2001) -> FloatArray:
    """Return evenly spaced times of the example (count,) [s]."""
    return np.linspace(0.0, DURATION, count)


def example_motion(time: FloatArray) -> ExampleMotion:
    """Return the prescribed motion at some times (...) [s]."""
    w, zero = SWING_RATE, np.zeros_like(time)
    sine, cosine = np.sin(w * time), np.cos(w * time)
    turn = INPUT_RATE * time
    return ExampleMotion(
        np.stack(
            [-FEED * time, FEED * time, HEIGHT + HEIGHT_SWING * sine, TILT_SWING * sine], axis=-1
        ),
        np.stack(
            [zero - FEED, zero + FEED, HEIGHT_SWING * w * cosine, TILT_SWING * w * cosine], axis=-1
        ),
        np.stack([zero, zero, -HEIGHT_SWING * w**2 * sine, -TILT_SWING * w**2 * sine], axis=-1),
        INPUT_SWING * np.sin(turn),
        INPUT_SWING * INPUT_RATE * np.cos(turn),
        -INPUT_SWING * INPUT_RATE**2 * np.sin(turn),
    )


def drive_motion(manipulator: GantryHybrid, motion: ExampleMotion) -> DriveMotion:
    """Return the drives' motion by (11)-(14), (19) and (25)."""
    posture = manipulator.inverse(motion.position)
    inverse_jacobian = manipulator.inverse_jacobian(posture)
    return DriveMotion(
        posture,
        np.einsum("...ij,...j->...i", inverse_jacobian, motion.velocity),
        manipulator.inverse_acceleration(posture, motion.velocity, motion.acceleration),
    )


def printed_forward_acceleration(manipulator: GantryHybrid, drives: DriveMotion) -> FloatArray:
    """Return x'', y'', z'', beta'' by (26) as printed: -q'^T H_k G q' + G q'' (..., 4)."""
    jacobian = manipulator.jacobian(drives.posture)
    influence = manipulator.second_order_influence(drives.posture)
    velocity = np.einsum("...ij,...j->...i", jacobian, drives.velocity)
    bend = np.einsum("...i,...kij,...j->...k", drives.velocity, influence, velocity)
    return np.einsum("...ij,...j->...i", jacobian, drives.acceleration) - bend


def printed_second_bend(manipulator: GantryHybrid, position: FloatArray) -> FloatArray:
    """Return phi_2 (...) [rad] by its cosine as printed, with ee' in the numerator."""
    _, _, z, beta = np.moveaxis(position, -1, 0)
    tip = manipulator.shaft_platform_left
    length = manipulator.auxiliary_chain.length(position)
    return np.arccos((z * np.cos(beta) + tip * np.sin(beta)) / length)


def drive_comparisons() -> list[Comparison]:
    """Check what the paper states of positions, speeds and accelerations."""
    manipulator, motion = example_manipulator(), example_motion(example_times())
    drives = drive_motion(manipulator, motion)
    start = float(np.abs(drives.posture.joint_positions[0]).max())
    reached = drives.posture.status == Status.OK
    back = manipulator.forward(drives.posture.joint_positions).foot_position
    position_error = float(np.abs(back - motion.position).max())
    correct = manipulator.acceleration(drives.posture, drives.velocity, drives.acceleration)
    correct_error = float(np.abs(correct - motion.acceleration).max())
    printed = printed_forward_acceleration(manipulator, drives)
    printed_error = np.abs(printed - motion.acceleration)
    span = f"motion of section 5, {DURATION:g} s"
    return [
        compare_claim(
            PAPER,
            "the drives start from their original positions",
            start < 1e-5,
            f"within {1e3 * start:.4f} mm",
            "(11)-(14) with the signs 12 -, 13 +, 14 +",
        ),
        compare_claim(
            PAPER,
            "the manipulator performs the motion of section 5",
            bool(reached.all()),
            f"{100.0 * reached.mean():.0f} % of {len(reached)} poses",
            span,
        ),
        compare_claim(
            PAPER,
            "position: (4), (5), (10) solve for the pose and (12)-(14) for the drives",
            position_error < 1e-9,
            f"round trip within {position_error:.0e} m, rad",
            span,
        ),
        compare_claim(
            PAPER,
            "acceleration: (25) and (26) are inverse to each other",
            bool(np.max(printed_error) < 1e-9),
            f"off by up to {printed_error[:, 0].max():.3f} m/s² in x, "
            f"{printed_error[:, 3].max():.3f} rad/s² in beta",
            "print lacks a G and a transposed G; with both, within "
            f"{correct_error:.0e} m/s², rad/s²",
        ),
    ]


def output_motions(motion: ExampleMotion) -> tuple[OutputMotion, OutputMotion]:
    """Return the output shaft's motion by the vector model and by (27)."""
    chain = example_manipulator().auxiliary_chain
    return chain.output_motion(*motion), chain.approximate_output_motion(*motion)


def shaft_comparisons() -> list[Comparison]:
    """Check what the paper states of the auxiliary chain."""
    manipulator, motion = example_manipulator(), example_motion(example_times())
    chain = manipulator.auxiliary_chain
    exact, approximate = output_motions(motion)

    def off(name: str) -> float:
        difference = getattr(exact, name) - getattr(approximate, name)
        return math.degrees(float(np.abs(difference).max()))

    bends = chain.bends(motion.position)
    bend_error = np.abs(printed_second_bend(manipulator, motion.position) - bends[..., 1])

    level = motion._replace(
        position=motion.position * [1.0, 1.0, 1.0, 0.0],
        velocity=motion.velocity * [1.0, 1.0, 1.0, 0.0],
        acceleration=motion.acceleration * [1.0, 1.0, 1.0, 0.0],
    )
    level_output, _ = output_motions(level)
    level_bends = chain.bends(level.position)
    unequal = max(
        float(np.abs(level_output.velocity - level.input_velocity).max()),
        float(np.abs(level_output.acceleration - level.input_acceleration).max()),
        float(np.abs(level_bends[..., 0] - level_bends[..., 1]).max()),
    )
    fastest = float(np.abs(exact.angular_velocity).max())
    hardest = float(np.abs(exact.angular_acceleration).max())
    return [
        compare_claim(
            PAPER,
            "(27) relates the angles of input and output shaft",
            off("angle") < 0.01,
            f"off by up to {off('angle'):.2f}°, {off('velocity'):.1f} °/s, "
            f"{off('acceleration'):.0f} °/s²",
            "against the vector model of both joints; exact for x = 0 or beta = 0",
        ),
        compare_claim(
            PAPER,
            "cos phi_2 as printed is that of the joint at F'",
            bool(bend_error.max() < 1e-9),
            f"phi_2 off by up to {math.degrees(float(bend_error.max())):.1f}°",
            "its numerator needs ee in place of ee'",
        ),
        compare_claim(
            PAPER,
            "with parallel platforms the output turns as the input, at equal bends",
            unequal < 1e-9,
            f"within {unequal:.0e} rad, rad/s, rad/s²",
            "beta held at 0 while x, y, z move",
        ),
        compare_claim(
            PAPER,
            "figure 5a: angular velocity within ±300 °/s",
            fastest <= FIGURE_5_VELOCITY,
            f"largest component {math.degrees(fastest):.1f} °/s",
        ),
        compare_claim(
            PAPER,
            "figure 5b: angular acceleration within ±500 °/s²",
            hardest <= FIGURE_5_ACCELERATION,
            f"largest component {math.degrees(hardest):.1f} °/s²",
        ),
    ]


def comparisons() -> list[Comparison]:
    """Return every claim of the paper beside ours."""
    return drive_comparisons() + shaft_comparisons()
