# SPDX-License-Identifier: Apache-2.0
"""Requests that the nodes must refuse: one line each."""

# ruff: noqa: E501

import math

from nodes_support import MAX_POINTS

P = [-0.1, 0.0, -0.65]
J = "left_front_crank_1"

# service, fields, error code, words that the message must have
BAD = {
    "fk unknown leg": ("forward_kinematics", {"leg": "tail"}, "UNKNOWN_LEG", ["tail", "left_front"]),
    "fk no leg": ("forward_kinematics", {"leg": ""}, "UNKNOWN_LEG", ["''", "right_rear"]),
    "fk leg of odd characters": ("forward_kinematics", {"leg": "ß\n%s{}"}, "UNKNOWN_LEG", ["allowed"]),
    "fk two joints": ("forward_kinematics", {"joint_positions": [0.1] * 2}, "INVALID_INPUT", ["joint_positions", "3", "got 2"]),
    "fk four joints": ("forward_kinematics", {"joint_positions": [0.1] * 4}, "INVALID_INPUT", ["joint_positions", "got 4"]),
    "fk mode": ("forward_kinematics", {"joint_positions": [0.0] * 3, "assembly_mode": "inside_out"}, "INVALID_INPUT", ["assembly mode", "inside_out", "initial"]),
    "fk all modes": ("forward_kinematics", {"joint_positions": [0.0] * 3, "assembly_mode": "ALL"}, "INVALID_INPUT", ["assembly mode", "ALL"]),
    "fk frame": ("forward_kinematics", {"joint_positions": [0.0] * 3, "frame": "map"}, "INVALID_INPUT", ["header.frame_id", "map", "left_front_leg", "base_link", "base_pose"]),
    "fk too large": ("forward_kinematics", {"joint_positions": [0.0] * 3 * (MAX_POINTS + 1)}, "TOO_LARGE", ["joint_positions", str(MAX_POINTS + 1), str(MAX_POINTS)]),
    "ik unknown leg": ("inverse_kinematics", {"leg": "LEFT_FRONT", "positions": P}, "UNKNOWN_LEG", ["LEFT_FRONT"]),
    "ik one coordinate": ("inverse_kinematics", {"positions": [0.5]}, "INVALID_INPUT", ["positions", "x, y, z", "got 1"]),
    "ik half a point": ("inverse_kinematics", {"positions": P + P[:2]}, "INVALID_INPUT", ["positions", "got 5"]),
    "ik mode": ("inverse_kinematics", {"positions": P, "assembly_mode": "all"}, "INVALID_INPUT", ["assembly mode", "'all'"]),
    "ik frame of another leg": ("inverse_kinematics", {"positions": P, "frame": "right_rear_leg"}, "INVALID_INPUT", ["header.frame_id", "right_rear_leg"]),
    "ik too large": ("inverse_kinematics", {"positions": P * (MAX_POINTS + 1)}, "TOO_LARGE", ["positions", "max_points"]),
    "ik too large by modes": ("inverse_kinematics", {"positions": P * 100, "assembly_mode": "ALL"}, "TOO_LARGE", ["1600", str(MAX_POINTS)]),
    "jacobian both": ("get_jacobian", {"positions": P, "joint_positions": [0.0] * 3}, "INVALID_INPUT", ["joint_positions", "positions", "one of them"]),
    "jacobian half a point": ("get_jacobian", {"positions": P[:2]}, "INVALID_INPUT", ["positions", "got 2"]),
    "jacobian joints": ("get_jacobian", {"joint_positions": [0.0] * 7}, "INVALID_INPUT", ["joint_positions", "got 7"]),
    "jacobian frame": ("get_jacobian", {"positions": P, "frame": "odom"}, "INVALID_INPUT", ["odom"]),
    "jacobian too large": ("get_jacobian", {"joint_positions": [0.0] * 3 * (MAX_POINTS + 1)}, "TOO_LARGE", ["joint_positions"]),
    "indices leg": ("evaluate_indices", {"leg": "a", "positions": P}, "UNKNOWN_LEG", ["'a'"]),
    "indices name": ("evaluate_indices", {"positions": P, "names": ["condition_number", "beauty"]}, "INVALID_INPUT", ["index", "beauty", "condition_number"]),
    "indices empty name": ("evaluate_indices", {"positions": P, "names": [""]}, "INVALID_INPUT", ["index", "''"]),
    "indices points": ("evaluate_indices", {"positions": P * 2 + [1.0]}, "INVALID_INPUT", ["positions", "got 7"]),
    "indices too large": ("evaluate_indices", {"positions": P * (MAX_POINTS + 1)}, "TOO_LARGE", ["positions"]),
    "efforts leg": ("compute_efforts", {"leg": "nose", "positions": P, "forces": P}, "UNKNOWN_LEG", ["nose"]),
    "efforts no force": ("compute_efforts", {"positions": P}, "INVALID_INPUT", ["forces", "got 0"]),
    "efforts force of two": ("compute_efforts", {"positions": P, "forces": [0.0, 1.0]}, "INVALID_INPUT", ["forces", "got 2", "3"]),
    "efforts two forces for three points": ("compute_efforts", {"positions": P * 3, "forces": P * 2}, "INVALID_INPUT", ["forces", "got 6", "9"]),
    "efforts moment": ("compute_efforts", {"positions": P, "forces": P, "moments": [1.0]}, "INVALID_INPUT", ["moments", "got 1"]),
    "efforts frame": ("compute_efforts", {"positions": P, "forces": P, "frame": "world"}, "INVALID_INPUT", ["world"]),
    "efforts mode": ("compute_efforts", {"positions": P, "forces": P, "assembly_mode": "x"}, "INVALID_INPUT", ["assembly mode"]),
    "efforts too large": ("compute_efforts", {"positions": P * (MAX_POINTS + 1), "forces": P}, "TOO_LARGE", ["positions"]),
    "description leg": ("get_leg_description", {"leg": "spider"}, "UNKNOWN_LEG", ["spider", "left_front"]),
    "limits leg": ("set_effort_limits", {"leg": "x", "joint_names": [J], "upper": [1.0]}, "UNKNOWN_LEG", ["'x'"]),
    "limits joint": ("set_effort_limits", {"joint_names": ["crank_1"], "upper": [1.0]}, "INVALID_INPUT", ["joint", "crank_1", J]),
    "limits joint of another leg": ("set_effort_limits", {"joint_names": ["right_rear_crank_1"], "upper": [1.0]}, "INVALID_INPUT", ["right_rear_crank_1"]),
    "limits twice": ("set_effort_limits", {"joint_names": [J, J], "upper": [1.0, 2.0]}, "INVALID_INPUT", ["joint_names", J, "twice"]),
    "limits too few": ("set_effort_limits", {"joint_names": [J], "upper": []}, "INVALID_INPUT", ["upper", "got 0", "1"]),
    "limits too many": ("set_effort_limits", {"joint_names": [J], "upper": [1.0, 2.0]}, "INVALID_INPUT", ["upper", "got 2"]),
    "limits lower too few": ("set_effort_limits", {"joint_names": [J, "left_front_crank_2"], "upper": [1.0, 2.0], "lower": [-1.0]}, "INVALID_INPUT", ["lower", "got 1"]),
    "limits negative": ("set_effort_limits", {"joint_names": [J], "upper": [-1.0]}, "INVALID_INPUT", ["upper", J, "-1.0", ">= 0"]),
    "limits positive lower": ("set_effort_limits", {"joint_names": [J], "upper": [1.0], "lower": [0.5]}, "INVALID_INPUT", ["lower", J, "0.5", "<= 0"]),
    "limits nan": ("set_effort_limits", {"joint_names": [J], "upper": [math.nan]}, "INVALID_INPUT", ["upper", "nan", "finite"]),
    "stance unknown leg": ("query_stance", {"legs": ["tail"]}, "UNKNOWN_LEG", ["tail", "left_front"]),
    "stance leg twice": ("query_stance", {"legs": ["left_front"] * 2}, "INVALID_INPUT", ["legs", "twice"]),
    "stance feet of one leg": ("query_stance", {"feet": P, "ground": "cement"}, "INVALID_INPUT", ["feet", "got 3", "18"]),
    "stance no ground": ("query_stance", {"legs": ["left_front"], "feet": P}, "INVALID_INPUT", ["ground", "friction_coefficients"]),
    "stance unknown ground": ("query_stance", {"legs": ["left_front"], "feet": P, "ground": "lava"}, "UNKNOWN_GROUND", ["lava", "cement"]),
    "stance negative friction": ("query_stance", {"legs": ["left_front"], "feet": P, "friction_coefficients": [-1.0]}, "INVALID_INPUT", ["friction_coefficients", "-1.0"]),
    "stance zero normal": ("query_stance", {"legs": ["left_front"], "feet": P, "ground": "cement", "normals": [0.0] * 3}, "INVALID_INPUT", ["normals", "zero"]),
    "stance negative mass": ("query_stance", {"legs": ["left_front"], "feet": P, "ground": "cement", "mass": -1.0}, "INVALID_INPUT", ["mass", "-1.0"]),
    "stance NaN gravity": ("query_stance", {"legs": ["left_front"], "feet": P, "ground": "cement", "gravity": [0.0, 0.0, math.nan]}, "INVALID_INPUT", ["gravity", "finite"]),
    "stance two directions": ("query_stance", {"legs": ["left_front"], "feet": P, "ground": "cement", "region_directions": 2}, "INVALID_INPUT", ["region_directions", "got 2"]),
    "stance vertical direction": ("query_stance", {"legs": ["left_front"], "feet": P, "ground": "cement", "margin_direction": [0.0, 0.0, 1.0]}, "INVALID_INPUT", ["direction", "along gravity"]),
    "stance rows that differ": ("query_stance", {"legs": ["left_front"], "feet": P * 3, "ground": "cement", "center_of_mass": [0.0] * 6}, "INVALID_INPUT", ["feet 3", "center_of_mass 2"]),
    "stance in a map without pose": ("query_stance", {"legs": ["left_front"], "feet": P, "ground": "cement", "frame": "map"}, "INVALID_INPUT", ["header.frame_id", "map", "base_link"]),
    "stance too many": ("query_stance", {"legs": ["left_front"], "feet": P * (MAX_POINTS // 100 + 1), "ground": "cement", "region_directions": 100}, "TOO_LARGE", ["max_points"]),
    "limits infinite": ("set_effort_limits", {"joint_names": [J], "upper": [math.inf]}, "INVALID_INPUT", ["upper", "inf", "finite"]),
    "limits infinite lower": ("set_effort_limits", {"joint_names": [J], "upper": [1.0], "lower": [-math.inf]}, "INVALID_INPUT", ["lower", "-inf"]),
}  # fmt: skip
