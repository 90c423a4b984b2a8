"""Token buckets: so many requests a minute for each API key, with room for a burst."""

from __future__ import annotations

import math
import threading
import time
from collections import OrderedDict
from collections.abc import Callable

__all__ = ["RateLimiter"]


class RateLimiter:
    """A bucket for each name, filled at a key's rate up to ten seconds' worth; a request takes one token.

    Held in this process: with N API processes a key gets at most N times its rate.
    """

    def __init__(self, *, names: int = 10_000, clock: Callable[[], float] = time.monotonic) -> None:
        self._names = names
        self._clock = clock
        self._lock = threading.Lock()
        self._buckets: OrderedDict[str, tuple[float, float]] = OrderedDict()

    def wait(self, name: str, per_minute: int) -> int:
        """Take a token: 0 when there was one, else the whole seconds after which there will be one."""
        rate = per_minute / 60.0
        burst = max(1.0, 10.0 * rate)
        now = self._clock()
        with self._lock:
            tokens, since = self._buckets.pop(name, (burst, now))
            tokens = min(burst, tokens + (now - since) * rate)
            missing = 1.0 - tokens
            self._buckets[name] = (tokens if missing > 0 else tokens - 1.0, now)
            # The least recently used bucket is the fullest one: forgetting it forgets least.
            while len(self._buckets) > self._names:
                self._buckets.popitem(last=False)
        return max(1, math.ceil(missing / rate)) if missing > 0 else 0
