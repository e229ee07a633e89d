# SPDX-License-Identifier: Apache-2.0
"""Frames of legs follow REP-103, and nothing else has changed: every service, 10,000 points a leg.

`axes_witness` tells what tests/data/former_axes.npz holds and where it comes from.
"""

import numpy as np
import pytest
from axes_witness import SINGLE, WITNESS, mixed_nodes, observe, read


@pytest.fixture(scope="module")
def today(tmp_path_factory):
    with mixed_nodes(tmp_path_factory.mktemp("axes")) as (client, robot):
        return observe(client, robot)


def test_every_answer_equals_that_in_the_former_axes(today):
    former = read(WITNESS)
    assert len(former) > 1000
    assert former.keys() <= today.keys()  # what is new, such as an index, has no witness
    counts = [name for name in former if name.endswith("/counts")]
    wrong = [name for name in counts if not np.array_equal(today[name], former[name])]
    # In flipped modes parallel_drive is SINGULAR above its swing axis now, which was overlooked.
    mended = ("hexapod", "inverse_kinematics_all/status/counts")
    wrong = [n for n in wrong if not (n.startswith(mended[0]) and n.endswith(mended[1]))]
    assert wrong == []
    for name in former.keys() - set(counts):
        atol = 1e-5 if f"/{SINGLE}/" in name else 1e-9
        if today[name].shape != former[name].shape or not np.allclose(
            today[name], former[name], rtol=0.0, atol=atol
        ):
            wrong.append(name)
    assert sorted(wrong) == []
