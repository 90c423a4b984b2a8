"""How every call of the client asks, pages and sends files."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, Self, TypeVar, cast
from urllib.parse import quote

import httpx

from reebase.client.transport import Transport
from reebase.errors import ParameterError
from reebase.mesh.mesh import Mesh
from reebase.mesh.write import to_bytes

__all__ = ["Requests", "Source", "collection_path", "given", "opened", "segment", "shape_path"]

Source = str | os.PathLike[str] | bytes | Mesh
"""A path, a file's bytes or a mesh."""

_T = TypeVar("_T")
_PAGE = 200
_LONG_POLL = 20.0


class Requests:
    """The connection that all calls share."""

    def __init__(
        self, url: str = "http://127.0.0.1:8000", *, api_key: str | None = None, timeout: float = 120.0,
        patience: float = 10.0, transport: httpx.BaseTransport | None = None,
    ) -> None:  # fmt: skip
        key = api_key or os.environ.get("REEBASE_API_KEY")
        self._http = Transport(url, api_key=key, timeout=timeout, patience=patience, transport=transport)
        self._poll = min(_LONG_POLL, timeout / 2)
        self.url = self._http.url

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the connections. A request of another thread that is about to be repeated gives up."""
        self._http.close()

    def _get(
        self, make: Callable[[dict[str, Any]], _T], path: str, *, method: str = "GET", **arguments: Any
    ) -> _T:
        return cast(_T, self._http.built(make, self._http.json(method, path, **arguments)))

    def _pages(
        self, make: Callable[[dict[str, Any]], _T], path: str, filters: Mapping[str, Any]
    ) -> Iterator[_T]:
        parameters = {"limit": _PAGE, **filters}
        while True:
            page = self._http.json("GET", path, params=parameters)
            yield from self._http.built(lambda found: [make(one) for one in found["items"]], page)
            if not page.get("next"):
                return
            parameters["cursor"] = page["next"]


def segment(value: str) -> str:
    """A name or id as one segment of a path."""
    if value in ("", ".", ".."):
        raise ParameterError(f"{value!r} is not a name or an id.", found=value)
    return quote(value, safe="")


def collection_path(name: str) -> str:
    return f"/v1/collections/{segment(name)}"


def shape_path(collection: str, shape: str) -> str:
    return f"{collection_path(collection)}/shapes/{segment(shape)}"


def given(values: Mapping[str, Any]) -> dict[str, Any]:
    """What is not None."""
    return {name: value for name, value in values.items() if value is not None}


@contextmanager
def opened(source: Source, name: str | None) -> Iterator[tuple[str, bytes | IO[bytes]]]:
    """The file name and the content of what is sent; a file is left on disk and read as it goes out."""
    if isinstance(source, Mesh):
        yield name or "mesh.ply", to_bytes(source, "ply")
    elif isinstance(source, bytes):
        yield name or "mesh", source
    else:
        path = Path(source)
        with path.open("rb") as content:
            yield path.name.encode(errors="replace").decode(), content
