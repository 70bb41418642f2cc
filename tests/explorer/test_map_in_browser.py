"""A map in Chromium: colours of pixels, a click and the arrow keys choose the right one, its model and data appear."""

import base64
import re

import numpy as np
import pytest
from made_maps import STATES, UNDETERMINED, material_map, parameter_map, pixel_data

from pbrdf.explorer.catalogue import catalogue
from pbrdf.explorer.workspace import Workspace
from pbrdf.inversion.map_store import DatasetSource
from pbrdf.inversion.parameter_map.layout import PixelStatus

pytestmark = pytest.mark.slow

expect = pytest.importorskip("playwright.sync_api").expect
PATIENCE = 60_000
# Colours in the middle of pixels, and how many there are.
COLOURS = """
([rows, columns, places]) => {
  const canvas = document.querySelector(".map .pixels canvas"), context = canvas.getContext("2d");
  const { width, height } = canvas;
  const all = new Uint32Array(context.getImageData(0, 0, width, height).data.buffer);
  const middle = (n, of, size) => Math.floor((n + 0.5) * size / of);
  const at = ([row, column]) => {
    const [x, y] = [middle(column, columns, width), middle(row, rows, height)];
    return [...context.getImageData(x, y, 1, 1).data];
  };
  return { count: new Set(all).size, pixels: places.map(at) };
}
"""
STATE = """() => {
  const text = location.hash.slice('#state='.length).replaceAll('-', '+').replaceAll('_', '/');
  return JSON.parse(new TextDecoder().decode(Uint8Array.from(atob(text), c => c.charCodeAt(0))));
}"""


def opened(page, served, dataset, data=None):
    pictures = [] if data is None else [("data", DatasetSource(data))]
    page.goto(served(lambda: Workspace(maps=[("paint", dataset)], pictures=list(pictures))))
    page.wait_for_selector(".map .kinds li", timeout=PATIENCE)
    return page


def press(page, row, column, shape):
    picture = page.locator(".map .pixels")
    picture.scroll_into_view_if_needed()
    box = picture.bounding_box()
    x, y = ((n + 0.5) / size for n, size in ((column, shape[1]), (row, shape[0])))
    page.mouse.click(box["x"] + x * box["width"], box["y"] + y * box["height"])


def bytes_of(colour):
    return [int(colour[i : i + 2], 16) for i in (1, 3, 5)] + [255]


def test_colours_are_those_of_the_values(page, served):
    found = parameter_map((50, 70))
    opened(page, served, found)
    page.get_by_label("Shown", exact=True).select_option("estimate:n")
    expect(page.locator(".map .colour-legend")).to_contain_text("1.5n1.6")
    places = [(0, 0), (31, 5), (49, 69)]
    drawn = page.evaluate(
        COLOURS, [50, 70, [*places, UNDETERMINED, STATES[PixelStatus.FAILED], STATES[PixelStatus.MASKED]]]
    )
    table = np.frombuffer(base64.b64decode(catalogue()["colours"]["sequential"]), np.uint8).reshape(256, 4)
    values = found["estimate"].values[1]
    known = (found["status"].values == 0) & (found["flags"].values[1] == 0)
    low, high = np.percentile(values[known], (1.0, 99.0))
    for at, colour in zip(places, drawn["pixels"], strict=False):
        place = round(255 * np.clip((values[at] - low) / (high - low), 0.0, 1.0))
        assert np.abs(table[place].astype(int) - colour).max() <= 3, at
    assert drawn["pixels"][3:] == [bytes_of(c) for c in ("#CC79A7", "#D55E00", "#D9D9D9")]
    assert drawn["count"] > 100


