"""Actors of the Ray cluster that this process has joined."""

from __future__ import annotations

from typing import Any


def start_actor(kind: type, name: str, *arguments: Any, **options: Any) -> Any:
    """Have Ray start an actor, of which it repeats nothing on its own.

    Args:
        kind: class of what is there.
        name: for people.
        arguments: of the class.
        options: what else Ray is asked for, processors (`num_cpus`) for instance.
    """
    import ray

    once = {"max_restarts": 0, "max_task_retries": 0}
    return ray.remote(kind).options(name=name, **once, **options).remote(*arguments)
