# SPDX-License-Identifier: Apache-2.0
"""Recorded queries of planners, answered again offline, give what the node answered."""

import shutil
from pathlib import Path

import numpy as np
import pyarrow.csv
import pyarrow.parquet
import pytest
from leg_msgs_py import errors
from leg_msgs_py.client import Ground, LegClient
from leg_msgs_py.recordings.bag_writer import BagWriter
from leg_msgs_py.recordings.bags import Bag
from leg_msgs_py.recordings.definitions import message_definition
from leg_msgs_py.recordings.errors import BagError
from node_processes import NodeProcesses
from nodes_support import PATIENCE, START_TIMEOUT, set_parameter, wait_for
from recorder_support import RecordProcess

from leg_kinematics import load_robot
from leg_kinematics.errors import ValueRangeError
from leg_statics.footholds import Contact, Verdict, evaluate_footholds
from leg_statics.grounds import load_grounds
from leg_statics.recordings import query_judge
from leg_statics.recordings.bag_judge import BagJudge, Topics
from leg_statics.recordings.judge_bag import main
from leg_statics.recordings.query_judge import QueryFindings, QueryJudge

NODE = "/planner/statics"
PREFIX = "planner/"  # of the robot's frames
BASE = f"{PREFIX}base_link"
OF_PLANNER = ("--node", NODE, "--frame-prefix", PREFIX)
FOOTHOLDS, STEPS = (f"{NODE}/query_{what}/_service_event" for what in ("footholds", "step_length"))
EVENT = "leg_msgs/srv/QueryFootholds_Event"
OTHERS = {"query_step_length", "get_leg_description"}  # what is asked beside footholds
WEAK = [20.0, 20.0, 20.0]
SLOPE = [0.1, -0.2, 1.0]
UNDER_LEFT_REAR = [-0.45, 0.35, -0.65]  # in the base frame


def feet(count, centre=(0.0, 0.0, -0.65)):
    return np.add(centre, np.random.default_rng(count).uniform(-0.25, 0.25, (count, 3)))


def ask(client):
    """Ask what planners ask, good and bad; return the answers that are checked below."""
    answers = [client.query_footholds("left_front", feet(100), "cement", 300.0)]
    client.query_footholds("right_rear", feet(50), Ground("wood", SLOPE), 200.0, efforts=True)
    client.query_footholds(
        "left_rear",
        feet(20, UNDER_LEFT_REAR),
        0.3,
        100.0,
        frame=f"{PREFIX}base_link",
        moment=[1, 2, 3],
    )
    client.query_footholds("left_front", np.empty((0, 3)), "cement", 300.0)
    client.query_footholds("left_front", feet(30, [0.0, 0.0, -3.0]), "cement", 300.0)
    answers.append(client.query_step_length([], [-0.62, -0.68], "cement", 100.0))
    client.query_step_length("left_front", [-0.65], 0.2, by_rated_friction=True)
    with pytest.raises(errors.UnknownLegError):
        client.query_footholds("wing", feet(2), "cement", 300.0)
    with pytest.raises(errors.UnknownGroundError):
        client.query_step_length([], [-0.8], "lava", 100.0)
    with pytest.raises(errors.TooLargeError):
        client.query_footholds("left_front", feet(2000), "cement", 300.0)
    limits = client.describe("left_front").effort_limits
    names = client.describe("left_front").joint_names
    client.set_effort_limits("left_front", names, WEAK)
    answers.append(client.query_footholds("left_front", feet(100), "cement", 300.0))
    client.set_effort_limits("left_front", names, limits[:, 1], limits[:, 0])
    answers.append(client.query_footholds("left_front", feet(100), "cement", 300.0))
    return answers


def set_events(client, state):
    return set_parameter(client.node, "planner/statics", "service_events", state)


