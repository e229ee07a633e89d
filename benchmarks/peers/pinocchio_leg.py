# SPDX-License-Identifier: Apache-2.0
"""The parallel-driving leg in Pinocchio: a tree of nine joints, closed by equations.

Joints are the three cranks, the platform's universal joint on the centre crank (2), the swing at
the hip, thigh, long link and shank. The loops are closed by the lengths of the two rods (2), the
ball S that joins platform and pantograph (3) and the shank parallel to the thigh (1). With the
wanted foot (3) there are nine equations for nine joints, solved by Newton's method from a
neighbouring pose. Rods as distances leave fewer equations than rods as bodies, for the peer's good.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from leg_kinematics import ParallelDrive, Posture
from leg_kinematics.arrays import FloatArray
from leg_kinematics.mechanisms.walking_axes import leg_vectors

TOLERANCE = 1e-10  # of the equations [m, m², rad]
MOST_STEPS = 20
LOOPS = 6  # equations that close the loops; the foot's follow
ACTUATED = 3  # the cranks are the first joints


class PinocchioLeg:
    """A leg of the geometry of `mechanism`."""

    def __init__(self, mechanism: ParallelDrive) -> None:
        import pinocchio as pin

        self._pin: Any = pin
        m = mechanism
        self._zeros = np.array([m.crank_zero, m.crank_zero, m.center_crank_zero])
        self._rod_square = m.rod_length**2
        # the tree is the paper's, turned into the leg frame where its first joints stand
        axes = leg_vectors(np.eye(3)).T
        self._hip = axes @ [0.0, m.hip_forward, -m.hip_drop]
        model = pin.Model()

        def joint(parent: int, kind: Any, x: float, y: float, z: float, name: str) -> int:
            place = pin.SE3(np.eye(3), np.array([x, y, z]))
            if parent == 0:
                place = pin.SE3(axes, np.zeros(3)) * place
            return int(model.addJoint(parent, kind(), place, name))

        def point(body: int, x: float, y: float, z: float, name: str) -> int:
            place = pin.SE3(np.eye(3), np.array([x, y, z]))
            return int(model.addFrame(pin.Frame(name, body, 0, place, pin.FrameType.OP_FRAME)))

        about_x, about_y, about_z = pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ
        half = 0.5 * m.crank_spacing
        crank_1 = joint(0, about_x, half, 0.0, 0.0, "crank_1")
        crank_2 = joint(0, about_x, -half, 0.0, 0.0, "crank_2")
        crank_3 = joint(0, about_x, 0.0, m.center_crank_forward, -m.center_crank_drop, "crank_3")
        platform = joint(crank_3, about_x, 0.0, m.center_crank_length, 0.0, "platform_elevation")
        platform = joint(platform, about_z, 0.0, 0.0, 0.0, "platform_tilt")
        swing = joint(0, about_y, 0.0, m.hip_forward, -m.hip_drop, "swing")
        thigh = joint(swing, about_x, 0.0, 0.0, 0.0, "thigh")
        link = joint(thigh, about_x, 0.0, m.thigh_upper, 0.0, "link")
        self._shank = shank = joint(link, about_x, 0.0, m.parallelogram_link, 0.0, "shank")
        self._pins = (
            point(crank_1, 0.0, m.crank_length, 0.0, "U1"),
            point(crank_2, 0.0, m.crank_length, 0.0, "U2"),
        )
        self._balls = (
            point(platform, m.platform_arm, m.platform_length, 0.0, "S1"),
            point(platform, -m.platform_arm, m.platform_length, 0.0, "S2"),
        )
        self._drive = point(platform, 0.0, m.platform_length, m.platform_post, "S")
        self._lever = point(link, 0.0, m.drive_lever, m.drive_lever_offset, "S of pantograph")
        self._foot = point(shank, 0.0, m.thigh_lower + m.shank_length, 0.0, "C")
        self._model, self._data = model, model.createData()
        self._residual, self._matrix = np.zeros(9), np.zeros((9, 9))
        self._matrix[5, 7:] = 1.0

    def configuration(self, posture: Posture) -> FloatArray:
        """Return the joints of the tree (..., 9) in a posture of the suite."""
        q = posture.joint_positions + self._zeros
        a, b, th1, th2, th3 = np.moveaxis(posture.closure, -1, 0)
        return np.concatenate(
            [q, np.stack([a - q[..., 2], -b, th3, th1, th2 - th1, th1 - th2], axis=-1)], axis=-1
        )

    def solve(self, foot: FloatArray, start: FloatArray) -> FloatArray:
        """Return the joints of the tree (9,) that put the foot (3,) somewhere.

        Raises:
            ArithmeticError: If Newton's method does not converge.
        """
        x = start
        target = foot + self._hip
        for _ in range(MOST_STEPS):
            self._update(x)
            self._residual[6:] -= target
            if np.abs(self._residual).max() < TOLERANCE:
                return x
            x = x - np.linalg.solve(self._matrix, self._residual)
        raise ArithmeticError("Newton's method does not converge")

    def crank_angles(self, x: FloatArray) -> FloatArray:
        """Return the actuated joints (3,) of the suite."""
        return x[:ACTUATED] - self._zeros

    def jacobians(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return J and J_omega (3, 3) by implicit differentiation; `x` is what `solve` returned."""
        loops = self._matrix[:LOOPS]
        passive = np.linalg.solve(loops[:, ACTUATED:], -loops[:, :ACTUATED])
        rates = np.concatenate([np.eye(ACTUATED), passive])
        turning = self._pin.getJointJacobian(
            self._model, self._data, self._shank, self._pin.LOCAL_WORLD_ALIGNED
        )[3:]
        return self._matrix[LOOPS:] @ rates, turning @ rates

    def _update(self, x: FloatArray) -> None:
        """Fill the equations and their derivatives; the foot's are its position."""
        pin, model, data = self._pin, self._model, self._data
        pin.computeJointJacobians(model, data, x)
        pin.updateFramePlacements(model, data)

        def position(frame: int) -> FloatArray:
            place: FloatArray = data.oMf[frame].translation
            return place

        def velocity(frame: int) -> FloatArray:
            jacobian: FloatArray = pin.getFrameJacobian(
                model, data, frame, pin.LOCAL_WORLD_ALIGNED
            )[:3]
            return jacobian

        residual, matrix = self._residual, self._matrix
        for i in range(2):
            rod = position(self._balls[i]) - position(self._pins[i])
            residual[i] = 0.5 * (rod @ rod - self._rod_square)
            matrix[i] = rod @ (velocity(self._balls[i]) - velocity(self._pins[i]))
        residual[2:5] = position(self._drive) - position(self._lever)
        matrix[2:5] = velocity(self._drive) - velocity(self._lever)
        residual[5] = x[7] + x[8]
        residual[6:] = position(self._foot)
        matrix[6:] = velocity(self._foot)
