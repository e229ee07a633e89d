# SPDX-License-Identifier: Apache-2.0
"""A tripod gait over terrain: which footholds, how long a step, how high the body.

The legs step in two tripods. While one tripod carries the body along +x of the map at constant yaw,
the other swings; then the roles change. Every half step goes like this:

1. Ground: the smoothest kind of ground that the swinging legs may land on counts.
2. Step length: for several body heights, the longest stance on it, by load and by rated friction.
3. Footholds: candidates on a grid around each leg's nominal foothold, judged at touchdown, halfway
   and at lift-off. One passes if it is on no edge, keeps clear of standing feet, carries the
   required load and needs no rougher ground than there is, also at full efforts (mu_e <= mu).
4. Choice: the lowest cost, which is the larger of required load / load capacity and mu_e / mu,
   plus the distance from the nominal foothold in metres. The three together must bear the weight
   with the body's centre: no leg more than the required load, none less than a little.
5. Moves are tried from the longest to the shortest, sidesteps last; one counts if the other tripod
   finds footholds after it. If none does, the walk ends and the reasons are told.

Assumed: the weight acts at the origin of the base frame, the legs weigh nothing, forces of
acceleration are within what `load_share` leaves, the ground is level within a patch.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from leg_msgs.msg import FootholdVerdict
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
GRAVITY = 9.81  # m/s^2
INSTANTS = np.array([0.0, 0.5, 1.0])  # of a stance: touchdown, halfway, lift-off
FRACTIONS = (1.0, 0.75, 0.5, 0.25)  # of the longest step that are tried
ASIDE_WEIGHT = 4.0  # so much travel is given up for staying on the line, per metre off it
MOST_HEIGHTS = 2  # body heights that are tried in a half step
MOST_PER_LEG = 10  # of the best candidates of each leg that are combined
VERDICTS = {
    getattr(FootholdVerdict, name): name.lower().replace("_", " ")
    for name in (
        *("FEASIBLE", "REACH", "JOINT_RANGE", "PASSIVE_JOINT", "SINGULAR", "INVALID_INPUT"),
        *("FRICTION", "EFFORT"),
    )
}
EDGE, CROWDED, SMOOTH = "edge", "near a foot", "mu_e > mu"


@dataclass(frozen=True)
class Gait:
    """What the planner assumes and how it searches; all in SI units.

    Attributes:
        mass: Mass of the robot [kg].
        load_share: Share of the weight that any leg may have to bear; half is the middle leg's.
        least_share: Share that every leg bears at least, so that the robot does not tip over.
        longest_step: Cap of the step length [m].
        shortest_step: No shorter ones are made [m].
        step_reserve: Share of the step length allowed that is used.
        heights: Heights of the base frame over the ground that may be chosen [m].
        height_change: Largest change of the body's z in a half step [m].
        ahead: Candidates lie so far before and behind the nominal foothold [m].
        aside: Candidates lie so far beside it [m].
        spacing: Distance of candidates [m].
        foot_radius: Ground this far around a foothold has to be level [m].
        clearance: Least distance of two feet [m].
        sidestep: How far the body goes aside at once [m].
    """

    mass: float = 120.0
    load_share: float = 0.6
    least_share: float = 0.03
    longest_step: float = 0.26
    shortest_step: float = 0.02
    step_reserve: float = 0.9
    heights: tuple[float, ...] = (0.60, 0.65, 0.70)
    height_change: float = 0.06
    ahead: float = 0.12
    aside: float = 0.09
    spacing: float = 0.015
    foot_radius: float = 0.03
    clearance: float = 0.1
    sidestep: float = 0.05

    @property
    def weight(self) -> float:
        """Weight of the robot [N]."""
        return self.mass * GRAVITY

    @property
    def required_load(self) -> float:
        """Load that a foothold has to bear [N]."""
        return self.load_share * self.weight

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
        load_capacity: Least load capacity during the stance [N].
        rated_friction: Largest mu_e during the stance.
        load: Largest load that the weight puts on it during the stance [N].
    """

    leg: str
    position: tuple[float, ...]
    ground: str
    friction: float
    load_capacity: float
    rated_friction: float
    load: float


