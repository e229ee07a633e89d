# SPDX-License-Identifier: Apache-2.0
"""Jansen's linkage in pylinkage, which steps a crank through a turn with compiled code."""

from __future__ import annotations

import math
from typing import Any

from leg_kinematics.arrays import FloatArray
from leg_kinematics.mechanisms.theo_jansen import TheoJansen

POINTS = ("A", "D", "B", "C", "U", "L", "F", "G")


class PylinkageJansen:
    """The linkage of `mechanism` in its plane, in crank lengths.

    pylinkage picks the solution of a dyad that is nearest to the last one, so it starts from points
    that are given.
    """

    def __init__(self, mechanism: TheoJansen, start: dict[str, FloatArray], steps: int) -> None:
        from pylinkage.actuators import Crank
        from pylinkage.components import Ground
        from pylinkage.dyads import FixedDyad, RRRDyad
        from pylinkage.simulation import Linkage

        m = mechanism

        def dyad(name: str, first: Any, second: Any, to_first: float, to_second: float) -> Any:
            x, y = map(float, start[name])
            return RRRDyad(first, second, to_first, to_second, x=x, y=y, name=name)

        def rigid(name: str, first: Any, second: Any, side: float, far: float, base: float) -> Any:
            """Return the corner of a triangle to the right of first -> second."""
            angle = math.acos((side**2 + base**2 - far**2) / (2.0 * side * base))
            return FixedDyad(first, second, side, -angle, name=name)

        a = Ground(0.0, 0.0, name="A")
        d = Ground(float(start["D"][0]), float(start["D"][1]), name="D")
        crank = Crank(a, 1.0, angular_velocity=2.0 * math.pi / steps, name="B")
        c = dyad("C", crank.output, d, m.lower_coupler, m.lower_rocker)
        u = dyad("U", crank.output, d, m.upper_coupler, m.upper_rocker)
        l = rigid("L", d, u, m.plate_arm, m.plate_brace, m.upper_rocker)  # noqa: E741
        f = dyad("F", l, c, m.link, m.foot_lever)
        g = rigid("G", c, f, m.foot_bar, m.foot_brace, m.foot_lever)
        self._linkage = Linkage([a, d, crank, c, u, l, f, g], name="Jansen")
        self._linkage.compile()
        self._steps = steps

    def turn(self) -> FloatArray:
        """Return all `POINTS` after each step of one turn (steps, 8, 2)."""
        points: FloatArray = self._linkage.step_fast(self._steps)
        return points
