# SPDX-License-Identifier: Apache-2.0
"""What the protocol promises, of every registered mechanism and of its mirror image."""

from __future__ import annotations

import importlib
import math
import pickle
import re
from dataclasses import FrozenInstanceError, dataclass, fields, replace
from typing import ClassVar

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from mechanism_zoo import (
    ALL,
    PLAIN,
    chosen,
    joint_distance,
    ok_postures,
    random_joints,
    varied,
    without_limits,
)

from leg_kinematics import (
    MECHANISMS,
    GeometryError,
    Joint,
    Linkage,
    Mechanism,
    Mirrored,
    NotSupportedError,
    Posture,
    ShapeError,
    Status,
    UnknownNameError,
)
from leg_kinematics.arrays import as_array
from leg_kinematics.geometry import Dimensioned, geometry_parameters, parameter
from leg_kinematics.mirrored import VECTOR

# Three points of the foot's body that are not in line, or of the plane that it keeps to.
FOOT_BODY = {
    "parallel_drive": ("R2", "C", "R1"),
    "double_rhombus": ("I", "O", "F"),
    "six_bar": ("C", "F", "G"),
    "theo_jansen": ("C", "F", "G"),
    "gantry_hybrid": ("O''", "C'", "B'"),
    "model": ("knee", "foot", "thigh"),
}
# Names in the kernels' geometry that are not the papers' symbols, by these.
ALIASES = {
    "six_bar": {"l_AB": "crank", "alpha_0": "zero", "-": "tolerance"},
    "theo_jansen": {"m": "crank", "alpha_0": "zero", "-": "tolerance"},
}
ABILITIES = (Mechanism.acceleration, Mechanism.constraint_jacobian, Mechanism.planar_jacobian)

mechanisms = pytest.mark.parametrize("mechanism", ALL.values(), ids=ALL)
plain_mechanisms = pytest.mark.parametrize("mechanism", PLAIN.values(), ids=PLAIN)
kinds = pytest.mark.parametrize("kind", MECHANISMS.values(), ids=MECHANISMS)


def assert_same_posture(one, other):
    for values, wanted in zip(one, other, strict=True):
        np.testing.assert_array_equal(values, wanted)


def gentle(mechanism, posture, limit=50.0):
    """Postures whose Jacobians are moderate, where finite differences keep their digits."""
    size = np.abs(mechanism.twist_jacobian(posture)).max(axis=(-2, -1))
    size /= np.median(size)
    return chosen(posture, size < limit)


# --------------------------------------------------------------------------- what it is


@mechanisms
def test_names_units_and_limits_fit_each_other(mechanism):
    names = [joint.name for joint in (*mechanism.joints, *mechanism.passive_joints)]
    assert len(set(names)) == len(names)
    excursions = [excursion.name for excursion in mechanism.excursions]
    assert len(set(excursions)) == len(excursions)
    assert len(set(mechanism.assembly_modes)) == len(mechanism.assembly_modes) > 0
    assert mechanism.joint_limits.shape == (len(mechanism.joints), 2)
    assert mechanism.passive_joint_limits.shape == (len(excursions), 2)
    assert len(mechanism.task_units) == len(mechanism.task_coordinates)
    assert mechanism.has_point_foot == (mechanism.task_coordinates == ("x", "y", "z"))
    assert {joint.unit for joint in mechanism.joints} <= {"rad", "m"}
    posture = mechanism.initial_posture
    assert posture.status == Status.OK
    assert posture.joint_positions.shape == (len(mechanism.joints),)
    assert posture.closure.shape == (len(mechanism.closure_names),)
    assert posture.foot_position.shape == (len(mechanism.task_coordinates),)


@mechanisms
def test_it_is_immutable_hashable_and_equal_to_its_like(mechanism):
    field = fields(mechanism)[0].name
    with pytest.raises(FrozenInstanceError):
        setattr(mechanism, field, getattr(mechanism, field))
    twin = replace(mechanism)
    assert twin == mechanism
    assert hash(twin) == hash(mechanism)
    assert {mechanism: 1}[twin] == 1