def topics_of(record):
    """Return the topics of which something is recorded already."""
    try:
        return set(Bag(record.folder).counts)
    except BagError:  # nothing yet
        return set()


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A recording of a planner's queries, and what the planner was answered."""
    folder = tmp_path_factory.mktemp("queries") / "plan"
    parameters = {"service_events": "contents", "max_points": 1000, "frame_prefix": PREFIX}
    with (
        NodeProcesses(names=["statics"], namespace="planner", parameters=parameters) as nodes,
        LegClient(namespace="planner", timeout=PATIENCE) as client,
        RecordProcess(folder, "--topics", f"{NODE}/*") as record,
    ):
        wait_for(lambda: client.node.count_publishers(FOOTHOLDS), START_TIMEOUT)
        refused = set_events(client, "all")
        assert not refused.successful
        assert "got 'all'; allowed: off, metadata, contents" in refused.reason
        assert set_events(client, "off").successful
        client.query_footholds("right_middle", feet(5), "cement", 300.0)
        assert set_events(client, "metadata").successful
        while FOOTHOLDS not in topics_of(record):  # what is sent before both sides know is lost
            client.query_footholds("right_middle", feet(5), "cement", 300.0)
        assert set_events(client, "contents").successful
        while STEPS not in topics_of(record):
            client.query_step_length("right_front", [-0.65], "cement", 100.0)
        answers = ask(client)
        output = record.stop()
        assert record.process.returncode == 0, output
        assert nodes.ended() == {}
    return folder, answers


def judged(path, robot="hexapod", node=NODE):
    """Judge the queries of a recording."""
    bag = Bag(path)
    robot = load_robot(robot).with_frame_prefix(PREFIX)
    judge = BagJudge(bag, robot, 0.4, Topics("", node=node))
    queries, findings = QueryJudge(bag, load_grounds("grounds"), node), QueryFindings()
    for message in bag.messages():
        judge.take(message)
        queries.take(message, judge.robot)
    found = queries.judge()
    findings.add(found)
    return found, queries, findings


def changed(path, source, change):
    """Write a recording with the events of footholds as `change` returns them; None is left out."""
    bag = Bag(source)
    with BagWriter(path) as writer:
        for topic in bag.topics.values():
            writer.copy_topic(topic, bag.types)
        for message in bag.messages():
            data = message.data
            if message.topic == FOOTHOLDS:
                event = change(bag.decode(message))
                if event is None:
                    continue
                data = bag.types.serialize_cdr(event, EVENT)
            writer.write(message.topic, message.time, data)
    return path


def without_contents(path):
    """Return how many requests for footholds were recorded as metadata alone."""
    bag = Bag(path)
    events = map(bag.decode, bag.messages([FOOTHOLDS]))
    return sum(event.info.event_type == 1 and not len(event.request) for event in events)


def only(event_type):
    """Return a change that leaves other events out."""
    return lambda event: event if event.info.event_type == event_type else None


# --------------------------------------------------------------------------- the same answers


def test_answers_are_those_of_the_node_bit_for_bit(recorded):
    found, judge, findings = judged(recorded[0])
    described = [query for query in found if query.service == "get_leg_description"]
    planned = [
        query
        for query in found
        if query not in described and query.legs not in ("right_front", "right_middle")
    ]
    assert all(query.exact and query.difference is None for query in found)
    assert [query.refused for query in planned if query.refused] == [
        *("UNKNOWN_LEG", "UNKNOWN_GROUND", "TOO_LARGE")
    ]
    assert (len(planned), len(described)) == (12, 2)
    assert judge.unanswered == 0
    assert judge.without_request <= 1  # the recorder may have come between question and answer
    assert judge.without_contents == without_contents(recorded[0]) > 0
    assert not any(query.legs == "right_middle" for query in found)
    assert all(0.0 < query.seconds < 10.0 for query in found)
    tally = findings.tallies["query_footholds", "left_front"]
    assert (tally.queries, tally.refused, tally.exact) == (6, 1, 6)


def test_the_summary_says_what_the_planner_was_answered(recorded):
    path, (first, steps, weak, last) = recorded
    found, _, _ = judged(path)
    by_service = {
        name: [query for query in found if query.service == name and not query.refused]
        for name in ("query_footholds", "query_step_length")
    }
    hundreds = [
        query.answer
        for query in by_service["query_footholds"]
        if query.legs == "left_front" and query.answer.points == 100
    ]
    for answer, wanted in zip(hundreds, (first, weak, last), strict=True):
        assert answer.feasible == np.sum(wanted.verdict == Verdict.FEASIBLE)
        assert answer.verdicts == {
            Verdict(k): n
            for k, n in zip(*np.unique(wanted.verdict, return_counts=True), strict=True)
        }
        best = wanted.load_capacity[wanted.best] if len(wanted.ranking) else np.nan
        np.testing.assert_equal(answer.best, best)
    assert hundreds[0] == hundreds[2] != hundreds[1]  # the limits in force count
    step, _ = (q.answer for q in by_service["query_step_length"] if q.legs != "right_front")
    assert (step.points, step.best) == (12, np.max(steps.common_length))


