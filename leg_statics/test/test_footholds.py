# SPDX-License-Identifier: Apache-2.0
"""Footholds: verdicts, forces and shares, checked by other optimisers and by admissibility."""

from __future__ import annotations

from dataclasses import replace

import clarabel
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy import sparse
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from leg_kinematics import Leg, ParallelDrive, ShapeError, Status, ValueRangeError, load_robot
from leg_kinematics.mirrored import Mirrored
from leg_kinematics.robot import Mount
from leg_statics.capacity.problem import load_capacity
from leg_statics.efforts import joint_efforts
from leg_statics.footholds import (
    AMPLE_CLEARANCE,
    CORNERS,
    Contact,
    Verdict,
    evaluate_around,
    evaluate_footholds,
)
from leg_statics.published.paper_000 import legs
from leg_statics.weight import GRAVITY

LIMITS = np.array([[-60.0, 60.0], [-60.0, 60.0], [-80.0, 40.0]])
LEG = Leg.of(legs()["optimised"], LIMITS)
CANDIDATES = np.random.default_rng(0).uniform([-0.4, -0.3, -0.8], [0.3, 0.3, -0.4], (4000, 3))
NORMAL = np.array([0.1, -0.2, 1.0])
BIAS = np.array([4.0, -3.0, 6.0])
MOMENT = np.array([3.0, -2.0, 1.0])
CONTACTS = {
    "level": Contact(0.4, load=150.0),
    "inclined": Contact(0.6, normal=NORMAL, load=150.0),
    "smooth": Contact(0.05, load=150.0),
    "soft": Contact(0.5, load=150.0, moment=MOMENT),
    "any moment": Contact(0.5, load=150.0, any_direction_moment=4.0),
    "weighted": Contact(0.5, load=150.0, bias_efforts=BIAS),
    "heavy": Contact(0.4, load=400.0),
}


def direction_of(contact):
    """The unit normal of a contact's ground."""
    normal = (0.0, 0.0, 1.0) if contact.normal is None else contact.normal
    return np.asarray(normal) / np.linalg.norm(normal)


every_contact = pytest.mark.parametrize("contact", CONTACTS.values(), ids=CONTACTS)


@every_contact
def test_a_candidate_that_is_not_solved_tells_why(contact):
    footholds = evaluate_footholds(LEG, CANDIDATES, contact)
    unsolved = footholds.posture.status != Status.OK
    assert 0.1 < unsolved.mean() < 0.9
    np.testing.assert_array_equal(footholds.verdict[unsolved], footholds.posture.status[unsolved])
    assert not footholds.feasible[unsolved].any()
    for values in (footholds.load_capacity, footholds.rated_friction, footholds.utilisation):
        assert np.isnan(values[unsolved]).all()
    assert (footholds.limiting_joint[unsolved] == -1).all()


@every_contact
def test_the_force_of_a_feasible_candidate_is_admissible(contact):
    footholds = evaluate_footholds(LEG, CANDIDATES, contact)
    good = footholds.feasible
    assert good.sum() > 20
    force, posture = footholds.force[good], footholds.posture
    np.testing.assert_allclose(force[:, 2], contact.load, rtol=1e-9)
    normal = direction_of(contact)
    pressed = force @ normal
    sideways = np.linalg.norm(force - pressed[:, None] * normal, axis=1)
    assert np.all(sideways <= contact.friction * pressed * (1 + 1e-9))
    jacobian = LEG.mechanism.jacobian(posture)[good]
    j_omega = LEG.mechanism.angular_jacobian(posture)[good]
    expected = joint_efforts(jacobian, j_omega, force, contact.moment)
    expected += np.asarray(contact.bias_efforts)
    efforts = footholds.joint_efforts[good]
    np.testing.assert_allclose(efforts, expected, rtol=1e-9, atol=1e-9)
    reserve = contact.any_direction_moment * np.hypot(j_omega[:, 0], j_omega[:, 1])
    share = np.maximum((efforts + reserve) / LIMITS[:, 1], (efforts - reserve) / LIMITS[:, 0])
    np.testing.assert_allclose(footholds.utilisation[good], share.max(axis=1), rtol=1e-9)
    limiting = np.take_along_axis(share, footholds.limiting_joint[good][:, None], axis=1)[:, 0]
    np.testing.assert_allclose(limiting, share.max(axis=1), rtol=1e-9)
    assert np.all(share <= 1.0 + 1e-9)


