# SPDX-License-Identifier: Apache-2.0
"""Go over rubble, stairs, a slope and a gap on the best footholds of a height map, with pictures.

It asks in-process, without nodes, what the node `terrain` publishes:

    ./leg python examples/06_footholds_on_terrain.py --output pictures
"""

import argparse
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from leg_kinematics import load_robot
from leg_kinematics.robot import Mount
from leg_statics import Contact
from leg_statics.drawing.style import write_figure
from leg_statics.drawing.terrain import plot_terrain
from leg_statics.terrain import HeightMap, Surface, foothold_map, survey

SPACING, LOAD, HIP_HEIGHT = 0.03, 300.0, 0.62  # m, N, m
STEPS = {"rubble": 0.2, "stairs": 1.45, "slope": 2.6, "gap": 3.35}  # x of the body [m]
LEGS = ("left_front", "right_front")

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--output", type=Path, default=Path(), help="folder for the pictures")
folder = parser.parse_args().output
folder.mkdir(parents=True, exist_ok=True)

# The ground as a mapping stack would tell it: what lies in the gap, or is not seen, is NaN.
random = np.random.default_rng(6)
x, y = np.meshgrid(np.arange(-0.9, 4.6, SPACING), np.arange(-1.0, 1.0, SPACING))
height = np.zeros_like(x)
for _ in range(90):
    a, b = random.uniform([-0.9, -1.0], [0.85, 1.0])
    size, wide = random.uniform([0.01, 0.04], [0.06, 0.1])
    height += size * np.exp(-((x - a) ** 2 + (y - b) ** 2) / wide**2)
height += 0.08 * np.clip(np.floor((x - 1.0) / 0.35) + 1.0, 0.0, 3.0)
height -= 0.24 * np.clip((x - 2.3) / 1.0, 0.0, 1.0)
height[(x > 3.75) & (x < 3.95)] = np.nan
height[random.random(height.shape) < 0.01] = np.nan
heights = HeightMap(np.stack([x, y, height], axis=-1), SPACING)
ground = survey(heights, Surface(edge_height=0.04, edge_margin=0.03))

robot = load_robot("hexapod")
for name, ahead in STEPS.items():
    near = ground.known & (np.abs(ground.points[..., 0] - ahead) < 0.6)
    here = ground.points[near]
    # The body keeps its height over the ground and leans as the ground does in the large.
    slope, level = np.polyfit(here[:, 0] - ahead, here[:, 2], 1)
    turn = Rotation.from_euler("y", -np.arctan(slope)).as_matrix()
    body = Mount(np.array([ahead, 0.0, level + HIP_HEIGHT]), turn)
    contact = Contact(0.5, load=LOAD)
    maps = {leg: foothold_map(robot.leg(leg), ground, contact, body) for leg in LEGS}
    feet = {}
    print(f"{name}, body at x = {ahead:.2f} m, pitch {np.degrees(np.arctan(-slope)):+.0f}°")
    for leg, found in maps.items():
        best = np.unravel_index(np.nanargmax(found.score), found.score.shape)
        feet[leg] = ground.points[best]
        good = int(np.sum(found.score > 0.0))
        print(
            f"  {leg:12} {good:4d} footholds; the best at ({feet[leg][0]:.2f}, {feet[leg][1]:.2f}, "
            f"{feet[leg][2]:.2f}) m carries {found.load_capacity[best]:.0f} N, score "
            f"{found.score[best]:.2f}"
        )
    picture = plot_terrain(ground, maps, feet=feet, title=f"footholds on the {name}")
    print(f"  {write_figure(picture, folder / f'terrain_{name}.png')}")
