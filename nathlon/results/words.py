"""What stages are called, and what a world's users call an episode, in sentences."""

from __future__ import annotations

STAGES = {"pareto": "filter", "battery": "n-athlon", "tournament": "round robin"}
"""What readers call the stages that judge."""


def stage_called(stage: str) -> str:
    """What readers call a stage; one of another name by that."""
    return STAGES.get(stage, stage)


def an_episode(episode: str) -> str:
    """One, with its article."""
    return f"{'an' if episode[:1].lower() in 'aeiou' else 'a'} {episode}"


def episodes(episode: str) -> str:
    """Several of them."""
    return f"{episode}{'es' if episode.endswith(('s', 'x', 'ch', 'sh')) else 's'}"
