"""How rulings move along the rails of a strip."""

import numpy as np
from developable_strips import SADDLE

from cqblend.patterns.flattening.development import RulingMotion


def test_motion_of_a_saddle():
    state = RulingMotion(SADDLE)(np.array([0.0, 0.5]))
    np.testing.assert_allclose(state.length, [1, np.hypot(1, 0.25)])
    np.testing.assert_allclose(state.direction[0], [0, 1, 0])
    np.testing.assert_allclose([state.across_first[0], state.across_second[0]], [[4, 0, 0], [4, 0, 0.5]])
    assert state.along_first[0] == 0
