"""The process in which a policy runs apart: `python -m nathlon.policies.apart_host DESCRIPTOR`."""

from __future__ import annotations

import os
import signal
import sys
import threading
from multiprocessing.connection import Connection
from typing import Any

from nathlon.policies.isolation import Globals
from nathlon.policies.load import load_policy
from nathlon.policies.memory_limit import memory_limit
from nathlon.policies.policy import Policy
from nathlon.sim.errors import InputError
from nathlon.sim.wire import pack, unpack


def main() -> None:
    """Open the policy that is asked for, and answer for it until nobody asks any more."""
    # Ctrl-C is for the process that asks.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    pipe = Connection(int(sys.argv[1]))
    Globals.seeded(0).restore()
    wanted, _ = unpack(pipe.recv_bytes())
    sys.path[:] = wanted["path"]
    try:
        with memory_limit():
            policy = load_policy(wanted["source"], wanted["circuit"], wanted["car"])
    except InputError as error:
        pipe.send_bytes(pack({"refused": str(error)}))
        return
    pipe.send_bytes(pack({"observation_spec": policy.observation_spec.to_dict()}))
    while True:
        try:
            asked = unpack(pipe.recv_bytes())
        except EOFError:
            return
        pipe.send_bytes(_answer(policy, *asked))


def _answer(policy: Policy, message: dict[str, Any], arrays: dict[str, Any]) -> bytes:
    try:
        if "seed" in message:
            Globals.seeded(message["seed"]).restore()
            return pack({})
        if "cars" in message:
            return pack({}, {"memory": policy.initial_memory(message["cars"])})
        # Copies, for a policy may write into them.
        actions, memory = policy.act(arrays["observations"].copy(), arrays["memory"].copy())
        return pack({}, {"actions": actions, "memory": memory})
    # It is foreign code: whatever it raises, the user wants to know whose it is.
    except Exception as error:
        return pack({"raised": f"{type(error).__name__} ({error})"})


def _end_with_parent() -> None:
    sys.stdin.buffer.read()
    os._exit(1)


if __name__ == "__main__":
    main()
