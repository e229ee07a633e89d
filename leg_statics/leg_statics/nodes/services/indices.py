# SPDX-License-Identifier: Apache-2.0
"""Performance indices at foot positions."""

from __future__ import annotations

from typing import Any

import numpy as np
from leg_msgs.srv import EvaluateIndices
from leg_msgs_py.arrays import to_field

from leg_kinematics.nodes.frames import find_frame, read_posture
from leg_kinematics.nodes.service import Host, service
from leg_statics.indices import INDICES
from leg_statics.indices import evaluate_indices as indices_at


@service(EvaluateIndices)
def evaluate_indices(host: Host, request: Any, response: Any) -> None:
    """Fill indices at foot positions."""
    leg = host.robot.leg(request.leg)
    frame = find_frame(host, leg, request)
    posture = read_posture(leg, request, frame, host.max_points)
    names, values = indices_at(leg.mechanism, posture, request.names)
    response.names = list(names)
    response.symbols = [INDICES[name].symbol for name in names]
    response.units = [INDICES[name].unit for name in names]
    response.values = to_field(values)
    response.status = to_field(posture.status, np.uint8)
