"""The work of `reebase ingest`: read, upload, wait; each can be interrupted and done again."""

from __future__ import annotations

import hashlib
import queue
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

from reebase.cli.output import Steps, shown
from reebase.client import Client, RequestBroken, ServiceError, ServiceLimits, ServiceUnreachable, Shape
from reebase.errors import ReebaseError

__all__ = ["TRANSIENT", "Failure", "Intake"]

_FATAL = frozenset({"collection_not_found", "quota_exceeded", "storage_full", "redirected"})
"""Refusals that every other file would meet too."""
_FATAL_STATUS = frozenset({401, 403, 429, 502, 503, 504})
TRANSIENT = frozenset({
    "worker_died", "child_crashed", "timed_out", "out_of_memory", "storage_full", "cancelled",
})  # fmt: skip
"""Why a shape failed that another try, or one with other limits, may index."""
_SHORTEST_PAUSE, _LONGEST_PAUSE = 0.2, 15.0
_SILENT_SECONDS = 60.0

_Sent = Literal["uploaded", "relabelled", "there"]


@dataclass(frozen=True)
class Failure:
    """A file that did not become an indexed shape, and why."""

    file: str
    code: str
    detail: str


class Intake:
    """Takes the files of a folder into a collection.

    same: SHA-256 -> the files of these bytes, which are one shape. failures: so far, in no order.
    uploaded, skipped: shapes that this run sent, and that were there before; relabelled: of the latter.
    """

    def __init__(
        self, client: Client, collection: str, folder: Path, label_of: dict[Path, str], limits: ServiceLimits,
        retry_failed: bool,
    ) -> None:  # fmt: skip
        self.same: dict[str, list[Path]] = {}
        self.failures: list[Failure] = []
        self.uploaded = 0
        self.skipped = 0
        self.relabelled = 0
        self._files: Sequence[Path] = ()
        self._client = client
        self._collection = collection
        self._folder = folder
        self._label_of = label_of
        self._limits = limits
        self._retry_failed = retry_failed
        self._there: dict[str, Shape] = {}
        self._shapes: dict[str, Shape] = {}
        self._refused: set[str] = set()

    def read(self, files: Sequence[Path], begin: Steps) -> None:
        """Hash every file; those of the same bytes come together."""
        self._files = files
        step = begin("reading", len(files))
        same: dict[str, list[Path]] = defaultdict(list)
        for done, path in enumerate(files, start=1):
            try:
                size = path.stat().st_size
                if size > self._limits.max_upload_bytes:
                    most = self._limits.max_upload_bytes
                    detail = f"The file has {size:,} bytes; the service takes at most {most:,}."
                    self._fail(path, "too_many_bytes", detail)
                else:
                    with path.open("rb") as opened:
                        same[hashlib.file_digest(opened, "sha256").hexdigest()].append(path)
            except OSError as failure:
                self._fail(path, "unreadable", _words(failure))
            step.update(done)
        self.same = dict(same)

    def upload(self, parallel: int, begin: Steps) -> None:
        """Send what is not there yet. Raises ServiceUnreachable, and ServiceError when going on is of no use."""
        self._there = {shape.sha256: shape for shape in self._client.shapes(self._collection)}
        step = begin("uploading", len(self.same))
        for done, (sha256, future) in enumerate(_in_parallel(self._send, list(self.same), parallel), start=1):
            self._judge(sha256, future)
            step.update(done)

    def settle(self, begin: Steps, say: Callable[[str], None]) -> None:
        """Wait until none of the shapes is queued or running."""
        wanted = set(self.same) - self._refused
        step = begin("indexing", len(wanted))
        left, moved = len(wanted) + 1, time.monotonic()
        while True:
            asked = time.monotonic()
            pending = self._pending(wanted)
            if not pending:
                self._shapes = {s.sha256: s for s in self._client.shapes(self._collection) if s.sha256 in wanted}
                if all(shape.settled for shape in self._shapes.values()):
                    break
            step.update(len(wanted) - len(pending))
            now = time.monotonic()
            if len(pending) != left:
                left, moved = len(pending), now
            elif now - moved > _SILENT_SECONDS:
                say(f"Nothing was indexed for {_SILENT_SECONDS:.0f} seconds; is a worker running? Still waiting.")
                moved = now
            # Asking must stay a small part of what the service does.
            time.sleep(min(max(_SHORTEST_PAUSE, 5 * (now - asked)), _LONGEST_PAUSE))
        step.update(len(wanted))
        for sha256 in wanted - set(self._shapes):
            self._fail(self.same[sha256][0], "deleted", "The shape was deleted from the collection meanwhile.")
        for sha256, shape in self._shapes.items():
            if shape.state != "indexed":
                code, detail = (shape.error.code, shape.error.detail) if shape.error else (shape.state, "")
                self._fail(self.same[sha256][0], code, detail)

    def summary(self, waited: bool) -> dict[str, Any]:
        """What became of the files, JSON-serialisable."""
        copies = [
            {"file": self._name(copy), "same_as": self._name(paths[0])}
            for paths in self.same.values()
            for copy in paths[1:]
        ]
        conflicts = [
            {"file": self._name(paths[0]), "labels": labels}
            for paths in self.same.values()
            if len(labels := self._labels(paths)) > 1
        ]
        return {
            "collection": self._collection, "files": len(self._files), "shapes": len(self.same), "waited": waited,
            "uploaded": self.uploaded, "skipped": self.skipped, "relabelled": self.relabelled,
            "without_label": sum(path not in self._label_of for path in self._files),
            "indexed": sum(shape.state == "indexed" for shape in self._shapes.values()),
            "failed": [asdict(one) for one in sorted(self.failures, key=lambda one: (one.file, one.code))],
            "copies": copies, "label_conflicts": conflicts,
        }  # fmt: skip

    def _name(self, path: Path) -> str:
        return shown(path.relative_to(self._folder).as_posix())

    def _labels(self, paths: Sequence[Path]) -> list[str]:
        """The labels that files of the same bytes have, the first file's first."""
        return list(dict.fromkeys(self._label_of[path] for path in paths if path in self._label_of))

    def _fail(self, path: Path, code: str, detail: str) -> None:
        self.failures.append(Failure(self._name(path), code, detail))

    def _send(self, sha256: str) -> _Sent:
        """Upload the file, or bring what is there up to date."""
        path = self.same[sha256][0]
        label = next(iter(self._labels(self.same[sha256])), None)
        known = self._there.get(sha256)
        if known is None:
            # The end of a path says more than its beginning.
            name = self._name(path)[-self._limits.max_name_length :]
            sent = self._client.upload(self._collection, path, name=name, label=label).shape
            if sent.sha256 != sha256:
                raise RequestBroken("The file changed while it was read; run the command again.")
            return "uploaded"
        relabel = label is not None and known.label != label
        if relabel:
            self._client.update_shape(self._collection, known.id, label=label)
        if self._retry_failed and known.state in ("failed", "cancelled"):
            self._client.retry_shape(self._collection, known.id)
        return "relabelled" if relabel else "there"

    def _judge(self, sha256: str, future: Future[_Sent]) -> None:
        """Count a file that is done; a failure of one is noted, a failure of all is raised."""
        path = self.same[sha256][0]
        try:
            sent = future.result()
            self.uploaded += sent == "uploaded"
            self.skipped += sent != "uploaded"
            self.relabelled += sent == "relabelled"
            return
        except ServiceUnreachable:
            raise
        except ServiceError as refusal:
            if refusal.code in _FATAL or refusal.status in _FATAL_STATUS:
                raise
            self._fail(path, refusal.code, refusal.message)
        except ReebaseError as refusal:
            self._fail(path, refusal.code, refusal.message)
        except OSError as failure:
            self._fail(path, "unreadable", _words(failure))
        self._refused.add(sha256)

    def _pending(self, wanted: set[str]) -> set[str]:
        """Which of the shapes are not settled. First the queued ones: a shape moves from these to the running."""
        return {
            shape.sha256
            for state in ("queued", "running")
            for shape in self._client.shapes(self._collection, state=state)
            if shape.sha256 in wanted
        }


def _words(failure: OSError) -> str:
    return f"The file cannot be read: {failure.strerror or failure}."


def _in_parallel(
    work: Callable[[str], _Sent], items: Sequence[str], parallel: int
) -> Iterator[tuple[str, Future[_Sent]]]:
    """Each item with what came of it, as they end.

    The threads are daemons, unlike those of an executor: Ctrl-C must not wait for a service that hangs, and what is
    cut off is sent again by the next run.
    """
    todo = iter(items)
    ended: queue.SimpleQueue[tuple[str, Future[_Sent]]] = queue.SimpleQueue()
    taking, stop = threading.Lock(), threading.Event()

    def run() -> None:
        while not stop.is_set():
            with taking:
                item = next(todo, None)
            if item is None:
                return
            future: Future[_Sent] = Future()
            try:
                future.set_result(work(item))
            except BaseException as failure:
                future.set_exception(failure)
            ended.put((item, future))

    for _ in range(min(parallel, len(items))):
        threading.Thread(target=run, name="upload", daemon=True).start()
    try:
        for _ in items:
            yield ended.get()
    finally:
        stop.set()
