"""The page in Chromium: sliders, undo, address, files, keyboard, themes, sizes, and what axe-core finds."""

import json

import pytest

from pbrdf.data.paints import open_experiment
from pbrdf.explorer.catalogue import layer_of, state_of
from pbrdf.explorer.session import VIEWS
from pbrdf.explorer.workspace import Workspace

pytestmark = pytest.mark.slow

STATE = """() => {
  const text = location.hash.slice('#state='.length).replaceAll('-', '+').replaceAll('_', '/');
  return JSON.parse(new TextDecoder().decode(Uint8Array.from(atob(text), c => c.charCodeAt(0))));
}"""
SLIDER = "input[type=range][name=sigma]"
#: Time after a change before the address follows, and more, ms.
SETTLED = 400


@pytest.fixture
def opened(served, page, white):
    """A function that opens the explorer with some models, and one view to be quick."""

    def start(*models):
        def workspace():
            found = Workspace([(name, white) for name in models])
            if models:
                state = {**found.state(), "settings": {"page": {"views": ["hemisphere"]}}}
                found.state = lambda: state
            return found

        page.goto(served(workspace))
        page.wait_for_selector(".card canvas" if models else ".paint")
        return page

    return start


def state_of_page(page):
    # by the page's clock: it may be busy drawing
    page.evaluate("ms => new Promise(done => setTimeout(done, ms))", SETTLED)
    return page.evaluate(STATE)


def sigma(page):
    return state_of_page(page)["layers"][0]["parameters"]["sigma"]


def boxes(page):
    """Where the cards, panels and controls stand."""
    return page.evaluate(
        "() => [...document.querySelectorAll('.card, .panel, .top, .slider-row, .layers li, .chip')]"
        ".map(e => { const b = e.getBoundingClientRect(); return [b.x, b.y, b.width, b.height]; })"
    )


def test_sliders_numbers_undo_and_address(opened):
    page = opened("thick")
    begun = page.locator(SLIDER).evaluate("e => Number(e.value)")
    before = boxes(page)
    box = page.locator(SLIDER).bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    for i in range(8):
        page.mouse.move(box["x"] + box["width"] * (0.5 + 0.04 * i), box["y"] + box["height"] / 2)
        assert boxes(page) == before
    page.mouse.up()
    moved = sigma(page)
    assert 0.05 < moved < 0.6
    number = page.get_by_label("σ, number")
    assert float(number.input_value()) == moved
    assert page.locator(SLIDER).get_attribute("aria-valuetext") == f"{moved:g}"
    # one step of undo for the whole drag
    page.keyboard.press("Control+z")
    assert sigma(page) == 0.0398
    assert page.locator(SLIDER).evaluate("e => Number(e.value)") == begun
    page.keyboard.press("Control+Shift+z")
    assert sigma(page) == moved
    # typed beyond the bounds of fits, within the domain; not outside of it
    number.fill("0,75")
    number.press("Enter")
    assert sigma(page) == 0.75
    assert "beyond the bounds" in page.locator(".beyond").first.inner_text()
    number.fill("7")
    number.press("Enter")
    assert "within 0.001 … 1" in page.locator(".slider-row .fault").first.inner_text()
    assert number.get_attribute("aria-invalid") == "true"
    assert sigma(page) == 0.75
    number.press("Escape")
    page.get_by_role("button", name="Reset σ").click()
    assert sigma(page) == 0.0398
    number.fill("0.1")
    number.press("Enter")
    # the address alone brings all of it back
    state = state_of_page(page)
    page.reload()
    page.wait_for_selector(".card canvas")
    assert state_of_page(page) == state
    assert page.get_by_label("σ, number").input_value() == "0.1"
    # somebody goes to an address that holds another state
    state["light"]["theta_i"] = 60.0
    page.evaluate("s => { location.hash = 'state=' + btoa(JSON.stringify(s)); }", state)
    page.wait_for_function(
        "() => document.querySelector('[name=theta_i]').getAttribute('aria-valuetext') === '60 °'"
    )
    assert state_of_page(page)["light"]["theta_i"] == 60.0
    page.evaluate("() => { location.hash = 'state=nonsense'; }")
    page.get_by_text("the address holds no state").wait_for()
    # one that cannot be shown leaves what the program was given
    page.evaluate("s => { location.hash = 'state=' + btoa(JSON.stringify({ ...s, version: 9 })); }", state)
    page.get_by_text("the address: this state is of another version").wait_for()
    page.reload()
    page.get_by_text("the address: this state is of another version").wait_for()
    page.wait_for_selector(".card canvas")
    assert page.get_by_label("σ, number").input_value() == "0.0398"


