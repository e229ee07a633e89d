# SPDX-License-Identifier: Apache-2.0
"""What README, examples and docs print runs as it stands: every snippet and every console line."""

import os
import re
import signal
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest
from nodes_support import PATIENCE, START_TIMEOUT
from ros_domain import claim_domain

ROOT = Path(__file__).resolve().parent.parent
PAGES = [
    *(ROOT / folder / "README.md" for folder in (".", "examples", "benchmarks")),
    *sorted(ROOT.glob("docs/*.md")),
]
WALKING = "make run GAIT=yes"
NODES = 5  # that it starts
ALONE = "test_gait.py"  # wants the joint states to itself
# What an example says when all is well.
SAID = {
    "01_ask_one_foothold.py": "carries 500 N",
    "02_rank_ten_thousand.py": "10000 candidates",
    "03_choose_height_and_step.py": "cement",
    "04_walk_over_terrain.py": "x  2.00 m",
    "my_planner.py": "longest step of all six legs",
}
# Targets that run the tests, or run long: that make knows them is enough here.
HEAVY_TARGETS = [
    "demo",
    "docs",
    "test",
    "test-lowest",
    "bench",
    "bench-compare",
    "soak",
    "stances",
    "papers",
]
ELSEWHERE = ("rosdep ", "colcon ", "ros2 ", "pip ")  # what only a robot's machine has


NAMED = re.compile(r'^```(?:python|yaml) title="([\w.]+)"\n(.*?)^```', re.DOTALL | re.MULTILINE)
# What the pages tell to save, by its name.
SAVED = dict(named for page in PAGES for named in NAMED.findall(page.read_text()))
IN_PROCESS = [
    name for name, text in SAVED.items() if name.endswith(".py") and "leg_msgs_py" not in text
]


def blocks(page, language):
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text(), re.DOTALL | re.MULTILINE)


def lines(page):
    """The console lines of a page, and what its text tells to run in backticks."""
    shown = [line for block in blocks(page, "console") for line in block.splitlines()]
    told = re.findall(r"`(\./leg [^`]+)`", page.read_text())
    whole = [" ".join(line.split()) for line in told if "COMMAND" not in line]
    found = [re.sub(r"\s+# .*", "", line) for line in shown] + whole
    return list(dict.fromkeys(found))


def execute(line, folder, domain):
    answer = subprocess.run(
        line,
        shell=True,
        cwd=folder,
        env={**os.environ, "ROS_DOMAIN_ID": domain},
        capture_output=True,
        text=True,
        timeout=START_TIMEOUT,
    )
    assert answer.returncode == 0, f"{line}\n{answer.stdout}{answer.stderr}"
    for name, words in SAID.items():
        assert name not in line or words in answer.stdout, answer.stdout


@contextmanager
def running(line, count, words="ready: robot"):
    """What a line starts, in a ROS domain of its own, once it has said so; it ends by Ctrl-C."""
    domain = claim_domain()
    process = subprocess.Popen(
        line,
        shell=True,
        cwd=ROOT,
        env={**os.environ, "ROS_DOMAIN_ID": domain, "PYTHONUNBUFFERED": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    output = []
    try:
        while sum(words in said for said in output) < count:
            output.append(process.stdout.readline())
            assert output[-1], "".join(output)
        yield domain
        os.killpg(process.pid, signal.SIGINT)
        output.append(process.communicate(timeout=PATIENCE)[0])
    finally:
        process.kill()
    assert "Stopped." in output[-1], "".join(output)
    assert "Traceback" not in "".join(output)


@pytest.fixture(scope="module")
def sandbox(tmp_path_factory):
    """A folder as a newcomer has it, with the snippets of the pages saved as they say."""
    folder = tmp_path_factory.mktemp("newcomer")
    for name in ("leg", "examples", "benchmarks"):
        (folder / name).symlink_to(ROOT / name)
    for name, text in SAVED.items():
        (folder / name).write_text(text)
    model = ROOT / "config" / "robots" / "solo12.urdf"  # one that somebody may have
    (folder / "my_robot.urdf").write_bytes(model.read_bytes())
    return folder


@pytest.fixture(scope="module")
def walking(sandbox):
    """The domain of a hexapod that walks by itself."""
    with running(WALKING, NODES) as domain:
        yield domain


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_console_line_runs_as_it_is_printed(page, sandbox, walking):
    for line in lines(page):
        command, *words = line.split()
        if command == "make" and words[0] in HEAVY_TARGETS:
            subprocess.run(f"{line} -n", shell=True, cwd=ROOT, capture_output=True, check=True)
        elif command == "make" and words[0] == "view":
            with running(line, 1, "is shown at"):
                pass
        elif command == "make":
            assert words[0] == "run"
            if words[1:] and line != WALKING:
                with running(line, NODES - 1):
                    pass
        elif not line.startswith(ELSEWHERE) and ALONE not in line:
            execute(line, sandbox, walking)


def test_every_snippet_has_a_name_of_its_own_and_is_run():
    pages = [page.read_text() for page in PAGES]
    names = [name for text in pages for name, _ in NAMED.findall(text)]
    assert sorted(names) == sorted(SAVED)
    assert sum(text.count("```python") for text in pages) == sum(n.endswith(".py") for n in names)
    told = " ".join(line for page in PAGES for line in lines(page))
    assert {"in_process.py", "stance.py"} <= {*IN_PROCESS}
    assert all(name in told for name in set(SAVED) - set(IN_PROCESS))


@pytest.mark.parametrize("name", IN_PROCESS)
def test_the_snippets_without_ros_need_no_more_than_is_said(sandbox, name):
    text = (ROOT / "docs" / "first_query.md").read_text()
    (told,) = re.findall(r"without ROS \(([\w\s,.]+) are enough\)", text)
    names = re.split(r",\s+|\s+and\s+", told)
    program = GUARD.format(names=names, snippet=str(sandbox / name))
    subprocess.run([sys.executable, "-c", program], check=True)


# Runs a snippet where nothing can be imported but the suite, what it names, and what that needs.
GUARD = """
import importlib.metadata, re, runpy, sys
needed, todo = set(), {names!r}
while todo:
    name = re.match(r"[\\w.-]+", todo.pop())[0]
    if name in needed: continue
    needed.add(name)
    try: required = importlib.metadata.requires(name) or []
    except importlib.metadata.PackageNotFoundError: continue
    todo += [each for each in required if "extra ==" not in each]
tops = {{top for top, packages in importlib.metadata.packages_distributions().items()
        if {{each.lower().replace("_", "-") for each in packages}}
        & {{each.lower().replace("_", "-") for each in needed}}}}
tops |= {{"ruamel", "leg_kinematics", "leg_statics", "_distutils_hack", *sys.stdlib_module_names}}
class Guard:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] not in tops:
            raise ModuleNotFoundError(f"{{name}} is not told", name=name)
sys.meta_path.insert(0, Guard())
runpy.run_path({snippet!r})
"""


def test_the_test_of_a_gait_runs_as_it_is_printed(sandbox, suite, walking):
    # Recorded where the hexapod walks, played where it does not.
    assert (sandbox / "walk_judged").is_dir()
    execute(f"./leg pytest {ALONE}", sandbox, os.environ["ROS_DOMAIN_ID"])
