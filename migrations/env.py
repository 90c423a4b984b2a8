"""Runs migrations on the connection that ``store.migrate`` opened, or on a URL.

The URL comes from ``alembic -x url=...``, from ``sqlalchemy.url``, or from the settings. Either way all
pending migrations are one transaction.
"""

from __future__ import annotations

from alembic import context
from sqlalchemy import Connection

from store.engine import migration_connection
from store.settings import Settings
from store.tables import metadata


def _run(connection: Connection) -> None:
    # Batch: SQLite changes a table by copying it. Transactional: its DDL is, though the driver's
    # default would hide that.
    context.configure(
        connection=connection, target_metadata=metadata, render_as_batch=True, transactional_ddl=True
    )
    with context.begin_transaction():
        context.run_migrations()


given = context.config.attributes.get("connection")
if given is not None:
    _run(given)
else:
    named = context.get_x_argument(as_dictionary=True).get("url")
    url = named or context.config.get_main_option("sqlalchemy.url") or Settings().database_url
    with migration_connection(url) as opened:
        _run(opened)