@every_contact
def test_a_verdict_of_friction_or_effort_is_confirmed_by_a_linear_programme(contact):
    """Without the cone the question is linear: highs must find the load, or not, likewise."""
    footholds = evaluate_footholds(LEG, CANDIDATES, contact)
    posture = footholds.posture
    jacobian, j_omega = LEG.mechanism.jacobian(posture), LEG.mechanism.angular_jacobian(posture)
    for verdict in (Verdict.FRICTION, Verdict.EFFORT):
        for k in np.flatnonzero(footholds.verdict == verdict)[:40]:
            idle = joint_efforts(0 * jacobian[k], j_omega[k], np.zeros(3), contact.moment)
            idle = idle + np.asarray(contact.bias_efforts)
            reserve = contact.any_direction_moment * np.hypot(j_omega[k, 0], j_omega[k, 1])
            lower, upper = LIMITS[:, 0] + reserve, LIMITS[:, 1] - reserve
            result = linprog(
                (0.0, 0.0, -1.0),
                A_ub=np.vstack([jacobian[k].T, -jacobian[k].T]),
                b_ub=np.concatenate([idle - lower, upper - idle]),
                bounds=[(None, None)] * 3,
                method="highs",
            )
            rough = np.inf if result.status == 3 else -result.fun
            assert (rough >= contact.load) == (verdict == Verdict.FRICTION)


def test_each_verdict_occurs():
    seen = {
        int(v)
        for contact in CONTACTS.values()
        for v in evaluate_footholds(LEG, CANDIDATES, contact).verdict
    }
    seen.add(int(evaluate_footholds(LEG, [np.nan, 0.0, -0.6], CONTACTS["level"]).verdict))
    assert seen == set(map(int, Verdict))


def test_capacity_is_that_of_the_jacobian():
    contact = Contact(0.4, normal=NORMAL, load=10.0, bias_efforts=BIAS)
    footholds = evaluate_footholds(LEG, CANDIDATES, contact)
    ok = footholds.posture.status == Status.OK
    direct = load_capacity(
        LEG.mechanism.jacobian(footholds.posture), *LIMITS.T, 0.4, normal=NORMAL, bias_efforts=BIAS
    )
    np.testing.assert_allclose(footholds.load_capacity[ok], direct.capacity[ok], rtol=1e-12)


def test_a_moment_of_unknown_direction_costs_at_least_as_much_as_any_known_one():
    size = 5.0
    worst = evaluate_footholds(LEG, CANDIDATES, Contact(0.4, any_direction_moment=size))
    ok = worst.posture.status == Status.OK
    for angle in np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False):
        moment = size * np.array([np.cos(angle), np.sin(angle), 0.0])
        known = evaluate_footholds(LEG, CANDIDATES, Contact(0.4, moment=moment))
        assert np.all(known.load_capacity[ok] >= worst.load_capacity[ok] * (1 - 1e-9))
    hard = evaluate_footholds(LEG, CANDIDATES, Contact(0.4))
    assert np.all(hard.load_capacity[ok] >= worst.load_capacity[ok])


def test_a_leg_that_cannot_be_held_carries_nothing():
    for contact in (
        Contact(0.4, bias_efforts=(0.0, -61.0, 0.0)),
        Contact(0.4, any_direction_moment=1e6),
        Contact(0.4, moment=(1e6, 0.0, 0.0)),
    ):
        footholds = evaluate_footholds(LEG, CANDIDATES, contact)
        ok = footholds.posture.status == Status.OK
        assert np.all(footholds.verdict[ok] == Verdict.EFFORT)
        assert np.all(footholds.load_capacity[ok] == 0.0)
        assert np.all(footholds.utilisation[ok] > 1.0)


