"""How a rank is written: with = after it where several share it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

ABSENT = "–"


def written_ranks(ranks: Iterable[int | None]) -> list[str]:
    """The ranks of one table as texts, such as 1=, 1=, 3; a dash for who has none."""
    all_ranks = list(ranks)
    holders = Counter(all_ranks)
    return [written_rank(rank, holders[rank] > 1) for rank in all_ranks]


def written_rank(rank: int | None, shared: bool) -> str:
    """A rank as text, given whether somebody else has it too; a dash for none."""
    if rank is None:
        return ABSENT
    return f"{rank}=" if shared else str(rank)
