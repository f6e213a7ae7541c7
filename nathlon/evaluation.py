"""One selection of given checkpoints, in a folder of its own."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence

from arena.entrant import Entrant
from arena.pool import Pool
from arena.store import Store
from nathlon.config import Config
from nathlon.field import Field
from nathlon.output import OutputFolder
from nathlon.pipeline import WAITING, select
from nathlon.publish import publish
from nathlon.run import OnMatch, Run
from reports.selection import Selection


def evaluate(
    entrants: Sequence[Entrant], output: OutputFolder, config: Config, workers: int, on_match: OnMatch
) -> Selection | None:
    """Run the whole selection and leave its report.

    A selection that was stopped goes on from what its store holds.

    Args:
        entrants: the candidates, all of one circuit and car.
        output: where everything goes.
        config: how to select.
        workers: processes.
        on_match: told about progress.

    Returns:
        what the report shows; None where people must vote first.
    """
    config = config.model_copy(update={"circuit": entrants[0].circuit, "car": entrants[0].car})
    plan = {"config": config.digest, "entrants": [entrant.id for entrant in entrants]}
    name = f"selection-{hashlib.sha256(json.dumps(plan).encode()).hexdigest()[:12]}"
    with Store(output.store) as store, Pool(workers) as pool:
        store.begin_run(name, plan)
        run = Run(store, name, (config.seed,), pool, on_match)
        status = select(run, Field(tuple(entrants)), config)
        selection = None if status == WAITING else publish(store, name, output)
        store.end_run(name, status)
    return selection