def least_share(jacobian, j_omega, limits, contact):
    """The least share of a limit that the most used joint needs, by a conic solver.

    Over F and the share: every effort within that share of its limits, F in the cone, the load its
    vertical part.
    """
    n = jacobian.shape[1]
    idle = np.asarray(contact.bias_efforts) - j_omega.T @ np.asarray(contact.moment)
    reserve = contact.any_direction_moment * np.hypot(j_omega[0], j_omega[1])
    normal = direction_of(contact)
    _, _, rows = np.linalg.svd(normal[None])
    efforts = np.vstack(
        [
            np.column_stack([-jacobian.T, -limits[:, 1]]),  # idle + reserve - J'F <= share * upper
            np.column_stack([jacobian.T, limits[:, 0]]),
            [[0.0, 0.0, 0.0, -1.0]],
        ]
    )
    cone = -np.column_stack([np.vstack([contact.friction * normal, rows[1:]]), np.zeros(3)])
    options = clarabel.DefaultSettings()
    options.verbose = False
    options.tol_gap_abs = options.tol_gap_rel = options.tol_feas = 1e-10
    solution = clarabel.DefaultSolver(
        sparse.csc_matrix((4, 4)),
        np.array([0.0, 0.0, 0.0, 1.0]),
        sparse.csc_matrix(np.vstack([[[0.0, 0.0, 1.0, 0.0]], efforts, cone])),
        np.concatenate([[contact.load], -idle - reserve, idle - reserve, np.zeros(4)]),
        [clarabel.ZeroConeT(1), clarabel.NonnegativeConeT(2 * n + 1), clarabel.SecondOrderConeT(3)],
        options,
    ).solve()
    return solution.obj_val if "Solved" in str(solution.status) else np.inf


@every_contact
def test_utilisation_is_the_least_share_that_a_conic_solver_finds(contact):
    footholds = evaluate_footholds(LEG, CANDIDATES, contact)
    posture = footholds.posture
    jacobian, j_omega = LEG.mechanism.jacobian(posture), LEG.mechanism.angular_jacobian(posture)
    solved = np.flatnonzero(posture.status == Status.OK)[:300]
    for k in solved:
        share = least_share(jacobian[k], j_omega[k], LIMITS, contact)
        assert footholds.utilisation[k] == pytest.approx(share, rel=1e-6, abs=1e-7)
    assert np.all(footholds.utilisation[footholds.feasible] <= 1.0)


def test_utilisation_without_anything_but_the_load_is_the_load_by_the_capacity():
    footholds = evaluate_footholds(LEG, CANDIDATES, CONTACTS["inclined"])
    ok = footholds.posture.status == Status.OK
    expected = CONTACTS["inclined"].load / footholds.load_capacity[ok]
    np.testing.assert_allclose(footholds.utilisation[ok], expected, rtol=1e-12)


@pytest.mark.parametrize("powerless", [0, 1, 2])
@pytest.mark.parametrize("contact", [CONTACTS["level"], Contact(0.2, load=50.0)])
def test_a_joint_without_power_makes_utilisation_infinite_only_where_the_load_needs_it(
    powerless, contact
):
    limits = LIMITS.copy()
    limits[powerless] = 0.0
    footholds = evaluate_footholds(Leg.of(LEG.mechanism, limits), CANDIDATES, contact)
    ok = footholds.posture.status == Status.OK
    bears, needed = footholds.feasible, ok & np.isinf(footholds.utilisation)
    assert needed.any()
    assert np.all(footholds.utilisation[bears] <= 1.0)
    assert np.all(footholds.utilisation[ok & ~bears] > 1.0)
    assert np.all(footholds.load_capacity[needed] == 0.0)
    assert np.all(footholds.limiting_joint[needed] == powerless)
    efforts = footholds.joint_efforts[ok]
    jacobian = LEG.mechanism.jacobian(footholds.posture)[ok]
    held = -np.einsum("kij,ki->kj", jacobian, footholds.force[ok])
    np.testing.assert_allclose(efforts, held, atol=1e-9)
    assert np.all(np.abs(footholds.joint_efforts[needed, powerless]) > 1e-9)
    relieved = ok & np.isfinite(footholds.utilisation)
    np.testing.assert_allclose(footholds.joint_efforts[relieved, powerless], 0.0, atol=1e-9)


