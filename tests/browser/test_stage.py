"""The 3D view: what it draws, that it lets go of what it took, and that a large shape turns."""

from __future__ import annotations

import re
from collections.abc import Callable

import pytest
from playwright.sync_api import Page, expect

from tests.browser.conftest import WAIT, Seen

Opened = Callable[..., Seen]

expect.set_options(timeout=WAIT)

MEMORY = """async () => {
  const { sharedRenderer } = await import("/page/three/stage.js");
  const { geometries, textures } = sharedRenderer().info.memory;
  return { geometries, textures, canvases: document.querySelectorAll("canvas").length };
}"""

PIXELS = """async () => {
  const canvas = document.querySelector(".stage canvas");
  // Drawn anew and read in the same frame: a canvas is empty once it was shown.
  canvas.parentElement.dispatchEvent(new KeyboardEvent("keydown", { key: "f", cancelable: true }));
  await new Promise(requestAnimationFrame);
  const flat = document.createElement("canvas");
  [flat.width, flat.height] = [canvas.width, canvas.height];
  const context = flat.getContext("2d");
  context.drawImage(canvas, 0, 0);
  const data = context.getImageData(0, 0, flat.width, flat.height).data;
  const sums = [0, 0, 0];
  let covered = 0;
  for (let i = 0; i < data.length; i += 4) {
    if (data[i + 3] <= 20) continue;
    covered += 1;
    for (let c = 0; c < 3; c += 1) sums[c] += data[i + c];
  }
  return { covered: covered / (data.length / 4), mean: sums.map((sum) => sum / Math.max(1, covered)) };
}"""


def go(page: Page, path: str) -> None:
    """Move to another view as a link does, without loading the page anew."""
    page.evaluate("async (path) => { const { go } = await import('/page/parts/router.js'); await go(path); }", path)


def test_ten_shapes_in_a_row_leave_nothing_behind(opened: Opened, zoo: dict[str, str]) -> None:
    shapes = [f"/collections/zoo/shapes/{id_}" for id_ in list(zoo.values())[:10]]
    page = opened(shapes[0]).page
    expect(page.locator(".mark").first).to_be_visible()
    after_one = page.evaluate(MEMORY)
    for path in shapes[1:]:
        go(page, path)
        expect(page.locator(".mark").first).to_be_visible()
        page.locator("label", has_text="Before / after").click()
        page.locator("label", has_text="wireframe").click()
        page.locator("label", has_text="Skeleton").click()
    go(page, shapes[0])
    expect(page.locator(".mark").first).to_be_visible()
    assert page.evaluate(MEMORY) == after_one
    go(page, "/tasks")
    expect(page.get_by_role("heading", name="Tasks")).to_be_visible()
    assert page.evaluate(MEMORY)["geometries"] == 0
    assert page.locator("canvas").count() == 0


def test_what_is_shown(opened: Opened, zoo: dict[str, str]) -> None:
    page = opened(f"/collections/zoo/shapes/{zoo['humans-00']}").page
    expect(page.locator(".mark").first).to_be_visible()
    glass = page.evaluate(PIXELS)
    assert 0.03 < glass["covered"] < 0.7
    page.locator("label", has_text="Colours").click()
    expect(page.locator(".legend")).to_be_visible()
    assert "show=colours" in page.url
    coloured = page.evaluate(PIXELS)
    red, _, blue = coloured["mean"]
    page.get_by_label("Colour by").select_option("displacement")
    other = page.evaluate(PIXELS)
    assert other["covered"] == pytest.approx(coloured["covered"], abs=0.01)
    assert abs(other["mean"][0] - red) + abs(other["mean"][2] - blue) > 10
    page.locator("label", has_text="Before / after").click()
    slider = page.get_by_label(re.compile("Before on the left"))
    slider.fill("100")
    before = page.evaluate(PIXELS)
    slider.fill("0")
    after = page.evaluate(PIXELS)
    assert before["covered"] == pytest.approx(after["covered"], abs=0.02)
    assert sum(abs(a - b) for a, b in zip(before["mean"], after["mean"], strict=True)) > 10


