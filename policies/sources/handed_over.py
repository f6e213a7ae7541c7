"""Policies that a program hands over as objects: they race in its own process, under names that it gives."""

from __future__ import annotations

import hashlib
import io
import pickle
import sys
from functools import cached_property
from types import CodeType, FunctionType
from typing import Any, NamedTuple

from nathlon.policies.policy import Policy
from nathlon.policies.sources import OBJECT
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec

PROTOCOL = 4
"""Of pickle: ids are the same in all versions of Python."""


class _Known(NamedTuple):
    """A policy and its id when it was handed over, which nothing changes that it notes in use."""

    policy: Policy
    identity: str


_policies: dict[str, _Known] = {}


def hand_over(policy: Policy, name: str) -> str:
    """Make a policy known, and return the source that stands for it: `object:NAME`.

    Raises:
        InputError: if it is no policy, or its contents do not tell it apart.
    """
    if not isinstance(getattr(policy, "observation_spec", None), ObservationSpec):
        raise InputError(f"policy {name!r}: field observation_spec is missing, expected an ObservationSpec")
    for method in ("initial_memory", "act"):
        if not callable(getattr(policy, method, None)):
            raise InputError(f"policy {name!r}: method {method} is missing, expected a policy")
    identity = _identity(policy, name)
    source = f"{OBJECT}:{name}"
    before = _policies.get(source)
    if before is not None and before.policy is not policy and before.identity != identity:
        raise InputError(f"policy {name!r}: handed over before with other contents, expected another name")
    _policies[source] = _Known(policy, identity)
    return source


def handed_over(source: str) -> Policy:
    """The policy of a source.

    Raises:
        InputError: if this process was not given it.
    """
    return _known(source).policy


def object_id(source: str) -> str:
    """The id of the policy of a source: of its file where it comes from one, or of its methods and its state.

    The state is that in which it was handed over.

    Raises:
        InputError: if this process was not given it.
    """
    return _known(source).identity


def _known(source: str) -> _Known:
    if source not in _policies:
        raise InputError(f"{source}: lives only in the program that made it, expected a file or a plugin")
    return _policies[source]


def _identity(policy: Policy, name: str) -> str:
    known = getattr(policy, "id", None)
    if isinstance(known, str):
        return known
    digest = hashlib.sha256(type(policy).__qualname__.encode())
    for kind in type(policy).__mro__:
        for attribute, value in sorted(vars(kind).items()):
            if isinstance(value, FunctionType):
                digest.update(f"{attribute}{_instructions(value.__code__)}".encode())
    try:
        written = io.BytesIO()
        _Pickler(written, PROTOCOL).dump(_state(policy))
    # Any attribute of a stranger's object may refuse.
    except Exception as error:
        raise InputError(
            f"policy {name!r}: cannot be pickled ({error}), expected so, or a text as its attribute id"
        ) from None
    digest.update(written.getbuffer())
    return digest.hexdigest()


class _Pickler(pickle.Pickler):
    """Writes down what tells objects apart; equal ones alike in all processes."""

    def reducer_override(self, value: Any) -> Any:
        torch: Any = sys.modules.get("torch")
        if torch and isinstance(value, torch.Tensor) and value.layout == torch.strided:
            # Its own way names the address at which the numbers lie.
            numbers = value.detach().cpu().contiguous().flatten().view(torch.uint8).numpy()
            return tuple, ((str(value.dtype), tuple(value.shape), numbers.tobytes()),)
        kind: Any = type(value)
        if kind.__reduce_ex__ is not object.__reduce_ex__ or not _scratch(value):
            return NotImplemented
        function, arguments, _, *items = value.__reduce_ex__(PROTOCOL)
        return function, arguments, _state(value), *items


def _state(value: Any) -> Any:
    """What an object says that it consists of, without its scratch."""
    state = value.__getstate__()
    scratch = _scratch(value)
    if not scratch or not isinstance(state, dict):
        return state
    kept = {name: one for name, one in state.items() if name not in scratch}
    if "_buffers" in kept:
        kept["_buffers"] = {name: one for name, one in kept["_buffers"].items() if name not in scratch}
    return kept


def _scratch(value: Any) -> set[str]:
    """Names of what an object's class declares to follow from the rest, so that it may come and go.

    These are cached properties, and buffers of PyTorch that are not persistent.
    """
    named = {
        name
        for kind in type(value).__mro__
        for name, one in vars(kind).items()
        if isinstance(one, cached_property)
    }
    transient: set[str] = getattr(value, "_non_persistent_buffers_set", set())
    return named | transient | ({"_non_persistent_buffers_set"} if transient else set())


def _instructions(code: CodeType) -> str:
    """What a function does, wherever it is written."""
    constants = [_instructions(one) if isinstance(one, CodeType) else repr(one) for one in code.co_consts]
    return f"{code.co_code.hex()}{code.co_names}{constants}"
