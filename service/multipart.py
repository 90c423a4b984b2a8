"""multipart/form-data, parsed as it arrives: the file goes to a sink, other fields stay small in memory."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING, Protocol

from python_multipart.exceptions import FormParserError
from python_multipart.multipart import MultipartParser, MultipartState, parse_options_header

from reebase.errors import TooManyBytes
from service.errors import MalformedMultipart

if TYPE_CHECKING:
    from python_multipart.multipart import MultipartCallbacks

__all__ = ["FILE", "FileSink", "Form", "boundary_of"]

FILE = "file"
"""The name of the part that is the file."""

MAX_PARTS = 128
MAX_FIELD_BYTES = 1 << 20
MAX_HEADER_BYTES = 8192


class FileSink(Protocol):
    """Where the bytes of file parts go, one part after another. part: the name of the form field."""

    def begin(self, filename: str | None, media_type: str | None, part: str = ...) -> None: ...

    def write(self, data: bytes) -> None: ...


def boundary_of(content_type: str) -> bytes:
    """The boundary in a Content-Type header. Raises MalformedMultipart when there is none."""
    _, options = parse_options_header(content_type)
    boundary = options.get(b"boundary", b"")
    if not 0 < len(boundary) <= 70:
        raise MalformedMultipart(
            "The Content-Type multipart/form-data needs a boundary of 1 to 70 characters."
        )
    return boundary


def _text(data: bytes, what: str) -> str:
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        raise MalformedMultipart(f"{what} is not UTF-8.") from None


class Form:
    """One multipart body. ``feed`` it, then ``finish``; ``fields`` then holds what was no file.

    The file is the part named ``file``; its bytes go to ``sink``, and so do those of parts named in ``others``,
    which need not be there. Other fields hold at most MAX_FIELD_BYTES.
    """

    def __init__(self, boundary: bytes, sink: FileSink, others: Collection[str] = ()) -> None:
        self.fields: dict[str, list[str]] = {}
        self._known = {FILE, *others}
        self._seen: set[str] = set()
        self._sink = sink
        self._left = MAX_FIELD_BYTES
        self._parts = 0
        self._headers: dict[bytes, bytes] = {}
        self._header = (bytearray(), bytearray())
        self._name = ""
        self._value: bytearray | None = None
        callbacks: MultipartCallbacks = {
            "on_part_begin": self._on_part_begin,
            "on_part_data": self._on_part_data,
            "on_part_end": self._on_part_end,
            "on_header_field": lambda data, start, end: self._header[0].extend(data[start:end]),
            "on_header_value": lambda data, start, end: self._header[1].extend(data[start:end]),
            "on_header_end": self._on_header_end,
            "on_headers_finished": self._on_headers_finished,
        }
        self._parser = MultipartParser(
            boundary, callbacks, max_header_count=16, max_header_size=MAX_HEADER_BYTES
        )

    @property
    def has_file(self) -> bool:
        """Whether the file came."""
        return FILE in self._seen

    def feed(self, data: bytes) -> None:
        """Parse more of the body. Raises MalformedMultipart, TooManyBytes and whatever the sink raises."""
        try:
            self._parser.write(data)
        except FormParserError as error:
            raise MalformedMultipart(f"The body is not well-formed multipart/form-data: {error}.") from None

    def finish(self) -> None:
        """The body has ended. Raises MalformedMultipart when it ended before its closing boundary."""
        if self._parser.state not in {MultipartState.END, MultipartState.END_BOUNDARY}:
            raise MalformedMultipart("The multipart body ends before its closing boundary.")

    def _on_part_begin(self) -> None:
        self._parts += 1
        if self._parts > MAX_PARTS:
            raise MalformedMultipart(f"The multipart body has more than {MAX_PARTS} parts.")
        self._headers = {}

    def _on_header_end(self) -> None:
        name, value = self._header
        self._headers[bytes(name).lower()] = bytes(value)
        self._header = (bytearray(), bytearray())

    def _on_headers_finished(self) -> None:
        kind, options = parse_options_header(self._headers.get(b"content-disposition", b""))
        if kind != b"form-data" or b"name" not in options:
            raise MalformedMultipart(
                "A part of the multipart body has no header Content-Disposition: form-data; name=…."
            )
        self._name = _text(options[b"name"], "The name of a form field")
        if self._name in self._known:
            if self._name in self._seen:
                raise MalformedMultipart(
                    f"The multipart body has more than one part named `{self._name}`; send one."
                )
            self._seen.add(self._name)
            self._value = None
            filename = options.get(b"filename")
            media_type = self._headers.get(b"content-type")
            self._sink.begin(
                None if filename is None else filename.decode("utf-8", "replace"),
                None if media_type is None else media_type.decode("latin-1"),
                self._name,
            )
        else:
            self._value = bytearray()

    def _on_part_data(self, data: bytes, start: int, end: int) -> None:
        if self._value is None:
            self._sink.write(data[start:end])
            return
        self._left -= end - start
        if self._left < 0:
            raise TooManyBytes(
                f"The form fields beside the file hold more than {MAX_FIELD_BYTES} bytes.",
                limit=MAX_FIELD_BYTES,
            )
        self._value += data[start:end]

    def _on_part_end(self) -> None:
        if self._value is not None:
            text = _text(bytes(self._value), f"The form field {self._name[:100]!r}")
            self.fields.setdefault(self._name, []).append(text)
