# SPDX-License-Identifier: Apache-2.0
"""Geometry search: the same designs always, whatever happens on the way."""

import threading
import tracemalloc
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np
import pytest

from leg_kinematics import load_robot
from leg_statics.design.designs import evaluate_design
from leg_statics.design.search import study_file
from leg_statics.design.search.design_table import Design, TableError
from leg_statics.design.search.geometry_search import EvenSample, GeometrySearch, SearchError
from leg_statics.design.search.jobs import SearchJob
from leg_statics.design.search.report import winner_robot, write_results
from leg_statics.design.search.study_file import load_study
from leg_statics.design.search.workers import LocalWorkers, Workers
from leg_statics.grounds import Ground, Grounds

CHEAP = """\
version: 1
name: cheap
units: {length: mm, angle: deg}
base: {robot: hexapod, leg_type: initial}
parameters:
  drive_lever: {from: 60, to: 200}
  shank_length: {from: 320, to: 520}
objectives: [condition_number, unit_effort_capacity]
constraints:
  unit_moment_effort: {max: 2.0}
method: {name: nsga2, designs: 96, population: 12}
seed: 1
tolerance: 0.5
"""


class Inline(Workers):
    """Works in this process, in chunks that end out of order."""

    losses = ()
    count = 3

    def close(self):
        pass

    def _submit(self, function, item):
        future = Future()
        future.set_result(function(item))
        return future

    def _recover(self, error):
        raise AssertionError


@pytest.fixture
def study(tmp_path):
    def study(old="", new="", text=CHEAP):
        path = tmp_path / "study.yaml"
        path.write_text(text.replace(old, new, 1))
        return load_study(path)

    return study


def run(study, folder, workers=None, on_design=lambda search: None):
    return GeometrySearch(study, folder, on_design).run(workers or Inline())


def table(folder):
    return (folder / "designs.csv").read_bytes()


def stop_after(count):
    return lambda search: search.stop() if search.progress.evaluated == count else None


@pytest.mark.parametrize("method", ["nsga2", "differential_evolution"])
def test_a_stopped_search_goes_on_to_the_same_table(study, tmp_path, method):
    cheap = study("nsga2", method)
    whole = run(cheap, tmp_path / "whole")
    for count in (1, 50, 95):
        stopped = run(cheap, tmp_path / "parts", on_design=stop_after(count))
        assert not stopped.complete
        assert stopped.progress.evaluated == count
        assert table(tmp_path / "whole").startswith(table(tmp_path / "parts"))
    resumed = run(cheap, tmp_path / "parts")
    assert table(tmp_path / "parts") == table(tmp_path / "whole")
    assert resumed.complete
    assert resumed.progress.recalled == 95
    assert resumed.winner.number == whole.winner.number
    assert resumed.improvements == whole.improvements


def test_processes_find_the_same_as_one(study, tmp_path):
    run(study(), tmp_path / "inline")
    with LocalWorkers(2) as workers:
        run(study(), tmp_path / "processes", workers)
    assert table(tmp_path / "processes") == table(tmp_path / "inline")


def test_another_seed_finds_other_designs(study, tmp_path):
    run(study(), tmp_path / "one")
    run(study("seed: 1", "seed: 2"), tmp_path / "two")
    assert table(tmp_path / "one") != table(tmp_path / "two")


