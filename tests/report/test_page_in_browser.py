"""The page of a fit in a browser: nothing goes wrong, nothing is fetched, everything can be read."""

from __future__ import annotations

import pytest

from browser import chromium
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
def browser():
    with chromium() as found:
        yield found


@pytest.fixture
def opened(browser):
    """A function that loads a page; gives it with what went wrong on it and what it asked for."""
    contexts = []

    def load(url, width=1280, dark=False):
        scheme = "dark" if dark else "light"
        contexts.append(
            browser.new_context(
                viewport={"width": width, "height": 900}, color_scheme=scheme, is_mobile=width < 600
            )
        )
        page = contexts[-1].new_page()
        said, asked = [], []
        page.on("console", lambda message: said.append(("console", message.text)))
        page.on("pageerror", lambda error: said.append(("error", str(error))))
        page.on("request", lambda request: asked.append(request.url))
        page.goto(url)
        return page, said, asked

    yield load
    for context in contexts:
        context.close()


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
def test_the_page_is_sound(opened, pages, tmp_path, name, width, dark):
    page, said, asked = opened(pages[name], width, dark)
    assert said == []
    assert asked[0] == pages[name] and all(url.startswith("data:") for url in asked[1:])

    texts = page.evaluate(IMAGES)
    assert len(texts) == 3 and all(len(text) > 20 for text in texts)
    assert page.evaluate("document.images.length + document.scripts.length") == 0

    assert page.evaluate("window.innerWidth") == width
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.evaluate(TOO_WIDE) == []
    background = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert background == ("rgb(21, 24, 28)" if dark else "rgb(255, 255, 255)")
    assert min(page.evaluate(CONTRAST)) > 4.5
    # the figures take part: their text has the page's colour
    ink = page.evaluate("getComputedStyle(document.body).color")
    assert page.evaluate("getComputedStyle(document.querySelector('svg text')).fill") == ink
    page.screenshot(path=tmp_path / "page.png", full_page=True)
    assert (tmp_path / "page.png").stat().st_size > 50_000


@pytest.mark.slow
def test_an_error_would_be_noticed(opened, tmp_path):
    """The listener hears: a page with a broken script and a missing picture makes both kinds of entry."""
    (tmp_path / "bad.html").write_text("<script>console.error('x'); nothing()</script><img src='absent.png'>")
    page, said, asked = opened((tmp_path / "bad.html").as_uri())
    assert ("console", "x") in said
    assert any(kind == "error" and "nothing" in text for kind, text in said)
    assert any("Failed to load" in text for _, text in said) and len(asked) == 2
    assert page.evaluate(IMAGES) == [""]


@pytest.mark.slow
def test_on_paper_it_is_black_on_white(opened, pages):
    page, _, _ = opened(pages["plane"], dark=True)
    page.emulate_media(media="print")
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    assert page.evaluate("getComputedStyle(document.querySelector('svg text')).fill") == "rgb(0, 0, 0)"
    assert page.evaluate("getComputedStyle(document.querySelector('nav')).display") == "none"
