# SPDX-License-Identifier: Apache-2.0
"""Whatever is given for an argument, the public functions answer or raise this suite's errors."""

import math

import numpy as np
import pytest

from leg_kinematics import (
    MECHANISMS,
    KindError,
    Leg,
    LegError,
    Mirrored,
    ParallelDrive,
    ShapeError,
    UnknownNameError,
    ValueRangeError,
    load_robot,
)
from leg_kinematics.arguments import as_count, as_names, as_number
from leg_kinematics.geometry import geometry_parameters
from leg_statics import (
    Contact,
    Criterion,
    JointStream,
    common_step,
    evaluate_footholds,
    evaluate_indices,
    joint_efforts,
    line_map,
    load_capacity,
    load_grounds,
    longest_step,
    plane_map,
    supported_indices,
    supported_layers,
    utilisation,
    volume_map,
    workspace_bounds,
)

ROBOT = load_robot("hexapod")
LEG = ROBOT.leg("left_front")
DRIVE = LEG.mechanism
FOOT = (0.0, 0.0, -0.65)
POSTURE = DRIVE.inverse(FOOT)
JACOBIAN, ANGULAR = DRIVE.jacobian(POSTURE), DRIVE.angular_jacobian(POSTURE)
CONTACT = Contact(0.4)
JOINTS = [name for leg in ROBOT.legs.values() for name in leg.joint_names]
ZEROS = [0.0] * len(JOINTS)
STREAM = JointStream(ROBOT, 0.4)
LOWER, UPPER = LEG.effort_limits.T
MAP = plane_map(LEG, -0.65, 0.2, layers=["condition_number"])
LAYERS = {"layers": ["load_capacity"], "contact": CONTACT}
STEP = {
    "contact": CONTACT, "lateral_offset": 0.0, "direction": (1.0, 0.0, 0.0),
    "criterion": Criterion.CAPACITY,
}  # fmt: skip


def contact_of(**fields):
    """Evaluate a foothold with a contact of these fields."""
    return evaluate_footholds(LEG, FOOT, Contact(**{"friction": 0.4, **fields}))


def whole_map(**arguments):
    """Compute a map of the whole workspace."""
    return list(volume_map(**arguments))


# A function, and arguments that it answers; each of them is exchanged for what it is not.
CALLS = {
    "load_robot": (load_robot, {"source": "hexapod"}),
    "load_grounds": (load_grounds, {"source": "grounds"}),
    "ground": (load_grounds().find, {"name": "cement"}),
    "leg": (ROBOT.leg, {"name": "left_front"}),
    "frame prefix": (ROBOT.with_frame_prefix, {"prefix": "robot_1/"}),
    "leg by itself": (Leg.of, {"mechanism": DRIVE, "effort_limits": (-1.0, 1.0)}),
    "to_base": (LEG.mount.to_base, {"points": FOOT}),
    "to_leg": (LEG.mount.to_leg, {"points": FOOT}),
    "mirrored": (Mirrored, {"original": ParallelDrive()}),
    "inverse": (DRIVE.inverse, {"foot_position": FOOT, "assembly_mode": ""}),
    "supported_indices": (supported_indices, {"mechanism": DRIVE}),
    "supported_layers": (supported_layers, {"mechanism": DRIVE}),
    "evaluate_indices": (evaluate_indices, {
        "mechanism": DRIVE, "posture": POSTURE, "names": ["condition_number"],
    }),
    "evaluate_footholds": (evaluate_footholds, {
        "leg": LEG, "foot_position": FOOT, "contact": CONTACT,
    }),
    "contact": (contact_of, {
        "friction": 0.4, "normal": (0.0, 0.0, 1.0), "load": 9.0, "moment": (0.0, 0.0, 0.0),
        "any_direction_moment": 1.0, "bias_efforts": 0.0,
    }),
    "load_capacity": (load_capacity, {
        "jacobian": JACOBIAN, "effort_lower": LOWER, "effort_upper": UPPER, "friction": 0.4,
        "normal": (0.0, 0.0, 1.0), "bias_efforts": 0.0,
    }),
    "joint_efforts": (joint_efforts, {
        "jacobian": JACOBIAN, "angular_jacobian": ANGULAR, "force": FOOT, "moment": FOOT,
    }),
    "utilisation": (utilisation, {"efforts": [1.0] * 3, "effort_limits": LEG.effort_limits}),
    "line_map": (line_map, {"leg": LEG, "y": 0.0, "height": -0.65, "resolution": 0.2, **LAYERS}),
    "plane_map": (plane_map, {"leg": LEG, "height": -0.65, "resolution": 0.2, **LAYERS}),
    "volume_map": (whole_map, {"leg": LEG, "resolution": 0.4, "threads": 1, **LAYERS}),
    "layer of a map": (MAP.layer, {"name": "condition_number"}),
    "longest_step": (longest_step, {"leg": LEG, "height": -0.65, **STEP}),
    "common_step": (common_step, {"legs": {"left_front": LEG}, "body_height": 0.65, **STEP}),
    "workspace_bounds": (workspace_bounds, {"mechanism": DRIVE, "points_per_joint": 5}),
    "stream": (JointStream, {"robot": ROBOT, "friction": 0.4}),
    "states of a stream": (STREAM.read, {
        "names": JOINTS, "position": ZEROS, "velocity": ZEROS, "effort": ZEROS,
    }),
}  # fmt: skip
for kind in MECHANISMS.values():
    mechanism = kind()
    ranges = ("joint_ranges", "passive_joint_ranges")
    dimensions = (geometry_parameters(kind)[0].name, *ranges)
    CALLS[f"{mechanism.name} of"] = (kind, {name: getattr(mechanism, name) for name in dimensions})
    CALLS[f"{mechanism.name}.forward"] = (
        mechanism.forward,
        {"joint_positions": np.zeros(len(mechanism.joints)), "assembly_mode": ""},
    )