def test_a_torn_line_is_evaluated_again(study, tmp_path):
    run(study(), tmp_path / "out")
    whole = table(tmp_path / "out")
    (tmp_path / "out" / "designs.csv").write_bytes(whole[: len(whole) // 2])
    run(study(), tmp_path / "out")
    assert table(tmp_path / "out") == whole


def test_a_larger_budget_goes_on(study, tmp_path):
    run(study(), tmp_path / "out")
    outcome = run(study("designs: 96", "designs: 120"), tmp_path / "out")
    assert (outcome.progress.recalled, outcome.progress.evaluated) == (96, 120)
    with pytest.raises(SearchError, match=r"differs .* in: method"):
        run(study(), tmp_path / "out")


def test_a_search_by_the_name_of_a_ground_goes_on_only_with_the_friction_that_it_began_with(
    study, tmp_path, monkeypatch
):
    named = study("method:", "conditions: {ground: cement}\nmethod:")
    run(named, tmp_path / "out", on_design=stop_after(10))
    assert run(named, tmp_path / "out", on_design=stop_after(20)).progress.recalled == 10
    other = Grounds({"cement": Ground("cement", 0.2, 0.7)})
    monkeypatch.setattr(study_file, "load_grounds", lambda: other)
    changed = study("method:", "conditions: {ground: cement}\nmethod:")
    with pytest.raises(SearchError, match=r"friction: 0.4; ground 'cement' has friction: 0.2 now"):
        run(changed, tmp_path / "out")
    (tmp_path / "out" / "ground.yaml").unlink()
    with pytest.raises(SearchError, match="does not tell the friction"):
        run(named, tmp_path / "out")
    assert len(table(tmp_path / "out").splitlines()) == 1 + 20


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("seed: 1", "seed: 2", "seed"),
        ("to: 200", "to: 201", "parameters"),
        ("max: 2.0", "max: 2.1", "constraints"),
        ("population: 12", "population: 13", "method"),
    ],
)
def test_results_of_another_study_are_kept(study, tmp_path, old, new, key):
    run(study("designs: 96", "designs: 12"), tmp_path / "out")
    before = table(tmp_path / "out")
    other = study("designs: 96", "designs: 13")
    other = study(old, new, CHEAP.replace("designs: 96", "designs: 13"))
    with pytest.raises(SearchError, match=f"holds results of another study.* in: {key}"):
        run(other, tmp_path / "out")
    assert table(tmp_path / "out") == before


def test_results_of_another_robot_are_kept(study, tmp_path):
    first = study("designs: 96", "designs: 12")
    run(first, tmp_path / "out")
    description = first.robot.text.replace("crank_1: 150", "crank_1: 149")
    (tmp_path / "hexapod").write_text(description)  # beside the study it hides the shipped one
    with pytest.raises(SearchError, match=r"holds results of another robot.* in: leg_types"):
        run(study("designs: 96", "designs: 12"), tmp_path / "out")


def test_a_table_of_another_version_is_refused(study, tmp_path):
    run(study(), tmp_path / "out")
    path = tmp_path / "out" / "designs.csv"
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join([*lines[:5], lines[6], lines[5], *lines[7:]]))
    with pytest.raises(SearchError, match=r"designs\.csv:6: holds another design"):
        run(study(), tmp_path / "out")


def test_two_searches_in_one_folder_are_refused(study, tmp_path):
    def begin_another(search):
        with pytest.raises(TableError, match="another search is at work"):
            run(study(), tmp_path / "out")
        search.stop()

    assert run(study(), tmp_path / "out", on_design=begin_another).progress.evaluated == 1


