"""Policies as ONNX graphs, of any environment with flat observations."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.spaces import Space
from numpy.typing import NDArray

from nathlon.policies.general.outputs import Outputs
from nathlon.policies.general.policy import GeneralPolicy
from nathlon.policies.policy import Batch
from nathlon.policies.policy_file import opening, read_policy_file
from nathlon.policies.sources.normalisation import companions, identity_with
from nathlon.policies.sources.onnx_graph import OnnxGraph, open_session, shapes
from nathlon.policies.sources.onnx_model import checked_graph
from nathlon.sim.errors import InputError

MOST_NUMBERS = 1 << 20
"""Of an observation: a graph may say that it takes any number, and is tried with so many."""


def load_onnx(path: Path, seen: Space[Any] | None = None) -> GeneralPolicy:
    """The policy of a graph, for a space of observations.

    It takes observations, (n, ...) or those of a Dict one by one, and gives numbers (n, k) or actions, whole
    numbers (n,) or (n, k).

    Raises:
        InputError: if the file is no such graph, or needs more than itself.
    """
    with opening(path):
        content, beside = read_policy_file(path), companions(path).read()
        card, whole = checked_graph(path, content, beside[-1])
        graph = OnnxGraph(open_session(path, whole), path, card, seen)
        if not 1 <= graph.size <= MOST_NUMBERS:
            raise InputError(f"{path}: takes {graph.size} numbers, expected 1 to {MOST_NUMBERS}")

        tried = graph.probe(partial(_answer, path))
        return GeneralPolicy(
            source=str(path),
            id=identity_with(content, beside),
            algorithm=card.algorithm,
            step=card.step,
            seed=card.seed,
            observation_size=graph.size,
            network=_CheckedGraph(path, graph),
            outputs=Outputs(
                "clip", "choice" if tried.dtype == np.int64 else "argmax", count=int(tried.shape[1])
            ),
            observation_shape=graph.shape,
        )


class _CheckedGraph:
    """A graph as a network, whose answers are looked at."""

    def __init__(self, path: Path, graph: OnnxGraph) -> None:
        self._path, self._graph = path, graph

    def initial_memory(self, n: int) -> Batch:
        return self._graph.initial_memory(n)

    def act(self, observations: Batch, memory: Batch) -> tuple[NDArray[Any], Batch]:
        found, memory = self._graph.act(observations, memory)
        return _answer(self._path, found, len(observations)), memory


def _answer(path: Path, found: Any, n: int) -> NDArray[Any]:
    """Numbers (n, k) of what a graph gave for n observations."""
    match shapes([found]):
        case [("float32" | "int64", (rows, width))] if rows == n and width > 0:
            return found
        case [("int64", (rows,))] if rows == n:
            return found[:, None]
    raise InputError(
        f"{path}: outputs for {n} observations are {shapes([found])}, "
        f"expected one of float32 ({n}, k), int64 ({n},) or int64 ({n}, k)"
    )
