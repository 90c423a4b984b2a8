"""Bytes by their SHA-256. Content addressed: a blob never changes, and the same bytes are kept once.

``Blobs``      the port: put_if_absent, get, stream, exists, delete, and what uploads and the sweep need
``LocalBlobs`` a directory, ``ab/cd/abcd...``; what it has accepted survives a power cut
``MemoryBlobs`` the same in memory, for tests
``open_blobs(settings)``

Order of writing: a blob is put first, then the row that names it is committed. So a blob without a
row may be about to get one; ``delete`` spares what was put within a grace period, and putting a blob
that is there already starts its grace anew.
"""

from __future__ import annotations

import fcntl
import hashlib
import io
import os
import tempfile
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from errno import EDQUOT, ENOSPC
from pathlib import Path
from typing import IO, Protocol

from reebase.errors import TooManyBytes
from store.errors import BlobNotFound, CorruptBlob, StorageFull, UnsupportedDatabase
from store.settings import Settings

__all__ = ["BlobWriter", "Blobs", "LocalBlobs", "MemoryBlobs", "open_blobs"]

_CHUNK = 1 << 20


class BlobWriter(Protocol):
    """Takes the bytes of one blob as they come."""

    @property
    def size(self) -> int:
        """How many bytes were written so far."""

    def write(self, data: bytes) -> None:
        """Appends. Raises TooManyBytes as soon as the limit is passed, StorageFull."""

    def commit(self) -> str:
        """Keeps the blob, durably, and returns its SHA-256. Without it, leaving the context drops it."""


class Blobs(Protocol):
    """Where blobs are kept. Hashes are 64 hexadecimal digits."""

    def put_if_absent(self, data: bytes | Iterable[bytes], *, limit: int | None = None) -> str:
        """Keeps the bytes unless they are there; either way their grace period starts now."""

    def writer(self, limit: int | None = None) -> AbstractContextManager[BlobWriter]:
        """A blob of unknown length, hashed while it is written. limit: in bytes."""

    def get(self, sha256: str) -> bytes:
        """The whole blob, its hash verified. Raises BlobNotFound, CorruptBlob."""

    def stream(self, sha256: str, chunk: int = _CHUNK) -> Iterator[bytes]:
        """The blob in pieces. Raises BlobNotFound at once, CorruptBlob before the last piece."""

    def exists(self, sha256: str) -> bool: ...

    def size(self, sha256: str) -> int:
        """In bytes. Raises BlobNotFound."""

    def delete(self, sha256: str, *, grace_seconds: float = 0.0) -> bool:
        """Removes it unless it was put within the grace period; says whether it did."""

    def all(self) -> Iterator[str]:
        """Every blob, in order of hash."""

    def clear_unfinished(self, *, grace_seconds: float) -> int:
        """Removes what writers that died left behind; says how many."""

    def hold(self) -> AbstractContextManager[None]:
        """While it is held, ``delete`` removes nothing."""


def _is_hash(text: str) -> bool:
    return len(text) == 64 and set(text) <= set("0123456789abcdef")


def _check_hash(sha256: str) -> str:
    # A hash becomes part of a path.
    if not _is_hash(sha256):
        raise BlobNotFound(f"{sha256[:80]!r} is not a SHA-256 in lower-case hexadecimal digits.")
    return sha256


def _too_many(limit: int) -> TooManyBytes:
    return TooManyBytes(f"The file is larger than the {limit} bytes that are accepted.", limit=limit)


@contextmanager
def _space() -> Iterator[None]:
    try:
        yield
    except OSError as error:
        if error.errno in (ENOSPC, EDQUOT):
            raise StorageFull from error
        raise


