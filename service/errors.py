"""Refusals that only HTTP knows; they extend the tree of ``reebase.errors``.

ReebaseError
└── RequestError               invalid_request
    ├── InvalidRequest         validation_error      carries one entry per wrong field
    ├── MalformedJson          malformed_json
    ├── MalformedMultipart     malformed_multipart
    ├── MissingFile            missing_file
    ├── UnsupportedMediaType   unsupported_media_type
    ├── UnsupportedEncoding    unsupported_encoding
    ├── MissingKey             missing_key
    ├── InvalidKey             invalid_key
    ├── ForbiddenScope         forbidden_scope
    ├── UnknownHost            unknown_host
    ├── ForeignOrigin          foreign_origin
    ├── RateLimited            rate_limited
    ├── TooManyStreams         too_many_streams
    ├── NotReady               not_ready
    ├── RouteNotFound          route_not_found
    ├── MethodNotAllowed       method_not_allowed
    ├── ClientGone             client_gone
    ├── UploadStalled          upload_stalled
    └── TaskFailed             task_failed           a task ended without a result
        └── TaskCancelled      task_cancelled
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

from reebase.errors import ReebaseError

__all__ = [
    "ClientGone", "ForbiddenScope", "ForeignOrigin", "InvalidKey", "InvalidRequest", "MalformedJson",
    "MalformedMultipart", "MethodNotAllowed", "MissingFile", "MissingKey", "NotReady",
    "RateLimited", "RequestError", "RouteNotFound", "TaskCancelled", "TaskFailed", "TooManyStreams", "UnknownHost",
    "UnsupportedEncoding", "UnsupportedMediaType", "UploadStalled",
]  # fmt: skip


class RequestError(ReebaseError):
    """The request cannot be served."""

    code = "invalid_request"
    headers: ClassVar[dict[str, str]] = {}


class InvalidRequest(RequestError):
    """Some values in the request are not allowed; `errors` names each."""

    code = "validation_error"

    def __init__(self, errors: Sequence[dict[str, Any]]) -> None:
        super().__init__()
        self.errors = list(errors)
        if len(self.errors) == 1:
            self.message = str(self.errors[0]["detail"])


class MalformedJson(RequestError):
    """The body is not JSON."""

    code = "malformed_json"


class MalformedMultipart(RequestError):
    """The body is not well-formed multipart/form-data."""

    code = "malformed_multipart"


class MissingFile(RequestError):
    """The multipart body has no part named `file`."""

    code = "missing_file"


class UnsupportedMediaType(RequestError):
    """The Content-Type of the request is not one that this route reads."""

    code = "unsupported_media_type"


class UnsupportedEncoding(RequestError):
    """The body has a Content-Encoding; send it as it is, without compression."""

    code = "unsupported_encoding"


class MissingKey(RequestError):
    """This service needs an API key; send it as `Authorization: Bearer rb_…`."""

    code = "missing_key"
    headers: ClassVar[dict[str, str]] = {"WWW-Authenticate": 'Bearer realm="reebase"'}


class InvalidKey(RequestError):
    """The API key is unknown or was revoked."""

    code = "invalid_key"
    headers: ClassVar[dict[str, str]] = {"WWW-Authenticate": 'Bearer realm="reebase", error="invalid_token"'}


class ForbiddenScope(RequestError):
    """The API key does not allow this."""

    code = "forbidden_scope"


class UnknownHost(RequestError):
    """The Host header names a host that this service does not answer for."""

    code = "unknown_host"


class ForeignOrigin(RequestError):
    """A page of another origin may not change anything here without an API key."""

    code = "foreign_origin"


class RateLimited(RequestError):
    """Too many requests with this API key; wait before the next."""

    code = "rate_limited"


class TooManyStreams(RequestError):
    """As many listen to events as are allowed at once; poll instead, or try again later."""

    code = "too_many_streams"


class NotReady(RequestError):
    """The service cannot serve requests yet."""

    code = "not_ready"


class RouteNotFound(RequestError):
    """There is nothing at this address."""

    code = "route_not_found"


class MethodNotAllowed(RequestError):
    """This address does not take that method."""

    code = "method_not_allowed"


class ClientGone(RequestError):
    """The client closed the connection before its request was complete."""

    code = "client_gone"


class UploadStalled(RequestError):
    """The client stopped sending before its upload was complete."""

    code = "upload_stalled"


class TaskFailed(RequestError):
    """The task ended without a result."""

    code = "task_failed"


class TaskCancelled(TaskFailed):
    """The task was cancelled before it had a result."""

    code = "task_cancelled"