def test_the_ground_and_the_load_of_a_tilted_leg_are_level_and_vertical_for_the_robot():
    tilt = Rotation.from_euler("xyz", [0.3, -0.2, 0.5]).as_matrix()
    tilted = replace(LEG, mount=Mount(np.zeros(3), tilt))
    up = tilt.T @ [0.0, 0.0, 1.0]
    down = -GRAVITY * up
    for contact in (Contact(0.4, load=150.0), Contact(0.4, load=150.0, any_direction_moment=3.0)):
        left_out = evaluate_footholds(tilted, CANDIDATES, contact)
        told = evaluate_footholds(LEG, CANDIDATES, contact._replace(normal=-down, gravity=down))
        np.testing.assert_array_equal(left_out.numbers, told.numbers)
        held = left_out.feasible
        np.testing.assert_allclose(left_out.force[held] @ up, 150.0, rtol=1e-9)


def test_ranking_lists_feasible_candidates_by_margin_or_by_capacity():
    footholds = evaluate_footholds(LEG, CANDIDATES, CONTACTS["level"])
    for order, values in (
        (footholds.ranking, footholds.margin),
        (footholds.ranking_by_capacity, footholds.load_capacity),
    ):
        assert len(order) == footholds.feasible.sum()
        assert footholds.feasible[order].all()
        assert np.all(np.diff(values[order]) <= 0.0)
    assert footholds.best == footholds.ranking[0]
    assert np.isnan(footholds.margin[~footholds.feasible]).all()


def test_margin_is_what_is_left_of_load_friction_and_clearance():
    footholds = evaluate_footholds(LEG, CANDIDATES, CONTACTS["level"])
    good = footholds.feasible
    left = 1.0 - CONTACTS["level"].load / footholds.load_capacity
    rough = 1.0 - footholds.rated_friction_full / CONTACTS["level"].friction
    least = np.minimum.reduce(
        [left, rough, footholds.clearance / AMPLE_CLEARANCE, np.ones(len(left))]
    )
    np.testing.assert_allclose(footholds.margin[good], least[good], rtol=1e-12)


def test_clearance_is_how_far_joints_let_the_foot_move_to_first_order():
    footholds = evaluate_footholds(LEG, CANDIDATES, CONTACTS["level"])
    ok = np.flatnonzero(footholds.posture.status == Status.OK)[:500]
    inverse = np.linalg.inv(LEG.mechanism.jacobian(footholds.posture)[ok])
    positions = footholds.posture.joint_positions[ok]
    lower, upper = LEG.mechanism.joint_limits.T
    room = np.minimum(positions - lower, upper - positions)
    least = np.min(room / np.linalg.norm(inverse, axis=-1), axis=-1)
    np.testing.assert_allclose(footholds.clearance[ok], least, rtol=1e-9, atol=1e-12)


def test_a_leg_with_one_crank_has_no_clearance_and_the_margin_of_its_load():
    leg = load_robot("walker").leg("left_front_inner")
    cranks = np.random.default_rng(5).uniform(-3.0, 3.0, (400, 1))
    feet = leg.mechanism.forward(cranks).foot_position
    feet[::3] += [0.0, 0.0, 0.1]  # out of reach
    footholds = evaluate_footholds(leg, feet, Contact(0.8, load=5.0))
    ok, good = footholds.status == Status.OK, footholds.feasible
    assert good.any()
    assert not ok.all()
    assert np.isposinf(footholds.clearance[ok]).all()
    assert np.isnan(footholds.clearance[~ok]).all()
    left = 1.0 - 5.0 / footholds.load_capacity[good]
    np.testing.assert_allclose(footholds.margin[good], left, rtol=1e-12)


