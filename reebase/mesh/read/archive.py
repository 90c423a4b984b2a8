"""A zip archive whose promises are not believed: sizes are judged from the directory and while inflating."""

from __future__ import annotations

import io
import zipfile
import zlib

from reebase.errors import FormatError, TruncatedFile, UnsupportedFeature
from reebase.mesh.read.limits import Limits

__all__ = ["MAGIC", "Archive"]

MAGIC = b"PK\x03\x04"
MOST_ENTRIES = 10_000
CHUNK = 1 << 20


class Archive:
    """Files of a zip archive by name, without regard to upper and lower case; nothing touches the disk.

    Raises ExpandsTooMuch when the directory, or what is really inflated over the life of this object, is
    over the limit; FormatError, TruncatedFile, UnsupportedFeature.
    """

    def __init__(self, data: bytes, limits: Limits) -> None:
        self._limits, self._inflated = limits, 0
        try:
            self._zip = zipfile.ZipFile(io.BytesIO(data))
            entries = self._zip.infolist()
        except (zipfile.BadZipFile, ValueError, OSError, NotImplementedError, EOFError):
            raise TruncatedFile("The archive has no readable directory at its end.") from None
        if len(entries) > MOST_ENTRIES:
            raise FormatError(f"The archive has {len(entries):,} entries; the limit is {MOST_ENTRIES:,}.")
        limits.check_expanded(sum(entry.file_size for entry in entries))
        self._entries = {entry.filename.lower().lstrip("/"): entry for entry in entries}

    @property
    def names(self) -> list[str]:
        """The names of all files, in lower case."""
        return list(self._entries)

    def read(self, name: str) -> bytes | None:
        """The inflated bytes of a file, or None when there is none of that name."""
        entry = self._entries.get(name.lower().lstrip("/"))
        if entry is None:
            return None
        if entry.flag_bits & 1:
            raise UnsupportedFeature("The archive is encrypted.")
        if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise UnsupportedFeature(
                f"The archive is compressed with method {entry.compress_type}, not deflate."
            )
        parts = []
        try:
            with self._zip.open(entry) as stream:
                while part := stream.read(CHUNK):
                    self._inflated += len(part)
                    self._limits.check_expanded(self._inflated)
                    parts.append(part)
        except (zipfile.BadZipFile, zlib.error, EOFError, ValueError, OSError, NotImplementedError):
            raise FormatError(f"The archive's file {name[:80]!r} is damaged.") from None
        except RuntimeError:
            raise UnsupportedFeature("The archive is encrypted.") from None
        return b"".join(parts)
