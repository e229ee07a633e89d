# SPDX-License-Identifier: Apache-2.0
"""Which of many stances is best: that whose centre of mass is farthest inside its region.

Candidates are body poses over the same feet, or footholds of one leg: leading axes of a stance.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from leg_statics.stance.region import DIRECTIONS, SupportRegion, support_region
from leg_statics.stance.stances import Load, Stance, Stances, evaluate_stances, ranking_of


class StanceChoice(NamedTuple):
    """Stances, ranked by their margins.

    Attributes:
        stances: What each carries (...).
        region: Its support region, with the margin (...).
    """

    stances: Stances
    region: SupportRegion

    @property
    def ranking(self) -> NDArray[np.int64]:
        """Flat indices of the stances that stand, largest margin first."""
        return ranking_of(self.stances.stands, self.region.margin)

    @property
    def best(self) -> int:
        """Flat index of the first of the ranking, -1 if none stands."""
        ranking = self.ranking
        return int(ranking[0]) if len(ranking) else -1


def choose_stance(stance: Stance, load: Load, directions: int = DIRECTIONS) -> StanceChoice:
    """Return stances ranked by the margins of their centres of mass.

    Args:
        stance: The candidates (...).
        load: What has to be carried.
        directions: In how many directions the borders of the regions are found, at least 3.

    Raises:
        ShapeError: If shapes do not fit.
        ValueRangeError: If a value is out of range, or the mass does not pull anywhere.
    """
    return StanceChoice(evaluate_stances(stance, load), support_region(stance, load, directions))
