"""The plain page, and a reference of the API that needs no script and no other host."""

from __future__ import annotations

import html
from pathlib import Path
from typing import Any

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, Response

from service.errors import RouteNotFound
from service.problems import catalogue

__all__ = ["router"]

router = APIRouter(include_in_schema=False)

_PAGE = Path(__file__).resolve().parent.parent / "page"
_TYPES = {".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}


@router.get("/")
def page() -> Response:
    """The page."""
    return FileResponse(_PAGE / "index.html", media_type="text/html", headers={"Cache-Control": "no-cache"})


@router.get("/page/{name}")
def part_of_page(name: str) -> Response:
    """A file of the page: only those that are there, by their plain names."""
    for path in _PAGE.iterdir():
        if path.name == name and path.suffix in _TYPES:
            return FileResponse(path, media_type=_TYPES[path.suffix], headers={"Cache-Control": "no-cache"})
    raise RouteNotFound(f"There is nothing at /page/{name[:80]}.")


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
  <link rel="stylesheet" href="/page/page.css">
</head>
<body>
  <header>
    <h1>Reebase: API reference</h1>
    <nav aria-label="Service">
      <a href="/">The page</a> <a href="/openapi.json">OpenAPI</a> <a href="#problems">Problems</a>
    </nav>
  </header>
  <main>
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
