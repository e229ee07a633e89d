# SPDX-License-Identifier: Apache-2.0
"""The table on disk: exact, locked, and what is left of it after an accident."""

import contextlib
import math
import resource

import numpy as np
import pytest

from leg_statics.design.search.design_table import Design, DesignTable, TableError

NAMES = (["a", "b"], ["x"])


def design(k, problem=""):
    return Design(np.array([k / 3.0, -1e-300]), np.array([math.pi * k]), 0.1 / 3.0, problem)


def filled(path, count=3):
    with DesignTable(path, *NAMES) as table:
        for k in range(count):
            table.append(design(k))
    return path


def same(a, b):
    return all(
        np.array_equal(x, y, equal_nan=True) for x, y in zip(a[:3], b[:3], strict=True)
    ) and (a.problem == b.problem)


def test_numbers_are_read_back_bit_by_bit(tmp_path):
    designs = [
        design(1),
        Design(np.array([np.nan, np.inf]), np.array([-0.0]), np.nan, 'cannot, "really"\nbe built'),
    ]
    with DesignTable(tmp_path / "t.csv", *NAMES) as table:
        for one in designs:
            table.append(one)
        found = list(table.read())
    assert same(found[0], designs[0])
    assert same(found[1], designs[1]._replace(problem='cannot, "really" be built'))
    assert found[0].feasible
    assert not found[1].feasible


@pytest.mark.parametrize("torn", [b"0.", b"0.5,0.5,1.0,0.1,all but the end of the line"])
def test_a_torn_last_line_is_dropped(tmp_path, torn):
    path = filled(tmp_path / "t.csv")
    whole = path.read_bytes()
    path.write_bytes(whole + torn)
    with DesignTable(path, *NAMES) as table:
        assert path.read_bytes() == whole
        assert len(list(table.read())) == 3
        table.append(design(3))
        assert same(list(table.read())[3], design(3))


def test_a_table_whose_header_is_torn_begins_anew(tmp_path):
    (tmp_path / "t.csv").write_bytes(b"a,b")
    with DesignTable(filled(tmp_path / "t.csv", 1), *NAMES) as table:
        (only,) = table.read()
    assert same(only, design(0))


def test_a_damaged_line_is_named(tmp_path):
    path = filled(tmp_path / "t.csv")
    lines = path.read_text().splitlines()
    lines[2] = lines[2].replace("0.", "zero.", 1)
    path.write_text("\n".join(lines) + "\n")
    with DesignTable(path, *NAMES) as table, pytest.raises(TableError, match=r"t\.csv:3: damaged"):
        list(table.read())


def test_a_table_of_something_else_is_refused(tmp_path):
    path = filled(tmp_path / "t.csv")
    with (
        DesignTable(path, ["a", "c"], ["x"]) as table,
        pytest.raises(TableError, match="a, b, x, error"),
    ):
        list(table.read())


def test_two_cannot_write_at_once(tmp_path):
    path = filled(tmp_path / "t.csv")
    with (
        DesignTable(path, *NAMES),
        pytest.raises(TableError, match="another search is at work"),
    ):
        DesignTable(path, *NAMES)
    DesignTable(path, *NAMES).close()


@contextlib.contextmanager
def largest_file(size):
    """Let no file of this process grow beyond a size: the disk is full."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_a_full_disk_keeps_what_was_written(tmp_path):
    path = filled(tmp_path / "t.csv")
    whole = path.read_bytes()
    with DesignTable(path, *NAMES) as table:
        with (
            largest_file(len(whole) + 10),
            pytest.raises(TableError, match=r"t\.csv: cannot be written: File too large.*kept"),
        ):
            table.append(design(3))
        assert path.read_bytes() == whole
        table.append(design(3))
        assert len(list(table.read())) == 4


def test_a_table_that_cannot_be_made_is_refused(tmp_path):
    with pytest.raises(TableError, match="cannot be written: No such file"):
        DesignTable(tmp_path / "nowhere" / "t.csv", *NAMES)
