# SPDX-License-Identifier: Apache-2.0
"""Ask one question: can this leg stand there, and how much does it carry?

Start the nodes with `make run`; then, in another terminal:

    ./leg python examples/01_ask_one_foothold.py
"""

import sys

from leg_msgs_py.client import LegClient
from leg_msgs_py.errors import ServerUnavailableError

LEG = "right_front"
FOOTHOLD = [0.10, -0.05, -0.65]  # x forward, y left, z up from the hip [m]
LOAD = 500.0  # N

with LegClient(timeout=10.0) as client:
    try:
        answer = client.query_footholds(LEG, FOOTHOLD, ground="cement", load=LOAD, efforts=True)
    except ServerUnavailableError as error:
        sys.exit(f"{error}\nStart the nodes first: make run")

joint = answer.joint_names[int(answer.limiting_joint)]
print(f"{LEG} at {FOOTHOLD} m on cement (mu = {answer.friction_coefficient:g}):")
print(f"  carries {LOAD:g} N:   {'yes' if answer.feasible else 'no'}")
print(f"  at most:         {answer.load_capacity:.0f} N")
print(f"  rated friction:  {answer.rated_friction:.2f}, margin {answer.friction_margin:.2f}")
print(f"  in full:         {answer.rated_friction_full:.2f} with the lateral component")
print(f"  hardest joint:   {joint}, {100 * answer.utilisation:.0f} % of its limit")
for name, effort in zip(answer.joint_names, answer.joint_efforts, strict=True):
    print(f"  {name}: {effort:.1f} N.m")
