# SPDX-License-Identifier: Apache-2.0
"""Known postures of a leg, from which others are followed: reached from the initial one.

They stand on a grid over the ranges of the actuated joints, as far as it can be reached from the
initial posture along the grid without passing a singularity, and so all belong to its branch. Each
is also what follows from its neighbour when the foot moves straight from there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from leg_kinematics.arrays import FloatArray, wrapped_angles
from leg_kinematics.bodies import LegTree
from leg_kinematics.errors import GeometryError
from leg_kinematics.model import newton
from leg_kinematics.model.chain import PRISMATIC, place_bodies
from leg_kinematics.model.equations import DEAD_CENTRE, Equations, fill_loops, new_room
from leg_kinematics.model.leg_tree import WHOLE_TURN

SPACING = 0.25  # rad or m between neighbours of the grid, if that does not make it too large
CURVE_NODES = 300  # of a leg with one actuator, whose foot moves on a curve
MOST_POSTURES = 20_000
FEWEST, MOST_ALONG = 5, 33  # along one joint of several
PASSES = 6  # of the foot on a curve that are tried at a point
AT_ONCE = 4096  # points
CELLS = 40  # along the longest side of the box in which the nearest foot is looked up
SAME = 1e-6  # rad or m, within which two solutions are one posture
ASSEMBLED = 1e-12  # m, what remains open in a posture that is assembled
JOINTS_ARE_GIVEN, FEET_ARE_GIVEN = np.uint8(newton.JOINTS), np.uint8(newton.FOOT)
RANK = 1e-9  # singular values of the equations that count as 0


class Postures(NamedTuple):
    """Known postures of one branch.

    Attributes:
        joints: All joint positions of each (P, N).
        feet: Their feet (P, 3) [m].
        signs: Signs of det C_p and det J on the branch (2,); 0 for one that means nothing.
        axes: Grid coordinates of each actuated joint.
        endless: Whether each of them turns endlessly, so that its last node neighbours the first.
        of_grid: Index of the posture nearest to each node of the grid.
        corner: Least corner of the box of cells of feet (3,) [m].
        cell: Sides of a cell (3,) [m].
        of_cell: Index of the posture whose foot is nearest to each cell's centre (x, y, z).
        curve: Indices of the postures along the grid, of a leg with one actuator.
    """

    joints: FloatArray
    feet: FloatArray
    signs: FloatArray
    axes: tuple[FloatArray, ...]
    endless: tuple[bool, ...]
    of_grid: Any
    corner: FloatArray
    cell: FloatArray
    of_cell: Any
    curve: Any

    def nearest_to_joints(self, actuated: FloatArray) -> Any:
        """Return the index of a posture near actuated joints (m, n)."""
        places = []
        columns = np.nan_to_num(actuated).T
        for axis, endless, values in zip(self.axes, self.endless, columns, strict=True):
            step = axis[1] - axis[0]
            if endless:
                turned = wrapped_angles(values - axis[0])
                places.append(np.rint(turned / step).astype(np.int64) % len(axis))
            else:
                place = np.rint((np.clip(values, axis[0], axis[-1]) - axis[0]) / step)
                places.append(np.clip(place, 0, len(axis) - 1).astype(np.int64))
        return self.of_grid[tuple(places)]

    def nearest_to_feet(self, feet: FloatArray) -> Any:
        """Return the index of a posture whose foot is near feet (m, 3)."""
        last = np.array(self.of_cell.shape) - 1
        place = np.clip(np.nan_to_num((feet - self.corner) / self.cell), 0.0, last)
        x, y, z = place.astype(np.int64).T
        return self.of_cell[x, y, z]

    def passes(self, feet: FloatArray) -> Any:
        """Return indices of the postures from which a foot on a curve is followed to feet (m, k).

        The foot passes a place more than once. Where it comes nearest each time, nearest first, and
        the nearest of all again where it does not come by as often.
        """
        found = [np.empty((0, PASSES), dtype=np.int64)]
        for start in range(0, len(feet), AT_ONCE):
            here = np.nan_to_num(feet[start : start + AT_ONCE], posinf=1e3, neginf=-1e3)
            squares = np.square(here[:, None] - self.feet[self.curve]).sum(axis=-1)
            ends = np.full((len(here), 1), np.inf)
            around = np.concatenate([ends, squares, ends], axis=1)
            least = (squares <= around[:, :-2]) & (squares <= around[:, 2:])
            ranked = np.argsort(np.where(least, squares, np.inf), axis=1, kind="stable")[:, :PASSES]
            counts = np.arange(PASSES) < least.sum(axis=1, keepdims=True)
            found.append(self.curve[np.where(counts, ranked, ranked[:, :1])])
        return np.concatenate(found)


def loop_state(tree: LegTree, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return what remains open of the loops (3 L,) [m] and its derivatives (3 L, N)."""
    room = new_room(len(tree.joints), len(tree.loops), 0)
    place_bodies(tree.chain, q, room.rotations, room.origins, room.axes)
    fill_loops(tree.chain, tree.loops, room)
    return room.values, room.columns