@mechanisms
def test_a_pickled_mechanism_gives_the_same_answers(mechanism):
    q = random_joints(mechanism, 20)
    mechanism.inverse(mechanism.forward(q).foot_position)  # fills what it keeps between calls
    twin = pickle.loads(pickle.dumps(mechanism))
    assert twin == mechanism
    assert_same_posture(twin.forward(q), mechanism.forward(q))


@kinds
def test_the_geometry_of_the_kernels_has_the_order_of_the_fields(kind):
    """Kernels take the parameters by position: their names must be the fields' symbols."""
    geometry = importlib.import_module(kind.__module__).Geometry

    def plain(symbol):
        return re.sub(r"[^a-z0-9]", "", symbol.replace("'", "prime").lower())

    aliases = ALIASES.get(kind.name, {})
    for f, name in zip(geometry_parameters(kind), geometry._fields, strict=True):
        symbol = aliases.get(f.metadata["symbol"], f.metadata["symbol"])
        assert plain(name) in (plain(symbol), plain(symbol.removeprefix("l_")))


@pytest.mark.parametrize("twice", [replace, lambda m: pickle.loads(pickle.dumps(m))])
def test_a_mirror_image_twice_is_no_mechanism_of_its_own(twice):
    mirrored = ALL["parallel_drive mirrored"]
    assert twice(mirrored).original == PLAIN["parallel_drive"]
    assert mirrored != PLAIN["parallel_drive"]


def test_the_mirror_image_decides_about_every_member():
    members = {name for name in vars(Mechanism) if not name.startswith("_")}
    inherited = {
        *("task_coordinates", "task_units", "has_point_foot", "mode_index"),
        "tree_positions",  # made of members that decide
    }
    assert members - set(vars(Mirrored)) == inherited


@pytest.mark.parametrize("name", [n for n, m in PLAIN.items() if m.has_point_foot])
def test_the_mirror_image_is_one(name):
    """What moves there moves here as in a mirror; turning goes the other way about its axes."""
    there, here = PLAIN[name], ALL[f"{name} mirrored"]
    posture, image = (m.forward(random_joints(there, 500, beyond=0.1)) for m in (there, here))
    np.testing.assert_array_equal(image.foot_position, posture.foot_position * VECTOR)
    np.testing.assert_array_equal(image.status, posture.status)
    np.testing.assert_array_equal(
        here.inverse(posture.foot_position * VECTOR).joint_positions,
        there.inverse(posture.foot_position).joint_positions,
    )
    np.testing.assert_array_equal(
        here.linkage(image).points, there.linkage(posture).points * VECTOR
    )
    # the velocity of a point of the foot's body is that of the mirrored point
    arm = np.array([0.1, -0.2, 0.3])
    v, v_image = (
        m.jacobian(p) + np.cross(m.angular_jacobian(p), a, axisa=-2, axisc=-2)
        for m, p, a in ((there, posture, arm), (here, image, arm * VECTOR))
    )
    np.testing.assert_allclose(v_image, v * VECTOR[:, None], rtol=1e-12, atol=1e-12)


def test_the_mirror_image_refuses_what_it_does_not_reflect():
    assert PLAIN["six_bar"].crank_length > 0.0
    with pytest.raises(AttributeError):
        _ = ALL["six_bar mirrored"].crank_length
    for mechanism in PLAIN.values():
        if not mechanism.has_point_foot:
            with pytest.raises(NotSupportedError, match=f"{mechanism.name}.* no point foot"):
                Mirrored(mechanism)


# --------------------------------------------------------------------------- the least mechanism


