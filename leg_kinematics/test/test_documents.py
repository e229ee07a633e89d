# SPDX-License-Identifier: Apache-2.0
"""Documents from anywhere: read within a second, or refused with file, what it was, what may be."""

from __future__ import annotations

import contextlib
import math
import os
import re
import socket
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from leg_kinematics import DescriptionError, load_robot
from leg_kinematics.bounded_yaml import MOST_CHARACTERS, MOST_LEVELS, MOST_VALUES
from leg_kinematics.description import MOST_LEGS, find_robot_file, robot_from_document
from leg_kinematics.documents import Document
from leg_kinematics.files import user_path

LONGEST_REFUSAL = 1.0  # of processor time [s]

LAUGHS = "a: &a [1, 2, 3, 4, 5, 6, 7, 8, 9]\n" + "".join(
    f"{name}: &{name} [{', '.join([f'*{before}'] * 9)}]\n"
    for before, name in zip("abcdefgh", "bcdefghi", strict=True)
)
TOO_MUCH = {
    "aliases of aliases": (LAUGHS, "values, with aliases written out"),
    "aliases of a text": (
        f"a: &a {'x' * 5000}\nb: [{', '.join(['*a'] * 50)}]",
        "characters, with aliases written out",
    ),
    "many values": ("[" + "1," * (MOST_CHARACTERS // 2 - 1) + "]", f"at most {MOST_VALUES}"),
    "many lines": ("- 1\n" * (MOST_CHARACTERS // 4), f"at most {MOST_VALUES}"),
    "many anchors": ("".join(f"- &a{k} 1\n" for k in range(5000)), f"at most {MOST_VALUES}"),
    "deep brackets": ("[" * 60_000, f"deeper than {MOST_LEVELS} levels"),
    "deep braces": ("{a: " * 16_000, f"deeper than {MOST_LEVELS} levels"),
    "deep lists": ("- " * 30_000 + "1", f"deeper than {MOST_LEVELS} levels"),
    "deep keys": ("? " * 30_000 + "1", f"deeper than {MOST_LEVELS} levels"),
    "in itself": ("&a [*a]", "'a' stands within its own meaning"),
    "in itself by a reused name": ("[&a 1, &a [*a]]", "'a' stands within its own meaning"),
    "merged with itself": ("a: &a {<<: *a}", "'a' stands within its own meaning"),
    "long": ("# " + "x" * 50_000_000, f"at most {MOST_CHARACTERS}"),
    "number": ("a: " + "9" * 60_000, "digits"),
}


@pytest.fixture
def written(tmp_path):
    """Return a function that writes a robot description and gives its path."""

    def write(text: str) -> Path:
        path = tmp_path / "robot.yaml"
        path.write_text(text)
        return path

    return write


def refusal(path: Path) -> str:
    """Return why a robot description is refused, which must not take long."""
    began = time.process_time()
    with pytest.raises(DescriptionError) as caught:
        load_robot(path)
    assert time.process_time() - began < LONGEST_REFUSAL
    return str(caught.value).replace(str(path), path.name)


@pytest.mark.filterwarnings("ignore::ruamel.yaml.error.ReusedAnchorWarning")
@pytest.mark.parametrize("case", TOO_MUCH.values(), ids=TOO_MUCH.keys())
def test_what_would_take_too_long_is_refused_at_once(written, case):
    text, words = case
    message = refusal(written(text))
    assert "robot.yaml" in message
    assert words in message
    assert len(message) < 500


def test_aliases_and_merges_of_an_honest_size_are_read(written):
    text = find_robot_file("hexapod").read_text()
    shared = text.replace("position: [", "position: &front [", 1)
    robot = load_robot(written(shared + "    # *front\n"))
    assert list(robot.legs) == list(load_robot("hexapod").legs)
    root = Document(Path("x"), "a: &a {x: 1, y: 2}\nb: {<<: *a, y: 3}\nc: [*a, *a]").root
    assert dict(root["b"]) == {"y": 3, "x": 1}
    assert root["c"][0] is root["c"][1]


def legs(count: int) -> str:
    """Return a hexapod with this many legs."""
    text = find_robot_file("hexapod").read_text()
    mount = "mount: {position: [0, 0, 0], rpy: [0, 0, 0]}"
    entries = [f"  leg_{k}: {{type: initial, {mount}}}\n" for k in range(count)]
    return text[: text.index("\nlegs:")] + "\nlegs:\n" + "".join(entries)


def test_a_robot_may_have_so_many_legs_and_no_more(written):
    assert len(load_robot(written(legs(MOST_LEGS))).legs) == MOST_LEGS
    message = refusal(written(legs(MOST_LEGS + 1)))
    assert f"legs: {MOST_LEGS + 1} entries; allowed: at most {MOST_LEGS}" in message
    assert f"allowed: at most {MOST_CHARACTERS}" in refusal(written(legs(30_000)))


def test_of_many_mistakes_some_are_told_and_the_rest_counted(written):
    text = find_robot_file("hexapod").read_text() + "".join(f"x{k}: 1\n" for k in range(50))
    long = refusal(written(text))
    assert "unknown key 'x0', 'x1'" in long
    assert len(long) < 500
    many = refusal(written(re.sub(r"(position|rpy): \[0,", r"\1: [a,", legs(60))))
    assert "legs.leg_0.mount.position.0: 'a' is not a finite number" in many
    assert "robot.yaml: 100 more mistakes" in many


WRONG_VALUES = {
    "a date": "name: 2001-99-99",
    "a tag": "name: !!int z",
    "binary": "name: !!binary zzz",
    "null byte": "name: \0",
    "lists as keys": "[1, 2]: 3",
    "mappings as keys": "{a: 1}: 4",
    "numbers as keys": "1: 2\n.nan: 3\ntrue: 4",
    "a set": "!!set {a, b}",
    "foreign tags": "name: !python/object:os.system [x]",
    "two documents": "a: 1\n---\nb: 2",
    "a value without end": "name: '" + "x" * 10_000,
    "a long key": f"{'k' * 1000}: 1",
}


@pytest.mark.parametrize("text", WRONG_VALUES.values(), ids=WRONG_VALUES.keys())
def test_whatever_is_no_description_is_refused_shortly(written, text):
    assert len(refusal(written(text))) < 500


EXTREMES = [1e308, -1e308, 1e-308, 0, -1, 10**400, math.inf, math.nan, None, True, "", [], {}]


def numbers(part: Any) -> Iterator[tuple[Any, Any]]:
    """Yield every mapping or list of a document that holds a number, and the number's key."""
    for key in part if isinstance(part, Mapping) else range(len(part)):
        if isinstance(part[key], (Mapping, list)):
            yield from numbers(part[key])
        elif isinstance(part[key], (int, float)) and not isinstance(part[key], bool):
            yield part, key


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("extreme", EXTREMES, ids=lambda value: repr(value)[:8])
def test_any_number_of_a_description_is_taken_or_refused_by_name(extreme):
    document = Document(find_robot_file("hexapod"))
    places = list(numbers(document.root))
    assert len(places) > 100
    for part, key in places[::3]:
        before, part[key] = part[key], extreme
        with contextlib.suppress(DescriptionError):
            assert robot_from_document(document).legs
        part[key] = before


def test_pipes_devices_folders_and_sockets_are_refused_unread(tmp_path):
    pipe, folder, port = (tmp_path / f"{name}.yaml" for name in ("pipe", "folder", "port"))
    os.mkfifo(pipe)
    folder.mkdir()
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(port))
        for path, words in (
            (pipe, "is a pipe; allowed: a regular file"),
            (folder, "is a folder; allowed: a regular file"),
            (port, "is a socket; allowed: a regular file"),
            (Path("/dev/zero"), "is a device; allowed: a regular file"),
        ):
            assert f"{path.name}: {words}" in refusal(path)


def test_paths_that_cannot_be_are_told(monkeypatch):
    assert "'~nobody_at_all'" in refusal(Path("~nobody_at_all/robot.yaml"))
    assert "does not exist" in refusal(Path("x" * 5000 + ".yaml"))
    assert "does not exist" in refusal(Path("a\0b.yaml"))
    monkeypatch.setenv("HOME", "/here")
    assert user_path("~/robot.yaml") == Path("/here/robot.yaml")