def assembled(tree: LegTree, guess: FloatArray, held: Any = ()) -> FloatArray:
    """Return all joint positions near a guess at which the loops are closed (N,).

    Args:
        tree: The leg.
        guess: All joint positions.
        held: Numbers of joints that stay as guessed; all move if the loops do not close so.

    Raises:
        GeometryError: If the loops do not close near the guess.
    """
    free = np.setdiff1d(np.arange(len(tree.joints)), np.asarray(held, dtype=np.int64))
    for moving in (free, np.arange(len(tree.joints))):
        q = np.array(guess, dtype=np.float64)
        for _ in range(200):
            values, columns = loop_state(tree, q)
            if np.abs(values).max(initial=0.0) <= ASSEMBLED:
                return q
            step = np.zeros(len(q))
            step[moving] = np.linalg.lstsq(columns[:, moving], -values, rcond=RANK)[0]
            largest = np.abs(step).max()
            q += step * min(1.0, 0.3 / largest if largest > 0.0 else 1.0)
    values, _ = loop_state(tree, np.asarray(guess, dtype=np.float64))
    raise GeometryError(
        f"the loops do not close: in the given posture points that must coincide are up to "
        f"{np.abs(values).max():.3g} m apart, and no posture nearby closes them; check the "
        "closures, or give an initial posture"
    )


def independent_rows(tree: LegTree, posture: FloatArray) -> FloatArray:
    """Return the equations of the loops that the others do not imply (m,), m = N - freedoms."""
    rng = np.random.default_rng(0)
    matrices = []
    for _ in range(6):  # at one posture they could depend on each other by chance
        try:
            near = assembled(tree, posture + rng.uniform(-0.05, 0.05, len(posture)))
        except GeometryError:
            continue
        matrices.append(loop_state(tree, near)[1])
    matrices = matrices or [loop_state(tree, posture)[1]]
    rows: list[int] = []
    for row in range(3 * len(tree.loops)):
        if any(_rank(m[[*rows, row]]) > len(rows) for m in matrices):
            rows.append(row)
    return np.array(rows, dtype=np.float64)


def _rank(matrix: FloatArray) -> int:
    return int(np.linalg.matrix_rank(matrix, tol=1e-7)) if matrix.size else 0


def known_postures(equations: Equations, limits: FloatArray, initial: FloatArray) -> Postures:
    """Return the postures that are reached from an initial one.

    Args:
        equations: The leg.
        limits: Ranges of the actuated joints (n, 2).
        initial: All joint positions of the initial posture (N,), the loops closed.

    Raises:
        GeometryError: If the initial posture is singular.
    """
    numbers = equations.actuated.astype(np.int64)
    n = len(numbers)
    start = initial[numbers]
    follow = _followed(equations)
    own, foot, found = follow(initial[None], start[None], np.zeros(2))
    if not np.abs(found[0]).min() > DEAD_CENTRE:  # NaN, too
        raise GeometryError(
            f"the initial posture {initial.round(6).tolist()} is singular: give one in which every "
            "actuator moves the foot"
        )
    signs = np.sign(found[0]) if n in (2, 3) else np.array([np.sign(found[0, 0]), 0.0])
    endless = tuple(
        bool(turns and np.ptp(pair) >= WHOLE_TURN)
        for turns, pair in zip(equations.chain[numbers, PRISMATIC] == 0.0, limits, strict=True)
    )
    axes = _grid_axes(limits, start, endless)
    shape = tuple(map(len, axes))
    index = np.full(shape, -1, dtype=np.int64)
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    joints, feet = own, foot
    here = tuple(int(np.argmin(abs(axis - q))) for axis, q in zip(axes, start, strict=True))
    frontier, sources = [here], np.array([0])
    while frontier:
        goals = nodes[tuple(np.array(frontier).T)]
        begin = joints[sources]
        turned = begin[:, numbers] + wrapped_angles(goals - begin[:, numbers])
        reached, places, determinants = follow(begin, np.where(endless, turned, goals), signs)
        good = np.isfinite(reached).all(axis=1) & np.all(determinants * signs >= 0.0, axis=1)
        good &= np.abs(determinants[:, 1]) > DEAD_CENTRE
        if n in (2, 3):
            told = equations._replace(signs=signs)
            from_feet = feet[sources[good]]
            again, *_ = newton.follow_postures(
                *told, begin[good], from_feet, places[good], FEET_ARE_GIVEN
            )
            good[good] = np.abs(again - reached[good]).max(axis=1, initial=0.0) <= SAME
        taken: list[int] = []
        for i in np.flatnonzero(good):
            if index[frontier[i]] < 0:  # else reached from another neighbour, too
                index[frontier[i]] = len(joints) + len(taken)
                taken.append(i)
        joints = np.concatenate([joints, reached[taken]])
        feet = np.concatenate([feet, places[taken]])
        steps = [
            (other, index[frontier[i]])
            for i in taken
            for other in _neighbours(frontier[i], shape, endless)
            if index[other] < 0
        ]
        frontier = [node for node, _ in steps]
        sources = np.array([source for _, source in steps], dtype=np.int64)
    return _looked_up(joints, feet, signs, axes, endless, index)


