# SPDX-License-Identifier: Apache-2.0
"""Claims about the load capacity, checked against independent solvers and exact properties."""

from __future__ import annotations

import math

import clarabel
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy import sparse
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from leg_kinematics.errors import ShapeError, ValueRangeError
from leg_statics.capacity.problem import CapacityStatus, load_capacity

BOUNDED, UNBOUNDED, INFEASIBLE, INVALID_INPUT = CapacityStatus
UP = (0.0, 0.0, 1.0)
LEG = np.array([[0.05, -0.3, 0.2], [0.25, 0.1, 0.3], [-0.35, 0.2, 0.1]])
LIMITS = np.array([100.0, 80.0, 120.0])


# --- independent solvers ------------------------------------------------------------------------


def tangents_of(normal):
    """Two unit vectors perpendicular to a unit normal."""
    _, _, rows = np.linalg.svd(normal[None, :])
    return rows[1:]


def capacity_by_socp(jacobian, lower, upper, mu, normal, vertical, bias):
    """Capacity by an interior-point solver: (status, capacity)."""
    normal, vertical = normal / np.linalg.norm(normal), vertical / np.linalg.norm(vertical)
    frame = np.vstack([tangents_of(normal), normal])
    columns = frame @ jacobian
    size = np.linalg.norm(columns, axis=0)
    rooms = np.concatenate([bias - lower, upper - bias])
    lengths = np.concatenate([size, size])
    planes = np.hstack([columns, -columns]).T
    keep = np.isfinite(rooms) & (lengths > 0.0)
    if np.any(rooms[~keep & np.isfinite(rooms)] < 0.0):
        return INFEASIBLE, math.nan
    planes, rooms = planes[keep] / lengths[keep, None], rooms[keep] / lengths[keep]
    unit = _largest_force_of_one_limit(planes, rooms, mu)
    for _ in range(3):  # the second and third time in units of the optimum
        status, value = _solve_socp(planes, rooms / unit, mu, frame @ vertical)
        if status != BOUNDED or not 0.0 < value < math.inf:
            return status, value * unit
        if 0.1 < value < 10.0:
            break
        unit *= value
    return status, value * unit


def _largest_force_of_one_limit(planes, rooms, mu):
    """An upper bound of the capacity, to scale the problem with, or the size of the rooms."""
    slope = np.hypot(planes[:, 0], planes[:, 1])
    least = planes[:, 2] - np.where(slope > 0.0, mu, 0.0) * slope
    bounds = rooms[(least > 0.0) & (rooms > 0.0)] / least[(least > 0.0) & (rooms > 0.0)]
    return bounds.min(initial=np.abs(rooms).max(initial=0.0)) or 1.0


def _solve_socp(planes, rooms, mu, objective):
    """Maximise the load of a force in the cone: (status, value)."""
    if mu == math.inf:
        cone, rows = [clarabel.NonnegativeConeT(1)], np.array([[0.0, 0.0, -1.0]])
    elif mu == 0.0:
        cone = [clarabel.NonnegativeConeT(1), clarabel.ZeroConeT(2)]
        rows = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    else:
        cone = [clarabel.SecondOrderConeT(3)]
        rows = -np.array([[0.0, 0.0, 1.0], [1.0 / mu, 0.0, 0.0], [0.0, 1.0 / mu, 0.0]])
    weights = 1.0 / np.maximum(np.abs(rooms), 1e-3)
    return clarabel_maximum(objective, planes * weights[:, None], rooms * weights, rows, cone)


def clarabel_maximum(objective, planes, rooms, cone_rows, cone):
    """Maximise objective·z subject to planes z <= rooms, -cone_rows z in the cone."""
    options = clarabel.DefaultSettings()
    options.verbose = False
    options.max_iter = 500
    options.tol_gap_abs = options.tol_gap_rel = options.tol_feas = 1e-11
    options.tol_infeas_abs = options.tol_infeas_rel = 1e-12
    solution = clarabel.DefaultSolver(
        sparse.csc_matrix((3, 3)),
        -np.asarray(objective),
        sparse.csc_matrix(np.vstack([planes, cone_rows])),
        np.concatenate([rooms, np.zeros(len(cone_rows))]),
        [clarabel.NonnegativeConeT(len(rooms)), *cone],
        options,
    ).solve()
    name = str(solution.status)
    if name in ("Solved", "AlmostSolved"):
        return BOUNDED, -solution.obj_val
    if "DualInfeasible" in name:
        return UNBOUNDED, math.inf
    if "PrimalInfeasible" in name:
        return INFEASIBLE, math.nan
    return None, -solution.obj_val


