"""A process that answers: what it sends is bounded in time and size, however it comes."""

from __future__ import annotations

import os
import sys
import time

import numpy as np
import pytest

from nathlon.policies.hosting.child import MOST_BYTES, Child, ChildError
from nathlon.sim.process import has_ended

SAYS = """
import os, struct, sys, time

def say(content):
    os.write(int(sys.argv[1]), content)

"""
DEEP = 100_000
"""Lists, one in another."""


STARTS_ANOTHER = """
import subprocess, sys, time
from nathlon.policies.hosting.wire import pack, pipe_to_parent

pipe = pipe_to_parent()
other = subprocess.Popen(["sleep", "1000"])
pipe.send_bytes(pack({"other": other.pid}))
time.sleep(1000)
"""
"""As a policy or a world may."""


def asked(code: str) -> Child:
    """A process that does this when it starts, and nothing more."""
    return Child([sys.executable, "-I", "-S", "-c", f"{SAYS}{code}\ntime.sleep(1000)", "{pipe}"])


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("say(b'\\0\\0')", "has not answered in 0.2 s"),
        ("say(struct.pack('!i', 1000) + b'x')", "has not answered in 0.2 s"),
        (
            "say(struct.pack('!i', 1000))\nwhile True: say(b'x'); time.sleep(0.02)",
            "has not answered in 0.2 s",
        ),
        (f"say(struct.pack('!i', {MOST_BYTES + 1}))", f"a message of more than {MOST_BYTES} bytes"),
        ("say(struct.pack('!iQ', -1, 1 << 40))", f"a message of more than {MOST_BYTES} bytes"),
        (f"say(struct.pack('!i', {4 + DEEP}) + struct.pack('<I', {DEEP}) + b'[' * {DEEP})", "no message"),
        ("say(struct.pack('!i', 1000) + b'x'); sys.exit()", "ended its process"),
    ],
)
def test_an_answer_must_come_whole_and_in_time(code: str, said: str) -> None:
    child = asked(code)
    with pytest.raises(ChildError, match=said):
        child.ask({}, limit_s=0.2 if "0.2 s" in said else 60.0)
    assert child.process.poll() is not None, "it is ended"


def test_one_that_takes_in_nothing_has_no_more_time() -> None:
    child = asked("")
    with pytest.raises(ChildError, match=r"has not answered in 0\.2 s"):
        child.ask({}, {"many": np.zeros(1 << 22)}, limit_s=0.2)
    assert child.process.poll() is not None


@pytest.mark.skipif(os.name != "posix", reason="groups of processes")
def test_what_it_has_started_ends_with_the_process_that_asks() -> None:
    child = Child([sys.executable, "-c", STARTS_ANOTHER, "{pipe}"])
    told, _ = child.ask({}, limit_s=60.0)
    assert child.process.stdin is not None
    child.process.stdin.close()  # as when this process is killed
    child.process.wait(60.0)
    for _ in range(600):
        if has_ended(told["other"]):
            break
        time.sleep(0.1)
    assert has_ended(told["other"])
