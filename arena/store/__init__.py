"""The store: what is kept of selections, in a SQLite file or a PostgreSQL database."""

from arena.store.log import LogEntry
from arena.store.runs import RunRecord
from arena.store.store import Store

__all__ = ["LogEntry", "RunRecord", "Store"]