def test_the_best_by_margin_stay_within_reach_where_the_best_by_capacity_do_not():
    """A foot that comes down 1 cm beside the foothold, in any direction."""
    footholds = evaluate_footholds(LEG, CANDIDATES, CONTACTS["level"])
    aside = np.random.default_rng(3).normal(size=(100, 3))
    aside *= 0.01 / np.linalg.norm(aside, axis=1)[:, None]

    def share_lost(ranking):
        moved = CANDIDATES[ranking[:20], None] + aside
        return 1.0 - evaluate_footholds(LEG, moved, CONTACTS["level"]).feasible.mean()

    assert share_lost(footholds.ranking) == 0.0
    assert share_lost(footholds.ranking_by_capacity) > 0.1


def test_a_candidate_that_the_foot_may_miss_is_worth_the_worst_around_it():
    contact = CONTACTS["inclined"]
    found = evaluate_around(LEG, CANDIDATES, contact, 0.02)
    alone = evaluate_footholds(LEG, CANDIDATES, contact)
    around = evaluate_footholds(LEG, CANDIDATES[:, None] + 0.02 * CORNERS, contact)
    np.testing.assert_array_equal(found.feasible, alone.feasible & around.feasible.all(axis=1))
    lost = alone.feasible & ~found.feasible
    assert lost.any()
    first = around.verdict[lost, np.argmax(~around.feasible[lost], axis=1)]
    np.testing.assert_array_equal(found.verdict[lost], first)
    np.testing.assert_array_equal(found.verdict[~alone.feasible], alone.verdict[~alone.feasible])
    good = found.feasible
    least = np.minimum(alone.load_capacity, around.load_capacity.min(axis=1))
    np.testing.assert_allclose(found.load_capacity[good], least[good], rtol=1e-12)
    least = np.minimum(alone.margin, around.margin.min(axis=1))
    np.testing.assert_allclose(found.margin, np.where(good, least, np.nan), rtol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(CORNERS, axis=1), 1.0, rtol=1e-12)


def test_contacts_that_differ_from_candidate_to_candidate_hold_for_all_around_it():
    friction, normal = np.linspace(0.05, 1.0, 50), np.tile(NORMAL, (50, 1))
    contact = Contact(friction, normal, load=120.0, bias_efforts=np.tile(BIAS, (50, 1)))
    together = evaluate_around(LEG, CANDIDATES[:50], contact, 0.01)
    for k in range(50):
        one = Contact(friction[k], NORMAL, load=120.0, bias_efforts=BIAS)
        alone = evaluate_around(LEG, CANDIDATES[k], one, 0.01)
        np.testing.assert_array_equal(alone.numbers, together.numbers[k])


def test_no_load_is_feasible_wherever_the_posture_is_ok():
    footholds = evaluate_footholds(LEG, CANDIDATES, Contact(0.0, load=0.0))
    ok = footholds.posture.status == Status.OK
    assert footholds.feasible[ok].all()
    np.testing.assert_array_equal(footholds.force[ok], 0.0)
    np.testing.assert_array_equal(footholds.utilisation[ok], 0.0)


def test_friction_margin_is_what_the_ground_offers_beyond_mu_e():
    footholds = evaluate_footholds(LEG, CANDIDATES, Contact(0.4))
    ok = footholds.posture.status == Status.OK
    np.testing.assert_allclose(
        footholds.friction_margin[ok], 0.4 - footholds.rated_friction[ok], atol=1e-12
    )
    assert np.all(footholds.rated_friction_full[ok] >= footholds.rated_friction[ok])


