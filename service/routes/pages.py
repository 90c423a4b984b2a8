"""The page, its files, and a reference of the API that needs no script and no other host."""

from __future__ import annotations

import gzip
import hashlib
import html
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import HTMLResponse, Response

from service.conditional import unless_unchanged
from service.errors import RouteNotFound
from service.problems import catalogue

__all__ = ["lost_page", "router"]

router = APIRouter(include_in_schema=False)

_PAGE = Path(__file__).resolve().parent.parent / "page"
_TYPES = {".css": "text/css", ".html": "text/html", ".js": "text/javascript", ".svg": "image/svg+xml"}


class _File(NamedTuple):
    plain: bytes
    packed: bytes
    etag: str
    media_type: str


@router.get("/")
@router.get("/collections/{rest:path}")
@router.get("/evaluations")
@router.get("/evaluations/{rest:path}")
@router.get("/tasks")
def page(request: Request) -> Response:
    """The page: which of its views is shown, its script reads from the address."""
    return _sent(request, _PAGE / "index.html")


def lost_page(request: Request) -> Response | None:
    """What a browser shows where there is nothing: the page says so itself. None where a program asks."""
    wanted = "text/html" in request.headers.get("accept", "")
    inside = request.url.path.partition("/")[2].partition("/")[0] in ("v1", "page")
    if request.method != "GET" or inside or not wanted:
        return None
    path = _PAGE / "index.html"
    plain = _read(path, path.stat().st_mtime_ns).plain
    return HTMLResponse(plain, 404, {"Cache-Control": "no-store", "Vary": "Accept"})


@router.get("/page/{name:path}")
def part_of_page(request: Request, name: str) -> Response:
    """A file of the page: only those that are there, by their plain paths."""
    for path in _PAGE.rglob("*"):
        if path.relative_to(_PAGE).as_posix() == name and path.suffix in _TYPES and path.is_file():
            return _sent(request, path)
    raise RouteNotFound(f"There is nothing at /page/{name[:80]}.")


def _sent(request: Request, path: Path) -> Response:
    """The file, packed for a browser that says it unpacks; not sent again while it has not changed."""
    file = _read(path, path.stat().st_mtime_ns)
    packed = "gzip" in request.headers.get("accept-encoding", "")
    headers = {"Cache-Control": "no-cache", "Vary": "Accept-Encoding"}

    def make() -> Response:
        if packed:
            headers["Content-Encoding"] = "gzip"
        return Response(file.packed if packed else file.plain, media_type=file.media_type, headers=headers)

    return unless_unchanged(request, f"{file.etag}-gzip" if packed else file.etag, make)


@lru_cache(maxsize=256)
def _read(path: Path, _changed: int) -> _File:
    plain = path.read_bytes()
    etag = hashlib.sha256(plain).hexdigest()[:32]
    return _File(plain, gzip.compress(plain, 9, mtime=0), etag, _TYPES[path.suffix])


@router.get("/docs")
def reference(request: Request) -> Response:
    """All operations and all problems, from the OpenAPI document."""
    return HTMLResponse(_reference(request.app.openapi()), headers={"Cache-Control": "no-cache"})


def _parameter(parameter: dict[str, Any]) -> str:
    name, text = html.escape(parameter["name"]), html.escape(parameter.get("description", ""))
    return f"<li><code>{name}</code> ({parameter['in']}) {text}</li>"


def _operation(method: str, path: str, operation: dict[str, Any]) -> str:
    told = f"{operation.get('summary', '')}. {operation.get('description', '')}"
    parameters = "".join(_parameter(parameter) for parameter in operation.get("parameters", ()))
    bodies = ", ".join(operation.get("requestBody", {}).get("content", {}))
    answers = ", ".join(status for status in operation["responses"] if status < "4")
    return (
        f"<section id='{html.escape(operation['operationId'])}'>"
        f"<h3><code>{method.upper()} {html.escape(path)}</code></h3><p>{html.escape(told)}</p>"
        + (f"<ul>{parameters}</ul>" if parameters else "")
        + (f"<p class='quiet'>Body: {html.escape(bodies)}</p>" if bodies else "")
        + f"<p class='quiet'>Answers: {html.escape(answers)}</p></section>"
    )


def _problem(code: str, status: int, text: str) -> str:
    named = f"<th scope='row'><code>{code}</code></th>"
    return f"<tr id='{code}'>{named}<td>{status}</td><td>{html.escape(text)}</td></tr>"


_REFERENCE = """<!doctype html>
<html lang="en">
<head>
  <meta charset="utf-8">
  <meta name="viewport" content="width=device-width, initial-scale=1">
  <meta name="color-scheme" content="light dark">
  <title>Reebase: API reference</title>
  <link rel="icon" href="/page/icon.svg" type="image/svg+xml">
  <link rel="stylesheet" href="/page/style/page.css">
</head>
<body class="reference">
  <header class="top">
    <a class="brand" href="/"><img src="/page/icon.svg" alt="" width="26" height="26">Reebase</a>
    <nav aria-label="Service">
      <a href="/">The page</a> <a href="/openapi.json">OpenAPI</a> <a href="#problems">Problems</a>
    </nav>
  </header>
  <main>
    <h1>API reference</h1>
    <p>{description}</p>
    {operations}
    <section>
      <h2 id="problems">Problems</h2>
      <p>Every error is application/problem+json (RFC 9457) with one of these codes.</p>
      <div class="scroll"><table>
        <thead>
          <tr><th scope="col">Code</th><th scope="col">Status</th><th scope="col">Meaning</th></tr>
        </thead>
        <tbody>{problems}</tbody>
      </table></div>
    </section>
  </main>
</body>
</html>
"""


def _reference(document: dict[str, Any]) -> str:
    operations = "".join(
        _operation(method, path, operation)
        for path, methods in document["paths"].items()
        for method, operation in methods.items()
    )
    return _REFERENCE.format(
        description=html.escape(document["info"]["description"]),
        operations=operations,
        problems="".join(_problem(*row) for row in catalogue()),
    )
