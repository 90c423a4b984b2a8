"""What goes wrong is said in words, with what to do; and a key is asked for once."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import expect

from store import keys, migrate
from tests.browser.conftest import WAIT, Seen
from tests.browser.test_journey import pick
from tests.http.serving import Served, whole_service

Opened = Callable[..., Seen]
Files = Callable[..., Path]

expect.set_options(timeout=WAIT)


def test_files_that_are_no_meshes(opened: Opened, service: Served, zoo: dict[str, str], mesh_file: Files) -> None:
    httpx.post(f"{service.url}/v1/collections", json={"name": "broken"}).raise_for_status()
    seen = opened("/collections/broken")
    page = seen.page
    cut = mesh_file("whole.ply").read_bytes()[:2000]
    pick(page, "Add meshes", mesh_file("notes.txt", b"hello"), mesh_file("cut.ply", cut))
    lines = page.locator("#uploads li")
    expect(lines.filter(has_text="notes.txt").locator(".bad")).to_contain_text("Save it as PLY, OBJ")
    expect(lines.filter(has_text="cut.ply").locator(".bad")).to_contain_text("Export or download it again.")
    expect(page.locator("#uploads-title")).to_have_text("No shape is ready")
    seen.forget("415")
    page.locator(".cards li").first.get_by_role("link").click()
    expect(page.get_by_role("heading", name="This mesh could not be described")).to_be_visible()
    expect(page.get_by_role("button", name="Try again")).to_be_visible()


def test_a_query_with_a_file_that_is_no_mesh(opened: Opened, zoo: dict[str, str], mesh_file: Files) -> None:
    page = opened("/collections/zoo").page
    pick(page, "Find similar to a file", mesh_file("cut.ply", mesh_file("whole.ply").read_bytes()[:2000]))
    expect(page.get_by_role("heading", name="This mesh could not be compared")).to_be_visible()
    expect(page.get_by_text("Export or download it again.")).to_be_visible()


@pytest.mark.parametrize(
    ("path", "said", "status", "way", "there"),
    [
        ("/collections/absent", "There is no collection", "404", "To the shapes", "Which shapes are like this one"),
        ("/collections/zoo/shapes/0199b4c0-7d5e-7000-8000-2f6f3a9f0001", "There is no shape", "404", "To zoo", "zoo"),
        (
            "/evaluations/0199b4c0-7d5e-7000-8000-2f6f3a9f0001", "There is no evaluation", "404", "To the evaluations",
            "Evaluations",
        ),
        ("/collections/zoo/nothing", "There is nothing at this address", None, "To the shapes", "Which shapes"),
        ("/nope", "There is nothing at this address", "404", "To the shapes", "Which shapes"),
        ("/tasks/xyz", "There is nothing at this address", "404", "To the shapes", "Which shapes"),
    ],
)  # fmt: skip
def test_addresses_that_lead_nowhere(
    opened: Opened, zoo: dict[str, str], path: str, said: str, status: str | None, way: str, there: str
) -> None:
    seen = opened(path)
    expect(seen.page.locator("#main")).to_contain_text(said)
    if status:
        seen.forget(status)
    seen.page.get_by_role("link", name=way).click()
    expect(seen.page.get_by_role("heading", level=1)).to_contain_text(there)


def test_no_hit_says_what_to_change(opened: Opened, service: Served, zoo: dict[str, str]) -> None:
    page = opened(f"/collections/zoo/query?shape={zoo['spiders-00']}&label=hands&tolerance=0").page
    page.get_by_role("button", name="Allow any number").click()
    expect(page.locator(".hits li").first).to_contain_text("hands")


def test_no_shape_of_a_label_offers_any_label(opened: Opened, zoo: dict[str, str]) -> None:
    page = opened(f"/collections/zoo/query?shape={zoo['spiders-00']}&label=zebras").page
    expect(page.get_by_role("heading", name="No shape to compare with has the label zebras")).to_be_visible()
    page.get_by_role("button", name="Any label").click()
    expect(page.locator(".hits li").first).to_contain_text("spiders")


def test_an_address_whose_hit_is_not_among_the_hits_says_so(opened: Opened, zoo: dict[str, str]) -> None:
    page = opened(f"/collections/zoo/query?shape={zoo['spiders-00']}&label=spiders&hit={zoo['hands-00']}").page
    expect(page.locator(".hits li").first).to_contain_text("spiders")
    expect(page.locator(".results")).to_contain_text("The hit of this address is not among these.")


def test_an_undo_that_is_refused_says_why(fresh_api: Served, opened: Opened, mesh_file: Files) -> None:
    """The same bytes came again after the deletion: two shapes cannot have them."""
    base = f"{fresh_api.url}/v1/collections"
    httpx.post(base, json={"name": "twice"}).raise_for_status()
    data = mesh_file("a.ply").read_bytes()
    shape = httpx.post(f"{base}/twice/shapes", content=data).raise_for_status().json()["shape"]["id"]
    seen = opened(f"/collections/twice/shapes/{shape}", url=fresh_api.url)
    seen.page.get_by_role("button", name="Delete").click()
    expect(seen.page.get_by_role("button", name="Undo")).to_be_visible()
    httpx.post(f"{base}/twice/shapes", content=data).raise_for_status()
    seen.page.get_by_role("button", name="Undo").click()
    expect(seen.page.get_by_role("alert")).to_contain_text("uploaded again after the deletion")
    seen.forget("409")


def test_a_key_that_may_read_only_sees_words_in_place_of_a_map(opened: Opened, guarded: tuple[Served, str]) -> None:
    served, admin = guarded
    mine = {"Authorization": f"Bearer {admin}"}
    httpx.post(f"{served.url}/v1/collections", json={"name": "read"}, headers=mine).raise_for_status()
    database = served.database()
    with database.write() as conn:
        _, secret = keys.create(conn, "read", None)
    database.close()
    seen = opened("/collections/read/map", url=served.url)
    seen.page.get_by_role("textbox", name="API key").fill(secret)
    seen.page.get_by_role("button", name="Use this key").click()
    expect(seen.page.get_by_role("status").filter(has_text="No map was drawn yet")).to_contain_text("may read only")
    expect(seen.page.get_by_role("alert")).to_have_count(0)
    seen.forget("401")
    seen.forget("403")


def test_the_service_is_gone(opened: Opened, tmp_path: Path) -> None:
    with whole_service(tmp_path / "home", "--workers", "0") as served:
        seen = opened("/tasks", url=served.url)
        expect(seen.page.get_by_role("heading", name="No tasks")).to_be_visible()
        assert served.process is not None
        served.process.terminate()
        served.process.wait(30)
        seen.page.get_by_role("link", name="Evaluations").click()
        expect(seen.page.locator("#main")).to_contain_text("The service does not answer.")
        expect(seen.page.get_by_role("button", name="Try again")).to_be_visible()
    seen.forget("ERR_CONNECTION_REFUSED")


@pytest.fixture(scope="module")
def guarded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Served, str]]:
    """A service that wants keys, and a key."""
    home = tmp_path_factory.mktemp("guarded")
    migrate.upgrade(f"sqlite:///{home / 'reebase.sqlite'}")
    database = Served("", home).database()
    with database.write() as conn:
        _, secret = keys.create(conn, "admin", None)
    database.close()
    with whole_service(home, REEBASE_REQUIRE_KEYS="true") as served:
        yield served, secret


def test_a_key_is_asked_for_once_and_kept_for_the_session(
    opened: Opened, guarded: tuple[Served, str], mesh_file: Files
) -> None:
    served, secret = guarded
    seen = opened("/", url=served.url)
    page = seen.page
    dialog = page.get_by_role("dialog")
    expect(dialog).to_contain_text("API key")
    dialog.get_by_label("API key").fill("rb_wrong")
    dialog.get_by_role("button", name="Use this key").click()
    expect(dialog.get_by_label("API key")).to_have_value("")
    dialog.get_by_label("API key").fill(secret)
    dialog.get_by_role("button", name="Use this key").click()
    expect(page.get_by_role("heading", level=1)).to_contain_text("Which shapes")
    expect(dialog).to_have_count(0)
    pick(page, "Add meshes", mesh_file("a.ply"))
    expect(page.locator("#uploads li")).to_contain_text("ready")
    # Pictures and downloads need it too, and an <img> or a link sends none.
    expect(page.locator(".cards .thumbnail img[src]")).to_have_count(1)
    page.locator("#uploads").get_by_role("link", name="Look at a.ply").click()
    with page.expect_download() as download:
        page.get_by_role("button", name="Original").click()
    assert download.value.path().read_bytes() == mesh_file("a.ply").read_bytes()
    page.reload()
    expect(page.get_by_role("heading", level=1)).to_contain_text("a.ply")
    assert page.evaluate("[localStorage.length, document.cookie]") == [0, ""]
    assert secret not in page.url and secret not in page.content()
    seen.forget("401")