def test_a_mirrored_leg_mirrors_everything():
    contact = CONTACTS["inclined"]
    mirror = contact._replace(normal=NORMAL * [1, -1, 1])
    mirrored = Leg.of(Mirrored(LEG.mechanism), LIMITS)
    a = evaluate_footholds(LEG, CANDIDATES, contact)
    b = evaluate_footholds(mirrored, CANDIDATES * [1, -1, 1], mirror)
    np.testing.assert_array_equal(a.verdict, b.verdict)
    np.testing.assert_allclose(a.load_capacity, b.load_capacity, rtol=1e-9)
    np.testing.assert_allclose(a.force * [1, -1, 1], b.force, rtol=1e-6, atol=1e-6)


def test_contacts_may_differ_from_candidate_to_candidate():
    friction = np.linspace(0.05, 1.0, 50)
    load = np.linspace(400.0, 10.0, 50)
    together = evaluate_footholds(
        LEG, CANDIDATES[:50], Contact(friction, load=load, moment=np.tile(MOMENT, (50, 1)))
    )
    for k in range(50):
        one = evaluate_footholds(
            LEG, CANDIDATES[k], Contact(friction[k], load=load[k], moment=MOMENT)
        )
        assert one.verdict == together.verdict[k]
        np.testing.assert_array_equal(one.load_capacity, together.load_capacity[k])


def test_a_contact_whose_array_changed_is_read_anew():
    load, points = np.array(10.0), CANDIDATES[:50]
    contact = Contact(0.4, load=load)
    evaluate_footholds(LEG, points, contact)
    load[()] = 500.0
    again = evaluate_footholds(LEG, points, contact)
    np.testing.assert_array_equal(
        again.verdict, evaluate_footholds(LEG, points, Contact(0.4, load=500.0)).verdict
    )


def test_numbers_have_a_column_for_each_result():
    footholds = evaluate_footholds(LEG, CANDIDATES, CONTACTS["soft"])
    results = [
        *(
            footholds.verdict,
            footholds.rated_friction,
            footholds.rated_friction_full,
            footholds.friction_margin,
        ),
        *(footholds.utilisation, footholds.limiting_joint, footholds.load_capacity),
        *(footholds.clearance, footholds.margin),
    ]
    columns = np.column_stack([*results, footholds.force, footholds.joint_efforts])
    np.testing.assert_array_equal(footholds.numbers, columns)
    one = evaluate_footholds(LEG, CANDIDATES[0], CONTACTS["soft"])
    assert isinstance(one.load_capacity, float)
    assert one.limiting_joint.dtype == np.int32


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"friction": -0.1}, "friction"),
        ({"friction": np.nan}, "friction"),
        ({"load": -1.0}, "load"),
        ({"load": np.nan}, "load"),
        ({"load": np.inf}, "load"),
        ({"any_direction_moment": -1.0}, "any_direction_moment"),
        ({"any_direction_moment": np.inf}, "any_direction_moment"),
        ({"moment": (0.0, np.nan, 0.0)}, "moment"),
        ({"normal": (0.0, 0.0, 0.0)}, "normal"),
        ({"normal": (0.0, np.nan, 1.0)}, "normal"),
        ({"normal": (0.0, 0.1, -1.0)}, "normal must point out of the ground"),
        ({"gravity": (0.0, 0.0, np.inf)}, "gravity"),
        ({"bias_efforts": (0.0, np.inf, 0.0)}, "bias_efforts"),
    ],
)
def test_a_value_out_of_range_is_named(change, named):
    with pytest.raises(ValueRangeError, match=named):
        evaluate_footholds(LEG, CANDIDATES, CONTACTS["level"]._replace(**change))


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"friction": [0.1, 0.2]}, "friction"),
        ({"moment": (0.0, 1.0)}, "moment"),
        ({"normal": (0.0, 1.0)}, "normal"),
        ({"bias_efforts": (0.0, 1.0)}, "bias_efforts"),
        ({"load": "heavy"}, "load"),
    ],
)
def test_a_wrong_shape_is_named(change, named):
    with pytest.raises(ShapeError, match=named):
        evaluate_footholds(LEG, CANDIDATES, CONTACTS["level"]._replace(**change))
    with pytest.raises(ShapeError, match="foot_position"):
        evaluate_footholds(LEG, [[0.0, 1.0]], CONTACTS["level"])
    with pytest.raises(ShapeError, match="effort_limits"):
        evaluate_footholds(replace(LEG, effort_limits=LIMITS[:2]), CANDIDATES, CONTACTS["level"])


