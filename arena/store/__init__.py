"""The store: what is kept of selections, in a SQLite file or a PostgreSQL database."""

from nathlon.arena.store.claims import WorkerRecord
from nathlon.arena.store.log import LogEntry
from nathlon.arena.store.matches import Finished
from nathlon.arena.store.queue import Queued
from nathlon.arena.store.runs import FoundEntrant, RunRecord
from nathlon.arena.store.store import Store

__all__ = ["Finished", "FoundEntrant", "LogEntry", "Queued", "RunRecord", "Store", "WorkerRecord"]