def test_recorded_answers_equal_direct_calls_of_the_library(recorded):
    bag, leg = Bag(recorded[0]), load_robot("hexapod").leg("right_rear")
    events = [bag.decode(message) for message in bag.messages([FOOTHOLDS])]
    (asked,) = (e for e in events if e.request and e.request[0].legs == [leg.name])
    number = asked.info.sequence_number
    (told,) = (e for e in events if e.response and e.info.sequence_number == number)
    request, response = asked.request[0], told.response[0]
    contact = Contact(0.6, SLOPE, 200.0)
    wanted = evaluate_footholds(leg, request.positions.reshape(-1, 3), contact)
    np.testing.assert_array_equal(response.verdict, wanted.verdict)
    np.testing.assert_allclose(response.load_capacity, wanted.load_capacity, rtol=1e-12)
    np.testing.assert_allclose(response.joint_efforts, wanted.joint_efforts.ravel(), rtol=1e-12)


# --------------------------------------------------------------------------- what is not so


def test_an_answer_that_is_not_the_recorded_one_is_told(recorded, tmp_path):
    def more_capacity(event):
        for response in event.response:
            if len(response.verdict) == 50:
                response.load_capacity = response.load_capacity + 1e-3
        return event

    found, _, findings = judged(changed(tmp_path / "bag", recorded[0], more_capacity))
    (query,) = findings.different
    assert query.legs == "right_rear"
    assert query.difference.field.startswith("load_capacity[")
    assert query.difference.expected - query.difference.got == pytest.approx(1e-3)
    assert sum(not query.exact for query in found) == 1


def test_rounding_is_told_apart_from_another_answer(recorded, tmp_path):
    def round_otherwise(event):
        for response in event.response:
            response.utilisation = response.utilisation * (1.0 + 1e-15)
        return event

    found, _, findings = judged(changed(tmp_path / "bag", recorded[0], round_otherwise))
    assert findings.different == []
    assert not all(query.exact for query in found)


def test_another_robot_gives_other_answers(recorded):
    _, _, findings = judged(recorded[0], "walker")
    assert findings.different[0].difference.field == "error.code"
    assert findings.different[0].difference.got == "UNKNOWN_LEG"


def test_half_a_conversation_is_counted(recorded, tmp_path):
    found, judge, _ = judged(changed(tmp_path / "asked", recorded[0], only(1)))
    assert {query.service for query in found} == OTHERS
    assert judge.unanswered == 9
    found, judge, _ = judged(changed(tmp_path / "answered", recorded[0], only(2)))
    assert {query.service for query in found} == OTHERS
    assert judge.without_request == 9


def test_requests_without_a_response_do_not_pile_up(recorded, tmp_path, monkeypatch):
    path = changed(tmp_path / "asked", recorded[0], only(1))
    _, before, _ = judged(path)
    monkeypatch.setattr(query_judge, "MOST_WAITING", 3)
    _, judge, _ = judged(path)
    assert judge.unanswered == before.unanswered > 3


def test_a_topic_of_another_type_is_told(recorded, tmp_path):
    bag = Bag(recorded[0])
    with BagWriter(tmp_path / "bag") as writer:
        writer.copy_topic(bag.topics[STEPS]._replace(name=FOOTHOLDS), bag.types)
    with pytest.raises(ValueRangeError, match="got leg_msgs/srv/QueryStepLength_Event; allowed"):
        QueryJudge(Bag(tmp_path / "bag"), load_grounds("grounds"), NODE)


def test_events_of_another_version_are_told(recorded, tmp_path):
    bag = Bag(recorded[0])
    older = bag.topics[FOOTHOLDS].definition.data.replace("int32[] best ", "int64[] best ")
    definition = bag.topics[FOOTHOLDS].definition._replace(data=older)
    with BagWriter(tmp_path / "bag") as writer:
        writer.copy_topic(bag.topics[FOOTHOLDS]._replace(definition=definition), bag.types)
    with pytest.raises(ValueRangeError, match=r"another version of leg_msgs"):
        QueryJudge(Bag(tmp_path / "bag"), load_grounds("grounds"), NODE)


