"""Signatures of SSH keys, which OpenSSH makes and checks."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

from nathlon.sim.errors import InputError
from nathlon.sim.names import printable

NAMESPACE = "nathlon"
"""So that a signature for something else is none of a pack."""
PATIENCE_S = 120.0
"""For whoever must type a passphrase."""


def sign(content: bytes, key: Path) -> bytes:
    """The signature of some bytes by a private key, or by the agent that has it.

    Raises:
        InputError: if OpenSSH is not there, or does not sign.
    """
    return _ssh_keygen(["-Y", "sign", "-n", NAMESPACE, "-f", str(key)], content, f"{key}: cannot sign")


def signer(content: bytes, signature: Path, allowed: Path | None) -> str:
    """Who has signed some bytes: a principal of the allowed ones, or the key's fingerprint.

    Args:
        content: what was signed.
        signature: file with it.
        allowed: file of allowed signers, see `man ssh-keygen`; without one any key will do.

    Raises:
        InputError: if the signature is not one of these bytes, or of nobody who is allowed.
    """
    wrong = "the signature is not of this pack"
    if allowed is None:
        checked = ["-Y", "check-novalidate", "-n", NAMESPACE, "-s", str(signature)]
        said = _ssh_keygen(checked, content, wrong).decode("utf-8", "replace")
        found = re.search(r"SHA256:\S+", said)
        return f"the key {found[0]}" if found else "a key"
    found_of = ["-Y", "find-principals", "-f", str(allowed), "-s", str(signature)]
    nobody = f"the signer is not in {allowed}"
    principals = _ssh_keygen(found_of, b"", nobody).decode("utf-8", "replace").split()
    if not principals:
        raise InputError(nobody)
    verified = [
        "-Y",
        "verify",
        "-f",
        str(allowed),
        "-I",
        principals[0],
        "-n",
        NAMESPACE,
        "-s",
        str(signature),
    ]
    _ssh_keygen(verified, content, wrong)
    return printable(principals[0])


def _ssh_keygen(arguments: list[str], content: bytes, failed: str) -> bytes:
    try:
        done = subprocess.run(
            ["ssh-keygen", *arguments], input=content, capture_output=True, timeout=PATIENCE_S, check=False
        )
    except FileNotFoundError:
        raise InputError("ssh-keygen is not there, expected that of OpenSSH 8.2 or newer") from None
    except subprocess.TimeoutExpired:
        raise InputError(f"{failed}: no answer within {PATIENCE_S:g} s") from None
    if done.returncode != 0:
        said = printable(" ".join(done.stderr.decode("utf-8", "replace").split()))[:200]
        raise InputError(f"{failed}: {said}" if said else failed)
    return done.stdout
