# SPDX-License-Identifier: Apache-2.0
"""Kernels: broadcasting, and a cache that notices edits of the code a kernel calls."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import leg_kinematics
from leg_kinematics.kernels.kernel import kernel, scalar

PACKAGES = str(Path(leg_kinematics.__file__).parents[1])


@scalar
def quotient(a, b):
    return a / b


@kernel("(n),()->(n)", "f8[:], f8, f8[:]")
def divide(vector, divisor, result):
    for i in range(vector.shape[0]):
        result[i] = quotient(vector[i], divisor)


def test_a_kernel_broadcasts_over_leading_axes():
    vectors = np.arange(24.0).reshape(2, 4, 3)
    np.testing.assert_array_equal(divide(vectors, 2.0), vectors / 2.0)
    np.testing.assert_array_equal(divide(vectors[0, 0], 2.0), vectors[0, 0] / 2.0)
    assert divide(np.empty((0, 3)), 1.0).shape == (0, 3)


def test_division_by_zero_yields_infinity_not_an_exception():
    np.testing.assert_array_equal(divide(np.array([1.0, -1.0]), 0.0), [np.inf, -np.inf])


def run(folder: Path, cache: Path, before: str = "") -> subprocess.CompletedProcess[str]:
    environment = {k: v for k, v in os.environ.items() if k not in ("HOME", "XDG_CACHE_HOME")}
    environment |= {
        "PYTHONPATH": os.pathsep.join([str(folder), PACKAGES]),
        "NUMBA_CACHE_DIR": str(cache),
        "HOME": str(cache),
        # Python would take an edited file of the same size and second for the old one
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    return subprocess.run(
        [sys.executable, "-c", f"{before}\nimport user; print(user.twice(3.0))"],
        env=environment, capture_output=True, text=True, check=True, timeout=600,
    )  # fmt: skip


@pytest.fixture
def program(tmp_path):
    (tmp_path / "helper.py").write_text(
        "from leg_kinematics.kernels.kernel import scalar\n\n"
        "@scalar\ndef times(x):\n    return 2.0 * x\n"
    )
    (tmp_path / "user.py").write_text(
        textwrap.dedent("""
        from leg_kinematics.kernels.kernel import kernel
        from helper import times

        @kernel("()->()", "f8, f8[:]")
        def twice(x, result):
            result[0] = times(x)
        """)
    )
    return tmp_path


def test_compiled_code_is_cached_and_an_edited_callee_invalidates_it(program, tmp_path):
    cache = tmp_path / "cache"
    cold, warm = run(program, cache), run(program, cache)
    assert (cold.stdout, warm.stdout) == ("6.0\n", "6.0\n")
    assert "compiling user.twice" in cold.stderr
    assert "compiling" not in warm.stderr
    helper = program / "helper.py"
    helper.write_text("# a comment\n" + helper.read_text())
    assert "compiling" not in run(program, cache).stderr
    helper.write_text(helper.read_text().replace("2.0", "5.0"))
    edited = run(program, cache)
    assert edited.stdout == "15.0\n"
    assert "compiling user.twice" in edited.stderr


def test_processes_that_start_together_compile_once_and_all_answer(program, tmp_path):
    with ThreadPoolExecutor(4) as pool:
        results = list(pool.map(lambda _: run(program, tmp_path / "cache"), range(4)))
    assert [result.stdout for result in results] == ["6.0\n"] * 4
    assert sum("compiling user.twice" in result.stderr for result in results) == 1


def test_an_unwritable_cache_falls_back_to_none(program, tmp_path):
    blocked = tmp_path / "file"  # a file where a folder is wanted: unwritable even for root
    blocked.write_text("")
    result = run(program, blocked)
    assert result.stdout == "6.0\n"
    assert "no writable cache folder" in result.stderr


def test_a_user_without_a_home_is_warned_and_answered(program):
    unknown = textwrap.dedent("""
        import os, pwd
        def nobody_known(uid):
            raise KeyError(uid)
        pwd.getpwuid = nobody_known  # as for a user of a container
        del os.environ["HOME"], os.environ["NUMBA_CACHE_DIR"]
    """)
    result = run(program, Path("unused"), unknown)
    assert result.stdout == "6.0\n"
    assert "no writable cache folder (set XDG_CACHE_HOME to one)" in result.stderr


def spoilt(cache: Path, how: str) -> None:
    """Let others write a cache, or a file in it, or the folder that holds it."""
    kernels = cache / "leg_kernels"
    index = next(kernels.rglob("*.nbi"))
    if how == "the folder above":
        cache.chmod(0o777)
    elif how == "the cache":
        kernels.chmod(0o777)
    elif how == "a file, for the group":
        index.chmod(0o660)
    elif how == "a file of another user":
        os.chown(index, 12345, 12345)
    elif how == "a folder of another user":
        os.chown(index.parent, 12345, 12345)
    else:
        index.rename(cache / "elsewhere")
        index.symlink_to(cache / "elsewhere")


HOW = ["the folder above", "the cache", "a file, for the group", "a link"]
GIVEN_AWAY = ["a file of another user", "a folder of another user"]


@pytest.mark.parametrize("how", [*HOW, *(GIVEN_AWAY if os.geteuid() == 0 else ())])
def test_code_that_others_could_have_put_there_is_not_loaded(program, tmp_path, how):
    cache = tmp_path / "cache"
    run(program, cache)
    assert "compiling" not in run(program, cache).stderr
    spoilt(cache, how)
    result = run(program, cache)
    assert result.stdout == "6.0\n"
    assert "compiling user.twice" in result.stderr
    assert f"the kernel cache {cache / 'leg_kernels'} is not used: " in result.stderr
    assert "remove" in result.stderr or "set XDG_CACHE_HOME" in result.stderr


@pytest.mark.parametrize("mask", [0o000, 0o002, 0o077])
def test_a_cache_is_private_whatever_the_umask(program, tmp_path, mask):
    cache = tmp_path / "cache"
    cache.mkdir()
    first, second = (run(program, cache, f"import os; os.umask({mask})\n") for _ in range(2))
    assert "compiling user.twice" in first.stderr
    assert second.stderr == ""
    assert not [p for p in (cache / "leg_kernels").rglob("*") if p.stat().st_mode & 0o022]
