"""TORCS 1.3.7 without graphics: a race of 8 and one of 20 touring cars on the circuit Forza.

Its own drivers (berniw, inferno, lliaw, tita) observe and act at 50 Hz, the physics runs at 500 Hz. An agent
step is a call of a driver, so that the cost of deciding, which is not counted for other peers, is part of
the figures. They are medians over the leader's laps but the first, which also bears the start of the program
and the drivers' preparations. All cars that started are counted, though one may break down on the way.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import statistics
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.peers.rates import figures, pin

DRIVERS = ("berniw", "inferno", "lliaw", "tita")
FIRST_INDEX = 3
"""Of a driver's cars, the first of the class trb1."""
DRIVER_HZ = 50.0
LAPS = 5

RACE = """<?xml version="1.0" encoding="UTF-8"?>
<params name="Quick Race" type="param" mode="mw">
  <section name="Header"><attstr name="name" val="Quick Race"/></section>
  <section name="Tracks">
    <attnum name="maximum number" val="1"/>
    <section name="1"><attstr name="name" val="forza"/><attstr name="category" val="road"/></section>
  </section>
  <section name="Races"><section name="1"><attstr name="name" val="Quick Race"/></section></section>
  <section name="Quick Race">
    <attnum name="distance" val="0"/>
    <attstr name="type" val="race"/>
    <attstr name="starting order" val="drivers list"/>
    <attstr name="restart" val="no"/>
    <attstr name="display mode" val="results only"/>
    <attnum name="laps" val="{laps}"/>
    <section name="Starting Grid">
      <attnum name="rows" val="2"/>
      <attnum name="distance to start" val="25"/>
      <attnum name="distance between columns" val="20"/>
      <attnum name="offset within a column" val="10"/>
      <attnum name="initial speed" val="0"/>
      <attnum name="initial height" val="0.2"/>
    </section>
  </section>
  <section name="Drivers"><attnum name="maximum number" val="{cars}"/>{drivers}</section>
</params>
"""
DRIVER = """
    <section name="{place}">
      <attnum name="idx" val="{index}"/>
      <attstr name="module" val="{module}"/>
    </section>"""


def race_text(cars: int) -> str:
    """Configuration of a race in which the drivers take turns on the grid."""
    drivers = "".join(
        DRIVER.format(
            place=place + 1,
            index=FIRST_INDEX + place // len(DRIVERS),
            module=DRIVERS[place % len(DRIVERS)],
        )
        for place in range(cars)
    )
    return RACE.format(laps=LAPS, cars=cars, drivers=drivers)


def cpu_s(script: int) -> float:
    """CPU seconds so far of the one program that a running shell script waits for (see proc(5))."""
    child = Path(f"/proc/{script}/task/{script}/children").read_text().strip()
    fields = Path(f"/proc/{child}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def laps(program: str, cars: int) -> list[tuple[float, float]]:
    """Simulated and CPU seconds so far whenever the leader completes a lap; `RuntimeError` if he does not."""
    with TemporaryDirectory() as home:
        config = Path(home) / "race.xml"
        config.write_text(race_text(cars))
        command = ["stdbuf", "-oL", program, "-r", str(config)]
        environment = {**os.environ, "HOME": home}
        with subprocess.Popen(
            command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        ) as running:
            # TORCS tells the time at every lap; the script it is started by waits for it.
            times = [
                (float(lap[1]), cpu_s(running.pid))
                for line in running.stdout or ()
                if (lap := re.match(r"Sim Time:\s*([\d.]+)", line))
            ]
    if len(times) != LAPS:
        raise RuntimeError(f"TORCS raced {len(times)} laps, expected {LAPS}")
    return times


def measure(program: str, cars: int) -> dict[str, float]:
    """Figures of a race of `cars`."""
    rate = statistics.median(
        cars * (end_s - start_s) / (end_cpu_s - start_cpu_s)
        for (start_s, start_cpu_s), (end_s, end_cpu_s) in pairwise(laps(program, cars))
    )
    return figures(DRIVER_HZ * rate, rate)


def main() -> None:
    """Print the figures as JSON."""
    program = shutil.which("torcs", path=f"{os.environ.get('PATH', os.defpath)}:/usr/games")
    if program is None:
        sys.exit("TORCS is not installed (Debian, Ubuntu: package torcs).")
    pin()
    print(json.dumps({f"torcs_{cars}": measure(program, cars) for cars in (8, 20)}))


if __name__ == "__main__":
    main()
