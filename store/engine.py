"""The database: one writer per process, readers beside it. The only place that knows a pragma.

``Database(url)``
  ``.write()``  context -> Connection inside BEGIN IMMEDIATE; commits at the end, rolls back on an exception
  ``.read()``   context -> read-only Connection that sees one snapshot
  ``.copy_to(path)``, ``.close()``

Both contexts may be used from any thread. Do not open a Database before forking: SQLite's locks do
not survive a fork, so a process that forks opens its own afterwards.
"""

from __future__ import annotations

import sqlite3
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Engine, create_engine, event
from sqlalchemy.engine import URL, make_url
from sqlalchemy.exc import ArgumentError, OperationalError
from sqlalchemy.pool import QueuePool, StaticPool

from store.errors import StorageFull, StoreBusy, UnsupportedDatabase

__all__ = ["BUSY_SECONDS", "Database", "migration_connection", "sqlite_path", "sqlite_url"]

BUSY_SECONDS = 10.0
"""How long a writer waits for the other processes' writers."""

_STRICT_SINCE = (3, 37)
_READERS = 8
_MORE_READERS = 32  # FastAPI's thread pool has 40 threads; a reader is held for milliseconds


def sqlite_url(path: Path) -> str:
    """The URL of a SQLite file, whatever characters its path has."""
    return URL.create("sqlite", database=str(path)).render_as_string()


def sqlite_path(url: str) -> Path:
    """The file of a SQLite URL. Raises UnsupportedDatabase for any other URL, and for no file."""
    try:
        parsed = make_url(url)
    except ArgumentError as error:
        raise UnsupportedDatabase(f"{url!r} is not a database URL.") from error
    if parsed.get_backend_name() != "sqlite":
        raise UnsupportedDatabase(
            f"Databases of kind {parsed.get_backend_name()!r} are not supported yet; "
            "leave REEBASE_DATABASE_URL unset for SQLite.",
            found=parsed.get_backend_name(),
        )
    if parsed.database in (None, "", ":memory:") or parsed.query:
        raise UnsupportedDatabase(
            "The database must be a file without options, such as sqlite:////var/lib/reebase/reebase.sqlite: "
            "API and worker are processes that share it."
        )
    return Path(str(parsed.database)).absolute()


def _check_version() -> None:
    if sqlite3.sqlite_version_info < _STRICT_SINCE:
        raise UnsupportedDatabase(
            f"SQLite {sqlite3.sqlite_version} is too old: Reebase needs 3.37 or newer for STRICT tables. "
            "It comes with Python; use a newer Python build.",
            found=sqlite3.sqlite_version,
        )


def _connect(path: Path, mode: str) -> sqlite3.Connection:
    # isolation_level None: the driver must not open or commit transactions by itself.
    connection = sqlite3.connect(
        f"{path.as_uri()}?mode={mode}", uri=True, timeout=BUSY_SECONDS, isolation_level=None,
        check_same_thread=False,
    )  # fmt: skip
    pragmas = [f"busy_timeout = {int(BUSY_SECONDS * 1000)}", "foreign_keys = ON"]
    if mode == "ro":
        pragmas.append("query_only = ON")
    else:
        # FULL: what was answered 202 survives a power cut.
        pragmas += ["journal_mode = WAL", "synchronous = FULL"]
    try:
        for pragma in pragmas:
            _set(connection, pragma)
    except sqlite3.Error:
        connection.close()
        raise
    return connection


def _set(connection: sqlite3.Connection, pragma: str) -> None:
    # Two processes that turn a new file to WAL at once: SQLite refuses one without waiting.
    until = time.monotonic() + BUSY_SECONDS
    while True:
        try:
            connection.execute(f"PRAGMA {pragma}").close()
            return
        except sqlite3.OperationalError as error:
            if error.sqlite_errorcode & 0xFF != sqlite3.SQLITE_BUSY or time.monotonic() > until:
                raise
        time.sleep(0.01)


