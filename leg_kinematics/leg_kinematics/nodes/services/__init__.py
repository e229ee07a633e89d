# SPDX-License-Identifier: Apache-2.0
"""What the kinematics node answers, by families of questions as in `leg_msgs_py.client`."""

from leg_kinematics.nodes.services import kinematics

# Services of the nodes, by the node's name.
SERVICES = {
    "kinematics": (
        kinematics.forward_kinematics,
        kinematics.inverse_kinematics,
        kinematics.get_jacobian,
    ),
}
