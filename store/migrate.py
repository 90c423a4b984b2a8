"""Brings a database to the schema of this version, or back.

``upgrade(url, revision="head")``, ``downgrade(url, revision)``, ``current(url) -> str | None``,
``head() -> str``, ``is_current(conn) -> bool``, ``check(url, *, any_schema=False)``

All pending migrations are one transaction that locks other writers out: either all are applied or none,
and two processes that start at once apply them once.
"""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

from alembic import command
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import Connection

from reebase.words import program
from store.engine import Database, migration_connection, sqlite_path
from store.errors import UnsupportedDatabase

__all__ = ["check", "current", "downgrade", "head", "is_current", "revision_of", "upgrade"]

_SCRIPTS = Path(__file__).resolve().parent.parent / "migrations"


def head() -> str:
    """The revision that this version of the code works with."""
    found = ScriptDirectory.from_config(_config()).get_current_head()
    if found is None:
        raise UnsupportedDatabase(f"There are no migrations in {_SCRIPTS}; the checkout is not complete.")
    return found


def current(url: str) -> str | None:
    """The revision of a database; None when it is empty or not there yet."""
    if not sqlite_path(url).exists():
        return None
    database = Database(url)
    try:
        with database.read() as conn:
            return revision_of(conn)
    finally:
        database.close()


def is_current(conn: Connection) -> bool:
    """Whether the database has the schema of this version."""
    return revision_of(conn) == head()


def check(url: str, *, any_schema: bool = False) -> None:
    """Raises UnsupportedDatabase when there is no database, or one with another schema than this version's.

    any_schema: an older one will do.
    """
    found = current(url)
    if found is None:
        raise UnsupportedDatabase(
            f"There is no database at {sqlite_path(url)} yet: `{program()} serve` or `{program()} migrate` makes it."
        )
    if found == head():
        return
    with closing(Database(url)) as database, database.read() as conn:
        _check_known(conn)
    if not any_schema:
        raise UnsupportedDatabase(
            f"The database has schema {found}, this version needs {head()}: run `{program()} migrate` first, "
            f"after a `{program()} backup` if you may want to go back.",
            found=found, needed=head(),
        )  # fmt: skip


def upgrade(url: str, revision: str = "head") -> None:
    """Applies what is pending. Raises UnsupportedDatabase for one that a newer version wrote, StoreBusy."""
    found = current(url)
    if found is not None and found == (head() if revision == "head" else revision):
        return
    with migration_connection(url) as conn:
        _check_known(conn)
        command.upgrade(_config(conn), revision)


def downgrade(url: str, revision: str) -> None:
    """Takes migrations back down to a revision, "base" for none; what they added is lost."""
    with migration_connection(url) as conn:
        _check_known(conn)
        command.downgrade(_config(conn), revision)


def _config(conn: Connection | None = None) -> Config:
    config = Config(attributes={"connection": conn})
    config.set_main_option("script_location", str(_SCRIPTS).replace("%", "%%"))
    config.set_main_option("path_separator", "os")
    return config


def revision_of(conn: Connection) -> str | None:
    return MigrationContext.configure(conn).get_current_revision()


def _check_known(conn: Connection) -> None:
    found = revision_of(conn)
    known = [script.revision for script in ScriptDirectory.from_config(_config()).walk_revisions()]
    if found is not None and found not in known:
        raise UnsupportedDatabase(
            f"The database has schema {found}, this version knows up to {head()}: a newer Reebase wrote it. "
            "Use that version, or restore a backup.",
            found=found, known=known,
        )  # fmt: skip
