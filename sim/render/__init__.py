"""Rendering of an environment's race: modes, and the screen behind them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from nathlon.sim.episode import Episodes
from nathlon.sim.errors import InputError

if TYPE_CHECKING:
    from nathlon.sim.render.screen import Screen

RENDER_MODES = ["human", "rgb_array"]


def open_screen(
    mode: str | None, episodes: Episodes, names: Sequence[str], focus: int | None = None
) -> Screen | None:
    """What shows the first race of some episodes, if it is to be shown.

    Args:
        mode: None, or one of RENDER_MODES.
        episodes: of which the first race is shown.
        names: of the cars; those with the same name have the same colour.
        focus: index of the car to follow; None follows the leader.

    Raises:
        InputError: if the mode is unknown, or a window is asked for where there is no display.
    """
    if mode is None:
        return None
    if mode not in RENDER_MODES:
        raise InputError(f"render_mode is {mode!r}, expected None, 'human' or 'rgb_array'")
    # Here, so that environments that show nothing do not load pygame.
    from nathlon.sim.render.screen import Screen

    return Screen(mode == "human", episodes, names, focus)