@dataclass(frozen=True)
class HalfStep:
    """One landing of a tripod and the travel of the body that it carries.

    Attributes:
        body_start: Origin of the base frame at touchdown, in the map [m].
        body_end: The same at lift-off [m].
        body_height: Height over the ground that was chosen [m].
        ground: The ground that limits the step.
        allowed_step: Longest step on it at this height [m], before cap and reserve.
        step_length: Travel ahead [m].
        footholds: One for each leg of the tripod.
        tries: Moves tried until this one.
        rejected: How many candidates failed, by reason.
        rejected_at: Where they are (m, 2) [m], by reason.
    """

    body_start: tuple[float, ...]
    body_end: tuple[float, ...]
    body_height: float
    ground: str
    allowed_step: float
    step_length: float
    footholds: tuple[Foothold, ...]
    tries: int
    rejected: dict[str, int]
    rejected_at: dict[str, FloatArray] = field(repr=False)


class NoFootholdsError(Exception):
    """No move is possible; the message says why."""


class StepOption(NamedTuple):
    """A body height and the step that it allows.

    Attributes:
        height: Height of the base frame over the ground [m].
        ground: The ground that limits the step.
        allowed: Longest step of the tripod [m].
        load_capacity: Least load capacity on it [N].
        centres: Middle of each leg's stance in the base frame (legs, 3) [m].
    """

    height: float
    ground: str
    allowed: float
    load_capacity: float
    centres: FloatArray


class Move(NamedTuple):
    """A step option and where the body goes: travel ahead and aside [m]."""

    option: StepOption
    travel: float
    aside: float