HOSTILE = {
    "an int that no float holds": 10**400,
    "ints that no float holds": [10**400] * 3,
    "an int beyond 64 bits": 2**70,
    "a large int": np.int64(2**62),
    "a negative int": -5,
    "a negative number": -0.5,
    "zero": 0,
    "a large number": 1e308,
    "nan": math.nan,
    "infinity": math.inf,
    "a complex number": 1j,
    "a truth": True,
    "nothing": None,
    "text": "x",
    "no text": "",
    "a null character": "\0",
    "bytes": b"x",
    "texts": ["a", "b"],
    "lists of texts": [["a"], ["b"]],
    "a tuple of tuples of texts": (("a",),),
    "numbers as texts": ["1", "2", "3"],
    "an array of texts": np.array(["a"]),
    "an empty list": [],
    "an empty array of points": np.zeros((0, 3)),
    "one number in a list": [1.0],
    "two numbers": [1.0, 2.0],
    "two heights": np.array([-0.6, -0.7]),
    "rows of different lengths": [[1.0], [1.0, 2.0]],
    "nothings": [None] * 3,
    "twenty axes": np.zeros((1,) * 20),
    "dates": np.array(["2020-01-01"], dtype="datetime64[D]"),
    "an object": object(),
    "an array of objects": np.array([object()]),
    "a mapping": {},
    "another mapping": {"a": 1},
    "a set": {1, 2},
    "a class": int,
    "a leg": LEG,
    "a mechanism": DRIVE,
    "a posture": POSTURE,
    "a robot": ROBOT,
    "a contact": CONTACT,
}


@pytest.mark.parametrize("call", CALLS)
@pytest.mark.filterwarnings("ignore:.*complex:numpy.exceptions.ComplexWarning")
def test_what_an_argument_is_not_gives_an_answer_or_an_error_of_this_suite(call):
    function, arguments = CALLS[call]
    function(**arguments)
    for name in arguments:
        for label, value in HOSTILE.items():
            if name == "lateral_offset" and callable(value):
                continue  # a function of the caller's, who hears what it raises
            try:
                function(**{**arguments, name: value})
            except LegError:
                pass
            except Exception as error:
                pytest.fail(f"{call}: {name} = {label}: {type(error).__name__}: {error}")


def test_errors_name_the_argument_and_what_it_must_be():
    for call, words in (
        (lambda: evaluate_footholds("left_front", FOOT, CONTACT), "leg must be a Leg, got str"),
        (lambda: evaluate_footholds(LEG, FOOT, 0.4), "contact must be a Contact, got float"),
        (lambda: evaluate_indices(DRIVE, FOOT), "posture must be a Posture, got tuple"),
        (lambda: evaluate_indices(DRIVE, POSTURE, "condition_number"), "names must be a sequence"),
        (lambda: longest_step(LEG, -0.65, CONTACT, criterion=1.0), "must be a Criterion"),
        (lambda: load_robot(7), "a path must be text or a Path, got int"),
    ):
        with pytest.raises(KindError, match=words):
            call()
    with pytest.raises(ShapeError, match=r"height must be one number, got shape \(2,\)"):
        plane_map(LEG, [-0.6, -0.7], 0.1)
    with pytest.raises(ShapeError, match="foot_position must be an array of numbers"):
        DRIVE.inverse([10**400, 0, 0])
    with pytest.raises(UnknownNameError, match="unknown leg"):
        ROBOT.leg(["left_front"])
    with pytest.raises(ValueRangeError, match="legs must be at least one leg"):
        common_step({}, 0.65, CONTACT)


def test_numbers_counts_and_names_are_returned_as_such():
    assert as_number("height", np.float32(0.5)) == 0.5
    assert as_count("threads", 3.0, 5) == 3
    assert as_names("layers", ["a", "b"]) == ("a", "b")
    for value in (0, 6, 2.5, -1):
        with pytest.raises(ValueRangeError, match="threads must be a whole number >= 1 and <= 5"):
            as_count("threads", value, 5)
    for value in ("ab", 7, [1], None, [["a"]]):
        with pytest.raises(KindError, match="layers must be a sequence of names"):
            as_names("layers", value)