def _engine(path: Path, mode: str, begin: str, **pool: Any) -> Engine:
    engine = create_engine(URL.create("sqlite"), creator=lambda: _connect(path, mode), **pool)

    @event.listens_for(engine, "begin")
    def _begin(connection: Connection) -> None:
        connection.exec_driver_sql(begin)

    return engine


@contextmanager
def _named_errors() -> Iterator[None]:
    """Gives the two failures that say something about the machine, not about the code, their class."""
    try:
        yield
    except OperationalError as error:
        code = getattr(error.orig, "sqlite_errorcode", 0) & 0xFF
        if code in (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED):
            raise StoreBusy from error
        if code == sqlite3.SQLITE_FULL:
            raise StorageFull from error
        raise


class Database:
    """A SQLite database that several processes share.

    Raises UnsupportedDatabase for a URL of another kind and for a SQLite without STRICT tables.
    """

    def __init__(self, url: str) -> None:
        _check_version()
        self.url = url
        self.path = sqlite_path(url)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self._lock = threading.Lock()
        self._owner: int | None = None
        self._closed = False
        self._writer = _engine(self.path, "rwc", "BEGIN IMMEDIATE", poolclass=StaticPool)
        self._readers = _engine(
            self.path, "ro", "BEGIN", poolclass=QueuePool, pool_size=_READERS, max_overflow=_MORE_READERS
        )
        with _named_errors():
            self._writer.connect().close()  # makes the file and its WAL, which readers cannot

    @contextmanager
    def write(self) -> Iterator[Connection]:
        """The writer, in one transaction. Raises StoreBusy, StorageFull; RuntimeError when nested."""
        if self._owner == threading.get_ident():
            raise RuntimeError("A write transaction is already open in this thread; pass its connection on.")
        with self._lock:
            self._check_open()
            self._owner = threading.get_ident()
            try:
                with _named_errors(), self._writer.begin() as connection:
                    yield connection
            finally:
                self._owner = None

    @contextmanager
    def read(self) -> Iterator[Connection]:
        """A reader; all that is read through it belongs to one snapshot."""
        self._check_open()
        with _named_errors(), self._readers.begin() as connection:
            yield connection

    def copy_to(self, path: Path) -> None:
        """A consistent copy of the whole database while it is used (SQLite's online backup)."""
        self._check_open()
        source, target = _connect(self.path, "ro"), sqlite3.connect(path)
        try:
            source.backup(target)
            # One file, not three: a copy must not depend on a WAL that lies beside it.
            target.execute("PRAGMA journal_mode = DELETE").close()
        finally:
            target.close()
            source.close()

    def close(self) -> None:
        """Ends all connections; later calls raise RuntimeError. Closing twice is allowed."""
        with self._lock:
            self._closed = True
            self._readers.dispose()
            self._writer.dispose()

    def _check_open(self) -> None:
        if self._closed:
            raise RuntimeError("The database is closed.")


@contextmanager
def migration_connection(url: str) -> Iterator[Connection]:
    """A connection for changing the schema: one transaction, others locked out, all or nothing.

    Foreign keys are off while tables are rebuilt (SQLite's own procedure) and checked before the commit.
    """
    _check_version()
    path = sqlite_path(url)
    path.parent.mkdir(parents=True, exist_ok=True)
    engine = _engine(path, "rwc", "BEGIN EXCLUSIVE", poolclass=StaticPool)
    try:
        raw = engine.raw_connection()
        raw.cursor().execute("PRAGMA foreign_keys = OFF").close()
        raw.close()
        with _named_errors(), engine.begin() as connection:
            yield connection
            broken = connection.exec_driver_sql("PRAGMA foreign_key_check").all()
            if broken:
                raise RuntimeError(
                    f"The migration left {len(broken)} dangling references, such as {broken[0]}."
                )
    finally:
        with suppress(Exception):
            engine.dispose()