def capacity_by_socp_in_efforts(jacobian, lower, upper, mu, normal, vertical, bias):
    """The same for an invertible, ill-conditioned J, with efforts as unknowns: F = J^-T e."""
    normal, vertical = normal / np.linalg.norm(normal), vertical / np.linalg.norm(vertical)
    up, down = bias - lower, upper - bias
    forces = np.vstack([tangents_of(normal) / mu, normal, vertical]) @ np.linalg.inv(jacobian).T
    forces = forces * np.maximum(up, down)
    unit = np.abs(forces[3]).max()
    wide = np.maximum(up, down)
    status, value = clarabel_maximum(
        forces[3] / unit,
        np.vstack([np.eye(3), -np.eye(3)]),
        np.concatenate([up / wide, down / wide]),
        -forces[[2, 0, 1]] / np.abs(forces).max(),
        [clarabel.SecondOrderConeT(3)],
    )
    return status, value * unit


def reference_capacity(jacobian, lower, upper, mu, normal, vertical, bias):
    """The more accurate of the two formulations: in efforts where the structure carries most."""
    status, value = capacity_by_socp(jacobian, lower, upper, mu, normal, vertical, bias)
    direct = np.min((upper - lower) / np.linalg.norm(jacobian, axis=0))
    square = jacobian.shape == (3, 3) and np.linalg.matrix_rank(jacobian) == 3
    hard = status is None or (status == BOUNDED and value > 100.0 * direct)
    if hard and square and mu > 0.0:
        return capacity_by_socp_in_efforts(jacobian, lower, upper, mu, normal, vertical, bias)
    if status == BOUNDED and value < -1e-9 * direct:
        return INFEASIBLE, math.nan  # forces push the foot downhill only
    return status, value


def random_case(rng, kind):
    """A random Jacobian with limits, friction, normal, direction of the load and bias."""
    n = rng.choice([1, 2, 3, 3, 3, 4, 6]) if kind in ("plain", "bias", "powerless") else 3
    jacobian = rng.normal(size=(3, n))
    if kind == "ill-conditioned":
        u, _, v = np.linalg.svd(jacobian)
        small = 10.0 ** np.sort(rng.uniform(-7.0, 0.0, 2))[::-1]
        jacobian = u @ np.diag([1.0, *small]) @ v
    elif kind.startswith("rank"):
        rank = int(kind[-1])
        jacobian = rng.normal(size=(3, rank)) @ rng.normal(size=(rank, 3))
    upper = 10.0 ** rng.uniform(-1.0, 1.0, n)
    lower = -upper if rng.random() < 0.5 else -(10.0 ** rng.uniform(-1.0, 1.0, n))
    if kind == "powerless":
        upper[0], lower[0] = 1e-12 * upper[0], 1e-12 * lower[0]
    bias = 3.0 * rng.normal(size=n) if kind == "bias" else np.zeros(n)
    mu = float(rng.choice([0.0, *rng.uniform(0.0, 1.0, 2), rng.uniform(0.0, 10.0), np.inf]))
    normal = np.array(UP) if rng.random() < 0.5 else np.append(0.5 * rng.normal(size=2), 1.0)
    vertical = normal if rng.random() < 0.3 else np.array(UP)
    return jacobian, lower, upper, mu, normal, vertical, bias


def solved(jacobian, lower, upper, mu, normal, vertical, bias):
    """The suite's answer to such a case, or to many."""
    directions = {"normal": normal, "vertical": vertical}
    return load_capacity(jacobian, lower, upper, mu, **directions, bias_efforts=bias)


# --- agreement with independent solvers ---------------------------------------------------------


@pytest.mark.parametrize(
    "kind", ["plain", "bias", "ill-conditioned", "rank 2", "rank 1", "powerless"]
)
def test_capacity_and_status_equal_those_of_an_interior_point_solver(kind):
    rng = np.random.default_rng(7)
    unsolved, outcomes = 0, set()
    for _ in range(300):
        case = random_case(rng, kind)
        status, value = reference_capacity(*case)
        result = solved(*case)
        if status is None:
            unsolved += 1
            continue
        assert result.status == status
        outcomes.add(status)
        if status == BOUNDED:
            assert result.capacity == pytest.approx(value, rel=1e-6)
    assert unsolved <= 3
    assert BOUNDED in outcomes
    assert kind != "bias" or outcomes == {BOUNDED, UNBOUNDED, INFEASIBLE}


