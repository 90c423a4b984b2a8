"""JSON bodies, read strictly: bounded, no NaN, no infinity, no text that a database cannot hold."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Coroutine, Iterator
from typing import Any

from fastapi.routing import APIRoute
from starlette.requests import Request
from starlette.responses import Response

from reebase.errors import TooManyBytes
from reebase.mesh.read.text import json_fault
from service.bodies import chunks
from service.errors import MalformedJson, UnsupportedMediaType

__all__ = ["StrictRoute", "is_json", "parse_json"]


def _no_constant(name: str) -> Any:
    raise MalformedJson(f"The body holds {name}, which JSON does not have.")


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise MalformedJson(f"The number {text[:40]} does not fit a double.")
    return value


def _no_repeats(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    value = dict(pairs)
    if len(value) != len(pairs):
        raise MalformedJson("An object in the body has the same member twice.")
    return value


def parse_json(text: bytes | str) -> Any:
    """The value of a JSON text. Raises MalformedJson."""
    try:
        value = json.loads(
            text, parse_constant=_no_constant, parse_float=_finite, object_pairs_hook=_no_repeats
        )
    except RecursionError:
        raise MalformedJson("The JSON is nested too deeply.") from None
    except ValueError as error:
        raise MalformedJson(f"The text is not JSON: {json_fault(error)}.") from None
    if any(_UNKEEPABLE.search(part) for part in _texts(value)):
        raise MalformedJson("A text in the body holds U+0000 or half a surrogate pair.")
    return value


# No database takes U+0000 in a text, and a lone surrogate is no character.
_UNKEEPABLE = re.compile("[\\x00\\ud800-\\udfff]")


def _texts(value: Any) -> Iterator[str]:
    """Every string in a JSON value, the names of members too."""
    waiting = [value]
    while waiting:
        one = waiting.pop()
        if isinstance(one, str):
            yield one
        elif isinstance(one, dict):
            yield from one
            waiting.extend(one.values())
        elif isinstance(one, list):
            waiting.extend(one)


class _StrictRequest(Request):
    async def body(self) -> bytes:
        """Raises TooManyBytes, UploadStalled."""
        if not hasattr(self, "_body"):
            limit = self.app.state.context.settings.max_json_bytes
            declared = self.headers.get("content-length", "")
            if declared.isdigit() and int(declared) > limit:
                raise _too_long(limit)
            held = bytearray()
            async for chunk in chunks(self):
                held += chunk
                if len(held) > limit:
                    raise _too_long(limit)
            self._body = bytes(held)
        return self._body

    async def json(self) -> Any:
        return parse_json(await self.body())


def _too_long(limit: int) -> TooManyBytes:
    return TooManyBytes(f"A JSON body may have at most {limit} bytes.", limit=limit)


def is_json(request: Request) -> bool:
    """Whether the request says that its body is JSON; a glTF file is a mesh."""
    kind = request.headers.get("content-type", "").split(";")[0].strip().lower()
    return kind == "application/json" or (kind.startswith("application/") and kind.endswith("+json"))


def _has_body(request: Request) -> bool:
    return request.headers.get("content-length", "0") != "0" or "transfer-encoding" in request.headers


class StrictRoute(APIRoute):
    """A route whose JSON body is read strictly, and by its header."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        handle = super().get_route_handler()
        takes_json = self.body_field is not None

        async def strictly(request: Request) -> Response:
            if takes_json and _has_body(request) and not is_json(request):
                raise UnsupportedMediaType("The body must be JSON; send the header `Content-Type: application/json`.")
            return await handle(_StrictRequest(request.scope, request.receive))

        return strictly
