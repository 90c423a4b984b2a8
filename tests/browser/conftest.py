"""A real browser in front of a real service with real shapes."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from playwright.sync_api import Browser, BrowserContext, ConsoleMessage, Page, sync_playwright

from reebase.client import Client
from reebase.evaluation.synthetic import synthetic_shape
from tests.http.serving import Served, whole_service

CLASSES = ("hands", "humans", "spiders")
PER_CLASS = 4
WAIT = 30_000
"""Milliseconds that a page may take for what a person would wait for."""

# Software WebGL: the machines of a gate have no graphics card.
_SWITCHES = [
    "--no-sandbox", "--disable-gpu", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--disable-background-networking", "--disable-dev-shm-usage",
]  # fmt: skip

_WATCH = """
window.refusals = [];
document.addEventListener("securitypolicyviolation", (e) => {
  refusals.push(`${e.violatedDirective}: ${e.blockedURI} ${e.sourceFile}`);
});
"""


def chromium() -> str:
    """Where the browser is. Without one these tests are skipped by name, or fail where they are required."""
    found = os.environ.get("REEBASE_CHROMIUM") or shutil.which("chromium") or shutil.which("google-chrome")
    if found:
        return found
    told = "No chromium here: `apt-get install chromium`, or name one in REEBASE_CHROMIUM."
    if os.environ.get("REEBASE_BROWSER_TESTS") == "required":
        pytest.fail(told)
    pytest.skip(told)


@dataclass
class Seen:
    """A page and all that went wrong in it."""

    page: Page
    complaints: list[str] = field(default_factory=list)
    provoked: set[str] = field(default_factory=set)

    def hear(self, message: ConsoleMessage) -> None:
        # The driver of a graphics card in software is slow when a picture is read back, and says so.
        if message.type == "error" or (message.type == "warning" and "GL Driver Message" not in message.text):
            self.complaints.append(f"{message.type}: {message.text} {message.location.get('url', '')}")

    def forget(self, part: str) -> None:
        """A complaint that a test has provoked: it must have come by the end, and may come again."""
        self.provoked.add(part)

    def check(self) -> None:
        refusals = self.page.evaluate("window.refusals ?? []")
        assert all(any(part in one for one in self.complaints) for part in self.provoked), self.complaints
        assert [one for one in self.complaints if not any(part in one for part in self.provoked)] == []
        assert refusals == []


@pytest.fixture(scope="session")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """API and worker, as `serve` starts them."""
    with whole_service(tmp_path_factory.mktemp("browser") / "home") as served:
        yield served


@pytest.fixture(scope="session")
def zoo(service: Served) -> dict[str, str]:
    """A collection of synthetic shapes, indexed: name -> id."""
    with Client(service.url) as client:
        client.create_collection("zoo", description="Synthetic animals and people")
        tasks = []
        for label in CLASSES:
            for number in range(PER_CLASS):
                made = synthetic_shape(label, number, 0)
                tasks.append(client.upload("zoo", made.mesh, name=made.name, label=made.label).task)
        for task in tasks:
            assert task is not None
            client.wait(task)
        return {shape.name: shape.id for shape in client.shapes("zoo")}


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    # A module's, not the session's: its loop must not run under the tests of other directories.
    with sync_playwright() as playwright:
        launched = playwright.chromium.launch(executable_path=chromium(), args=_SWITCHES)
        yield launched
        launched.close()


@pytest.fixture
def opened(browser: Browser, service: Served) -> Iterator[Callable[..., Seen]]:
    """Opens an address of the service in a window of its own. At the end nothing may have been complained about."""
    contexts: list[BrowserContext] = []
    pages: list[Seen] = []

    def open_(path: str, url: str | None = None, **options: object) -> Seen:
        usual = {"viewport": {"width": 1200, "height": 800}, "reduced_motion": "reduce", "locale": "en-GB"}
        context = browser.new_context(base_url=url or service.url, **{**usual, **options})  # type: ignore[arg-type]
        context.set_default_timeout(WAIT)
        context.add_init_script(_WATCH)
        contexts.append(context)
        seen = Seen(context.new_page())
        pages.append(seen)
        seen.page.on("console", seen.hear)
        seen.page.on("pageerror", lambda error: seen.complaints.append(f"exception: {error}"))
        seen.page.goto(path)
        return seen

    yield open_
    try:
        for seen in pages:
            seen.check()
    finally:
        for context in contexts:
            context.close()


@pytest.fixture
def mesh_file(tmp_path: Path) -> Callable[..., Path]:
    """Writes a synthetic shape, or any bytes, as a file to upload."""

    def make(name: str, data: bytes | None = None, label: str = "humans", number: int = 9) -> Path:
        from reebase.mesh.write import to_bytes

        target = tmp_path / name
        if data is None:
            data = to_bytes(synthetic_shape(label, number, 0).mesh, target.suffix[1:])
        target.write_bytes(data)
        return target

    return make


@pytest.fixture(scope="module")
def fresh(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """A service that holds nothing yet."""
    with whole_service(tmp_path_factory.mktemp("fresh") / "home") as served:
        yield served


@pytest.fixture
def fresh_api(tmp_path: Path) -> Iterator[Served]:
    """An API without a worker: what is queued stays queued."""
    with whole_service(tmp_path / "home", "--workers", "0") as served:
        yield served
