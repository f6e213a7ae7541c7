"""A run of its own for given entrants, outside the nights."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from nathlon.arena.entrant import Entrant
from nathlon.arena.pool import Pool
from nathlon.arena.store import Store
from nathlon.selection.config import Config
from nathlon.selection.engines import engine_of
from nathlon.selection.publish.output import POLICY_LOG
from nathlon.selection.run import OnMatch, Run


@contextmanager
def single_run(
    kind: str,
    entrants: Sequence[Entrant],
    config: Config,
    store: Path | str,
    pool: Pool,
    on_match: OnMatch,
    folder: Path | None = None,
) -> Iterator[Run]:
    """Begin a run, or go on with the one of the same kind, entrants and configuration that was stopped.

    It ends as its `status` says, unless an error stops it.

    Args:
        kind: what its name begins with.
        entrants: who takes part.
        config: how.
        store: the SQLite file, or the URL of a database; it may hold other runs.
        pool: where matches run.
        on_match: told about progress.
        folder: where what policies print is kept; that of the file by default.

    Raises:
        InputError: if the store or the engine cannot be used, or the configuration names a file that is
            wrong.
    """
    plan = {"config": config.digest, "entrants": [entrant.id for entrant in entrants]}
    name = f"{kind}-{hashlib.sha256(json.dumps(plan).encode()).hexdigest()[:12]}"
    with Store(store) as opened, engine_of(config, opened, pool) as engine:
        opened.begin_run(name, plan)
        pool.log.keep_in((folder or Path(store).parent) / POLICY_LOG)
        run = Run(opened, name, (config.seed,), pool, on_match, other_engine=engine)
        yield run
        opened.end_run(name, run.status)
