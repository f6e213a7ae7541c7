"""How a rank is written: as the range of those that are possible."""

from __future__ import annotations

from typing import Final

ABSENT: Final = "–"


def written_rank(best: int | None, worst: int | None) -> str:
    """The ranks that are possible as text, such as 1 to 3, or 2; a dash for who has none.

    Runs of older versions did not keep the worst one.
    """
    if best is None:
        return ABSENT
    if worst is None:
        return f"from {best}"
    return str(best) if worst == best else f"{best} to {worst}"
