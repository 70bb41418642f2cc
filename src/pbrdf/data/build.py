"""Data sets from NumPy arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from pbrdf.data.covariance import complete_covariance
from pbrdf.data.schema import (
    COVARIANCE,
    DIMENSION,
    NATURAL_LIGHT,
    NORMALISED,
    QUANTITIES,
    STOKES_AXES,
    VARIABLES,
    only_ratios,
    spells_integer,
    std_name,
    variable_dims,
    variable_units,
)
from pbrdf.data.validation import validate
from pbrdf.errors import DataError
from pbrdf.optics.stokes import STOKES

__all__ = ["assemble", "group_labels", "make_dataset"]


def make_dataset(
    theta_i: ArrayLike,
    theta_r: ArrayLike,
    phi: ArrayLike,
    *,
    quantity: str | None = None,
    I: ArrayLike | None = None,  # noqa: E741
    Q: ArrayLike | None = None,
    U: ArrayLike | None = None,
    V: ArrayLike | None = None,
    dolp: ArrayLike | None = None,
    aolp: ArrayLike | None = None,
    mueller: ArrayLike | None = None,
    Q_over_I: ArrayLike | None = None,
    U_over_I: ArrayLike | None = None,
    V_over_I: ArrayLike | None = None,
    mueller_over_m00: ArrayLike | None = None,
    std: Mapping[str, ArrayLike] | None = None,
    covariance: ArrayLike | None = None,
    wavelength: ArrayLike | None = None,
    group: ArrayLike | None = None,
    illumination: Sequence[float] = NATURAL_LIGHT,
    simulated: bool = False,
    attrs: Mapping[str, Any] | None = None,
) -> xr.Dataset:
    """Build and validate a data set; :mod:`pbrdf.data.schema` says what its parts mean.

    Give one of the five forms: `I` with any of `Q`, `U`, `V`; `dolp`, perhaps with `aolp`, `V_over_I` and `I`;
    `mueller`; any of `Q_over_I`, `U_over_I`, `V_over_I`, perhaps with `I`; or `mueller_over_m00`, perhaps with `I`.
    NaN marks what was not measured.

    Parameters
    ----------
    theta_i, theta_r, phi
        Angles in radians, φ = 0 forward; scalars or shape (N,), broadcast against each other.
    quantity
        ``"brdf"`` (1/sr), ``"reflectance_factor"``, ``"radiance"``, ``"dn"`` or, for ratios alone, ``"normalised"``,
        for which None stands.
    I, Q, U, V, dolp, aolp
        Shape (N,) or scalars. Q = I_p − I_s; `aolp` in radians.
    mueller
        Shape (N, 4, 4), indexed [row, outgoing Stokes, incident Stokes].
    Q_over_I, U_over_I, V_over_I
        Normalised Stokes parameters, shape (N,) or scalars.
    mueller_over_m00
        Mueller matrices divided by their element m00, shape (N, 4, 4).
    std
        Standard uncertainties by the name of the variable they belong to, in that variable's unit and
        shape (or broadcast to it).
    covariance
        Of the errors of I, Q, U, V (these four in this order, NaN for what was not measured or is not known),
        shape (N, 4, 4), or (4, 4) for all rows, in the square of the data's unit. It fills the standard
        uncertainties that `std` does not state; those that it states must agree with the diagonal.
    wavelength
        Nanometres, shape (N,) or a scalar; None leaves the coordinate out.
    group
        Integers or text, shape (N,) or a scalar; None is 0 everywhere. Labels that all spell integers
        are stored as integers.
    illumination
        Stokes vector of the source, p − s convention.
    simulated
        Whether a model produced the numbers.
    attrs
        Further attributes, such as ``title``, ``source``, ``reference``, ``instrument``.

    Returns
    -------
    xarray.Dataset
        A new data set that owns its arrays.

    Raises
    ------
    DataError
        If shapes do not fit or the result breaks the schema; all problems are listed.

    Examples
    --------
    >>> import numpy as np
    >>> ds = make_dataset(np.deg2rad([30, 45]), np.deg2rad([30, 45]), 0.0, quantity="brdf", I=[0.2, 0.3])
    >>> ds.sizes["geometry"]
    2
    """
    given = {"I": I, "Q": Q, "U": U, "V": V, "dolp": dolp, "aolp": aolp, "mueller": mueller}
    given |= {"Q_over_I": Q_over_I, "U_over_I": U_over_I, "V_over_I": V_over_I}
    given["mueller_over_m00"] = mueller_over_m00
    channels = {name: value for name, value in given.items() if value is not None}
    if quantity is None:
        if not only_ratios(channels):
            raise DataError(f"state the quantity, one of {', '.join(QUANTITIES)}")
        quantity = NORMALISED
    ds = assemble(
        {"theta_i": theta_i, "theta_r": theta_r, "phi": phi, "wavelength": wavelength, "group": group},
        channels,
        std or {},
        {
            "quantity": quantity,
            "illumination": [float(x) for x in illumination],
            "simulated": int(simulated),
            **(attrs or {}),
        },
        covariance,
    )
    validate(ds)
    return ds


def assemble(
    coordinates: Mapping[str, ArrayLike | None],
    channels: Mapping[str, ArrayLike],
    std: Mapping[str, ArrayLike],
    attrs: Mapping[str, Any],
    covariance: ArrayLike | None = None,
) -> xr.Dataset:
    """Put arrays into the form of the schema without judging their values (readers do that later)."""
    quantity = attrs["quantity"]
    if quantity not in QUANTITIES:
        raise DataError(f"the quantity {quantity!r} is not known; use one of {', '.join(QUANTITIES)}")
    strangers = [name for name in (*channels, *std) if name not in VARIABLES]
    if strangers:
        raise DataError(f"no data variable is called {strangers[0]!r}; use one of {', '.join(VARIABLES)}")
    orphans = [name for name in std if name not in channels]
    if orphans:
        raise DataError(f"there is an uncertainty of {orphans[0]} but no {orphans[0]}")

    rows = _row_count({**coordinates, **channels, COVARIANCE: covariance})
    if covariance is not None:
        covariance, std = complete_covariance(covariance, rows, std, channels)
    coords: dict[str, Any] = {}
    for name, value in coordinates.items():
        if name == "group":
            labels = group_labels(0 if value is None else value)
            coords[name] = (DIMENSION, _broadcast(name, labels, (rows,)))
        elif value is not None:
            units = {"units": variable_units(name, quantity)}
            coords[name] = (DIMENSION, _broadcast(name, _floats(name, value), (rows,)), units)

    data: dict[str, Any] = {}
    for name, value, owner in [
        *((name, value, name) for name, value in channels.items()),
        *((std_name(name), value, name) for name, value in std.items()),
    ]:
        dims = variable_dims(owner)
        shape = (rows,) if len(dims) == 1 else (rows, 4, 4)
        array = _broadcast(name, _floats(name, value), shape)
        data[name] = (dims, array, {"units": variable_units(name, quantity)})
    if covariance is not None:
        units = {"units": variable_units(COVARIANCE, quantity)}
        data[COVARIANCE] = (variable_dims(COVARIANCE), covariance, units)
    used = {dim for dims, *_ in data.values() for dim in dims}
    coords |= {axis: list(STOKES) for axis in STOKES_AXES if axis in used}
    return xr.Dataset(data, coords, {"stokes_convention": "p-s", **attrs})


def group_labels(values: ArrayLike) -> NDArray[Any]:
    """Integers (int64) where all labels are or spell integers, else text.

    Raises
    ------
    DataError
        If a label is neither an integer nor text.
    """
    array = np.asarray(values)
    if array.dtype.kind in "iu":
        return array.astype(np.int64)
    if array.dtype.kind == "U":
        return _text_labels(array)
    flat = array.ravel().tolist()
    if not all(isinstance(label, str) for label in flat):
        if all(isinstance(label, int | float) and float(label).is_integer() for label in flat):
            return array.astype(np.int64)
        raise DataError("group labels are integers or text")
    if flat and all(spells_integer(label) for label in flat):
        return array.astype(np.int64)
    return array.astype(np.str_)


def _text_labels(array: NDArray[np.str_]) -> NDArray[Any]:
    """As :func:`group_labels`; few labels come many times."""
    if not array.size or not spells_integer(array.flat[0]):
        return array.copy()
    flat = array.ravel().tolist()
    numbers = {label: int(label) for label in set(flat) if spells_integer(label)}
    if len(numbers) < len(set(flat)):
        return array.copy()
    return np.array([numbers[label] for label in flat], dtype=np.int64).reshape(array.shape)


def _floats(name: str, value: ArrayLike) -> NDArray[np.float64]:
    try:
        return np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise DataError(f"{name} does not hold real numbers: {error}") from error


def _row_count(arrays: Mapping[str, ArrayLike | None]) -> int:
    lengths = set()
    for name, value in arrays.items():
        shape = np.shape(value) if value is not None else ()
        if len(shape) == (3 if name in ("mueller", "mueller_over_m00", COVARIANCE) else 1):
            lengths.add(shape[0])
    return max(lengths - {1}, default=1)


def _broadcast(name: str, array: NDArray[Any], shape: tuple[int, ...]) -> NDArray[Any]:
    try:
        return np.broadcast_to(array, shape).copy()
    except ValueError:
        raise DataError(f"{name} has the shape {array.shape}, but {shape} is needed here") from None
