"""Instruments that are built in.

``paper``
    The full-Stokes imager of the paper (Zhang, Song, Zhao, Infrared and Laser Engineering 46, 1117002 (2017), section
    2): two liquid-crystal retarders, 1 % accuracy for linear and 5 % for circular polarisation, a source stable to
    0.001.
``conservative``
    The same with the accuracy that the abstract of the paper's own reference states, 1.7 % and 8.8 % (Zhang, Zhao, Li,
    Applied Optics 52, 1284 (2013)). The two publications disagree; which holds cannot be decided from them.
``sony_imx250mzr``
    A camera with wire-grid polarisers on its pixels, cell [[90°, 45°], [135°, 0°]]; it does not see V.
``sony_imx250myr``, ``sony_imx264myr``
    The same under a Bayer mosaic, a colour for each cell of polarisers
    (:mod:`pbrdf.instruments.polarimeter.color_filters`): every picture gives one series for each of R, G and B.

The retardances of the paper's imager are not published: the tetrahedral set stands in for them. Its detector is not
named either; the intensities in digital numbers (20 of them at most, called 17 % of the largest value) suggest eight
bits, and gain and read noise are those of a common CCD (about 20 000 electrons over 255 numbers).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pbrdf.errors import DataError
from pbrdf.instruments.polarimeter.color_filters import ColorFilters
from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.polarimeter.polarimeter import division_of_focal_plane, lcvr
from pbrdf.instruments.polarimeter.retardance_sets import retardance_set

__all__ = ["PRESETS", "preset"]


def _imager(linear: float, circular: float, name: str) -> Instrument:
    polarimeter = lcvr(retardance_set("tetrahedron"), name=name).with_accuracy(linear, circular)
    detector = Detector(bits=8, gain=80.0, read_noise=20.0)
    return Instrument(polarimeter, detector, stability=0.001)


def _paper() -> Instrument:
    return _imager(0.01, 0.05, "full-Stokes imager, 1 % linear and 5 % circular")


def _conservative() -> Instrument:
    return _imager(0.017, 0.088, "full-Stokes imager, 1.7 % linear and 8.8 % circular")


def _sony() -> Instrument:
    # 8-bit mode: a full well of about 10 500 electrons over 255 numbers
    detector = Detector(bits=8, gain=41.0, read_noise=2.5)
    return Instrument(division_of_focal_plane(np.deg2rad([[90.0, 45.0], [135.0, 0.0]])), detector)


def _sony_color() -> Instrument:
    grey = _sony()
    name = "division of focal plane in colours"
    return replace(grey, polarimeter=replace(grey.polarimeter, name=name, filters=ColorFilters()))


#: Makers of the built-in instruments.
PRESETS: dict[str, Callable[[], Instrument]] = {
    "paper": _paper,
    "conservative": _conservative,
    "sony_imx250mzr": _sony,
    "sony_imx250myr": _sony_color,
    "sony_imx264myr": _sony_color,
}


def preset(name: str) -> Instrument:
    """The built-in instrument of this name.

    Raises
    ------
    DataError
        If there is none.
    """
    if name not in PRESETS:
        raise DataError(f"no instrument is called {name!r}; use one of {', '.join(PRESETS)}")
    return PRESETS[name]()
