"""The process in which a policy runs apart: `python -m nathlon.policies.apart_host DESCRIPTOR`."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

from nathlon.policies.child_host import messages, pipe_to_parent
from nathlon.policies.isolation import Globals
from nathlon.policies.load import load_policy
from nathlon.policies.memory_limit import memory_limit
from nathlon.policies.policy import Observations, Policy, has_reverse
from nathlon.sim.errors import InputError
from nathlon.sim.wire import pack


def main() -> None:
    """Open the policy that is asked for, and answer for it until nobody asks any more."""
    pipe = pipe_to_parent()
    asked = messages(pipe)
    Globals.seeded(0).restore()
    wanted, _ = next(asked)
    sys.path[:] = wanted["path"]
    try:
        with memory_limit():
            policy = load_policy(wanted["source"], wanted["circuit"], wanted["car"])
    except InputError as error:
        pipe.send_bytes(pack({"refused": str(error)}))
        return
    pipe.send_bytes(
        pack({"observation_spec": policy.observation_spec.to_dict(), "reverse": has_reverse(policy)})
    )
    for message, arrays in asked:
        pipe.send_bytes(_answer(policy, message, arrays))


def _answer(policy: Policy, message: dict[str, Any], arrays: dict[str, Any]) -> bytes:
    try:
        if "seed" in message:
            Globals.seeded(message["seed"]).restore()
            return pack({})
        if "cars" in message:
            return pack({}, {"memory": policy.initial_memory(message["cars"])})
        # Copies, for a policy may write into them.
        actions, memory = policy.act(_seen(policy, arrays), arrays["memory"].copy())
        return pack({}, {"actions": actions, "memory": memory})
    # It is foreign code: whatever it raises, the user wants to know whose it is.
    except Exception as error:
        return pack({"raised": f"{type(error).__name__} ({error})"})


def _seen(policy: Policy, arrays: dict[str, Any]) -> Observations:
    """Observations as they were before they travelled."""
    if "observations" in arrays:
        return np.array(arrays["observations"])
    seen = policy.observation_spec.blank(len(arrays["memory"]))
    for name in seen.dtype.names or ():
        seen[name] = arrays[name]
    return seen


if __name__ == "__main__":
    main()
