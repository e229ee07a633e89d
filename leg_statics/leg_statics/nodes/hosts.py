# SPDX-License-Identifier: Apache-2.0
"""What services ask of the node that answers them, or of whoever answers as it does."""

from __future__ import annotations

from typing import Any, Protocol

from leg_kinematics.nodes.service import Host
from leg_kinematics.robot import Leg, Robot
from leg_statics.grounds import Grounds
from leg_statics.map_jobs import MapKey
from leg_statics.maps import IndexMap


class GroundsHost(Host, Protocol):
    """A host that knows grounds."""

    @property
    def grounds(self) -> Grounds:
        """Grounds that requests may name."""


class StepsHost(GroundsHost, Protocol):
    """A host that finds step lengths."""

    @property
    def max_steps(self) -> int:
        """Steps (legs times heights) accepted in one request."""


class MapsHost(GroundsHost, Protocol):
    """A host that draws maps."""

    def plane(self, leg: Leg, key: MapKey) -> IndexMap:
        """Return the map of a plane."""


class LimitsHost(Host, Protocol):
    """A node whose effort limits can be changed."""

    @property
    def limits(self) -> Any:
        """The `leg_msgs/EffortLimits` in force, as they were published."""

    def put_in_force(self, robot: Robot) -> None:
        """Take up the robot with other effort limits."""
