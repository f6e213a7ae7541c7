"""Compiling the kernels once for all workers: left to themselves, each would compile every one."""

from __future__ import annotations

from collections.abc import Callable

from nathlon.arena.job import Opening
from nathlon.arena.pool import Pool
from nathlon.arena.world_finding import is_racing
from nathlon.policies.kernels import GROUPS
from nathlon.policies.sources import DRIVER


def compile_kernels(
    pool: Pool, world: str, circuit: str, car: str, on_compiled: Callable[[int, int], None]
) -> None:
    """Have what races need on the disk: compiled kernels, then the driver's practice, which runs them.

    What is there already is only loaded. A circuit or car that cannot be driven is passed over: whoever
    enters a policy there says so. Other worlds than ours have no kernels.

    Args:
        pool: compiles.
        world, circuit, car: what is raced.
        on_compiled: told how many kernels are there, and how many there are in all.
    """
    if not is_racing(world):
        return
    done, total = 0, sum(map(len, GROUPS))
    on_compiled(done, total)
    for functions in GROUPS:
        pool.open([Opening(DRIVER, function, (circuit, car)) for function in functions])
        done += len(functions)
        on_compiled(done, total)