def test_a_pixel_by_pointer_and_keyboard_with_its_model_and_data(page, served):
    found, data = parameter_map(), pixel_data()
    opened(page, served, found, data)
    press(page, 3, 2, (5, 7))
    where = page.locator(".map .where")
    expect(where).to_have_text("y 3 (rows from the top), x 2 (columns from the left)")
    expect(page.locator(".map tbody")).to_contain_text(f"{found['estimate'].values[1, 3, 2]:.4f}")
    picture = page.locator(".map .pixels")
    assert "5 rows (y, from the top) by 7 columns (x, from the left)" in picture.get_attribute("aria-label")
    picture.focus()
    page.keyboard.press("ArrowRight")
    expect(where).to_have_text(re.compile("^y 3 .*x 3 "))
    expect(page.get_by_text("Nobody has fitted it yet.")).to_be_visible()
    page.keyboard.press("ArrowUp")
    expect(where).to_have_text(re.compile("^y 2 .*x 3 "))
    # the keys are one step of undo, what follows another
    page.wait_for_timeout(1000)
    page.get_by_role("button", name="Show this pixel’s model and data").click()
    expect(page.locator(".layers li")).to_have_count(2)
    page.wait_for_timeout(600)
    state = page.evaluate(STATE)
    assert state["settings"]["map"]["pixel"] == [2, 3] and state["active"] == 1
    assert state["layers"][1]["parameters"]["n"] == found["estimate"].values[1, 2, 3]
    assert state["settings"]["data"] == {"set": "paint at y 2, x 3"}
    expect(page.locator("svg.cut .mark-used").first).to_be_visible(timeout=PATIENCE)
    expect(page.locator(".measured")).to_contain_text("paint at y 2, x 3")
    page.get_by_role("button", name=re.compile("^Undo")).click()
    expect(page.locator(".layers li")).to_have_count(1)
    page.get_by_role("button", name=re.compile("^Redo")).click()
    # the page loaded anew shows the same
    page.wait_for_timeout(600)
    page.reload()
    expect(where).to_have_text(re.compile("^y 2 .*x 3 "), timeout=PATIENCE)
    expect(page.locator("svg.cut .mark-used").first).to_be_visible(timeout=PATIENCE)


def test_zoom_and_materials(page, served):
    opened(page, served, material_map((40, 60)))
    expect(page.locator(".map .kinds")).to_contain_text("gloss black")
    drawn = page.evaluate(COLOURS, [40, 60, [(20, 1), (20, 30), (0, 0), (1, 1)]])
    assert drawn["pixels"][2:] == [bytes_of("#222222"), bytes_of("#DADADA")]
    assert drawn["pixels"][0] != drawn["pixels"][1]
    press(page, 20, 30, (40, 60))
    expect(page.get_by_text("matt white", exact=True)).to_be_visible()
    page.keyboard.press("+")
    expect(page.get_by_role("button", name="Whole map")).to_be_enabled()
    page.wait_for_timeout(800)
    assert page.evaluate(STATE)["settings"]["map"]["region"] == [10, 15, 20, 30]
    # the same place on the screen is another pixel now
    press(page, 0, 0, (20, 30))
    expect(page.locator(".map .where")).to_have_text(re.compile("^y 10 .*x 15 "))
    page.get_by_role("button", name="Whole map").click()
    expect(page.get_by_role("button", name="Whole map")).to_be_disabled()


def test_axe_finds_no_serious_fault_in_a_map(page, served):
    pytest.importorskip("axe_playwright_python")
    from axe_playwright_python.sync_playwright import Axe

    opened(page, served, parameter_map(), pixel_data())
    press(page, 3, 2, (5, 7))
    page.emulate_media(reduced_motion="reduce")
    expect(page.locator(".map tbody tr")).to_have_count(2)
    for _ in range(2):
        found = Axe().run(page).response["violations"]
        faults = [(f["id"], [n["target"] for n in f["nodes"]]) for f in found]
        assert [
            f for f, told in zip(faults, found, strict=True) if told["impact"] in ("serious", "critical")
        ] == []
        page.get_by_role("button", name="Theme").click()
        page.get_by_role("button", name="Theme").click()