def test_the_mouse_turns_both_shapes_of_a_pair(opened: Opened, zoo: dict[str, str]) -> None:
    page = opened(f"/collections/zoo/query?shape={zoo['humans-00']}&hit={zoo['humans-01']}").page
    expect(page.locator(".link").first).to_be_attached()
    places = "[...document.querySelectorAll('.mark')].map((m) => m.getAttribute('transform'))"
    page.wait_for_timeout(300)
    before = page.evaluate(places)
    box = page.locator(".stage canvas").bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] * 0.25, box["y"] + box["height"] * 0.3
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 90, y + 20, steps=4)
    page.mouse.up()
    page.wait_for_timeout(200)
    after = page.evaluate(places)
    assert all(a != b for a, b in zip(before, after, strict=True))


LARGE = """async () => {
  const { Stage, sharedRenderer } = await import("/page/three/stage.js");
  const { Surface } = await import("/page/three/surface.js");
  const [round, along] = [250, 400];
  const positions = new Float32Array(3 * round * along);
  const faces = new Uint32Array(6 * round * along);
  for (let i = 0; i < along; i += 1) for (let j = 0; j < round; j += 1) {
    const [u, v, at] = [2 * Math.PI * i / along, 2 * Math.PI * j / round, i * round + j];
    const [next, up] = [((i + 1) % along) * round + j, i * round + (j + 1) % round];
    const over = ((i + 1) % along) * round + (j + 1) % round;
    positions.set([(3 + Math.cos(v)) * Math.cos(u), (3 + Math.cos(v)) * Math.sin(u), Math.sin(v)], 3 * at);
    faces.set([at, next, over, at, over, up], 6 * at);
  }
  const stage = new Stage({ label: "large", describedBy: "main", signal: new AbortController().signal });
  document.getElementById("main").replaceChildren(stage.host);
  const surface = stage.add(new Surface({ positions, faces, offset: [0, 0, 0] }));
  surface.colour(Float32Array.from({ length: round * along }, (_, i) => positions[3 * i]));
  stage.fit();
  const frames = [];
  let last = performance.now();
  for (let i = 0; i < 30; i += 1) {
    stage.turn(0.12, 0);
    await new Promise(requestAnimationFrame);
    const now = performance.now();
    frames.push(now - last);
    last = now;
  }
  const turning = sharedRenderer().info.render.triangles;
  await new Promise((resolve) => setTimeout(resolve, 2000));
  const atRest = sharedRenderer().info.render.triangles;
  stage.close();
  return [turning, atRest, frames.slice(5).sort((a, b) => a - b)[12]];
}"""


def test_a_shape_of_a_hundred_thousand_vertices_turns(opened: Opened) -> None:
    """In software, on whatever cores are left: a graphics card has many times this. The bound is for a defect."""
    page = opened("/tasks").page
    turning, at_rest, milliseconds = page.evaluate(LARGE)
    assert at_rest == 200_000
    # Where frames are slow, as they are in software, it turns with few faces.
    assert milliseconds < 45 or turning < 60_000
    print(f"100,000 vertices: a frame takes {milliseconds:.0f} ms (median) with {turning:,} faces")  # noqa: T201 - a figure to see with -s
    assert milliseconds < 1000


def test_without_webgl_the_numbers_are_there(opened: Opened, zoo: dict[str, str]) -> None:
    seen = opened("/tasks")
    page = seen.page
    page.add_init_script("HTMLCanvasElement.prototype.getContext = () => null;")
    page.goto(f"/collections/zoo/shapes/{zoo['humans-00']}")
    expect(page.get_by_text("This browser has no WebGL")).to_be_visible()
    expect(page.locator("#endpoints tbody tr").first).to_be_visible()
    page.goto(f"/collections/zoo/query?shape={zoo['humans-00']}&hit={zoo['humans-01']}")
    expect(page.get_by_text("This browser has no WebGL")).to_be_visible()
    expect(page.locator("#pairs tbody tr").first).to_be_visible()
    seen.forget("WebGL")
