# SPDX-License-Identifier: Apache-2.0
"""Entry points of the nodes about statics: light, see `leg_kinematics.nodes.entry_points`."""

from functools import partial

from leg_kinematics.nodes.entry_points import start

designs_node = partial(start, "leg_statics.nodes.designs_node")
gait_node = partial(start, "leg_statics.nodes.gait_node")
maps_node = partial(start, "leg_statics.nodes.maps_node")
statics_node = partial(start, "leg_statics.nodes.statics_node")
terrain_node = partial(start, "leg_statics.nodes.terrain_node")
viewer_node = partial(start, "leg_statics.nodes.viewer_node")