def test_a_folder_that_cannot_be_made_is_told(study, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(SearchError, match=r"file/out: cannot be written: Not a directory"):
        run(study(), tmp_path / "file" / "out")


def test_the_front_is_what_comparing_all_designs_finds(study, tmp_path):
    cheap = study()
    outcome = run(cheap, tmp_path / "out")
    with (tmp_path / "out" / "designs.csv").open() as file:
        rows = [line.rstrip("\n").split(",", 6) for line in list(file)[1:]]
    feasible = [np.array(row[2:4], float) * [1, -1] for row in rows if not row[6]]
    assert len(rows) == outcome.progress.evaluated == 96
    assert 0 < len(feasible) == outcome.progress.feasible < 96
    best = [a for a in feasible if not any((b <= a).all() and (b < a).any() for b in feasible)]
    found = [entry.design.values[:2] * [1, -1] for entry in outcome.front]
    np.testing.assert_array_equal(
        np.unique(np.array(found), axis=0), np.unique(np.array(best), axis=0)
    )
    for row in rows:
        violated = float(row[4]) > 2.0
        assert bool(row[6]) >= violated


def test_lines_of_the_table_are_what_the_library_evaluates(study, tmp_path):
    cheap = study()
    outcome = run(cheap, tmp_path / "out", on_design=stop_after(20))
    design = outcome.front[0].design
    changes = {"drive_lever": design.parameters[0], "shank_length": design.parameters[1]}
    wanted = evaluate_design(cheap.leg, changes, cheap.metrics, cheap.conditions)
    np.testing.assert_array_equal(design.values, list(wanted.values.values()))


def test_the_winner_is_a_robot(study, tmp_path):
    outcome = run(study(), tmp_path / "out")
    paths = write_results(outcome, tmp_path / "out")
    assert all(path.stat().st_size for path in paths)
    robot, base = load_robot(tmp_path / "out" / "winner.yaml"), load_robot("hexapod")
    assert list(robot.legs) == list(base.legs)
    winner = outcome.winner.design
    for name, leg in robot.legs.items():
        assert leg.mirrored == base.legs[name].mirrored
        assert leg.geometry.drive_lever == pytest.approx(winner.parameters[0], rel=1e-12)
        assert leg.geometry.shank_length == pytest.approx(winner.parameters[1], rel=1e-12)
        assert leg.geometry.crank_zero == base.legs[name].geometry.crank_zero
        np.testing.assert_array_equal(leg.mount.position, base.legs[name].mount.position)
    report = (tmp_path / "out" / "report.md").read_text()
    for path in paths[:-1]:
        assert path.suffix == ".yaml" or f"({path.name})" in report
    scores = [outcome.study.score(e.design.values, outcome.base) for e in outcome.front]
    assert max(scores) == outcome.study.score(winner.values, outcome.base)


def test_a_search_without_a_feasible_design_says_why(study, tmp_path):
    outcome = run(study("max: 2.0", "max: 0.1"), tmp_path / "out")
    assert outcome.winner is None
    assert winner_robot(outcome) == ""
    assert outcome.problems["unit_moment_effort … > …"] > 40
    report = write_results(outcome, tmp_path / "out")[-1].read_text()
    assert "unit_moment_effort … > …" in report
    assert np.isnan(outcome.progress.best).all()


def test_one_objective_and_a_grid(study, tmp_path):
    grid = study(
        "",
        "",
        CHEAP.replace("to: 200", "to: 200, step: 70")
        .replace("{from: 320, to: 520}", "{values: [320, 400]}")
        .replace(", unit_effort_capacity]", "]")
        .replace("{name: nsga2, designs: 96, population: 12}", "{name: grid}"),
    )
    outcome = run(grid, tmp_path / "out")
    assert outcome.progress.evaluated == grid.total == 6
    assert len(outcome.front) == 1
    assert outcome.winner.design.values[0] == outcome.progress.best[0]
    assert write_results(outcome, tmp_path / "out")


def test_a_leg_that_cannot_be_evaluated_is_told(study, tmp_path):
    impossible = study("tolerance: 0.5", "tolerance: 1e-9")
    with pytest.raises(SearchError, match="the leg to be improved cannot be evaluated: not known"):
        run(impossible, tmp_path / "out")


def test_a_sample_is_even_and_small():
    sample = EvenSample()
    for k in range(50_000):
        sample.add(k)
    assert 1000 < len(sample.entries) <= 4000
    assert len(set(np.diff(sample.entries))) == 1


class Held(Inline):
    """Waits at a gate when it has worked for a while."""

    def __init__(self):
        self.waiting, self.gate = threading.Event(), threading.Event()
        self._left = 5

    def _submit(self, function, item):
        self._left -= 1
        if not self._left:
            self.waiting.set()
            self.gate.wait()
        return super()._submit(function, item)


def test_a_job_ends_early_when_cancelled(study, tmp_path):
    workers = Held()
    with ThreadPoolExecutor(1) as pool:
        job = SearchJob(study(), tmp_path / "out", lambda: workers, pool)
        workers.waiting.wait()
        job.cancel()
        workers.gate.set()
    job.check()
    assert not job.complete
    assert 12 <= job.outcome.progress.evaluated < 96
    assert (tmp_path / "out" / "report.md").exists()


def test_memory_stays_flat_as_designs_stream_by(study, tmp_path, monkeypatch):
    def instead(task, designs):
        return [Design(d, np.array([d.sum(), d.prod(), 0.0]), 0.0, "") for d in designs]

    monkeypatch.setattr("leg_statics.design.search.geometry_search.evaluate_designs", instead)
    monkeypatch.setattr("leg_statics.design.search.geometry_search.MOST_SAMPLED", 100)
    stream = study("{name: nsga2, designs: 96, population: 12}", "{name: samples, designs: 3000}")
    used = []
    tracemalloc.start()
    try:
        run(
            stream,
            tmp_path / "out",
            on_design=lambda search: used.append(tracemalloc.get_traced_memory()[0]),
        )
    finally:
        tracemalloc.stop()
    assert len(used) == 3000
    assert used[-1] - used[1000] < 200_000  # bytes; 2,000 designs would take a million
