"""How large a file and a mesh may be, and the refusals when they are larger."""

from __future__ import annotations

from dataclasses import dataclass

from reebase.errors import ExpandsTooMuch, TooManyBytes, TooManyFaces, TooManyVertices

__all__ = ["DEFAULT", "Limits"]


@dataclass(frozen=True)
class Limits:
    """Upper bounds on what is read.

    bytes: size of the file. vertices, faces: size of the mesh after triangulation; of STL, which repeats
    vertices, only the different ones count.
    expanded_bytes: what all parts of a compressed file may hold together.
    """

    bytes: int = 256 * 2**20
    vertices: int = 1_000_000
    faces: int = 2_000_000
    expanded_bytes: int = 512 * 2**20

    def check_bytes(self, found: int) -> None:
        """Raises TooManyBytes when a file of ``found`` bytes is over the limit."""
        if found > self.bytes:
            raise TooManyBytes(
                f"The file has {found:,} bytes; the limit is {self.bytes:,}.", found=found, limit=self.bytes
            )

    def check_vertices(self, found: int) -> None:
        """Raises TooManyVertices when ``found`` vertices are over the limit."""
        if found > self.vertices:
            raise TooManyVertices(
                f"The mesh has {found:,} vertices or more; the limit is {self.vertices:,}. Decimate it.",
                found=found, limit=self.vertices,
            )  # fmt: skip

    def check_faces(self, found: int) -> None:
        """Raises TooManyFaces when ``found`` triangles are over the limit."""
        if found > self.faces:
            raise TooManyFaces(
                f"The mesh has {found:,} triangles or more; the limit is {self.faces:,}. Decimate it.",
                found=found, limit=self.faces,
            )  # fmt: skip

    def check_expanded(self, found: int) -> None:
        """Raises ExpandsTooMuch when a compressed file holds ``found`` bytes or more."""
        if found > self.expanded_bytes:
            raise ExpandsTooMuch(
                f"The file expands to {found:,} bytes or more; the limit is {self.expanded_bytes:,}.",
                found=found, limit=self.expanded_bytes,
            )  # fmt: skip


DEFAULT = Limits()
"""The bounds when a caller gives none."""
