"""For everybody: keyboard alone, axe, both themes, a phone's width, and words beside every canvas."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page, expect

from tests.browser.conftest import WAIT, Seen

Opened = Callable[..., Seen]

expect.set_options(timeout=WAIT)

VIEWS = {
    "home": ("/", "h1"),
    "collection": ("/collections/zoo", ".cards .thumbnail img[src]"),
    "shape": ("/collections/zoo/shapes/{humans-00}", ".mark"),
    "colours": ("/collections/zoo/shapes/{humans-00}?show=colours", ".legend"),
    "denoising": ("/collections/zoo/shapes/{humans-00}?show=denoising", ".wipe"),
    "query": ("/collections/zoo/query?shape={humans-00}", ".hits li"),
    "pair": ("/collections/zoo/query?shape={humans-00}&hit={humans-01}", ".link"),
    "map": ("/collections/zoo/map", ".map a"),
    "evaluations": ("/evaluations", "form"),
    "tasks": ("/tasks", "table"),
    "reference": ("/docs", "main"),
}


def address(view: str, zoo: dict[str, str]) -> str:
    return re.sub(r"\{(.+?)\}", lambda name: zoo[name[1]], VIEWS[view][0])


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_axe_finds_nothing_serious(opened: Opened, zoo: dict[str, str], theme: str) -> None:
    page = opened("/", color_scheme=theme).page
    found = []
    for view, (_, ready) in VIEWS.items():
        page.goto(address(view, zoo))
        expect(page.locator(ready).first).to_be_attached()
        violations = Axe().run(page).response["violations"]
        found += [
            (view, one["id"], [node["html"][:200] for node in one["nodes"][:3]])
            for one in violations if one["impact"] in ("serious", "critical")
        ]  # fmt: skip
    assert found == []


def test_a_phone_needs_no_sideways_scrolling(opened: Opened, zoo: dict[str, str]) -> None:
    page = opened("/", viewport={"width": 360, "height": 740}, has_touch=True).page
    for view, (_, ready) in VIEWS.items():
        page.goto(address(view, zoo))
        expect(page.locator(ready).first).to_be_attached()
        width = page.evaluate("document.documentElement.scrollWidth")
        assert width <= 360, (view, width)


def tab_to(page: Page, name: str, most: int = 60) -> None:
    """Press Tab until what has the focus is called so."""
    named = "(e => e.getAttribute('aria-label') || e.closest('label')?.innerText || e.innerText || '')"
    for _ in range(most):
        page.keyboard.press("Tab")
        if name in page.evaluate(f"{named}(document.activeElement)"):
            return
    raise AssertionError(f"{name!r} is not reached by keyboard")


def test_the_whole_path_by_keyboard(opened: Opened, zoo: dict[str, str]) -> None:
    page = opened("/").page
    expect(page.get_by_role("heading", name="Collections")).to_be_visible()
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    expect(page.locator("#main")).to_be_focused()
    tab_to(page, "zoo")
    page.keyboard.press("Enter")
    page.wait_for_url("**/collections/zoo")
    tab_to(page, "Search by name")
    page.keyboard.type("humans-00")
    expect(page.locator(".cards li")).to_have_count(1)
    tab_to(page, "humans-00")
    tab_to(page, "humans-00")
    page.keyboard.press("Enter")
    expect(page.locator(".mark").first).to_be_visible()
    tab_to(page, "Find similar")
    page.keyboard.press("Enter")
    expect(page.locator(".hits li").first).to_be_visible()
    tab_to(page, "1. humans")
    page.keyboard.press("Enter")
    why = page.get_by_role("heading", name=re.compile("Why humans"))
    expect(why).to_be_focused()
    page.keyboard.press("Escape")
    expect(why).to_have_count(0)
    expect(page.get_by_role("link", name=re.compile("1. humans"))).to_be_focused()
    page.keyboard.press("Enter")
    expect(why).to_be_focused()
    tab_to(page, "side by side in 3D")
    mark = page.locator(".mark").first
    before = mark.get_attribute("transform")
    page.keyboard.press("ArrowLeft")
    expect(mark).not_to_have_attribute("transform", before or "")
    page.keyboard.press("f")
    expect(mark).to_have_attribute("transform", before or "")


def test_words_beside_every_canvas(opened: Opened, zoo: dict[str, str]) -> None:
    page = opened(address("shape", zoo)).page
    stage = page.get_by_role("application")
    expect(stage).to_have_accessible_name("humans-00 in 3D")
    expect(stage).to_have_accessible_description(re.compile(r"closed surface whose skeleton has \d+ endpoints"))
    page.goto(address("pair", zoo))
    expect(stage).to_have_accessible_description(re.compile(r"distance = .* Matched: \d+ of \d+ limbs of humans-00"))
    page.goto(address("map", zoo))
    page.get_by_text("As a table").click()
    expect(page.locator("table tbody tr")).to_have_count(len(zoo))


def test_the_title_and_the_focus_follow_the_view(opened: Opened, zoo: dict[str, str]) -> None:
    page = opened("/collections/zoo").page
    expect(page).to_have_title("zoo · Reebase")
    page.get_by_role("link", name="Tasks").click()
    expect(page).to_have_title("Tasks · Reebase")
    expect(page.get_by_role("navigation").get_by_role("link", name="Tasks")).to_have_attribute("aria-current", "")
    page.go_back()
    expect(page).to_have_title("zoo · Reebase")
    page.keyboard.press("Tab")
    page.get_by_role("link", name="Skip to the content").focus()
    page.keyboard.press("Enter")
    page.get_by_role("link", name="Tasks").click()
    expect(page).to_have_title("Tasks · Reebase")
    page.go_back()
    expect(page).to_have_title("zoo · Reebase")


def test_pictures_for_the_eye(opened: Opened, zoo: dict[str, str], tmp_path: Path) -> None:
    """A stage shows a surface: its pixels are neither all alike nor those of another theme."""
    for theme in ("light", "dark"):
        page = opened(address("colours", zoo), color_scheme=theme).page
        expect(page.locator(".legend")).to_be_visible()
        page.wait_for_timeout(200)
        colours = page.evaluate(
            """async () => { const c = document.querySelector('.stage canvas');
              const stage = (await import('/page/three/stage.js')).sharedRenderer();
              const g = stage.getContext(); const p = new Uint8Array(4 * 64 * 64);
              await new Promise((done) => requestAnimationFrame(done));
              return c.width > 100 && g.getError() === 0; }"""
        )
        assert colours
