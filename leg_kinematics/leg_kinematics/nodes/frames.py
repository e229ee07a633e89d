# SPDX-License-Identifier: Apache-2.0
"""Frames of requests and points in them: a leg's own, the base, or one around the robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from scipy.spatial.transform import Rotation

from leg_kinematics.arrays import FloatArray
from leg_kinematics.errors import NotSupportedError
from leg_kinematics.mechanism import Posture
from leg_kinematics.nodes.requests import RequestError, check_count, read_rows
from leg_kinematics.robot import BASE, Leg, Mount, Robot

UNIT_TOLERANCE = 1e-3  # of the norm of a quaternion


class Whereabouts(Protocol):
    """What knows a robot, and where it is."""

    @property
    def robot(self) -> Robot:
        """The robot."""

    def base_pose(self, frame_id: str, stamp: Any) -> Mount:
        """Return where the base frame is in a frame that is none of the robot's.

        Args:
            frame_id: Name of the frame.
            stamp: Time of the pose; zero for the latest.

        Raises:
            RequestError: If it is not known, with the reason.
        """


@dataclass(frozen=True)
class LegFrame:
    """A request in the leg's own frame: nothing to convert.

    Attributes:
        vertical: Which way is up unless a request tells, in the leg frame (3,).
    """

    vertical: tuple[float, float, float]

    def points_to_leg(self, points: FloatArray) -> FloatArray:
        """Return points (..., t) of the request in the leg frame."""
        return points

    def points_from_leg(self, points: FloatArray) -> FloatArray:
        """Return points (..., t) of the leg frame in the frame of the request."""
        return points

    def vectors_to_leg(self, vectors: FloatArray) -> FloatArray:
        """Return free vectors (..., 3) of the request in the leg frame."""
        return vectors

    def vectors_from_leg(self, vectors: FloatArray) -> FloatArray:
        """Return free vectors (..., 3) of the leg frame in the frame of the request."""
        return vectors

    def rows_from_leg(self, matrix: FloatArray) -> FloatArray:
        """Return a matrix (..., 3, n) whose columns are free vectors in the request's frame."""
        return matrix


@dataclass(frozen=True)
class OuterFrame(LegFrame):
    """A request in a frame of which it is known where the leg is in it: z is up."""

    mount: Mount

    @classmethod
    def of(cls, mount: Mount) -> OuterFrame:
        """Return the frame in which a leg is mounted so."""
        return cls(mount.vertical, mount)

    def points_to_leg(self, points: FloatArray) -> FloatArray:
        """Return points (..., 3) of the outer frame in the leg frame."""
        return self.mount.to_leg(points)

    def points_from_leg(self, points: FloatArray) -> FloatArray:
        """Return points (..., 3) of the leg frame in the outer frame."""
        return self.mount.to_base(points)

    def vectors_to_leg(self, vectors: FloatArray) -> FloatArray:
        """Return free vectors (..., 3) of the outer frame in the leg frame."""
        return self.mount.vectors_to_leg(vectors)

    def vectors_from_leg(self, vectors: FloatArray) -> FloatArray:
        """Return free vectors (..., 3) of the leg frame in the outer frame."""
        return self.mount.vectors_to_base(vectors)

    def rows_from_leg(self, matrix: FloatArray) -> FloatArray:
        """Return a matrix (..., 3, n) whose columns are free vectors in the outer frame."""
        return self.mount.rotation @ matrix


def read_feet(leg: Leg, request: Any, frame: LegFrame) -> FloatArray:
    """Return the `positions` of a request in the leg frame (N, t).

    Raises:
        RequestError: If their number is wrong.
    """
    positions = read_rows("positions", request.positions, leg.mechanism.task_coordinates)
    return frame.points_to_leg(positions)


def read_posture(leg: Leg, request: Any, frame: LegFrame, limit: int) -> Posture:
    """Return the postures (N,) at the `positions` of a request.

    Raises:
        RequestError: If their number is wrong or too large.
        UnknownNameError: If the leg has no such assembly mode.
    """
    feet = read_feet(leg, request, frame)
    check_count("positions", len(feet), limit)
    return leg.mechanism.inverse(feet, request.assembly_mode)


def find_frame(host: Whereabouts, leg: Leg, request: Any) -> LegFrame:
    """Return the frame of a request about a leg.

    Raises:
        RequestError: If it is neither the leg's own frame nor one in which the base is.
        NotSupportedError: If it is not the leg's own, and the foot's coordinates are not x, y, z.
    """
    if request.header.frame_id in ("", leg.frame):
        _refuse_pose(host.robot, request)
        return LegFrame(leg.mount.vertical)
    return outer_frame(leg, find_base(host, request), request.header.frame_id)