class Candidates(NamedTuple):
    """Judged candidates of one leg.

    Attributes:
        leg: Name of the leg.
        positions: Where they are in the map (m, 3) [m].
        grounds: Index of the patch that counts (m,).
        friction: Friction coefficient there (m,).
        load_capacity: Least load capacity during the stance (m,) [N].
        rated_friction: Largest mu_e during the stance (m,).
        cost: What the choice minimises (m,); infinite for those that fail.
        reason: Why it fails (m,); empty for those that pass.
    """

    leg: str
    positions: FloatArray
    grounds: Any
    friction: FloatArray
    load_capacity: FloatArray
    rated_friction: FloatArray
    cost: FloatArray
    reason: Any


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
        self._step_lengths: dict[tuple[int, str], tuple[FloatArray, FloatArray, FloatArray]] = {}
        names = client.legs()
        missing = sorted({leg for tripod in TRIPODS for leg in tripod} - set(names))
        if missing:
            raise NoFootholdsError(
                f"a tripod gait needs the legs {', '.join(missing)}; the robot has "
                f"{', '.join(names)}"
            )
        self.base_frame = client.describe(TRIPODS[0][0]).base_frame
        self.neutral = {leg: self._neutral_foot(leg) for tripod in TRIPODS for leg in tripod}

    def start(self) -> State:
        """Return the state at the origin of the map, all feet in the middle of their stances."""
        ground = self.terrain.patches[0]
        options = [self.best_options(tripod, [ground.ground]) for tripod in (0, 1)]
        if not all(options):
            raise NoFootholdsError(f"the legs cannot carry the robot on {ground.ground}")
        body = np.array([0.0, 0.0, ground.height + options[1][0].height])
        feet = body + balanced_centres(options[1][0], 0.0)
        feet[:, 2] = self.terrain.height(feet)
        return State(0, body, dict(zip(TRIPODS[1], feet, strict=True)))

    def arrived(self, state: State) -> bool:
        """Tell whether the body has gone the distance."""
        return bool(state.body[0] >= self.distance - 1e-6)

    def next_half_step(self, state: State) -> tuple[HalfStep, State]:
        """Return the best half step after which the other tripod can land, too.

        Raises:
            NoFootholdsError: If there is none.
        """
        failures: Counter[str] = Counter()
        self._forget_step_lengths(state.tripod)
        for half_step, after in self.half_steps(state, failures):
            if self.arrived(after) or next(self.half_steps(after, Counter(), brief=True), None):
                return half_step, after
            failures["the other tripod would find no footholds"] += 1
        reasons = "; ".join(f"{reason} ({count})" for reason, count in failures.most_common(6))
        raise NoFootholdsError(
            f"no footholds for {', '.join(TRIPODS[state.tripod])}: {reasons or 'no step allowed'}"
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
        legs = TRIPODS[state.tripod]
        present = float(state.body[2] - np.median([foot[2] for foot in state.feet.values()]))
        options = self.best_options(state.tripod, self.grounds_ahead(state), present)
        for tries, move in enumerate(self.moves(state, options, brief), start=1):
            window = self.window(state, balanced_centres(move.option, move.travel), move.travel)
            level = float(np.median(self.terrain.height(window)))
            rise = np.clip(
                level + move.option.height - state.body[2],
                -self.gait.height_change,
                self.gait.height_change,
            )
            after = state.body + np.array([move.travel, move.aside, rise])
            judged = self.judge(legs, window, state, after)
            chosen = self.choose(judged, state.body, after)
            if chosen is None:
                failures.update(_why(judged))
                continue
            rejected = {
                str(reason): np.concatenate(
                    [candidates.positions[candidates.reason == reason, :2] for candidates in judged]
                )
                for reason in np.unique(np.concatenate([c.reason for c in judged]))
                if reason
            }
            half_step = HalfStep(
                tuple(map(float, state.body)),
                tuple(map(float, after)),
                move.option.height,
                move.option.ground,
                move.option.allowed,
                move.travel,
                chosen,
                tries,
                {reason: len(points) for reason, points in rejected.items()},
                rejected,
            )
            feet = {foothold.leg: np.array(foothold.position) for foothold in chosen}
            yield half_step, State(1 - state.tripod, after, feet)

    # ------------------------------------------------------------------ step length

    def grounds_ahead(self, state: State) -> list[str]:
        """Return the kinds of ground that the next tripod may land on."""
        legs = TRIPODS[state.tripod]
        centres = np.stack([self.neutral[leg] for leg in legs])
        windows = [self.window(state, centres, travel) for travel in (0.0, self.gait.longest_step)]
        touched = np.unique(self.terrain.at(np.stack(windows)))
        return sorted({self.terrain.patches[k].ground for k in touched})

    def _neutral_foot(self, leg: str) -> FloatArray:
        """Return the foot in the initial pose, in the base frame [m]."""
        joints = np.zeros(len(self.client.describe(leg).joint_names))
        answer = self.client.forward_kinematics(leg, joints, frame=self.base_frame)
        return np.asarray(answer.positions)

    def best_options(
        self, tripod: int, grounds: Sequence[str], present: float | None = None
    ) -> list[StepOption]:
        """Return the best body heights, the one with the longest step that may be used first.

        Of equal steps, that nearest to the present height comes first, then that with the larger
        load capacity.
        """
        answers = {ground: self.ask_step_length(tripod, ground) for ground in grounds}
        options = []
        for k, height in enumerate(self.gait.heights):
            ground = min(answers, key=lambda ground: float(answers[ground][0][k]))
            allowed, centres, capacity = (values[k] for values in answers[ground])
            if self.usable(allowed) >= self.gait.shortest_step:
                option = StepOption(height, ground, float(allowed), float(capacity), centres)
                options.append(option)

        def order(option: StepOption) -> tuple[float, ...]:
            change = 0.0 if present is None else abs(option.height - present)
            step = self.usable(option.allowed)
            return -round(step, 2), round(change, 2), -option.load_capacity

        return sorted(options, key=order)[:MOST_HEIGHTS]

    def usable(self, allowed: float) -> float:
        """Return the step that may be used of a step allowed [m]."""
        return min(self.gait.longest_step, self.gait.step_reserve * float(allowed))

    def ask_step_length(
        self, tripod: int, ground: str
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Ask for the stance on level ground that both criteria allow, at all heights (h,).

        Returns:
            Longest common step (h,) [m], middle of each leg's stance in the base frame
            (h, legs, 3) [m], and least load capacity on it (h,) [N].
        """
        if (tripod, ground) in self._step_lengths:
            return self._step_lengths[tripod, ground]
        heights = -np.array(self.gait.heights)
        by_load, by_friction = (
            self.client.query_step_length.future(
                TRIPODS[tripod],
                heights,
                ground,
                self.gait.required_load,
                by_rated_friction=by_rated_friction,
                frame=self.base_frame,
            )
            for by_rated_friction in (False, True)
        )
        load, friction = by_load.wait(), by_friction.wait()
        starts, ends = (
            np.maximum(load.start, friction.start),
            np.minimum(load.end, friction.end),
        )
        lengths = np.fmax(ends[..., 0] - starts[..., 0], 0.0)
        centres = np.swapaxes(0.5 * (starts + ends), 0, 1)
        capacity = np.min(load.load_capacity, axis=(0, 2))
        self._step_lengths[tripod, ground] = np.min(lengths, axis=0), centres, capacity
        return self._step_lengths[tripod, ground]

    def _forget_step_lengths(self, tripod: int) -> None:
        """Forget the answers for one tripod; looking ahead at the other one takes the last ones."""
        for key in [key for key in self._step_lengths if key[0] == tripod]:
            del self._step_lengths[key]

    # ------------------------------------------------------------------ moves

    def moves(self, state: State, options: Sequence[StepOption], brief: bool) -> list[Move]:
        """Return the moves to try, the best first: far ahead and close to the line y = 0."""
        y, far = float(state.body[1]), self.gait.sidestep
        home = float(np.clip(-y, -far, far))
        asides = [home] if brief else sorted({home, 0.0, far, -far}, key=lambda dy: abs(y + dy))
        left = self.distance - float(state.body[0])
        fractions = FRACTIONS[::2] if brief else FRACTIONS
        moves = []
        for option, fraction, aside in product(options, fractions, asides):
            travel = min(fraction * self.usable(option.allowed), left)
            if travel >= min(self.gait.shortest_step, left):
                moves.append(Move(option, travel, aside))
        moves.sort(key=lambda m: ASIDE_WEIGHT * abs(y + m.aside) - m.travel)
        return moves

    def window(self, state: State, centres: FloatArray, travel: float) -> FloatArray:
        """Return the candidates of each leg in the map (legs, m, 2) [m], nominal foothold amid."""
        nominal = state.body[:2] + centres[:, :2] + [0.5 * travel, 0.0]
        return np.asarray(nominal[:, None, :] + self.gait.grid)

    # ------------------------------------------------------------------ footholds

    def judge(
        self, legs: Sequence[str], window: FloatArray, state: State, body_end: FloatArray
    ) -> list[Candidates]:
        """Ask the nodes about all candidates of a tripod while the body goes to its end."""
        bodies = state.body + INSTANTS[:, None] * (body_end - state.body)
        patches = self.terrain.patches
        asked = []
        for leg, xy in zip(legs, window, strict=True):
            under = self.terrain.under_foot(xy, self.gait.foot_radius)
            positions = np.column_stack([xy, self.terrain.height(xy)])
            seen = positions - bodies[:, None, :]
            grounds = {patches[k].ground for k in under if k >= 0}
            futures = {}
            for ground in sorted(grounds):
                rows = np.flatnonzero([k >= 0 and patches[k].ground == ground for k in under])
                futures[ground] = (
                    rows,
                    self.client.query_footholds.future(
                        leg,
                        seen[:, rows],
                        ground,
                        self.gait.required_load,
                        frame=self.base_frame,
                    ),
                )
            asked.append((leg, positions, under, futures))
        return [self._judged(*parts, state) for parts in asked]

    def _judged(
        self, leg: str, positions: FloatArray, under: Any, futures: Mapping[str, Any], state: State
    ) -> Candidates:
        count = len(positions)
        friction, capacity, mu_e, margin = (np.full(count, np.nan) for _ in range(4))
        reason = np.full(count, EDGE, dtype=object)
        for rows, future in futures.values():
            answer = future.wait()
            worst = np.max(answer.verdict, axis=0)
            friction[rows] = answer.friction_coefficient
            capacity[rows] = np.min(answer.load_capacity, axis=0)
            mu_e[rows] = np.max(answer.rated_friction, axis=0)
            margin[rows] = np.min(answer.margin, axis=0)
            reason[rows] = [VERDICTS[int(verdict)] if verdict else "" for verdict in worst]
        reason[(reason == "") & (mu_e > friction)] = SMOOTH
        for foot in state.feet.values():
            near = np.linalg.norm(positions[:, :2] - foot[:2], axis=-1) < self.gait.clearance
            reason[near & (reason == "")] = CROWDED
        distance = np.linalg.norm(positions[:, :2] - positions[count // 2, :2], axis=-1)
        cost = np.where(reason == "", distance - margin, np.inf)
        return Candidates(leg, positions, under, friction, capacity, mu_e, cost, reason)

    def choose(
        self, judged: Sequence[Candidates], body: FloatArray, body_end: FloatArray
    ) -> tuple[Foothold, ...] | None:
        """Return the footholds of least cost that bear the weight together, if there are any."""
        best = [np.argsort(c.cost, kind="stable")[:MOST_PER_LEG] for c in judged]
        best = [rows[np.isfinite(c.cost[rows])] for c, rows in zip(judged, best, strict=True)]
        choices = np.stack(np.meshgrid(*best, indexing="ij"), axis=-1).reshape(-1, len(best))
        if not len(choices):
            return None
        feet = np.stack([c.positions[choices[:, k]] for k, c in enumerate(judged)], axis=1)
        bodies = body + INSTANTS[:, None] * (body_end - body)
        shares = load_shares(feet, bodies)
        bears = (shares >= self.gait.least_share) & (shares <= self.gait.load_share)
        cost = sum(c.cost[choices[:, k]] for k, c in enumerate(judged))
        cost = np.where(bears.all(axis=(1, 2)), cost, np.inf)
        row = int(np.argmin(cost))
        if not np.isfinite(cost[row]):
            return None
        return tuple(
            Foothold(
                c.leg,
                tuple(map(float, c.positions[i])),
                self.terrain.patches[c.grounds[i]].ground,
                float(c.friction[i]),
                float(c.load_capacity[i]),
                float(c.rated_friction[i]),
                float(np.max(shares[row, k]) * self.gait.weight),
            )
            for k, (c, i) in enumerate(zip(judged, choices[row], strict=True))
        )


def balanced_centres(option: StepOption, travel: float) -> FloatArray:
    """Return where the middle of each leg's stance should be, in the base frame (legs, 3) [m].

    The stances allowed leave some slack when less than their length is used: it goes into bringing
    the middle of the feet under the origin of the base frame, where the weight acts.
    """
    slack = 0.5 * (option.allowed - travel)
    shift = np.clip(-np.mean(option.centres[:, 0]), -slack, slack)
    return np.asarray(option.centres + np.array([shift, 0.0, 0.0]))


def load_shares(feet: FloatArray, bodies: FloatArray) -> FloatArray:
    """Return the share of the weight that each of three feet bears.

    Args:
        feet: Where they stand (..., 3, 3) [m].
        bodies: Where the weight acts (t, 3) [m].

    Returns:
        Shares (..., 3, t); negative ones mean that the body tips over.
    """
    ones = np.ones((*feet.shape[:-1], 1))
    balance = np.swapaxes(np.concatenate([ones, feet[..., :2]], axis=-1), -1, -2)
    weight = np.column_stack([np.ones(len(bodies)), bodies[:, :2]]).T
    weights = np.broadcast_to(weight, (*feet.shape[:-2], 3, len(bodies)))
    return np.asarray(np.linalg.solve(balance, weights))


def _why(judged: Sequence[Candidates]) -> Counter[str]:
    """Count why a move failed: the commonest reason of each leg that has no candidate left."""
    stuck = [c for c in judged if (c.reason != "").all()]
    if not stuck:
        return Counter(["the weight would not be shared well"])
    return Counter(f"{c.leg}: {Counter(c.reason).most_common(1)[0][0]}" for c in stuck)