def test_without_friction_limit_capacity_equals_a_linear_programme():
    rng = np.random.default_rng(8)
    for _ in range(200):
        jacobian, upper = rng.normal(size=(3, 4)), 10.0 ** rng.uniform(-1.0, 1.0, 4)
        lower = -(10.0 ** rng.uniform(-1.0, 1.0, 4))
        programme = linprog(
            [0.0, 0.0, -1.0],
            A_ub=np.vstack([-jacobian.T, jacobian.T]),
            b_ub=np.concatenate([upper, -lower]),
            bounds=[(None, None), (None, None), (0.0, None)],
            method="highs",
        )
        expected = pytest.approx(-programme.fun, rel=1e-7)
        assert load_capacity(jacobian, lower, upper, np.inf).capacity == expected
        assert load_capacity(jacobian, lower, upper, 1e9).capacity == expected


def test_without_friction_capacity_is_that_of_the_weakest_joint():
    rng = np.random.default_rng(9)
    jacobian, limits = rng.normal(size=(50, 3, 3)), 10.0 ** rng.uniform(-3.0, 6.0, (50, 3))
    alone = limits / np.abs(jacobian[:, 2, :])
    result = load_capacity(jacobian, -limits, limits, 0.0)
    np.testing.assert_allclose(result.capacity, alone.min(axis=-1), rtol=1e-12)
    np.testing.assert_array_equal(result.limiting_joint, alone.argmin(axis=-1))
    np.testing.assert_array_equal(result.force[:, :2], 0.0)


def test_without_friction_limit_three_joints_follow_the_inverse_jacobian():
    rng = np.random.default_rng(10)
    jacobian, limits = rng.normal(size=(50, 3, 3)), 10.0 ** rng.uniform(-1.0, 1.0, (50, 3))
    shares = limits * np.abs(np.linalg.inv(jacobian)[..., :, 2])
    result = load_capacity(jacobian, -limits, limits, np.inf)
    np.testing.assert_allclose(result.capacity, shares.sum(axis=-1), rtol=1e-9)
    np.testing.assert_array_equal(result.limiting_joint, shares.argmax(axis=-1))


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e3])
@pytest.mark.parametrize("effort", [1e-3, 1.0, 1e6])
def test_capacity_scales_with_limits_and_inversely_with_the_jacobian(scale, effort):
    base = load_capacity(LEG, -LIMITS, LIMITS, 0.5)
    result = load_capacity(scale * LEG, -effort * LIMITS, effort * LIMITS, 0.5)
    assert result.capacity == pytest.approx(base.capacity * effort / scale, rel=1e-12)


# --- special poses and joints -------------------------------------------------------------------


def test_structure_alone_carries_when_the_load_passes_through_a_singular_direction():
    jacobian = np.array([[1.0, 0.0, 2.0], [0.0, 1.0, 1.0], [0.0, 0.0, 0.0]])
    result = load_capacity(jacobian, -LIMITS, LIMITS, 0.3)
    assert (result.status, result.capacity, result.limiting_joint) == (UNBOUNDED, np.inf, -1)


def test_singular_direction_outside_the_friction_cone_does_not_carry():
    jacobian = np.array([[1.0, 0.0, 2.0], [0.0, 1.0, 1.0], [1.0, 0.0, 2.0]])  # null: (-1, 0, 1)
    assert load_capacity(jacobian, -LIMITS, LIMITS, 0.99).status == BOUNDED
    assert load_capacity(jacobian, -LIMITS, LIMITS, 1.01).status == UNBOUNDED


def test_powerless_joint_confines_the_force_to_what_does_not_load_it():
    limits = np.array([0.0, 80.0, 120.0])
    result = load_capacity(LEG, -limits, limits, 3.0)
    nearly = np.array([1e-12, 80.0, 120.0])
    tiny = load_capacity(LEG, -nearly, nearly, 3.0)
    assert result.status == BOUNDED
    assert result.capacity > 1.0
    assert result.capacity == pytest.approx(tiny.capacity, rel=1e-9)
    assert LEG[:, 0] @ result.force == pytest.approx(0.0, abs=1e-12)


