"""BRDF tables in the binary format of the MERL database.

W. Matusik, H. Pfister, M. Brand, L. McMillan, "A data-driven reflectance model" (ACM Transactions on Graphics
22(3), 759 (2003)); the layout is that of their ``BRDFRead.cpp``. Three int32, the numbers of cells 90, 90, 180 of
θ_h, θ_d and φ_d (:mod:`pbrdf.optics.half_difference`), then a plane of float64 for each of red, green and blue, in
which φ_d runs fastest. A value times 1/1500, 1.15/1500 or 1.66/1500 is a BRDF in 1/sr; negative ones are invalid. All
little-endian.

Cell j of θ_h begins at (π/2) (j/90)²: fine near the normal, where the lobe is. Those of θ_d are 1° wide, those of
φ_d, from 0 to π, too: the format takes reciprocity for granted, by which φ_d + π is the same as φ_d. A value is
taken to stand at the middle of its cell's indices, j + ½.
"""

from __future__ import annotations

import math
import struct
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from pbrdf.data.build import assemble
from pbrdf.data.formats.declaration import Reader
from pbrdf.data.formats.thinning import thinning, thinning_in_words
from pbrdf.data.schema import NATURAL_LIGHT
from pbrdf.data.validation import validate
from pbrdf.errors import DataError
from pbrdf.files.atomic import atomic_file
from pbrdf.files.text import first_bytes
from pbrdf.optics.half_difference import directions, half_difference

__all__ = [
    "COLOURS",
    "READER",
    "SHAPE",
    "cell_centres",
    "look_up",
    "read_merl",
    "read_planes",
    "write_planes",
]

#: Cells of θ_h, θ_d and φ_d.
SHAPE = (90, 90, 180)
COLOURS = ("red", "green", "blue")

_SCALES = np.array([1.0, 1.15, 1.66]) / 1500.0
_HEADER = struct.Struct("<3i")
_INVALID = -1.0


def cell_centres() -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """θ_h, θ_d and φ_d of the cells along their axes, radians; shapes (90,), (90,) and (180,)."""
    theta_h, theta_d, phi_d = ((np.arange(count) + 0.5) / count for count in SHAPE)
    return np.pi / 2 * theta_h**2, np.pi / 2 * theta_d, np.pi * phi_d


def look_up(
    planes: NDArray[np.float64], theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike
) -> NDArray[np.float64]:
    """Value of the cell that a pair of directions falls into.

    Parameters
    ----------
    planes
        BRDF in 1/sr, shape (3, 90, 90, 180).
    theta_i, theta_r, phi
        Radians, φ = 0 forward; shape (...).

    Returns
    -------
    ndarray
        Shape (..., 3), NaN in invalid cells.
    """
    theta_h, theta_d, phi_d = half_difference(theta_i, theta_r, phi)
    half_turn = np.where(phi_d < 0.0, phi_d + np.pi, phi_d)
    share = (np.sqrt(theta_h / (np.pi / 2)), theta_d / (np.pi / 2), half_turn / np.pi)
    # Rounding may lead past the last cell.
    cell = (np.minimum((s * count).astype(np.intp), count - 1) for s, count in zip(share, SHAPE, strict=True))
    return np.moveaxis(planes[:, *cell], 0, -1)


def read_planes(path: str | Path) -> NDArray[np.float64]:
    """BRDF of the three colours in 1/sr, shape (3, 90, 90, 180); NaN in invalid cells.

    Raises
    ------
    DataError
        If the file cannot be read, is no MERL file or has not the right length.
    """
    path = Path(path)
    wanted = _HEADER.size + 8 * len(COLOURS) * math.prod(SHAPE)
    try:
        with path.open("rb") as file:
            header = file.read(_HEADER.size)
            size = path.stat().st_size
            counts = _HEADER.unpack(header) if len(header) == _HEADER.size else None
            if counts != SHAPE:
                found = "is too short for" if counts is None else f"begins with {counts} in place of"
                raise DataError(f"{path}: this is not a MERL file: it {found} the cell numbers {SHAPE}")
            if size != wanted:
                state = "truncated" if size < wanted else "not a MERL file"
                raise DataError(f"{path}: the file has {size} bytes, a MERL file has {wanted}: it is {state}")
            raw = np.fromfile(file, "<f8").reshape(len(COLOURS), *SHAPE)
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror or error}") from error
    return np.where(raw < 0.0, np.nan, raw * _SCALES[:, np.newaxis, np.newaxis, np.newaxis])


