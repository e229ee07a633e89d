# SPDX-License-Identifier: Apache-2.0
"""The terrain node: height maps in, foothold maps out, one for each leg.

It is a process of its own, so that a map never delays the answer to a query.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import PointCloud2

from leg_kinematics.nodes.frames import read_mount
from leg_kinematics.nodes.node_process import run
from leg_kinematics.nodes.requests import RequestError
from leg_kinematics.nodes.robot_node import RobotNode
from leg_kinematics.robot import BASE, Mount, Robot
from leg_statics.contact import Contact
from leg_statics.nodes.limits_in_force import LATCHED, LimitsInForce
from leg_statics.nodes.terrain_messages import (
    NORMAL_FIELDS,
    Layers,
    cloud_heights,
    foothold_cloud,
    foothold_grid,
    grid_heights,
)
from leg_statics.terrain import HeightMap, Surface, Survey, foothold_map, survey
from leg_statics.warm_up import warm_up_statics

PASSING = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
KEPT = QoSProfile(
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
SAME_PLACE, SAME_TURN = 0.002, 0.002  # m and rad by which a body has not moved
AGE, CELLS = "terrain age [s]", "terrain cells"
WHERE, TERRAIN = "base pose", "terrain"


class _Terrain(NamedTuple):
    """The terrain last heard of.

    Attributes:
        header: Its frame and time.
        height_map: Its heights.
        heard: When it came [ns].
    """

    header: Any
    height_map: HeightMap
    heard: int


@dataclass
class _Input:
    """A subscription, and how to make another in its place.

    Attributes:
        subscribe: Makes one with a quality of service.
        subscription: That there is.
        kept: Whether it asks for what was published before.
    """

    subscribe: Callable[[QoSProfile], Any]
    subscription: Any
    kept: bool = False


class TerrainNode(RobotNode):
    """Publishes what every cell of a height map within reach is worth to each leg."""

    def __init__(self) -> None:
        super().__init__("terrain")
        self._declare_parameters()
        self._terrain: _Terrain | None = None
        self._ground: Survey | None = None
        self._pose: Any = None
        self._at: Mount | None = None  # where the body was when the maps were made
        self._inputs: list[_Input] = []
        self._grid_types = _grid_map_types()
        self._limits = LimitsInForce(self, "foothold maps", self._take_up_limits)
        self._clouds: dict[str, Any] = {}
        self._grids: dict[str, Any] = {}
        self.robot_changed()
        self._hear(PointCloud2, "terrain", self._take_cloud)
        if self._grid_types is not None:
            self._hear(self._grid_types.GridMap, "terrain_map", self._take_grid)
        self._hear(PoseStamped, "base_pose", self._take_pose)
        self.add_post_set_parameters_callback(self._parameters_changed)
        self.every(1.0 / self.value("rate"), self._renew)
        self.announce()

    def _declare_parameters(self) -> None:
        numbers = (
            ("rate", 10.0, "Greatest rate of foothold maps [Hz].", (0.1, 100.0), True),
            (
                "friction_coefficient",
                0.4,  # the low end of cement
                "Friction coefficient where the terrain tells none.",
                (0.0, 10.0),
                False,
            ),
            ("required_load", 0.0, "Force against gravity to bear [N].", (0.0, 1e6), False),
            (
                "resolution",
                0.0,
                "Grid spacing of point clouds [m]; 0 = that of the points.",
                (0.0, 10.0),
                False,
            ),
            ("fit_radius", 1, "Cells around a cell to which its plane is fitted.", (1, 20), False),
            ("edge_height", 0.05, "Height of a step that is an edge [m].", (0.0, 10.0), False),
            ("steepest", 0.7, "Slope beyond which there is no foothold [rad].", (0.0, 1.6), False),
            ("edge_margin", 0.03, "Distance from edges to keep [m].", (0.0, 10.0), False),
            (
                "ample_margin",
                0.1,
                "Distance from edges that takes nothing from a score [m].",
                (0.0, 10.0),
                False,
            ),
            (
                "patience",
                0.0,
                "Age of the terrain from which it is told to be old [s]; 0 = never.",
                (0.0, 1e6),
                False,
            ),
        )
        for name, default, description, limits, read_only in numbers:
            self.declare_number(name, default, description, limits, read_only=read_only)
        self.declare("elevation_layer", "elevation", "Layer of grid maps with the heights.")
        self.declare(
            "friction_layer",
            "friction",
            "Layer of grid maps, or field of clouds, with friction coefficients.",
        )
        self.declare(
            "normal_layers",
            list(NORMAL_FIELDS),
            "Layers of grid maps, or fields of clouds, with normals x, y, z; fitted if missing.",
        )

    # ------------------------------------------------------------------ what changes

    def warm_up(self, robot: Robot) -> None:
        """Call the kernels of the footholds once, too."""
        super().warm_up(robot)
        warm_up_statics(robot)

    def robot_changed(self) -> None:
        """Begin anew, with publishers for the legs that there are now."""
        self.robot = self._limits.of(self.robot)
        for publisher in (*self._clouds.values(), *self._grids.values()):
            self.destroy_publisher(publisher)
        feet = [leg.name for leg in self.robot.legs.values() if leg.mechanism.has_point_foot]
        self._clouds = {
            leg: self.create_publisher(PointCloud2, f"~/{leg}/footholds", LATCHED) for leg in feet
        }
        if self._grid_types is not None:
            self._grids = {
                leg: self.create_publisher(
                    self._grid_types.GridMap, f"~/{leg}/foothold_map", LATCHED
                )
                for leg in feet
            }
        self._at = None

    def _take_up_limits(self) -> None:
        self.robot = self._limits.of(self.robot)
        self._at = None

    def _parameters_changed(self, parameters: Sequence[Parameter]) -> None:
        self._ground = self._at = None

    def look_around(self) -> None:
        """Tell the age of the terrain, and note what is missing."""
        self._limits.look_around()
        self._follow_publishers()
        notes, figures = self.health.notes, self.health.figures
        notes.pop(TERRAIN, None)
        if self._terrain is None:
            notes[TERRAIN] = "no terrain was heard of yet"
            return
        age = 1e-9 * (self.get_clock().now().nanoseconds - _time_of(self._terrain))
        figures[AGE] = f"{age:.3f}"
        figures[CELLS] = str(self._terrain.height_map.points[..., 0].size)
        patience = self.value("patience")
        if 0.0 < patience < age:
            notes[TERRAIN] = f"the terrain is {age:.1f} s old (parameter patience: {patience:g} s)"

    # ------------------------------------------------------------------ inputs

    def _hear(self, kind: Any, topic: str, take: Callable[[Any], None]) -> None:
        """Take messages of which the last counts."""
        last = b""

        def receive(data: bytes) -> None:
            nonlocal last
            if data == last:  # what is kept comes again to a new subscription
                return
            last = data
            self.health.received += 1
            with self.health.timed():
                try:
                    take(deserialize_message(data, kind))
                except Exception as error:
                    self.failure(topic, error)

        def subscribe(qos: QoSProfile) -> Any:
            return self.create_subscription(kind, topic, receive, qos, raw=True)

        self._inputs.append(_Input(subscribe, subscribe(PASSING)))

    def _follow_publishers(self) -> None:
        """Subscribe as publishers offer: a map that is published once is kept for who comes later.

        A subscription that asks for what was kept hears nothing of those who keep nothing.
        """
        for heard in self._inputs:
            topic = heard.subscription.topic_name
            told = [
                info.qos_profile.durability for info in self.get_publishers_info_by_topic(topic)
            ]
            kept = bool(told) and all(one == KEPT.durability for one in told)
            if kept != heard.kept:
                self.destroy_subscription(heard.subscription)
                heard.subscription, heard.kept = heard.subscribe(KEPT if kept else PASSING), kept

    def _layers(self) -> Layers:
        normals = tuple(self.value("normal_layers"))
        if len(normals) != 3:
            raise RequestError(
                f"parameter normal_layers: got {len(normals)} names; allowed: 3, of x, y, z"
            )
        return Layers(self.value("elevation_layer"), normals, self.value("friction_layer"))

    def _take_cloud(self, cloud: Any) -> None:
        heights = cloud_heights(cloud, self._layers(), self.value("resolution"), self.max_points)
        self._take(cloud.header, heights)

    def _take_grid(self, grid: Any) -> None:
        self._take(grid.header, grid_heights(grid, self._layers(), self.max_points))

    def _take(self, header: Any, heights: HeightMap) -> None:
        now = self.get_clock().now().nanoseconds
        self._terrain, self._ground = _Terrain(header, heights, now), None
        self._at = None

    def _take_pose(self, message: Any) -> None:
        pose = message.pose
        read_mount("base_pose.pose", pose.position, pose.orientation)  # refused, not kept
        self._pose = message

    def _base(self, frame_id: str) -> Mount:
        """Return where the body is in the frame of the terrain.

        Raises:
            RequestError: If it is not known.
        """
        if frame_id in ("", self.robot.base_frame):
            return BASE
        if self._pose is not None and self._pose.header.frame_id == frame_id:
            pose = self._pose.pose
            return read_mount("base_pose.pose", pose.position, pose.orientation)
        try:
            return self.base_pose(frame_id, PoseStamped().header.stamp)
        except RequestError as error:
            told = "none" if self._pose is None else repr(self._pose.header.frame_id)
            raise RequestError(
                f"no pose of {self.robot.base_frame!r} in the terrain's frame {frame_id!r}: "
                f"base_pose is heard in {told}; {error}"
            ) from None

    # ------------------------------------------------------------------ outputs

    def _renew(self) -> None:
        """Make the maps anew if terrain, body, limits or parameters have changed."""
        if self._terrain is None:
            return
        with self.health.timed():
            try:
                base = self._base(self._terrain.header.frame_id)
                self.health.notes.pop(WHERE, None)
            except RequestError as error:
                self.health.notes[WHERE] = str(error)
                return
            if self._at is not None and not _has_moved(self._at, base):
                return
            self._at = base  # what fails would fail again
            try:
                self._publish(self._terrain, base)
            except Exception as error:
                self.failure(TERRAIN, error)

    def _publish(self, terrain: _Terrain, base: Mount) -> None:
        if self._ground is None:
            surface = Surface(*(self.value(name) for name in Surface._fields))
            self._ground = survey(terrain.height_map, surface)
        contact = Contact(self.value("friction_coefficient"), load=self.value("required_load"))
        for name, publisher in self._clouds.items():
            found = foothold_map(self.robot.legs[name], self._ground, contact, base)
            publisher.publish(foothold_cloud(terrain.header, self._ground, found))
            if name in self._grids:
                resolution = terrain.height_map.resolution
                grid = foothold_grid(
                    self._grid_types, terrain.header, resolution, self._ground, found
                )
                self._grids[name].publish(grid)


def _grid_map_types() -> Any:
    """Return the module of grid maps' messages; None if it is not installed."""
    try:
        return importlib.import_module("grid_map_msgs.msg")
    except ImportError:
        return None


def _time_of(terrain: _Terrain) -> int:
    """Return the time of a terrain, or else when it came [ns]."""
    stamp = terrain.header.stamp
    return int(stamp.sec) * 10**9 + int(stamp.nanosec) or terrain.heard


def _has_moved(before: Mount, now: Mount) -> bool:
    """Tell whether a body is elsewhere, or turned."""
    far = float(np.linalg.norm(now.position - before.position)) > SAME_PLACE
    cosine = 0.5 * (float(np.trace(before.rotation.T @ now.rotation)) - 1.0)
    return far or math.acos(min(1.0, max(-1.0, cosine))) > SAME_TURN


def main() -> int:
    """Run the node."""
    return run(TerrainNode)