def test_powerless_joint_that_every_force_loads_leaves_no_capacity():
    result = load_capacity([[0.0], [0.0], [1.0]], [0.0], [0.0], 0.5)
    assert (result.status, result.capacity, result.limiting_joint) == (BOUNDED, 0.0, 0)
    np.testing.assert_array_equal(result.force, 0.0)


def test_bias_beyond_a_limit_is_carried_by_a_load_that_relieves_the_joint():
    jacobian = np.array([[0.0], [0.0], [1.0]])
    result = load_capacity(jacobian, [-1.0], [1.0], 0.5, bias_efforts=[3.0])
    assert (result.status, result.capacity) == (BOUNDED, 4.0)
    assert load_capacity(jacobian, [-1.0], [1.0], 0.5, bias_efforts=[-3.0]).status == INFEASIBLE


def test_bias_beyond_a_limit_that_no_load_relieves_is_infeasible():
    result = load_capacity(np.zeros((3, 1)), [-1.0], [1.0], 0.5, bias_efforts=[3.0])
    assert result.status == INFEASIBLE
    assert np.isnan(result.capacity)
    assert np.all(np.isnan(result.force))


def test_joint_with_infinite_limits_never_limits():
    limits = np.array([np.inf, 80.0, 120.0])
    without = load_capacity(LEG[:, 1:], -LIMITS[1:], LIMITS[1:], 0.3)
    result = load_capacity(LEG, -limits, limits, 0.3)
    assert result.capacity == pytest.approx(without.capacity, rel=1e-12)
    assert result.limiting_joint == without.limiting_joint + 1


def test_level_optimum_has_no_tangential_force():
    jacobian = np.array([[0.0, 0.1, 0.0], [0.0, 0.0, 0.1], [1.0, 0.0, 0.0]])
    result = load_capacity(jacobian, -LIMITS, LIMITS, 0.5)
    np.testing.assert_array_equal(result.force, [0.0, 0.0, 100.0])
    assert not result.friction_limited


def test_friction_limits_exactly_when_more_friction_would_help():
    rng = np.random.default_rng(11)
    jacobian = rng.normal(size=(500, 3, 3))
    result = load_capacity(jacobian, -LIMITS, LIMITS, 0.8)
    more = load_capacity(jacobian, -LIMITS, LIMITS, 0.8 + 1e-3)
    gains = more.capacity > result.capacity * (1.0 + 1e-9)
    np.testing.assert_array_equal(gains, result.friction_limited)
    assert 0.2 < gains.mean() < 0.8


def test_limiting_joint_is_the_one_whose_limit_raises_capacity_most():
    rng = np.random.default_rng(12)
    jacobian = rng.normal(size=(500, 3, 3))
    base = load_capacity(jacobian, -LIMITS, LIMITS, 0.5)
    raised = LIMITS * (1.0 + 1e-6 * np.eye(3))
    gains = load_capacity(jacobian[:, None], -raised, raised, 0.5).capacity
    order = np.sort(gains - base.capacity[:, None], axis=1)
    clear = order[:, 2] > 1.01 * order[:, 1]
    assert clear.mean() > 0.9
    np.testing.assert_array_equal(base.limiting_joint[clear], gains.argmax(axis=1)[clear])


def test_not_finite_elements_spoil_only_their_own_point():
    jacobian = np.stack([LEG, LEG, LEG, LEG])
    jacobian[1, 0, 0], jacobian[2, 2, 1] = np.nan, np.inf
    result = load_capacity(jacobian, -LIMITS, LIMITS, 0.5)
    wanted = [BOUNDED, INVALID_INPUT, INVALID_INPUT, BOUNDED]
    np.testing.assert_array_equal(result.status, wanted)
    np.testing.assert_array_equal(np.isnan(result.capacity), [False, True, True, False])
    bias = [np.nan, 0.0, 0.0]
    assert load_capacity(LEG, -LIMITS, LIMITS, 0.5, bias_efforts=bias).status == INVALID_INPUT


# --- laws ---------------------------------------------------------------------------------------

ordinary = st.floats(-10.0, 10.0).map(lambda x: x if abs(x) > 1e-9 else 0.0)
positive = st.floats(1e-3, 1e3)
matrices = st.integers(1, 5).flatmap(lambda n: hnp.arrays(float, (3, n), elements=ordinary))


