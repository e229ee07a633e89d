# SPDX-License-Identifier: Apache-2.0
"""Frames of legs follow REP-103, and nothing else has changed: every service, 10,000 points a leg.

`axes_witness` tells what tests/data/former_axes.npz holds and where it comes from.
"""

import re

import numpy as np
import pytest
from axes_witness import SINGLE, WITNESS, mixed_nodes, observe, read

from leg_kinematics import Status


@pytest.fixture(scope="module")
def today(tmp_path_factory):
    with mixed_nodes(tmp_path_factory.mktemp("axes")) as (client, robot):
        return observe(client, robot)


# Loads are vertical now, where they were along the normal of the witness's slope, candidates are
# ranked by margin, and legs without rated friction have no steps by it: that has no witness. A line
# on which no point is feasible tells what is wrong at its front, too, where it told its rear twice.
MEANS_ELSE = re.compile(
    r"/query_footholds/(verdict|limiting_joint|load_capacity|utilisation|joint_efforts|forces"
    r"|ranking)\b|/query_step_length/\dcapacity/|/query_step_length/(\dfriction/load_capacity|0friction/limits)\b"
    r"|_index_map/(\w+/)?load_capacity\b|^walker\w*/.*/query_step_length/"
)


def test_every_answer_equals_that_in_the_former_axes(today):
    former = {name: values for name, values in read(WITNESS).items() if not MEANS_ELSE.search(name)}
    assert len(former) > 1000
    assert former.keys() <= today.keys()  # what is new, such as an index, has no witness
    wrong = [name for name in former if not _same(name, today[name], former[name])]
    # In flipped modes parallel_drive is SINGULAR above its swing axis now, which was overlooked:
    # some of what was beyond a limit; postures are the same.
    mended = re.compile(r"(hexapod_\w+/\w+/inverse_kinematics_all/status)/(counts|sums)")
    places = {match[1] for match in map(mended.fullmatch, wrong) if match}
    for place in places:
        moved = today[f"{place}/counts"] - former[f"{place}/counts"]
        assert moved[Status.SINGULAR + 1] == -moved[Status.JOINT_LIMIT + 1] > 0
        assert np.count_nonzero(moved) == 2
    assert sorted(name for name in wrong if not mended.fullmatch(name)) == []


def _same(name, values, expected):
    if name.endswith("/counts"):
        return np.array_equal(values, expected)
    atol = 1e-5 if f"/{SINGLE}/" in name else 1e-9
    return values.shape == expected.shape and np.allclose(values, expected, rtol=0.0, atol=atol)
