# SPDX-License-Identifier: Apache-2.0
"""Choose the next foothold of a leg, then height and lean of the body, by what the stance carries.

It asks in-process, without nodes; with a folder it draws the stance, and margins over a gait:

    ./leg python examples/05_choose_stance.py --output stance_pictures
"""

import argparse
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from leg_kinematics import load_robot
from leg_statics import (
    BodyPose,
    Load,
    StanceVerdict,
    choose_stance,
    evaluate_stances,
    robot_stance,
    support_region,
)

MASS, FRICTION = 120.0, 0.4  # kg; cement
NEXT, STANDING = "right_middle", ("left_front", "left_rear")
HIP_HEIGHT = 0.65  # m
STRIDE = np.linspace(-0.15, 0.15, 61)  # of the body over the feet [m]

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--output", type=Path, help="folder of the pictures")
output = parser.parse_args().output

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
position = np.stack([0.0 * heights, 0.0 * heights, heights], axis=-1).reshape(-1, 3)
turned = Rotation.from_euler("y", leans.ravel()).as_matrix()
poses = BodyPose(position, turned)
choice = choose_stance(robot_stance(robot, feet, FRICTION, poses), Load(MASS, position))
best, region = choice.best, choice.region
print(
    f"body {100.0 * heights.flat[best]:+.0f} cm, pitch {np.degrees(leans.flat[best]):+.0f}°: "
    f"its centre of mass is {region.margin[best]:.3f} m inside what the feet support"
)

if output:
    from leg_statics.drawing.stances import plot_margins, plot_support_region

    output.mkdir(parents=True, exist_ok=True)
    pose = BodyPose(position[best], turned[best])
    load = Load(MASS, position[best])
    stance = robot_stance(robot, feet, FRICTION, pose)
    held = evaluate_stances(stance, load)
    title = f"hexapod on three feet, {MASS:g} kg, friction {FRICTION}: the best forces"
    figure = plot_support_region(
        support_region(stance, load, 36),
        stance.position,
        load.center_of_mass,
        names=list(feet),
        force=held.force,
        title=title,
    )
    figure.savefig(output / "support_region.png", dpi=200)
    body = STRIDE[:, None] * [1.0, 0.0, 0.0]
    strides = robot_stance(robot, feet, FRICTION, BodyPose(body))
    margins = {
        f"{each:g} kg": support_region(strides, Load(each, body), 36).margin
        for each in (MASS, 150.0, 180.0)
    }
    figure = plot_margins(
        STRIDE,
        margins,
        time_label="body over the feet, forward [m]",
        label="margin of the centre of mass [m]",
        title=f"hexapod while one tripod carries it, friction {FRICTION}",
    )
    figure.savefig(output / "stance_margins.png", dpi=200)
    print(f"wrote {output}/support_region.png and {output}/stance_margins.png")
