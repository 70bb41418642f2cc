from html.parser import HTMLParser

import pytest

from pbrdf.reproduction.page.pieces import figure, page, paragraph, table, verdict

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


def read(text):
    parser = Balance()
    parser.feed(text)
    assert parser.open == []
    return parser


def test_text_is_escaped():
    assert paragraph("a < b & c") == "<p>a &lt; b &amp; c</p>"
    found = read(page("θ < 1", "simulated & shown", [paragraph("x > 0")]))
    assert "x > 0" in found.text


def test_a_page_says_its_banner_at_both_ends_and_fetches_nothing():
    found = read(page("title", "all simulated", ["<p>body</p>"]))
    assert found.text.count("all simulated") == 2
    assert found.fetched == []


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
    text = figure(tmp_path / "x.png", "what it shows", "caption", ["figures/x.png"])
    found = read(text)
    assert found.fetched[0] == "data:image/png;base64,iVBORw=="
    assert 'alt="what it shows"' in text
    assert found.fetched[1:] == ["figures/x.png"]


@pytest.mark.parametrize(("passed", "word"), [(True, "holds"), (False, "fails")])
def test_a_verdict_is_told_in_words_too(passed, word):
    assert word in read(verdict(passed)).text[0]