@dataclass(frozen=True)
class Slide(Dimensioned):
    """A foot on a slide along z: an open chain, made of what is abstract alone."""

    name: ClassVar[str] = "slide"
    joints: ClassVar[tuple[Joint, ...]] = (Joint("slide", "prismatic"),)
    passive_joints: ClassVar[tuple[Joint, ...]] = ()
    closure_names: ClassVar[tuple[str, ...]] = ()
    assembly_modes: ClassVar[tuple[str, ...]] = ("only",)

    height: float = parameter("height of the foot at zero", "h", "length", 0.5)
    joint_ranges: tuple[tuple[float, float], ...] = ((-0.1, 0.1),)
    passive_joint_ranges: tuple[tuple[float, float], ...] = ()

    def __post_init__(self):
        self.check_fields()

    @property
    def initial_posture(self):
        return self.forward([0.0])

    def forward(self, joint_positions, assembly_mode=""):
        self.mode_index(assembly_mode)
        q = as_array("joint_positions", joint_positions, 1)
        foot = np.concatenate([0 * q, 0 * q, q - self.height], axis=-1)
        return Posture(q, q[..., :0], foot, np.zeros(q.shape[:-1], np.uint8))

    def inverse(self, foot_position, assembly_mode=""):
        return self.forward(as_array("foot_position", foot_position, 3)[..., 2:] + self.height)

    def jacobian(self, posture):
        return np.broadcast_to([[0.0], [0.0], [1.0]], (*posture.status.shape, 3, 1))

    def angular_jacobian(self, posture):
        return np.zeros((*posture.status.shape, 3, 1))

    def passive_joint_positions(self, posture):
        return posture.closure

    def linkage(self, posture):
        return Linkage(("foot",), posture.foot_position[..., None, :], ((0,),))


def test_what_is_abstract_suffices():
    slide = Slide()
    posture, twist = slide.forward_with_twist(np.zeros((2, 1)))
    np.testing.assert_array_equal(twist, [[[0], [0], [1], [0], [0], [0]]] * 2)
    np.testing.assert_array_equal(slide.inverse_with_twist([0, 0, -0.5])[1], twist[0])
    assert slide.has_point_foot
    assert slide.task_units == ("m", "m", "m")
    assert slide.excursions == ()
    assert slide.passive_joint_limits.shape == (0, 2)
    assert slide.passive_joint_excursions(posture).shape == (2, 0)
    assert Mirrored(slide).forward([0.05]).foot_position[2] == -0.45


def test_a_mechanism_that_lacks_something_cannot_be_made():
    class Lacking(Slide):
        jacobian = Mechanism.jacobian

    with pytest.raises(TypeError, match="jacobian"):
        Lacking()


def test_abilities_that_a_mechanism_lacks_are_told_with_its_name():
    for mechanism in (Slide(), Mirrored(Slide())):
        posture = mechanism.initial_posture
        assert not any(mechanism.offers(ability) for ability in ABILITIES)
        for ask in (
            lambda m, p: m.acceleration(p, [0.0], [0.0]),
            lambda m, p: m.constraint_jacobian(p),
            lambda m, p: m.planar_jacobian(p),
        ):
            with pytest.raises(NotSupportedError, match="slide"):
                ask(mechanism, posture)


# --------------------------------------------------------------------------- position


def assert_both_ways(mechanism, q, mode="", tolerance=1e-6):
    """Forward OK <=> inverse OK with the same posture, wherever there is a foot."""
    forward = mechanism.forward(q, mode)
    solved = np.isfinite(forward.foot_position).all(axis=-1)
    forward, q = chosen(forward, solved), q[solved]
    inverse = mechanism.inverse(forward.foot_position, mode)
    same = joint_distance(mechanism, inverse.joint_positions, q) < tolerance
    there = forward.status == Status.OK
    np.testing.assert_array_equal((inverse.status == Status.OK) & same, there)
    np.testing.assert_allclose(
        inverse.foot_position[there], forward.foot_position[there], rtol=0, atol=1e-8
    )
    return np.count_nonzero(there)


@mechanisms
def test_forward_is_ok_where_inverse_is_with_the_same_posture(mechanism):
    assert assert_both_ways(mechanism, random_joints(mechanism, 20_000, beyond=0.1)) > 500


