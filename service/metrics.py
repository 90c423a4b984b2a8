"""What /metrics tells: requests by route, and tasks by state."""

from __future__ import annotations

from collections.abc import Mapping

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram
from prometheus_client.exposition import generate_latest

__all__ = ["MEDIA_TYPE", "Metrics"]

MEDIA_TYPE = "text/plain; version=0.0.4; charset=utf-8"

_METHODS = frozenset({"GET", "HEAD", "POST", "PATCH", "PUT", "DELETE", "OPTIONS"})

# An upload of hundreds of megabytes and a query that waits take long; most requests take milliseconds.
_BUCKETS = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0, 60.0)


class Metrics:
    """The counters of one process, in a registry of their own."""

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        self.requests = Counter(
            "reebase_requests", "Requests answered.", ["method", "route", "status"], registry=self.registry
        )
        self.seconds = Histogram(
            "reebase_request_seconds", "Time to answer, to the last byte.", ["method", "route"],
            buckets=_BUCKETS, registry=self.registry,
        )  # fmt: skip
        self.tasks = Gauge(
            "reebase_tasks", "Tasks by kind and state.", ["kind", "state"], registry=self.registry
        )
        self.depth = Gauge("reebase_queue_depth", "Tasks that wait for a worker.", registry=self.registry)

    def observe(self, method: str, route: str, status: int, seconds: float) -> None:
        """Count one request. ``route`` is the template, so that ids do not become label values."""
        known = method if method in _METHODS else "OTHER"
        self.requests.labels(known, route, str(status)).inc()
        self.seconds.labels(known, route).observe(seconds)

    def render(self, tasks: Mapping[tuple[str, str], int]) -> bytes:
        """The page, with the tasks counted by (kind, state) just now."""
        self.tasks.clear()
        for (kind, state), count in tasks.items():
            self.tasks.labels(kind, state).set(count)
        self.depth.set(sum(count for (_, state), count in tasks.items() if state == "queued"))
        return generate_latest(self.registry)
