# SPDX-License-Identifier: Apache-2.0
"""Choose the next foothold of a leg, then height and lean of the body, by what the stance carries.

It asks in-process, without nodes:

    ./leg python examples/05_choose_stance.py
"""

import numpy as np
from scipy.spatial.transform import Rotation

from leg_kinematics import load_robot
from leg_statics import (
    BodyPose,
    Load,
    StanceVerdict,
    evaluate_stances,
    robot_stance,
    support_region,
)

MASS, FRICTION = 120.0, 0.4  # kg; cement
NEXT, STANDING = "right_middle", ("left_front", "left_rear")
HIP_HEIGHT = 0.65  # m

robot = load_robot("hexapod")
feet = {name: robot.leg(name).mount.to_base((0.05, 0.0, -HIP_HEIGHT)) for name in STANDING}

# One foot's candidates, the others where they are: each is judged as the stance after touchdown.
box = np.random.default_rng(2).uniform([-0.2, -0.2, -0.7], [0.2, 0.2, -0.6], (1000, 3))
candidates = robot.leg(NEXT).mount.to_base(box)
found = evaluate_stances(robot_stance(robot, {**feet, NEXT: candidates}, FRICTION), Load(MASS))
print(f"{found.stands.sum()} of {len(candidates)} footholds of {NEXT} let {MASS:g} kg stand")
for verdict, count in zip(*np.unique(found.verdict, return_counts=True), strict=True):
    print(f"  {StanceVerdict(verdict).name.lower().replace('_', ' '):14} {count:5d}")
feet[NEXT] = candidates[found.best]
print(f"the best carries {found.load_factor[found.best]:.2f} times as much")

# Candidates of the body's pose over these feet; the centre of mass is the body's origin.
heights, leans = np.meshgrid(np.linspace(-0.05, 0.05, 11), np.radians(np.linspace(-6, 6, 7)))
position = np.stack([0.0 * heights, 0.0 * heights, heights], axis=-1)
turned = Rotation.from_euler("y", leans.ravel()).as_matrix().reshape(*leans.shape, 3, 3)
poses = BodyPose(position, turned)
found = evaluate_stances(robot_stance(robot, feet, FRICTION, poses), Load(MASS, position))
height, lean = heights.flat[found.best], np.degrees(leans.flat[found.best])
factor = found.load_factor.flat[found.best]
print(f"body {100.0 * height:+.0f} cm, pitch {lean:+.0f}°: {factor:.2f} times")

best = BodyPose(position.reshape(-1, 3)[found.best], turned.reshape(-1, 3, 3)[found.best])
region = support_region(robot_stance(robot, feet, FRICTION, best), Load(MASS, best.position))
print(f"its centre of mass is {region.margin:.3f} m inside what the feet support")
