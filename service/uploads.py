"""An uploaded file on its way in: limits are checked while it streams, before anything is stored."""

from __future__ import annotations

import re
from collections.abc import AsyncIterator, Collection, Mapping, Sequence
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
from service.multipart import FILE, MAX_FIELD_BYTES, Form, boundary_of
from store.blobs import Blobs, BlobWriter
from store.errors import StoreBusy

__all__ = ["Part", "Upload", "received"]

BATCH_BYTES = 1 << 18
"""So much of the body is gathered before a thread parses, hashes and writes it."""


@dataclass(frozen=True)
class Part:
    """Where a file lies in its blob: so many bytes from ``start``. format: a name of ``FORMATS``."""

    start: int
    size: int
    format: str


@dataclass
class Upload:
    """A file that is complete on disk but not stored yet, and what came with it.

    fields: form fields, or the query parameters of a raw body. size: in bytes. format: a name of ``FORMATS``.
    parts: of the blob, by the name of the form field; "file" alone unless the route takes another file beside it.
    """

    fields: dict[str, list[str]]
    format: str
    filename: str | None
    size: int
    parts: dict[str, Part]
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


@dataclass
class _Incoming:
    """A file that comes in; ``head``: what is held back until the format can be told from it."""

    start: int
    filename: str | None = None
    format_hint: str | None = None
    format: str = ""
    size: int = 0
    head: bytearray = field(default_factory=bytearray)
    passed: bool = False


class _Intake:
    """The sink of files' bytes: tells each one's format from its first ones, then writes to one blob.

    limit: of each file, of which at most ``most`` come.
    """

    def __init__(self, blobs: Blobs, limit: int, most: int = 1) -> None:
        self.blobs = blobs
        self.limit = limit
        self.format_hint: str | None = None
        self.files: dict[str, _Incoming] = {}
        self._most = most
        self._now = _Incoming(0)
        self._written = 0
        self._writer: BlobWriter | None = None
        self._stack = ExitStack()

    def begin(self, filename: str | None, media_type: str | None, part: str = FILE) -> None:
        self._end()
        self._now = self.files[part] = _Incoming(self._written, clean_filename(filename), _format_of(media_type))

    def write(self, data: bytes) -> None:
        now = self._now
        now.size += len(data)
        if now.size > self.limit:
            raise too_large(self.limit)
        if now.passed:
            self._put(data)
            return
        now.head += data
        if len(now.head) >= START:
            self._pass()

    def _pass(self) -> None:
        """Let the held bytes go on to the blob."""
        now = self._now
        if self._hint(now) is None:
            # What the start does not tell, the size may: see `_end`.
            with suppress(UnknownFormat):
                now.format = sniff(bytes(now.head), now.filename)
        now.passed = True
        self._put(bytes(now.head))

    def _put(self, data: bytes) -> None:
        if self._writer is None:
            self._writer = self._stack.enter_context(self.blobs.writer(self._most * self.limit))
        self._writer.write(data)
        self._written += len(data)

    def _hint(self, file: _Incoming) -> str | None:
        """What was said of the format; of the main file the request may say it."""
        given = self.format_hint if file is self.files.get(FILE) else None
        return given or file.format_hint

    def _end(self) -> None:
        """The file that came last is complete. Raises EmptyFile."""
        if not self.files:
            return
        if self._now.size == 0:
            raise EmptyFile()
        if not self._now.passed:
            self._pass()

    def finish(self) -> None:
        """All files are complete. Raises EmptyFile, UnknownFormat."""
        self._end()
        for file in self.files.values():
            file.format = self._hint(file) or file.format or sniff(bytes(file.head), file.filename, size=file.size)

    @property
    def looks_like_json(self) -> bool:
        return self.files[FILE].head.lstrip().startswith((b"{", b"["))

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
async def received(
    request: Request, blobs: Blobs, limit: int, *, or_json: bool = False, beside: Collection[str] = ()
) -> AsyncIterator[Upload]:
    """Receive a multipart or raw body with a file of at most ``limit`` bytes; what the block does not keep is dropped.

    or_json: the route takes JSON too, so a body of no format may be JSON that was sent without its header.
    beside: names of further files that a form may have, each of at most ``limit`` bytes too.
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
    overhead = MAX_FIELD_BYTES * 2 + len(beside) * limit if kind == "multipart/form-data" else 0
    if declared.isdigit() and int(declared) > limit + overhead:
        raise too_large(limit)
    query = {name: request.query_params.getlist(name) for name in request.query_params}
    intake = _Intake(blobs, limit, 1 + len(beside))
    if hint := _one(query, "format"):
        intake.format_hint = canonical(hint)
    with intake:
        if kind == "multipart/form-data":
            form = Form(boundary_of(content_type), intake, beside)
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
        parts = {name: Part(file.start, file.size, file.format) for name, file in intake.files.items()}
        file = intake.files[FILE]
        yield Upload(fields, file.format, file.filename, file.size, parts, intake)
