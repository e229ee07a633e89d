# SPDX-License-Identifier: Apache-2.0
"""What the statics and maps nodes answer, by families of questions as in `leg_msgs_py.client`."""

from leg_statics.nodes.services import (
    description,
    efforts,
    footholds,
    indices,
    limits,
    maps,
    stances,
    steps,
)

# Services of the nodes, by the node's name.
SERVICES = {
    "statics": (
        efforts.compute_efforts,
        indices.evaluate_indices,
        description.get_leg_description,
        footholds.query_footholds,
        stances.query_stance,
        steps.query_step_length,
        limits.set_effort_limits,
    ),
    "maps": (maps.get_index_map,),
}
