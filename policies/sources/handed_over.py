"""Policies that a program hands over as objects: they race in its own process, under names that it gives."""

from __future__ import annotations

import hashlib
import pickle
from types import CodeType, FunctionType

from nathlon.policies.policy import Policy
from nathlon.policies.sources import OBJECT
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec

_policies: dict[str, Policy] = {}


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
    identity = object_id(policy, name)
    source = f"{OBJECT}:{name}"
    if source in _policies and object_id(_policies[source], name) != identity:
        raise InputError(f"policy {name!r}: handed over before with other contents, expected another name")
    _policies[source] = policy
    return source


def handed_over(source: str) -> Policy:
    """The policy of a source.

    Raises:
        InputError: if this process was not given it.
    """
    if source not in _policies:
        raise InputError(f"{source}: lives only in the program that made it, expected a file or a plugin")
    return _policies[source]


def object_id(policy: Policy, name: str) -> str:
    """The id of a policy's file where it comes from one, or the SHA-256 of its methods and its state.

    Raises:
        InputError: if it cannot be written down.
    """
    known = getattr(policy, "id", None)
    if isinstance(known, str):
        return known
    digest = hashlib.sha256(type(policy).__qualname__.encode())
    for kind in type(policy).__mro__:
        for attribute, value in sorted(vars(kind).items()):
            if isinstance(value, FunctionType):
                digest.update(f"{attribute}{_instructions(value.__code__)}".encode())
    try:
        digest.update(pickle.dumps(policy.__getstate__()))
    # Any attribute of a stranger's object may refuse.
    except Exception as error:
        raise InputError(
            f"policy {name!r}: cannot be pickled ({error}), expected so, or a text as its attribute id"
        ) from None
    return digest.hexdigest()


def _instructions(code: CodeType) -> str:
    """What a function does, wherever it is written."""
    constants = [_instructions(one) if isinstance(one, CodeType) else repr(one) for one in code.co_consts]
    return f"{code.co_code.hex()}{code.co_names}{constants}"
