"""Pieces that several resources share: checked strings, pages, progress."""

from __future__ import annotations

import unicodedata
from collections.abc import Callable, Collection
from datetime import datetime
from typing import Annotated, Any, Generic, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, PlainSerializer
from pydantic_core import PydanticCustomError

from reebase.errors import ReebaseError, unknown_name

__all__ = [
    "Body", "CollectionName", "ErrorValue", "Finite", "Metadata", "Moment", "PageOf", "Progress", "Text",
    "Triple", "Value", "one_of", "printable", "refused",
]  # fmt: skip

T = TypeVar("T")

COLLECTION_NAME = r"^[a-z0-9][a-z0-9._-]{0,62}$"
IDEMPOTENCY_KEY = r"^[\x21-\x7e]+$"


class Body(BaseModel):
    """A request body: unknown members are refused, so that a misspelt one is not silently ignored."""

    model_config = ConfigDict(extra="forbid", strict=False)


class Value(BaseModel):
    """A response body."""

    model_config = ConfigDict(from_attributes=True)


def printable(text: str) -> str:
    """Refuse characters that nobody can see: they break logs, terminals and databases."""
    for character in text:
        if unicodedata.category(character) in {"Cc", "Cs", "Zl", "Zp"}:
            raise ValueError(f"must not contain the control character U+{ord(character):04X}")
    return text


def _not_blank(text: str) -> str:
    if not text.strip():
        raise ValueError("must not be blank")
    return text.strip()


def _utc(moment: datetime) -> str:
    return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")


MAX_MEMBERS = 256
"""Top-level members of metadata; each of a filter is a condition, and a database takes a thousand at most."""

MAX_DEPTH = 32
"""Of metadata. Comparing and writing values takes recursion, which has an end."""


def check_metadata(value: dict[str, Any]) -> dict[str, Any]:
    """Keys must be printable, and values must not nest deeper than MAX_DEPTH."""
    for key in value:
        printable(key)
    level: list[Any] = [value]
    for _ in range(MAX_DEPTH):
        level = [
            inner for outer in level if isinstance(outer, dict | list)
            for inner in (outer.values() if isinstance(outer, dict) else outer)
        ]  # fmt: skip
    if any(isinstance(one, dict | list) for one in level):
        raise ValueError(f"must not nest deeper than {MAX_DEPTH} levels")
    return value


Text = Annotated[str, AfterValidator(printable), AfterValidator(_not_blank)]
"""Printable, not blank, without spaces at its ends."""

def refused(error: ReebaseError) -> PydanticCustomError:
    """A refusal of the library as pydantic's, so that all that is wrong with a body is said at once."""
    return PydanticCustomError(error.code, "{message}", {"message": error.message, "details": error.details})


def one_of(kind: str, names: Callable[[], Collection[str]]) -> AfterValidator:
    """Refuse names that a registry does not hold. names: called when it is needed, for what is slow to import."""

    def check(name: str) -> str:
        known = names()
        if name not in known:
            raise refused(unknown_name(kind, name[:80], known))
        return name

    return AfterValidator(check)


Moment = Annotated[datetime, PlainSerializer(_utc, when_used="json")]
"""UTC, ISO 8601 with milliseconds."""

Finite = Annotated[float, Field(allow_inf_nan=False)]

Metadata = Annotated[
    dict[str, Any],
    AfterValidator(check_metadata),
    Field(
        max_length=MAX_MEMBERS,
        description="Any JSON object; its top-level members can be filtered by.",
        examples=[{"source": "scan"}],
    ),
]

Triple = Annotated[list[float], Field(min_length=3, max_length=3)]
"""Three numbers: a position, or ω = (a, dv, dc)."""

CollectionName = Annotated[
    str,
    Field(
        pattern=COLLECTION_NAME, description="Lower-case letters, digits, `.`, `_` and `-`; at most 63.",
        examples=["animals"],
    ),
]  # fmt: skip


class PageOf(Value, Generic[T]):
    """A page of a list. `next` is the `cursor` of the page that follows, null at the end."""

    items: list[T]
    next: str | None


class Progress(Value):
    """How far a task is: the stage that runs, and the fraction of the whole that is done."""

    stage: str | None = Field(examples=["eigenpairs"])
    fraction: float = Field(ge=0, le=1)


class ErrorValue(Value):
    """Why a task failed: a stable code and words."""

    code: str = Field(examples=["truncated_file"])
    detail: str
    details: dict[str, Any] | None = None
