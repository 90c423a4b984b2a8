"""Requests that survive a bad connection: what may be repeated is repeated, with growing pauses."""

from __future__ import annotations

import ipaddress
import random
import threading
import time
import uuid
from collections.abc import Callable
from typing import Any

import httpx

from reebase.client.errors import RequestBroken, ServiceError, ServiceUnreachable, UnexpectedReply
from reebase.errors import ParameterError
from reebase.words import program

__all__ = ["Transport"]

_NOT_SENT = (httpx.ConnectError, httpx.ConnectTimeout, httpx.PoolTimeout)
"""Failures before anything reached the service: to try again is always right."""
_NOT_DONE = frozenset({429, 503})
"""Statuses that say that nothing was done."""
_PERHAPS_DONE = frozenset({502, 504})
"""What a proxy says when the service behind it may have done the work all the same."""
_REPEATABLE = frozenset({"GET", "PATCH", "DELETE"})
_FIRST_PAUSE, _LONGEST_PAUSE = 0.1, 5.0
_CONNECT_SECONDS = 10.0
_LONGEST_ASKED = 60.0
_MOST_ASKED = 600.0


class Transport:
    """An HTTP client of one service. Thread-safe.

    patience: for how many seconds a request is repeated while nobody answers or the service is busy. The time
    that the service itself asks for (Retry-After) comes on top, up to ten minutes.
    """

    def __init__(
        self, url: str, *, api_key: str | None, timeout: float, patience: float,
        transport: httpx.BaseTransport | None,
    ) -> None:  # fmt: skip
        self.url = _checked_url(url)
        self.patience = patience
        self._closed = threading.Event()
        self._http = httpx.Client(
            base_url=self.url,
            headers={"Authorization": f"Bearer {_checked_key(api_key)}"} if api_key else {},
            timeout=httpx.Timeout(timeout, connect=min(_CONNECT_SECONDS, timeout)),
            transport=transport,
            # A proxy from the environment cannot reach this machine's loopback.
            trust_env=not _is_loopback(httpx.URL(self.url).host),
        )

    def close(self) -> None:
        """Close the connections; requests that pause between two attempts give up at once."""
        self._closed.set()
        self._http.close()

    def request(
        self, method: str, path: str, *, creates: bool = False, reads: bool = False, **arguments: Any
    ) -> httpx.Response:  # fmt: skip
        """The successful response.

        creates: send an Idempotency-Key, so that a repeated POST is done once. reads: it changes nothing. A POST
        that is neither is repeated only when it was surely not done.
        Raises ServiceError, ServiceUnreachable, UnexpectedReply and RequestBroken.
        """
        if creates:
            arguments["headers"] = {"Idempotency-Key": str(uuid.uuid4())}
        repeatable = creates or reads or method in _REPEATABLE
        pauses = _Pauses(self.patience, self._closed)
        while True:
            try:
                reply = self._http.request(method, path, **arguments)
            except httpx.RequestError as failure:
                if isinstance(failure, httpx.LocalProtocolError):
                    raise RequestBroken(f"The request could not be sent whole: {failure}.") from failure
                if (repeatable or isinstance(failure, _NOT_SENT)) and pauses.sleep():
                    continue
                raise self._unreachable(failure) from failure
            except RuntimeError as failure:
                # httpx has no class of its own for this.
                if self._closed.is_set():
                    raise ServiceUnreachable("The client was closed.") from failure
                raise
            if reply.is_success:
                return reply
            if pauses.attempts and method == "DELETE" and reply.status_code == httpx.codes.NOT_FOUND:
                return reply  # an earlier attempt, whose answer was lost, did it
            refusal = self._refusal(reply)
            if not (_may_pass(refusal, repeatable) and pauses.sleep(_retry_after(reply))):
                raise refusal

    def json(self, method: str, path: str, **arguments: Any) -> dict[str, Any]:
        """The JSON object in the successful response."""
        return self.object_of(self.request(method, path, **arguments))

    def object_of(self, reply: httpx.Response) -> dict[str, Any]:
        """The JSON object in a response. Raises UnexpectedReply."""
        try:
            body = reply.json()
        except ValueError:
            body = None
        if not isinstance(body, dict):
            raise UnexpectedReply(f"{reply.request.url} answered, but not as a Reebase service does. Is --url right?")
        return body

    def built(self, make: Callable[[dict[str, Any]], Any], values: dict[str, Any]) -> Any:
        """What ``make`` makes of a JSON object. Raises UnexpectedReply where something is missing in it."""
        try:
            return make(values)
        except (KeyError, TypeError, ValueError, AttributeError) as failure:
            raise UnexpectedReply(
                f"{self.url} sent something that this version of the client does not understand ({failure!r})."
            ) from failure

    def answers(self) -> httpx.Response | None:
        """The response of /readyz, without a second try; None when nobody answers."""
        try:
            return self._http.get("/readyz", timeout=_CONNECT_SECONDS)
        except httpx.RequestError:
            return None

    def _unreachable(self, failure: httpx.RequestError) -> ServiceUnreachable:
        if isinstance(failure, httpx.TimeoutException) and not isinstance(failure, _NOT_SENT):
            return ServiceUnreachable(f"{self.url} took the request but did not answer in time.")
        reason = str(failure) or type(failure).__name__
        return ServiceUnreachable(
            f"No answer from {self.url} ({reason}). Is the service running ({program()} serve)? Where it is "
            "elsewhere, name its address: --url or REEBASE_URL."
        )

    def _refusal(self, reply: httpx.Response) -> ServiceError:
        if reply.is_redirect:
            target = reply.headers.get("location", "elsewhere")
            detail = f"{self.url} sends its callers to {target}; use that address."
            return ServiceError(reply.status_code, {"code": "redirected", "detail": detail})
        try:
            body = reply.json()
        except ValueError:
            body = None
        if not isinstance(body, dict) or "code" not in body:
            phrase = f"{reply.status_code} {reply.reason_phrase}".strip()
            body = {"code": f"http_{reply.status_code}", "detail": f"{reply.request.url} answered {phrase}."}
        return ServiceError(reply.status_code, body)