@kinds
def test_so_it_is_with_other_dimensions(kind):
    for mechanism in varied(kind, 12):
        assert_both_ways(mechanism, random_joints(mechanism, 1500, beyond=0.1))


@mechanisms
def test_so_it_is_in_every_mode(mechanism):
    free = without_limits(mechanism)
    q = random_joints(mechanism, 1500, beyond=0.5)
    found = [assert_both_ways(free, q, mode, 1e-5) for mode in free.assembly_modes]
    assert found[0] > 50


@mechanisms
def test_forward_undoes_inverse(mechanism):
    reached = ok_postures(mechanism, 1000)
    low, high = reached.foot_position.min(axis=0), reached.foot_position.max(axis=0)
    feet = np.random.default_rng(3).uniform(low, high, (20_000, len(low)))
    # a foot with fewer joints than coordinates stays on a curve
    feet = feet if len(mechanism.joints) >= len(low) else reached.foot_position
    inverse = mechanism.inverse(feet)
    inverse = chosen(inverse, inverse.status == Status.OK)
    assert len(inverse.status) > 500
    forward = mechanism.forward(inverse.joint_positions)
    np.testing.assert_array_equal(forward.status, Status.OK)
    np.testing.assert_allclose(forward.foot_position, inverse.foot_position, rtol=0, atol=1e-9)


@mechanisms
def test_modes_have_names_and_the_first_is_the_default(mechanism):
    foot = mechanism.initial_posture.foot_position
    first = mechanism.assembly_modes[0]
    assert_same_posture(mechanism.inverse(foot), mechanism.inverse(foot, first))
    q = mechanism.initial_posture.joint_positions
    assert_same_posture(mechanism.forward(q), mechanism.forward(q, first))
    for solve in (lambda mode: mechanism.inverse(foot, mode), lambda m: mechanism.forward(q, m)):
        with pytest.raises(UnknownNameError, match=first):
            solve("upside down")


# --------------------------------------------------------------------------- velocity


def differences(function, q, step):
    """Return derivatives by each joint (..., n) of a function of joint positions, 4th order."""
    columns = []
    for dq in step * np.eye(q.shape[-1]):
        f = [function(q + k * dq) for k in (-2, -1, 1, 2)]
        columns.append((f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * step))
    return np.stack(columns, axis=-1)


def assert_mostly_close(values, wanted, scale, tolerance=1e-6):
    """Derivatives agree where the differences exist, which a limit or singularity may prevent."""
    error = np.abs(values - wanted).reshape(len(values), -1).max(axis=-1) / scale
    known = np.isfinite(error)
    assert known.mean() > 0.95
    assert error[known].max() < tolerance


@mechanisms
def test_jacobian_is_the_derivative_of_the_foot(mechanism):
    posture = gentle(mechanism, ok_postures(mechanism, 800))
    jacobian = mechanism.jacobian(posture)
    wanted = differences(
        lambda q: mechanism.forward(q).foot_position, posture.joint_positions, 1e-5
    )
    scale = np.maximum(1.0, np.abs(jacobian).max(axis=(-2, -1)))
    assert_mostly_close(jacobian, wanted, scale**5)


def body_rotation(mechanism, posture):
    """Return the rotation (..., 3, 3) of a frame that is fixed in the foot's body."""
    linkage = mechanism.linkage(posture)
    a, b, c = (linkage.points[..., linkage.names.index(n), :] for n in FOOT_BODY[mechanism.name])
    x, normal = b - a, np.cross(b - a, c - a)
    x, normal = (v / np.linalg.norm(v, axis=-1, keepdims=True) for v in (x, normal))
    return np.stack([x, np.cross(normal, x), normal], axis=-1)


@mechanisms
def test_angular_jacobian_is_the_turning_of_the_foots_body(mechanism):
    posture = gentle(mechanism, ok_postures(mechanism, 800))
    jacobian = mechanism.angular_jacobian(posture)
    rates = differences(
        lambda q: body_rotation(mechanism, mechanism.forward(q)), posture.joint_positions, 1e-5
    )
    skew = np.einsum("nijk,nlj->nilk", rates, body_rotation(mechanism, posture))
    omega = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)
    scale = np.maximum(1.0, np.abs(mechanism.twist_jacobian(posture)).max(axis=(-2, -1)))
    assert_mostly_close(jacobian, omega, scale**5)


