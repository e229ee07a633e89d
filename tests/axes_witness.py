# SPDX-License-Identifier: Apache-2.0
"""What every service answers on random points, condensed, in the leg frames of the first release.

Leg frames had y forward and x to the right before they followed REP-103. `observe` asks the nodes
of a mixed robot the same questions whatever the axes are: points and vectors are drawn in the
former ones, turned to today's for the request, and what comes back is turned again. Of every field
of an answer it keeps weighted sums over blocks of points, in which any single value that differs
shows, and how often each status, verdict and index occurs.

`python tests/axes_witness.py FILE` writes these numbers as the nodes of this checkout give them.
The file in tests/data was written so by commit cda2af5, whose leg frames were the former ones, with
`turned` and `former` that leave every vector as it is and lateral offsets that count to the right.
"""

import sys
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from leg_msgs_py.client import LegClient
from leg_msgs_py.grounds import Ground
from node_processes import NodeProcesses
from ruamel.yaml import YAML
from scipy.spatial.transform import Rotation

from leg_kinematics import load_robot
from leg_kinematics.description import find_robot_file

WITNESS = Path(__file__).resolve().parent / "data" / "former_axes.npz"

POINTS = 10_000  # of each leg
BLOCK = 500  # of them in a sum
STEPS = 60  # stances of each leg
MAP_POINTS_ACROSS = 40
SINGLE = "single"  # precision of a cloud's fields

# One leg of every type that the robots' legs have, and its mirror image where there is one.
LEGS = {
    "hexapod": ("right_front", "left_front"),
    "quadruped": ("right_front", "left_front"),
    "walker": ("left_front_inner", "left_front_outer"),
    "gantry": ("arm",),
}
# What acts on their feet: force [N], moment [N.m], how far points lie about the workspace [m].
SCALES = {
    "hexapod": (500.0, 5.0, 0.3),
    "quadruped": (1000.0, 20.0, 0.3),
    "walker": (100.0, 0.1, 0.002),
    "gantry": (200.0, 10.0, 0.1),
}


def turned(vectors):
    """Return vectors (..., 3) of a walking leg's former frame in its frame of today."""
    vectors = np.asarray(vectors, dtype=np.float64)
    return np.stack([vectors[..., 1], -vectors[..., 0], vectors[..., 2]], axis=-1)


def former(vectors):
    """Return vectors (..., 3) of a walking leg's frame of today in its former frame."""
    return np.stack([-vectors[..., 1], vectors[..., 0], vectors[..., 2]], axis=-1)


def lateral(offset):
    """Return the distance of a line, once counted to the right, as it counts today."""
    return -offset


def mixed_description():
    """Return one robot that has the legs of all shipped ones."""
    types, legs = {}, {}
    for robot, names in LEGS.items():
        document = YAML(typ="safe").load(find_robot_file(robot).read_text())
        assert document["units"] == {"length": "mm", "angle": "deg"}
        types |= {f"{robot}_{name}": value for name, value in document["leg_types"].items()}
        for name in names:
            leg = document["legs"][name]
            legs[f"{robot}_{name}"] = {**leg, "type": f"{robot}_{leg['type']}"}
    frame = {"base_frame": "base_link", "units": {"length": "mm", "angle": "deg"}}
    return {"name": "mixed", **frame, "leg_types": types, "legs": legs}


class Record:
    """Sums of the fields of answers, by name."""

    def __init__(self):
        self.sums = {}

    def values(self, name, values):
        """Keep values (points, ...): sums of a bounded function of them, and where NaN stands."""
        flat = np.asarray(values, dtype=np.float64).reshape(len(values), -1)
        rng = np.random.default_rng(3)
        weights, marks = rng.uniform(0.5, 1.5, (2, *flat.shape))
        missing = np.isnan(flat)
        with np.errstate(invalid="ignore"):
            bounded = np.where(np.isinf(flat), np.sign(flat), flat / (1.0 + np.abs(flat)))
        starts = np.arange(0, len(flat), BLOCK)
        for kind, terms in (
            ("sums", np.where(missing, 0.0, weights * bounded)),
            ("missing", np.where(missing, marks, 0.0)),
        ):
            if kind == "sums" or missing.any():
                self.sums[f"{name}/{kind}"] = np.add.reduceat(terms.sum(axis=-1), starts)

    def codes(self, name, codes):
        """Keep small whole numbers (points, ...): their sums, and how often each occurs."""
        codes = np.asarray(codes, dtype=np.int64)
        self.values(name, codes.reshape(len(codes), -1))
        self.sums[f"{name}/counts"] = np.bincount(codes.ravel() + 1)  # -1 stands for none


