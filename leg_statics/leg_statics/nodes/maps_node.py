# SPDX-License-Identifier: Apache-2.0
"""The maps node: index maps of the legs of one robot, and markers that show the legs.

It is a process of its own, so that a map never delays the answer to a query.
"""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from leg_msgs.action import ComputeIndexMap
from leg_msgs_py.arrays import to_field
from leg_msgs_py.clouds import to_cloud
from sensor_msgs.msg import JointState, PointCloud2
from std_msgs.msg import Header
from visualization_msgs.msg import MarkerArray

from leg_kinematics.arrays import FloatArray
from leg_kinematics.errors import LegError, UnknownNameError
from leg_kinematics.mechanism import Posture
from leg_kinematics.nodes.frames import LegFrame, robot_frame
from leg_kinematics.nodes.node_process import run
from leg_kinematics.nodes.requests import RequestError
from leg_kinematics.nodes.robot_node import RobotNode
from leg_kinematics.robot import Leg, Robot
from leg_kinematics.status import Status
from leg_statics.footholds import Contact
from leg_statics.map_jobs import MapJob, MapKey, MapMemory
from leg_statics.maps import IndexMap, find_layer, supported_layers
from leg_statics.nodes.contacts import declare_grounds
from leg_statics.nodes.goal_queue import GoalQueue
from leg_statics.nodes.limits_in_force import LATCHED, LimitsInForce
from leg_statics.nodes.markers import (
    Scene,
    deletion,
    grid_points,
    moving_markers,
    workspace_marker,
    workspace_name,
)
from leg_statics.nodes.services import SERVICES
from leg_statics.nodes.services.maps import map_key
from leg_statics.warm_up import warm_up_statics


@dataclass(frozen=True)
class _MapWork:
    """A map of a whole workspace that a goal has ordered."""

    node: MapsNode
    leg: Leg
    frame: LegFrame
    frame_id: str
    job: MapJob

    def feedback(self) -> Any:
        """Return how far the map is."""
        progress = self.job.progress
        positions: FloatArray = self.frame.points_from_leg(progress.best_positions)
        return ComputeIndexMap.Feedback(
            fraction=progress.fraction,
            elapsed=progress.elapsed,
            remaining=progress.remaining,
            layers=list(progress.layers),
            best=to_field(progress.best),
            best_positions=to_field(positions),
        )

    def result(self) -> Any:
        """Return the map, or what there is of it."""
        progress, index_map = self.job.progress, self.job.index_map
        if self.job.complete and index_map is not None:
            self.node.publish_map(self.leg, index_map)
        result = ComputeIndexMap.Result(
            fraction=progress.fraction,
            elapsed=progress.elapsed,
            layers=list(progress.layers),
            units=[find_layer(name).unit for name in progress.layers],
            cloud=self.node.cloud(self.frame_id, self.frame, index_map),
        )
        if not self.job.complete:
            result.error.message = (
                f"cancelled by the caller after {100.0 * progress.fraction:.0f} % of the map"
            )
        return result


