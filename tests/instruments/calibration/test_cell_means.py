"""Means over cells of the field of view: over exactly the pixels of each cell, bad ones kept out and counted."""

from __future__ import annotations

import numpy as np
import pytest

from pbrdf.errors import DataError
from pbrdf.instruments.calibration.analyzer_calibration import standard_inputs
from pbrdf.instruments.calibration.cell_means import cell_means
from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.polarimeter.polarimeter import lcvr, measured
from pbrdf.instruments.polarimeter.retardance_sets import retardance_set
from pbrdf.instruments.reduction.stokes_image import PixelFlag

NOMINAL = lcvr(retardance_set("six_states"))
DETECTOR = Detector(bits=14, gain=2.0, read_noise=5.0, offset=60.0)


def frames_at_inputs(polarimeter, level, shape, seed=0):
    """Raw frames (states, inputs, rows, columns) of even light."""
    rng = np.random.default_rng(seed)
    frames = [
        DETECTOR.expose(np.multiply.outer(polarimeter.intensities(level * s), np.ones(shape)), rng)
        for s in standard_inputs(12).T
    ]
    return np.stack(frames, axis=1)


@pytest.mark.parametrize("cells", [(1, 1), (2, 3), None])
def test_means_are_over_the_pixels_of_each_cell(cells):
    """Means and their variance over exactly the pixels that the map's cell serves (10 × 11 pixels, cells uneven)."""
    rng = np.random.default_rng(4)
    frames = rng.integers(100, 2000, size=(2, 3, 10, 11)).astype(np.uint16)
    found = cell_means(frames, DETECTOR, cells=cells)
    shape = (10, 11) if cells is None else cells
    of = measured(np.arange(shape[0] * shape[1] * 4.0).reshape(*shape, 1, 4)).spread(10, 11)[..., 0, 0] / 4
    for i in range(shape[0] * shape[1]):
        part = frames[..., of == i]
        place = () if cells == (1, 1) else np.unravel_index(i, shape)
        index = (..., *place)
        assert found.pixels[place] == part.shape[-1]
        np.testing.assert_allclose(found.intensities[index], part.mean(axis=-1) - DETECTOR.black)
        expected = DETECTOR.variance(part).sum(axis=-1) / part.shape[-1] ** 2
        np.testing.assert_allclose(found.variance[index], expected)


def test_bad_pixels_are_kept_out_and_counted():
    """Saturated, dead and dark pixels, each bad at one input only, are out at all inputs: the readings are those of the
    other pixels."""
    frames = frames_at_inputs(NOMINAL, 3000.0, (6, 8))
    clean = frames.copy()
    frames[2, 5, 0, 0] = 2**14 - 1
    frames[:, 7, 1, 1] = 55
    dead = np.zeros((6, 8), dtype=bool)
    dead[5, 7] = True
    frames[:, :, 5, 7] = 3
    found = cell_means(frames, DETECTOR, dead=dead)
    assert found.counts() == {"good": 45, "saturated": 1, "dead": 1, "dark": 1}
    assert found.flags[0, 0] == PixelFlag.SATURATED and found.flags[1, 1] == PixelFlag.DARK
    good = found.flags == 0
    np.testing.assert_allclose(found.intensities, clean[..., good].mean(axis=-1) - DETECTOR.black)
    assert found.pixels == 45


def test_frames_that_make_no_sense_are_refused():
    with pytest.raises(DataError, match="states, inputs, rows, columns"):
        cell_means(np.ones((2, 3, 4)), DETECTOR)
    with pytest.raises(DataError, match="cannot be divided"):
        cell_means(np.ones((2, 3, 4, 4)), DETECTOR, cells=(5, 1))
    with pytest.raises(DataError, match="no pixel of the calibration frames is good"):
        cell_means(np.zeros((2, 3, 4, 4)), DETECTOR)
    with pytest.raises(DataError, match="flat field"):
        cell_means(np.full((2, 3, 4, 4), 100), DETECTOR, flat=np.zeros((4, 4)))
