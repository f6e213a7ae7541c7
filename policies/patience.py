"""What a process in which policies run is granted."""

from __future__ import annotations

ANSWER_S = 10.0
"""A policy that has not answered for so long has timed out: a hundred times what is between two ticks."""
FIRST_ANSWER_S = 120.0
"""Its first answer may take longer, and so may its loading: libraries start and compile."""
WORLD_OPENS_S = 100.0
"""A world in another interpreter has so long to begin, and for every reset: simulators load their assets."""
WORLD_ANSWER_S = 60.0
"""One that has not made a step for so long hangs."""
