"""How the world's functions are compiled: one setting for all of them.

Divisions are unchecked and may become products with a reciprocal; nan keeps its meaning, since it
marks a lap that was not driven. The order of sums is kept, so that results do not depend on how
races are batched.
"""

import os
from pathlib import Path
from typing import Any

from numba import config, float32, float64, njit
from numba.extending import intrinsic

from nathlon.sim.decisive import fingerprint


def _cache_by_source() -> None:
    """Keep compiled functions apart by all that decides what they compute, unless NUMBA_CACHE_DIR is set.

    Numba notices a change in a function's own file, but not in the constants and functions that it
    takes from others: it would go on with the old ones.
    """
    if config.CACHE_DIR:  # type: ignore[attr-defined]  # set when numba loads
        return
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    folder = Path(home) / "nathlon" / fingerprint()[:16]
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return  # without a writable home, Numba's own choice of a place has to do
    config.CACHE_DIR = str(folder)  # type: ignore[attr-defined]


_cache_by_source()

OPTIONS: dict[str, Any] = {
    "nogil": True,
    "cache": True,
    "error_model": "numpy",
    "fastmath": {"contract", "arcp", "nsz"},
}

kernel = njit(**OPTIONS)
"""For functions that Python calls."""

inlined = njit(**OPTIONS, forceinline=True)
"""For functions that kernels call. A call would hand over every number of the car's parameters by
value, which costs about as much as the arithmetic."""

# A row of an array counts as a reference to the array while it lasts. Counting is atomic: it would take a
# quarter of the world's time, and threads would pass the counters of their common arrays to and fro.
LEAN_OPTIONS = OPTIONS | {"_nrt": False}

lean_kernel = njit(**LEAN_OPTIONS)
"""A kernel that does not count references to arrays, and so cannot make any."""

lean_inlined = njit(**LEAN_OPTIONS, forceinline=True)
"""For functions that lean kernels call."""


def _fused(_context: Any, a: Any, b: Any, c: Any) -> Any:
    """a * b + c, rounded once: in float32 if all three are, else in float64.

    The compiler rounds sums of products so as well, but with two products it may choose which of them
    it rounds first, and choose anew after a change elsewhere.
    """

    def build(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.fma(*arguments)

    kind = float32 if a == b == c == float32 else float64
    return kind(kind, kind, kind), build


# A kernel leaves out the context, which types cannot tell.
fused: Any = intrinsic(_fused)