@settings(max_examples=300, deadline=None)
@given(matrices, positive, positive, st.floats(0.0, 10.0), ordinary, ordinary)
def test_the_force_is_admissible_and_attains_the_capacity(matrix, down, up, mu, side, bias):
    normal = np.array([side, 1.0, 2.0]) / np.linalg.norm([side, 1.0, 2.0])
    ones = np.ones(matrix.shape[1])
    result = solved(matrix, -down * ones, up * ones, mu, normal, UP, bias)
    if result.status != BOUNDED:
        return
    force = result.force
    rounding = 1e-12 * np.linalg.norm(matrix, axis=0) * np.linalg.norm(force) + 1e-9 * (down + up)
    efforts = bias - matrix.T @ force
    assert np.all(efforts >= -down - rounding)
    assert np.all(efforts <= up + rounding)
    assert force[2] == pytest.approx(result.capacity, rel=1e-12)
    pressed = force @ normal
    tangential = np.linalg.norm(force - pressed * normal)
    assert tangential <= mu * pressed + 1e-12 * np.linalg.norm(force)


@settings(max_examples=300, deadline=None)
@given(
    hnp.arrays(float, (4, 3, 3), elements=st.floats(width=64)),
    hnp.arrays(float, (2, 3), elements=st.floats(0.0, allow_nan=False)),
    st.floats(0.0, allow_nan=False),
    hnp.arrays(float, 3, elements=st.floats(width=64)),
)
def test_any_numbers_give_a_named_outcome_and_never_an_exception(jacobian, limits, mu, bias):
    lower, upper = -np.minimum(limits[0], 1e308), np.minimum(limits[1], 1e308)
    result = load_capacity(jacobian, lower, upper, mu, bias_efforts=bias)
    bounded = result.status == BOUNDED
    assert np.all(np.isfinite(result.capacity[bounded]))
    assert np.all(np.isfinite(result.force[bounded]))
    assert np.all(result.capacity[result.status == UNBOUNDED] == np.inf)
    assert np.all(np.isnan(result.capacity[result.status >= INFEASIBLE]))
    assert np.all((result.limiting_joint >= 0) == bounded)
    invalid = ~(np.isfinite(jacobian).all(axis=(1, 2)) & np.isfinite(bias).all())
    np.testing.assert_array_equal(result.status == INVALID_INPUT, invalid)


def test_capacity_grows_with_friction_and_with_every_limit():
    rng = np.random.default_rng(13)
    jacobian = rng.normal(size=(300, 3, 3))
    friction = np.linspace(0.0, 3.0, 31)
    by_friction = load_capacity(jacobian[:, None], -LIMITS, LIMITS, friction).capacity
    assert np.all(np.diff(by_friction, axis=1) >= -1e-9 * by_friction[:, 1:])
    for joint in range(3):
        more = LIMITS + 20.0 * np.eye(3)[joint]
        assert np.all(
            load_capacity(jacobian, -LIMITS, more, 0.6).capacity
            >= load_capacity(jacobian, -LIMITS, LIMITS, 0.6).capacity * (1.0 - 1e-12)
        )


@pytest.mark.parametrize("friction", [0.6, 2.5, np.inf])
def test_turning_leg_ground_and_gravity_together_changes_nothing(friction):
    rng = np.random.default_rng(14)
    turn = Rotation.random(200, rng=rng).as_matrix()
    jacobian = rng.normal(size=(200, 3, 3))
    normal = np.append(rng.normal(size=2), 1.0)
    straight = load_capacity(jacobian, -LIMITS, LIMITS, friction, normal=normal)
    turned = load_capacity(
        turn @ jacobian, -LIMITS, LIMITS, friction, normal=turn @ normal, vertical=turn @ UP
    )
    np.testing.assert_allclose(turned.capacity, straight.capacity, rtol=1e-9)
    aligned = np.einsum("kij,kj->ki", turn, straight.force)
    np.testing.assert_allclose(turned.force, aligned, rtol=1e-6, atol=1e-6)


def test_directions_of_any_length_and_straight_down_are_directions():
    down = load_capacity(
        -LEG, -LIMITS, LIMITS, 0.6, normal=(0.0, 0.0, -7.0), vertical=(0.0, 0.0, -0.1)
    )
    up = load_capacity(LEG, -LIMITS, LIMITS, 0.6)
    assert down.capacity == pytest.approx(up.capacity, rel=1e-12)
    np.testing.assert_allclose(down.force, -up.force, rtol=1e-12)