@mechanisms
def test_power_at_the_joints_is_power_at_the_foot(mechanism):
    """Work of a force on a small way of the foot, by the efforts that J^T tells."""
    posture = gentle(mechanism, ok_postures(mechanism, 800))
    rng = np.random.default_rng(5)
    force = rng.normal(size=posture.foot_position.shape)
    rates = rng.normal(size=posture.joint_positions.shape)
    effort = np.einsum("nij,ni->nj", mechanism.jacobian(posture), force)
    way = 1e-6 * rates
    ends = [mechanism.forward(posture.joint_positions + k * way).foot_position for k in (-1, 1)]
    work = 0.5e6 * np.sum(force * (ends[1] - ends[0]), axis=-1)
    power = np.sum(effort * rates, axis=-1)
    scale = np.maximum(1.0, np.abs(mechanism.jacobian(posture)).max(axis=(-2, -1)))
    assert_mostly_close(power, work, scale**4, 1e-5)


@mechanisms
def test_twists_are_both_jacobians_and_one_pass_equals_its_parts(mechanism):
    q = random_joints(mechanism, 300, beyond=0.2)
    q[7] = np.nan
    for mode in mechanism.assembly_modes:
        posture, twist = mechanism.forward_with_twist(q, mode)
        wanted = mechanism.forward(q, mode)
        assert_same_posture(posture, wanted)
        parts = [mechanism.jacobian(wanted), mechanism.angular_jacobian(wanted)]
        np.testing.assert_array_equal(
            mechanism.twist_jacobian(wanted), np.concatenate(parts, axis=-2)
        )
        assert_same_twist(twist, mechanism.twist_jacobian(wanted), wanted.status)
        foot = posture.foot_position
        posture, twist = mechanism.inverse_with_twist(foot, mode)
        wanted = mechanism.inverse(foot, mode)
        assert_same_posture(posture, wanted)
        assert_same_twist(twist, mechanism.twist_jacobian(wanted), wanted.status)


def assert_same_twist(twist, wanted, status):
    """One may come from the sines of a pose, the other from its angles."""
    known = np.isin(status, (Status.OK, Status.JOINT_LIMIT, Status.PASSIVE_JOINT_LIMIT))
    size = np.abs(twist[known]).max(axis=(-2, -1), keepdims=True, initial=1.0)
    np.testing.assert_allclose(twist[known] / size, wanted[known] / size, rtol=0, atol=1e-9)


@mechanisms
def test_acceleration_is_the_second_derivative_of_the_foot(mechanism):
    posture = ok_postures(mechanism, 400)
    rng = np.random.default_rng(6)
    rates = rng.uniform(-0.1, 0.1, posture.joint_positions.shape)
    changes = rng.uniform(-1.0, 1.0, posture.joint_positions.shape)
    if not mechanism.offers(Mechanism.acceleration):
        with pytest.raises(NotSupportedError, match=mechanism.name):
            mechanism.acceleration(posture, rates, changes)
        return
    posture = gentle(mechanism, posture, 5.0)
    rates, changes = rates[: len(posture.status)], changes[: len(posture.status)]
    step = 1e-3

    def foot(t):
        q = posture.joint_positions + rates * t + 0.5 * changes * t**2
        return mechanism.forward(q).foot_position

    f = [foot(k * step) for k in (-2, -1, 0, 1, 2)]
    wanted = (-f[0] + 16 * f[1] - 30 * f[2] + 16 * f[3] - f[4]) / (12 * step**2)
    found = mechanism.acceleration(posture, rates, changes)
    error = np.abs(found - wanted).max(axis=-1) / np.maximum(1.0, np.abs(found).max(axis=-1))
    assert np.nanmax(error) < 1e-3
    assert np.nanmedian(error) < 1e-7


