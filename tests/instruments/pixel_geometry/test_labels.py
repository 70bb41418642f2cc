"""Labels of pixels, by numbers or by names."""

import numpy as np
import pytest

from pbrdf.errors import DataError
from pbrdf.instruments.pixel_geometry.labels import label_map, label_names, read_labels
from pbrdf.instruments.reduction.regions import Rectangle


def test_a_picture_keeps_its_numbers(tmp_path):
    from PIL import Image

    values = np.zeros((6, 8), np.uint8)
    values[1:3, 2:5], values[4:, :] = 7, 2
    Image.fromarray(values).save(tmp_path / "labels.png")
    found = read_labels(tmp_path / "labels.png", 6, 8)
    assert (found.values == values).all() and found.dtype == np.int32
    assert label_names(found) == {2: "2", 7: "7"}
    with pytest.raises(DataError, match=r"labels\.png: .*"):
        read_labels(tmp_path / "labels.png", 6, 9)


def test_names_of_a_file_are_kept(tmp_path):
    (tmp_path / "regions.toml").write_text(
        "[red paint]\nrectangle = [0, 2, 0, 3]\n".replace("red paint", '"red paint"')
        + "[edge]\nrectangle = [4, 6, 1, 2]\n"
    )
    found = read_labels(tmp_path / "regions.toml", 4, 6)
    assert label_names(found) == {1: "red_paint", 2: "edge"}
    assert (found.values == 1).sum() == 6 and (found.values == 2).sum() == 2


def test_a_pixel_has_one_label():
    with pytest.raises(DataError, match="'b' overlaps another one"):
        label_map({"a": Rectangle(0, 3, 0, 3), "b": Rectangle(2, 4, 2, 4)}, 5, 5)
