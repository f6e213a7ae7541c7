"""What stages are called, what a world's users call an episode, and how figures are written."""

from __future__ import annotations

import re

STAGES = {"pareto": "filter", "battery": "n-athlon", "tournament": "round robin"}
"""What readers call the stages that judge."""
SHARE = "_share"
"""At the end of the name of a measure that is a share: people read it in per cent."""
UNIT_IN_NAME = re.compile(r"_share$|_s$|_m$")
AUTOMATIC = "rule:"
"""What the name of an automatic member of a committee begins with."""


def stage_called(stage: str) -> str:
    """What readers call a stage; one of another name by that."""
    return STAGES.get(stage, stage)


def an_episode(episode: str) -> str:
    """One, with its article."""
    return f"{'an' if episode[:1].lower() in 'aeiou' else 'a'} {episode}"


def episodes(episode: str) -> str:
    """Several of them."""
    return f"{episode}{'es' if episode.endswith(('s', 'x', 'ch', 'sh')) else 's'}"


def measure_called(name: str) -> str:
    """What readers call a measure, without its unit: `off_course_share` is off course, `lap_s` lap."""
    return UNIT_IN_NAME.sub("", name).replace("_", " ")


def measure_head(name: str, unit: str) -> str:
    """A measure at the head of its values, which are in this unit, shares in per cent."""
    told = "%" if name.endswith(SHARE) else "" if unit in ("1", "1/km") else unit
    called = measure_called(name)
    return f"{called[:1].upper()}{called[1:]}{told and f', {told}'}"


def counted(number: int, what: str, several: str = "") -> str:
    """So many of what is counted; `several` where more than one are not called by adding an s."""
    return f"{number:,} {what if number == 1 else several or what + 's'}"


def percent(share: float | None, digits: int = 0) -> str:
    """A share in per cent; a dash where there is none."""
    return "–" if share is None else f"{100 * share:.{digits}f} %"


def interval(low: float | None, high: float | None, form: str = ".2f") -> str:
    """An interval by its bounds; nothing where it is not known."""
    return "" if low is None or high is None else f"{low:{form}} to {high:{form}}"


def figure(
    value: float | None, low: float | None = None, high: float | None = None, form: str = ".2f"
) -> str:
    """A figure with its interval, if it is known; what the races could not tell is a dash."""
    shown = "–" if value is None else format(value, form)
    within = interval(low, high, form)
    return f"{shown} ({within})" if within else shown
