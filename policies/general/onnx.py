"""Policies as ONNX graphs, of any environment with flat observations."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.general.outputs import Outputs
from nathlon.policies.general.policy import GeneralPolicy, Memoryless
from nathlon.policies.policy_file import content_id, opening, read_policy_file
from nathlon.policies.sources.onnx_graph import OnnxGraph, checked_card, open_session, shapes
from nathlon.sim.errors import InputError

MOST_NUMBERS = 1 << 20
"""Of an observation: a graph may say that it takes any number, and is tried with so many."""


def load_onnx(path: Path) -> GeneralPolicy:
    """The policy of a graph.

    It takes observations, float32 (n, size), and gives float32 (n, k) or actions, int64 (n,) or (n, k).

    Raises:
        InputError: if the file is no such graph, or needs more than itself.
    """
    with opening(path):
        content = read_policy_file(path)
        card = checked_card(path, content)
        graph = OnnxGraph(open_session(path, content), path)
        if not 1 <= graph.size <= MOST_NUMBERS:
            raise InputError(f"{path}: takes {graph.size} numbers, expected 1 to {MOST_NUMBERS}")

        tried = graph.probe(partial(_answer, path))
        return GeneralPolicy(
            source=str(path),
            id=content_id(content),
            algorithm=card.algorithm,
            step=card.step,
            seed=card.seed,
            observation_size=graph.size,
            network=Memoryless(lambda seen: _answer(path, graph(seen), len(seen))),
            outputs=Outputs(
                "clip", "choice" if tried.dtype == np.int64 else "argmax", count=int(tried.shape[1])
            ),
        )


def _answer(path: Path, found: list[Any], n: int) -> NDArray[Any]:
    """Numbers (n, k) among all that a graph gave for n observations."""
    match found, shapes(found):
        case [numbers], [("float32" | "int64", (rows, width))] if rows == n and width > 0:
            return numbers
        case [numbers], [("int64", (rows,))] if rows == n:
            return numbers[:, None]
    raise InputError(
        f"{path}: outputs for {n} observations are {shapes(found)}, "
        f"expected one of float32 ({n}, k), int64 ({n},) or int64 ({n}, k)"
    )