class _Pauses:
    """The pauses between attempts, until patience ends."""

    def __init__(self, patience: float, closed: threading.Event) -> None:
        self.attempts = 0
        self._closed = closed
        self._end = time.monotonic() + patience
        self._once = patience <= 0
        self._pause = _FIRST_PAUSE
        self._asked = 0.0

    def sleep(self, asked: float | None = None) -> bool:
        """Pause before the next attempt; False when there shall be none. asked: seconds that the service names."""
        if self._once:
            return False
        if asked is not None and self._asked + asked <= _MOST_ASKED:
            self._asked += asked
            self._end += asked
            pause = asked
        else:
            # Many clients that lost the same service must not come back in step.
            pause = self._pause * random.uniform(0.5, 1.0)  # noqa: S311 - no secret
            self._pause = min(2 * self._pause, _LONGEST_PAUSE)
        left = self._end - time.monotonic()
        if left <= 0:
            return False
        self.attempts += 1
        return not self._closed.wait(min(pause, left))


def _may_pass(refusal: ServiceError, repeatable: bool) -> bool:
    """Whether the same request may succeed a moment later, and is safe to send again."""
    if refusal.status in _NOT_DONE or refusal.code == "idempotency_in_progress":
        return True
    return repeatable and refusal.status in _PERHAPS_DONE


def _retry_after(reply: httpx.Response) -> float | None:
    try:
        return min(max(float(reply.headers["Retry-After"]), 0.0), _LONGEST_ASKED)
    except (KeyError, ValueError):
        return None


def _checked_url(url: str) -> str:
    try:
        parsed = httpx.URL(url.strip())
    except httpx.InvalidURL as failure:
        raise ParameterError(f"{url!r} is not an address: {failure}.", parameter="url") from failure
    if parsed.scheme not in ("http", "https") or not parsed.host:
        raise ParameterError(
            f"{url!r} is not an address of a service; it must be like http://127.0.0.1:8000.", parameter="url"
        )
    return str(parsed).rstrip("/")


def _checked_key(key: str) -> str:
    stripped = key.strip()
    if not (stripped.isascii() and stripped.isprintable() and " " not in stripped):
        raise ParameterError("The API key has characters that no key has; was it copied whole?", parameter="api_key")
    return stripped


def _is_loopback(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