def write_planes(planes: ArrayLike, path: str | Path) -> None:
    """Write the BRDF of the three colours; inverse of :func:`read_planes`.

    Parameters
    ----------
    planes
        1/sr, shape (3, 90, 90, 180); NaN, no value, becomes −1.
    path
        The file; replaced, when the new one is complete, if it exists.

    Raises
    ------
    DataError
        If the shape is another, a value is infinite or below 0, which the format takes for none, or the file cannot
        be written.
    """
    path = Path(path)
    values = np.asarray(planes, dtype=np.float64)
    if values.shape != (len(COLOURS), *SHAPE):
        raise DataError(f"{path}: planes of the shape {values.shape}; {(len(COLOURS), *SHAPE)} is needed")
    wrong = (values < 0.0) | np.isinf(values)
    if wrong.any():
        colour, *cell = np.argwhere(wrong)[0].tolist()
        raise DataError(
            f"{path}: {COLOURS[colour]} is {values[(colour, *cell)]:.4g} in the cell {tuple(cell)}: the format holds "
            "finite values from 0, and takes others for none"
        )
    raw = values / _SCALES[:, np.newaxis, np.newaxis, np.newaxis]
    with atomic_file(path) as beside, beside.open("wb") as file:
        file.write(_HEADER.pack(*SHAPE))
        np.where(np.isnan(raw), _INVALID, raw).astype("<f8").tofile(file)


def read_merl(path: str | Path, *, every: int | None = None) -> xr.Dataset:
    """Read a MERL ``.binary`` table as a data set.

    Parameters
    ----------
    path
        The file.
    every
        Take one cell in this many along each of θ_h, θ_d and φ_d; 1 takes all 1 458 000 cells. None takes as many
        as leave no more than :data:`pbrdf.data.formats.thinning.MOST_CELLS`: one in 5.

    Returns
    -------
    xarray.Dataset
        ``I`` as a BRDF in 1/sr under natural light at the middle of the cells, in the order of the file, the colours
        of a cell after one another; ``group`` is ``"red"``, ``"green"`` or ``"blue"``, ``wavelength`` NaN: the database
        does not state any. Invalid cells and those with a direction below the horizon are left out.

    Raises
    ------
    DataError
        As :func:`read_planes`; if no cell is valid.
    """
    path = Path(path)
    step = thinning(SHAPE, every, str(path))
    planes = read_planes(path)[:, ::step, ::step, ::step].reshape(len(COLOURS), -1)
    centres = np.meshgrid(*(a[::step] for a in cell_centres()), indexing="ij")
    theta_i, theta_r, phi = directions(*(a.ravel() for a in centres))
    above = (theta_i < np.pi / 2) & (theta_r < np.pi / 2)
    cell, colour = np.nonzero(above[:, np.newaxis] & np.isfinite(planes.T))
    if not cell.size:
        raise DataError(f"{path}: no cell of the table is valid")
    ds = assemble(
        {
            "theta_i": theta_i[cell],
            "theta_r": theta_r[cell],
            "phi": phi[cell],
            "wavelength": np.full(cell.size, np.nan),
            "group": np.array(COLOURS)[colour],
        },
        {"I": planes[colour, cell]},
        {},
        {
            "quantity": "brdf",
            "illumination": list(NATURAL_LIGHT),
            "simulated": 0,
            "source": path.name + thinning_in_words(step),
        },
    )
    validate(ds, origin=str(path))
    return ds


def _begins_as_merl(path: Path) -> bool:
    return first_bytes(path, _HEADER.size) == _HEADER.pack(*SHAPE)


READER = Reader("merl", read_merl, extensions=(".binary", ".merl", ".bin"), sniff=_begins_as_merl)
