from dataclasses import dataclass
from html.parser import HTMLParser

import pytest

from pbrdf.report.page import (
    Section,
    bullets,
    command,
    embedded_picture,
    figure,
    holds,
    markup,
    paragraph,
    render_page,
    table,
    terms,
)

VOID = {"meta", "img", "br"}


class Balance(HTMLParser):
    """Fails on tags that are closed in the wrong order; collects what a page would fetch."""

    def __init__(self):
        super().__init__()
        self.open, self.fetched, self.text = [], [], []

    def handle_starttag(self, tag, attrs):
        self.fetched += [value for name, value in attrs if name in ("src", "href")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


@dataclass
class Verdict:
    level: str
    sentence: str
    reasons: tuple[str, ...] = ()


def read(text):
    parser = Balance()
    parser.feed(text)
    assert parser.open == []
    return parser


def test_text_is_escaped_once():
    assert paragraph("a < b & c") == "<p>a &lt; b &amp; c</p>"
    found = read(render_page("θ < 1", [Section("<b>", [paragraph("x > 0")])], lead="a & b"))
    for text in ("x > 0", "<b>", "θ < 1", "a & b"):
        assert text in found.text
    assert markup("<i>{}</i>", "<") == "<i>&lt;</i>"
    for piece in (
        bullets(["<u>"]),
        terms([("<u>", ["<u>"])]),
        command("<u>"),
        table("<u>", ["<u>"], [["<u>"]]),
    ):
        assert "<u>" not in piece and "&lt;u&gt;" in piece


def test_a_page_says_its_banner_at_both_ends_and_fetches_nothing():
    found = read(render_page("title", [Section("", [paragraph("body")])], banner="all simulated"))
    assert found.text.count("all simulated") == 2
    assert found.fetched == []


def test_links_lead_to_the_sections():
    text = render_page("title", [Section("How sure?"), Section("Where it fails")], navigation=True)
    assert read(text).fetched == ["#how-sure", "#where-it-fails"]
    assert '<section id="how-sure">' in text and '<section id="where-it-fails">' in text


@pytest.mark.parametrize(
    ("level", "tone"),
    [("describes", "good"), ("in part", "partly"), ("does not describe", "bad"), ("unheard-of", "")],
)
def test_a_verdict_stands_first_in_the_colour_of_its_level(level, tone):
    text = render_page("title", [Section("Body")], verdict=Verdict(level, "It is <so>.", ("because",)))
    assert f'class="verdict {tone}"' in text
    assert text.index("It is &lt;so&gt;.") < text.index("<li>because</li>") < text.index("Body")
    assert 'class="verdict' not in render_page("title", [Section("Body")])


def test_a_cell_spans_the_empty_ones_after_it():
    text = table("what", ["a", "b", "c"], [["1", "2", "3"], ["x", None, None]], numeric=[1])
    read(text)
    assert '<td colspan="3">x</td>' in text
    assert '<td class="n">2</td>' in text
    assert '<th scope="col" class="n">b</th>' in text


def test_rows_may_have_a_class():
    text = table("what", ["a"], [["1"], ["2"]], classes=["theirs", ""])
    assert '<tr class="theirs"><td>1</td></tr>\n<tr><td>2</td></tr>' in text


def test_a_picture_is_put_into_the_page(tmp_path):
    (tmp_path / "x.png").write_bytes(b"\x89PNG")
    image = embedded_picture(tmp_path / "x.png", "what it shows")
    text = figure(image, "caption", ["figures/x.png"])
    found = read(text)
    assert found.fetched[0] == "data:image/png;base64,iVBORw=="
    assert 'alt="what it shows"' in text
    assert found.fetched[1:] == ["figures/x.png"]


@pytest.mark.parametrize(("passed", "word"), [(True, "✓ holds"), (False, "✗ fails")])
def test_an_outcome_is_told_in_words_too(passed, word):
    assert read(holds(passed)).text == [word]