def _sync_directory(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


class _LocalWriter:
    def __init__(self, blobs: LocalBlobs, file: IO[bytes], path: Path, limit: int | None) -> None:
        self._blobs, self._file, self._path, self._limit = blobs, file, path, limit
        self._hash = hashlib.sha256()
        self.size = 0

    def write(self, data: bytes) -> None:
        self.size += len(data)
        if self._limit is not None and self.size > self._limit:
            raise _too_many(self._limit)
        self._hash.update(data)
        self._file.write(data)

    def commit(self) -> str:
        self._file.flush()
        os.fsync(self._file.fileno())
        sha256 = self._hash.hexdigest()
        self._blobs._place(self._path, sha256)
        return sha256


class LocalBlobs:
    """Blobs in a directory of this machine, shared by its processes."""

    def __init__(self, directory: str | os.PathLike[str]) -> None:
        self.directory = Path(directory).absolute()
        self._unfinished = self.directory / "unfinished"
        self._lock_path = self.directory / "lock"
        self.directory.mkdir(parents=True, exist_ok=True)

    def put_if_absent(self, data: bytes | Iterable[bytes], *, limit: int | None = None) -> str:
        with self.writer(limit) as writer:
            for piece in (data,) if isinstance(data, bytes) else data:
                writer.write(piece)
            return writer.commit()

    @contextmanager
    def writer(self, limit: int | None = None) -> Iterator[BlobWriter]:
        with _space():
            self._unfinished.mkdir(exist_ok=True)
            # In the same file system as the blobs, so that placing one is a rename.
            descriptor, name = tempfile.mkstemp(dir=self._unfinished)
            path = Path(name)
            try:
                with os.fdopen(descriptor, "wb") as file:
                    yield _LocalWriter(self, file, path, limit)
            finally:
                path.unlink(missing_ok=True)

    def get(self, sha256: str) -> bytes:
        try:
            data = self.path(sha256).read_bytes()
        except FileNotFoundError:
            raise _missing(sha256) from None
        if hashlib.sha256(data).hexdigest() != sha256:
            raise _corrupt(sha256)
        return data

    def stream(self, sha256: str, chunk: int = _CHUNK) -> Iterator[bytes]:
        try:
            file = self.path(sha256).open("rb")
        except FileNotFoundError:
            raise _missing(sha256) from None
        return _verified(file, sha256, chunk)

    def exists(self, sha256: str) -> bool:
        return self.path(sha256).exists()

    def size(self, sha256: str) -> int:
        try:
            return self.path(sha256).stat().st_size
        except FileNotFoundError:
            raise _missing(sha256) from None

    def delete(self, sha256: str, *, grace_seconds: float = 0.0) -> bool:
        path = self.path(sha256)
        with self._locked(fcntl.LOCK_EX | fcntl.LOCK_NB) as locked:
            if not locked:
                return False
            try:
                if grace_seconds and time.time() - path.stat().st_mtime < grace_seconds:
                    return False
                path.unlink()
            except FileNotFoundError:
                return False
        return True

    def all(self) -> Iterator[str]:
        for first in sorted(self.directory.glob("[0-9a-f][0-9a-f]")):
            for second in sorted(first.glob("[0-9a-f][0-9a-f]")):
                # Whatever else a file system or a person puts there is no blob.
                yield from sorted(path.name for path in second.iterdir() if _is_hash(path.name))

    def clear_unfinished(self, *, grace_seconds: float) -> int:
        removed = 0
        for path in self._unfinished.glob("*"):
            with suppress(FileNotFoundError):
                # Every write moves the time on, so a slow upload is not taken for a dead one.
                if time.time() - path.stat().st_mtime >= grace_seconds:
                    path.unlink()
                    removed += 1
        return removed

    @contextmanager
    def hold(self) -> Iterator[None]:
        with self._locked(fcntl.LOCK_SH):
            yield

    def path(self, sha256: str) -> Path:
        """Where the blob lies, whether it is there or not."""
        _check_hash(sha256)
        return self.directory / sha256[:2] / sha256[2:4] / sha256

    def _place(self, unfinished: Path, sha256: str) -> None:
        target = self.path(sha256)
        # ``delete`` looks at the age and removes under the other side of this lock: so either it
        # sees the new age, or the blob is gone before it is placed again.
        with self._locked(fcntl.LOCK_SH):
            try:
                os.utime(target)
            except FileNotFoundError:
                target.parent.mkdir(parents=True, exist_ok=True)
                unfinished.replace(target)
        # Also where the blob or its directory was there: whoever made it may have died before this line.
        for directory in (target.parent, target.parent.parent, self.directory):
            _sync_directory(directory)

    @contextmanager
    def _locked(self, how: int) -> Iterator[bool]:
        with self._lock_path.open("ab") as file:
            try:
                fcntl.flock(file, how)
            except BlockingIOError:
                yield False
                return
            yield True


class _MemoryWriter:
    def __init__(self, blobs: MemoryBlobs, limit: int | None) -> None:
        self._blobs, self._limit = blobs, limit
        self._data = bytearray()

    @property
    def size(self) -> int:
        return len(self._data)

    def write(self, data: bytes) -> None:
        self._data += data
        if self._limit is not None and len(self._data) > self._limit:
            raise _too_many(self._limit)

    def commit(self) -> str:
        return self._blobs._keep(bytes(self._data))


class MemoryBlobs:
    """Blobs in this process's memory."""

    def __init__(self) -> None:
        self._blobs: dict[str, tuple[bytes, float]] = {}
        self._holders = 0
        self._lock = threading.Lock()

    def put_if_absent(self, data: bytes | Iterable[bytes], *, limit: int | None = None) -> str:
        with self.writer(limit) as writer:
            for piece in (data,) if isinstance(data, bytes) else data:
                writer.write(piece)
            return writer.commit()

    @contextmanager
    def writer(self, limit: int | None = None) -> Iterator[BlobWriter]:
        yield _MemoryWriter(self, limit)

    def get(self, sha256: str) -> bytes:
        try:
            return self._blobs[_check_hash(sha256)][0]
        except KeyError:
            raise _missing(sha256) from None

    def stream(self, sha256: str, chunk: int = _CHUNK) -> Iterator[bytes]:
        return _verified(io.BytesIO(self.get(sha256)), sha256, chunk)

    def exists(self, sha256: str) -> bool:
        return _check_hash(sha256) in self._blobs

    def size(self, sha256: str) -> int:
        return len(self.get(sha256))

    def delete(self, sha256: str, *, grace_seconds: float = 0.0) -> bool:
        with self._lock:
            _data, put_at = self._blobs.get(_check_hash(sha256), (b"", None))
            if put_at is None or self._holders or time.time() - put_at < grace_seconds:
                return False
            del self._blobs[sha256]
        return True

    def all(self) -> Iterator[str]:
        yield from sorted(self._blobs)

    def clear_unfinished(self, *, grace_seconds: float) -> int:
        return 0

    @contextmanager
    def hold(self) -> Iterator[None]:
        with self._lock:
            self._holders += 1
        try:
            yield
        finally:
            with self._lock:
                self._holders -= 1

    def _keep(self, data: bytes) -> str:
        sha256 = hashlib.sha256(data).hexdigest()
        with self._lock:
            self._blobs[sha256] = (data, time.time())
        return sha256


def _missing(sha256: str) -> BlobNotFound:
    return BlobNotFound(f"There is no blob {sha256}.", sha256=sha256)


def _corrupt(sha256: str) -> CorruptBlob:
    return CorruptBlob(
        f"The bytes of blob {sha256} have changed on disk; restore it from a backup.", sha256=sha256
    )


def _verified(file: IO[bytes], sha256: str, chunk: int) -> Iterator[bytes]:
    # One piece is held back, so that a damaged blob never arrives whole.
    found = hashlib.sha256()
    with file:
        piece = file.read(chunk)
        if not piece and found.hexdigest() != sha256:
            raise _corrupt(sha256)
        while piece:
            found.update(piece)
            following = file.read(chunk)
            if not following and found.hexdigest() != sha256:
                raise _corrupt(sha256)
            yield piece
            piece = following


def open_blobs(settings: Settings) -> Blobs:
    """The blobs that the settings name. Raises UnsupportedDatabase for anything but a directory."""
    if "://" in settings.blobs:
        raise UnsupportedDatabase(
            f"Blobs at {settings.blobs!r} are not supported yet; give REEBASE_BLOBS a directory.",
            found=settings.blobs,
        )
    return LocalBlobs(settings.blobs)
