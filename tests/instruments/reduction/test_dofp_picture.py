"""A real picture of a division-of-focal-plane camera: four film polarisers before a window.

The raw frame (Sony IMX250MZR, 2448 × 2048 pixels, 8 bits) is from elerac/polanalyser on GitHub, MIT licence. From left
to right the polarisers' transmitted light has an AoLP of about 83°, 44°, −5° and −45°.
"""

import numpy as np
import pytest
from PIL import Image

from pbrdf.instruments.frames.frame_files import open_frames
from pbrdf.instruments.polarimeter.presets import preset
from pbrdf.instruments.reduction.reduce import reduce
from pbrdf.instruments.reduction.region_averages import RegionCollector
from pbrdf.instruments.reduction.regions import Ellipse
from pbrdf.optics.stokes import aolp, dolp

#: Within each of the four polarisers, in cells of the mosaic; a wall beside them; and their AoLP, degrees.
POLARIZERS = {
    "first": (Ellipse(195, 548, 85, 85), 83.0),
    "second": (Ellipse(505, 548, 85, 85), 44.0),
    "third": (Ellipse(780, 550, 85, 85), -5.0),
    "fourth": (Ellipse(1055, 557, 85, 85), -45.0),
}
WALL = Ellipse(150, 250, 60, 60)
REGIONS = {**{name: region for name, (region, _) in POLARIZERS.items()}, "wall": WALL}


@pytest.fixture(scope="module")
def picture(measured):
    return measured("dofp-polarizers/polarizer_IMX250MZR.png")


def reduced(path, weighted):
    instrument = preset("sony_imx250mzr")
    frames = open_frames(path, instrument)
    collector = RegionCollector(REGIONS, frames, instrument)
    reduce(frames, instrument, [collector], weighted=weighted)
    # a grey camera, saturated in the sky where its 8 bits end: there is nothing to say
    assert frames.notes == []
    return {name: means[0] for name, means in collector.averages().items()}


@pytest.mark.parametrize("weighted", [True, False])
def test_angles_of_the_four_polarisers(picture, weighted):
    """Angles are counted from x, to the right, towards y, upwards: with the cell [[90°, 45°], [135°, 0°]] read from the
    top left, the second polariser, whose light has Q ≈ 0 and I_45 > I_135, stands at +45° and not at −45°."""
    averages = reduced(picture, weighted)
    for name, (_, expected) in POLARIZERS.items():
        found = averages[name]
        assert found.counts["good"] == found.pixels > 20_000
        assert np.rad2deg(aolp(found.stokes)) == pytest.approx(expected, abs=1.3)
        assert 0.35 < dolp(found.stokes) < 0.6
    assert averages["second"].stokes[2] > 0.0 > averages["fourth"].stokes[2]
    assert dolp(averages["wall"].stokes) < 0.03


def test_it_is_the_usual_formula(picture):
    """Unweighted, the reduction is I = ½ ΣI, Q = I_0 − I_90, U = I_45 − I_135, taken from the picture by hand."""
    raw = np.asarray(Image.open(picture)).astype(float)
    i90, i45, i135, i0 = raw[0::2, 0::2], raw[0::2, 1::2], raw[1::2, 0::2], raw[1::2, 1::2]
    by_hand = np.stack([(i0 + i45 + i90 + i135) / 2.0, i0 - i90, i45 - i135])
    averages = reduced(picture, weighted=False)
    for name, region in REGIONS.items():
        mask = region.mask(0, 1024, 1224)
        np.testing.assert_allclose(averages[name].stokes[:3], by_hand[:, mask].mean(axis=1), rtol=1e-9)
