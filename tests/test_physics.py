# SPDX-License-Identifier: Apache-2.0
"""Legs pressed in MuJoCo give way at the load that is predicted; `make physics` presses more."""

import numpy as np
import pytest
from physics import pressed_legs, trials

LEGS = pressed_legs()


@pytest.mark.parametrize("name", ["parallel_drive", "double_rhombus", "solo12"])
def test_a_leg_gives_way_at_its_load_capacity(name):
    for trial in trials(name, LEGS[name], 2):
        np.testing.assert_allclose(trial.simulated, trial.predicted, rtol=0.12)
