"""Alembic's way in: brings the connection that `nathlon.arena.store.opening` hands it up to date."""

from alembic import context

context.configure(
    connection=context.config.attributes["connection"],
    version_table=context.config.attributes["version_table"],
)
context.run_migrations()
