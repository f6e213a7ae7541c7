"""What an action of each entrant costs, kept with its run.

No stage decides by it and nothing that is hashed holds it: on another machine it is another figure.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from nathlon.arena.action_cost import action_costs, costed, machine
from nathlon.arena.entrant import Entrant
from nathlon.results.standing import ActionTime
from nathlon.selection.run import TIMES, Run
from nathlon.sim.errors import InputError

TIMED = "action_times"
"""Fact of a run: what the actions of its entrants cost, by id."""


def time_actions(run: Run, entrants: Sequence[Entrant]) -> dict[str, ActionTime | str]:
    """What an action of each entrant costs on this machine, or why that is not known, by id.

    What the run has measured here before stays as it is.
    """
    here = machine()
    kept: Any = run.store.facts(run.name).get(TIMED, {})
    times: dict[str, ActionTime | str] = {
        one.id: ActionTime.model_validate(kept[one.id] | {"name": one.name})
        for one in entrants
        if kept.get(one.id, {}).get("machine") == here
    }
    missing = list({one.id: one for one in entrants if one.id not in times and costed(one)}.values())
    for done, (entrant, cost) in enumerate(action_costs(run.pool, missing), 1):
        times[entrant.id] = (
            str(cost)
            if isinstance(cost, InputError)
            else ActionTime(name=entrant.name, entrant=entrant.id, machine=here, **vars(cost))
        )
        run.on_match(TIMES, done, len(missing))
    if missing:
        fresh = {id: one.model_dump(mode="json") for id, one in times.items() if isinstance(one, ActionTime)}
        run.store.put_fact(run.name, TIMED, kept | fresh)
    return times