class MapsNode(RobotNode):
    """Serves index maps of planes and of whole workspaces, and publishes maps and markers."""

    def __init__(self) -> None:
        super().__init__("maps")
        self._declare_parameters()
        self.grounds = declare_grounds(self)
        self._memory = MapMemory(int(1e6 * self.value("map_memory")))
        self._limits = LimitsInForce(self, "maps", self._take_up_limits)
        self._postures: dict[str, Posture] = {}
        self._workspaces: list[Any] = []
        self._drawn_at = -np.inf
        self._shown: set[str] = set()  # namespaces of markers, of former robots too
        self._moved: dict[str, float] = {}  # positions of joints since the legs were drawn
        self._map_publisher = self.create_publisher(PointCloud2, "~/index_map", LATCHED)
        self._marker_publisher = self.create_publisher(MarkerArray, "~/markers", LATCHED)
        self.listen(JointState, "joint_states", self.joint_states)
        self.add_post_set_parameters_callback(lambda parameters: self._draw())
        self.robot_changed()
        self._queue = GoalQueue(
            self, ComputeIndexMap, "compute_index_map", "maps", self._begin, self.failure
        )
        self.serve(SERVICES["maps"])
        self.announce()

    def _declare_parameters(self) -> None:
        self.declare_number(
            "friction_coefficient",
            0.4,  # the low end of cement
            "Friction coefficient of the ground in ~/markers.",
            (0.0, 10.0),
        )
        self.declare(
            "marker_layer",
            "load_capacity",
            "Layer that colours the slice of the workspace in ~/markers; '' = no slice.",
        )
        self.declare_number(
            "marker_resolution", 0.03, "Grid spacing of that slice [m].", (0.005, 1.0)
        )
        self.declare_number("marker_rate", 10.0, "Greatest rate of ~/markers [Hz].", (0.1, 100.0))
        self.declare_number(
            "marker_force_scale", 1e-4, "Length of a force in ~/markers [m/N].", (1e-9, 1.0)
        )
        self.declare_number(
            "map_memory", 200.0, "Memory for maps computed before [MB].", (0.0, 1e5), read_only=True
        )

    def destroy_node(self) -> None:
        """End the map under way, then destroy the node."""
        self._queue.destroy()
        super().destroy_node()

    def warm_up(self, robot: Robot) -> None:
        """Call the kernels of the maps once, too."""
        super().warm_up(robot)
        warm_up_statics(robot)

    def robot_changed(self) -> None:
        """Begin anew: all legs in their initial posture, with the limits in force."""
        self._postures = {leg.name: leg.mechanism.initial_posture for leg in self._legs()}
        self._take_up_limits()

    def _legs(self) -> list[Leg]:
        return list(self.robot.legs.values())

    def look_around(self) -> None:
        """Note if no node tells the limits in force."""
        self._limits.look_around()

    def _take_up_limits(self) -> None:
        self.robot = self._limits.of(self.robot)
        self._draw()

    # ------------------------------------------------------------------ maps

    def plane(self, leg: Leg, key: MapKey) -> IndexMap:
        """Return the map of a plane, and publish it."""
        plane = self._memory.plane(key)
        self.publish_map(leg, plane)
        return plane

    def cloud(self, frame_id: str, frame: LegFrame, index_map: IndexMap | None) -> Any:
        """Return the points of a map within the workspace as a cloud."""
        if index_map is None:
            return to_cloud(self.header(frame_id), np.empty((0, 3)), {})
        inside = index_map.status == Status.OK
        values = index_map.values[inside]
        columns = {name: values[:, k] for k, name in enumerate(index_map.layers)}
        points = frame.points_from_leg(grid_points(index_map)[inside])
        return to_cloud(self.header(frame_id), points, columns)

    def publish_map(self, leg: Leg, index_map: IndexMap) -> None:
        """Publish a map in the base frame, without a time: who comes later shows it there, too."""
        base = self.robot.base_frame
        cloud = self.cloud(base, robot_frame(self.robot, leg, base), index_map)
        cloud.header = Header(frame_id=base)
        self._map_publisher.publish(cloud)

    # ------------------------------------------------------------------ the action

    def _begin(self, request: Any, pool: ThreadPoolExecutor) -> _MapWork:
        """Order the map of a goal.

        Raises:
            LegError: If it cannot be computed.
        """
        leg = self.robot.leg(request.leg)
        frame = robot_frame(self.robot, leg, request.header.frame_id)
        key = map_key(self, leg, request, frame, None)
        unknown = set(request.layers) - set(supported_layers(leg.mechanism))
        if unknown:
            raise UnknownNameError("layer", unknown.pop(), supported_layers(leg.mechanism))
        job = MapJob(key, self._memory, pool)
        return _MapWork(self, leg, frame, request.header.frame_id or leg.frame, job)

    # ------------------------------------------------------------------ markers

    def joint_states(self, message: Any) -> None:
        """Draw the legs whose joints are in the message, if somebody looks."""
        if not self._marker_publisher.get_subscription_count():
            return
        if len(message.position) != len(message.name):
            raise RequestError(
                f"position: got {len(message.position)} values; allowed: {len(message.name)}, one "
                "a name"
            )
        self._moved |= dict(zip(message.name, message.position, strict=True))
        if time.monotonic() - self._drawn_at < 1.0 / self.value("marker_rate"):
            return
        positions, self._moved = self._moved, {}  # drivers may tell one joint a message
        for leg in self._legs():
            if all(joint in positions for joint in leg.joint_names):
                joints = np.array([positions[joint] for joint in leg.joint_names])
                if leg.drives is not None:
                    joints = leg.drives.positions(joints)
                self._postures[leg.name] = leg.mechanism.forward(joints)
        self._publish_markers()

    def _draw(self) -> None:
        """Draw everything anew."""
        self._workspaces = [self._workspace(leg) for leg in self._legs()]
        self._publish_markers()

    def _workspace(self, leg: Leg) -> Any:
        """Return the marker of a leg's workspace at the height of its initial foot position."""
        header, layer = Header(frame_id=self.robot.base_frame), self.value("marker_layer")
        note = f"no workspace drawn: {leg.name}"
        self.health.notes.pop(note, None)
        if not layer or not leg.mechanism.has_point_foot:
            return deletion(header, workspace_name(leg))
        try:
            key = MapKey.of(
                leg,
                float(leg.mechanism.initial_posture.foot_position[2]),
                self.value("marker_resolution"),
                (layer,),
                Contact(self.value("friction_coefficient")),
            )
            return workspace_marker(header, leg, self._memory.plane(key), layer)
        except LegError as error:
            self.health.notes[note] = f"parameter marker_layer: {error}"
            return deletion(header, workspace_name(leg))

    def _publish_markers(self) -> None:
        header = Header(frame_id=self.robot.base_frame)
        friction, scale = self.value("friction_coefficient"), self.value("marker_force_scale")
        scenes = [
            Scene(leg, self._postures[leg.name], friction, scale)
            for leg in self._legs()
            if leg.name in self._postures
        ]
        moving = [marker for scene in scenes for marker in moving_markers(header, scene)]
        markers = [*moving, *self._workspaces]
        names = {marker.ns for marker in markers}
        self._shown |= names
        gone = [deletion(header, name) for name in sorted(self._shown - names)]
        self._marker_publisher.publish(MarkerArray(markers=[*gone, *markers]))
        self._drawn_at = time.monotonic()  # drawing takes long: the node rests after it


def main() -> int:
    """Run the node."""
    return run(MapsNode)
