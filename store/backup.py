"""Backup and restore: a directory that holds everything, checked by hash.

``backup(database, blobs, target) -> Manifest``: while service and worker run
``restore(source, settings) -> Manifest``: into a home without a database
``verify(source) -> Manifest``: raises CorruptBackup

The directory: ``reebase.sqlite`` (a consistent copy), ``blobs/ab/cd/abcd...`` (those that its rows name) and
``manifest.json``, written last. It appears whole under its name or not at all.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import tempfile
from contextlib import closing
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from store import migrate, tasks
from store.blobs import Blobs, LocalBlobs, open_blobs
from store.engine import Database, sqlite_path, sqlite_url
from store.errors import CorruptBackup, CorruptBlob, NotFound, TargetNotEmpty, UnsupportedDatabase
from store.settings import Settings
from store.sweep import all_referenced

__all__ = ["Manifest", "backup", "restore", "verify"]

_FORMAT = 1
_DATABASE, _BLOBS, _MANIFEST = "reebase.sqlite", "blobs", "manifest.json"


@dataclass(frozen=True)
class Manifest:
    """What a backup holds. schema: the database's revision. blobs: hash -> size in bytes."""

    created: str
    schema: str
    database_sha256: str
    blobs: dict[str, int]


def backup(database: Database, blobs: Blobs, target: Path) -> Manifest:
    """Writes a backup. Raises TargetNotEmpty; BlobNotFound or CorruptBlob when the store is damaged."""
    if target.exists() and any(target.iterdir()):
        raise TargetNotEmpty(f"{target} is not empty; give the backup a directory of its own.")
    partial = target.with_name(f"{target.name}.partial")
    shutil.rmtree(partial, ignore_errors=True)
    partial.mkdir(parents=True)
    # Held from before the copy: a blob that the copy names must not be swept before it is copied.
    with blobs.hold():
        database.copy_to(partial / _DATABASE)
        schema, named = _contents(partial / _DATABASE)
        kept = LocalBlobs(partial / _BLOBS)
        sizes = {}
        for sha256 in sorted(named):
            kept.put_if_absent(blobs.stream(sha256))
            sizes[sha256] = kept.size(sha256)
    manifest = Manifest(
        datetime.now(UTC).isoformat(timespec="seconds"), schema, _hash(partial / _DATABASE), sizes
    )
    record = {"format": _FORMAT, **manifest.__dict__}
    (partial / _MANIFEST).write_text(json.dumps(record, indent=1) + "\n")
    _sync(partial / _DATABASE, partial / _MANIFEST, partial)
    partial.replace(target)
    _sync(target.absolute().parent)
    return manifest


def verify(source: Path) -> Manifest:
    """Reads a backup through and compares every hash. Raises CorruptBackup, naming what is wrong."""
    try:
        record = json.loads((source / _MANIFEST).read_text())
        if record.pop("format") != _FORMAT:
            raise UnsupportedDatabase(f"{source} is a backup in a format of another version of Reebase.")
        manifest = Manifest(**record)
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise CorruptBackup(
            f"{source} is not a complete backup: {_MANIFEST} is missing or unreadable."
        ) from error
    if not (source / _DATABASE).is_file() or _hash(source / _DATABASE) != manifest.database_sha256:
        raise CorruptBackup(f"{source / _DATABASE} is missing or has changed since the backup.")
    kept = LocalBlobs(source / _BLOBS)
    for sha256 in manifest.blobs:
        try:
            for _ in kept.stream(sha256):
                pass
        except (NotFound, CorruptBlob) as error:
            raise CorruptBackup(f"In {source}: {error.message}", sha256=sha256) from error
    return manifest


def restore(source: Path, settings: Settings) -> Manifest:
    """Puts a backup where the settings say; the database comes last, so a broken-off restore is repeated.

    Tasks that ran at the time are queued again. Raises CorruptBackup before anything is written,
    TargetNotEmpty when there is a database, UnsupportedDatabase when a newer version wrote the backup.
    """
    path = sqlite_path(settings.database_url)
    # A log without its database is replayed into whatever database comes to lie beside it.
    for there in (path, *(path.with_name(path.name + end) for end in ("-wal", "-shm"))):
        if there.exists():
            raise TargetNotEmpty(f"There is a database at {there}; move it away first, nothing was changed.")
    manifest = verify(source)
    kept, blobs = LocalBlobs(source / _BLOBS), open_blobs(settings)
    for sha256 in manifest.blobs:
        blobs.put_if_absent(kept.stream(sha256))
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f"{path.name}.partial")
    partial.unlink(missing_ok=True)
    shutil.copyfile(source / _DATABASE, partial)
    url = sqlite_url(partial)
    migrate.upgrade(url)
    database = Database(url)
    try:
        with database.write() as conn:
            tasks.release_all(conn)
    finally:
        database.close()
    _sync(partial)
    partial.replace(path)
    _sync(path.parent)
    return manifest


def _contents(path: Path) -> tuple[str, set[str]]:
    """The schema of a database, and the blobs that its rows name."""
    with closing(Database(sqlite_url(path))) as copy, copy.read() as conn:
        schema = migrate.revision_of(conn) or "base"
        if migrate.is_current(conn):
            return schema, all_referenced(conn)
    # Which rows name blobs is known of this version's schema alone, so an older one is read as it would become.
    with tempfile.TemporaryDirectory(dir=path.parent) as directory:
        later = Path(directory) / path.name
        shutil.copyfile(path, later)
        migrate.upgrade(sqlite_url(later))
        with closing(Database(sqlite_url(later))) as copy, copy.read() as conn:
            return schema, all_referenced(conn)


def _hash(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _sync(*paths: Path) -> None:
    for path in paths:
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
