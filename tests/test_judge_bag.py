# SPDX-License-Identifier: Apache-2.0
"""The offline judge says of a recording what the library says of each of its messages."""

import shutil
import signal
import tracemalloc
from pathlib import Path

import numpy as np
import pyarrow.csv
import pyarrow.parquet
import pytest
from leg_msgs_py.recordings.bag_types import installed_types
from leg_msgs_py.recordings.bag_writer import BagWriter, offered_qos
from leg_msgs_py.recordings.bags import Bag
from leg_msgs_py.recordings.definitions import message_definition
from make_golden_bags import JOINT_STATE, TYPES, WRENCH
from rosbags.highlevel import AnyReader

from leg_kinematics import load_robot
from leg_kinematics.status import Status
from leg_statics import evaluate_stances, measured_stance, robot_load, support_region
from leg_statics.capacity.problem import load_capacity
from leg_statics.efforts import joint_efforts, utilisation
from leg_statics.indices import condition_number, rated_friction, rated_friction_full
from leg_statics.joint_stream import JointStream
from leg_statics.recordings import bag_judge
from leg_statics.recordings import findings as judge_findings
from leg_statics.recordings.bag_judge import BagJudge, Judgement, Topics
from leg_statics.recordings.findings import Findings
from leg_statics.recordings.judge_bag import main
from leg_statics.recordings.judged_stances import DIRECTIONS, INTERVAL

BAGS = Path(__file__).parent / "bags"
TRIPOD, TROT, FAULTS = BAGS / "hexapod_tripod", BAGS / "quadruped_trot", BAGS / "hexapod_faults"
LEGS = [f"{side}_{end}" for side in ("left", "right") for end in ("front", "middle", "rear")]
WRENCHES = {leg: f"/{leg}/wrench" for leg in LEGS}
PLAIN = Topics()
SAME = {"rtol": 1e-12, "atol": 1e-12}
STATE_NUMBERS = (
    *("status", "contact", "condition_number", "load_capacity"),
    *("rated_friction", "rated_friction_full", "utilisation"),
)
STATE_FIELDS = (*STATE_NUMBERS, "foot_position", "foot_velocity", "ground_force")


def judged(bag, robot, topics=PLAIN, friction=0.4):
    """Judge a recording; return the judgements by leg, the judge and the findings."""
    judge = BagJudge(bag, load_robot(robot), friction, topics)
    findings, judgements = Findings(judge.robot, friction), []
    for message in bag.messages():
        judge.take(message)
        if judge.full:
            judgements += judge.judge()
    judgements += judge.judge()
    findings.add(judgements)
    by_leg = {}
    for leg in dict.fromkeys(judgement.leg for judgement in judgements):
        parts = zip(*(j[1:] for j in judgements if j.leg == leg), strict=True)
        by_leg[leg] = Judgement(leg, *map(np.concatenate, parts))
    return by_leg, judge, findings


def joint_states(path):
    bag = Bag(path)
    return [bag.decode(message) for message in bag.messages(["/joint_states"])]


def changed_bag(path, change, source=TRIPOD, topics=("/joint_states",), types=None):
    """Write a recording of the (topic, type, time, message) that `change` returns."""
    bag = Bag(source)
    with BagWriter(path) as writer:
        known = set()
        for message in bag.messages(topics):
            for topic, kind, time, content in change(message, bag.decode(message)):
                if topic not in known:
                    writer.add_topic(topic, kind, offered_qos())
                    known.add(topic)
                writer.write(topic, time, (types or TYPES).serialize_cdr(content, kind))
    return path


# --------------------------------------------------------------------------- the same numbers


