"""What the other interpreter imports: it has gym and numpy, and no nathlon."""

from typing import Any


def pole() -> Any:
    """A pole to be balanced: `step` gives four values, `reset` an observation alone."""
    import gym  # type: ignore[import-not-found]

    return gym.make("CartPole-v1")
