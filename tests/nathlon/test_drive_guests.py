"""Opponents that are code or graphs: one that hangs or dies is said, and the race goes on without it."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from onnx import TensorProto, helper, numpy_helper

from nathlon.arena.race_log import Incident
from nathlon.lab.drive.choice import DriveOpponent, Offer, plan
from nathlon.lab.drive.frames import HEAD
from nathlon.lab.drive.heat import DrivenHeat, Heat
from nathlon.lab.drive.input_buffer import InputBuffer
from nathlon.policies.apart import PolicyApart
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec
from tests.policies.test_plugin import install
from tests.support.drives import Hurry, choice

CODE = """
import os
import time

import numpy as np
from nathlon.sim.observation import ObservationSpec


class Straight:
    observation_spec = ObservationSpec(course_points=1)

    def __init__(self, circuit, car):
        self.asked = 0

    def initial_memory(self, n):
        return np.zeros((n, 1), np.float32)

    def act(self, observations, memory):
        if memory.max() >= 5:
            self.fail()
        return np.tile(np.float32([[0.1, np.random.uniform(-1e-3, 1e-3)]]), (len(memory), 1)), memory + 1

    def fail(self):
        pass


class Hangs(Straight):
    def fail(self):
        time.sleep(1000.0)
"""


@pytest.fixture(autouse=True)
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A plugin that hangs after half a second."""
    site = tmp_path / "site"
    site.mkdir()
    (site / "failing.py").write_text(CODE)
    install(site, "failing", "[nathlon.policies]\nhangs = failing:Hangs\n")
    monkeypatch.syspath_prepend(site)
    monkeypatch.delitem(sys.modules, "failing", raising=False)


def test_an_opponent_that_hangs_is_said_and_the_race_goes_on_without_it() -> None:
    made = plan(choice(cars=2, seat=2, opponents=(0,)), Offer.of([DriveOpponent.of("plugin:hangs")]))
    [guest] = made.policies
    assert isinstance(guest, PolicyApart)
    said: list[Incident] = []
    ended: list[DrivenHeat | None] = []
    frames: list[bytes] = []
    clock = Hurry().clock()
    heat = Heat(made, InputBuffer(), frames.append, said.append, lambda mark: None, ended.append, clock)
    heat.run()
    [driven] = ended
    assert driven is not None
    assert driven.results.sort("car")["ending"].to_list() == ["timed_out", "stuck"]
    [told] = [incident for incident in said if incident.kind == "ending"]
    assert (told.text, told.cars) == ("hangs: has not answered in 0.5 s, and is out", (0,))
    times = [np.frombuffer(frame, HEAD, 1)[0]["time_s"] for frame in frames]
    assert sum(time_s > told.time_s for time_s in times) > 60, "the picture goes on"
    assert guest.process.poll() is not None


def endless(path: Path) -> Path:
    """A graph that counts for ever before it answers."""
    size = ObservationSpec().size
    true = numpy_helper.from_array(np.array(True), "on")
    body = helper.make_graph(
        [
            helper.make_node("Identity", ["on_in"], ["on_out"]),
            helper.make_node("Add", ["y_in", "y_in"], ["y_out"]),
        ],
        "body",
        [
            helper.make_tensor_value_info("turn", TensorProto.INT64, []),
            helper.make_tensor_value_info("on_in", TensorProto.BOOL, []),
            helper.make_tensor_value_info("y_in", TensorProto.FLOAT, ["n", 2]),
        ],
        [
            helper.make_tensor_value_info("on_out", TensorProto.BOOL, []),
            helper.make_tensor_value_info("y_out", TensorProto.FLOAT, ["n", 2]),
        ],
    )
    graph = helper.make_graph(
        [
            helper.make_node("MatMul", ["x", "w"], ["start"]),
            helper.make_node("Loop", ["", "on", "start"], ["y"], body=body),
        ],
        "policy",
        [helper.make_tensor_value_info("x", TensorProto.FLOAT, ["n", size])],
        [helper.make_tensor_value_info("y", TensorProto.FLOAT, ["n", 2])],
        [numpy_helper.from_array(np.zeros((size, 2), np.float32), "w"), true],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    path.write_bytes(model.SerializeToString())
    return path


def test_an_endless_graph_is_refused_when_it_is_offered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("nathlon.lab.drive.choice.FIRST_ANSWER_S", 1.0)
    path = endless(tmp_path / "endless.onnx")
    with pytest.raises(InputError, match=r"endless\.onnx: took more than 1 s to open, expected a policy"):
        DriveOpponent.of(str(path))
