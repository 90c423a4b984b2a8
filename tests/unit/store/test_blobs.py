"""Blobs: one suite for the directory and its twin in memory, then what only a directory can do wrong."""

from __future__ import annotations

import errno
import hashlib
import os
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from reebase.errors import TooManyBytes
from store.blobs import Blobs, LocalBlobs, MemoryBlobs, open_blobs
from store.errors import BlobNotFound, CorruptBlob, StorageFull, UnsupportedDatabase
from store.settings import Settings

DATA = b"solid tetrahedron"
SHA = hashlib.sha256(DATA).hexdigest()
OTHER = hashlib.sha256(b"other").hexdigest()


@pytest.fixture(params=["directory", "memory"])
def blobs(request: pytest.FixtureRequest, tmp_path: Path) -> Blobs:
    return LocalBlobs(tmp_path / "blobs") if request.param == "directory" else MemoryBlobs()


def test_put_and_get(blobs: Blobs) -> None:
    assert not blobs.exists(SHA)
    assert blobs.put_if_absent(DATA) == SHA
    assert blobs.put_if_absent(iter([DATA[:5], DATA[5:]])) == SHA
    assert (blobs.get(SHA), blobs.exists(SHA), blobs.size(SHA)) == (DATA, True, len(DATA))
    assert list(blobs.all()) == [SHA]


@pytest.mark.parametrize("chunk", [1, 5, 17, 100])
def test_stream_gives_all_in_pieces(blobs: Blobs, chunk: int) -> None:
    blobs.put_if_absent(DATA)
    pieces = list(blobs.stream(SHA, chunk))
    assert b"".join(pieces) == DATA
    assert max(map(len, pieces)) <= chunk


def test_the_empty_blob_is_a_blob(blobs: Blobs) -> None:
    sha256 = blobs.put_if_absent(b"")
    assert (blobs.get(sha256), list(blobs.stream(sha256))) == (b"", [])


@pytest.mark.parametrize("name", [OTHER, "", "../../etc/passwd", SHA.upper(), SHA[:-1], f"{SHA}/"])
def test_what_is_not_there(blobs: Blobs, name: str) -> None:
    blobs.put_if_absent(DATA)
    for call in (blobs.get, blobs.size, blobs.stream):
        with pytest.raises(BlobNotFound):
            call(name)
    if name == OTHER:
        assert not blobs.exists(name)
        assert not blobs.delete(name)


def test_the_limit_stops_the_stream_where_it_is_passed(blobs: Blobs) -> None:
    taken = 0

    def endless() -> Iterator[bytes]:
        nonlocal taken
        while True:
            taken += 1
            yield b"x" * 10

    with pytest.raises(TooManyBytes) as refusal:
        blobs.put_if_absent(endless(), limit=35)
    assert refusal.value.details == {"limit": 35}
    assert taken == 4
    assert list(blobs.all()) == []
    assert blobs.put_if_absent(b"x" * 35, limit=35)


def test_a_writer_that_does_not_commit_leaves_nothing(blobs: Blobs) -> None:
    with blobs.writer() as writer:
        writer.write(DATA)
        assert writer.size == len(DATA)
    with pytest.raises(ZeroDivisionError), blobs.writer() as writer:
        writer.write(DATA)
        1 / 0  # noqa: B018 - to raise
    assert list(blobs.all()) == []
    assert blobs.clear_unfinished(grace_seconds=0) == 0


def test_delete_spares_what_is_young_and_putting_again_makes_young(blobs: Blobs, tmp_path: Path) -> None:
    blobs.put_if_absent(DATA)
    assert not blobs.delete(SHA, grace_seconds=60)
    age(blobs, SHA, 120)
    blobs.put_if_absent(DATA)
    assert not blobs.delete(SHA, grace_seconds=60)
    age(blobs, SHA, 120)
    assert blobs.delete(SHA, grace_seconds=60)
    assert not blobs.exists(SHA)


