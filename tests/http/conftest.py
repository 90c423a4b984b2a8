"""One whole service for all tests that need its worker, and an API alone for those that do not."""

from __future__ import annotations

import itertools
import signal
from collections.abc import Iterator

import httpx
import pytest
import structlog

from tests.http.serving import Served, api_alone, whole_service

_numbers = itertools.count()


@pytest.fixture(scope="session", autouse=True)
def interruptible() -> None:
    """A shell that runs the tests in the background has them ignore SIGINT, and so would all that they start."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session", autouse=True)
def quiet() -> Iterator[None]:
    """No log from the API in this process: failures print what they have."""

    def drop(*_: object) -> str:
        raise structlog.DropEvent

    before = structlog.get_config()["processors"]
    structlog.configure(processors=[drop])
    yield
    structlog.configure(processors=before)


@pytest.fixture(scope="session")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """API and worker, as `serve` starts them."""
    with whole_service(tmp_path_factory.mktemp("service") / "home") as served:
        yield served


@pytest.fixture(scope="session")
def http(service: Served) -> Iterator[httpx.Client]:
    """A client of the whole service."""
    with service.client() as client:
        yield client


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """The API without a worker, with small limits."""
    home = tmp_path_factory.mktemp("alone")
    with api_alone(home, max_upload_bytes=200_000, max_json_bytes=50_000) as served:
        yield served


@pytest.fixture(scope="module")
def api(alone: Served) -> Iterator[httpx.Client]:
    """A client of the API without a worker."""
    with alone.client() as client:
        yield client


def new_collection(client: httpx.Client) -> str:
    """The path of a new, empty collection."""
    name = f"c{next(_numbers)}"
    client.post("/v1/collections", json={"name": name}).raise_for_status()
    return f"/v1/collections/{name}"


@pytest.fixture
def collection(http: httpx.Client) -> str:
    """An empty collection of the whole service."""
    return new_collection(http)


@pytest.fixture
def shelf(api: httpx.Client) -> str:
    """An empty collection of the API without a worker."""
    return new_collection(api)
