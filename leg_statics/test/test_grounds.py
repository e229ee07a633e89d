# SPDX-License-Identifier: Apache-2.0
"""Grounds: the published ranges, and files with mistakes."""

from __future__ import annotations

import pytest

from leg_kinematics import DescriptionError, UnknownNameError
from leg_statics.grounds import load_grounds
from leg_statics.published.paper_000 import GROUNDS


def test_the_shipped_grounds_are_the_published_ones():
    grounds = load_grounds()
    assert {g.name: (g.friction_low, g.friction_high) for g in grounds.by_name.values()} == GROUNDS


def test_an_unknown_ground_lists_those_that_exist():
    with pytest.raises(UnknownNameError, match="unknown ground 'lava'; allowed: ice, wood, cement"):
        load_grounds().find("lava")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("grounds: {sand: {friction: [0.5, 0.3]}}", "low end"),
        ("grounds: {sand: {friction: [-0.5, 0.3]}}", ">= 0"),
        ("grounds: {sand: {friction: [.nan, 0.3]}}", "finite number"),
        ("grounds: {sand: {friction: 0.3}}", "0.3"),
        ("grounds: {sand: {friktion: [0.1, 0.3]}}", "friktion"),
        ("grounds: {}", "grounds"),
        ("", "grounds.yaml"),
    ],
)
def test_a_mistake_is_named(tmp_path, content, words):
    path = tmp_path / "grounds.yaml"
    path.write_text(content)
    with pytest.raises(DescriptionError, match=r"grounds\.yaml") as error:
        load_grounds(path)
    assert words in str(error.value)


def test_a_missing_file_is_told(tmp_path):
    with pytest.raises(DescriptionError, match="does not exist"):
        load_grounds(tmp_path / "none.yaml")
