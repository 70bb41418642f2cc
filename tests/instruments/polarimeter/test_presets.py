"""The built-in instruments."""

from __future__ import annotations

import numpy as np
import pytest

from pbrdf.errors import DataError
from pbrdf.instruments.polarimeter.merit import merit
from pbrdf.instruments.polarimeter.presets import PRESETS, preset


def test_the_papers_imager():
    """Full Stokes, 1 % linear, 5 % circular, source stable to 0.001; retardances as good as there are."""
    found = preset("paper")
    assert found.polarimeter.accuracy == (0.01, 0.05)
    assert found.stability == 0.001
    assert merit(found.polarimeter).equally_weighted_variance == pytest.approx(10)


def test_the_conservative_imager_differs_in_accuracy_only():
    """1.7 % and 8.8 %: the abstract of the paper's own reference."""
    paper, other = preset("paper"), preset("conservative")
    assert other.polarimeter.accuracy == (0.017, 0.088)
    np.testing.assert_array_equal(other.polarimeter.analyzer, paper.polarimeter.analyzer)
    assert other.detector == paper.detector and other.stability == paper.stability


def test_the_mosaic_camera():
    """Cell [[90°, 45°], [135°, 0°]]; it does not see V."""
    found = preset("sony_imx250mzr").polarimeter
    np.testing.assert_array_equal(np.array(found.states)[found.mosaic], [["90", "45"], ["135", "0"]])
    assert merit(found).determined == ("I", "Q", "U")


def test_unknown_names():
    with pytest.raises(DataError, match="paper, conservative, sony_imx250mzr"):
        preset("papr")
    assert set(PRESETS) == {
        "paper", "conservative", "sony_imx250mzr", "sony_imx250myr", "sony_imx264myr"
    }  # fmt: skip
