"""Every error leaves as a problem document (RFC 9457): classes map to statuses here, and nowhere else."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Sequence
from http import HTTPStatus
from typing import Any, get_args

import structlog
from fastapi import FastAPI
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, ConfigDict, Field
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response

from reebase import errors as library
from service import errors as http
from service.schemas.common import COLLECTION_NAME, IDEMPOTENCY_KEY
from store import errors as store
from store.records import Task

__all__ = ["MEDIA_TYPE", "PROBLEMS", "Problem", "code_class", "install", "problem_response", "problem_value",
           "status_of", "task_problem"]  # fmt: skip

MEDIA_TYPE = "application/problem+json"
INTERNAL = "Something went wrong inside; the log has the request id."

STATUS: dict[type[library.ReebaseError], int] = {
    library.ReebaseError: 500,
    library.FormatError: 422,
    library.UnknownFormat: 415,
    library.MeshError: 422,
    library.LimitError: 422,
    library.TooManyBytes: 413,
    library.ParameterError: 422,
    library.ComputationError: 422,
    library.MissingPackage: 501,
    store.StoreError: 500,
    store.NotFound: 404,
    # A row names a blob that is not there: that is no fault of the client.
    store.BlobNotFound: 500,
    store.Conflict: 409,
    store.InvalidCursor: 400,
    store.QuotaExceeded: 403,
    store.StoreBusy: 503,
    store.StorageFull: 507,
    http.RequestError: 400,
    http.InvalidRequest: 422,
    http.UnsupportedMediaType: 415,
    http.UnsupportedEncoding: 415,
    http.MissingFile: 422,
    http.MissingKey: 401,
    http.InvalidKey: 401,
    http.ForbiddenScope: 403,
    http.ForeignOrigin: 403,
    http.UnknownHost: 421,
    http.RateLimited: 429,
    http.TaskCancelled: 409,
    http.NotReady: 503,
    http.TooManyStreams: 503,
    http.RouteNotFound: 404,
    http.MethodNotAllowed: 405,
    http.UploadStalled: 408,
    http.TaskFailed: 422,
}
"""Status of each class; a class that is not here has that of its nearest ancestor."""


class FieldError(BaseModel):
    """One value of the request that was refused."""

    detail: str
    code: str = Field(description="Kind of the refusal, stable.")
    pointer: str | None = Field(None, description="JSON pointer into the body, as `/k`.")
    parameter: str | None = Field(None, description="Name of the query, path, header or form field.")
    location: str | None = Field(None, description="Where the parameter was: query, path, header or form.")


class Problem(BaseModel):
    """An error, as RFC 9457 describes it; `code` is stable and meant for programs."""

    model_config = ConfigDict(
        extra="allow",
        json_schema_extra={
            "example": {
                "type": "/docs#unknown_name", "title": "Unknown name", "status": 422, "code": "unknown_name",
                "detail": "Unknown measure 'best'; the choices are greedy, literal, matching, "
                "matching_mean.",
                "instance": "/v1/collections/animals/query",
                "request_id": "0199b4c0-7d5e-7000-8000-2f6f3a9f0001",
                "details": {"parameter": "measure", "found": "best"},
            }
        },
    )  # fmt: skip

    type: str = Field(description="Address of the explanation of the code, relative to the service.")
    title: str
    status: int
    code: str
    detail: str
    instance: str
    request_id: str
    errors: list[FieldError] | None = None
    details: dict[str, Any] | None = None


def status_of(error: type[library.ReebaseError]) -> int:
    """The HTTP status of a class of error."""
    return next(STATUS[ancestor] for ancestor in error.__mro__ if ancestor in STATUS)


def _classes(root: type[library.ReebaseError]) -> Iterator[type[library.ReebaseError]]:
    """Every class of error that this service can meet; those of its client are not among them."""
    if root.__module__ in {library.__name__, store.__name__, http.__name__}:
        yield root
    for child in root.__subclasses__():
        yield from _classes(child)


def code_class(code: str) -> type[library.ReebaseError] | None:
    """The class that carries a code, or None when no class does."""
    return next((found for found in _classes(library.ReebaseError) if found.code == code), None)


TASK_CODES = {
    "worker_died": "The worker died several times on this task, so it is not tried again.",
    "out_of_memory": "The computation needs more memory than one mesh may use.",
    "timed_out": "The computation needs more time than one mesh may use.",
    "child_crashed": "The process that computed crashed on this mesh.",
}
"""Why a task can fail without an error of its own; as the answer to a query by mesh they are 422."""


def catalogue() -> list[tuple[str, int, str]]:
    """(code, status, explanation) of every problem, sorted by code, for the reference page."""
    rows = {c.code: (c.code, status_of(c), (c.__doc__ or "").strip()) for c in _classes(library.ReebaseError)}
    rows |= {code: (code, status_of(http.TaskFailed), text) for code, text in TASK_CODES.items()}
    rows["internal_error"] = ("internal_error", 500, INTERNAL)
    del rows[library.ReebaseError.code]
    return sorted(rows.values())


def _title(code: str) -> str:
    return code.replace("_", " ").capitalize()


def problem_value(
    request: Request, status: int, code: str, detail: str, *,
    errors: list[dict[str, Any]] | None = None, details: dict[str, Any] | None = None,
) -> dict[str, Any]:  # fmt: skip
    """The problem document as a JSON value."""
    value: dict[str, Any] = {
        "type": f"/docs#{code}", "title": _title(code), "status": status, "code": code, "detail": detail,
        "instance": request.url.path, "request_id": request.scope.get("state", {}).get("request_id", ""),
    }  # fmt: skip
    if errors:
        value["errors"] = errors
    if details:
        value["details"] = json.loads(json.dumps(details, default=str))
    return value


def value_of(request: Request, error: library.ReebaseError) -> dict[str, Any]:
    """The problem document of one of our own errors."""
    return problem_value(
        request, status_of(type(error)), error.code, error.message,
        errors=getattr(error, "errors", None), details=error.details,
    )  # fmt: skip


def _response(value: dict[str, Any], headers: dict[str, str] | None = None) -> Response:
    status = int(value["status"])
    return JSONResponse(value, status, {"Cache-Control": "no-store", **(headers or {})}, MEDIA_TYPE)


def problem_response(request: Request, error: library.ReebaseError) -> Response:
    """The response that carries one of our own errors."""
    value = value_of(request, error)
    headers = dict(getattr(error, "headers", {}))
    if "retry_after" in error.details:
        headers["Retry-After"] = str(error.details["retry_after"])
    elif value["status"] == 503:
        headers["Retry-After"] = "1"
    if "allow" in error.details:
        headers["Allow"] = ", ".join(error.details["allow"])
    if value["status"] >= 500:
        structlog.get_logger("service").error("error", code=error.code, detail=error.message)
    return _response(value, headers)


def internal_error(request: Request) -> Response:
    """The response to an exception that nobody expected: it tells nothing but where to look."""
    return _response(problem_value(request, 500, "internal_error", INTERNAL))


_PLACES = {"query": "query", "path": "path", "header": "header", "cookie": "cookie"}


def pointer(parts: tuple[int | str, ...]) -> str:
    """The JSON pointer (RFC 6901) to a place given as keys and indices."""
    return "".join("/" + str(part).replace("~", "~0").replace("/", "~1") for part in parts)


_WORDS = {
    "missing": "is required",
    "string_type": "must be a text",
    "string_pattern_mismatch": "does not have the form that is asked for",
    "int_type": "must be a whole number",
    "int_parsing": "must be a whole number",
    "int_parsing_size": "is too large a number",
    "int_from_float": "must be a whole number",
    "float_type": "must be a number",
    "float_parsing": "must be a number",
    "finite_number": "must be a finite number",
    "bool_type": "must be true or false",
    "bool_parsing": "must be true or false",
    "list_type": "must be a list",
    "dict_type": "must be a JSON object",
    "model_type": "must be a JSON object",
    "model_attributes_type": "must be a JSON object",
    "greater_than_equal": "must be at least {ge}",
    "greater_than": "must be more than {gt}",
    "less_than_equal": "must be at most {le}",
    "less_than": "must be less than {lt}",
    "literal_error": "must be one of {expected}",
    "string_too_long": "has too many characters; at most {max_length} are allowed",
    "string_too_short": "has too few characters; at least {min_length} are needed",
    "too_long": "there are too many; at most {max_length} are allowed",
    "too_short": "there are too few; at least {min_length} are needed",
}
"""pydantic's kinds of refusal in our words; what is not here speaks for itself."""

