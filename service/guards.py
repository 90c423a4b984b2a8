"""Checks of a request before it reaches a route: its host, its origin, its encoding.

On loopback the service trusts whoever can reach it, so a web page must not be able to: a name that an
attacker rebinds to 127.0.0.1 is refused by its Host header, a form on a foreign page by its Origin header.
"""

from __future__ import annotations

from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.requests import Request
from starlette.types import ASGIApp, Receive, Scope, Send

from reebase.errors import ReebaseError
from service.errors import ForeignOrigin, UnknownHost, UnsupportedEncoding
from service.problems import problem_response

__all__ = ["Guards", "host_name"]

LOOPBACK_NAMES = frozenset({"localhost", "127.0.0.1", "::1"})
_SAFE = frozenset({"GET", "HEAD", "OPTIONS"})


def host_name(header: str) -> str:
    """The name in a Host header, without port, brackets and a closing dot, in lower case."""
    try:
        return (urlsplit(f"//{header}").hostname or "").rstrip(".").lower()
    except ValueError:
        return ""


class Guards:
    """Refuses unknown hosts, foreign origins and encoded bodies.

    ``hosts``: names that the service answers for; None answers for all.
    """

    def __init__(self, app: ASGIApp, hosts: frozenset[str] | None) -> None:
        self.app = app
        self.hosts = hosts

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http" and (refusal := self._refusal(scope)) is not None:
            await problem_response(Request(scope), refusal)(scope, receive, send)
            return
        await self.app(scope, receive, send)

    def _refusal(self, scope: Scope) -> ReebaseError | None:
        headers = Headers(scope=scope)
        host = headers.get("host", "")
        if self.hosts is not None and host_name(host) not in self.hosts:
            return UnknownHost(
                f"This service does not answer for the host {host[:100]!r}; it answers for "
                f"{', '.join(sorted(self.hosts))}. Other names are set with REEBASE_HOSTS."
            )
        if scope["method"] in _SAFE:
            return None
        if headers.get("content-encoding", "identity").strip().lower() not in {"", "identity"}:
            return UnsupportedEncoding()
        # A key cannot be sent by a form of another page, so with one the origin does not matter.
        if "authorization" not in headers and self._foreign(headers, host):
            return ForeignOrigin()
        return None

    @staticmethod
    def _foreign(headers: Headers, host: str) -> bool:
        if headers.get("sec-fetch-site", "same-origin") in {"cross-site", "same-site"}:
            return True
        origin = headers.get("origin")
        if origin is None:
            return False
        try:
            return urlsplit(origin).netloc.lower() != host.lower()
        except ValueError:  # no browser sends it
            return True
