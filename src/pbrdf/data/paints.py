"""Bundled paints and the bundled virtual experiment.

The parameters are Table 1 of Zhang, Song, Zhao, Infrared and Laser Engineering 46(11), 1117002 (2017), for
476 nm; the amplitude ``a`` is on that paper's camera scale, so these paints reflect more than they receive. Each has a
companion for rendering, ``NAME-scene``, whose ``a`` alone is another: scaled so that under an even sky the paint
reflects the share :data:`SCENE_ALBEDO`, a round number of ours, for the paper states none.
The measurements are simulated by ``scripts/make_bundled_experiment.py``: the paper published no raw data.
"""

from __future__ import annotations

from importlib import resources
from typing import TYPE_CHECKING

from pbrdf.data.readers import read
from pbrdf.errors import DataError
from pbrdf.models import DoubleGauss

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["PAINTS", "SCENE_ALBEDO", "SCENE_PAINTS", "WAVELENGTH", "load_paint", "open_experiment"]

#: Wavelength of Table 1 in nm.
WAVELENGTH = 476.0

#: Parameters (σ, n, a, k, b, t) of Table 1 by name.
PAINTS: dict[str, tuple[float, float, float, float, float, float]] = {
    "white": (0.0060, 1.7984, 1.9343, 1.1627, 0.0304, 0.6219),
    "matte-white-thin": (0.0368, 1.6925, 2.0533, 1.3759, 0.3519, 0.5998),
    "matte-white-thick": (0.0398, 1.6207, 1.5174, 1.2504, 0.1827, 0.6717),
    "pearl-white": (0.0380, 1.7227, 4.7723, 2.6395, 2.4167, 0.4103),
    "cd-back": (0.0346, 1.7420, 1.4927, 1.1945, 0.2749, 0.4686),
}

#: Share of an even sky's light that the companions for rendering reflect, :func:`pbrdf.models.reflectance.albedo`.
SCENE_ALBEDO = 0.6

#: Diffuse amplitude ``a`` of the companions by name, from :func:`pbrdf.models.reflectance.with_albedo`.
SCENE_PAINTS: dict[str, float] = {
    "white-scene": 0.5724,
    "matte-white-thin-scene": 0.7633,
    "matte-white-thick-scene": 0.6758,
    "pearl-white-scene": 2.8331,
    "cd-back-scene": 0.6500,
}


def load_paint(name: str) -> DoubleGauss:
    """The double-Gauss model of a bundled paint, or of its companion for rendering, ``NAME-scene``.

    Raises
    ------
    DataError
        If there is no such paint; the names are listed.
    """
    if name in SCENE_PAINTS:
        return load_paint(name.removesuffix("-scene")).replace(a=SCENE_PAINTS[name])
    if name not in PAINTS:
        raise DataError(
            f"no bundled paint is named {name!r}: choose one of {', '.join(PAINTS)}, for rendering NAME-scene"
        )
    return DoubleGauss(*PAINTS[name])


def open_experiment(name: str) -> xr.Dataset:
    """The simulated measurement of a bundled paint: 3 camera positions (``group``) × 21 sample angles.

    Raises
    ------
    DataError
        If there is no such paint; the names are listed.
    """
    if name not in PAINTS:
        raise DataError(f"no bundled measurement is named {name!r}: choose one of {', '.join(PAINTS)}")
    file = resources.files("pbrdf.data") / "experiment" / f"{name}.csv"
    with resources.as_file(file) as path:
        return read(path, format="csv")
