import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from pbrdf.report.inline_svg import inline_svg
from pbrdf.report.style import BLUE, new_figure, styled


@pytest.fixture(scope="module")
def svg():
    with styled():
        figure = new_figure(4.0, 3.0)
        ax = figure.subplots()
        ax.plot([0.0, 1.0], [0.0, 1.0], color="black", marker="o", markerfacecolor="white")
        ax.plot([0.0, 1.0], [1.0, 0.0], color="#D55E00")
        ax.plot([0.0, 1.0], [0.5, 0.5], color=BLUE)
        ax.set_title("θ < 1")
    return inline_svg(figure, 'rises & "falls"', "first")


def test_it_is_well_formed_and_says_what_it_shows(svg):
    root = ET.fromstring(svg)
    assert root.attrib["role"] == "img"
    assert root.attrib["aria-label"] == root.find("title").text == 'rises & "falls"'
    assert "θ < 1" in "".join(root.itertext())


def test_it_fetches_nothing_and_its_names_are_its_own(svg):
    assert "http" not in svg and "<style" not in svg
    names = set(re.findall(r'id="([^"]+)"', svg))
    assert names and all(name.startswith("first-") for name in names)
    assert set(re.findall(r'(?:url\(|href=")#([^")]+)', svg)) <= names


def test_black_and_white_are_those_of_the_page_and_curves_keep_theirs(svg):
    assert not re.search("(fill|stroke): #(000000|ffffff)", svg)
    assert "currentColor" in svg and "var(--paper)" in svg
    assert "#d55e00" in svg
    assert "var(--curve-blue)" in svg and BLUE.lower() not in svg.lower()


def test_very_many_points_become_a_picture():
    with styled():
        figure = new_figure(4.0, 3.0)
        figure.subplots().plot(np.arange(5000.0), np.sin(np.arange(5000.0)), "o")
    text = inline_svg(figure, "many", "many")
    assert "data:image/png;base64," in text
    assert len(text) < 150_000
