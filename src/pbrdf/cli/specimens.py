"""What stands for measurements of a material on the command line: data, the folder of a fit, a map; and libraries."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pbrdf.cli.reading import Reading
from pbrdf.errors import DataError

if TYPE_CHECKING:
    import xarray as xr

    from pbrdf.identification.library import Library
    from pbrdf.inversion.result import FitResult

__all__ = ["BUNDLED", "Measurement", "open_library", "open_measurement", "open_pixels"]

#: What stands for the library that comes with the package, in words.
BUNDLED = "the bundled paints"


@dataclass(frozen=True)
class Measurement:
    """Data of one specimen.

    Attributes
    ----------
    source
        As it was given.
    dataset
        The data.
    fit
        The fit whose data they are; None where they come from a file of data.
    """

    source: str
    dataset: xr.Dataset
    fit: FitResult | None = None

    @property
    def origin(self) -> str:
        """Name of the file or folder, and the title of the data."""
        title = " ".join(str(self.dataset.attrs.get("title", "")).split())
        name = Path(self.source).name
        return f"{name}: {title}" if title and title != name else name


def open_measurement(source: str, reading: Reading) -> Measurement:
    """Open a file of data, a bundled paint's experiment, or the folder of a fit.

    Raises
    ------
    PbrdfError
        If it is none of these, or options of reading are given for a fit.
    """
    from pbrdf.inversion.stored_result import FILE_NAME, load_fit

    path = Path(source)
    if not (path.name == FILE_NAME and path.is_file()) and not (path / FILE_NAME).is_file():
        return Measurement(source, reading.open(source))
    if given := reading.stated():
        named = ", ".join("--" + name.replace("_", "-") for name in given)
        raise DataError(f"{source} is a fit, whose data have been read already: leave {named} out")
    fit = load_fit(path)
    return Measurement(source, fit.dataset, fit)


def open_pixels(source: str) -> xr.Dataset | None:
    """A map of parameters or data with further dimensions beside ``geometry``, not yet read; None for anything else.

    Raises
    ------
    DataError
        If it is a file of one of the forms that hold maps, but cannot be read.
    """
    from pbrdf.data.formats.zarr_folder import open_zarr
    from pbrdf.data.schema import DIMENSION, STOKES_AXES
    from pbrdf.files.netcdf_files import open_netcdf
    from pbrdf.inversion.stored_result import FILE_NAME

    path = Path(source)
    if not path.exists() or path.name == FILE_NAME:
        return None
    if path.is_dir() and path.suffix.lower() == ".zarr":
        opened = open_zarr(path, decode_times=False)
    elif path.is_file() and path.suffix.lower() in (".nc", ".nc4"):
        opened = open_netcdf(path, decode_times=False)
    else:
        return None
    if "estimate" in opened and "parameter" in opened.dims:
        return opened
    if DIMENSION in opened.dims and {*map(str, opened.dims)} - {DIMENSION, *STOKES_AXES}:
        return _in_radians(opened)
    opened.close()
    return None


def _in_radians(stored: xr.Dataset) -> xr.Dataset:
    """Angles of a file, which are in degrees there, as the schema has them; those of each pixel are not read yet."""
    import numpy as np
    from xarray.conventions import decode_cf_variable

    from pbrdf.data.schema import ANGLES

    turned = {}
    for name in ANGLES:
        if name in stored and str(stored[name].attrs.get("units", "rad")).startswith("deg"):
            variable = stored[name].variable.copy(deep=False)
            variable.attrs = variable.attrs | {"units": "rad", "scale_factor": np.float64(np.pi / 180.0)}
            turned[name] = decode_cf_variable(name, variable, decode_times=False)
    return stored.assign(turned)


def open_library(path: Path | None) -> Library:
    """A library's file, or that of the bundled paints."""
    from pbrdf.identification.library import bundled_library, read_library

    return bundled_library() if path is None else read_library(path)