def test_nothing_is_deleted_while_it_is_held(blobs: Blobs) -> None:
    blobs.put_if_absent(DATA)
    with blobs.hold():
        assert not blobs.delete(SHA)
        assert blobs.put_if_absent(b"other") == OTHER
    assert blobs.delete(SHA)


def age(blobs: Blobs, sha256: str, seconds: float) -> None:
    then = time.time() - seconds
    if isinstance(blobs, LocalBlobs):
        os.utime(blobs.path(sha256), (then, then))
    else:
        assert isinstance(blobs, MemoryBlobs)
        blobs._blobs[sha256] = (blobs._blobs[sha256][0], then)


@pytest.fixture
def local(tmp_path: Path) -> LocalBlobs:
    return LocalBlobs(tmp_path / "blobs")


def test_two_levels_of_directories(local: LocalBlobs) -> None:
    local.put_if_absent(DATA)
    assert local.path(SHA).relative_to(local.directory).parts == (SHA[:2], SHA[2:4], SHA)
    assert local.path(SHA).read_bytes() == DATA


@pytest.mark.parametrize("damage", [b"solid tetrahedroN", b"solid", b"", DATA + b"!"])
def test_damage_is_noticed(local: LocalBlobs, damage: bytes) -> None:
    local.put_if_absent(DATA)
    local.path(SHA).write_bytes(damage)
    with pytest.raises(CorruptBlob):
        local.get(SHA)
    seen = b""
    with pytest.raises(CorruptBlob):
        for piece in local.stream(SHA, 4):
            seen += piece
    assert len(seen) < max(len(damage), 1)


def test_unfinished_uploads_are_cleared_after_the_grace(local: LocalBlobs) -> None:
    with local.writer() as writer:
        writer.write(DATA)
        left = local.directory / "unfinished" / "dead"
        left.write_bytes(b"half")
        assert local.clear_unfinished(grace_seconds=60) == 0
        then = time.time() - 120
        os.utime(left, (then, then))
        assert local.clear_unfinished(grace_seconds=60) == 1
        assert writer.commit() == SHA


def test_bytes_are_on_disk_before_the_name_is(local: LocalBlobs, monkeypatch: pytest.MonkeyPatch) -> None:
    steps: list[str] = []
    fsync, replace = os.fsync, Path.replace

    def note_fsync(descriptor: int) -> None:
        where = Path(f"/proc/self/fd/{descriptor}").readlink()
        steps.append("directory" if where.is_dir() else "file")
        fsync(descriptor)

    def note_replace(self: Path, target: Path) -> Path:
        steps.append("rename")
        return replace(self, target)

    monkeypatch.setattr(os, "fsync", note_fsync)
    monkeypatch.setattr(Path, "replace", note_replace)
    local.put_if_absent(DATA)
    assert steps == ["file", "rename", "directory", "directory", "directory"]


def test_a_blob_that_another_put_is_on_disk_before_it_counts_as_kept(
    local: LocalBlobs, monkeypatch: pytest.MonkeyPatch
) -> None:
    local.put_if_absent(DATA)
    synced: list[Path] = []
    fsync = os.fsync

    def note_fsync(descriptor: int) -> None:
        synced.append(Path(f"/proc/self/fd/{descriptor}").readlink())
        fsync(descriptor)

    monkeypatch.setattr(os, "fsync", note_fsync)
    local.put_if_absent(DATA)
    assert local.path(SHA).parent in synced


def test_what_else_lies_among_the_blobs_is_none(local: LocalBlobs) -> None:
    local.put_if_absent(DATA)
    local.path(SHA).with_name(".nfs0001").touch()
    assert list(local.all()) == [SHA]


def test_a_full_disk_has_a_name(local: LocalBlobs, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(StorageFull):
        local.put_if_absent(DATA)
    assert list(local.all()) == []
    assert list((local.directory / "unfinished").iterdir()) == []


def test_open_blobs(tmp_path: Path) -> None:
    assert isinstance(open_blobs(Settings(home=tmp_path)), LocalBlobs)
    with pytest.raises(UnsupportedDatabase, match="s3://"):
        open_blobs(Settings(home=tmp_path, blobs="s3://bucket"))