def test_models_light_and_quantities(opened):
    page = opened("thick", "other")
    side = page.get_by_role("complementary", name="Controls")
    page.get_by_role("button", name="Duplicate other").click()
    page.get_by_label("Difference to").select_option(label="thick")
    page.get_by_role("button", name="Hide other", exact=True).click()
    page.get_by_label("Another model").select_option(label="ggx-lambert")
    page.get_by_role("button", name="Add", exact=True).click()
    state = state_of_page(page)
    assert [layer["name"] for layer in state["layers"]] == ["thick", "other", "other 2", "ggx-lambert"]
    assert [layer["shown"] for layer in state["layers"]] == [True, False, True, True]
    assert (state["active"], state["compare"]) == (3, 0)
    page.get_by_role("button", name="Remove thick").click()
    state = state_of_page(page)
    assert (state["active"], state["compare"]) == (2, None)
    page.get_by_label("shadowing").select_option("none")
    side.get_by_label("linear", exact=True).check()
    angle = page.locator(".light").get_by_label("α, number")
    angle.fill("45")
    angle.press("Enter")
    page.get_by_label("P, number").fill("0.5")
    page.get_by_label("P, number").press("Enter")
    state = state_of_page(page)
    assert state["light"]["stokes"] == [1, 0, 0.5, 0]
    assert state["layers"][2]["options"]["shadowing"] == "none"
    side.get_by_label("circular", exact=True).check()
    side.get_by_label("right (V < 0)").check()
    assert state_of_page(page)["light"]["stokes"] == [1, 0, 0, -0.5]
    side.get_by_label("I Q U V").check()
    page.get_by_label("Q of the light").fill("2")
    page.get_by_label("Q of the light").press("Enter")
    # what only Dr.Jit's side knows to be wrong is said beside the numbers
    page.locator("[data-place='light.stokes'] .fault.said").wait_for()
    assert page.get_by_label("Q of the light").get_attribute("aria-invalid") == "true"
    page.keyboard.press("Escape")
    page.get_by_role("button", name="Undo").click()
    page.locator("[data-place='light.stokes'] .fault.said").wait_for(state="detached")
    page.get_by_role("button", name="Q over I").click()
    side.get_by_label("of the body", exact=True).check()
    state = state_of_page(page)
    assert state["quantities"] == ["intensity", "dolp", "q"]
    assert state["part"] == "diffuse"


def test_nothing_open_a_paint_and_a_state_file(opened, tmp_path, white):
    page = opened()
    page.get_by_role("button", name="pearl white").click()
    page.wait_for_selector(".card canvas")
    assert state_of_page(page)["layers"][0]["name"] == "pearl-white"
    with page.expect_download() as saved:
        page.get_by_role("button", name="Save the state").click()
    assert saved.value.suggested_filename == "pearl-white.explorer.json"
    assert json.loads(saved.value.path().read_text()) == state_of_page(page)
    state = state_of([layer_of("mine", white)])
    file = tmp_path / "sent.json"
    file.write_text(json.dumps(state))
    page.locator("input[type=file]").set_input_files(file)
    page.get_by_label("name of the model").and_(page.locator(":visible")).first.wait_for()
    page.wait_for_function("() => document.querySelector('.name').value === 'mine'")
    assert state_of_page(page) == state
    # a file that is dropped is opened as one that is chosen
    dropped = """text => {
      const data = new DataTransfer();
      data.items.add(new File([text], 'sent.json'));
      const stage = document.querySelector('.stage');
      for (const name of ['dragover', 'drop'])
        stage.dispatchEvent(new DragEvent(name, { dataTransfer: data, bubbles: true, cancelable: true }));
    }"""
    page.evaluate(dropped, json.dumps({**state, "version": 7}))
    page.get_by_text("sent.json: this state is of another version").wait_for()
    page.get_by_role("button", name="Undo").click()
    assert state_of_page(page)["layers"][0]["name"] == "pearl-white"


