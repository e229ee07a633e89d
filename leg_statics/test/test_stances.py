# SPDX-License-Identifier: Apache-2.0
"""Claims about stances, checked against a conic solver, mechanics and exact properties."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation
from stance_oracle import KINDS, compare, greatest_by_clarabel, random_stance

from leg_kinematics import load_robot
from leg_kinematics.errors import NotSupportedError, ShapeError, UnknownNameError, ValueRangeError
from leg_statics.capacity.problem import load_capacity
from leg_statics.stance.choice import choose_stance
from leg_statics.stance.region import margin_along, support_region
from leg_statics.stance.stances import (
    Load,
    Stance,
    StanceVerdict,
    as_arrays,
    best_forces,
    evaluate_stances,
    load_factor,
    payload,
)
from leg_statics.stance.standing import BodyPose, measured_stance, robot_load, robot_stance
from leg_statics.weight import LEVEL_GRAVITY, weight_efforts

G = 9.80665
LEFT, RIGHT = (
    ("left_front", "left_middle", "left_rear"),
    ("right_front", "right_middle", "right_rear"),
)
TRIPOD = ("left_front", "right_middle", "left_rear")


@pytest.fixture(scope="module")
def hexapod():
    return load_robot("hexapod")


@pytest.fixture(scope="module")
def solo12():
    return load_robot("solo12")


def initial_feet(robot):
    """The feet of all legs in their initial postures, in the base frame."""
    return {
        name: leg.mount.to_base(leg.mechanism.initial_posture.foot_position)
        for name, leg in robot.legs.items()
    }


def feet_of(robot, names, foot=(0.05, 0.0, -0.65)):
    """The same foot position in the frame of every leg, in the base frame."""
    return {name: robot.leg(name).mount.to_base(foot) for name in names}


def some_stances(count, seed=3, kinds=KINDS):
    rng = np.random.default_rng(seed)
    return [random_stance(rng, kinds[k % len(kinds)]) for k in range(count)]


def test_load_factors_are_those_of_a_conic_solver_also_where_nothing_stands():
    solved, different = compare(20 * len(KINDS), seed=1, tell=lambda *case: None)
    assert solved > 17 * len(KINDS)
    assert different == []


@pytest.mark.parametrize("kind", KINDS)
def test_forces_balance_the_load_within_cones_and_limits(kind):
    for stance, load in some_stances(25, kinds=[kind]):
        found, feet = load_factor(stance, load), as_arrays(stance)
        if not np.isfinite(found.multiple):
            continue
        wrench = found.multiple * load.weight + load.further
        size = np.linalg.norm(wrench[:3]) + 1.0
        held = np.concatenate([found.force.sum(0), np.cross(feet.position, found.force).sum(0)])
        np.testing.assert_allclose(held, -wrench, atol=1e-6 * size)
        normal = feet.normal / np.linalg.norm(feet.normal, axis=-1, keepdims=True)
        pressure = (found.force * normal).sum(-1)
        across = np.linalg.norm(found.force - pressure[:, None] * normal, axis=-1)
        with np.errstate(invalid="ignore"):
            allowed = np.where(feet.friction < np.inf, feet.friction * pressure, np.inf)
        assert (pressure >= -1e-7 * size).all()
        assert (across <= allowed + 1e-6 * size).all()
        effort = feet.bias_efforts - np.einsum("lij,li->lj", feet.jacobian, found.force)
        slack = 1e-6 * size * np.linalg.norm(feet.jacobian, axis=-2).max()
        assert (effort <= feet.effort_upper + slack)[feet.stands].all()
        assert (effort >= feet.effort_lower - slack)[feet.stands].all()
        assert (found.force[~feet.stands] == 0.0).all()


def test_a_robot_stands_exactly_where_its_load_factor_is_at_least_one():
    for stance, load in some_stances(160):
        if np.any(load.further):
            continue
        found = evaluate_stances(stance, load)
        if abs(found.load_factor - 1.0) > 1e-6 and np.all(stance.bias_efforts == 0.0):
            assert found.stands == (found.load_factor >= 1.0)
            assert found.stands == (found.utilisation <= 1.0)


def test_the_best_forces_have_the_least_utilisation_that_a_conic_solver_finds():
    checked = 0
    for stance, load in some_stances(64, seed=5, kinds=["plain", "slopes", "wrench"]):
        best = best_forces(stance, load)
        status, most = greatest_by_clarabel(stance, np.zeros(6), load.weight + load.further)
        if status != "Solved" or most < 1e-3:
            continue
        checked += 1
        assert best.utilisation == pytest.approx(1.0 / most, rel=1e-6)
        feet = as_arrays(stance)
        limit = np.where(best.joint_efforts > 0.0, feet.effort_upper, feet.effort_lower)
        used = (best.joint_efforts / limit)[feet.stands].max()
        assert used == pytest.approx(best.utilisation, rel=1e-6)
    assert checked > 20


def test_a_single_foot_without_friction_carries_its_load_capacity():
    rng = np.random.default_rng(8)
    for _ in range(20):
        jacobian, limits = rng.normal(0.0, 0.3, (3, 3)), 10.0 ** rng.uniform(1.0, 2.0, 3)
        foot = rng.normal(size=3)
        # without friction neither the leg nor the stance has a choice of tangential force
        found = load_factor(
            Stance(foot[None], jacobian[None], -limits, limits, 0.0), Load(1.0, foot)
        )
        capacity = load_capacity(jacobian, -limits, limits, 0.0).capacity
        assert found.multiple * G == pytest.approx(capacity, rel=1e-6)


def test_without_effort_limits_on_level_ground_the_region_is_the_support_polygon(hexapod):
    rng = np.random.default_rng(4)
    for legs in (3, 4, 6):
        feet = rng.uniform([-0.6, -0.6, 0.0], [0.6, 0.6, 0.0], (legs, 3))
        stance = Stance(feet, np.zeros((legs, 3, 3)), -np.inf, np.inf, 0.5)
        center = feet.mean(0) + np.array([0.0, 0.0, 0.7])
        region = support_region(stance, Load(50.0, center), 24)
        reach = (region.directions @ (feet - center).T).max(-1)
        np.testing.assert_allclose(region.reach, reach, atol=1e-7)
        hull = feet[ConvexHull(feet[:, :2]).vertices]
        for vertex in region.vertices:
            assert np.linalg.norm((hull - vertex)[:, :2], axis=-1).min() < 1e-5


def test_the_region_reaches_as_far_as_a_conic_solver_says():
    checked = 0
    for stance, load in some_stances(48, seed=6, kinds=["plain", "slopes", "tilted", "wrench"]):
        region = support_region(stance, load, 7)
        weight = load.weight
        for k in range(0, 7, 3):
            along = region.directions[k]
            turning = np.concatenate([np.zeros(3), np.cross(along, weight[:3])])
            status, reach = greatest_by_clarabel(stance, weight + load.further, turning, along)
            if status == "Solved":
                checked += 1
                assert region.reach[k] == pytest.approx(reach, abs=1e-5)
            elif status == "PrimalInfeasible":
                assert np.isnan(region.reach[k])
    assert checked > 60


def test_a_load_at_every_vertex_is_carried_and_beyond_every_tangent_is_not(hexapod):
    stance = robot_stance(hexapod, feet_of(hexapod, TRIPOD), 0.4)
    region = support_region(stance, Load(100.0))
    assert np.isfinite(region.vertices).all()
    center = region.vertices.mean(0)
    inside = evaluate_stances(stance, Load(100.0, center + 0.999 * (region.vertices - center)))
    assert inside.stands.all()
    out = Load(100.0, region.directions * (region.reach + 1e-4)[:, None])
    assert not evaluate_stances(stance, out).stands.any()


def test_margins_and_regions_agree(hexapod):
    stance, load = robot_stance(hexapod, feet_of(hexapod, TRIPOD), 0.4), Load(100.0)
    region = support_region(stance, load, 36)
    along = margin_along(stance, load, region.directions).multiple
    assert (along <= region.reach + 1e-9).all()
    assert region.margin - 1e-9 <= along.min() <= region.margin + region.error + 1e-9
    assert support_region(stance, load, 144).error < 0.5 * region.error


def test_margins_change_steadily_while_the_body_moves(hexapod):
    shift = np.linspace(-0.1, 0.1, 60)[:, None] * np.array([1.0, 0.0, 0.0])
    feet = {name: foot + shift for name, foot in feet_of(hexapod, TRIPOD).items()}
    for mass in (60.0, 120.0):
        region = support_region(robot_stance(hexapod, feet, 0.4), Load(mass), 36)
        assert np.abs(np.diff(region.margin)).max() < 2.0 * np.diff(shift[:, 0]).max()
        assert (np.diff(region.margin) != 0.0).all()


def test_a_symmetric_robot_has_a_symmetric_region(hexapod):
    stance = robot_stance(hexapod, feet_of(hexapod, (*LEFT, *RIGHT)), 0.4)
    region = support_region(stance, Load(350.0), 36)
    np.testing.assert_allclose(region.reach[1:], region.reach[1:][::-1], atol=1e-7)
    left = robot_stance(hexapod, feet_of(hexapod, TRIPOD), 0.4)
    names = ("right_front", "left_middle", "right_rear")
    right = robot_stance(hexapod, feet_of(hexapod, names), 0.4)
    ours, mirrored = (
        evaluate_stances(s, Load(100.0, c))
        for s, c in ((left, [0.02, 0.05, 0.1]), (right, [0.02, -0.05, 0.1]))
    )
    assert ours.load_factor == pytest.approx(float(mirrored.load_factor), rel=1e-7)


def test_a_payload_at_the_centre_of_mass_is_what_the_load_factor_leaves(hexapod):
    stance = robot_stance(hexapod, feet_of(hexapod, TRIPOD), 0.4)
    center = np.array([0.05, 0.1, 0.0])
    more = payload(stance, Load(60.0, center), center).multiple
    factor = load_factor(stance, Load(60.0, center)).multiple
    assert 60.0 + more == pytest.approx(60.0 * factor, rel=1e-6)


def test_a_leg_holds_its_links_besides(solo12):
    feet = initial_feet(solo12)
    stance = robot_stance(solo12, feet, 0.5)
    for k, name in enumerate(feet):
        mechanism = solo12.leg(name).mechanism
        held = weight_efforts(mechanism, mechanism.initial_posture, LEVEL_GRAVITY)
        np.testing.assert_allclose(stance.bias_efforts[k], held, atol=1e-9)
        assert np.abs(held).max() > 0.05
    found = evaluate_stances(stance, robot_load(solo12))
    borne = np.einsum("lij,li->lj", stance.jacobian, found.force)
    np.testing.assert_allclose(found.joint_efforts + borne, stance.bias_efforts, atol=1e-9)
    assert found.stands
    assert found.force.sum(axis=0)[2] == pytest.approx(2.5 * G, rel=1e-3)  # all of solo12


def test_a_stance_by_its_joints_is_that_of_its_feet(solo12):
    rng = np.random.default_rng(2)
    joints = {
        name: leg.mechanism.initial_posture.joint_positions + rng.uniform(-0.1, 0.1, (5, 3))
        for name, leg in solo12.legs.items()
    }
    feet = {
        name: leg.mount.to_base(leg.mechanism.forward(joints[name]).foot_position)
        for name, leg in solo12.legs.items()
    }
    stands = np.array([True, True, True, False])
    down = np.array([1.0, 0.5, -9.0])
    load = robot_load(solo12, gravity=down)
    told = measured_stance(solo12, joints, stands, 0.8, down)
    on_feet = robot_stance(solo12, dict(list(feet.items())[:3]), 0.8, normal=-down, gravity=down)
    found, wanted = evaluate_stances(told, load), evaluate_stances(on_feet, load)
    np.testing.assert_allclose(found.load_factor, wanted.load_factor, rtol=1e-6, atol=1e-7)
    np.testing.assert_array_equal(found.verdict, wanted.verdict)
    assert found.stands.any()


def test_a_load_without_a_mass_is_refused():
    with pytest.raises(ValueRangeError, match="mass"):
        robot_load(load_robot("quadruped"))


def test_turning_a_robot_with_heavy_legs_changes_nothing_either(solo12):
    feet = initial_feet(solo12)
    level = evaluate_stances(robot_stance(solo12, feet, 0.6), robot_load(solo12))
    turn = Rotation.from_rotvec([0.4, 0.3, -0.8]).as_matrix()
    pose, down = BodyPose([1.0, 2.0, 3.0], turn), turn @ [0.0, 0.0, -G]
    moved = {name: pose.from_base(foot) for name, foot in feet.items()}
    stance = robot_stance(solo12, moved, 0.6, pose, normal=turn[:, 2], gravity=down)
    found = evaluate_stances(stance, robot_load(solo12, pose, down))
    assert found.load_factor == pytest.approx(float(level.load_factor), rel=1e-6)
    np.testing.assert_allclose(found.force, level.force @ turn.T, atol=1e-3)


def test_the_pose_chosen_has_the_largest_margin_of_those_that_stand(hexapod):
    feet = feet_of(hexapod, TRIPOD)
    shifts = np.random.default_rng(6).uniform([-0.2, -0.2, -0.1], [0.2, 0.2, 0.1], (40, 3))
    poses = BodyPose(shifts)
    stance = robot_stance(hexapod, feet, 0.4, poses)
    choice = choose_stance(stance, Load(80.0, shifts))
    margin, stands = choice.region.margin, choice.stances.stands
    assert 1 < stands.sum() < len(shifts)
    assert margin[choice.best] == margin[stands].max()
    assert sorted(choice.ranking) == np.flatnonzero(stands).tolist()
    assert (np.diff(margin[choice.ranking]) <= 0.0).all()
    assert (margin[stands] > -1e-9).all()
    posed = (stance.status == 0).all(axis=-1)
    inside = margin > choice.region.error  # the true margin is larger by the error at most
    assert stands[posed & inside].all()
    assert not stands[margin < -1e-6 - choice.region.error].any()


def test_turning_everything_changes_nothing(hexapod):
    names = (*LEFT, "right_middle")
    feet, load = feet_of(hexapod, names), Load(80.0, [0.0, 0.05, 0.1])
    level = evaluate_stances(robot_stance(hexapod, feet, 0.5), load)
    turn, shift = Rotation.from_rotvec([0.3, -0.2, 1.0]).as_matrix(), np.array([3.0, -2.0, 1.0])
    pose = BodyPose(shift, turn)
    moved = robot_stance(
        hexapod,
        {name: pose.from_base(foot) for name, foot in feet.items()},
        0.5,
        pose,
        normal=turn[:, 2],
    )
    turned = Load(80.0, pose.from_base(load.center_of_mass), turn @ [0.0, 0.0, -G])
    found = evaluate_stances(moved, turned)
    assert found.load_factor == pytest.approx(float(level.load_factor), rel=1e-6)
    np.testing.assert_allclose(found.joint_efforts, level.joint_efforts, atol=1e-3)


def test_accelerating_is_as_gravity_that_leans(hexapod):
    stance = robot_stance(hexapod, feet_of(hexapod, TRIPOD), 0.4)
    speeding = load_factor(stance, Load(60.0, acceleration=[1.0, 0.5, 0.0])).multiple
    leaning = load_factor(stance, Load(60.0, gravity=[-1.0, -0.5, -G])).multiple
    assert speeding == leaning
    assert speeding < load_factor(stance, Load(60.0)).multiple


def test_the_verdict_says_what_is_wrong(hexapod):
    feet = feet_of(hexapod, TRIPOD)
    stance = robot_stance(hexapod, feet, 0.4)

    def verdict(stance, load):
        return StanceVerdict(int(evaluate_stances(stance, load).verdict))

    over_edge = Load(60.0, [0.0, -0.35, 0.0])
    assert verdict(stance, Load(60.0)) == StanceVerdict.STANDS
    assert verdict(stance, Load(1000.0)) == StanceVerdict.EFFORT
    assert verdict(stance, over_edge) == StanceVerdict.PULL
    pushed = Load(60.0, force=[200.0, 0.0, 0.0], moment=[0.0, -130.0, 0.0])
    assert verdict(stance._replace(friction=0.2), pushed) == StanceVerdict.FRICTION
    away = robot_stance(hexapod, {**feet, "left_rear": np.array([5.0, 0.0, 0.0])}, 0.4)
    assert verdict(away, Load(60.0)) == StanceVerdict.REACH
    assert verdict(stance, Load(60.0, [np.nan, 0.0, 0.0])) == StanceVerdict.INVALID_INPUT
    assert np.isnan(evaluate_stances(away, Load(60.0)).load_factor)


def test_what_limits_is_what_helps_if_it_is_relaxed():
    seen = set()
    for stance, load in some_stances(60, seed=12, kinds=["plain", "wrench", "one-sided"]):
        found = load_factor(stance, load)
        if not 0.1 < found.multiple < 100.0:
            continue
        feet, leg, joint = as_arrays(stance), int(found.limiting_leg), int(found.limiting_joint)
        wide = [feet.effort_lower.copy(), feet.effort_upper.copy(), feet.friction.copy()]
        if found.limit == StanceVerdict.EFFORT:
            wide[0][leg, joint] *= 1.02
            wide[1][leg, joint] *= 1.02
        elif found.limit == StanceVerdict.FRICTION:
            wide[2][leg] *= 1.02
        else:
            continue
        seen.add(int(found.limit))
        relaxed = feet._replace(effort_lower=wide[0], effort_upper=wide[1], friction=wide[2])
        assert load_factor(relaxed, load).multiple > found.multiple * (1.0 + 1e-7)
    assert StanceVerdict.EFFORT in seen


def test_candidates_are_leading_axes(hexapod):
    feet = feet_of(hexapod, TRIPOD)
    steps = feet["left_front"] + np.linspace(-0.05, 0.05, 4)[:, None] * np.array([1.0, 0.0, 0.0])
    found = evaluate_stances(
        robot_stance(hexapod, {**feet, "left_front": steps}, 0.4), Load([[60.0], [80.0]])
    )
    assert found.load_factor.shape == (2, 4)
    assert found.force.shape == (2, 4, 3, 3)
    one = robot_stance(hexapod, {**feet, "left_front": steps[2]}, 0.4)
    assert load_factor(one, Load(80.0)).multiple == pytest.approx(found.load_factor[1, 2])
    assert found.best == np.argmax(found.load_factor)


def test_a_leg_in_the_air_counts_for_nothing(hexapod):
    all_feet, names = feet_of(hexapod, (*LEFT, *RIGHT)), (*LEFT, *RIGHT)
    lifted = robot_stance(hexapod, all_feet, 0.4)._replace(
        stands=[name in TRIPOD for name in names]
    )
    tripod = robot_stance(hexapod, feet_of(hexapod, TRIPOD), 0.4)
    assert load_factor(lifted, Load(60.0)).multiple == pytest.approx(
        float(load_factor(tripod, Load(60.0)).multiple), rel=1e-7
    )
    none = lifted._replace(stands=False)
    assert evaluate_stances(none, Load(60.0)).verdict == StanceVerdict.PULL


def test_what_cannot_be_asked_raises(hexapod):
    feet = feet_of(hexapod, TRIPOD)
    stance, gantry = robot_stance(hexapod, feet, 0.4), load_robot("gantry")
    with pytest.raises(UnknownNameError, match="wing"):
        robot_stance(hexapod, {"wing": [0.0, 0.0, 0.0]}, 0.4)
    with pytest.raises(ShapeError, match="at least one leg"):
        robot_stance(hexapod, {}, 0.4)
    with pytest.raises(ShapeError, match="left_front"):
        robot_stance(hexapod, {**feet, "left_front": [0.0, 0.0]}, 0.4)
    with pytest.raises(NotSupportedError, match="point feet"):
        robot_stance(gantry, {next(iter(gantry.legs)): [0.0, 0.0, 0.0]}, 0.4)
    with pytest.raises(ValueRangeError, match="friction"):
        evaluate_stances(stance._replace(friction=-1.0), Load(60.0))
    with pytest.raises(ValueRangeError, match="mass"):
        evaluate_stances(stance, Load(-1.0))
    with pytest.raises(ValueRangeError, match="effort_lower"):
        evaluate_stances(stance._replace(effort_lower=200.0), Load(60.0))
    with pytest.raises(ValueRangeError, match="along gravity"):
        margin_along(stance, Load(60.0), [0.0, 0.0, 1.0])
    with pytest.raises(ValueRangeError, match="directions"):
        support_region(stance, Load(60.0), 2)
    with pytest.raises(ShapeError):
        evaluate_stances(stance._replace(friction=[0.4, 0.4]), Load(60.0))
