# SPDX-License-Identifier: Apache-2.0
"""A tripod gait over terrain: which footholds, how long a step, how high the body.

The legs step in two tripods. While one tripod carries the body along +x of the map at constant yaw,
the other swings; then the roles change. A half step is judged by what its three feet carry together
at touchdown, halfway and at lift-off. Every half step goes like this:

1. Moves are tried from the longest to the shortest, sidesteps last.
2. Candidates lie on a grid around each leg's nominal foothold. Those on an edge of the ground, near
   a standing foot or out of the leg's reach drop out.
3. Choice: of each leg in turn, the others where they are, the candidate with which the stance
   carries most, less a price for its distance from the nominal foothold.
4. Height: over these feet, that of the body with which its centre of mass is farthest inside what
   the feet support. The stance must carry some times the weight all the way.
5. A move counts if the other tripod finds footholds after it. If none does, the walk ends and the
   reasons are told.

Assumed: the mass acts at the origin of the base frame, forces of acceleration are within the
reserve, the ground is level within a patch.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from leg_msgs_py.client import LegClient
from terrain import Terrain

from leg_kinematics.arrays import FloatArray

TRIPODS = (
    ("left_front", "left_rear", "right_middle"),
    ("right_front", "right_rear", "left_middle"),
)
# Of pictures and markers, from Okabe and Ito's palette, which colour-blind readers can tell apart.
COLOURS = {
    "left_front": "#0072B2",
    "left_middle": "#009E73",
    "left_rear": "#56B4E9",
    "right_front": "#D55E00",
    "right_middle": "#CC79A7",
    "right_rear": "#E69F00",
}
INSTANTS = np.array([0.0, 0.5, 1.0])  # of a stance: touchdown, halfway, lift-off
FRACTIONS = (1.0, 0.75, 0.5, 0.25)  # of the longest step that are tried
ASIDE_WEIGHT = 4.0  # so much travel is given up for staying on the line, per metre off it
AWAY_WEIGHT = 2.0  # so much load factor is given up for a metre from the nominal foothold
DIRECTIONS = 12  # of margins
# Why a leg has no pose, by `leg_msgs/PointStatus`, and a stance does not hold, by `StanceVerdict`.
POSES = ("", "out of reach", "joint range", "passive joint range", "singular", "invalid")
VERDICTS = ("too little reserve", *POSES[1:], "a foot would slip", "too weak", "would tip over")
EDGE, CROWDED = "edge", "near a foot"


@dataclass(frozen=True)
class Gait:
    """What the planner assumes and how it searches; all in SI units.

    Attributes:
        mass: Mass of the robot [kg].
        reserve: Every stance carries the mass so many times.
        longest_step: Step that is tried first [m].
        heights: Heights of the base frame over the ground that may be chosen, the usual one first
            [m].
        height_change: Largest change of the body's z in a half step [m].
        ahead: Candidates lie so far before and behind the nominal foothold [m].
        aside: Candidates lie so far beside it [m].
        spacing: Distance of candidates [m].
        foot_radius: Ground this far around a foothold has to be level [m].
        clearance: Least distance of two feet [m].
        sidestep: How far the body goes aside at once [m].
    """

    mass: float = 120.0
    reserve: float = 1.2
    longest_step: float = 0.26
    heights: tuple[float, ...] = (0.65, 0.60, 0.70)
    height_change: float = 0.06
    ahead: float = 0.12
    aside: float = 0.08
    spacing: float = 0.02
    foot_radius: float = 0.03
    clearance: float = 0.1
    sidestep: float = 0.05

    @property
    def grid(self) -> FloatArray:
        """Candidates around a nominal foothold (m, 2) [m]."""
        x, y = (
            np.arange(-round(reach / self.spacing), round(reach / self.spacing) + 1) * self.spacing
            for reach in (self.ahead, self.aside)
        )
        return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)


class State(NamedTuple):
    """Between two half steps: the tripod that lands next, and where everything stands in the map.

    Attributes:
        tripod: Index of the tripod that lands next.
        body: Origin of the base frame (3,) [m].
        feet: Feet of the other tripod, by leg (3,) [m].
    """

    tripod: int
    body: FloatArray
    feet: Mapping[str, FloatArray]


@dataclass(frozen=True)
class Foothold:
    """A chosen foothold.

    Attributes:
        leg: Name of the leg.
        position: x, y, z in the map [m].
        ground: Name of the ground there.
        friction: Its friction coefficient.
        load: Largest vertical force on it during the stance [N].
        friction_used: Largest horizontal / vertical force on it during the stance.
    """

    leg: str
    position: tuple[float, ...]
    ground: str
    friction: float
    load: float
    friction_used: float


@dataclass(frozen=True)
class HalfStep:
    """One landing of a tripod and the travel of the body that it carries.

    Attributes:
        body_start: Origin of the base frame at touchdown, in the map [m].
        body_end: The same at lift-off [m].
        body_height: Height over the ground that was chosen [m].
        step_length: Travel ahead [m].
        load_factor: How many times the mass is carried, at the worst instant.
        margin: How far the centre of mass is inside the support region, at the worst instant [m].
        footholds: One for each leg of the tripod.
        rejected: How many candidates failed, by reason.
        rejected_at: Where they are (m, 2) [m], by reason.
        tries: Moves tried until this one.
    """

    body_start: tuple[float, ...]
    body_end: tuple[float, ...]
    body_height: float
    step_length: float
    load_factor: float
    margin: float
    footholds: tuple[Foothold, ...]
    rejected: dict[str, int]
    rejected_at: dict[str, FloatArray] = field(repr=False)
    tries: int = 1


class Move(NamedTuple):
    """Where the body goes: travel ahead and aside [m]."""

    travel: float
    aside: float


class NoFootholdsError(Exception):
    """No move is possible; the message says why."""


class Candidates(NamedTuple):
    """Candidates of one leg.

    Attributes:
        leg: Name of the leg.
        positions: Where they are in the map (m, 3) [m].
        away: Distance from the nominal foothold (m,) [m].
        patches: Index of the patch that counts (m,).
        friction: Its friction coefficient (m,).
        reason: Why a candidate drops out (m,); empty for those that stay.
    """

    leg: str
    positions: FloatArray
    away: FloatArray
    patches: Any
    friction: FloatArray
    reason: Any

    @property
    def left(self) -> Any:
        """Indices of those that stay, the nearest to the nominal foothold first."""
        rows = np.flatnonzero(self.reason == "")
        return rows[np.argsort(self.away[rows], kind="stable")]


class TripodPlanner:
    """Plans half steps by asking the nodes of the robot.

    Args:
        client: Client of the nodes.
        terrain: The map.
        gait: Assumptions and search.
        distance: How far along x the body shall go [m].
    """

    def __init__(self, client: LegClient, terrain: Terrain, gait: Gait, distance: float) -> None:
        self.client, self.terrain, self.gait, self.distance = client, terrain, gait, distance
        names = client.legs()
        missing = sorted({leg for tripod in TRIPODS for leg in tripod} - set(names))
        if missing:
            raise NoFootholdsError(
                f"a tripod gait needs the legs {', '.join(missing)}; the robot has "
                f"{', '.join(names)}"
            )
        self.base_frame = client.describe(TRIPODS[0][0]).base_frame
        self.neutral = {leg: self._neutral_foot(leg) for tripod in TRIPODS for leg in tripod}

    def _neutral_foot(self, leg: str) -> FloatArray:
        """Return the foot in the initial pose, in the base frame [m]."""
        joints = np.zeros(len(self.client.describe(leg).joint_names))
        answer = self.client.forward_kinematics(leg, joints, frame=self.base_frame)
        return np.asarray(answer.positions)

    def start(self) -> State:
        """Return the state at the origin of the map, all feet where the initial pose has them."""
        body = np.array([0.0, 0.0, self.terrain.patches[0].height + self.gait.heights[0]])
        feet = {leg: body + self.neutral[leg] for leg in TRIPODS[1]}
        return State(0, body, {leg: self._on_ground(foot[:2]) for leg, foot in feet.items()})

    def _on_ground(self, xy: FloatArray) -> FloatArray:
        """Return points (..., 2) with their height (..., 3) [m]."""
        return np.concatenate([xy, self.terrain.height(xy)[..., None]], axis=-1)

    def arrived(self, state: State) -> bool:
        """Tell whether the body has gone the distance."""
        return bool(state.body[0] >= self.distance - 1e-6)

    def next_half_step(self, state: State) -> tuple[HalfStep, State]:
        """Return the best half step after which the other tripod can land, too.

        Raises:
            NoFootholdsError: If there is none.
        """
        failures: Counter[str] = Counter()
        for half_step, after in self.half_steps(state, failures):
            if self.arrived(after) or next(self.half_steps(after, Counter(), brief=True), None):
                return half_step, after
            failures["the other tripod would find no footholds"] += 1
        reasons = "; ".join(f"{reason} ({count})" for reason, count in failures.most_common(6))
        raise NoFootholdsError(
            f"no footholds for {', '.join(TRIPODS[state.tripod])}: {reasons or 'no step left'}"
        )

    def half_steps(
        self, state: State, failures: Counter[str], brief: bool = False
    ) -> Iterator[tuple[HalfStep, State]]:
        """Yield possible half steps, the best first, and what follows from each.

        Args:
            state: Where everything stands.
            failures: Counts why moves failed.
            brief: Whether to look at few moves only.
        """
        for tries, move in enumerate(self.moves(state, brief), start=1):
            candidates = self.candidates(state, move)
            stuck = [c for c in candidates if not len(c.left)]
            if stuck:
                failures.update(f"{c.leg}: {Counter(c.reason).most_common(1)[0][0]}" for c in stuck)
                continue
            bodies = self.bodies(state, move, candidates)
            chosen = self.choose(candidates, bodies[0])
            half_step = self.settle(candidates, chosen, bodies, failures)
            if half_step is None:
                continue
            half_step = replace(half_step, tries=tries)
            feet = {foothold.leg: np.array(foothold.position) for foothold in half_step.footholds}
            yield half_step, State(1 - state.tripod, np.array(half_step.body_end), feet)

    def moves(self, state: State, brief: bool) -> list[Move]:
        """Return the moves to try, the best first: far ahead and close to the line y = 0."""
        y, far = float(state.body[1]), self.gait.sidestep
        home = float(np.clip(-y, -far, far))
        asides = [home] if brief else sorted({home, 0.0, far, -far}, key=lambda dy: abs(y + dy))
        left = self.distance - float(state.body[0])
        moves = []
        for fraction, aside in product(FRACTIONS[::2] if brief else FRACTIONS, asides):
            moves.append(Move(min(fraction * self.gait.longest_step, left), aside))
        return sorted(moves, key=lambda move: ASIDE_WEIGHT * abs(y + move.aside) - move.travel)

    def bodies(self, state: State, move: Move, candidates: Sequence[Candidates]) -> FloatArray:
        """Return the body at all instants, for each height that may be chosen (h, 3, 3) [m]."""
        level = np.median(np.concatenate([c.positions[:, 2] for c in candidates]))
        most = self.gait.height_change
        rise = np.clip(level + np.array(self.gait.heights) - state.body[2], -most, most)
        ahead = np.stack(np.broadcast_arrays(move.travel, move.aside, rise), axis=-1)
        return np.asarray(state.body + INSTANTS[:, None] * ahead[:, None, :])

    def candidates(self, state: State, move: Move) -> list[Candidates]:
        """Return the candidates of the tripod that lands, judged by ground and reach."""
        found = []
        for leg in TRIPODS[state.tripod]:
            nominal = state.body[:2] + self.neutral[leg][:2] + 0.5 * np.array(move)
            positions = self._on_ground(nominal + self.gait.grid)
            patches = self.terrain.under_foot(positions, self.gait.foot_radius)
            reason = np.where(patches < 0, EDGE, "").astype(object)
            for foot in state.feet.values():
                near = np.linalg.norm((positions - foot)[:, :2], axis=-1) < self.gait.clearance
                reason[near & (reason == "")] = CROWDED
            away = np.linalg.norm(self.gait.grid, axis=-1)
            friction = np.array([patch.friction for patch in self.terrain.patches])[patches]
            found.append(Candidates(leg, positions, away, patches, friction, reason))
        bodies = self.bodies(state, move, found)[0]
        poses = [
            self.client.inverse_kinematics.future(
                c.leg, c.positions - bodies[:, None, :], frame=self.base_frame
            )
            for c in found
        ]
        for c, future in zip(found, poses, strict=True):
            for row, status in enumerate(np.max(future.wait().status, axis=0)):
                c.reason[row] = c.reason[row] or POSES[status]
        return found

    def choose(self, candidates: Sequence[Candidates], bodies: FloatArray) -> list[int]:
        """Return the best candidate of each leg, chosen one leg after the other."""
        chosen = [int(c.left[0]) for c in candidates]
        for k, c in enumerate(candidates):
            feet = _taken(candidates, chosen)
            friction = np.tile(
                [c.friction[i] for c, i in zip(candidates, chosen, strict=True)],
                (len(c.left), 1, 1),
            )
            friction[:, 0, k] = c.friction[c.left]
            answer = self.client.query_stance(
                feet | {c.leg: c.positions[c.left, None]},
                friction,
                base_position=bodies,
                mass=self.gait.mass,
            )
            least = np.min(np.nan_to_num(answer.load_factor, nan=-np.inf), axis=-1)
            chosen[k] = int(c.left[np.argmax(least - AWAY_WEIGHT * c.away[c.left])])
        return chosen

    def settle(
        self,
        candidates: Sequence[Candidates],
        chosen: Sequence[int],
        bodies: FloatArray,
        failures: Counter[str],
    ) -> HalfStep | None:
        """Return the half step over chosen feet, at the height with the largest margin.

        None if the stance does not hold at any height; `failures` then counts why.
        """
        friction = [c.friction[i] for c, i in zip(candidates, chosen, strict=True)]
        answer = self.client.query_stance(
            _taken(candidates, chosen),
            friction,
            base_position=bodies,
            mass=self.gait.mass,
            directions=DIRECTIONS,
            forces=True,
        )
        factor, margin = np.min(answer.load_factor, axis=-1), np.min(answer.margin, axis=-1)
        holds = answer.stands.all(axis=-1) & (factor >= self.gait.reserve)
        if not holds.any():
            failures[VERDICTS[int(np.max(answer.verdict[0]))]] += 1
            return None
        h = int(np.argmax(np.where(holds, margin, -np.inf)))
        force = answer.force[h]
        used = np.linalg.norm(force[..., :2], axis=-1) / np.maximum(force[..., 2], 1e-9)
        footholds = [
            Foothold(
                c.leg,
                tuple(map(float, c.positions[i])),
                self.terrain.patches[c.patches[i]].ground,
                float(c.friction[i]),
                float(force[:, k, 2].max()),
                float(used[:, k].max()),
            )
            for k, (c, i) in enumerate(zip(candidates, chosen, strict=True))
        ]
        rejected = {
            reason: np.concatenate([c.positions[c.reason == reason, :2] for c in candidates])
            for reason in sorted({*np.concatenate([c.reason for c in candidates])} - {""})
        }
        return HalfStep(
            body_start=tuple(map(float, bodies[h, 0])),
            body_end=tuple(map(float, bodies[h, -1])),
            body_height=self.gait.heights[h],
            step_length=float(bodies[h, -1, 0] - bodies[h, 0, 0]),
            load_factor=float(factor[h]),
            margin=float(margin[h]),
            footholds=tuple(footholds),
            rejected={reason: len(points) for reason, points in rejected.items()},
            rejected_at=rejected,
        )


def _taken(candidates: Sequence[Candidates], chosen: Sequence[int]) -> dict[str, FloatArray]:
    """Return the chosen feet, by leg."""
    return {c.leg: c.positions[i] for c, i in zip(candidates, chosen, strict=True)}
