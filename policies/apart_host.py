"""The process in which a policy runs apart: `python -m nathlon.policies.apart_host DESCRIPTOR`."""

from __future__ import annotations

import sys
from functools import partial
from typing import Any

import numpy as np

from nathlon.policies.hosting.wire import messages, pack, pipe_to_parent, serve
from nathlon.policies.isolation import Globals
from nathlon.policies.load import load_policy
from nathlon.policies.memory_limit import memory_limit
from nathlon.policies.policy import Observations, Policy, has_reverse
from nathlon.sim.errors import InputError


def main() -> None:
    """Open the policy that is asked for, and answer for it until nobody asks any more."""
    pipe = pipe_to_parent()
    Globals.seeded(0).restore()
    wanted, _ = next(messages(pipe))
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
    serve(pipe, partial(_answer, policy))


def _answer(
    policy: Policy, message: dict[str, Any], arrays: dict[str, Any]
) -> tuple[dict[str, Any], dict[str, Any]]:
    if "seed" in message:
        Globals.seeded(message["seed"]).restore()
        return {}, {}
    if "cars" in message:
        return {}, {"memory": policy.initial_memory(message["cars"])}
    # Copies, for a policy may write into them.
    actions, memory = policy.act(_seen(policy, arrays), arrays["memory"].copy())
    return {}, {"actions": actions, "memory": memory}


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
