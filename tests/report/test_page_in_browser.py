"""The page of a fit in a browser: nothing goes wrong, nothing is fetched, everything can be read."""

from __future__ import annotations

import pytest

from browser import Browser, chromium
from pbrdf.report.fit.folder import write_report

# Elements that are pictures, and the text that a screen reader has for each.
IMAGES = """[...document.querySelectorAll('img, svg, canvas, [role=img]')]
  .filter(e => !e.parentElement.closest('svg'))
  .map(e => e.tagName === 'IMG' ? e.alt : (e.getAttribute('aria-label') || ''))"""
CONTRAST = """(() => {
  const numbers = c => c.match(/[\\d.]+/g).slice(0, 3).map(Number);
  const luminance = c => { const [r, g, b] = numbers(c).map(v => { v /= 255;
    return v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4; }); return 0.2126*r + 0.7152*g + 0.0722*b; };
  const paper = luminance(getComputedStyle(document.body).backgroundColor);
  return [...document.querySelectorAll('p, li, td, th, dt, dd, a, caption, figcaption, h1, h2')].map(e => {
    const ink = luminance(getComputedStyle(e).color);
    return (Math.max(ink, paper) + 0.05) / (Math.min(ink, paper) + 0.05); }); })()"""
TOO_WIDE = """[...document.querySelectorAll('body *')].filter(e => !e.closest('.scroll, .picture, pre')
  && e.getBoundingClientRect().right > window.innerWidth + 1).map(e => e.outerHTML.slice(0, 120))"""


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    program = chromium()
    if program is None:
        pytest.skip("no Chromium or Chrome on this machine (apt-get install chromium)")
    with Browser(program, tmp_path_factory.mktemp("browser") / "profile") as found:
        yield found


@pytest.fixture(scope="module")
def pages(report, hemisphere_report, tmp_path_factory):
    """Pages of a fit of polarised light in the plane of incidence, and of intensities over the hemisphere."""
    folder = tmp_path_factory.mktemp("pages")
    for name, one in (("plane", report), ("hemisphere", hemisphere_report)):
        write_report(one, folder / name)
    return {name: (folder / name / "index.html").as_uri() for name in ("plane", "hemisphere")}


@pytest.mark.slow
@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("width", [390, 1280])
@pytest.mark.parametrize("name", ["plane", "hemisphere"])
def test_the_page_is_sound(browser, pages, tmp_path, name, width, dark):
    events = browser.open(pages[name], width, dark=dark)
    said = [e for e in events if e.get("method") in ("Runtime.consoleAPICalled", "Runtime.exceptionThrown")]
    said += [e for e in events if e.get("method") == "Log.entryAdded"]
    assert said == []
    asked = [e["params"]["request"]["url"] for e in events if e.get("method") == "Network.requestWillBeSent"]
    assert asked[0] == pages[name] and all(url.startswith("data:") for url in asked[1:])

    texts = browser.ask(IMAGES)
    assert len(texts) == 3 and all(len(text) > 20 for text in texts)
    assert browser.ask("document.images.length + document.scripts.length") == 0

    assert browser.ask("window.innerWidth") == width
    assert browser.ask("document.documentElement.scrollWidth") <= width
    assert browser.ask(TOO_WIDE) == []
    background = browser.ask("getComputedStyle(document.body).backgroundColor")
    assert background == ("rgb(21, 24, 28)" if dark else "rgb(255, 255, 255)")
    assert min(browser.ask(CONTRAST)) > 4.5
    # the figures take part: their text has the page's colour
    ink = browser.ask("getComputedStyle(document.body).color")
    assert browser.ask("getComputedStyle(document.querySelector('svg text')).fill") == ink
    browser.picture(tmp_path / "page.png")
    assert (tmp_path / "page.png").stat().st_size > 50_000


@pytest.mark.slow
def test_an_error_would_be_noticed(browser, tmp_path):
    """The listener hears: a page with a broken script and a missing picture makes both kinds of entry."""
    (tmp_path / "bad.html").write_text("<script>console.error('x'); nothing()</script><img src='absent.png'>")
    events = browser.open((tmp_path / "bad.html").as_uri(), 1280)
    methods = {e.get("method") for e in events}
    assert {"Runtime.consoleAPICalled", "Runtime.exceptionThrown"} <= methods
    assert browser.ask(IMAGES) == [""]


@pytest.mark.slow
def test_on_paper_it_is_black_on_white(browser, pages):
    browser.open(pages["plane"], 1280, dark=True)
    browser.call(
        "Emulation.setEmulatedMedia",
        media="print",
        features=[{"name": "prefers-color-scheme", "value": "dark"}],
    )
    assert browser.ask("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    assert browser.ask("getComputedStyle(document.querySelector('svg text')).fill") == "rgb(0, 0, 0)"
    assert browser.ask("getComputedStyle(document.querySelector('nav')).display") == "none"
    browser.call("Emulation.setEmulatedMedia", media="")
