"""Values that come as text, in form fields or query parameters, and the models that check them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from service.errors import InvalidRequest, MalformedJson
from service.problems import field_errors
from service.strict import parse_json

__all__ = ["model_of_fields", "model_of_json"]

M = TypeVar("M", bound=BaseModel)

Fields = Mapping[str, Sequence[str]]

_NULLABLE = frozenset({"tolerance", "max_dissimilarity"})
_JSON = frozenset({"metadata", "parameters"})


def model_of_json(model: type[M], value: Any) -> M:
    """The model of a JSON body. Raises InvalidRequest."""
    try:
        return model.model_validate(value)
    except ValidationError as error:
        found = [{**one, "loc": ("body", *one["loc"])} for one in error.errors(include_url=False)]
        raise InvalidRequest(field_errors(found, model)) from None


def model_of_fields(model: type[M], fields: Fields, *, leave: frozenset[str] = frozenset()) -> M:
    """The model of text fields: ``tags`` may repeat and hold commas, ``metadata`` and ``parameters`` are JSON.

    "null" is null where a number may be null, and a word elsewhere.

    leave: names that belong to somebody else. Raises InvalidRequest.
    """
    values: dict[str, Any] = {}
    for name, texts in fields.items():
        if name in leave:
            continue
        if name == "tags":
            values[name] = [tag.strip() for text in texts for tag in text.split(",") if tag.strip()]
        elif len(texts) > 1:
            raise _wrong(name, "was given more than once", "repeated")
        elif name in _JSON:
            values[name] = _object(name, texts[0])
        elif texts[0]:  # an empty field of a form says nothing
            values[name] = None if texts[0] == "null" and name in _NULLABLE else texts[0]
    try:
        return model.model_validate(values)
    except ValidationError as error:
        raise InvalidRequest(field_errors(error.errors(include_url=False), model, location="form")) from None


def _object(name: str, text: str) -> Any:
    if not text.strip():
        return {}
    try:
        return parse_json(text)
    except MalformedJson as error:
        raise _wrong(name, f"is not a JSON object: {error.message}", "json_invalid") from None


def _wrong(name: str, detail: str, code: str) -> InvalidRequest:
    return InvalidRequest(
        [{"detail": f"{name[:80]}: {detail}", "code": code, "parameter": name[:80], "location": "form"}]
    )