def _neighbours(
    node: tuple[int, ...], shape: tuple[int, ...], endless: tuple[bool, ...]
) -> Iterator[tuple[int, ...]]:
    """Yield the nodes of the grid beside one."""
    for k, count in enumerate(shape):
        for way in (-1, 1):
            place = (node[k] + way) % count if endless[k] else node[k] + way
            if 0 <= place < count:
                yield (*node[:k], place, *node[k + 1 :])


def _followed(equations: Equations) -> Any:
    numbers = equations.actuated.astype(np.int64)

    def follow(start: FloatArray, goal: FloatArray, signs: FloatArray) -> Any:
        """Return joints, feet and signs; only a change of det C_p's ends the way."""
        told = equations._replace(signs=np.array([signs[0], 0.0]))
        q, feet, _, found, _ = newton.follow_postures(
            *told, start, start[:, numbers], goal, JOINTS_ARE_GIVEN
        )
        return q, feet, found

    return follow


def _grid_axes(
    limits: FloatArray, start: FloatArray, endless: tuple[bool, ...]
) -> tuple[FloatArray, ...]:
    if len(limits) == 1:
        fewest = along = CURVE_NODES
    else:
        fewest = FEWEST
        along = int(np.clip(MOST_POSTURES ** (1.0 / len(limits)), FEWEST, MOST_ALONG))
    axes = []
    for (lower, upper), q, turns in zip(limits, start, endless, strict=True):
        lower, upper = max(lower, q - math.pi), min(upper, q + math.pi)
        if turns:
            lower, upper = q - math.pi, q + math.pi
        count = int(np.clip(math.ceil((upper - lower) / SPACING) + 1, fewest, along))
        width = max(upper - lower, 1e-9)
        axes.append(np.linspace(lower, lower + width, count, endpoint=not turns))
    return tuple(axes)


def _looked_up(
    joints: FloatArray,
    feet: FloatArray,
    signs: FloatArray,
    axes: tuple[FloatArray, ...],
    endless: tuple[bool, ...],
    index: Any,
) -> Postures:
    """Return the postures with the tables in which the nearest are found."""
    from scipy.ndimage import distance_transform_edt  # slow to import
    from scipy.spatial import cKDTree

    curve = index[index >= 0] if (index >= 0).any() else np.zeros(1, dtype=np.int64)
    if (index >= 0).any():
        near = distance_transform_edt(index < 0, return_distances=False, return_indices=True)
        index = index[tuple(near)]
    else:
        index = np.zeros_like(index)
    lower, upper = feet.min(axis=0), feet.max(axis=0)
    side = max(float((upper - lower).max()) / CELLS, 1e-6)
    counts = np.maximum(np.ceil((upper - lower) / side), 1.0).astype(np.int64)
    centres = [low + side * (np.arange(k) + 0.5) for low, k in zip(lower, counts, strict=True)]
    grid = np.stack(np.meshgrid(*centres, indexing="ij"), axis=-1)
    of_cell = cKDTree(feet).query(grid)[1]
    cell = np.full(3, side)
    return Postures(joints, feet, signs, axes, endless, index, lower, cell, of_cell, curve)