@pytest.mark.parametrize("degrees", [5.0, 40.0, 55.0, 80.0])
def test_on_a_slope_that_holds_no_force_but_one_the_load_is_its_vertical_part(degrees):
    """A smooth slope pushes along its normal only, however steep: a joint that holds it tells."""
    normal = np.array([0.0, -np.sin(np.radians(degrees)), np.cos(np.radians(degrees))])
    pressed = 50.0
    result = load_capacity(normal[:, None], [-pressed], [pressed], 0.0, normal=normal)
    assert result.capacity == pytest.approx(pressed * normal[2], rel=1e-12)
    np.testing.assert_allclose(result.force, pressed * normal, rtol=1e-12)


def test_the_load_of_a_steep_slope_is_found_though_its_cone_reaches_below_the_horizon():
    rng = np.random.default_rng(16)
    for _ in range(200):
        slope, mu = rng.uniform(0.5, 1.4), rng.uniform(0.7, 5.0)
        normal = np.array([np.sin(slope), 0.0, np.cos(slope)])
        if slope + np.arctan(mu) < 0.5 * np.pi:
            continue
        jacobian, limits = rng.normal(size=(3, 3)), 10.0 ** rng.uniform(-1.0, 1.0, 3)
        case = jacobian, -limits, limits, mu, normal, np.array(UP), np.zeros(3)
        assert solved(*case).capacity == pytest.approx(reference_capacity(*case)[1], rel=1e-6)


# --- shapes and misuse --------------------------------------------------------------------------


def test_a_batch_equals_a_loop_over_single_points():
    rng = np.random.default_rng(15)
    cases = [random_case(rng, "bias") for _ in range(300)]
    cases = [case for case in cases if case[0].shape[1] == 3]
    batch = [np.stack([np.asarray(case[k]) for case in cases]) for k in range(7)]
    together = solved(*batch)
    for k, case in enumerate(cases):
        single = solved(*case)
        for name, value in single._asdict().items():
            np.testing.assert_array_equal(getattr(together, name)[k], value)


def test_leading_axes_broadcast():
    result = load_capacity(
        np.broadcast_to(LEG, (4, 1, 3, 3)), -LIMITS, LIMITS, np.linspace(0.1, 0.9, 5)
    )
    assert result.capacity.shape == result.status.shape == (4, 5)
    assert result.force.shape == (4, 5, 3)
    assert load_capacity(np.zeros((0, 3, 3)), -LIMITS, LIMITS, 0.5).capacity.shape == (0,)


@pytest.mark.parametrize(
    ("error", "name", "change"),
    [
        (ShapeError, "jacobian", {"jacobian": np.zeros((2, 3))}),
        (ShapeError, "jacobian", {"jacobian": np.zeros(3)}),
        (ShapeError, "jacobian", {"jacobian": np.zeros((3, 0))}),
        (ShapeError, "effort_lower", {"effort_lower": [-1.0, -1.0]}),
        (ShapeError, "effort_upper", {"effort_upper": "strong"}),
        (ShapeError, "friction", {"jacobian": np.zeros((2, 3, 3)), "friction": [0.1, 0.2, 0.3]}),
        (ShapeError, "bias_efforts", {"bias_efforts": [0.0, 0.0]}),
        (ShapeError, "normal", {"normal": [0.0, 1.0]}),
        (ValueRangeError, "friction", {"friction": -0.1}),
        (ValueRangeError, "friction", {"friction": np.nan}),
        (ValueRangeError, "normal", {"normal": [0.0, 0.0, 0.0]}),
        (ValueRangeError, "normal", {"normal": [0.0, np.nan, 1.0]}),
        (ValueRangeError, "normal must point out", {"normal": [0.1, 0.0, -1.0]}),
        (ValueRangeError, "normal must point out", {"vertical": [0.0, 0.0, -1.0]}),
        (ValueRangeError, "vertical", {"vertical": [0.0, 0.0, 0.0]}),
        (ValueRangeError, "effort_lower", {"effort_lower": [-1.0, np.nan, -1.0]}),
        (ValueRangeError, "effort_upper", {"effort_upper": [1.0, -np.inf, 1.0]}),
        (ValueRangeError, "effort_lower", {"effort_lower": [-1.0, 90.0, -1.0]}),
    ],
)
def test_misuse_raises_an_error_that_names_the_field(error, name, change):
    arguments = {
        "jacobian": LEG,
        "effort_lower": -LIMITS,
        "effort_upper": LIMITS,
        "friction": 0.5,
    } | change
    with pytest.raises(error, match=name):
        load_capacity(**arguments)