_PATTERNS = {
    COLLECTION_NAME: "must be lower-case letters, digits, '.', '_' and '-', at most 63, beginning with a letter "
    "or digit",
    IDEMPOTENCY_KEY: "must be printable ASCII characters without spaces",
}


def _words(error: dict[str, Any], model: type[BaseModel] | None, path: list[int | str]) -> str:
    """What is wrong with a value, without its name."""
    context = error.get("ctx", {})
    if error["type"] == "extra_forbidden":
        there = _members(model, path[:-1])
        return f"is not known here; there is {', '.join(there)}" if there else "is not known here"
    if error["type"] == "string_pattern_mismatch" and context.get("pattern") in _PATTERNS:
        return _PATTERNS[context["pattern"]]
    if error["type"] in _WORDS:
        return _WORDS[error["type"]].format_map(context)
    return re.sub(r"^(Value error|Assertion failed), ", "", error["msg"])


def _members(model: Any, path: list[int | str]) -> list[str]:
    """The names of the members that the model has at a place inside it."""
    for part in path:
        if model is not None and not isinstance(part, int):
            found = model.model_fields.get(part)
            model = None if found is None else _model_in(found.annotation)
    return [] if model is None else list(model.model_fields)


def _model_in(annotation: Any) -> type[BaseModel] | None:
    """The model in ``Model | None``, ``list[Model]`` and the like."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next(filter(None, map(_model_in, get_args(annotation))), None)


def field_errors(
    raw: Sequence[Any], model: type[BaseModel] | None = None, *, location: str | None = None
) -> list[dict[str, Any]]:
    """pydantic's errors in our shape and words.

    model: of the body, to name its members. location: where the values came from, when not as a JSON body.
    """
    entries: list[dict[str, Any]] = []
    for error in raw:
        place, *path = error["loc"] or ("body",)
        if location is not None:
            place, path = location, list(error["loc"])
        name = ".".join(str(part) for part in path)
        message = _words(error, model, path)
        detail = f"{name}: {message}" if name else re.sub("^(?=must |is )", "The body ", message)
        entry: dict[str, Any] = {"detail": detail, "code": error["type"]}
        if place in _PLACES or location is not None:
            entry |= {"parameter": name, "location": str(place)}
        else:
            entry["pointer"] = pointer(tuple(path))
        entries.append(entry)
    return entries


def task_problem(request: Request, task: Task) -> Response:
    """The problem of a task that ended without a result, with the status of its code's class."""
    if task.error_code is None:
        return problem_response(request, http.TaskCancelled(task=task.id))
    details = dict(task.error_detail or {})
    message = str(details.pop("message", task.error_code))
    status = status_of(code_class(task.error_code) or http.TaskFailed)
    # What the worker met is the mesh's doing or its own; this service did not fail.
    status = status if status < 500 else 422
    return _response(
        problem_value(request, status, task.error_code, message, details={**details, "task": task.id})
    )


