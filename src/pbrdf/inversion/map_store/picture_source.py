"""What a map is fitted to, in files that are opened when a block of pixels is asked for.

A file holds either Stokes pictures as ``pbrdf reduce`` writes them, over (``series``, ``y``, ``x``), which the geometry
of their pixels makes data; or data of :mod:`pbrdf.data.schema` with dimensions beside ``geometry``. Several files are
several series, or several geometries, of the same pixels.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import math
import operator
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from pbrdf.data.alignment import few, require_same_labels
from pbrdf.data.formats.attributes import plain_attributes
from pbrdf.data.formats.csv_table.columns import COVARIANCES
from pbrdf.data.formats.stored import NANOMETRES, pixels_from_stored
from pbrdf.data.formats.zarr_folder import open_zarr
from pbrdf.data.schema import COORDINATES, COVARIANCE, DIMENSION, NATURAL_LIGHT, STOKES_AXES, VARIABLES
from pbrdf.errors import DataError
from pbrdf.files.digest import sha256_of
from pbrdf.files.netcdf_files import SIGNATURE, open_netcdf
from pbrdf.files.text import first_bytes
from pbrdf.instruments.pixel_geometry.geometry import PixelGeometry
from pbrdf.instruments.pixel_geometry.labels import read_labels
from pbrdf.instruments.pixel_geometry.map_dataset import map_block
from pbrdf.inversion.map_store.map_source import file_identity
from pbrdf.inversion.parameter_map.map_fit import LABEL, MASK
from pbrdf.optics.stokes import STOKES

__all__ = ["PictureSource", "opened_pictures"]

_SERIES = "series"
#: Attributes that say what the numbers of a file are, and what it means where one is not there.
_MEANINGS: dict[str, Any] = {
    "quantity": "dn",
    "scale": None,
    "stokes_convention": "p-s",
    "illumination": list(NATURAL_LIGHT),
    "simulated": 0,
}
#: Wavelengths that differ by no more are the same, nm.
_SAME_WAVELENGTH = 0.5


@dataclass(frozen=True)
class PictureSource:
    """Files of a map, with what makes them data; made by :meth:`open`, and can be sent to other processes.

    Attributes
    ----------
    paths
        The files.
    geometry
        Of the pixels of each, located; None where the files hold data.
    scale
        Of :func:`~pbrdf.instruments.pixel_geometry.map_dataset.map_block`.
    labels
        Number of the part of the sample that each pixel belongs to, shape (y, x), 0 is left out; or None.
    sizes
        Of the map's dimensions.
    """

    paths: tuple[Path, ...]
    geometry: tuple[PixelGeometry, ...] | None
    scale: float | None
    labels: np.ndarray | None
    sizes: Mapping[str, int]
    _opened: list[xr.Dataset] = field(default_factory=list, repr=False, compare=False)

    @classmethod
    def open(
        cls,
        paths: Sequence[Path],
        geometry: Sequence[PixelGeometry] | None = None,
        *,
        scale: float | None = None,
        labels: Path | None = None,
    ) -> PictureSource:
        """Look at the files, and find in the pictures what the geometry leaves open.

        Parameters
        ----------
        paths
            The files.
        geometry
            One for all files, or one for each; None if the files hold data.
        scale
            As the attribute.
        labels
            A file of :func:`~pbrdf.instruments.pixel_geometry.labels.read_labels`.

        Raises
        ------
        DataError
            If a file cannot be read, files do not fit each other (other pixels, wavelengths or components, another
            quantity or convention), or a geometry is missing or one too many.
        """
        opened = [opened_pictures(path) for path in paths]
        pictures = [DIMENSION not in one.dims for one in opened]
        if any(pictures) != all(pictures):
            raise DataError(f"{paths[pictures.index(False)]}: holds data, and other files Stokes pictures")
        located = None
        if pictures[0]:
            if not geometry:
                raise DataError(
                    f"{paths[0]}: Stokes pictures need the geometry of their pixels, for example "
                    "flat:theta_i=30,theta_r=40,phi=0"
                )
            if len(geometry) not in (1, len(paths)):
                raise DataError(
                    f"{len(geometry)} geometries for {len(paths)} files: give one, or one for each"
                )
            each = list(geometry) * (len(paths) // len(geometry))
            located = tuple(map(_located, each, opened, paths))
        elif geometry:
            raise DataError(
                f"{paths[0]}: holds data with the angles of every pixel: a geometry is one too many"
            )
        elif scale is not None:
            raise DataError(
                f"{paths[0]}: holds data, which say themselves what their values are: counts per BRDF belong to Stokes "
                "pictures"
            )
        found = [_pixel_sizes(path, one) for path, one in zip(paths, opened, strict=True)]
        for path, sizes in zip(paths, found, strict=True):
            if sizes != found[0]:
                raise DataError(
                    f"{path}: has {_in_words(sizes)} pixels, {paths[0]} has {_in_words(found[0])}"
                )
        for path, one in zip(paths[1:], opened[1:], strict=True):
            _require_alike(opened[0], paths[0], one, path, found[0])
        parts = None
        if labels is not None:
            if not {"y", "x"} <= set(found[0]):
                raise DataError(
                    f"{labels}: regions are parts of pictures over y and x, not of {_in_words(found[0])}"
                )
            parts = read_labels(labels, found[0]["y"], found[0]["x"]).values
        return cls(tuple(paths), located, scale, parts, found[0], opened)

    def __getstate__(self) -> dict[str, Any]:
        # open files stay in their process
        return {**self.__dict__, "_opened": []}

    def outline(self) -> xr.Dataset:
        """The whole as a data set whose values are one pixel's, everywhere: its form, in no memory."""
        first = self.block({dim: slice(0, 1) for dim in self.sizes})
        variables: dict[Any, Any] = {}
        for name, variable in first.variables.items():
            if not set(self.sizes) & set(variable.dims):
                variables[name] = variable
            elif name not in self.sizes:
                shape = [self.sizes.get(str(d), size) for d, size in variable.sizes.items()]
                values = np.broadcast_to(variable.values, shape)
                variables[name] = xr.Variable(variable.dims, values, variable.attrs)
        variables |= {dim: places.variable for dim, places in self.places.coords.items()}
        coords = {name for name in variables if name in first.coords}
        return xr.Dataset(
            {name: v for name, v in variables.items() if name not in coords},
            {name: variables[name] for name in coords},
            first.attrs,
        )

    @property
    def places(self) -> xr.Dataset:
        """Coordinates of the pixels along each dimension, of those that have some."""
        first = self._files()[0]
        return xr.Dataset(coords={dim: first[dim] for dim in self.sizes if dim in first.coords})

    def block(self, region: Mapping[str, slice]) -> xr.Dataset:
        """Some pixels, in memory.

        Parameters
        ----------
        region
            Slices along dimensions of the map; all of those that are not named.
        """
        parts = []
        for k, (path, one) in enumerate(zip(self.paths, self._files(), strict=True)):
            try:
                part = one.isel({dim: region.get(dim, slice(None)) for dim in self.sizes}).load()
            except Exception as error:  # decoders raise anything over a damaged chunk
                raise DataError(f"{path}: cannot be read: {' '.join(str(error).split())}") from error
            if self.geometry is None:
                parts.append(pixels_from_stored(part, path))
            else:
                parts.append(map_block(part, self.geometry[k], scale=self.scale))
        found = parts[0] if len(parts) == 1 else _together(parts, self.sizes)
        if self.labels is not None:
            shown = self.labels[region.get("y", slice(None)), region.get("x", slice(None))]
            found = found.assign({LABEL: (("y", "x"), shown)})
        return found

    def identity(self) -> dict[str, Any]:
        """Files by their size, variables and the digest of a sample; geometry, scale and labels."""
        return {
            "files": [file_identity(path, one) for path, one in zip(self.paths, self._files(), strict=True)],
            "geometry": _plain(self.geometry),
            "scale": self.scale,
            "labels": _plain(self.labels),
        }

    def _files(self) -> list[xr.Dataset]:
        if not self._opened:
            self._opened.extend(opened_pictures(path) for path in self.paths)
        return self._opened


