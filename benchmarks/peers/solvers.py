# SPDX-License-Identifier: Apache-2.0
"""Load capacity by general solvers, set up once for a leg and fed one Jacobian after the other.

All maximise F_z subject to lower <= -Jᵀ F <= upper and a friction cone or a pyramid in place of it.
A solver's package is imported when the solver is made, so that a missing one stops nothing else.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy import sparse

from leg_kinematics.arrays import FloatArray

SIDES = 32  # of the friction pyramid
# A pyramid about the cone of mu lies within the cone of mu times this.
PYRAMID_EXCESS = 1.0 / math.cos(math.pi / SIDES)


class Clarabel:
    """The cone programme itself, by an interior point method; only the matrix's values change.

    Its matrix is 9 x 3: six rows for the limits and three for the cone (mu F_z, F_x, F_y).
    """

    def __init__(self, lower: FloatArray, upper: FloatArray, friction: float) -> None:
        import clarabel

        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.presolve_enable = False  # it would forbid updates
        self._cone_values = -1.0, -1.0, -friction
        matrix = sparse.csc_matrix(
            (
                self._values(np.ones((3, 3))),
                np.concatenate([[*range(6), row] for row in (7, 8, 6)]),
                [0, 7, 14, 21],
            ),
            shape=(9, 3),
        )
        self._solver = clarabel.DefaultSolver(
            sparse.csc_matrix((3, 3)),
            np.array([0.0, 0.0, -1.0]),
            matrix,
            np.concatenate([-lower, upper, np.zeros(3)]),
            [clarabel.NonnegativeConeT(6), clarabel.SecondOrderConeT(3)],
            settings,
        )

    def capacity(self, jacobian: FloatArray) -> float:
        """Return the load capacity."""
        self._solver.update(A=self._values(jacobian))
        return -float(self._solver.solve().obj_val)

    def _values(self, jacobian: FloatArray) -> FloatArray:
        values = np.empty((3, 7))
        values[:, :3], values[:, 3:6], values[:, 6] = jacobian, -jacobian, self._cone_values
        return values.ravel()


def pyramid(friction: float) -> FloatArray:
    """Return the rows a of a·F <= 0 for a pyramid about the friction cone (SIDES, 3)."""
    angles = 2.0 * np.pi * np.arange(SIDES) / SIDES
    return np.stack([np.cos(angles), np.sin(angles), np.full(SIDES, -friction)], axis=-1)


class Highs:
    """The linear programme with a pyramid, each solved from the basis of the last one."""

    def __init__(self, lower: FloatArray, upper: FloatArray, friction: float) -> None:
        import highspy

        infinity = highspy.kHighsInf
        matrix = np.concatenate([np.ones((3, 3)), pyramid(friction)])
        model = highspy.HighsLp()
        model.num_col_, model.num_row_ = 3, len(matrix)
        model.sense_ = highspy.ObjSense.kMaximize
        model.col_cost_ = np.array([0.0, 0.0, 1.0])
        model.col_lower_, model.col_upper_ = np.full(3, -infinity), np.full(3, infinity)
        model.row_lower_ = np.concatenate([-upper, np.full(SIDES, -infinity)])
        model.row_upper_ = np.concatenate([-lower, np.zeros(SIDES)])
        model.a_matrix_.format_ = highspy.MatrixFormat.kRowwise
        model.a_matrix_.start_ = np.arange(0, matrix.size + 1, 3)
        model.a_matrix_.index_ = np.tile(np.arange(3), len(matrix))
        model.a_matrix_.value_ = matrix.ravel()
        self._solver = highspy.Highs()
        self._solver.setOptionValue("output_flag", False)
        self._solver.setOptionValue("threads", 1)
        self._solver.passModel(model)

    def capacity(self, jacobian: FloatArray) -> float:
        """Return the load capacity."""
        change = self._solver.changeCoeff
        for row, column in enumerate(jacobian.T.tolist()):
            change(row, 0, column[0])
            change(row, 1, column[1])
            change(row, 2, column[2])
        self._solver.run()
        return float(self._solver.getObjectiveValue())


class Linprog:
    """The same linear programme through SciPy, anew each time."""

    def __init__(self, lower: FloatArray, upper: FloatArray, friction: float) -> None:
        self._sides = pyramid(friction)
        self._bounds = np.concatenate([-lower, upper, np.zeros(SIDES)])

    def capacity(self, jacobian: FloatArray) -> float:
        """Return the load capacity."""
        from scipy.optimize import linprog

        rows = np.concatenate([jacobian.T, -jacobian.T, self._sides])
        answer = linprog((0.0, 0.0, -1.0), rows, self._bounds, bounds=(None, None), method="highs")
        return -float(answer.fun)


class ForcePolytope:
    """The vertices of all forces within the limits; it knows no friction."""

    def __init__(self, lower: FloatArray, upper: FloatArray) -> None:
        from pycapacity.robot import force_polytope

        self._polytope: Any = force_polytope
        self._lower, self._upper = lower[:, None], upper[:, None]

    def capacity(self, jacobian: FloatArray) -> float:
        """Return the load capacity on ground of any roughness."""
        polytope = self._polytope(-jacobian, self._upper, self._lower)
        return float(polytope.vertices[2].max())
