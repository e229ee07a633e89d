# SPDX-License-Identifier: Apache-2.0
"""Load factors of stances by general solvers, set up once and fed one stance after the other.

Unknowns are the forces of the feet in units of the weight, and the load factor. A solver's package
is imported when the solver is made, so that a missing one stops nothing else.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse

from leg_kinematics.arrays import FloatArray
from leg_statics.stance.stances import Load, Stance, as_arrays
from peers.solvers import PYRAMID_EXCESS as PYRAMID_EXCESS
from peers.solvers import SIDES, pyramid


def balance_and_limits(stance: Stance, load: Load) -> tuple[FloatArray, FloatArray]:
    """Return the equations (6, 3 L + 1) and J_iᵀ of all legs (L n, 3 L + 1), in units of weight."""
    feet: Any = as_arrays(stance)
    weight = load.weight
    unit = np.linalg.norm(weight[:3])
    legs, n = feet.jacobian.shape[0], feet.jacobian.shape[2]
    balance, efforts = np.zeros((6, 3 * legs + 1)), np.zeros((legs * n, 3 * legs + 1))
    balance[:, -1] = weight / unit
    for i, (x, y, z) in enumerate(feet.position):
        own = slice(3 * i, 3 * i + 3)
        balance[:3, own] = np.eye(3)
        balance[3:, own] = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
        efforts[n * i : n * i + n, own] = feet.jacobian[i].T * unit
    return balance, efforts


class ClarabelStance:
    """The cone programme itself, by an interior-point method; only the matrix's values change."""

    def __init__(self, stance: Stance, load: Load) -> None:
        import clarabel

        feet: Any = as_arrays(stance)
        legs, self._load = len(feet.position), load
        cones = np.zeros((3 * legs, 3 * legs + 1))
        for i in range(legs):
            cones[3 * i, 3 * i + 2] = -feet.friction[i]
            cones[3 * i + 1, 3 * i] = cones[3 * i + 2, 3 * i + 1] = -1.0
        self._cones = cones
        pattern = np.abs(self._matrix(stance)) > 0.0
        pattern[:6] = True  # a moment may be zero in one stance only
        self._where = pattern
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.presolve_enable = False  # it would forbid updates
        columns = self._sparse(np.where(pattern, 1.0, 0.0))
        objective = np.zeros(3 * legs + 1)
        objective[-1] = -1.0
        rooms = np.concatenate([-feet.effort_lower.ravel(), feet.effort_upper.ravel()])
        self._solver = clarabel.DefaultSolver(
            sparse.csc_matrix((3 * legs + 1, 3 * legs + 1)),
            objective,
            columns,
            np.concatenate([np.zeros(6), rooms, np.zeros(3 * legs)]),
            [clarabel.ZeroConeT(6), clarabel.NonnegativeConeT(len(rooms))]
            + [clarabel.SecondOrderConeT(3)] * legs,
            settings,
        )

    def load_factor(self, stance: Stance) -> float:
        """Return the load factor."""
        values = self._matrix(stance).T[self._where.T]
        self._solver.update(A=values)
        return -float(self._solver.solve().obj_val)

    def _matrix(self, stance: Stance) -> FloatArray:
        balance, efforts = balance_and_limits(stance, self._load)
        return np.concatenate([balance, efforts, -efforts, self._cones])

    def _sparse(self, matrix: FloatArray) -> Any:
        rows = [np.flatnonzero(column) for column in self._where.T]
        ends = np.concatenate([[0], np.cumsum([len(row) for row in rows])])
        return sparse.csc_matrix(
            (matrix.T[self._where.T], np.concatenate(rows), ends), shape=matrix.shape
        )


class HighsStance:
    """The linear programme with pyramids, each solved from the basis of the last one."""

    def __init__(self, stance: Stance, load: Load) -> None:
        import highspy

        feet: Any = as_arrays(stance)
        self._load, legs = load, len(feet.position)
        balance, efforts = balance_and_limits(stance, load)
        sides = np.zeros((SIDES * legs, 3 * legs + 1))
        for i in range(legs):
            sides[SIDES * i : SIDES * i + SIDES, 3 * i : 3 * i + 3] = pyramid(feet.friction[i])
        matrix, infinity = np.concatenate([balance, efforts, sides]), highspy.kHighsInf
        model = highspy.HighsLp()
        model.num_row_, model.num_col_ = matrix.shape
        model.sense_ = highspy.ObjSense.kMaximize
        model.col_cost_ = np.append(np.zeros(3 * legs), 1.0)
        model.col_lower_ = np.full(matrix.shape[1], -infinity)
        model.col_upper_ = np.full(matrix.shape[1], infinity)
        zero, below = np.zeros(6), np.full(len(sides), -infinity)
        model.row_lower_ = np.concatenate([zero, -feet.effort_upper.ravel(), below])
        upper = [zero, -feet.effort_lower.ravel(), np.zeros(len(sides))]
        model.row_upper_ = np.concatenate(upper)
        model.a_matrix_.format_ = highspy.MatrixFormat.kRowwise
        model.a_matrix_.start_ = np.arange(0, matrix.size + 1, matrix.shape[1])
        model.a_matrix_.index_ = np.tile(np.arange(matrix.shape[1]), len(matrix))
        model.a_matrix_.value_ = np.where(matrix == 0.0, 1e-300, matrix).ravel()
        self._solver = highspy.Highs()
        self._solver.setOptionValue("output_flag", False)
        self._solver.setOptionValue("threads", 1)
        self._solver.passModel(model)

    def load_factor(self, stance: Stance) -> float:
        """Return the load factor."""
        balance, efforts = balance_and_limits(stance, self._load)
        change = self._solver.changeCoeff
        for row, numbers in enumerate(np.concatenate([balance, efforts]).tolist()):
            for column, number in enumerate(numbers):
                if number:
                    change(row, column, number)
        self._solver.run()
        return float(self._solver.getObjectiveValue())
