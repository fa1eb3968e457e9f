"""What the tests of the players share: a scene whose distances can be worked out by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

# The scene, in metres; x to the right, y up, C the centre of a 25 m x 25 m field:
#
#      K2 of match order                  T0
#      (-12, 2)                         (0, 1)
#                                         C                 K1 (4, 0)
#
#                                         K0 with the ball at (0.5, -3)
#                        T1             (0, -3)
#                      (-4, -6)
#
# K0 is K1 of the paper, K1 is its K2, K2 its K3; T0 is its T1, T1 its T2.


@pytest.fixture
def scene() -> SimpleNamespace:
    """3v2 with the ball at keeper 0; `position` in match order, then the ball."""
    position = np.array([(0, -3), (4, 0), (-12, 2), (0, 1), (-4, -6), (0.5, -3)], dtype=float)
    return SimpleNamespace(
        position=position,
        age=np.zeros(6, dtype=np.int32),
        cycles_to_ball=np.array([0, 9, 20, 65535, 65535], dtype=np.int32),
        num_keepers=3,
        order=np.array([0, 1, 2, 3, 4]),
    )