def test_exports(opened):
    page = opened("thick")
    page.get_by_label("What", exact=True).select_option("plane")
    assert page.get_by_label("As", exact=True).is_disabled()
    with page.expect_download() as saved:
        page.get_by_role("button", name="Save", exact=True).click()
    assert saved.value.suggested_filename == "thick-plane.csv"
    assert "# simulated: 1" in saved.value.path().read_text()
    command = page.locator(".command code").inner_text()
    assert command == "pbrdf simulate thick.json --theta-i 35 --plane --output thick-plane.csv"
    page.get_by_label("What", exact=True).select_option("curves")
    page.get_by_label("As", exact=True).select_option("svg")
    with page.expect_download() as saved:
        page.get_by_role("button", name="Save", exact=True).click()
    assert "<svg" in saved.value.path().read_text()[:400]


def test_a_lost_connection_is_said_and_found_again(served, page, white):
    sockets = []

    def between(socket):
        sockets.append((socket, socket.connect_to_server()))

    page.route_web_socket("**/socket*", between)
    page.goto(served(lambda: Workspace([("thick", white)])))
    page.wait_for_selector(".card canvas")
    page.get_by_label("σ, number").fill("0.2")
    page.get_by_label("σ, number").press("Enter")
    sockets[0][0].close()
    page.get_by_text("does not answer").wait_for()
    page.get_by_text("does not answer").wait_for(state="hidden")
    assert len(sockets) == 2
    # what stood on the page still stands, and pictures come again
    assert sigma(page) == 0.2
    page.get_by_label("σ", exact=True).press("ArrowRight")
    page.wait_for_function("() => !document.querySelector('.busy.on')")
    assert sigma(page) > 0.2


def test_what_is_asked_while_there_is_no_connection_is_not_waited_for(served, page, white):
    sockets, ended = [], False

    def between(socket):
        sockets.append(socket)
        if ended:
            socket.close()
        else:
            socket.connect_to_server()

    page.route_web_socket("**/socket*", between)
    page.goto(served(lambda: Workspace([("thick", white)])))
    page.wait_for_selector(".card canvas")
    page.wait_for_function("() => !document.querySelector('.busy.on')")
    ended = True
    sockets[0].close()
    page.get_by_text("does not answer").wait_for()
    page.locator("input[type=file]").set_input_files(
        {"name": "mine.csv", "mimeType": "text/csv", "buffer": b"theta_i\n1\n"}
    )
    page.get_by_text("mine.csv: not opened").wait_for()
    page.evaluate("() => [...document.querySelectorAll('.panel')].forEach(panel => { panel.open = true; })")
    page.get_by_role("button", name="Save", exact=True).click()
    page.get_by_label("σ, number").fill("0.2")
    page.get_by_label("σ, number").press("Enter")
    ended = False
    page.get_by_text("does not answer").wait_for(state="hidden")
    page.wait_for_function("() => !document.querySelector('.busy.on')")
    assert page.get_by_role("button", name="Save", exact=True).is_enabled()


def test_a_page_too_many_says_so(page, served, white, monkeypatch):
    monkeypatch.setattr("pbrdf.explorer.server._MOST_PAGES", 0)
    page.goto(served(lambda: Workspace([("thick", white)])))
    page.get_by_text("0 pages are open, close some").wait_for()


def test_nothing_is_left_when_the_explorer_goes(opened):
    """In a notebook a cell is run again: the element is empty then, and no listener of the document remains."""
    page = opened("thick")
    left = page.evaluate(
        """async () => {
          const { default: explorer } = await import('/explorer.js');
          const listeners = new Map();
          const model = {
            get: () => undefined, send: () => {},
            on: (name, f) => listeners.set(f, name), off: (name, f) => listeners.delete(f),
          };
          const el = document.createElement('div');
          document.body.append(el);
          const added = [];
          for (const target of [document, window]) {
            const add = target.addEventListener;
            target.addEventListener = (...given) => { added.push(given[0]); add.apply(target, given); };
          }
          const ids = [...document.querySelectorAll('[id]')].map(e => e.id);
          explorer.render({ model, el })();
          return [added, listeners.size, el.childElementCount, new Set(ids).size === ids.length];
        }"""
    )
    assert left == [[], 0, 0, True]


