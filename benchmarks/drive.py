"""Test drives: how punctual the world is, how old inputs are, what it costs, and whether people can drive.

A page stands in for a browser, in a process of its own: it sends inputs 60 times a second over the WebSocket
and reads all frames. An input works from when the first frame comes that it shaped, by one clock for both.

    python -m benchmarks.drive --json FILE

Figures: `tick_p99_ms`, lateness of a tick of 20 cars; `input_age_p99_ms`, from sending to that frame;
`frames_per_s` that came; `cpu_share_20` and `cpu_share`, cores that the server used with 20 cars and with 9;
`drivers`, laps of scripted people over those of the built-in driver, by circuit: with keys and eyes 250 ms
late, with a wheel and 200 ms, and with that wheel and no aids.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import multiprocessing
import sys
import time
from multiprocessing.connection import Connection
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from websockets.sync.client import connect
from websockets.typing import Origin

from benchmarks.result import write_result
from benchmarks.scripted_drivers import KEYS, UNAIDED, WHEEL, built_in_driver_alone, drive_alone
from nathlon.lab.drive.choice import Choice, Offer
from nathlon.lab.drive.finalists import champions
from nathlon.lab.drive.frames import HEAD, RACING
from nathlon.lab.drive.input_buffer import INPUT
from nathlon.lab.drive.room import Room
from nathlon.lab.drive.server import DriveServer, serve_drives
from nathlon.selection.publish.output import OutputFolder

CIRCUITS = ("porto-sereno", "lindenring", "grandes-landes")
STYLES = {"keys": KEYS, "wheel": WHEEL, "unaided": UNAIDED}
LAPS = 2
"""The second is a flying one."""
SEND_S = 1.0 / 60.0
SETTLE_S = 3.0
"""After the start, before anything counts."""


class Seen(NamedTuple):
    """What a page saw of a race.

    Attributes:
        frames_per_s: that came.
        ages_s: of inputs when the first frame came that they shaped.
        cpu_share: of a core, used by the server meanwhile.
        late_s: of the server's ticks meanwhile.
    """

    frames_per_s: float
    ages_s: list[float]
    cpu_share: float
    late_s: list[float]


def page(url: str, token: str, choice: dict[str, Any], seconds: float, told: Connection) -> None:
    """Drive as a browser's page does, and tell when the measurement begins and what was seen."""
    origin = Origin(url.replace("ws:", "http:"))
    with connect(url, origin=origin, compression=None, max_size=None) as socket:
        socket.send(token)
        socket.send(json.dumps({"type": "race", "choice": choice}))
        sent, ages = dict[int, float](), list[float]()
        number = shaped = frames = 0
        due = time.monotonic()
        begun = end = np.inf
        ready = False
        while (now := time.monotonic()) < end:
            if now >= due:
                number += 1
                sent[number] = now
                socket.send(INPUT.pack(number, False, 0.1 * np.sin(now), 0.6, 0.0))
                due = max(due + SEND_S, now)
            try:
                message = socket.recv(timeout=max(due - time.monotonic(), 0.0))
            except TimeoutError:
                continue
            if isinstance(message, str):
                continue
            head = np.frombuffer(message, HEAD, 1)[0]
            if not ready:
                socket.send(json.dumps({"type": "ready"}))
                ready = True
            if begun == np.inf and head["phase"] == RACING and head["time_s"] > SETTLE_S:
                begun, end = now, now + seconds
                told.send("begun")
            if begun < np.inf:
                frames += 1
                if head["number"] > shaped:
                    ages.append(time.monotonic() - sent[int(head["number"])])
            shaped = int(head["number"])
        told.send((frames / (time.monotonic() - begun), ages))


async def measure(cars: int, seconds: float) -> Seen:
    """A race of so many cars, driven by a page."""
    ours, theirs = multiprocessing.get_context("spawn").Pipe()
    offer = Offer.of(champions())
    there = [i for i, one in enumerate(offer.opponents) if one.drives(offer.circuits[0], offer.cars[0])]
    choice = Choice(
        name="page", circuit=offer.circuits[0], car=offer.cars[0], cars=cars, seat=cars, laps=3,
        opponents=tuple(there),
    )  # fmt: skip
    opened = asyncio.get_running_loop().create_future()
    with TemporaryDirectory() as folder:
        room = Room(offer, OutputFolder(Path(folder)))
        serving = asyncio.create_task(serve_drives(lambda: room, 0, opened.set_result))
        server: DriveServer = await opened
        arguments = (
            f"ws://127.0.0.1:{server.port}", server.token, choice.model_dump(mode="json"), seconds, theirs
        )  # fmt: skip
        process = multiprocessing.get_context("spawn").Process(target=page, args=arguments)
        process.start()
        await asyncio.to_thread(ours.recv)
        heat = room.heat
        assert heat is not None, "a race is under way"
        ticks, cpu_s, began = len(heat.clock.late_s), time.process_time(), time.perf_counter()
        frames_per_s, ages_s = await asyncio.to_thread(ours.recv)
        cpu_share = (time.process_time() - cpu_s) / (time.perf_counter() - began)
        late_s = heat.clock.late_s[ticks:]
        await asyncio.to_thread(process.join)
        serving.cancel()
        await asyncio.gather(serving, return_exceptions=True)
    return Seen(frames_per_s, ages_s, cpu_share, late_s)


def p99_ms(seconds: list[float]) -> float:
    """The 99th percentile, ms."""
    return round(1000.0 * float(np.percentile(seconds, 99)), 2)


def drivers() -> dict[str, dict[str, float | None]]:
    """Laps of scripted people over the built-in driver's, by circuit; None for one who left the course."""
    shares: dict[str, dict[str, float | None]] = {}
    for circuit in CIRCUITS:
        best = built_in_driver_alone(circuit, "gt3", LAPS)["best_lap_s"]
        shares[circuit] = {}
        for name, style in STYLES.items():
            lap = drive_alone(circuit, "gt3", style, LAPS)
            clean = lap["ending"] == "finished" and lap["off_course_s"] == 0.0
            shares[circuit][name] = round(lap["best_lap_s"] / best, 3) if clean else None
    return shares


def main() -> None:
    """Print and write the figures."""
    parser = argparse.ArgumentParser(prog="benchmarks.drive", description="Test drives")
    parser.add_argument("--seconds", type=float, default=30.0, help="of each race that are measured")
    parser.add_argument("--json", type=Path, help="file to write")
    options = parser.parse_args()
    full = asyncio.run(measure(20, options.seconds))
    nine = asyncio.run(measure(9, options.seconds))
    figures = {
        "cars": 20,
        "ticks": len(full.late_s),
        "tick_p99_ms": p99_ms(full.late_s),
        "input_age_p99_ms": p99_ms(full.ages_s),
        "frames_per_s": round(full.frames_per_s, 1),
        "cpu_share_20": round(full.cpu_share, 2),
        "cpu_share": round(nine.cpu_share, 2),
        "drivers": drivers(),
    }
    print(json.dumps(figures, indent=1), file=sys.stderr)
    if options.json:
        write_result(options.json, figures)


if __name__ == "__main__":
    main()
