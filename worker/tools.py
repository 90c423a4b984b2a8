"""What every job works with."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import Any, BinaryIO

from store.blobs import Blobs
from store.engine import Database
from store.follower import IndexFollower
from store.settings import Settings
from store.tasks import TaskQueue
from worker.claim import Claim
from worker.sandbox import Finished, Sandbox

__all__ = ["Tools", "pieces"]

_PIECE = 1 << 20


@dataclass(frozen=True)
class Tools:
    """The worker's settings, store and sandbox."""

    settings: Settings
    database: Database
    queue: TaskQueue
    blobs: Blobs
    sandbox: Sandbox

    @cached_property
    def follower(self) -> IndexFollower:
        """The index of each collection, which queries search; built when the first one comes."""
        return IndexFollower(self.database, self.settings.gallery_memory_bytes)

    @contextmanager
    def described(
        self, claim: Claim, source: str | bytes, profile: dict[str, Any], *, format: str | None,
        outputs: tuple[str, ...] = (), descriptors: Iterable[str] = (), progress: bool = True,
    ) -> Iterator[Finished]:  # fmt: skip
        """Describe a mesh in a child: the hash of its blob, or its bytes.

        The files are ``description`` (see ``Description.load``), ``kept`` (what these descriptors keep, see
        ``reebase.descriptors.kept.load``) and the outputs asked for: ``cleaned``, ``denoised``. Raises ChildError,
        BlobNotFound, CorruptBlob, and what ``claim.tick`` raises.
        """
        arguments = {"format": format, "profile": profile, "descriptors": [*descriptors]}
        files = ("description", "kept", *outputs)
        with self.computed(claim, "describe", arguments, source, files, progress) as finished:
            yield finished

    @contextmanager
    def computed(
        self, claim: Claim, computation: str, arguments: dict[str, Any], source: str | bytes,
        outputs: tuple[str, ...], progress: bool = True,
    ) -> Iterator[Finished]:  # fmt: skip
        """Run a computation on meshes, which gets ``limits`` too; the rest as ``described``."""
        limits = {
            "bytes": self.settings.max_upload_bytes,
            "vertices": self.settings.max_vertices,
            "faces": self.settings.max_faces,
        }
        with tempfile.TemporaryFile() as file:
            # A copy, because a blob may lie elsewhere, and because its hash is verified on the way.
            with claim.kept():
                for piece in [source] if isinstance(source, bytes) else self.blobs.stream(source):
                    file.write(piece)
                file.seek(0)
            with self.sandbox.run(
                computation, {**arguments, "limits": limits}, file, outputs,
                progress=claim.progress if progress else None, tick=claim.tick,
            ) as finished:  # fmt: skip
                yield finished


def pieces(file: BinaryIO) -> Iterator[bytes]:
    """The rest of a file, a MiB at a time."""
    while piece := file.read(_PIECE):
        yield piece
