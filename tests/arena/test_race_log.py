"""How cars stand in the world, against scipy's rotations."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from nathlon.arena.race_log import orientation

ANGLE = st.floats(-3.2, 3.2)
TILT = st.floats(-1.5, 1.5)


@given(st.lists(st.tuples(ANGLE, TILT, ANGLE), min_size=1, max_size=6))
def test_a_car_is_turned_by_yaw_then_pitch_then_roll(angles: list[tuple[float, float, float]]) -> None:
    yaw, pitch, roll = np.array(angles).T
    turned = Rotation.from_quat(orientation(yaw, pitch, roll))
    expected = Rotation.from_euler("ZYX", np.array(angles))
    np.testing.assert_allclose(turned.as_matrix(), expected.as_matrix(), atol=1e-12)
    together = orientation(yaw[None], pitch[None], roll[None])
    np.testing.assert_array_equal(together[0], orientation(yaw, pitch, roll))