@pytest.mark.parametrize(("path", "robot"), [(TRIPOD, "hexapod"), (TROT, "quadruped")])
def test_judgements_equal_direct_calls_of_the_library(path, robot):
    legs, judge, _ = judged(Bag(path), robot)
    messages = joint_states(path)
    assert judge.tally.judged == len(messages) == 300
    assert list(legs) == list(judge.robot.legs)
    for name, found in legs.items():
        leg = judge.robot.leg(name)
        lower, upper = leg.effort_limits.T
        assert list(found.message) == list(range(len(messages)))
        for k in range(0, len(messages), 17):
            message = messages[k]
            columns = [message.name.index(joint) for joint in leg.joint_names]
            posture = leg.mechanism.forward(message.position[columns])
            jacobian = leg.mechanism.jacobian(posture)
            wanted = {
                "stamp": message.header.stamp.sec * 10**9 + message.header.stamp.nanosec,
                "joint_positions": message.position[columns],
                "status": posture.status,
                "foot_position": posture.foot_position,
                "foot_velocity": jacobian @ message.velocity[columns],
                "condition_number": condition_number(jacobian),
                "load_capacity": load_capacity(jacobian, lower, upper, 0.4).capacity,
                "rated_friction": rated_friction(jacobian),
                "rated_friction_full": rated_friction_full(jacobian),
                "utilisation": utilisation(message.effort[columns], leg.effort_limits)[0],
                "joint_utilisation": np.abs(message.effort[columns]) / upper,
            }
            for field, value in wanted.items():
                np.testing.assert_allclose(getattr(found, field)[k], value, **SAME, err_msg=field)


@pytest.mark.parametrize("path", [TRIPOD, FAULTS])
def test_many_messages_at_once_give_bit_for_bit_what_each_gives_alone(path):
    legs, judge, _ = judged(Bag(path), "hexapod")
    stream = JointStream(judge.robot, 0.4)
    bag, compared = Bag(path), 0
    for number, message in enumerate(bag.messages(["/joint_states"])):
        if number % 3:
            continue
        for name, found in legs.items():
            row = np.flatnonzero(found.message == number)
            if not len(row):
                continue
            one = bag.decode(message)
            alone = stream.read(tuple(one.name), one.position, one.velocity, one.effort)
            k = alone.legs.index(name)
            for field in STATE_FIELDS:
                np.testing.assert_array_equal(
                    getattr(found, field)[row[0]], getattr(alone, field)[k]
                )
            compared += 1
    assert compared == sum(np.sum(found.message % 3 == 0) for found in legs.values()) > 500


def test_range_use_is_one_at_the_limits_of_the_status(tmp_path):
    leg = load_robot("hexapod").leg("left_front")
    lower, upper = leg.mechanism.joint_limits[0]
    ends = iter([lower, upper, 0.5 * (lower + upper), 1.01 * upper])

    def at_ends(message, content):
        content.position = np.zeros(len(content.name))
        content.position[0] = next(ends, 0.0)
        return [("/joint_states", JOINT_STATE, message.time, content)]

    legs, _, _ = judged(Bag(changed_bag(tmp_path / "bag", at_ends)), "hexapod")
    found = legs["left_front"]
    np.testing.assert_allclose(found.range_use[:4], [1.0, 1.0, 0.0, 1.01], atol=1e-12)
    assert found.status[3] == Status.JOINT_LIMIT
    assert (legs["right_rear"].passive_range_use < 1e-9).all()  # excursions from this posture


def test_wrenches_are_weighed_against_capacity_friction_and_efforts():
    legs, judge, _ = judged(Bag(TRIPOD), "hexapod", Topics(wrenches=WRENCHES))
    for name, found in legs.items():
        leg = judge.robot.leg(name)
        stands = found.force[:, 2] >= 10.0
        assert 0.4 < np.mean(stands) < 0.6
        np.testing.assert_array_equal(found.load_share, found.force[:, 2] / found.load_capacity)
        slope = np.abs(found.force[stands, 0]) / found.force[stands, 2]
        np.testing.assert_allclose(found.friction_used[stands], slope, **SAME)
        assert np.isnan(found.friction_used[~stands]).all()
        posture = leg.mechanism.forward(found.joint_positions)
        jacobians = leg.mechanism.jacobian(posture), leg.mechanism.angular_jacobian(posture)
        needed = joint_efforts(*jacobians, found.force)
        np.testing.assert_allclose(
            found.required_utilisation, np.abs(needed) / leg.effort_limits[:, 1], **SAME
        )
        # the recorded efforts are those that hold the recorded wrenches, up to their resolution
        np.testing.assert_allclose(found.required_utilisation, found.joint_utilisation, atol=1e-3)