def test_an_event_that_is_cut_off_is_refused_and_the_others_judged(recorded, tmp_path):
    bag = Bag(recorded[0])
    with BagWriter(tmp_path / "bag") as writer:
        for topic in bag.topics.values():
            writer.copy_topic(topic, bag.types)
        for message in bag.messages():
            writer.write(message.topic, message.time, message.data)
            if message.topic == FOOTHOLDS:
                writer.write(message.topic, message.time, message.data[: len(message.data) // 2])
    report = tmp_path / "report.md"
    outputs = ["--table", str(tmp_path / "table.csv"), "--report", str(report)]
    assert main([str(tmp_path / "bag"), *OF_PLANNER, *outputs]) == 0
    assert f"{FOOTHOLDS}: no {EVENT}" in report.read_text()
    assert "0 differ." in report.read_text()


# --------------------------------------------------------------------------- recordings


def test_events_are_recorded_as_rosbag2_does(recorded):
    bag = Bag(recorded[0])
    topic = bag.topics[FOOTHOLDS]
    assert topic.type == EVENT
    assert topic.definition.data.startswith(f"{'=' * 80}\nSRV: leg_msgs/srv/QueryFootholds\n# What")
    digest = message_definition(EVENT).hash
    assert bag.types.hash_rihs01(EVENT) == digest
    assert digest in (recorded[0] / "metadata.yaml").read_text()


def test_a_definition_without_what_all_events_have_is_enough(recorded, tmp_path):
    """Recordings of rosbag2 leave out what the service's own definition does not name."""
    bag = Bag(recorded[0])
    text = bag.topics[FOOTHOLDS].definition.data
    parts = text.split(f"{'=' * 80}\n")
    short = f"{'=' * 80}\n".join(part for part in parts if "ServiceEventInfo" not in part)
    assert short != text
    path = tmp_path / "bag"
    definition = bag.topics[FOOTHOLDS].definition._replace(data=short)
    with BagWriter(path) as writer:
        writer.copy_topic(bag.topics[FOOTHOLDS]._replace(definition=definition), bag.types)
        for message in bag.messages([FOOTHOLDS]):
            writer.write(message.topic, message.time, message.data)
    found, _, _ = judged(path)
    assert found


# --------------------------------------------------------------------------- the command


def test_the_command_judges_a_recording_of_queries_alone(recorded, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main([str(recorded[0]), *OF_PLANNER, "--report", "plan.md"]) == 0
    assert capsys.readouterr().out.split() == [
        *("plan_judged.parquet", "plan.md", "plan_judged_queries.parquet")
    ]
    report = Path("plan.md").read_text()
    for text in (
        "| query_footholds | left_front | 6 | 1 | 330 |",
        "Queries that were refused, the first query_footholds of wing at",
        "0 differ.",
        "UNKNOWN_GROUND: unknown ground 'lava'; allowed: ice, wood, cement",
        f"{without_contents(recorded[0])} requests were recorded without their contents.",
        "30 REACH",
    ):
        assert text in report
    table = pyarrow.parquet.read_table("plan_judged_queries.parquet").to_pylist()
    found, _, _ = judged(recorded[0])
    assert [row["time"] for row in table] == [query.time for query in found]
    assert [row["reach"] for row in table] == [
        query.answer.verdicts.get(Verdict.REACH, 0) for query in found
    ]
    assert all(row["exact"] and row["difference"] == "" for row in table)


def test_the_table_of_queries_may_be_csv(recorded, tmp_path):
    table = tmp_path / "plan.csv"
    arguments = [*OF_PLANNER, "--table", str(table), "--report", str(tmp_path / "plan.html")]
    assert main([str(recorded[0]), *arguments]) == 0
    rows = pyarrow.csv.read_csv(tmp_path / "plan_queries.csv")
    assert "left_front" in rows.column("legs").to_pylist()


def test_a_recording_of_another_node_has_nothing_to_judge(recorded, tmp_path, capsys):
    shutil.copytree(recorded[0], tmp_path / "plan")
    assert main([str(tmp_path / "plan")]) == 1
    assert "no topic /joint_states" in capsys.readouterr().err
