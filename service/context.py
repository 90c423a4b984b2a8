"""What every request works with: one value, made when the service starts, closed when it stops."""

from __future__ import annotations

import threading
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Annotated

from anyio import CapacityLimiter
from fastapi import Depends
from starlette.requests import Request

from service.events import EventHub
from service.metrics import Metrics
from service.plots import Plots
from service.rates import RateLimiter
from service.settings import ServiceSettings
from store import sweep
from store.blobs import Blobs, open_blobs
from store.engine import Database
from store.errors import StoreError
from store.follower import IndexFollower
from store.overview import RecentOverview

__all__ = ["Context", "Here"]


@dataclass(frozen=True)
class Context:
    """Settings, database, blobs, and what this process holds in memory.

    stopping: set when the service is told to stop, so that requests that wait answer at once.
    """

    settings: ServiceSettings
    database: Database
    blobs: Blobs
    follower: IndexFollower
    metrics: Metrics
    events: EventHub
    overview: RecentOverview = field(default_factory=RecentOverview)
    plots: Plots = field(default_factory=Plots)
    limiter: RateLimiter = field(default_factory=RateLimiter)
    stopping: threading.Event = field(default_factory=threading.Event)
    # Threads of the probes alone.
    probes: CapacityLimiter = field(default_factory=lambda: CapacityLimiter(2))

    @classmethod
    def open(cls, settings: ServiceSettings, metrics: Metrics, stopping: threading.Event) -> Context:
        """Raises what the store raises when its places cannot be used."""
        database = Database(settings.database_url)
        follower, hub = IndexFollower(database, settings.gallery_memory_bytes), EventHub(database, settings.max_streams)
        return cls(settings, database, open_blobs(settings), follower, metrics, hub, stopping=stopping)

    def remove_unnamed(self, sha256: str, grace_seconds: float | None = None) -> None:
        """Remove a blob that no row names, if that can be done now; else the sweep will.

        grace_seconds: spare what was put since; by default what the settings say.
        """
        grace = self.settings.sweep_grace_seconds if grace_seconds is None else grace_seconds
        with suppress(StoreError, OSError):
            sweep.remove_unnamed(self.database, self.blobs, sha256, grace)

    def close(self) -> None:
        self.database.close()


async def context_of(request: Request) -> Context:  # a coroutine needs no thread
    """The context of the application that serves this request."""
    found: Context = request.app.state.context
    return found


Here = Annotated[Context, Depends(context_of)]