def test_the_stance_is_judged_where_all_wrenches_are_known(hexapod):
    legs, judge, _ = judged(Bag(TRIPOD), "hexapod", Topics(wrenches=WRENCHES))
    time = legs[LEGS[0]].time
    _, rows = np.unique(time // INTERVAL, return_index=True)
    joints = {leg: found.joint_positions[rows] for leg, found in legs.items()}
    force = np.stack([found.force[rows, 2] for found in legs.values()], axis=-1)
    known = np.isfinite(force).all(axis=-1)
    joints = {leg: q[known] for leg, q in joints.items()}
    stance = measured_stance(hexapod, joints, force[known] >= 10.0, 0.4)
    load = robot_load(hexapod)
    found = evaluate_stances(stance, load)
    margin = support_region(stance, load, DIRECTIONS).margin
    assert judge.stances.known == known.sum() > 10
    assert judge.stances.carried == np.sum(found.load_factor >= 1.0)
    worst = np.nanargmin(margin)
    assert judge.stances.margin == pytest.approx((margin[worst], time[rows][known][worst]))
    assert judge.stances.load_factor.value == pytest.approx(
        np.nan_to_num(found.load_factor).min(), rel=1e-9
    )
    assert judged(Bag(TRIPOD), "hexapod")[1].stances.known == 0


def test_a_wrench_in_the_base_frame_is_turned_into_the_leg_frame(tmp_path):
    robot = load_robot("hexapod")
    leg = robot.leg("left_front")

    def turned(message, content):
        if message.type == WRENCH:
            force = content.wrench.force
            force.x, force.y, force.z = leg.mount.vectors_to_base([force.x, force.y, force.z])
            content.header.frame_id = robot.base_frame
        return [(message.topic, message.type, message.time, content)]

    topics = ("/joint_states", "/left_front/wrench")
    path = changed_bag(tmp_path / "bag", turned, topics=topics)
    only = Topics(wrenches={"left_front": "/left_front/wrench"})
    wanted, _, _ = judged(Bag(TRIPOD), "hexapod", only)
    found, _, _ = judged(Bag(path), "hexapod", only)
    np.testing.assert_allclose(found["left_front"].force, wanted["left_front"].force, atol=1e-9)
    assert np.isnan(found["right_front"].force).all()


def test_an_unknown_frame_and_old_values_count_as_unknown(tmp_path):
    start = Bag(TRIPOD).start

    def spoilt(message, content):
        if message.type == WRENCH and message.time > start + 10**9:
            content.header.frame_id = "elsewhere"
        return [(message.topic, message.type, message.time, content)]

    topics = ("/joint_states", "/left_front/wrench")
    path = changed_bag(tmp_path / "bag", spoilt, topics=topics)
    only = Topics(wrenches={"left_front": "/left_front/wrench"})
    legs, judge, _ = judged(Bag(path), "hexapod", only)
    (reason,) = judge.tally.refused
    assert "unknown frame 'elsewhere'" in reason
    known = ~np.isnan(legs["left_front"].force[:, 0])
    since = (legs["left_front"].time - legs["left_front"].time[0]) / 1e9
    assert known[since < 1.0].all()
    assert not known[since > 1.0 + bag_judge.HOLD / 1e9].any()


def test_efforts_may_come_from_a_topic_of_their_own(tmp_path):
    def split(message, content):
        name, effort = list(content.name), content.effort
        content.effort = np.empty(0)
        motors = TYPES.types[JOINT_STATE](
            content.header, name[::-1], np.empty(0), np.empty(0), effort[::-1].copy()
        )
        yield "/motors", JOINT_STATE, message.time - 1, motors
        yield "/joint_states", JOINT_STATE, message.time, content

    bag = Bag(changed_bag(tmp_path / "bag", split))
    wanted, _, _ = judged(Bag(TRIPOD), "hexapod")
    found, _, _ = judged(bag, "hexapod", Topics(efforts="/motors"))
    without, _, _ = judged(bag, "hexapod")
    for leg in LEGS:
        np.testing.assert_array_equal(found[leg].utilisation, wanted[leg].utilisation)
        assert np.isnan(without[leg].utilisation).all()


def test_recorded_effort_limits_count_from_when_they_came_into_force(tmp_path):
    kind = "leg_msgs/msg/EffortLimits"
    types = installed_types([JOINT_STATE, kind])
    start = Bag(TRIPOD).start

    def with_limits(message, content):
        if message.time - start == 3_000_000_000 + 200_000:
            limits = types.types[kind](
                content.header, ["left_front_crank_2"], np.array([-75.0]), np.array([75.0])
            )
            yield "/statics/effort_limits", kind, message.time - 1, limits
        if message.time - start == 4_000_000_000 + 200_000:
            limits = types.types[kind](content.header, [], np.array([-75.0]), np.empty(0))
            yield "/statics/effort_limits", kind, message.time - 1, limits
        yield "/joint_states", JOINT_STATE, message.time, content

    path = changed_bag(tmp_path / "bag", with_limits, types=types)
    legs, judge, _ = judged(Bag(path), "hexapod")
    wanted, _, _ = judged(Bag(TRIPOD), "hexapod")
    assert judge.tally.limit_changes == 1
    (reason,) = judge.tally.refused
    assert reason.startswith("/statics/effort_limits: got [0, 1, 0] names, lower, upper limits")
    before, after = slice(150), slice(150, None)
    for field in ("load_capacity", "utilisation", "joint_utilisation"):
        one, other = getattr(legs["left_front"], field), getattr(wanted["left_front"], field)
        np.testing.assert_array_equal(one[before], other[before])
    np.testing.assert_allclose(
        legs["left_front"].joint_utilisation[after, 1],
        2.0 * wanted["left_front"].joint_utilisation[after, 1],
    )
    assert (
        legs["left_front"].load_capacity[after] < wanted["left_front"].load_capacity[after]
    ).any()
    np.testing.assert_array_equal(
        legs["left_rear"].load_capacity, wanted["left_rear"].load_capacity
    )


# --------------------------------------------------------------------------- faults


def test_every_fault_is_counted_under_its_reason():
    legs, judge, findings = judged(Bag(FAULTS), "hexapod")
    tally = judge.tally
    assert len(tally.refused) == 4
    assert tally.refused["/joint_states: name: left_front_crank_1 appear more than once"] == 3
    assert any("got 17 values; allowed: 18" in reason for reason in tally.refused)
    assert any("no sensor_msgs/msg/JointState" in reason for reason in tally.refused)
    assert sum(tally.refused.values()) == 3 + 2 + 1 + 1  # repeated, too few, no names, garbled
    assert tally.foreign == 4
    assert tally.foreign_names[0] == "arm_0"
    assert tally.missing == {"right_rear lacks right_rear_crank_3": 6}
    assert tally.judged == 300 - 25 - 7 - 4
    # a duplicate, one that is late, and the first after a clock that was 30 s ahead
    assert tally.disordered == 3
    assert tally.gaps == 1
    (_, length), *_ = tally.longest_gaps
    assert length == 26 * 20_000_000
    assert findings.statuses["left_middle"][Status.INVALID_INPUT] == 5
    assert findings.statuses["left_front"][Status.INVALID_INPUT] == 2
    assert findings.statuses["right_rear"][Status.JOINT_LIMIT] == 3
    assert len(legs["left_rear"].message) == len(legs["right_rear"].message) + 6
    (worst, *_) = findings.worst(next(q for q in findings.quantities if q.name == "range_use"))
    assert worst.leg == "right_rear"
    assert worst.value > 1.0
    assert worst.time == Bag(FAULTS).start + 70 * 20_000_000


def test_memory_of_the_judge_does_not_grow_with_the_recording(monkeypatch):
    monkeypatch.setattr(bag_judge, "BATCH", 50)
    monkeypatch.setattr(judge_findings, "MOST_BINS", 50)
    bag = Bag(TROT)
    messages, length = list(bag.messages()), bag.end - bag.start + 20_000_000

    def peak(times):
        judge = BagJudge(bag, load_robot("quadruped"), 0.4, PLAIN)
        findings = Findings(judge.robot, 0.4)
        tracemalloc.start()
        for k in range(times):
            for message in messages:
                judge.take(message._replace(time=message.time + k * length))
                if judge.full:
                    findings.add(judge.judge())
        size = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert judge.tally.judged == times * len(messages)
        return size

    peak(8)  # what is loaded or compiled once
    assert peak(8) < 1.5 * peak(1)


# --------------------------------------------------------------------------- the command


@pytest.fixture(scope="module")
def one_leg(tmp_path_factory):
    """A recording of one leg, whose report is made quickly."""

    def first_leg(message, content):
        content.name = content.name[:3]
        for field in ("position", "velocity", "effort"):
            setattr(content, field, getattr(content, field)[:3].copy())
        return [("/joint_states", JOINT_STATE, message.time, content)]

    return changed_bag(tmp_path_factory.mktemp("bag") / "walk", first_leg)


@pytest.fixture(scope="module")
def tripod_files(tmp_path_factory):
    """All that the command can write, for the tripod walk."""
    folder = tmp_path_factory.mktemp("tripod")
    wrenches = [f"--wrench={leg}={topic}" for leg, topic in WRENCHES.items()]
    files = [
        f"--{kind}={folder / name}"
        for kind, name in (
            ("table", "walk.parquet"),
            ("report", "walk.md"),
            ("output-bag", "copy"),
        )
    ]
    assert main([str(TRIPOD), *wrenches, *files]) == 0
    return folder


def test_the_table_holds_the_judgements(tripod_files):
    table = pyarrow.parquet.read_table(tripod_files / "walk.parquet")
    assert table.num_rows == 300 * len(LEGS)
    assert table.column("leg").to_pylist()[: len(LEGS)] == LEGS
    legs, _, _ = judged(Bag(TRIPOD), "hexapod", Topics(wrenches=WRENCHES))
    for k, leg in enumerate(LEGS):
        rows = table.slice(0).take(np.arange(k, table.num_rows, len(LEGS)))
        found = legs[leg]
        for name in (
            "message",
            "time",
            "stamp",
            "load_capacity",
            "passive_range_use",
            "load_share",
        ):
            np.testing.assert_array_equal(rows.column(name).to_numpy(), getattr(found, name))
        for column, values in (
            ("foot_position_z", found.foot_position[:, 2]),
            ("force_y", found.force[:, 1]),
            ("joint_positions_crank_2", found.joint_positions[:, 1]),
            ("required_utilisation_crank_3", found.required_utilisation[:, 2]),
        ):
            np.testing.assert_array_equal(rows.column(column).to_numpy(), values)
        assert set(rows.column("status").to_pylist()) == {"OK"}
    assert table.schema.field("load_capacity").metadata[b"unit"] == b"N"


def test_the_report_tells_what_matters(tripod_files):
    text = (tripod_files / "walk.md").read_text()
    assert "**Within the limits in what was checked; everything was checked.**" in text
    assert "| ground | cement, friction 0.4 |" in text
    assert "| command | judge\\_bag " in text or "| command | judge_bag " in text
    assert "| recorded | 2023-11-14 22:13:20 UTC to 2023-11-14 22:13:25 UTC |" in text
    assert "margin of the centre of mass in the support region" in text
    assert "/drives: motors told WARN: warm" in text
    assert "| /drives: motors | OK 4, WARN 2 | WARN at 4.001" in text
    for leg in LEGS:
        picture = tripod_files / f"walk_{leg}.png"
        assert f"![{leg}]({picture.name})" in text
        assert picture.stat().st_size > 10_000


def test_the_report_says_first_what_could_not_be_checked(tmp_path, one_leg):
    def without_efforts(message, content):
        content.effort = content.effort[:0].copy()
        if message.topic == "/left_front/wrench":
            return [(message.topic, message.type, message.time, content)]
        return [(message.topic, JOINT_STATE, message.time, content)]

    bag = changed_bag(tmp_path / "bag", without_efforts, one_leg)
    files = ["--table", str(tmp_path / "walk.csv"), "--report", str(tmp_path / "walk.md")]
    assert main([str(bag), *files]) == 0
    verdict, _, rest = (tmp_path / "walk.md").read_text().partition("## About this report")
    assert "not everything was checked" in verdict
    assert "Nothing of left_middle, left_rear, right_front, right_middle, right_rear" in verdict
    assert "effort / limit, worst joint of any leg: it needs efforts in the joint states" in verdict
    assert "load / load capacity of any leg: it needs the wrench on the foot" in verdict
    assert "| joint range used | 1 | 1 of 6, 100 % of their joint states |" in verdict
    assert "The worst share of a limit is" in verdict
    moments = rest.partition("## Worst moments")[2].partition("## Queries")[0].splitlines()
    rows = [tuple(line.split("|")[1:4]) for line in moments if line.startswith("|")]
    assert len(rows) == len(set(rows))  # what is alike is one row


def test_wrenches_that_are_recorded_and_not_used_are_told(tmp_path):
    start = Bag(TRIPOD).start

    def shortened(message, content):
        if message.time - start < 200_000_000:
            yield message.topic, message.type, message.time, content

    topics = ("/joint_states", "/left_front/wrench", "/right_rear/wrench")
    bag = changed_bag(tmp_path / "bag", shortened, topics=topics)
    files = ["--table", str(tmp_path / "walk.csv"), "--report", str(tmp_path / "walk.md")]
    assert main([str(bag), "--wrench", "left_front=/left_front/wrench", *files]) == 0
    text = (tmp_path / "walk.md").read_text()
    assert "Recorded wrenches that were not used: /right" in text
    assert "load / load capacity of left_middle, left_rear" in text


def test_one_joint_a_message_is_judged_as_one_message_of_all(tmp_path):
    def in_pieces(message, content):
        for k, name in enumerate(content.name):
            values = (getattr(content, f)[k : k + 1] for f in ("position", "velocity", "effort"))
            piece = TYPES.types[JOINT_STATE](content.header, [name], *values)
            yield "/joint_states", JOINT_STATE, message.time + k, piece

    wanted, _, _ = judged(Bag(TRIPOD), "hexapod")
    found, judge, _ = judged(Bag(changed_bag(tmp_path / "bag", in_pieces)), "hexapod")
    assert judge.tally.pieces == 300 * 18
    assert judge.tally.judged == 300 * len(LEGS)
    for leg in LEGS:
        for field in STATE_FIELDS:
            np.testing.assert_array_equal(getattr(found[leg], field), getattr(wanted[leg], field))


def test_the_copy_has_leg_states_and_all_the_rest(tripod_files):
    kind, topic = "leg_msgs/msg/LegStates", "/statics/leg_states"
    source, copy = Bag(TRIPOD), Bag(tripod_files / "copy")
    assert not copy.damages
    assert copy.counts == {**source.counts, topic: 300}
    assert {name: copy.topics[name] for name in source.topics} == source.topics
    assert list(copy.messages(source.topics)) == list(source.messages())
    times = [message.time for message in copy.messages()]
    assert times == sorted(times)
    metadata = (tripod_files / "copy" / "metadata.yaml").read_text()
    for name in ("sensor_msgs/msg/JointState", kind):
        assert message_definition(name).hash in metadata

    robot = load_robot("hexapod")
    stream = JointStream(robot, 0.4)
    with AnyReader([tripod_files / "copy"]) as reader:
        answers = reader.messages([c for c in reader.connections if c.topic == topic])
        for (connection, time, data), message in zip(
            answers, source.messages(["/joint_states"]), strict=True
        ):
            answer, asked = reader.deserialize(data, connection.msgtype), source.decode(message)
            assert time == message.time
            assert answer.header.stamp == asked.header.stamp
            assert answer.header.frame_id == "base_link"
            assert [leg.leg for leg in answer.legs] == LEGS
            states = stream.read(tuple(asked.name), asked.position, asked.velocity, asked.effort)
            for field in STATE_NUMBERS:
                found = np.array([getattr(leg, field) for leg in answer.legs])
                np.testing.assert_array_equal(found, getattr(states, field))
            for field in ("foot_position", "foot_velocity", "ground_force"):
                for k, leg in enumerate(answer.legs):
                    mount, own = robot.leg(leg.leg).mount, getattr(states, field)[k]
                    turn = mount.to_base if field == "foot_position" else mount.vectors_to_base
                    told = getattr(leg, field)
                    np.testing.assert_array_equal([told.x, told.y, told.z], turn(own))


def test_a_damaged_recording_is_judged_up_to_its_damage_and_the_report_says_so(tmp_path, capsys):
    content = (TROT / "quadruped_trot.mcap").read_bytes()
    (tmp_path / "torn.mcap").write_bytes(content[: len(content) * 2 // 5])
    files = ["--table", str(tmp_path / "walk.csv"), "--report", str(tmp_path / "walk.html")]
    assert main([str(tmp_path / "torn.mcap"), "--robot", "quadruped", *files]) == 0
    warning = capsys.readouterr().err
    assert "torn.mcap is damaged" in warning
    table = pyarrow.csv.read_csv(tmp_path / "walk.csv")
    messages = table.num_rows // 4
    assert 30 < messages < 300
    assert f"{messages} messages before it were read" in warning
    legs, _, _ = judged(Bag(TROT), "quadruped")
    np.testing.assert_array_equal(
        table.column("load_capacity").to_numpy().reshape(-1, 4).T,
        [found.load_capacity[:messages] for found in legs.values()],
    )
    page = (tmp_path / "walk.html").read_text()
    assert "<strong>Damaged: torn.mcap</strong>" in page
    assert page.count('src="data:image/png;base64,') == 4
    assert sorted(f.name for f in tmp_path.iterdir()) == ["torn.mcap", "walk.csv", "walk.html"]


def test_text_of_a_recording_cannot_change_the_report(tmp_path, one_leg):
    def hostile(message, content):
        if message.time % 40_000_000 > 20_000_000:
            content.name[1] = content.name[0] = "<script>alert(1)</script> | **x** [y](z)"
        return [("/joint_states", JOINT_STATE, message.time, content)]

    bag = changed_bag(tmp_path / "bag", hostile, one_leg)
    files = ["--table", str(tmp_path / "walk.csv"), "--report", str(tmp_path / "walk.html")]
    assert main([str(bag), *files]) == 0
    page = (tmp_path / "walk.html").read_text()
    assert "<script>" not in page
    assert "&lt;script&gt;alert(1)&lt;/script&gt; | **x** [y](z) appear more than once" in page


def test_nothing_is_overwritten_unless_asked_for(tmp_path, capsys, one_leg):
    table, report = tmp_path / "walk.csv", tmp_path / "walk.html"
    table.write_text("mine")
    arguments = [str(one_leg), f"--table={table}", f"--report={report}"]
    assert main(arguments) == 1
    assert "exists already; give another name or --force" in capsys.readouterr().err
    assert table.read_text() == "mine"
    assert main([*arguments, "--force"]) == 0
    assert pyarrow.csv.read_csv(table).num_rows == 300

    folder = tmp_path / "letters"
    folder.mkdir()
    (folder / "letter.txt").write_text("mine")
    assert main([*arguments, "--force", f"--output-bag={folder}"]) == 1
    assert "other files than those of a recording" in capsys.readouterr().err
    copy = shutil.copytree(one_leg, tmp_path / "copy")
    assert main([str(copy), *arguments[1:], "--force", f"--output-bag={copy}"]) == 1
    assert "holds the recording itself" in capsys.readouterr().err
    assert Bag(copy).counts == Bag(one_leg).counts


@pytest.mark.parametrize(
    ("arguments", "code", "told"),
    [
        ([], 2, "BAG"),
        (["missing"], 1, "missing does not exist"),
        (["empty"], 1, "empty: no recording"),
        (["{faults}", "--robot", "dog"], 1, "no robot named 'dog'; shipped robots: "),
        (["{faults}", "--ground", "lava"], 1, "unknown ground 'lava'; allowed: "),
        (["{faults}", "--grounds", "no.yaml"], 1, "no.yaml does not exist"),
        (["{faults}", "--friction", "-1"], 1, "--friction: got -1; allowed: "),
        (["{faults}", "--friction", "nan"], 1, "--friction: got nan; allowed: "),
        (["{faults}", "--friction", "1", "--ground", "ice"], 2, "not allowed with"),
        (["{faults}", "--joint-states", "/j"], 1, "no topic /j; it has /joint_states (sensor_msgs"),
        (["{tripod}", "--joint-states", "/diagnostics"], 1, "allowed: sensor_msgs/msg/JointState"),
        (["{faults}", "--wrench", "left_front"], 2, "allowed: LEG=TOPIC"),
        (["{faults}", "--wrench", "left_front=/w"], 1, "no topic /w"),
        (["{tripod}", "--wrench", "tail=/left_front/wrench"], 1, "unknown leg 'tail'; allowed: "),
        (
            ["{tripod}", "--wrench", "left_front=/a", "--wrench", "left_front=/b"],
            1,
            "given 2 times",
        ),
        (["{trot}"], 1, "they name left_front_upper_cylinder"),
        (["{faults}", "--table", "walk.xlsx"], 1, "got '.xlsx'; allowed: .parquet, .csv"),
        (["{faults}", "--report", "walk.pdf"], 1, "got '.pdf'; allowed: .html, .md"),
        (["{faults}", "--report", "no/walk.html"], 1, "folder no does not exist"),
        (["{faults}", "--gap", "0"], 1, "--gap: got 0; allowed: > 0"),
        (["{tripod}", "--output-bag", "copy", "--leg-states", "/diagnostics"], 1, "has it already"),
    ],
)
def test_a_mistake_ends_with_one_line_and_leaves_nothing(
    tmp_path, monkeypatch, capsys, arguments, code, told
):
    monkeypatch.chdir(tmp_path)
    Path("empty").mkdir()
    names = {"faults": FAULTS, "tripod": TRIPOD, "trot": TROT}
    given = [argument.format(**names) for argument in arguments]
    if code == 2:
        with pytest.raises(SystemExit) as ended:
            main(given)
        assert ended.value.code == code
    else:
        assert main(given) == code
    printed = capsys.readouterr()
    assert told in printed.err
    assert printed.err.startswith("judge_bag: error: ")
    assert printed.err.count("\n") == 1
    assert not printed.out
    assert [file.name for file in tmp_path.iterdir()] == ["empty"]


def test_ctrl_c_stops_cleanly_and_leaves_nothing(tmp_path, monkeypatch, capsys):
    take = BagJudge.take

    def interrupted(judge, message):
        if judge.tally.first is not None:
            signal.raise_signal(signal.SIGINT)
        take(judge, message)

    monkeypatch.setattr(BagJudge, "take", interrupted)
    monkeypatch.chdir(tmp_path)
    ignored = signal.signal(signal.SIGINT, signal.default_int_handler)  # by a shell's `&`, maybe
    try:
        assert main([str(TRIPOD), "--output-bag", "copy"]) == 130
    finally:
        signal.signal(signal.SIGINT, ignored)
    assert capsys.readouterr().err == "judge_bag: interrupted, nothing was written\n"
    assert list(tmp_path.iterdir()) == []
