"""Files that fall on the page in Chromium: data, models, tables that leave something unsaid, and hostile ones."""

import base64
import json
from importlib import resources

import pytest

from pbrdf.explorer.workspace import Workspace

pytestmark = pytest.mark.slow

TABLE = (resources.files("pbrdf.data") / "experiment" / "white.csv").read_text(encoding="utf-8")
SETTINGS = {"page": {"views": ["hemisphere"]}, "cuts": {"along": "phi"}}
DROP = """([name, text, bytes]) => {
  const files = new DataTransfer();
  files.items.add(new File([text ?? new Uint8Array(bytes)], name));
  document.querySelector('.body').dispatchEvent(new DragEvent('drop', { dataTransfer: files, bubbles: true }));
}"""


def drop(page, name, text=None, size=0):
    page.evaluate(DROP, [name, text, size])


def said(page, text):
    page.locator(".notice", has_text=text).wait_for(timeout=60_000)


@pytest.fixture
def workspace(white):
    found = Workspace([("white", white)])
    state = {**found.state(), "quantities": ["v"], "settings": SETTINGS}
    found.state = lambda: state
    return found


def test_data_are_opened_while_a_slider_moves(served, page, workspace, white):
    page.goto(served(lambda: workspace))
    page.wait_for_selector(".card canvas")
    page.on("websocket", lambda socket: pytest.fail("another connection"))
    drop(page, "../../paint.csv", TABLE)
    said(page, "Opening ../../paint.csv")
    slider = page.locator("input[type=range][name=sigma]")
    before = page.locator("input.number").first.input_value()
    slider.press("ArrowRight")
    assert page.locator("input.number").first.input_value() != before
    said(page, "paint.csv is open.")
    ((name, dataset),) = workspace.datasets
    assert name == "paint.csv"
    # it is shown as if the program had been started with it
    page.wait_for_function("() => location.hash")
    page.evaluate("() => new Promise(done => setTimeout(done, 400))")
    code = page.url.partition("#state=")[2]
    state = json.loads(base64.urlsafe_b64decode(code + "=" * (-len(code) % 4)))
    begins = Workspace([("white", white)], [(name, dataset)]).state()
    assert state["light"] == begins["light"] and state["quantities"] == begins["quantities"]
    assert state["settings"] == {**SETTINGS, "cuts": {}, "data": {"set": name}}
    # a model is shown at once
    drop(page, "mine.json", json.dumps(workspace.models[0][1].to_dict()))
    said(page, "mine.json is open.")
    assert page.locator(".layers li").count() == 2


def test_what_a_table_leaves_unsaid_is_asked(served, page, workspace):
    page.goto(served(lambda: workspace))
    page.wait_for_selector(".card canvas")
    drop(page, "table.csv", "in,theta_r,phi,value\n10,20,0,0.3\n10,30,0,0.4\n")
    asked = page.locator("dialog.unsaid")
    asked.get_by_text("there is no column theta_i").wait_for(timeout=60_000)
    asked.get_by_label("columns").fill("theta_i=in, I=value")
    asked.get_by_label("what was measured").select_option("brdf")
    asked.get_by_role("button", name="Read it again").click()
    said(page, "table.csv is open.")
    ((name, dataset),) = workspace.datasets
    assert name == "table.csv" and dataset["I"].values.tolist() == [0.3, 0.4]


def test_hostile_files_are_refused_in_words(served, page, workspace):
    page.goto(served(lambda: workspace))
    page.wait_for_selector(".card canvas")
    drop(page, "zeros.nc", size=200_000_000)
    said(page, "zeros.nc: 200 MB are more than the page takes")
    drop(page, "..\\..\\zeros.csv", size=5000)
    said(page, "zeros.csv: line 1: a byte 0x00 is in no text")
    drop(page, "<img src=x onerror=alert(1)>.csv", "theta_i,theta_r,phi,I\n10,20,0,nan\n")
    asked = page.locator("dialog.unsaid")
    asked.get_by_text("it does not say what was measured").wait_for(timeout=60_000)
    assert asked.locator("img").count() == 0
    asked.get_by_role("button", name="Leave it").click()
    assert workspace.datasets == []
    # and the sliders move on
    page.locator("input[type=range][name=sigma]").press("ArrowRight")
    assert page.locator(".notice.gone").is_hidden()