# --------------------------------------------------------------------------- status and limits


@mechanisms
def test_only_solved_points_have_numbers(mechanism):
    q = random_joints(mechanism, 4000, beyond=1.5)
    q[:3, 0] = [np.nan, np.inf, -np.inf]
    foot = mechanism.forward(q).foot_position
    feet = np.where(np.isfinite(foot), foot, 0.1) * np.random.default_rng(4).uniform(
        0.3, 2.0, (len(q), 1)
    )
    feet[:2, 1] = [np.nan, np.inf]
    solved = (Status.OK, Status.JOINT_LIMIT, Status.PASSIVE_JOINT_LIMIT)
    for posture in (mechanism.forward(q), mechanism.inverse(feet)):
        values = np.concatenate([posture.foot_position, posture.closure], axis=-1)
        values = np.concatenate([values, posture.joint_positions], axis=-1)
        assert np.isfinite(values[np.isin(posture.status, solved)]).all()
        none = np.isin(posture.status, (Status.UNREACHABLE, Status.INVALID_INPUT))
        assert none.any()
        assert np.isnan(posture.closure[none]).all()
        for unknown in (mechanism.jacobian, mechanism.angular_jacobian):
            assert np.isnan(unknown(posture)[none]).any(axis=(-2, -1)).all()
        passive = mechanism.passive_joint_positions(posture)
        assert np.isfinite(passive[np.isin(posture.status, solved)]).all()
    np.testing.assert_array_equal(
        mechanism.forward(q).status == Status.INVALID_INPUT, ~np.isfinite(q).all(axis=-1)
    )
    np.testing.assert_array_equal(
        mechanism.inverse(feet).status == Status.INVALID_INPUT, ~np.isfinite(feet).all(axis=-1)
    )


@plain_mechanisms
def test_a_posture_on_a_joint_limit_is_ok_and_one_beyond_is_not(mechanism):
    free = without_limits(mechanism)
    q = ok_postures(mechanism, 20).joint_positions
    for k in range(len(mechanism.joints)):
        for end in (0, 1):
            ranges = list(free.joint_ranges)
            ranges[k] = (q[0, k], q[0, k] + 0.01) if end == 0 else (q[0, k] - 0.01, q[0, k])
            limited = replace(free, joint_ranges=tuple(ranges))
            at = limited.forward(q[0])
            assert at.status == Status.OK
            assert limited.inverse(at.foot_position).status == Status.OK
            step = np.zeros(len(mechanism.joints))
            step[k] = (-1e-6, 1e-6)[end]
            beyond = limited.forward(q[0] + step)
            assert beyond.status == Status.JOINT_LIMIT
            assert np.isfinite(beyond.foot_position).all()
            assert limited.inverse(beyond.foot_position).status == Status.JOINT_LIMIT


@plain_mechanisms
def test_each_excursion_limits_the_workspace(mechanism):
    free = without_limits(mechanism)
    posture = free.forward(random_joints(mechanism, 3000))
    posture = chosen(posture, posture.status == Status.OK)
    excursions = np.abs(free.passive_joint_excursions(posture))
    for k, excursion in enumerate(mechanism.excursions):
        reach = np.median(excursions[:, k])
        ranges = list(free.passive_joint_ranges)
        ranges[k] = (-reach, reach)
        limited = replace(free, passive_joint_ranges=tuple(ranges))
        wanted = np.where(excursions[:, k] > reach, Status.PASSIVE_JOINT_LIMIT, Status.OK)
        off = np.abs(excursions[:, k] - reach) > 2e-9
        solved = limited.forward(posture.joint_positions)
        np.testing.assert_array_equal(solved.status[off], wanted[off], excursion.name)
        solved = limited.inverse(posture.foot_position)
        # the foot may come by there in another posture, which keeps the limits
        other = joint_distance(mechanism, solved.joint_positions, posture.joint_positions) > 1e-6
        other &= wanted == Status.PASSIVE_JOINT_LIMIT
        expected = np.where(other, Status.OK, wanted)
        np.testing.assert_array_equal(solved.status[off], expected[off], excursion.name)
        assert np.mean(other) < 0.1


