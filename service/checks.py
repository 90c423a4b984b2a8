"""Checks against the limits of the settings, which a schema cannot know; each refusal says the limit."""

from __future__ import annotations

import json
from typing import Any

from service.errors import InvalidRequest
from service.problems import pointer
from service.schemas.queries import QueryParameters
from service.schemas.shapes import Attributes, ShapePatch
from service.settings import ServiceSettings

__all__ = ["MAX_PAGE", "check_attributes", "check_label", "check_query"]

MAX_PAGE = 500

Place = tuple[int | str, ...]


class _Findings:
    def __init__(self, form: bool, prefix: Place = ()) -> None:
        self.errors: list[dict[str, Any]] = []
        self._form = form
        self._prefix = prefix

    def add(self, name: str, detail: str, code: str) -> None:
        place: dict[str, Any] = (
            {"parameter": name, "location": "form"}
            if self._form
            else {"pointer": pointer((*self._prefix, name))}
        )
        self.errors.append({"detail": f"{name}: {detail}", "code": code, **place})

    def longest(self, name: str, text: str | None, limit: int) -> None:
        if text is not None and len(text) > limit:
            self.add(name, f"has {len(text)} characters; at most {limit} are allowed", "too_long")

    def refuse(self) -> None:
        if self.errors:
            raise InvalidRequest(self.errors)


def check_attributes(value: Attributes | ShapePatch, settings: ServiceSettings, *, form: bool) -> None:
    """Raises InvalidRequest naming every attribute over its limit. form: they came as fields, not as JSON."""
    found = _Findings(form)
    found.longest("name", value.name, settings.max_name_length)
    found.longest("label", value.label, settings.max_label_length)
    tags = value.tags or []
    if len(tags) > settings.max_tags:
        found.add("tags", f"there are {len(tags)}; at most {settings.max_tags} are allowed", "too_many")
    for tag in tags[: settings.max_tags]:
        found.longest("tags", tag, settings.max_tag_length)
    size = len(json.dumps(value.metadata or {}, ensure_ascii=False).encode())
    if size > settings.max_metadata_bytes:
        found.add(
            "metadata",
            f"has {size} bytes as JSON; at most {settings.max_metadata_bytes} are allowed",
            "too_long",
        )
    found.refuse()


def check_label(label: str | None, settings: ServiceSettings) -> None:
    """Raises InvalidRequest for a label that is too long."""
    found = _Findings(form=False)
    found.longest("label", label, settings.max_label_length)
    found.refuse()


def check_query(
    value: QueryParameters, settings: ServiceSettings, *, form: bool = False, prefix: Place = ()
) -> None:
    """Raises InvalidRequest for values out of bounds, UnknownName for an unknown descriptor or measure, ParameterError
    for what does not go together.
    """
    from reebase.errors import ParameterError, UnknownName
    from reebase.ranking import ranking_named

    found = _Findings(form, prefix)
    if not 1 <= value.k <= settings.max_k:
        found.add("k", f"is {value.k}; it must be between 1 and {settings.max_k}", "out_of_range")
    found.longest("label", value.label, settings.max_label_length)
    try:
        ranking_named(value.descriptor, value.measure, value.rerank)
    except (UnknownName, ParameterError) as refusal:
        if not found.errors:
            raise
        place = str(refusal.details.get("parameter", "descriptor")).split()[0]
        found.add(place, refusal.message, refusal.code)
    found.refuse()