class Questions:
    """Asks for one leg and keeps the answers.

    Args:
        client: Client of the mixed robot's nodes.
        robot: Name of the robot that the leg is from.
        leg: Name of the leg in the mixed robot.
        mechanism: The leg's mechanism.
        record: Where sums go.
    """

    def __init__(self, client, robot, leg, mechanism, record):
        self.client, self.leg, self.record = client, leg, record
        self.has_foot = tuple(mechanism.task_coordinates) == ("x", "y", "z")
        self.has_rated_friction = len(mechanism.joints) == 3
        # the manipulator's frame has stayed as it was
        self.turned = turned if self.has_foot else np.asarray
        self.former = former if self.has_foot else np.asarray
        self.force, self.moment, spread = SCALES[robot]
        rng = np.random.default_rng(sum(map(ord, leg)))
        lower, upper = mechanism.joint_limits.T
        middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
        self.joints = middle + 1.1 * half * rng.uniform(-1.0, 1.0, (POINTS, len(lower)))
        reached = self.former(client.forward_kinematics(leg, self.joints).positions)
        start = self.former(mechanism.initial_posture.foot_position)
        # two of three points as the joints put them, the others about them
        around = spread * rng.uniform(-1.0, 1.0, reached.shape)
        around[rng.uniform(size=POINTS) < 2.0 / 3.0] = 0.0
        self.feet = np.where(np.isnan(reached), start, reached) + around
        if mechanism.name == "six_bar":  # the foot stays on a curve: stay near enough
            self.feet[:, 0] = 2e-4 * rng.uniform(-1.0, 1.0, POINTS)
        self.feet[7] = np.nan
        self.forces = self.force * rng.normal(size=(POINTS, 3))
        self.moments = self.moment * rng.normal(size=(POINTS, 3))
        self.slope = np.array([0.12, -0.07, 1.0])  # a normal of the ground
        self.rng = rng

    def ask_all(self):
        """Ask every service, in the leg's own frame and, where it has one, the base frame."""
        told = self.client.describe(self.leg)
        self._describe(told)
        self._kinematics("own", "", self.turned(self.feet), self.turned)
        if not self.has_foot:
            return
        rotation = _matrix(told.mount_orientation)
        base = self.turned(self.feet) @ rotation.T + told.mount_position

        def in_base(vectors):
            return self.turned(vectors) @ rotation.T

        self._kinematics("base", told.base_frame, base, in_base)
        for name, frame, feet, vectors in (
            ("own", "", self.turned(self.feet), self.turned),
            ("base", told.base_frame, base, in_base),
        ):
            self._footholds(name, frame, feet, vectors)
            self._steps(name, frame, vectors, told.mount_position if frame else np.zeros(3))
        self._maps(told.base_frame)

    def _back(self, frame):
        """Return what brings an answer's vectors to the axes of the file."""
        return np.asarray if frame else self.former

    def _columns(self, matrix, frame):
        """Return a matrix (..., 3, n) with columns in the axes of the file."""
        return np.moveaxis(self._back(frame)(np.moveaxis(matrix, -2, -1)), -1, -2)

    def _describe(self, told):
        axes = self.turned(np.eye(3)) @ _matrix(told.mount_orientation).T
        self.record.values(f"{self.leg}/describe/axes", axes)
        self.record.values(f"{self.leg}/describe/mount_position", told.mount_position)
        if self.has_foot:
            initial = self.former(told.initial_foot_position)
            self.record.values(f"{self.leg}/describe/initial_foot_position", initial)

    def _kinematics(self, name, frame, feet, vectors):
        place, back = f"{self.leg}/{name}", self._back(frame)
        fk = self.client.forward_kinematics(self.leg, self.joints, frame=frame)
        self.record.values(f"{place}/forward_kinematics/positions", back(fk.positions))
        self.record.codes(f"{place}/forward_kinematics/status", fk.status)
        ik = self.client.inverse_kinematics(self.leg, feet, frame=frame)
        self.record.values(f"{place}/inverse_kinematics/joint_positions", ik.joint_positions)
        self.record.codes(f"{place}/inverse_kinematics/status", ik.status)
        modes = self.client.inverse_kinematics(self.leg, feet, frame=frame, assembly_mode="ALL")
        self.record.values(
            f"{place}/inverse_kinematics_all/joint_positions",
            np.moveaxis(modes.joint_positions, 0, 1),
        )
        self.record.codes(f"{place}/inverse_kinematics_all/status", modes.status.T)
        for source, points in (("positions", feet), ("joint_positions", self.joints)):
            answer = self.client.jacobian(self.leg, **{source: points}, frame=frame)
            at = f"{place}/get_jacobian/{source}"
            jacobian = answer.jacobian
            rows = self._columns(jacobian, frame) if self.has_foot else jacobian
            self.record.values(f"{at}/jacobian", rows)
            omega = self._columns(answer.angular_jacobian, frame)
            self.record.values(f"{at}/angular_jacobian", omega)
            self.record.values(f"{at}/condition_number", answer.condition_number)
            self.record.codes(f"{at}/status", answer.status)
        indices = self.client.evaluate_indices(self.leg, feet, frame=frame)
        for k, index in enumerate(indices.names):
            values = indices.values[:, k]
            self.record.values(f"{place}/evaluate_indices/{index}", values)
        self.record.codes(f"{place}/evaluate_indices/status", indices.status)
        if self.has_foot:
            forces, moments = vectors(self.forces), vectors(self.moments)
            held = self.client.compute_efforts(self.leg, feet, forces, moments, frame=frame)
            self.record.values(f"{place}/compute_efforts/joint_efforts", held.joint_efforts)
            self.record.values(f"{place}/compute_efforts/utilisation", held.utilisation)
            self.record.codes(f"{place}/compute_efforts/limiting_joint", held.limiting_joint)
            self.record.codes(f"{place}/compute_efforts/status", held.status)

    def _footholds(self, name, frame, feet, vectors):
        place = f"{self.leg}/{name}/query_footholds"
        answer = self.client.query_footholds(
            self.leg,
            feet,
            Ground(0.2, vectors(self.slope)),
            self.force,
            moment=vectors(self.moment * np.array([0.3, -0.2, 0.1])),
            any_direction_moment=0.2 * self.moment,
            frame=frame,
            efforts=True,
        )
        self.record.codes(f"{place}/verdict", answer.verdict)
        self.record.codes(f"{place}/status", answer.status)
        self.record.codes(f"{place}/limiting_joint", answer.limiting_joint)
        for field in (
            *("load_capacity", "rated_friction", "rated_friction_full", "friction_margin"),
            *("utilisation", "joint_efforts"),
        ):
            self.record.values(f"{place}/{field}", getattr(answer, field))
        self.record.values(f"{place}/forces", self._back(frame)(answer.force))
        ranks = np.full(POINTS, np.nan)
        ranks[answer.ranking] = np.arange(len(answer.ranking)) / POINTS
        self.record.values(f"{place}/ranking", ranks)

    def _steps(self, name, frame, vectors, origin):
        place = f"{self.leg}/{name}/query_step_length"
        low, high = np.nanquantile(self.feet[:, 2], [0.1, 0.9])
        for k, direction in enumerate(([0.0, 0.0, 0.0], [1.0, 2.0, 0.0], [-1.0, 0.3, 0.0])):
            for by_friction in (False, True)[: 2 if self.has_rated_friction else 1]:
                heights = np.random.default_rng(k).uniform(low, high, STEPS // 6)
                answer = self.client.query_step_length(
                    self.leg,
                    heights + origin[2],
                    Ground(0.2, vectors(self.slope)),
                    0.5 * self.force,
                    lateral_offsets=lateral(1e-4 * (k - 1) * self.moment),
                    direction=vectors(direction),
                    by_rated_friction=by_friction,
                    frame=frame,
                )
                at = f"{place}/{k}{'friction' if by_friction else 'capacity'}"
                back = self._back(frame)
                self.record.values(f"{at}/lengths", answer.length[0])
                for field in ("load_capacity", "rated_friction"):
                    self.record.values(f"{at}/{field}", getattr(answer, field)[0])
                self.record.values(f"{at}/starts", back(answer.start[0]))
                self.record.values(f"{at}/ends", back(answer.end[0]))
                limits = np.stack([answer.start_limit[0], answer.end_limit[0]], axis=-1)
                self.record.codes(f"{at}/limits", limits)

    def _maps(self, base_frame):
        ground = Ground(0.2, self.turned(self.slope))
        width = float(np.nanmax(np.abs(self.feet[:, 1])))
        height = float(np.nanmedian(self.feet[:, 2]))
        spacing = width / MAP_POINTS_ACROSS
        plane = self.client.index_map(self.leg, height, spacing, (), ground)
        x, y = np.meshgrid(plane.x, plane.y)
        points = self.former(np.stack([x, y, np.full_like(x, height)], axis=-1)).reshape(-1, 3)
        order = _in_order(points, spacing)
        at = f"{self.leg}/get_index_map"
        self.record.values(f"{at}/points", points[order])
        self.record.codes(f"{at}/status", plane.status.ravel()[order])
        for k, layer in enumerate(plane.layers):
            self.record.values(f"{at}/{layer}", plane.values[..., k].ravel()[order])
        # the six-bar's foot stays on a curve, which no grid meets
        spacing = 4.0 * spacing
        cloud = self.client.compute_index_map(self.leg, spacing, (), ground)
        points = self.former(cloud.positions)
        if not len(points):
            return
        order = _in_order(points, spacing)
        at = f"{self.leg}/compute_index_map"
        self.record.values(f"{at}/{SINGLE}/points", points[order])
        for k, layer in enumerate(cloud.layers):
            self.record.values(f"{at}/{SINGLE}/{layer}", cloud.values[order, k])


def _in_order(points, spacing):
    """Return the order of grid points by z, y and x."""
    return np.lexsort(np.round(points / spacing).T)


def _matrix(quaternion):
    return Rotation.from_quat(quaternion).as_matrix()


def observe(client, robot):
    """Ask the nodes of the mixed robot; return sums and counts by name.

    Args:
        client: Client of the nodes.
        robot: The same robot, for its mechanisms' limits.
    """
    record = Record()
    for source, names in LEGS.items():
        for name in names:
            leg = f"{source}_{name}"
            Questions(client, source, leg, robot.legs[leg].mechanism, record).ask_all()
    return record.sums


@contextmanager
def mixed_nodes(folder):
    """Run the nodes of the mixed robot; yield a client and the robot."""
    path = Path(folder) / "mixed.yaml"
    with path.open("w") as file:
        YAML(typ="safe").dump(mixed_description(), file)
    nodes = NodeProcesses(str(path), namespace="axes", names=["kinematics", "statics", "maps"])
    with nodes, LegClient(namespace="axes", timeout=60.0) as client:
        client.wait_until_ready(180.0)
        yield client, load_robot(path)


def write(path, sums):
    """Write numbers by name to a file."""
    np.savez_compressed(
        path,
        names=np.array(list(sums)),
        sizes=np.array([len(values) for values in sums.values()]),
        values=np.concatenate(list(sums.values())),
    )


def read(path):
    """Return what `write` has written."""
    with np.load(path) as file:
        parts = np.split(file["values"], np.cumsum(file["sizes"])[:-1])
        return dict(zip(file["names"].tolist(), parts, strict=True))


if __name__ == "__main__":
    with TemporaryDirectory() as folder, mixed_nodes(folder) as (client, robot):
        write(sys.argv[1], observe(client, robot))
