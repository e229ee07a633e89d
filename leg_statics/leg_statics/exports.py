# SPDX-License-Identifier: Apache-2.0
"""What `leg_statics` offers to those who use it in their own process."""

from leg_statics.capacity.problem import CapacityStatus, LoadCapacity, load_capacity
from leg_statics.contact import Contact
from leg_statics.efforts import joint_efforts, utilisation
from leg_statics.footholds import Footholds, Verdict, evaluate_around, evaluate_footholds
from leg_statics.grounds import Ground, Grounds, load_grounds
from leg_statics.indices import INDICES, evaluate_indices, supported_indices
from leg_statics.joint_stream import JointStream
from leg_statics.leg_state import LegStates
from leg_statics.maps import IndexMap, line_map, plane_map, supported_layers, volume_map
from leg_statics.stance.choice import StanceChoice, choose_stance
from leg_statics.stance.region import SupportRegion, margin_along, support_region
from leg_statics.stance.stances import (
    BestForces,
    Load,
    Multiples,
    Stance,
    Stances,
    StanceVerdict,
    best_forces,
    evaluate_stances,
    load_factor,
    payload,
)
from leg_statics.stance.standing import BodyPose, measured_stance, robot_load, robot_stance
from leg_statics.step_length import (
    CommonStep,
    Criterion,
    GroundProfile,
    StepLength,
    common_step,
    longest_step,
)
from leg_statics.workspace import workspace_bounds

__all__ = [
    "INDICES",
    "BestForces",
    "BodyPose",
    "CapacityStatus",
    "CommonStep",
    "Contact",
    "Criterion",
    "Footholds",
    "Ground",
    "GroundProfile",
    "Grounds",
    "IndexMap",
    "JointStream",
    "LegStates",
    "Load",
    "LoadCapacity",
    "Multiples",
    "Stance",
    "StanceChoice",
    "StanceVerdict",
    "Stances",
    "StepLength",
    "SupportRegion",
    "Verdict",
    "best_forces",
    "choose_stance",
    "common_step",
    "evaluate_around",
    "evaluate_footholds",
    "evaluate_indices",
    "evaluate_stances",
    "joint_efforts",
    "line_map",
    "load_capacity",
    "load_factor",
    "load_grounds",
    "longest_step",
    "margin_along",
    "measured_stance",
    "payload",
    "plane_map",
    "robot_load",
    "robot_stance",
    "support_region",
    "supported_indices",
    "supported_layers",
    "utilisation",
    "volume_map",
    "workspace_bounds",
]
