"""Messages written for many rows at once, read by the library."""

from __future__ import annotations

import numpy as np
import pytest
from foxglove_schemas_protobuf.Log_pb2 import Log
from hypothesis import given
from hypothesis import strategies as st

from nathlon.arena import _car_state_pb2 as pb
from nathlon.arena.protobuf_rows import encode

SINT64 = st.integers(-(2**62), 2**62 - 1)


@given(st.lists(st.tuples(SINT64, SINT64, st.floats(width=64)), min_size=1, max_size=5))
def test_the_library_reads_what_was_written(rows: list[tuple[int, int, float]]) -> None:
    seeds, races, lengths = (np.array(column) for column in zip(*rows, strict=True))
    sections = [{"name": "Linde", "start_m": lengths}, {"kind": "corner", "end_m": -lengths}]
    values = {"seed": seeds, "race": races, "car_length_m": lengths, "match": "ä", "sections": sections}
    written = encode(pb.Race.DESCRIPTOR, values, len(rows))
    for row, (seed, race, length) in zip(written, rows, strict=True):
        read = pb.Race.FromString(row.tobytes())
        assert (read.seed, read.race, read.match) == (seed, race, "ä")
        assert (
            np.array([read.car_length_m, -read.sections[1].end_m]).tobytes()
            == np.array([length, length]).tobytes()
        )
        assert [(s.name, s.kind) for s in read.sections] == [("Linde", ""), ("", "corner")]


def test_numbers_that_are_not_zigzag_have_no_sign() -> None:
    times = {"timestamp": {"seconds": np.array([2**40, 0]), "nanos": np.array([1, 999_999_999])}}
    read = [Log.FromString(row.tobytes()).timestamp for row in encode(Log.DESCRIPTOR, times, 2)]
    assert [(stamp.seconds, stamp.nanos) for stamp in read] == [(2**40, 1), (0, 999_999_999)]
    with pytest.raises(ValueError, match="negative"):
        encode(pb.Incident.DESCRIPTOR, {"cars": np.array([-1])}, 1)


def test_nothing_is_written_of_no_rows() -> None:
    assert encode(pb.CarStates.DESCRIPTOR, {"time_s": np.zeros(0), "cars": []}, 0).shape == (0, 9)
    assert encode(pb.CarStates.DESCRIPTOR, {}, 3).shape == (3, 0)
