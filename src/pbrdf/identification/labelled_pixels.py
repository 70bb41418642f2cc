"""Which material each pixel of an image really is, from a file of labels; and what it was taken for.

A file of labels is netCDF with a variable ``material``, ``labels`` or ``label`` over the image, an array of NumPy
(``.npy``), or what :func:`pbrdf.instruments.pixel_geometry.labels.read_labels` takes: a picture of whole numbers, or
regions with names. Labels are names of materials, or numbers: where nothing names these (``flag_values`` and
``flag_meanings``), 1 is the library's first material. 0 and the empty name are no label. A name that the library has
not got is an unknown material.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pbrdf.data.alignment import require_same_labels
from pbrdf.data.schema import DIMENSION, STOKES_AXES, VARIABLES
from pbrdf.errors import DataError
from pbrdf.identification.class_map import NOT_MEASURED
from pbrdf.identification.confusion import Confusion, table_of
from pbrdf.instruments.pixel_geometry.labels import read_labels

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["image_of", "judge_pixels", "read_material_labels"]

#: Variables that hold labels, the first that is there.
_VARIABLES = ("material", "labels", "label")
#: Names that are no label.
_NO_LABEL = ("", "not_measured")


def read_material_labels(path: Path, like: xr.DataArray) -> xr.DataArray:
    """Labels of an image's pixels.

    Parameters
    ----------
    path
        The file.
    like
        Something over the image, for the names of its dimensions and their sizes.

    Returns
    -------
    DataArray
        Names, or numbers with ``flag_values`` and ``flag_meanings`` where they have names, over the dimensions of the
        image.

    Raises
    ------
    DataError
        If the file cannot be read, or is not of this image.
    """
    import xarray as xr

    kind = path.suffix.lower()
    if kind in (".nc", ".nc4", ".zarr"):
        found = _variable(path)
        if set(found.dims) != set(like.dims) or found.transpose(*like.dims).shape != like.shape:
            raise DataError(f"{path}: {found.name} is over {_shape(found)}, the image over {_shape(like)}")
        require_same_labels(found, str(path), like, "the image", map(str, like.dims))
        return found.transpose(*like.dims)
    if kind == ".npy":
        array = _array(path)
        if array.shape != like.shape:
            raise DataError(f"{path}: its shape is {array.shape}, the image is over {_shape(like)}")
        return xr.DataArray(array, dims=like.dims)
    if like.ndim != 2:
        raise DataError(
            f"{path}: a picture has two dimensions, the image is over {_shape(like)}: give netCDF"
        )
    found = read_labels(path, *like.shape)
    return found.rename(dict(zip(found.dims, like.dims, strict=True)))


def image_of(dataset: xr.Dataset) -> xr.DataArray:
    """A variable of a map over its image alone, for the names of the dimensions and their sizes."""
    name = next(name for name in ("estimate", *VARIABLES) if name in dataset.data_vars)
    array = dataset[name]
    return array.isel({d: 0 for d in array.dims if d in ("parameter", DIMENSION, *STOKES_AXES)})


def judge_pixels(found: xr.Dataset, labels: xr.DataArray) -> Confusion:
    """What the pixels of an image of known materials are taken for.

    Parameters
    ----------
    found
        As :func:`pbrdf.identify_map` gives it.
    labels
        Over the same image: names, or numbers, as the module's text describes them.

    Raises
    ------
    DataError
        If no pixel that was measured has a label, or the labels are of other pixels.
    """
    image = found["material"]
    require_same_labels(labels, "the labels", image, "the map", map(str, image.dims))
    names = [str(name) for name in found["material_name"].values]
    truth, strangers = _numbered(labels.transpose(*image.dims), names)
    judged = (truth >= 0) & (image.values != NOT_MEASURED)
    if not judged.any():
        raise DataError("no pixel that was measured has a label")
    over = ("material_name", *image.dims)
    probability, inside = (
        found[name].transpose(*over).values[:, judged].T for name in ("probability", "in_set")
    )
    at = float(found.attrs["confidence"])
    return table_of(names, truth[judged], probability, inside.astype(bool), at, strangers)


def _numbered(labels: xr.DataArray, names: Sequence[str]) -> tuple[np.ndarray, list[str]]:
    """Numbers of the true materials, those of the library first, -1 for no label; and the others' names."""
    values = labels.values
    seen, places = np.unique(values, return_inverse=True)
    if values.dtype.kind in "iub":
        said = [_named(int(value), labels, names) for value in seen]
    elif values.dtype.kind in "fc":
        raise DataError(f"labels are names or whole numbers, these are of the type {values.dtype}")
    else:
        said = [str(value).strip() for value in seen]
    # a list of meanings has no blanks within a name
    plain = {"_".join(name.split()): number for number, name in enumerate(names)}
    strangers: list[str] = []
    numbers = np.empty(len(seen), dtype=int)
    for place, name in enumerate(said):
        if name in _NO_LABEL:
            numbers[place] = -1
        elif "_".join(name.split()) in plain:
            numbers[place] = plain["_".join(name.split())]
        else:
            if name not in strangers:
                strangers.append(name)
            numbers[place] = len(names) + strangers.index(name)
    return numbers[places].reshape(values.shape), strangers


def _named(value: int, labels: xr.DataArray, names: Sequence[str]) -> str:
    """Name of a number: as stated, else the library's first material is 1."""
    stated = np.atleast_1d(labels.attrs.get("flag_values", []))
    meanings = str(labels.attrs.get("flag_meanings", "")).split()
    named = dict(zip(map(int, stated), meanings, strict=False)).get(value)
    # a picture of numbers names them by themselves
    if named is not None and named != str(value):
        return named
    if value == 0:
        return ""
    return names[value - 1] if 1 <= value <= len(names) else f"label {value}"


def _variable(path: Path) -> xr.DataArray:
    """The variable of labels in a file."""
    from pbrdf.data.formats.zarr_folder import open_zarr
    from pbrdf.files.netcdf_files import open_netcdf

    opened = (open_zarr if path.suffix.lower() == ".zarr" else open_netcdf)(path, decode_times=False)
    for name in _VARIABLES:
        if name in opened.variables:
            return opened[name].load()
    raise DataError(
        f"{path}: labels are a variable {' or '.join(_VARIABLES)}; it has {', '.join(map(str, opened.variables))}"
    )


def _array(path: Path) -> np.ndarray:
    try:
        return np.asarray(np.load(path, allow_pickle=False))
    except FileNotFoundError as error:
        raise DataError(f"{path}: there is no such file") from error
    except Exception as error:  # the library raises anything over a damaged file
        raise DataError(f"{path}: this is not an array of NumPy, or a damaged one: {error}") from error


def _shape(array: xr.DataArray) -> str:
    return ", ".join(f"{name} ({size})" for name, size in array.sizes.items())