@mechanisms
def test_joint_limits_are_obeyed(mechanism):
    q = random_joints(mechanism, 5000, beyond=0.1)
    lower, upper = mechanism.joint_limits.T
    endless = [
        joint.type == "revolute" and high - low >= 2.0 * math.pi - 1e-9
        for joint, low, high in zip(mechanism.joints, lower, upper, strict=True)
    ]
    outside = (((q < lower) | (q > upper)) & ~np.array(endless)).any(axis=-1)
    status = mechanism.forward(q).status
    assert not np.isin(status[outside], (Status.OK, Status.PASSIVE_JOINT_LIMIT)).any()
    assert not (status[~outside] == Status.JOINT_LIMIT).any()


# --------------------------------------------------------------------------- shapes and misuse


@mechanisms
@pytest.mark.parametrize("batch", [(), (0,), (1,), (5,), (2, 3), (2, 1, 3, 1), (2, 0, 3)])
def test_any_leading_axes_come_back(mechanism, batch):
    n, t = len(mechanism.joints), len(mechanism.task_coordinates)
    q = random_joints(mechanism, math.prod(batch)).reshape(*batch, n)
    posture = mechanism.forward(q)
    again, twist = mechanism.inverse_with_twist(posture.foot_position)
    for solved in (posture, again, mechanism.forward_with_twist(q)[0]):
        assert solved.joint_positions.shape == (*batch, n)
        assert solved.closure.shape == (*batch, len(mechanism.closure_names))
        assert solved.foot_position.shape == (*batch, t)
        assert solved.status.shape == batch
        assert solved.status.dtype == np.uint8
    assert twist.shape == mechanism.twist_jacobian(posture).shape == (*batch, t + 3, n)
    assert mechanism.jacobian(posture).shape == (*batch, t, n)
    assert mechanism.angular_jacobian(posture).shape == (*batch, 3, n)
    passive = mechanism.passive_joint_positions(posture)
    assert passive.shape == (*batch, len(mechanism.passive_joints))
    excursions = mechanism.passive_joint_excursions(posture)
    assert excursions.shape == (*batch, len(mechanism.excursions))
    linkage = mechanism.linkage(posture)
    assert linkage.points.shape == (*batch, len(linkage.names), 3)
    assert all(0 <= i < len(linkage.names) for bar in linkage.bars for i in bar)
    if mechanism.offers(Mechanism.acceleration):
        assert mechanism.acceleration(posture, np.zeros(n), np.zeros(n)).shape == (*batch, t)
    if mechanism.offers(Mechanism.constraint_jacobian):
        assert mechanism.constraint_jacobian(posture).shape[-1] == 6
    if mechanism.offers(Mechanism.planar_jacobian):
        assert mechanism.planar_jacobian(posture).shape == (*batch, 2, 2)


@mechanisms
def test_a_batch_is_its_points_one_by_one(mechanism):
    q = random_joints(mechanism, 150, beyond=0.2)  # more than two blocks
    q[[3, 77], 0] = [np.nan, 1e300]
    n, t = len(mechanism.joints), len(mechanism.task_coordinates)
    batch = mechanism.forward(q)
    strided = mechanism.forward(np.asfortranarray(q.reshape(15, 10, n)))
    back = mechanism.inverse(batch.foot_position)
    for i in range(len(q)):
        assert_same_posture(mechanism.forward(q[i]), [field[i] for field in batch])
        assert_same_posture(mechanism.inverse(batch.foot_position[i]), [field[i] for field in back])
    assert_same_posture([field.reshape(150, *field.shape[2:]) for field in strided], list(batch))
    assert strided.foot_position.shape == (15, 10, t)


