"""What pictures and tables show of a map of parameters: every pixel of a small one, every n-th of a large one.

A map of 10⁸ pixels lies in a store and fits into no memory. It is read with strides, so that what is held has the size
of a picture; the store's chunks pass through one after the other. What is shown was fitted there, and is no average
over neighbours.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.errors import DataError
from pbrdf.inversion.parameter_map.layout import UNFITTED
from pbrdf.models.parameters import shown_unit

if TYPE_CHECKING:
    import xarray as xr

    from pbrdf.models.parameters import Parameter

__all__ = ["GOOD", "PENDING", "WITHOUT", "Label", "ShownMap", "Window", "labels_of"]

#: Pixels along a side of a picture, at most.
MOST_PIXELS = 480
#: Points along a line, at most.
_MOST_POINTS = 4000
#: Names of the states of a pixel with a result, and of those that there was nothing to fit to; the map says which
#: number means which.
GOOD, WITHOUT = "converged", ("not_measured", "masked")
#: What a pixel is that no worker has come to.
PENDING = UNFITTED
#: Dimensions that are no pixels.
_NO_PIXELS = ("parameter", "other")


@dataclass(frozen=True)
class Label:
    """How a parameter is written.

    Attributes
    ----------
    name, text
        Its name, and as a person reads it, with the symbol.
    description
        What it means; empty if the map does not say.
    factor, unit
        From the map's numbers to those shown, and the unit of the latter; empty for pure numbers.
    """

    name: str
    text: str
    description: str
    factor: float
    unit: str

    @property
    def with_unit(self) -> str:
        """Name and unit."""
        return f"{self.text}, {self.unit}" if self.unit else self.text


def labels_of(dataset: xr.Dataset) -> list[Label]:
    """Of the parameters of a map, in their order."""
    known = _declared(dataset)
    # Zarr gives text another type than NumPy's
    units = [str(unit) for unit in dataset["unit"].values] if "unit" in dataset.coords else None
    labels = []
    for k, name in enumerate(map(str, dataset["parameter"].values)):
        parameter = known.get(name)
        unit = str(units[k]) if units is not None else (parameter.unit if parameter is not None else "")
        factor = 1.0
        if parameter is not None and unit == parameter.unit:
            factor, unit = shown_unit(parameter)
        elif unit == "rad":
            factor, unit = 180.0 / math.pi, "°"
        text = name if parameter is None or parameter.symbol == name else f"{parameter.symbol} ({name})"
        description = "" if parameter is None else parameter.description
        labels.append(Label(name, text, description, factor, "" if unit == "1" else unit))
    return labels


def _declared(dataset: xr.Dataset) -> Mapping[str, Parameter]:
    """Parameters that the map's model declares; none if the model is not known here."""
    from pbrdf.errors import PbrdfError
    from pbrdf.models import find_model

    try:
        name = json.loads(str(dataset.attrs["model"]))["model"]
        return {p.name: p for p in find_model(name).parameters}
    except (KeyError, TypeError, ValueError, PbrdfError):
        return {}


