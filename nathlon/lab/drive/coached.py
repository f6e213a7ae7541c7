"""After a test drive: the coach works on it in a process of its own, and its page opens."""

from __future__ import annotations

import threading
import webbrowser
from pathlib import Path

from nathlon.arena.race_log import start_number
from nathlon.lab.drive.keeping import Kept
from nathlon.policies.hosting.programs import complaint
from nathlon.sim.process import command_of
from nathlon.terminal import warn


class CoachAfterwards:
    """Has each kept drive coached; what is wrong with one is said in a line.

    Attributes:
        threads: one for each drive, which end by themselves.

    Args:
        folder: for the coach's folders, one a drive.
    """

    def __init__(self, folder: Path) -> None:
        self.threads: list[threading.Thread] = []
        self._folder = folder

    def __call__(self, kept: Kept, car: int) -> None:
        """Begin with a drive, and do not wait.

        Args:
            kept: where the drive is.
            car: the person's.
        """
        self.threads.append(threading.Thread(target=self._work, args=(kept.recording, car), daemon=True))
        self.threads[-1].start()

    def _work(self, recording: Path, car: int) -> None:
        out = self._folder / recording.stem
        # The next race may be under way, which must not wait for this one's numbers.
        command = command_of("nathlon.cli", "coach", recording, "--car", start_number(car), "--out", out)
        if said := complaint(command, "the coach has failed"):
            warn(f"Not coached: {said}")
        else:
            webbrowser.open((out / "index.html").absolute().as_uri())
