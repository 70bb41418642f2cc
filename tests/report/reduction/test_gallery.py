"""Which series are drawn, and what the files are called."""

import numpy as np
import pytest

from pbrdf.instruments.frames.frames import ArrayFrames
from pbrdf.instruments.reduction.stokes_image import StokesImage
from pbrdf.instruments.reduction.streaming import Block
from pbrdf.report.reduction import gallery
from pbrdf.report.reduction.gallery import Gallery, safe_name
from pbrdf.report.reduction.quicklook import overview_figure


def image(level, rows=6, columns=5):
    stokes = np.zeros((4, rows, columns))
    stokes[0] = level
    covariance = np.broadcast_to(np.eye(4)[:, :, None, None], (4, 4, rows, columns))
    return StokesImage(stokes, covariance, np.zeros((rows, columns), np.uint8))


def drawn(tmp_path, names):
    frames = ArrayFrames(np.zeros((len(names), 4, 6, 5), np.uint16), names)
    with Gallery(frames, tmp_path, "run", {}) as made:
        for series in range(len(names)):
            for first in (0, 3):
                block = Block(series, first, first + 3, image(100.0 + series, rows=3))
                made.add(block, made.prepare(block))
    assert sorted(made.files) == sorted(path.name for path in tmp_path.iterdir())
    return made.files


@pytest.mark.slow
def test_of_many_series_evenly_spread_ones_are_drawn(tmp_path, monkeypatch):
    monkeypatch.setattr(gallery, "_QUICKLOOKS", 2)
    monkeypatch.setattr(gallery, "_THUMBNAILS", 3)
    shown = []

    def noted(*arguments):
        shown.append(arguments)
        return overview_figure(*arguments)

    monkeypatch.setattr(gallery, "overview_figure", noted)
    files = drawn(tmp_path, ("a", "b", "c", "d", "e"))
    assert files == ["overview.png", "picture_a.png", "picture_e.png"]
    ((pictures, names, title),) = shown
    assert names == ["a", "c", "e"]
    assert title == "run (3 of 5 series)"
    assert [float(picture.intensity.mean()) for picture in pictures] == [100.0, 102.0, 104.0]


@pytest.mark.slow
def test_one_series_needs_no_overview(tmp_path):
    assert drawn(tmp_path, ("only one",)) == ["picture_only_one.png"]


@pytest.mark.slow
def test_names_that_a_file_cannot_have(tmp_path):
    assert drawn(tmp_path, ("a/b", "a:b")) == ["overview.png", "picture_a_b.png", "picture_a_b_2.png"]


@pytest.mark.slow
def test_an_error_leaves_no_pictures(tmp_path):
    frames = ArrayFrames(np.zeros((2, 4, 6, 5), np.uint16), ("a", "b"))
    (tmp_path / "other.png").touch()
    with pytest.raises(RuntimeError), Gallery(frames, tmp_path, "run", {}) as made:
        for series in range(2):
            block = Block(series, 0, 6, image(100.0))
            made.add(block, made.prepare(block))
        assert (tmp_path / "picture_a.png").exists()
        raise RuntimeError
    assert [path.name for path in tmp_path.iterdir()] == ["other.png"]


@pytest.mark.parametrize(
    ("name", "file"), [("white paint", "white_paint"), ("θ=30°", "θ_30"), ("../x", "x"), ("...", "unnamed")]
)
def test_safe_names(name, file):
    assert safe_name(name) == file