def test_no_candidates_give_no_answers():
    footholds = evaluate_footholds(LEG, np.empty((0, 3)), CONTACTS["level"])
    assert footholds.verdict.shape == (0,)
    assert footholds.ranking.shape == (0,)
    assert footholds.best == -1


@settings(max_examples=200, deadline=None)
@given(hnp.arrays(np.float64, (6, 3), elements=st.floats()), st.floats(0.0, 10.0))
def test_any_candidates_are_taken(points, friction):
    footholds = evaluate_footholds(
        Leg.of(ParallelDrive(), LIMITS), points, Contact(friction, load=100.0)
    )
    good = footholds.feasible
    for values in (footholds.load_capacity, footholds.utilisation, footholds.rated_friction):
        assert np.isfinite(values[good]).all()
    assert np.all(footholds.verdict[~np.isfinite(points).all(axis=1)] == Verdict.INVALID_INPUT)


@pytest.mark.parametrize("count", [1, 2, 63, 64, 65, 200])
def test_a_batch_equals_its_points_one_by_one_whatever_its_size(count):
    random = np.random.default_rng(count)
    feet = CANDIDATES.reshape(-1, 3)[random.integers(0, CANDIDATES.size // 3, count)]
    contact = Contact(
        friction=random.uniform(0.0, 1.0, count),
        normal=random.normal(size=(count, 3)) + np.array([0.0, 0.0, 4.0]),
        load=random.uniform(0.0, 400.0, count),
        moment=random.uniform(-3.0, 3.0, (count, 3)),
        any_direction_moment=random.uniform(0.0, 2.0, count),
        bias_efforts=random.uniform(-3.0, 3.0, (count, 3)),
        gravity=random.normal(size=(count, 3)) - np.array([0.0, 0.0, 6.0]),
        load_direction=random.normal(size=(count, 3)) + np.array([0.0, 0.0, 6.0]),
    )
    steep = np.sum(contact.normal * contact.load_direction, axis=1) <= 0.0
    contact.normal[steep] = contact.load_direction[steep]
    together = evaluate_footholds(LEG, feet, contact)
    for k in range(count):
        alone = evaluate_footholds(LEG, feet[k], Contact(*(field[k] for field in contact)))
        for name in ("verdict", "limiting_joint"):
            assert getattr(alone, name) == getattr(together, name)[k]
        for name in ("load_capacity", "force", "joint_efforts", "utilisation", "friction_margin"):
            np.testing.assert_allclose(
                getattr(alone, name), getattr(together, name)[k], rtol=1e-12, atol=1e-12
            )


@pytest.mark.parametrize(
    "contact",
    [
        Contact(friction=[0.4, -0.1]),
        Contact(friction=0.4, normal=[[0.0, 0.0, 1.0], [0.0, 0.0, 0.0]]),
        Contact(friction=0.4, load=[1.0, np.nan]),
        Contact(friction=0.4, any_direction_moment=[0.0, np.inf]),
        Contact(friction=0.4, moment=[[0.0] * 3, [0.0, np.nan, 0.0]]),
    ],
)
def test_one_wrong_contact_among_many_is_told_even_where_the_foot_cannot_reach(contact):
    far = np.array([[9.0, 9.0, 9.0], [9.0, 9.0, 9.0]])
    with pytest.raises(ValueRangeError):
        evaluate_footholds(LEG, far, contact)
