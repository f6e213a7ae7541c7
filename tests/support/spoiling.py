"""Spoiling files: TOML line by line and byte by byte, and paths that are no files."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

VALUES = (
    *("nan", "inf", "-inf", "1e400", "1e308", "-1e308", "1e-300", "0", "-1", "0.5", "3", "true"),
    *("1" + "0" * 400, "9" * 5000, str(2**63), str(-(2**63)), "10000000000", "1979-05-27"),
    *(
        '""',
        '"' + "x" * 100_000 + '"',
        '"a\\u0000b"',
        '"\\u001b[31m\\n"',
        '"../../nowhere"',
        '"none.toml"',
        '"."',
    ),
    *("[]", "{}", "[1]", '["", 1]', "[nan, inf]", "[[[[[1]]]]]", "{ a = 1 }", "[" * 5000 + "]" * 5000),
)
"""What may stand where another value should."""
LINES = (
    '"\\u001b[31m\\n" = 1',
    "[nowhere]",
    "[[nowhere]]",
    "a." * 20_000 + "a = 1",
    "a = " + "{a = " * 3000,
)
"""What may stand anywhere."""


def spoilt_toml(text: str, rng: np.random.Generator) -> bytes:
    """The bytes of a TOML file after one accident."""
    lines = text.splitlines()
    fields = [number for number, line in enumerate(lines) if "=" in line.partition("#")[0]]
    here, there = (int(rng.choice(fields)) for _ in range(2))
    accident = rng.choice(["value"] * 6 + ["drop", "repeat", "swap", "line", "bytes", "cut"])
    match accident:
        case "value":
            lines[here] = f"{lines[here].partition('=')[0]}= {rng.choice(VALUES)}"
        case "drop":
            del lines[here]
        case "repeat":
            lines.insert(here, lines[here])
        case "swap":
            (name, _, value), (other, _, others) = lines[here].partition("="), lines[there].partition("=")
            lines[here] = f"{name}={others}"
            lines[there] = f"{other}={value}"
        case "line":
            lines.insert(here, str(rng.choice(LINES)))
    ending, mark = rng.choice(["\n", "\n", "\r\n", "\r"]), rng.choice(["", "", "\ufeff"])
    data = (mark + ending.join(lines)).encode()
    return spoilt_bytes(data, rng) if accident in ("bytes", "cut") else data


def spoilt_bytes(data: bytes, rng: np.random.Generator) -> bytes:
    """The bytes of a file after one to three accidents; what says how to read the rest stands at its ends."""
    spoilt = bytearray(data)
    for _ in range(rng.integers(1, 4)):
        end = min(600, len(spoilt))
        place = int(rng.choice([rng.integers(len(spoilt)), rng.integers(end), -rng.integers(1, end + 1)]))
        match rng.choice(["flip", "cut", "nought", "ones", "insert", "text"]):
            case "flip":
                spoilt[place] ^= 1 << int(rng.integers(8))
            case "cut":
                del spoilt[place:]
            case "nought":
                spoilt[place : place + 8] = bytes(8)
            case "ones":
                spoilt[place : place + 8] = b"\xff" * 8
            case "insert":
                spoilt[place:place] = rng.bytes(9)
            case "text":
                spoilt[place:place] = b"\xff\xfe\0"
        if not spoilt:
            break
    return bytes(spoilt)


NO_FILES = ("missing", "folder", "pipe", "device", "huge", "binary", "a\0b", "loop", "long" * 100)


def no_file(folder: Path, kind: str, suffix: str) -> Path:
    """A path with this ending at which there is no text, nor anything else that can be read to its end."""
    path = folder / f"{kind}{suffix}"
    match kind:
        case "folder":
            path.mkdir()
        case "pipe":
            os.mkfifo(path)
        case "device":
            path.symlink_to("/dev/zero")
        case "huge":
            with path.open("wb") as file:
                file.truncate(10 << 30)
        case "binary":
            path.write_bytes(b"\x89MCAP0\r\n\xff\xfe\0")
        case "loop":
            path.symlink_to(path)
    return path
