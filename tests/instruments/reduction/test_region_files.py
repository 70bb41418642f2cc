"""Regions from words, TOML, CSV and pictures of labels."""

import numpy as np
import pytest
from PIL import Image

from pbrdf.errors import DataError
from pbrdf.instruments.reduction.region_files import read_regions, region_from_text
from pbrdf.instruments.reduction.regions import Ellipse, Polygon, Rectangle


def test_words():
    assert region_from_text("100:200,150:260") == Rectangle(100, 200, 150, 260)
    assert region_from_text("ellipse:320, 240, 40, 30") == Ellipse(320, 240, 40, 30)
    assert region_from_text("polygon:0,0,9,0,4.5,8") == Polygon(((0, 0), (9, 0), (4.5, 8)))


@pytest.mark.parametrize(
    "text",
    [
        "",
        "1:2",
        "1:2,3",
        "1:2,3:4,5:6",
        "a:b,c:d",
        "ellipse:1,2,3",
        "polygon:1,2,3",
        "circle:1,2,3",
        "1:nan,2:3",
    ],
)
def test_words_that_are_no_region(text):
    with pytest.raises(DataError, match="is no region: give x0:x1,y0:y1"):
        region_from_text(text)


def test_toml(tmp_path):
    labels = np.zeros((30, 40), np.uint8)
    labels[5:9, 10:20] = 3
    Image.fromarray(labels).save(tmp_path / "labels.png")
    (tmp_path / "roi.toml").write_text(
        "[paint]\nrectangle = [1, 2, 3, 4]\n['my disc']\nellipse = [10, 11, 3, 4.5]\n"
        "[edge]\npolygon = [[0, 0], [5, 0], [0, 5]]\n[coin]\nlabels = 'labels.png'\nvalue = 3\n"
    )
    regions = read_regions(tmp_path / "roi.toml")
    coin = regions.pop("coin")
    assert regions == {
        "paint": Rectangle(1, 2, 3, 4),
        "my disc": Ellipse(10, 11, 3, 4.5),
        "edge": Polygon(((0, 0), (5, 0), (0, 5))),
    }
    assert coin.mask(0, 30, 40).sum() == 40
    assert coin.box == (10, 20, 5, 9)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[a]\nrectangle = [1, 2, 3]", "region 'a': give rectangle"),
        ("[a]\nrectangle = [2, 1, 3, 4]", "region 'a': rectangle 2:1,3:4: give the smaller edge first"),
        ("[a]\ncircle = [1, 2, 3]", "region 'a': give rectangle"),
        ("[a]\nellipse = [5, nan, 1, 1]", "region 'a': give rectangle"),
        ("[a]\npolygon = [[0, 0], [5, 0], [0, inf]]", "region 'a': give rectangle"),
        ("a = 1", "region 'a': give rectangle"),
        ("[a]\nlabels = 'none.png'\nvalue = 1", "none.png: there is no such file"),
        ("[a", "not a TOML file"),
        ("", "there is no region in it"),
    ],
)
def test_toml_that_is_wrong(tmp_path, text, message):
    (tmp_path / "roi.toml").write_text(text)
    with pytest.raises(DataError) as caught:
        read_regions(tmp_path / "roi.toml")
    assert message in str(caught.value)
    assert "roi.toml" in str(caught.value)


def test_csv(tmp_path):
    (tmp_path / "roi.csv").write_text("# by hand\nname,x0,x1,y0,y1\nwhite,1,20,3,40\n black , 5,6,7,8\n")
    assert read_regions(tmp_path / "roi.csv") == {
        "white": Rectangle(1, 20, 3, 40),
        "black": Rectangle(5, 6, 7, 8),
    }


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name,x,y\na,1,2", "its columns are name, x, y; give name, x0, x1, y0, y1"),
        ("name,x0,x1,y0,y1\na,1,2,3", "line 2: 4 cells under 5 column names"),
        ("name,x0,x1,y0,y1\na,1,2,3,4\na,1,2,3,4", "line 3: 'a' stands there twice"),
        ("name,x0,x1,y0,y1\na,2,1,3,4", "line 2: rectangle 2:1,3:4"),
        ("name,x0,x1,y0,y1\na,1,2,3,nan", "line 2: give a name and four finite numbers"),
        ("name,x0,x1,y0,y1\na,1,2,3,x", "line 2, column 'y1': 'x' is not a number"),
        ("name,x0,x1,y0,y1\n,1,2,3,4", "line 2, column 'name': the cell is empty"),
        ("name,x0,x1,y0,y1\n", "there is no region in it"),
    ],
)
def test_csv_that_is_wrong(tmp_path, text, message):
    (tmp_path / "roi.csv").write_text(text)
    with pytest.raises(DataError) as caught:
        read_regions(tmp_path / "roi.csv")
    assert message in str(caught.value)


def test_a_picture_of_labels(tmp_path):
    labels = np.zeros((20, 30), np.uint16)
    labels[2:4, 5:9], labels[10:, 20:] = 1, 700
    np.save(tmp_path / "labels.npy", labels)
    regions = read_regions(tmp_path / "labels.npy")
    assert list(regions) == ["1", "700"]
    np.testing.assert_array_equal(regions["700"].mask(8, 12, 30), labels[8:12] == 700)
    np.save(tmp_path / "photograph.npy", np.arange(6000, dtype=np.uint16).reshape(60, 100))
    with pytest.raises(DataError, match="6000 different values"):
        read_regions(tmp_path / "photograph.npy")


def test_another_kind_of_file(tmp_path):
    with pytest.raises(DataError, match=r"regions are read from \.toml, \.csv and other tables"):
        read_regions(tmp_path / "roi.json")


@pytest.mark.parametrize(
    "text",
    [
        "rectangle = [true, 5, 1, 4]",
        "rectangle = [1" + "0" * 400 + ", 5, 1, 4]",
        'rectangle = ["1_0", 50, 1, 4]',
        'labels = "a.png"\nvalue = true',
    ],
)
def test_what_is_no_number_is_no_edge(tmp_path, text):
    (tmp_path / "roi.toml").write_text(f"[a]\n{text}\n", encoding="utf-8")
    with pytest.raises(DataError, match=r"roi\.toml: region 'a': give rectangle"):
        read_regions(tmp_path / "roi.toml")
    with pytest.raises(DataError, match="is no region"):
        region_from_text("1_0:20,1:4")
