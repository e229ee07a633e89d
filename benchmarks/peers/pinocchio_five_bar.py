# SPDX-License-Identifier: Apache-2.0
"""The leg with a five-bar in Pinocchio: its URDF, two equations that close the loop, and the foot.

Five equations for five joints, solved by Newton's method from a neighbouring posture. The loop is
plane, so two equations in the plane of the hip's link close it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from leg_kinematics.arrays import FloatArray

TOLERANCE = 1e-10  # of the equations [m]
MOST_STEPS = 20
JOINTS = ("hip", "thigh", "crank", "knee", "rod_pin")  # the actuated ones first
ACTUATED = 3


class PinocchioFiveBar:
    """The leg of `robots/five_bar.urdf`; joints are in the order of `JOINTS`."""

    def __init__(self, urdf: Path) -> None:
        import pinocchio as pin

        self._pin: Any = pin
        self._model = model = pin.buildModelFromUrdf(str(urdf))
        self._order = [model.joints[model.getJointId(name)].idx_q for name in JOINTS]
        self._hip = model.getJointId("hip")

        def point(joint: str, z: float, name: str) -> int:
            place = pin.SE3(np.eye(3), np.array([0.0, 0.0, z]))
            body = model.getJointId(joint)
            return int(model.addFrame(pin.Frame(name, body, 0, place, pin.FrameType.OP_FRAME)))

        self._ends = point("knee", -0.2, "end of shin"), point("rod_pin", -0.2, "end of rod")
        self._foot = point("knee", -0.3, "foot")
        self._data = model.createData()

    def solve(self, foot: FloatArray, start: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the joints (5,) that put the foot (3,) somewhere in the base, and J (3, 3).

        Raises:
            ArithmeticError: If Newton's method does not converge.
        """
        x = start
        for _ in range(MOST_STEPS):
            residual, matrix = self._equations(x)
            residual[2:] -= foot
            if np.abs(residual).max() < TOLERANCE:
                passive = np.linalg.solve(matrix[:2, ACTUATED:], -matrix[:2, :ACTUATED])
                return x, matrix[2:, :ACTUATED] + matrix[2:, ACTUATED:] @ passive
            x = x - np.linalg.solve(matrix, residual)
        raise ArithmeticError("Newton's method does not converge")

    def _equations(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        pin, model, data = self._pin, self._model, self._data
        q = np.empty(len(x))
        q[self._order] = x
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        places = [data.oMf[frame].translation for frame in (*self._ends, self._foot)]
        rates = [
            pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)[:3, self._order]
            for frame in (*self._ends, self._foot)
        ]
        plane = data.oMi[self._hip].rotation.T[
            [0, 2]
        ]  # in it the difference stays as the hip rolls
        residual = np.concatenate([plane @ (places[1] - places[0]), places[2]])
        matrix = np.concatenate([plane @ (rates[1] - rates[0]), rates[2]])
        return residual, matrix
