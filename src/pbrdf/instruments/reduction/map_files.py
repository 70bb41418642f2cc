"""Files of Stokes parameters pixel by pixel, netCDF or Zarr, written one block of rows after another.

Variables over (series, y, x), 32-bit floating point: ``I``, ``Q``, ``U``, ``V``; ``cov_II``, ``cov_IQ`` … ``cov_VV``,
their covariance by detector noise (the matrix is symmetric: its elements on and above the diagonal); ``dolp``,
``dolp_debiased``, ``dolp_std``, ``aolp``, ``aolp_std``, ``docp``, ``docp_std``; and ``flags``. Stokes parameters are in
digital numbers, angles in degrees. The polarisation refers to the instrument's axes: x to the right in the picture, y
upwards, angles counterclockwise. Components that the instrument does not determine have no variable; a pixel with a
flag is NaN.

A file has its name when it is complete. In the hidden one that a killed process leaves, what was not written is NaN,
and its flag says so.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from pbrdf.data.formats.csv_table.columns import COVARIANCES
from pbrdf.data.formats.zarr_folder import create_zarr, list_arrays, require_zarr
from pbrdf.errors import DataError
from pbrdf.files.atomic import atomic_file, atomic_folder
from pbrdf.files.netcdf_files import PatientFile, write_netcdf_file
from pbrdf.instruments.frames.frames import Frames
from pbrdf.instruments.goniometer.angle_table import AngleTable
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.polarimeter.polarization_errors import debiased_dolp, polarization
from pbrdf.instruments.reduction.stokes_image import BAD_FLAGS
from pbrdf.instruments.reduction.streaming import Block
from pbrdf.optics.angles import within_half_turn
from pbrdf.optics.stokes import STOKES

__all__ = ["MapWriter"]

#: Rows of a chunk of a file are so many that it holds about this many bytes.
_CHUNK = 2**18

#: Flag of pixels that were not written.
_UNWRITTEN = np.uint8(128)
#: Units and long name of each variable, and which Stokes components it needs.
_VARIABLES: dict[str, tuple[str, str, tuple[int, ...]]] = {
    **{name: ("1", f"Stokes parameter {name}, digital numbers", (k,)) for k, name in enumerate(STOKES)},
    **{
        name: (
            "1",
            f"covariance of {STOKES[i]} and {STOKES[j]}, detector noise, digital numbers squared",
            (i, j),
        )
        for (i, j), name in COVARIANCES.items()
    },
    "dolp": ("1", "degree of linear polarisation", (0, 1, 2)),
    "dolp_debiased": (
        "1",
        "degree of linear polarisation without most of the bias of noise, modified asymptotic estimator",
        (0, 1, 2),
    ),
    "dolp_std": ("1", "standard error of the degree of linear polarisation", (0, 1, 2)),
    "aolp": ("degree", "angle of linear polarisation from x (right) towards y (up)", (1, 2)),
    "aolp_std": ("degree", "standard error of the angle of linear polarisation", (1, 2)),
    "docp": ("1", "degree of circular polarisation", (0, 3)),
    "docp_std": ("1", "standard error of the degree of circular polarisation", (0, 3)),
}


class MapWriter:
    """A file of Stokes parameters pixel by pixel: a sink for :func:`pbrdf.instruments.reduction.reduce.reduce`.

    The file is written beside, and has its name when the reduction is done; if that fails, it goes.

    Parameters
    ----------
    path
        The new file, ``.nc``, or folder, ``.zarr``.
    frames, instrument
        What was measured, and with what.
    angles
        Angles of the series, if they are known.
    attrs
        Further attributes of the file.

    Attributes
    ----------
    names
        Of the variables.

    Raises
    ------
    DataError
        If the extension is another one, zarr is not installed, or the angles lack a series; when the first block is
        due, if there is something of that name; if the file cannot be written.
    """

    def __init__(
        self,
        path: str | Path,
        frames: Frames,
        instrument: Instrument,
        *,
        angles: AngleTable | None = None,
        attrs: dict[str, Any] | None = None,
    ) -> None:
        path = Path(path)
        self._kind = path.suffix.lower()
        if self._kind not in (".nc", ".zarr"):
            raise DataError(f"{path}: Stokes pictures are written as .nc or .zarr")
        if self._kind == ".zarr":
            require_zarr(path)
        self._path = path
        self._head = _head(frames, instrument, angles, attrs or {})
        self._shape = (len(frames.names), frames.rows, frames.columns)
        self._chunk_shape = (1, min(max(_CHUNK // (4 * frames.columns), 1), frames.rows), frames.columns)
        self.rows = (0, frames.rows)
        determined = instrument.polarimeter.determined
        self._attributes: dict[str, dict[str, Any]] = {
            name: {"units": units, "long_name": words}
            for name, (units, words, needs) in _VARIABLES.items()
            if determined[list(needs)].all()
        }
        self._attributes["flags"] = {
            "long_name": "why a pixel was left out; 0 is a good pixel",
            "flag_masks": np.array(
                [*(flag.value for flag in BAD_FLAGS), _UNWRITTEN], dtype=np.uint8
            ).tolist(),
            "flag_meanings": " ".join([*(str(flag.name).lower() for flag in BAD_FLAGS), "not_yet_reduced"]),
        }
        self.names = tuple(self._attributes)
        self._buffers: dict[str, np.ndarray] = {}
        self._variables: dict[str, Any] = {}
        self._file: Any = None
        self._target: PatientFile | None = None
        self._place: AbstractContextManager[Path] = (atomic_file if self._kind == ".nc" else atomic_folder)(
            path
        )

    def __enter__(self) -> MapWriter:
        if self._path.exists():
            raise DataError(f"{self._path}: there is something of that name already")
        beside = self._place.__enter__()
        try:
            with self._written():
                self._create(beside)
        except BaseException as error:
            self._give_up(error)
            raise
        return self

    def _create(self, path: Path) -> None:
        """Write all but the numbers."""
        if self._kind == ".nc":
            import h5netcdf

            write_netcdf_file(path, {"/": self._head})
            self._target = PatientFile(path)
            self._file = h5netcdf.File(self._target, "a")
        else:
            import zarr

            create_zarr(self._head, path)
            self._file = zarr.open_group(path, mode="r+", zarr_format=3, use_consolidated=False)
        self._variables = {name: self._variable(name) for name in self.names}
        if self._kind == ".zarr":
            list_arrays(path)
        self._buffers = {name: np.empty(self._chunk_shape[1:], _type(name)) for name in self.names}
        if self._kind == ".nc":
            # the file is complete but for its numbers, and h5py writes small parts of them faster
            import h5py

            self._file.close()
            # rows come in order: one chunk of each variable has to be kept, not the usual megabytes
            self._file = h5py.File(self._target, "r+", rdcc_nbytes=2 * _CHUNK)
            self._variables = {name: self._file[name] for name in self.names}
            # no flag of a complete file is missing: bits stay whole numbers
            del self._variables["flags"].attrs["_FillValue"]

    def _variable(self, name: str) -> Any:
        dims = ("series", "y", "x")
        dtype = _type(name)
        attributes = self._attributes[name]
        fill = _UNWRITTEN if name == "flags" else np.float32(np.nan)
        if self._kind == ".nc":
            variable = self._file.create_variable(name, dims, dtype, chunks=self._chunk_shape, fillvalue=fill)
        else:
            # a chunk of nothing but bad pixels is written as well: one that is not there was lost
            variable = self._file.create_array(
                name,
                shape=self._shape,
                chunks=self._chunk_shape,
                dtype=dtype,
                fill_value=fill,
                dimension_names=dims,
                config={"write_empty_chunks": True},
            )
        for key, value in attributes.items():
            variable.attrs[key] = value
        return variable

    def prepare(self, block: Block) -> dict[str, np.ndarray]:
        """What is stored of a block.

        Returns
        -------
        dict of str to ndarray
            By the name of the variable, float32 but for the flags, angles in degrees, shape (rows, columns).
        """
        image = block.image
        good = image.flags == 0
        stokes = np.where(good, image.stokes, np.nan)
        covariance = np.where(good, image.covariance, np.nan)
        found = polarization(stokes, covariance)
        values = {
            **dict(zip(STOKES, stokes, strict=True)),
            **{name: covariance[i, j] for (i, j), name in COVARIANCES.items()},
            "dolp": found.dolp,
            "dolp_debiased": debiased_dolp(stokes, covariance),
            "dolp_std": found.dolp_std,
            # in single precision, which rounds what lies beside −90° to it
            "aolp": within_half_turn(np.rad2deg(found.aolp).astype(np.float32), 90.0),
            "aolp_std": np.rad2deg(found.aolp_std),
            "docp": found.docp,
            "docp_std": found.docp_std,
        }
        return {
            name: image.flags if name == "flags" else values[name].astype(np.float32, copy=False)
            for name in self.names
        }

    def add(self, block: Block, part: dict[str, np.ndarray]) -> None:
        """Write what :meth:`prepare` made of a block; all rows must come, in their order."""
        # whole chunks only: a part of a chunk would make the file be read, packed and written again
        high, rows = self._chunk_shape[1], self._shape[1]
        done, count = 0, len(part["flags"])
        while done < count:
            row = block.first_row + done
            start, end = row // high * high, min((row // high + 1) * high, rows)
            taken = min(end - row, count - done)
            for name, buffer in self._buffers.items():
                buffer[row - start : row - start + taken] = part[name][done : done + taken]
                if row + taken == end:
                    with self._written():
                        self._variables[name][block.series, start:end, :] = buffer[: end - start]
            done += taken

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, *_: object) -> None:
        try:
            self._close()
        except BaseException as own:
            self._give_up(own)
            raise
        if error is None:
            self._place.__exit__(None, None, None)
        else:
            self._give_up(error)

    @contextmanager
    def _written(self) -> Iterator[None]:
        """Raise what the disk has to say, in place of what the library makes of it."""
        try:
            yield
        finally:
            if self._target is not None:
                self._target.require_written()

    def _close(self) -> None:
        with self._written():
            if hasattr(self._file, "close"):
                self._file.close()
            if self._target is not None:
                self._target.close()

    def _give_up(self, error: BaseException) -> None:
        """Leave nothing half-written; raises DataError in the place of what the disk has to say."""
        with suppress(Exception):  # the error that matters is another one
            self._close()
        self._place.__exit__(type(error), error, error.__traceback__)


def _type(name: str) -> np.dtype[Any]:
    return np.dtype(np.uint8 if name == "flags" else np.float32)


def _head(
    frames: Frames, instrument: Instrument, angles: AngleTable | None, attrs: dict[str, Any]
) -> xr.Dataset:
    """Coordinates and attributes."""
    coords: dict[str, Any] = {
        "series": ("series", list(frames.names)),
        "y": ("y", np.arange(frames.rows), {"units": "1", "long_name": "row, from the top"}),
        "x": ("x", np.arange(frames.columns), {"units": "1", "long_name": "column, from the left"}),
    }
    reference = np.rad2deg(instrument.reference_angle)
    if angles is not None:
        table = angles.for_frames(frames).rows(frames.names)
        for name in ("theta_i", "theta_r", "phi", "sample_angle"):
            coords[name] = ("series", np.rad2deg(getattr(table, name)), {"units": "degree"})
        own = np.rad2deg(table.reference_angle)
        coords["reference_angle"] = ("series", np.where(np.isnan(own), reference, own), {"units": "degree"})
        coords["exposure"] = ("series", np.asarray(table.exposure), {"long_name": "exposure time, relative"})
        if table.wavelength is not None:
            coords["wavelength"] = ("series", np.asarray(table.wavelength), {"units": "nm"})
    polarimeter, detector = instrument.polarimeter, instrument.detector
    described = {
        "axes": "x to the right in the picture, y upwards, angles counterclockwise as the receiver sees them",
        "instrument": polarimeter.name,
        "polarimeter": json.dumps(polarimeter.details, ensure_ascii=False),
        "states": ", ".join(polarimeter.states),
        "accuracy_linear": float(polarimeter.accuracy[0]),
        "accuracy_circular": float(polarimeter.accuracy[1]),
        "detector": json.dumps(asdict(detector)),
        "reference_angle_degree": float(reference),
        "stability": float(instrument.stability),
    }
    return xr.Dataset(coords=coords, attrs={**described, **attrs})