def find_base(host: Whereabouts, request: Any) -> Mount:
    """Return where the base frame is in the frame of a request, which is no leg's own.

    Raises:
        RequestError: If it is not known.
    """
    frame_id, robot = request.header.frame_id, host.robot
    if frame_id in ("", robot.base_frame):
        _refuse_pose(robot, request)
        return BASE
    if frame_id in {leg.frame for leg in robot.legs.values()}:
        raise RequestError(
            f"header.frame_id: {frame_id!r} is another leg's; allowed: that of the leg asked "
            f"about, {robot.base_frame!r} (the robot's base), or a frame around the robot with "
            "base_pose"
        )
    if len(request.base_pose):
        pose = request.base_pose[0]
        return read_mount("base_pose", pose.position, pose.orientation)
    return host.base_pose(frame_id, request.header.stamp)


def robot_frame(robot: Robot, leg: Leg, frame_id: str) -> LegFrame:
    """Return a frame of the robot in which something about a leg is given.

    Raises:
        RequestError: If it is neither the leg's own frame nor the robot's base frame.
        NotSupportedError: If it is the base frame and the foot's coordinates are not x, y, z.
    """
    if frame_id in ("", leg.frame):
        return LegFrame(leg.mount.vertical)
    if frame_id != robot.base_frame:
        raise RequestError(
            f"header.frame_id: unknown frame {frame_id!r}; allowed: '' or {leg.frame!r} (the leg's "
            f"own), {robot.base_frame!r} (the robot's base)"
        )
    return outer_frame(leg, BASE, frame_id)


def outer_frame(leg: Leg, base: Mount, frame_id: str) -> OuterFrame:
    """Return a frame in which the base frame is as `base` tells, for a leg.

    Raises:
        NotSupportedError: If the foot's coordinates are not x, y, z.
    """
    if not leg.mechanism.has_point_foot:
        raise NotSupportedError(
            f"header.frame_id: {frame_id!r} needs a leg with coordinates x, y, z; {leg.name!r} has "
            f"{', '.join(leg.mechanism.task_coordinates)}: give positions in {leg.frame!r}"
        )
    return OuterFrame.of(leg.mount.within(base))


def read_mount(field: str, place: Any, turn: Any) -> Mount:
    """Return where a frame is, from a point (x, y, z) and a quaternion (x, y, z, w).

    Raises:
        RequestError: If it is not finite, or the quaternion is not of length 1.
    """
    positions, rotations = _placements([field], [place], [turn])
    return Mount(positions[0], rotations[0])


def read_poses(field: str, poses: Sequence[Any]) -> tuple[FloatArray, FloatArray]:
    """Return the positions (S, 3) [m] and rotations (S, 3, 3) of poses of a request, at least one.

    Raises:
        RequestError: If one is not finite, or its quaternion is not of length 1.
    """
    names = [f"{field}[{k}]" for k in range(len(poses))]
    return _placements(names, [p.position for p in poses], [p.orientation for p in poses])


def _placements(
    fields: Sequence[str], places: Sequence[Any], turns: Sequence[Any]
) -> tuple[FloatArray, FloatArray]:
    """Return points (S, 3) and the rotations (S, 3, 3) of quaternions x, y, z, w."""
    positions = np.array([(p.x, p.y, p.z) for p in places])
    quaternions = np.array([(q.x, q.y, q.z, q.w) for q in turns])
    far = ~np.isfinite(positions).all(axis=-1)
    if far.any():
        k = int(np.argmax(far))
        raise RequestError(
            f"{fields[k]}.position: got {positions[k].tolist()}; allowed: finite values"
        )
    norms = np.linalg.norm(quaternions, axis=-1)
    wrong = ~(np.abs(norms - 1.0) <= UNIT_TOLERANCE)
    if wrong.any():
        k = int(np.argmax(wrong))
        raise RequestError(
            f"{fields[k]}.orientation: got {quaternions[k].tolist()} (x, y, z, w) of length "
            f"{norms[k]:g}; allowed: a quaternion of length 1"
        )
    return positions, Rotation.from_quat(quaternions).as_matrix()


def no_transforms(robot: Robot, frame_id: str, why: str) -> RequestError:
    """Return the error that tells why it is not known where the base is in a frame."""
    return RequestError(
        f"header.frame_id: unknown frame {frame_id!r}; allowed: '' or the leg's own "
        f"({', '.join(leg.frame for leg in robot.legs.values())}), {robot.base_frame!r} (the "
        f"robot's base), or any other with base_pose, the pose of {robot.base_frame!r} in it; {why}"
    )


def _refuse_pose(robot: Robot, request: Any) -> None:
    """Raise a RequestError if a request in a frame of the robot tells where the robot is."""
    if len(request.base_pose):
        raise RequestError(
            f"base_pose: given, and header.frame_id {request.header.frame_id!r} is a frame of the "
            f"robot; allowed: none, or a frame in which {robot.base_frame!r} has this pose"
        )