def _validation(request: Request, error: RequestValidationError) -> Response:
    found = error.errors()
    broken = next((e for e in found if e["type"] == "json_invalid"), None)
    if broken is not None:
        reason = broken.get("ctx", {}).get("error", "it cannot be parsed")
        return problem_response(request, http.MalformedJson(f"The body is not JSON: {reason}."))
    if len(found) == 1 and (kind := code_class(found[0]["type"])):
        # A refusal of the library keeps its own code where it is the only one.
        return problem_response(request, kind(found[0]["msg"], **found[0].get("ctx", {}).get("details", {})))
    body = getattr(request.scope.get("route"), "body_field", None)
    model = None if body is None else _model_in(body.field_info.annotation)
    return problem_response(request, http.InvalidRequest(field_errors(found, model)))


def _framework(request: Request, error: HTTPException) -> Response:
    """What Starlette and FastAPI raise themselves: unknown routes, wrong methods, unreadable bodies."""
    if isinstance(error.__cause__, library.ReebaseError):
        return problem_response(request, error.__cause__)
    if isinstance(error.__cause__, ClientDisconnect):
        return problem_response(request, http.ClientGone())
    if error.status_code == 404:
        lost: Response | None = request.app.state.lost_page(request)
        return lost or problem_response(request, http.RouteNotFound(f"There is nothing at {request.url.path}."))
    if error.status_code == 405:
        allowed = request.app.state.allowed_methods(request.url.path)
        message = f"{request.url.path} does not take {request.method}; it takes {', '.join(allowed)}."
        return problem_response(request, http.MethodNotAllowed(message, allow=allowed))
    if error.status_code == 400:
        reason = error.__cause__
        detail = f"The body cannot be read: {reason}." if isinstance(reason, ValueError) else None
        return problem_response(request, http.MalformedJson(detail))
    phrase = HTTPStatus(error.status_code).phrase
    value = problem_value(request, error.status_code, phrase.lower().replace(" ", "_"), f"{error.detail}")
    return _response(value, dict(error.headers or {}))


def install(app: FastAPI) -> None:
    """Register the handlers. What they do not catch is answered by ``service.edge`` as internal_error."""
    # Starlette types a handler by Exception, and calls it with the class that it is registered for alone.
    handlers: dict[type[Exception], Callable[[Request, Any], Response]] = {
        library.ReebaseError: problem_response,
        RequestValidationError: _validation,
        HTTPException: _framework,
        ClientDisconnect: lambda request, _: problem_response(request, http.ClientGone()),
    }
    for kind, handler in handlers.items():
        app.add_exception_handler(kind, handler)


PROBLEMS: dict[int | str, dict[str, Any]] = {
    status: {"description": description, "model": Problem, "content": {MEDIA_TYPE: {}}}
    for status, description in {
        400: "The request is malformed.",
        401: "An API key is missing or unknown.",
        403: "The API key does not allow this.",
        404: "There is no such thing.",
        409: "The request conflicts with what is there.",
        413: "The body is larger than the limit.",
        415: "The format or media type is not one that is read.",
        421: "The Host header names another host.",
        422: "A value is not allowed, or a mesh cannot be used.",
        429: "Too many requests; see Retry-After.",
        408: "The client stopped sending.",
        500: "Something went wrong inside.",
        501: "A format needs a package that is not installed here.",
        507: "There is no space left.",
        503: "The service is not ready, or its database is busy.",
    }.items()
}
"""What every operation of the API may answer, for OpenAPI."""