@mechanisms
@pytest.mark.parametrize("bad", ["abc", 1.0, [[None, "x"]], [[1.0] * 7] * 2, [[]], {"a": 1}])
def test_a_wrong_shape_names_the_argument(mechanism, bad):
    with pytest.raises(ShapeError, match="foot_position"):
        mechanism.inverse(bad)
    with pytest.raises(ShapeError, match="joint_positions"):
        mechanism.forward(bad)
    with pytest.raises(ShapeError, match="foot_position"):
        mechanism.inverse_with_twist(bad)
    with pytest.raises(ShapeError, match="joint_positions"):
        mechanism.forward_with_twist(bad)
    if mechanism.offers(Mechanism.acceleration):
        posture, good = mechanism.initial_posture, np.zeros(len(mechanism.joints))
        with pytest.raises(ShapeError, match="joint_velocities"):
            mechanism.acceleration(posture, bad, good)
        with pytest.raises(ShapeError, match="joint_accelerations"):
            mechanism.acceleration(posture, good, bad)


@plain_mechanisms
def test_an_impossible_value_names_its_field(mechanism):
    for f in geometry_parameters(mechanism):
        bad = [math.nan, math.inf] + ([0.0, -0.1] if f.metadata["positive"] else [])
        for value in bad:
            with pytest.raises(GeometryError, match=f.name):
                replace(mechanism, **{f.name: value})
    for name in ("joint_ranges", "passive_joint_ranges"):
        good = getattr(mechanism, name)
        wrong = (((0.3, 0.2),) * len(good), ((0.0, math.nan),) * len(good), good[:-1])
        for bad in wrong if good else ():
            with pytest.raises(GeometryError, match=name):
                replace(mechanism, **{name: bad})


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_any_numbers_are_taken(data):
    mechanism = data.draw(st.sampled_from([*ALL.values(), *map(without_limits, ALL.values())]))
    mode = data.draw(st.sampled_from(mechanism.assembly_modes))
    anything = st.floats(width=64, allow_nan=True, allow_infinity=True) | st.floats(-1.1, 1.1)
    leading = data.draw(hnp.array_shapes(max_dims=2, max_side=4))

    def numbers(width):
        return data.draw(hnp.arrays(np.float64, (*leading, width), elements=anything))

    feet, joints = numbers(len(mechanism.task_coordinates)), numbers(len(mechanism.joints))
    for given_, posture in (
        (feet, mechanism.inverse(feet, mode)),
        (joints, mechanism.forward(joints, mode)),
    ):
        values = [posture.joint_positions, posture.closure, posture.foot_position]
        values += [mechanism.passive_joint_positions(posture)]
        values += [mechanism.passive_joint_excursions(posture)]
        values += [mechanism.twist_jacobian(posture).reshape(*leading, -1)]
        if mechanism.offers(Mechanism.acceleration):
            n = len(mechanism.joints)
            values += [mechanism.acceleration(posture, np.full(n, 0.1), np.full(n, 0.2))]
        answered = np.isfinite(np.concatenate(values, axis=-1)).all(axis=-1)
        assert not np.any((posture.status == Status.OK) & ~answered)
        np.testing.assert_array_equal(
            posture.status == Status.INVALID_INPUT, ~np.isfinite(given_).all(axis=-1)
        )
        mechanism.linkage(posture)


@settings(max_examples=100, deadline=None)
@given(st.data())
def test_forward_and_inverse_agree_on_any_joints(data):
    mechanism = data.draw(st.sampled_from([*ALL.values()]))
    limits = np.clip(mechanism.joint_limits, -math.pi, math.pi)
    columns = [data.draw(hnp.arrays(np.float64, 7, elements=st.floats(*pair))) for pair in limits]
    q = np.stack(columns, axis=-1)
    posture = mechanism.forward(q)
    ok = posture.status == Status.OK
    back = mechanism.inverse(posture.foot_position[ok])
    error = joint_distance(mechanism, back.joint_positions, q[ok])
    steep = np.abs(np.linalg.pinv(mechanism.jacobian(back))).max(axis=(-2, -1), initial=1.0)
    assert np.all(error <= 1e-8 + 1e-13 * steep)
