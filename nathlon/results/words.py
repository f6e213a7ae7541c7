"""What a world's users call an episode, in sentences."""

from __future__ import annotations


def an_episode(episode: str) -> str:
    """One, with its article."""
    return f"{'an' if episode[:1].lower() in 'aeiou' else 'a'} {episode}"


def episodes(episode: str) -> str:
    """Several of them."""
    return f"{episode}{'es' if episode.endswith(('s', 'x', 'ch', 'sh')) else 's'}"
