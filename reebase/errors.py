"""Every error that Reebase raises on purpose, each with a stable ``code``.

ReebaseError
├── FormatError            malformed_file      the bytes are not what they claim to be
│   ├── UnknownFormat      unknown_format
│   ├── EmptyFile          empty_file
│   ├── TruncatedFile      truncated_file
│   ├── ExternalReference  external_reference
│   └── UnsupportedFeature unsupported_feature
├── MeshError              invalid_mesh        well-formed bytes, a mesh that cannot be used
│   ├── NoFaces            no_faces
│   ├── NonFiniteVertices  non_finite_vertices
│   ├── FaceIndexOutOfRange face_index_out_of_range
│   └── DegenerateMesh     degenerate_mesh
├── LimitError             limit_exceeded
│   ├── TooManyBytes       too_many_bytes
│   ├── TooManyVertices    too_many_vertices
│   ├── TooManyFaces       too_many_faces
│   └── ExpandsTooMuch     expands_too_much
├── ParameterError         invalid_parameter
│   └── UnknownName        unknown_name
├── ComputationError       computation_failed
└── MissingPackage         missing_package

The docstring of a class is its message when none is given. ``code`` never changes once released;
messages may. ``details`` holds what a program may want: numbers and names, JSON-serialisable.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

__all__ = [
    "ComputationError", "DegenerateMesh", "EmptyFile", "ExpandsTooMuch", "ExternalReference",
    "FaceIndexOutOfRange", "FormatError", "LimitError", "MeshError", "MissingPackage", "NoFaces",
    "NonFiniteVertices", "ParameterError", "ReebaseError", "TooManyBytes", "TooManyFaces",
    "TooManyVertices", "TruncatedFile", "UnknownFormat", "UnknownName", "UnsupportedFeature",
    "unknown_name",
]  # fmt: skip


class ReebaseError(Exception):
    """Something that Reebase refuses or could not do."""

    code: str = "error"

    def __init__(self, message: str | None = None, **details: Any) -> None:
        self.message = message or (type(self).__doc__ or "").strip()
        self.details: dict[str, Any] = details
        super().__init__(self.message)


class FormatError(ReebaseError):
    """The file is not well formed."""

    code = "malformed_file"


class UnknownFormat(FormatError):
    """The format of the file is not one that Reebase reads."""

    code = "unknown_format"


class EmptyFile(FormatError):
    """The file is empty."""

    code = "empty_file"


class TruncatedFile(FormatError):
    """The file ends before what its header announces."""

    code = "truncated_file"


class ExternalReference(FormatError):
    """The file refers to another file; send one file that holds everything, such as GLB."""

    code = "external_reference"


class UnsupportedFeature(FormatError):
    """The file uses a feature of its format that Reebase does not read."""

    code = "unsupported_feature"


class MeshError(ReebaseError):
    """The mesh cannot be used."""

    code = "invalid_mesh"


class NoFaces(MeshError):
    """The file holds no faces; Reebase needs a surface of triangles or polygons."""

    code = "no_faces"


class NonFiniteVertices(MeshError):
    """A vertex has a coordinate that is NaN or infinite."""

    code = "non_finite_vertices"


class FaceIndexOutOfRange(MeshError):
    """A face refers to a vertex that does not exist."""

    code = "face_index_out_of_range"


class DegenerateMesh(MeshError):
    """No triangle with area is left after cleaning."""

    code = "degenerate_mesh"


class LimitError(ReebaseError):
    """A limit of this service or call was exceeded."""

    code = "limit_exceeded"


class TooManyBytes(LimitError):
    """The file is larger than the limit."""

    code = "too_many_bytes"


class TooManyVertices(LimitError):
    """The mesh has more vertices than the limit."""

    code = "too_many_vertices"


class TooManyFaces(LimitError):
    """The mesh has more faces than the limit."""

    code = "too_many_faces"


class ExpandsTooMuch(LimitError):
    """A compressed file expands to more than the limit."""

    code = "expands_too_much"


class ParameterError(ReebaseError):
    """A parameter has a value that is not allowed."""

    code = "invalid_parameter"


class UnknownName(ParameterError):
    """There is nothing by that name."""

    code = "unknown_name"


class ComputationError(ReebaseError):
    """A computation did not reach its result."""

    code = "computation_failed"


class MissingPackage(ReebaseError):
    """A package that this call needs is not installed."""

    code = "missing_package"


def unknown_name(kind: str, name: str, known: Iterable[str]) -> UnknownName:
    """The refusal of a name that a registry does not hold; it lists the names that would do."""
    choices = sorted(known)
    return UnknownName(
        f"Unknown {kind} {name!r}; the choices are {', '.join(choices)}.",
        parameter=kind, found=name, choices=choices,
    )  # fmt: skip
