"""An uploaded file on its way in: limits are checked while it streams, before anything is stored."""

from __future__ import annotations

import re
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import ExitStack, asynccontextmanager, suppress
from dataclasses import dataclass, field
from types import TracebackType

from python_multipart.multipart import parse_options_header
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request

from reebase.errors import EmptyFile, TooManyBytes, UnknownFormat
from reebase.mesh.read.sniff import START, canonical, sniff
from service.bodies import chunks
from service.errors import MissingFile, UnsupportedMediaType
from service.multipart import MAX_FIELD_BYTES, Form, boundary_of
from store.blobs import Blobs, BlobWriter
from store.errors import StoreBusy

__all__ = ["Upload", "received"]

BATCH_BYTES = 1 << 18
"""So much of the body is gathered before a thread parses, hashes and writes it."""


@dataclass
class Upload:
    """A file that is complete on disk but not stored yet, and what came with it.

    fields: form fields, or the query parameters of a raw body. size: in bytes. format: a name of ``FORMATS``.
    """

    fields: dict[str, list[str]]
    format: str
    filename: str | None
    size: int
    _intake: _Intake = field(repr=False)

    def keep(self) -> str:
        """Make the blob durable; returns its SHA-256. Blocks. Without this call nothing stays."""
        return self._intake.commit()

    def check_kept(self, sha256: str) -> None:
        """Call it in the transaction that names the blob. Raises StoreBusy when a sweep was faster.

        A sweep removes in a write transaction of its own, so a blob that is there now will be there. It takes
        what nothing named for its whole grace period, and the mesh of a query that ended: an upload that waited
        so long, or came with the same bytes at that moment, is sent again.
        """
        if not self._intake.blobs.exists(sha256):
            raise StoreBusy("The upload was cleared away while it waited for the database; send it again.")


def clean_filename(given: str | None) -> str | None:
    """The last part of a client's file name, printable, at most 255 characters; None when nothing is left."""
    if given is None:
        return None
    last = re.split(r"[/\\]", given)[-1]
    shown = "".join(character for character in last if character.isprintable()).strip()
    return shown[:255] if shown not in {"", ".", ".."} else None


class _Intake:
    """The sink of the file's bytes: tells the format from the first ones, then writes to the blob store."""

    def __init__(self, blobs: Blobs, limit: int) -> None:
        self.blobs = blobs
        self.limit = limit
        self.filename: str | None = None
        self.format_hint: str | None = None
        self.format = ""
        self.size = 0
        self._head = bytearray()
        self._writer: BlobWriter | None = None
        self._stack = ExitStack()

    def begin(self, filename: str | None, media_type: str | None) -> None:
        self.filename = clean_filename(filename)
        self.format_hint = self.format_hint or _format_of(media_type)

    def write(self, data: bytes) -> None:
        self.size += len(data)
        if self.size > self.limit:
            raise too_large(self.limit)
        if self._writer is not None:
            self._writer.write(data)
            return
        self._head += data
        if len(self._head) >= START:
            self._open()

    def _open(self) -> None:
        head = bytes(self._head)
        if self.format_hint is None:
            # What the start does not tell, the size may: see `finish`.
            with suppress(UnknownFormat):
                self.format = sniff(head, self.filename)
        self._writer = self._stack.enter_context(self.blobs.writer(self.limit))
        self._writer.write(head)

    def finish(self) -> None:
        """The file is complete. Raises EmptyFile, UnknownFormat."""
        if self.size == 0:
            raise EmptyFile()
        if self._writer is None:
            self._open()
        if not self.format_hint and not self.format:
            self.format = sniff(bytes(self._head), self.filename, size=self.size)

    @property
    def looks_like_json(self) -> bool:
        return self._head.lstrip().startswith((b"{", b"["))

    def commit(self) -> str:
        if self._writer is None:
            raise RuntimeError("The file is not complete yet.")
        return self._writer.commit()

    def __enter__(self) -> _Intake:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.__exit__(kind, error, trace)


def too_large(limit: int) -> TooManyBytes:
    """The refusal of a file over the limit."""
    return TooManyBytes(f"The file is larger than {limit} bytes, the limit of this service.", limit=limit)


def _format_of(media_type: str | None) -> str | None:
    """The format that a media type names; generic types name none."""
    try:
        return canonical(media_type or "")
    except UnknownFormat:
        return None


async def _batches(request: Request, limit: int, overhead: int) -> AsyncIterator[bytes]:
    """The body in pieces of some size.

    Raises UploadStalled, and TooManyBytes also for what is no part of the file: a form may begin and end with
    bytes that mean nothing.
    """
    held, left = bytearray(), limit + overhead
    async for chunk in chunks(request):
        left -= len(chunk)
        if left < 0:
            raise too_large(limit)
        held += chunk
        if len(held) >= BATCH_BYTES:
            yield bytes(held)
            held.clear()
    if held:
        yield bytes(held)


def _one(fields: Mapping[str, Sequence[str]], name: str) -> str | None:
    values = fields.get(name, ())
    return values[-1] if values else None


@asynccontextmanager
async def received(request: Request, blobs: Blobs, limit: int, *, or_json: bool = False) -> AsyncIterator[Upload]:
    """Receive a multipart or raw body of at most ``limit`` bytes; what the block does not keep is dropped.

    or_json: the route takes JSON too, so a body of no format may be JSON that was sent without its header.
    Raises TooManyBytes (at once when Content-Length says so, else when the limit is passed),
    MalformedMultipart, MissingFile, EmptyFile, UnknownFormat, UnsupportedMediaType and UploadStalled.
    """
    content_type = request.headers.get("content-type", "")
    kind = content_type.split(";")[0].strip().lower()
    if kind.startswith("multipart/") and kind != "multipart/form-data":
        raise UnsupportedMediaType(
            f"A body of type {kind[:60]} is not read; send multipart/form-data or the bytes."
        )
    declared = request.headers.get("content-length", "")
    overhead = MAX_FIELD_BYTES * 2 if kind == "multipart/form-data" else 0
    if declared.isdigit() and int(declared) > limit + overhead:
        raise too_large(limit)
    query = {name: request.query_params.getlist(name) for name in request.query_params}
    intake = _Intake(blobs, limit)
    if hint := _one(query, "format"):
        intake.format_hint = canonical(hint)
    with intake:
        if kind == "multipart/form-data":
            form = Form(boundary_of(content_type), intake)
            async for batch in _batches(request, limit, overhead):
                await run_in_threadpool(form.feed, batch)
            form.finish()
            if not form.has_file:
                raise MissingFile()
            if hint := _one(form.fields, "format"):
                intake.format_hint = canonical(hint)
            fields = {**query, **form.fields}
        else:
            _, options = parse_options_header(request.headers.get("content-disposition"))
            given = (
                _one(query, "filename") or options.get(b"filename", b"").decode("utf-8", "replace") or None
            )
            intake.begin(given, content_type)
            async for batch in _batches(request, limit, overhead):
                await run_in_threadpool(intake.write, batch)
            fields = query
        try:
            await run_in_threadpool(intake.finish)
        except UnknownFormat:
            if or_json and (kind == "application/x-www-form-urlencoded" or intake.looks_like_json):
                raise UnsupportedMediaType(
                    "The body is no mesh. To ask by the id of a shape, send JSON with the header "
                    "`Content-Type: application/json`."
                ) from None
            raise
        yield Upload(fields, intake.format_hint or intake.format, intake.filename, intake.size, intake)
