"""Settings of the HTTP service, beside those of the store; each is an environment variable REEBASE_…."""

from __future__ import annotations

import ipaddress
from typing import Annotated

from pydantic import Field, field_validator
from pydantic_settings import NoDecode

from service.guards import LOOPBACK_NAMES
from store.settings import Settings

__all__ = ["ServiceSettings"]


class ServiceSettings(Settings):
    """How the service meets its clients."""

    host: str = "127.0.0.1"
    hosts: Annotated[frozenset[str], NoDecode] = frozenset()
    """Names beside those of loopback that the Host header may carry, separated by commas."""
    require_keys: bool = False
    """Ask for API keys on loopback too."""
    allow_anonymous: bool = False
    """Serve without keys on any address. Whoever reaches the service may then do everything."""
    requests_per_minute: int = Field(6000, ge=1)
    """Rate limit of a key that has none of its own."""
    max_connections: int = Field(512, ge=1)
    """So many connections are served at once; a request beyond is answered 503."""
    max_json_bytes: int = Field(1 << 20, ge=1024)
    max_wait_seconds: float = Field(60.0, ge=0)
    max_streams: int = Field(64, ge=0)
    """So many listen to events at once; a further one is answered 503 and polls."""
    max_stream_seconds: float = Field(600.0, ge=0)
    """After that a listener connects again, and its key is looked at again."""
    idempotency_seconds: float = Field(86400.0, gt=0)

    @field_validator("hosts", mode="before")
    @classmethod
    def _split(cls, value: object) -> object:
        if isinstance(value, str):
            return frozenset(name.strip().lower() for name in value.split(",") if name.strip())
        return value

    @property
    def loopback(self) -> bool:
        """Whether the service is bound where only this machine reaches it."""
        if self.host == "localhost":
            return True
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False

    @property
    def anonymous(self) -> bool:
        """Whether a request without a key may do everything."""
        return self.allow_anonymous or (self.loopback and not self.require_keys)

    @property
    def known_hosts(self) -> frozenset[str] | None:
        """Names that the Host header may carry; None for any."""
        if self.loopback:
            return LOOPBACK_NAMES | self.hosts
        return self.hosts | LOOPBACK_NAMES if self.hosts else None
