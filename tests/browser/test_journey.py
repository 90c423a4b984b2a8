"""As a person would walk: from an empty service to an explained match, and on through the collection."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import Page, Route, expect

from reebase.client import Client, Upload
from tests.browser.conftest import CLASSES, PER_CLASS, WAIT, Seen
from tests.http.serving import Served

Opened = Callable[..., Seen]
Files = Callable[..., Path]

expect.set_options(timeout=WAIT)


def drop(page: Page, path: Path, target: str | None = None) -> None:
    """Drag a file over the window, and let it go where the page offers a place."""
    transfer = page.evaluate_handle(
        """([name, bytes]) => {
          const carried = new DataTransfer();
          carried.items.add(new File([new Uint8Array(bytes)], name));
          return carried;
        }""",
        [path.name, list(path.read_bytes())],
    )
    page.dispatch_event("body", "dragenter", {"dataTransfer": transfer})
    page.dispatch_event(target or ".target:not([data-ask])", "drop", {"dataTransfer": transfer})


def pick(page: Page, button: str, *paths: Path) -> None:
    with page.expect_file_chooser() as chooser:
        page.get_by_role("button", name=button).first.click()
    chooser.value.set_files([str(path) for path in paths])


def settled(client: Client, upload: Upload) -> None:
    assert upload.task is not None
    client.wait(upload.task)


def test_from_drop_to_an_explained_match(opened: Opened, zoo: dict[str, str], mesh_file: Files) -> None:
    seen = opened("/collections/zoo")
    page = seen.page
    expect(page.locator(".cards li")).to_have_count(len(CLASSES) * PER_CLASS)
    drop(page, mesh_file("stranger.ply", label="hands", number=7), "[data-ask]")
    page.wait_for_url(re.compile(r"/collections/zoo/query\?task="))
    expect(page.get_by_role("heading", level=1)).to_have_text("Like stranger.ply")
    hits = page.locator(".hits li")
    expect(hits.first).to_contain_text("hands")
    hits.first.get_by_role("link").click()
    expect(page.get_by_role("heading", name=re.compile("Why hands-"))).to_be_visible()
    expect(page.locator("#pair-summary")).to_contain_text("distance = ")
    rows = page.locator("#pairs tbody tr")
    expect(page.locator(".stage canvas")).to_be_visible()
    matched = rows.filter(has_not_text="alone").count()
    assert matched > 0
    expect(page.locator(".overlay .link")).to_have_count(matched)
    assert page.locator(".mark").count() == 2 * matched + rows.filter(has_text="alone").count()
    shares = [float(text.split()[0]) for text in page.locator("#pairs .share").all_inner_texts()]
    assert sum(shares) == pytest.approx(100, abs=3)
    # The address alone leads back to it: the service has kept the answer, not the mesh's row in the collection.
    page.reload()
    expect(page.locator("#pair-summary")).to_contain_text("distance = ")
    expect(page.locator(".stage canvas")).to_be_visible()
    page.go_back()
    expect(page).to_have_url(re.compile(r"query\?task=[^&]+&name=[^&]+$"))
    expect(page.locator("#compare")).to_be_hidden()


def test_from_an_empty_service_by_one_click(opened: Opened, fresh: Served) -> None:
    page = opened("/", url=fresh.url).page
    button = page.get_by_role("button", name="Try 50 sample shapes")
    expect(button).to_be_visible()
    assert "false" not in page.locator("#main").inner_text()
    button.click()
    page.wait_for_url("**/collections/synthetic")
    expect(page.locator(".cards .thumbnail img[src]").first).to_be_visible(timeout=2 * WAIT)
    page.goto(fresh.url)
    expect(page.get_by_role("link", name="synthetic")).to_be_visible()
    expect(button).to_be_visible()


def test_files_that_are_kept(opened: Opened, service: Served, zoo: dict[str, str], mesh_file: Files) -> None:
    httpx.post(f"{service.url}/v1/collections", json={"name": "mine"}).raise_for_status()
    page = opened("/collections/mine").page
    expect(page.get_by_role("heading", name="This collection is empty")).to_be_visible()
    pick(page, "Add meshes", mesh_file("one.ply"), mesh_file("two.stl", label="spiders"))
    lines = page.locator("#uploads li")
    expect(lines).to_have_count(2)
    for line in lines.all():
        expect(line).to_contain_text("ready")
    expect(page.locator(".cards li")).to_have_count(2)
    lines.first.get_by_role("link", name="Look at one.ply").click()
    expect(page.get_by_role("heading", level=1)).to_contain_text("one.ply")
    expect(page.locator("#summary")).to_contain_text("endpoints")
    page.get_by_text("Rename or label").click()
    page.get_by_label("Label", exact=True).fill("friends")
    page.get_by_role("button", name="Save").click()
    expect(page.locator("h1 .chip")).to_have_text("friends")
    with page.expect_download() as download:
        page.get_by_role("button", name="Original").click()
    assert download.value.suggested_filename == "one.ply"
    drop(page, mesh_file("one.ply"))
    expect(page.locator("#uploads")).to_contain_text("was there already")


def test_a_query_by_shape_and_its_terms(opened: Opened, zoo: dict[str, str]) -> None:
    page = opened(f"/collections/zoo/shapes/{zoo['humans-00']}").page
    page.get_by_role("link", name="Find similar").click()
    expect(page.locator(".hits li").first).to_contain_text("humans")
    page.get_by_label("Endpoints").select_option("any")
    page.wait_for_url("**tolerance=any**")
    expect(page.locator(".hits li")).to_have_count(len(CLASSES) * PER_CLASS - 1)
    page.get_by_label("Only the label").fill("spiders")
    page.get_by_label("Only the label").press("Enter")
    expect(page.locator(".hits li")).to_have_count(PER_CLASS)
    page.go_back()
    expect(page.get_by_role("heading", level=1)).to_contain_text("humans-00")


def test_browse_label_delete_and_undo(opened: Opened, service: Served, zoo: dict[str, str]) -> None:
    page = opened("/collections/zoo").page
    cards = page.locator(".cards li")
    page.get_by_label("Label", exact=True).select_option("hands")
    expect(cards).to_have_count(PER_CLASS)
    page.reload()
    expect(cards).to_have_count(PER_CLASS)
    page.get_by_label("Search by name").fill("hands-01")
    expect(cards).to_have_count(1)
    page.get_by_label("Select hands-01").check()
    bar = page.get_by_role("region", name="Selected shapes")
    bar.get_by_label("Label").fill("gloves")
    bar.get_by_role("button", name="Set").click()
    expect(page.get_by_text("1 shape labelled gloves.")).to_be_visible()
    page.goto("/collections/zoo?text=hands-01")
    expect(cards).to_contain_text("gloves")
    page.get_by_label("Select hands-01").check()
    bar.get_by_role("button", name="Delete").click()
    expect(page.get_by_role("heading", name="No shape passes these filters")).to_be_visible()
    page.get_by_role("button", name="Undo").click()
    expect(cards).to_have_count(1)
    shape = f"{service.url}/v1/collections/zoo/shapes/{zoo['hands-01']}"
    httpx.patch(shape, json={"label": "hands"}).raise_for_status()


def test_labels_of_many_are_taken_away_only_when_asked_and_come_back(
    opened: Opened, service: Served, zoo: dict[str, str]
) -> None:
    page = opened("/collections/zoo").page

    def labels() -> set[tuple[str, str | None]]:
        items = httpx.get(f"{service.url}/v1/collections/zoo/shapes").json()["items"]
        return {(item["name"], item["label"]) for item in items}

    before = labels()
    for name in ("hands-00", "spiders-00"):
        page.get_by_label(f"Select {name}").check()
    bar = page.get_by_role("region", name="Selected shapes")
    expect(bar.get_by_role("button", name="Set")).to_be_disabled()
    bar.get_by_label("Label").press("Enter")
    expect(bar).to_be_visible()
    assert labels() == before
    bar.get_by_role("button", name="Remove labels").click()
    expect(page.get_by_text("2 shapes without label now.")).to_be_visible()
    assert {label for name, label in labels() if name in ("hands-00", "spiders-00")} == {None}
    with page.expect_response(lambda reply: "/shapes?" in reply.url):
        page.get_by_role("button", name="Undo").click()
    assert labels() == before


def test_the_map(opened: Opened, zoo: dict[str, str]) -> None:
    page = opened("/collections/zoo/map").page
    dots = page.locator(".map a")
    expect(dots).to_have_count(len(CLASSES) * PER_CLASS)
    dots.first.focus()
    expect(page.locator(".map-card")).to_be_visible()
    page.keyboard.press("Enter")
    page.wait_for_url("**/shapes/**")


def test_every_label_of_a_map_has_a_mark_of_its_own(opened: Opened, zoo: dict[str, str]) -> None:
    def relabel(route: Route) -> None:
        found = route.fetch().json()
        for number, point in enumerate(found["points"]):
            point["label"] = None if number == 0 else f"label {number:02}"
        route.fulfill(json=found)

    page = opened("/").page
    page.route("**/v1/collections/zoo/map*", relabel)
    page.goto("/collections/zoo/map")
    expect(page.locator(".map a")).to_have_count(len(zoo))
    marks = "[...document.querySelectorAll(%r)].map((p) => p.getAttribute('d') + p.getAttribute('fill'))"
    assert len(set(page.evaluate(marks % ".map path"))) == len(zoo)
    assert set(page.evaluate(marks % ".map-key path")) == set(page.evaluate(marks % ".map path"))
    expect(page.locator(".legend-list li").last).to_have_text("no label")


def test_a_hit_that_re_ranking_does_not_reach_has_words(opened: Opened, zoo: dict[str, str]) -> None:
    def lose(route: Route) -> None:
        found = route.fetch().json()
        found["hits"][-1]["dissimilarity"] = 1001.5
        route.fulfill(json=found)

    page = opened("/").page
    page.route("**/v1/collections/zoo/query", lose)
    page.goto(f"/collections/zoo/query?shape={zoo['humans-00']}")
    last = page.locator(".hits li").last
    expect(last).to_contain_text("not connected")
    last.get_by_role("link").click()
    expect(page.locator("#compare")).to_contain_text("no chain of shapes that are alike leads here")


def test_a_map_that_is_outdated_is_drawn_anew_on_demand(
    opened: Opened, service: Served, zoo: dict[str, str], mesh_file: Files
) -> None:
    """Shapes that keep arriving outdate every map: one drawn unasked would follow the other."""
    with Client(service.url) as client:
        client.create_collection("grows")
        for number in range(3):
            settled(client, client.upload("grows", mesh_file("a.ply", number=number)))
        page = opened("/collections/grows/map").page
        dots = page.locator(".map a")
        expect(dots).to_have_count(3)
        settled(client, client.upload("grows", mesh_file("b.ply", number=3)))
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.method))
    page.reload()
    again = page.get_by_role("button", name="Draw anew")
    expect(again).to_be_visible()
    expect(dots).to_have_count(3)
    assert "POST" not in asked
    again.click()
    expect(dots).to_have_count(4)
    expect(again).to_have_count(0)
    httpx.delete(f"{service.url}/v1/collections/grows").raise_for_status()


def test_a_descriptor_on_demand_is_given_and_offered(opened: Opened, service: Served, mesh_file: Files) -> None:
    with Client(service.url) as client:
        client.create_collection("demand")
        shapes = [client.upload("demand", mesh_file("a.ply", number=number)) for number in range(2)]
        for one in shapes:
            settled(client, one)
    seen = opened(f"/collections/demand/query?shape={shapes[0].shape.id}&descriptor=gps")
    page = seen.page
    seen.forget("404")
    page.get_by_role("button", name="Describe such shapes again").click()
    expect(page.get_by_role("status").filter(has_text="2 shapes will be described again.")).to_be_visible()
    demand = f"{service.url}/v1/collections/demand"
    with Client(service.url) as client:
        for task in client.tasks(collection="demand"):
            client.wait(task)
    given = {one["name"]: one["shapes"] for one in httpx.get(f"{demand}/descriptors").json()["items"]}
    assert given["gps"] == 2
    page.goto(f"/collections/demand/query?shape={shapes[0].shape.id}")
    page.get_by_label("Compare by").select_option("gps")
    expect(page.locator(".hits li")).to_have_count(1)
    httpx.delete(demand).raise_for_status()


def test_tasks_are_cancelled_and_tried_again(fresh_api: Served, opened: Opened, mesh_file: Files) -> None:
    """Where no worker runs, a task waits for as long as a test needs."""
    base = f"{fresh_api.url}/v1"
    httpx.post(f"{base}/collections", json={"name": "waiting"}).raise_for_status()
    mesh = mesh_file("named.ply").read_bytes()
    httpx.post(f"{base}/collections/waiting/shapes", files={"file": ("named.ply", mesh)}).raise_for_status()
    page = opened("/tasks", url=fresh_api.url).page
    page.get_by_role("button", name="Cancel: Describe a shape").click()
    expect(page.locator("tbody tr")).to_contain_text("cancelled")
    page.get_by_role("button", name="Try again: Describe a shape").click()
    expect(page.locator("tbody tr")).to_contain_text("waiting")
    page.locator("tbody").get_by_role("link", name="named").click()
    page.wait_for_url("**/collections/waiting/shapes/**")
