"""The client: one method a route."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import httpx

from reebase.client import received
from reebase.client.collections import CollectionCalls
from reebase.client.evaluations import EvaluationCalls
from reebase.client.queries import QueryCalls
from reebase.client.records import Descriptor, Filter, Formats, Measure, Readiness, ServiceLimits
from reebase.client.shapes import ShapeCalls

__all__ = ["Client"]


class Client(CollectionCalls, ShapeCalls, QueryCalls, EvaluationCalls):
    """A connection to a Reebase service. Thread-safe; close it, or use it in ``with``.

    url: where the service answers. api_key: where it asks for one, by default $REEBASE_API_KEY.
    timeout: seconds to wait for one reply. patience: seconds during which a request is repeated while nobody
    answers or the service is busy, 0 for a single try. transport: an httpx transport, for tests without a socket.
    Raises ParameterError for an url or a key that cannot be one.

    Every method raises ServiceError when the service refuses (``code`` says why: ``collection_not_found``,
    ``validation_error``, ...), ServiceUnreachable when nobody answers, UnexpectedReply when something else does.
    """

    def limits(self) -> ServiceLimits:
        """What a request may hold."""
        return self._get(lambda found: received.record(ServiceLimits, found), "/v1/limits")

    def formats(self) -> Formats:
        """What can be uploaded, and what meshes are given back in."""

        def made(found: Mapping[str, Any]) -> Formats:
            return Formats({one["name"]: one["media_type"] for one in found["items"]}, tuple(found["written"]))

        return self._get(made, "/v1/formats")

    def measures(self) -> list[Measure]:
        """The measures of D that a query or an evaluation can name."""
        return self._get(lambda found: [received.record(Measure, one) for one in found["items"]], "/v1/measures")

    def descriptors(self) -> list[Descriptor]:
        """What a query or an evaluation can name as descriptor."""

        def made(found: Mapping[str, Any]) -> list[Descriptor]:
            return [received.record(Descriptor, one, default=one["name"] == found["default"]) for one in found["items"]]

        return self._get(made, "/v1/descriptors")

    def filters(self) -> list[Filter]:
        """The denoising filters that a profile can name."""
        return self._get(lambda found: [received.record(Filter, one) for one in found["items"]], "/v1/filters")

    def profiles(self) -> dict[str, dict[str, Any]]:
        """Parameters of the pipeline by name: what a profile's ``base`` can be."""
        return self._get(lambda found: {one["name"]: one["profile"] for one in found["items"]}, "/v1/profiles")

    def readiness(self) -> Readiness:
        """Whether it can serve, and when a worker was last seen. Raises ServiceError: ``not_ready``."""
        return self._get(lambda found: received.record(Readiness, found), "/readyz")

    def ready(self) -> bool:
        """Whether the service answers and can serve, asked once."""
        reply = self._http.answers()
        return reply is not None and reply.status_code == httpx.codes.OK
