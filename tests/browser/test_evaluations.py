"""Evaluations on the page: run, watched, understood, compared."""

from __future__ import annotations

import re
from collections.abc import Callable

import httpx
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page, expect

from tests.browser.conftest import CLASSES, PER_CLASS, WAIT, Seen
from tests.http.serving import Served

Opened = Callable[..., Seen]

expect.set_options(timeout=WAIT)


def run(page: Page, descriptor: str) -> str:
    """Start one of the collection by hand, and watch it to its end."""
    page.goto("/evaluations?collection=zoo")
    page.get_by_label("Compare by").select_option(descriptor)
    page.get_by_role("button", name="Evaluate").click()
    page.wait_for_url(re.compile(r"/evaluations/[0-9a-f-]{30,}"))
    expect(page.locator(".scores")).to_be_visible()
    return page.url


def test_run_watch_understand_and_compare(opened: Opened, service: Served, zoo: dict[str, str]) -> None:
    page = opened("/").page
    first = run(page, "srg")
    report = httpx.get(f"{service.url}/v1/evaluations/{first.rsplit('/', 1)[1]}").json()["report"]
    shown = page.locator(".scores > div", has_text="Nearest neighbour").locator("dd").first.inner_text()
    assert float(shown) == round(report["overall"]["nn"], 3)
    classes = page.get_by_role("table", name=re.compile("Scores of each class"))
    expect(classes.locator("tbody tr")).to_have_count(len(CLASSES))
    for name in ("Precision and recall", "Dissimilarities", "Confusion"):
        card = page.locator(".plot-card", has_text=name).first
        card.scroll_into_view_if_needed()
        expect(card.locator("img[src]")).to_have_count(1)
        assert card.locator("img").evaluate("(i) => i.decode().then(() => i.naturalWidth)") > 100
    worst = page.locator(".worst")
    worst.first.scroll_into_view_if_needed()
    expect(worst.first.locator("li")).to_have_count(1 + min(10, len(CLASSES) * PER_CLASS - 1))
    with page.expect_download() as download:
        page.get_by_role("button", name="Report, JSON").click()
    assert download.value.suggested_filename.endswith(".json")
    serious = [one["id"] for one in Axe().run(page).response["violations"] if one["impact"] in ("serious", "critical")]
    assert serious == []
    run(page, "fused")
    page.get_by_role("navigation").get_by_role("link", name="Evaluations").click()
    boxes = page.get_by_label(re.compile("^Compare zoo"))
    expect(boxes).to_have_count(2)
    for box in boxes.all():
        box.check()
    page.get_by_role("button", name="Compare").click()
    expect(page.locator("table tbody tr")).to_have_count(2)
    expect(page.locator(".plot img[src]")).to_have_count(1)
    with page.expect_download() as download:
        page.get_by_role("button", name="Save as a report").click()
    assert download.value.path().read_text().startswith("<!doctype html>")


def test_an_evaluation_that_fails_says_why(opened: Opened, service: Served, zoo: dict[str, str]) -> None:
    httpx.post(f"{service.url}/v1/collections", json={"name": "bare"})
    made = httpx.post(f"{service.url}/v1/evaluations", json={"collection": "bare"}).json()
    page = opened(f"/evaluations/{made['id']}").page
    expect(page.get_by_role("heading", name="This evaluation failed")).to_be_visible()
    expect(page.get_by_role("button", name="Try again")).to_be_visible()