@dataclass(frozen=True)
class Window:
    """Which pixels of a map are shown.

    Attributes
    ----------
    dims
        Dimensions of the picture, (down, across) or a single one.
    sizes
        Of the whole map along them.
    steps
        Every so many pixels along each.
    others
        Place along the dimensions that the picture does not have.
    """

    dims: tuple[str, ...]
    sizes: tuple[int, ...]
    steps: tuple[int, ...]
    others: Mapping[str, int] = field(default_factory=dict)

    @classmethod
    def of(cls, dataset: xr.Dataset, most: int = MOST_PIXELS) -> Window:
        """The pixels to show of a map: its last two dimensions with more than one pixel, the first of all others."""
        dims = [str(d) for d in dataset["status"].dims]
        if not dims:
            raise DataError("this map has no dimension: it is one fit, which pbrdf.fit shows")
        long = [d for d in dims if dataset.sizes[d] > 1] or dims[-1:]
        shown = long[-2:]
        most = _MOST_POINTS if len(shown) == 1 else most
        sizes = tuple(dataset.sizes[d] for d in shown)
        return cls(
            tuple(shown),
            sizes,
            tuple(max(math.ceil(size / most), 1) for size in sizes),
            {d: 0 for d in dims if d not in shown},
        )

    @property
    def shape(self) -> tuple[int, ...]:
        """Of what is shown."""
        return tuple(math.ceil(size / step) for size, step in zip(self.sizes, self.steps, strict=True))

    def within(self, region: Mapping[str, slice]) -> tuple[dict[str, Any], tuple[slice, ...]] | None:
        """Where to read in a map, and where that goes in a picture.

        Parameters
        ----------
        region
            Part of the map by dimension.

        Returns
        -------
        indices, places
            None if no pixel of the region is shown.
        """
        indices: dict[str, Any] = {}
        for dim, at in self.others.items():
            start, stop, _ = region.get(dim, slice(None)).indices(at + 1)
            if not start <= at < stop:
                return None
            indices[dim] = at
        places = []
        for dim, size, step in zip(self.dims, self.sizes, self.steps, strict=True):
            start, stop, _ = region.get(dim, slice(None)).indices(size)
            first, last = -(-start // step), -(-stop // step)
            if first >= last:
                return None
            indices[dim] = slice(first * step, stop, step)
            places.append(slice(first, last))
        return indices, tuple(places)

    def words(self) -> str:
        """What is not shown; empty if that is nothing."""
        by_step: dict[int, list[str]] = {}
        for dim, step in zip(self.dims, self.steps, strict=True):
            by_step.setdefault(step, []).append(dim)
        parts = [
            f"every {_ordinal(step)} pixel along {' and '.join(dims)}"
            for step, dims in by_step.items()
            if step > 1
        ]
        parts += [f"{dim}: the first only" for dim in self.others]
        return "; ".join(parts)


def _ordinal(number: int) -> str:
    ending = {1: "st", 2: "nd", 3: "rd"}.get(number % 10, "th") if number % 100 not in (11, 12, 13) else "th"
    return f"{number}{ending}"


class ShownMap:
    """The shown pixels of a map, in memory.

    Parameters
    ----------
    dataset
        A map as :func:`pbrdf.fit_map` gives it; its values may be lazy.
    window
        Which pixels; by default those of :meth:`Window.of`.
    empty
        Whether to read nothing yet: for :meth:`update`.

    Attributes
    ----------
    labels
        Of the parameters.
    window
        Which pixels.
    estimate, standard_error, flags
        Shape (parameters, \\*shape), in shown units; flags as the map has them.
    reduced_chi2, degrees_of_freedom, optima, starts
        Shape of the window; NaN and 0 where there is none.
    status
        Shape of the window: place in `states`.
    states, codes
        Names of what a pixel can be, the last one :data:`PENDING`, and the numbers that the map has for the others.
    masks
        Bits of the flags by name.
    """

    def __init__(self, dataset: xr.Dataset, window: Window | None = None, *, empty: bool = False) -> None:
        self.labels = labels_of(dataset)
        self.window = Window.of(dataset) if window is None else window
        status, flags = dataset["status"].attrs, dataset["flags"].attrs
        said = str(status["flag_meanings"]).split()
        self.states = [*(name for name in said if name != PENDING), PENDING]
        self.codes = np.asarray(status["flag_values"]).ravel().astype(int)[[n != PENDING for n in said]]
        names = str(flags["flag_meanings"]).split()
        self.masks = dict(
            zip(names, np.asarray(flags["flag_masks"]).ravel().astype(int).tolist(), strict=True)
        )
        shape = self.window.shape
        self.estimate = np.full((len(self.labels), *shape), np.nan)
        self.standard_error = np.full((len(self.labels), *shape), np.nan)
        self.flags = np.zeros((len(self.labels), *shape), dtype=np.uint8)
        self.reduced_chi2 = np.full(shape, np.nan)
        self.degrees_of_freedom = np.zeros(shape, dtype=np.int32)
        self.optima, self.starts = np.zeros(shape, dtype=np.int16), np.zeros(shape, dtype=np.int16)
        self.status = np.full(shape, len(self.states) - 1, dtype=np.int8)
        steps = zip(self.window.dims, self.window.steps, strict=True)
        self.coordinates = {d: _coordinate(dataset, d, step) for d, step in steps}
        if not empty:
            self.update(dataset, {})

    def update(self, dataset: xr.Dataset, region: Mapping[str, slice]) -> None:
        """Read what a part of the map holds now.

        Parameters
        ----------
        dataset
            The map.
        region
            The part, slices by dimension.
        """
        found = self.window.within(region)
        if found is None:
            return
        indices, place = found

        def read(name: str) -> np.ndarray:
            part = dataset[name].isel(indices)
            return np.asarray(
                part.transpose(*(d for d in _NO_PIXELS if d in part.dims), *self.window.dims).values
            )

        factors = np.array([label.factor for label in self.labels]).reshape(-1, *(1,) * len(place))
        self.estimate[:, *place] = factors * read("estimate")
        self.standard_error[:, *place] = factors * read("standard_error")
        self.flags[:, *place] = np.nan_to_num(read("flags")).astype(np.uint8)
        freedom = np.nan_to_num(read("degrees_of_freedom"))
        self.degrees_of_freedom[place] = freedom
        self.optima[place], self.starts[place] = (np.nan_to_num(read(n)) for n in ("optima", "starts"))
        self.reduced_chi2[place] = read("chi2") / np.where(freedom > 0, freedom, np.nan)
        codes = read("status")
        # where a fill value is no known state, nobody has been there yet
        states = np.full(codes.shape, len(self.states) - 1, dtype=np.int8)
        for k, code in enumerate(self.codes):
            states[codes == code] = k
        self.status[place] = states

    def state(self, name: str) -> np.ndarray:
        """Where pixels are in this state."""
        return (
            self.status == self.states.index(name)
            if name in self.states
            else np.zeros(self.status.shape, bool)
        )

    @property
    def good(self) -> np.ndarray:
        """Pixels with a result."""
        return self.state(GOOD)

    @property
    def pending(self) -> np.ndarray:
        """Pixels that no worker has come to."""
        return self.state(PENDING)

    @property
    def masked(self) -> np.ndarray:
        """Pixels that were not measured, or left out."""
        values: np.ndarray = np.logical_or.reduce([self.state(name) for name in WITHOUT])
        return values

    @property
    def searched(self) -> np.ndarray:
        """Pixels with a result that were searched from many starts, not from their neighbours alone."""
        return self.good & (self.starts > 1)

    def flagged(self, *names: str) -> np.ndarray:
        """Which parameters of which pixels with a result have one of these flags."""
        bits = sum(self.masks.get(name, 0) for name in names)
        values: np.ndarray = (self.flags & np.uint8(bits) != 0) & self.good
        return values

    @property
    def at_bounds(self) -> np.ndarray:
        """Which parameters of which pixels lie at a bound."""
        return self.flagged("at_lower_bound", "at_upper_bound")

    def determined(self, parameter: int) -> np.ndarray:
        """Pixels with a result whose data determine a parameter: elsewhere its value means nothing."""
        values: np.ndarray = self.good & ~self.flagged("undetermined")[parameter]
        return values

    def varies(self, parameter: int) -> bool:
        """Whether a parameter differs from pixel to pixel; those that are shared do not."""
        values = self.estimate[parameter][self.good]
        return values.size > 0 and bool(np.ptp(values) > 0.0)


def _coordinate(dataset: xr.Dataset, dim: str, step: int) -> tuple[np.ndarray, str]:
    """Values along a dimension, the numbers of its pixels if the map has none evenly spaced, and what they are."""
    if dim in dataset.coords and dataset[dim].dtype.kind in "iuf":
        values = np.asarray(dataset[dim].values, dtype=float)
        unit = str(dataset[dim].attrs.get("units", "1"))
        between = np.diff(values)
        even = between.size == 0 or np.allclose(between, between[0], rtol=1e-3, atol=0.0)
        if even and np.isfinite(values).all() and (between.size == 0 or between[0] > 0.0) and unit != "1":
            return values[::step], f"{dim}, {unit}"
    return np.arange(0, dataset.sizes[dim], step, dtype=float), f"{dim}, pixels"
