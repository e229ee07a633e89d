# SPDX-License-Identifier: Apache-2.0
"""Prints the seconds until imports were done and until the first foothold was, as JSON."""

import time

START = time.perf_counter()

import json  # noqa: E402

import leg_statics.footholds  # noqa: E402
import leg_statics.maps  # noqa: E402
from leg_kinematics import load_robot  # noqa: E402

IMPORTED = time.perf_counter()

leg = load_robot("hexapod").legs["right_front"]
mechanism = leg.mechanism
foot = mechanism.initial_posture.foot_position
contact = leg_statics.footholds.Contact(friction=0.4, load=300.0)
leg_statics.footholds.evaluate_footholds(leg, foot, contact)
leg_statics.indices.evaluate_indices(mechanism, mechanism.inverse(foot))

ANSWERED = time.perf_counter()
print(json.dumps({"import": IMPORTED - START, "answer": ANSWERED - START}))
