"""Records made of classes with annotated attributes."""

from __future__ import annotations

from typing import Annotated, Protocol

import numpy as np
from numpy.typing import NDArray

from nathlon.sim.state import CAR_STATE, CarRecord, record_dtype


class Fields(Protocol):
    gear: int
    driving: bool
    spin: Annotated[NDArray[np.float64], 4]
    yaw: float


def test_a_record_has_the_attributes_of_its_class_in_their_order() -> None:
    expected = [("gear", "i8"), ("driving", "?"), ("spin", "f8", 4), ("yaw", "f8")]
    assert record_dtype(Fields) == np.dtype(expected, align=True)
    assert CAR_STATE.names == tuple(CarRecord.__annotations__)
