"""What stands for measurements of a material on the command line: data, the folder of a fit, a map; and libraries."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pbrdf.cli.reading import Reading
from pbrdf.cli.wavelengths import require_choice
from pbrdf.errors import DataError

if TYPE_CHECKING:
    import xarray as xr

    from pbrdf.identification.fitted_parameters import FittedParameters
    from pbrdf.identification.library import Library
    from pbrdf.inversion.result import FitResult

__all__ = [
    "BUNDLED",
    "LIBRARY",
    "Measurement",
    "library_file",
    "open_compared",
    "open_library",
    "open_measurement",
    "open_parameters",
    "open_pixels",
]

#: The library's file where none is named.
LIBRARY = Path("library.json")
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
    from pbrdf.identification.fitted_parameters import RECORD
    from pbrdf.inversion.stored_result import FILE_NAME, load_fit

    path = Path(source)
    if not (path.name == FILE_NAME and path.is_file()) and not (path / FILE_NAME).is_file():
        if (path / RECORD).is_file():
            raise DataError(
                f"{source}: the folder of a fit without its {FILE_NAME}, which holds the data: fit again"
            )
        return Measurement(source, reading.open(source))
    _require_not_read(source, reading)
    fit = load_fit(path)
    return Measurement(source, fit.dataset, fit)


def open_parameters(source: str, reading: Reading) -> FittedParameters | None:
    """A fit of which only the parameters are there: ``fit.json`` alone or in a folder without ``fit.nc``; None else.

    Raises
    ------
    PbrdfError
        If it cannot be read, or options of reading are given for it.
    """
    from pbrdf.identification.fitted_parameters import RECORD, FittedParameters
    from pbrdf.identification.identify_fit import open_fit
    from pbrdf.inversion.stored_result import FILE_NAME

    path = Path(source)
    alone = path.suffix.lower() == ".json" and path.is_file()
    if not alone and not ((path / RECORD).is_file() and not (path / FILE_NAME).is_file()):
        return None
    _require_not_read(source, reading)
    found = open_fit(path)
    assert isinstance(found, FittedParameters)
    return found


def _require_not_read(source: str, reading: Reading) -> None:
    if given := reading.stated():
        named = ", ".join("--" + name.replace("_", "-") for name in given)
        raise DataError(f"{source} is a fit, whose data have been read already: leave {named} out")


def open_compared(source: str, reading: Reading) -> Measurement:
    """The same of what is compared with materials, which are of one wavelength: it is of few, or they were chosen."""
    measured = open_measurement(source, reading)
    if measured.fit is None:
        require_choice(measured.dataset, reading, source, otherwise="each material of the library is of one")
    return measured


def open_pixels(source: str) -> xr.Dataset | None:
    """A map of parameters or data with further dimensions beside ``geometry``, not yet read; None for anything else.

    Raises
    ------
    DataError
        If it is a file of one of the forms that hold maps, but cannot be read, or a map that is not complete; or if it
        holds Stokes pictures without their geometry.
    """
    from pbrdf.data.formats.stored import require_no_pictures
    from pbrdf.data.formats.zarr_folder import open_zarr
    from pbrdf.data.schema import DIMENSION, STOKES_AXES
    from pbrdf.files.netcdf_files import open_netcdf
    from pbrdf.inversion.map_store import is_map, open_map
    from pbrdf.inversion.stored_result import FILE_NAME

    path = Path(source)
    if not path.exists() or path.name == FILE_NAME:
        return None
    if path.is_dir() and path.suffix.lower() == ".zarr":
        opened = open_map(path) if is_map(path) else open_zarr(path, decode_times=False)
    elif path.is_file() and path.suffix.lower() in (".nc", ".nc4"):
        opened = open_netcdf(path, decode_times=False)
    else:
        return None
    if "estimate" in opened and "parameter" in opened.dims:
        return opened
    if DIMENSION in opened.dims and {*map(str, opened.dims)} - {DIMENSION, *STOKES_AXES}:
        return _in_radians(opened)
    require_no_pictures(opened, path)
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


def library_file(named: Path | None) -> Path | None:
    """The library that is meant: the file that is named, else the one of this folder; None for the bundled paints."""
    return named if named is not None or not LIBRARY.exists() else LIBRARY


def open_library(path: Path | None) -> Library:
    """A library's file, or that of the bundled paints."""
    from pbrdf.identification.library import bundled_library, read_library

    return bundled_library() if path is None else read_library(path)