def _plain(value: Any) -> Any:
    """What decides a geometry, as JSON can hold it: arrays and files by their digests."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        own = {f.name: _plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
        return {"kind": type(value).__name__, **own}
    if isinstance(value, np.ndarray):
        return {
            "shape": list(value.shape),
            "digest": hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest(),
        }
    if isinstance(value, xr.Dataset):
        return {str(name): _plain(variable.values) for name, variable in value.variables.items()}
    if isinstance(value, Path):
        return {"file": value.name, "digest": sha256_of(value)}
    if isinstance(value, Mapping):
        return {str(name): _plain(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def opened_pictures(path: Path) -> xr.Dataset:
    """A file of Stokes pictures or of data with pixels, whose numbers are read when they are asked for.

    Raises
    ------
    DataError
        If it cannot be read, or is neither.
    """
    if not path.exists():
        raise DataError(f"{path}: there is no such file")
    if not path.is_dir() and first_bytes(path, len(SIGNATURE)) != SIGNATURE:
        raise DataError(
            f"{path}: is neither netCDF nor a Zarr folder, and a map is made of pictures: stokes.nc or .zarr of "
            "`pbrdf reduce`, or data with dimensions beside geometry. Measurements in a table are fitted with "
            f"`pbrdf fit {path.name}`, raw frames reduced first by `pbrdf reduce`"
        )
    options: dict[str, Any] = {"decode_times": False, "cache": False}
    opened = open_zarr(path, **options) if path.is_dir() else open_netcdf(path, **options)
    if "I" in opened and {"y", "x"} <= set(opened.dims) and DIMENSION not in opened.dims:
        # degrees and angles of polarisation follow from these
        kept = {*STOKES, *COVARIANCES.values(), "flags"}
        return opened.drop_vars([name for name in opened.data_vars if name not in kept])
    if DIMENSION not in opened.dims:
        raise DataError(
            f"{path}: holds neither Stokes pictures, I, Q, U over series, y and x as `pbrdf reduce` writes them into "
            "stokes.nc, nor data with the dimension geometry"
        )
    return opened


def _located(geometry: PixelGeometry, opened: xr.Dataset, path: Path) -> PixelGeometry:
    try:
        return geometry.located(opened)
    except DataError as error:
        raise DataError(f"the geometry of {path}: {error}") from error


def _pixel_sizes(path: Path, opened: xr.Dataset) -> dict[str, int]:
    """Dimensions of the map in a file, in the order of its data."""
    kept = (DIMENSION, _SERIES, *STOKES_AXES)
    dims = [str(d) for v in opened.data_vars.values() for d in v.dims if d not in kept]
    if not dims:
        raise DataError(f"{path}: has one value for each geometry and no pixels: fit it with `pbrdf fit`")
    sizes = {dim: opened.sizes[dim] for dim in dict.fromkeys(dims)}
    if 0 in sizes.values():
        raise DataError(f"{path}: has no pixels, {_in_words(sizes)}")
    return sizes


def _require_alike(first: xr.Dataset, name: Path, other: xr.Dataset, path: Path, dims: Iterable[str]) -> None:
    """Raise if a file is labelled otherwise than the first one: nothing that is put together goes by its place."""
    require_same_labels(other, str(path), first, str(name), dims)
    meanings = [plain_attributes(one.attrs) for one in (other, first)]
    for key, usual in _MEANINGS.items():
        values = [attrs.get(key, usual) for attrs in meanings]
        if values[0] != values[1]:
            raise DataError(
                f"{key} is {_said(values[0])} in {path}, and {_said(values[1])} in {name}: one map is made of one {key}"
            )
    held = [
        [n for n in map(str, one.data_vars) if n in VARIABLES or n == COVARIANCE] for one in (other, first)
    ]
    if sorted(held[0]) != sorted(held[1]):
        raise DataError(
            f"{path}: holds {', '.join(held[0])}, and {name} {', '.join(held[1])}: several files of a map hold the "
            "same components"
        )
    here, there = _wavelengths(other), _wavelengths(first)
    off = np.abs(np.subtract.outer(here, there)) > _SAME_WAVELENGTH
    if bool(here.size) != bool(there.size) or off.all(axis=0).any() or off.all(axis=1).any():
        said = [few(one) or "not stated" for one in (here, there)]
        raise DataError(
            f"wavelength is {said[0]} in {path}, and {said[1]} in {name}: a map has one set of parameters for all, so "
            "make a map of each"
        )


def _wavelengths(opened: xr.Dataset) -> np.ndarray:
    """Those of a file, each once, nm; empty where it states none."""
    if "wavelength" not in opened.variables:
        return np.empty(0)
    found = opened["wavelength"]
    factor = NANOMETRES.get(str(found.attrs.get("units", "nm")), 1.0)
    values = np.unique(factor * found.values.astype(float))
    return values[np.isfinite(values)]


def _said(value: Any) -> str:
    return "not stated" if value is None else few(value)


def _in_words(sizes: Mapping[str, int]) -> str:
    return " × ".join(f"{size} ({dim})" for dim, size in sizes.items())


def _together(parts: Sequence[xr.Dataset], sizes: Mapping[str, int]) -> xr.Dataset:
    """Geometries of several files one after the other; a pixel that one of them leaves out is left out."""
    shared = {
        name for part in parts for name in COORDINATES if name in part and set(sizes) & set(part[name].dims)
    }
    spread = []
    for part in parts:
        # angles that one file has for every pixel, and another for all of them
        for name in shared:
            if name in part and not set(sizes) & set(part[name].dims):
                part = part.assign_coords({name: part[name].expand_dims(_sizes_here(part, sizes))})
        spread.append(part)
    found = xr.concat(
        spread,
        DIMENSION,
        data_vars="minimal",
        coords="minimal",
        compat="override",
        join="override",
        combine_attrs="override",
    )
    masks = [part[MASK] != 0 for part in parts if MASK in part.data_vars]
    return found.assign({MASK: functools.reduce(operator.and_, masks)}) if masks else found


def _sizes_here(part: xr.Dataset, sizes: Mapping[str, int]) -> dict[str, int]:
    """Sizes of a block along the dimensions of its map."""
    return {dim: part.sizes[dim] for dim in sizes if dim in part.sizes}