def test_keyboard_alone(opened):
    page = opened("thick")
    seen = []
    for _ in range(60):
        page.keyboard.press("Tab")
        seen.append(
            page.evaluate(
                "() => { const e = document.activeElement; "
                "return e.getAttribute('aria-label') ?? e.labels?.[0]?.innerText ?? e.innerText; }"
            )
        )
        outline = page.evaluate(
            "() => { const e = document.activeElement; const of = e => parseFloat(getComputedStyle(e).outlineWidth); "
            "return e === document.body ? 1 : Math.max(of(e), e.nextElementSibling ? of(e.nextElementSibling) : 0); }"
        )
        assert outline > 0, seen[-1]
    order = [
        "Open a file",
        "Theme: as the system",
        "Models",
        "name of the model",
        "Parameters",
        "σ, number",
        "σ",
        "n, number",
    ]
    places = [seen.index(name) for name in order]
    assert places == sorted(places)
    page.get_by_label("σ", exact=True).focus()
    before = sigma(page)
    page.keyboard.press("ArrowRight")
    assert sigma(page) > before
    page.get_by_role("button", name="Help and keyboard").focus()
    page.keyboard.press("Enter")
    assert page.get_by_role("dialog").is_visible()
    page.keyboard.press("Escape")
    assert not page.get_by_role("dialog").is_visible()


def faults_found(page):
    from axe_playwright_python.sync_playwright import Axe

    found = Axe().run(page).response["violations"]
    return [
        (fault["id"], node["target"], node.get("failureSummary"))
        for fault in found
        if fault["impact"] in ("serious", "critical")
        for node in fault["nodes"]
    ]


@pytest.mark.parametrize("what", ["empty", "full"])
def test_axe_finds_no_serious_fault(served, page, white, what):
    pytest.importorskip("axe_playwright_python")
    models, data = [], []
    if what == "full":
        models, data = [("thick", white), ("other", white)], [("paint", open_experiment("matte-white-thick"))]
    page.goto(served(lambda: Workspace(list(models), list(data))))
    page.wait_for_selector(".card canvas" if models else ".paint")
    for name in VIEWS if models else ():
        button = page.locator(".views").get_by_role("button").nth(list(VIEWS).index(name))
        if button.get_attribute("aria-pressed") == "false":
            button.click()
    page.wait_for_function("() => !document.querySelector('.busy.on')")
    page.evaluate("for (const e of document.querySelectorAll('details')) e.open = true")
    # axe looks at colours as they are, not at what they turn into
    page.emulate_media(reduced_motion="reduce")
    shown = "document.querySelector('.pbrdf-explorer')"
    papers = set()
    for theme, (width, height) in (("light", (1280, 800)), ("dark", (1280, 800)), ("dark", (390, 844))):
        page.set_viewport_size({"width": width, "height": height})
        while page.evaluate(f"{shown}.dataset.theme") != theme:
            page.get_by_role("button", name="Theme").click()
        papers.add(page.evaluate(f"getComputedStyle({shown}).backgroundColor"))
        assert faults_found(page) == [], (theme, width)
    assert len(papers) == 2


def test_an_enlarged_view_is_wider_and_in_sight(served, page, white):
    page.set_viewport_size({"width": 1700, "height": 900})
    page.goto(served(lambda: Workspace([("thick", white)])))
    page.wait_for_selector(".card canvas")
    stage = page.locator(".stage").bounding_box()
    for view in ("Hemisphere", "Curves", "Lit ball"):
        button = page.get_by_role("button", name=f"Enlarge {view}")
        button.click()
        card = page.get_by_role("article", name=view).bounding_box()
        assert card["width"] > 0.9 * stage["width"]
        assert -1.0 <= card["y"] < 900
        button.click()


def test_from_a_phone_to_a_wall(opened):
    page = opened("thick")
    for width, height in ((360, 740), (768, 1024), (1280, 800), (3840, 2160)):
        page.set_viewport_size({"width": width, "height": height})
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        card = page.locator(".card").first.bounding_box()
        assert card["x"] >= 0 and card["x"] + card["width"] <= width
