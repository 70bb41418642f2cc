"""The settings of a map of parameters, checked once, and the fit of a block of its pixels."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from pbrdf.data.schema import (
    COORDINATES,
    COVARIANCE,
    DIMENSION,
    STOKES_AXES,
    VARIABLES,
    std_name,
    variable_dims,
)
from pbrdf.data.validation import validate
from pbrdf.errors import DataError, FitError
from pbrdf.inversion.noise import Noise, parse_noise
from pbrdf.inversion.nuisance import Nuisance
from pbrdf.inversion.observations import Observations, noise_in_words
from pbrdf.inversion.parameter_map.ends import Ends, Pixels
from pbrdf.inversion.parameter_map.layout import PixelStatus, broadcast_map, empty_map, template
from pbrdf.inversion.parameter_map.search import fit_pixels
from pbrdf.inversion.parameter_map.spread import spread_of
from pbrdf.inversion.problem import Space
from pbrdf.inversion.solver import Status
from pbrdf.inversion.stack import Stack
from pbrdf.inversion.unknowns import bounds_of_each, check_choices, space_of, with_terms
from pbrdf.models import DoubleGauss, Model
from pbrdf.version import __version__

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["LABEL", "MASK", "MapFit"]

#: Variables over the image that are no measurement: which pixels are fitted, the part of the sample each belongs to.
MASK, LABEL = "mask", "label"
#: Changes whenever the same settings would give other numbers or another form.
LAYOUT = 1
_ANGLES = ("theta_i", "theta_r", "phi")
_MEASURED = {*VARIABLES, *map(std_name, VARIABLES), COVARIANCE}


@dataclass(frozen=True, eq=False)
class MapFit:
    """How a map is fitted: made by :meth:`prepare`; knows no file, and holds no values of the data.

    Attributes
    ----------
    dims
        The dimensions beside ``geometry``: those of the image.
    settings
        Everything that decides the numbers, as JSON can hold it.
    space
        The free parameters; bounds that follow from the data are those of values of 1.
    """

    dims: tuple[str, ...]
    settings: dict[str, Any]
    space: Space
    _sizes: dict[str, int]
    _coords: dict[str, Any]
    _given: dict[str, Any]

    @classmethod
    def prepare(
        cls,
        dataset: xr.Dataset,
        model: type[Model] | Model | str = DoubleGauss,
        *,
        options: Mapping[str, str] | None = None,
        fix: Mapping[str, float] | None = None,
        free: Sequence[str] = (),
        bounds: Mapping[str, tuple[float, float]] | None = None,
        start: Mapping[str, float] | None = None,
        priors: Mapping[str, tuple[float, float]] | None = None,
        nuisances: Sequence[Nuisance | str] = (),
        loss: str = "linear",
        starts: int = 64,
        noise: Noise | str | None = None,
        objective: str = "stokes",
        covariance: ArrayLike | None = None,
        seed: int = 0,
        max_iterations: int = 100,
        share: Sequence[str] = (),
        labels: str | None = None,
        correlation: bool = False,
    ) -> MapFit:
        """Check the settings against the names, dimensions, sizes and types of a data set; no values are loaded.

        Parameters
        ----------
        dataset
            As for :func:`~pbrdf.inversion.parameter_map.fit_map.fit_map`.
        labels
            Name of the variable of the data set that holds the labels.
        model, options, fix, free, bounds, start, priors, nuisances, loss, starts, noise, objective, covariance, seed, \
max_iterations, share, correlation
            As for :func:`~pbrdf.inversion.parameter_map.fit_map.fit_map`.

        Raises
        ------
        FitError, DataError, ModelError
            If the options or the form of the data do not allow a fit; the message says why.
        """
        if isinstance(noise, str):
            noise = parse_noise(noise)
        check_choices(starts, loss, objective)
        dims = _image_dims(dataset, labels)
        form = _form(dataset, dims)
        terms = [Nuisance.parse(n) if isinstance(n, str) else n for n in nuisances]
        like = Observations.from_dataset(form, noise, objective)
        if covariance is not None:
            covariance = np.asarray(covariance, dtype=float)
            like.with_covariance(covariance)
        space, begin = space_of(model, options or {}, fix or {}, free, bounds or {}, start or {}, like)
        space = with_terms(space, like, priors or {}, {}, terms, bounds or {}, loss)
        if like.count <= len(space.free):
            raise FitError(
                f"{like.count} measured values cannot determine {len(space.free)} parameters: measure "
                "more, or fix parameters"
            )
        share = (share,) if isinstance(share, str) else tuple(share)
        for name in share:
            if name not in space.names:
                raise FitError(f"share: {name!r} is not a free parameter; free are {', '.join(space.names)}")
        shown = space.build(0.5 * (space.lower + space.upper))
        settings = {
            "layout": LAYOUT,
            "version": __version__,
            "model": space.model.name,
            "options": dict(shown.chosen),
            "fixed": dict(space.fixed),
            "free": space.names,
            "bounds": {name: [float(v) for v in pair] for name, pair in (bounds or {}).items()},
            "begin": begin,
            "start": {name: float(v) for name, v in (start or {}).items()},
            "priors": {name: [float(v) for v in pair] for name, pair in (priors or {}).items()},
            "nuisances": [[t.kind, t.per_group, None if t.prior is None else list(t.prior)] for t in terms],
            "loss": loss,
            "starts": int(starts),
            "noise": None if noise is None else repr(noise),
            "objective": objective,
            "covariance": None if covariance is None else hashlib.sha256(covariance.tobytes()).hexdigest(),
            "seed": int(seed),
            "max_iterations": int(max_iterations),
            "share": list(share),
            "labels": labels,
            "correlation": bool(correlation),
        }
        given = {
            "begin": begin,
            "start": dict(start or {}),
            "bounds": dict(bounds or {}),
            "noise": noise,
            "objective": objective,
            "covariance": covariance,
            "words": _words(noise, covariance, like, dataset),
        }
        coords = {
            name: dataset.coords[name]
            for name in map(str, dataset.coords)
            if name not in (*COORDINATES, *STOKES_AXES)
            and set(dataset.coords[name].dims) <= set(dims)
            and (name in dims or _in_memory(dataset.coords[name]))
        }
        return cls(dims, settings, space, {d: dataset.sizes[d] for d in dims}, coords, given)

    @property
    def attrs(self) -> dict[str, Any]:
        """Attributes of the map that its settings decide."""
        described = {
            "model": self.settings["model"],
            "options": self.settings["options"],
            "fixed": self.settings["fixed"],
        }
        return {
            "model": json.dumps(described, ensure_ascii=False),
            "settings": json.dumps(self.settings, ensure_ascii=False),
            "noise": self._given["words"],
        }

    def template(self) -> xr.Dataset:
        """The map before any pixel was fitted: its form, coordinates and attributes, in no memory.

        Every value is NaN, and ``status`` is :data:`~pbrdf.inversion.parameter_map.layout.PENDING`.
        """
        shape = [self._sizes[d] for d in self.dims]
        arrays = broadcast_map(len(self.space.free), shape, self.settings["correlation"])
        return self._assembled(arrays, self._coords)

    def _assembled(self, arrays: Mapping[str, Any], coords: Mapping[str, Any]) -> xr.Dataset:
        names = self.space.names
        own: dict[str, Any] = {
            "parameter": names,
            "unit": ("parameter", [p.unit for p in self.space.free]),
        }
        if self.settings["correlation"]:
            own["other"] = names
        return template(arrays, self.dims, {**coords, **own}, self.attrs)

    def fit_block(self, block: xr.Dataset, progress: Callable[[int, int], None] | None = None) -> xr.Dataset:
        """Load and fit a block of pixels: the same numbers whoever does it, whatever lies around the block.

        Parameters
        ----------
        block
            Part of the data set along the image's dimensions.
        progress
            Called with the number of pixels that are done and of all.

        Returns
        -------
        Dataset
            That part of the map.

        Raises
        ------
        DataError
            If directions that all pixels share are none. What is wrong at a pixel is left out there.
        """
        shape = [block.sizes[d] for d in self.dims]
        arrays = empty_map(len(self.space.free), shape, self.settings["correlation"])
        flat = {
            name: values.reshape(*values.shape[: values.ndim - len(shape)], -1)
            for name, values in arrays.items()
        }
        status = flat["status"]
        status[:] = int(PixelStatus.NOT_MEASURED)
        wanted = self._wanted(block).ravel()
        status[~wanted] = int(PixelStatus.MASKED)
        stack = self._stack(block) if wanted.any() else None
        if stack is not None:
            self._fit_stack(stack, shape, wanted, flat, progress)
        if progress is not None:
            progress(status.size, status.size)
        coords = {name: block.coords[name] for name in self._coords if name in block.coords}
        return self._assembled(arrays, coords)

    def _fit_stack(
        self,
        stack: Stack,
        shape: Sequence[int],
        wanted: np.ndarray,
        flat: Mapping[str, np.ndarray],
        progress: Callable[[int, int], None] | None,
    ) -> None:
        """Fit what was measured at the pixels of a block, into its arrays."""
        status, size = flat["status"], len(self.space.free)
        count = stack.count
        freedom = count - size
        flat["degrees_of_freedom"][:] = np.where(wanted, np.maximum(freedom, 0), 0)
        few = wanted & (count > 0) & ((freedom <= 0) | (stack.different_values() < size))
        status[few] = int(PixelStatus.TOO_FEW_VALUES)
        usable = np.flatnonzero(wanted & (count > 0) & ~few)
        if not len(usable):
            return
        if len(usable) < len(stack):
            stack = stack.take(usable)
        pixels = self._pixels(stack)
        places = np.stack(np.unravel_index(usable, shape), axis=1)
        total = status.size
        report = None if progress is None else lambda done: progress(total - len(usable) + done, total)
        ends = fit_pixels(pixels, shape, places, freedom[usable], stack.std_known, report)
        self._store(ends, pixels, freedom[usable], usable, flat)

    def _pixels(self, stack: Stack) -> Pixels:
        lower, upper = bounds_of_each(self.space, stack, self._given["bounds"])
        return Pixels(
            self.space,
            stack,
            self.space.to_unknowns(lower),
            self.space.to_unknowns(upper),
            self._given["begin"],
            self._given["start"],
            self.settings["starts"],
            self.settings["seed"],
            self.settings["max_iterations"],
        )

    def _store(
        self,
        ends: Ends,
        pixels: Pixels,
        freedom: np.ndarray,
        usable: np.ndarray,
        flat: Mapping[str, np.ndarray],
    ) -> None:
        """Estimates and all that is said of them, into the arrays of a block."""
        space, reached = self.space, ends.reached
        converged = np.isin(ends.status, [s for s in Status if s.converged])
        chi2 = 2.0 * ends.cost
        scale = np.where(pixels.stack.std_known, 1.0, chi2 / freedom)
        spread = spread_of(ends.u, ends.information, pixels.low, pixels.high, scale)
        lower, upper = space.to_parameters(pixels.low), space.to_parameters(pixels.high)
        values = np.clip(space.to_parameters(ends.u), lower, upper)
        error = spread.error * space.derivative(values)
        trusted = converged[:, None] & (spread.flags == 0)
        flat["estimate"][:, usable] = np.where(reached[:, None], values, np.nan).T
        flat["standard_error"][:, usable] = np.where(trusted, error, np.nan).T
        flat["flags"][:, usable] = np.where(reached[:, None], spread.flags, 0).T
        flat["chi2"][usable] = np.where(reached, chi2, np.nan)
        flat["optima"][usable] = ends.optima
        flat["starts"][usable] = np.minimum(ends.starts, np.iinfo(np.int16).max)
        flat["status"][usable] = np.where(
            converged,
            int(PixelStatus.CONVERGED),
            np.where(reached, int(PixelStatus.NOT_CONVERGED), int(PixelStatus.FAILED)),
        )
        if self.settings["correlation"]:
            with np.errstate(divide="ignore", invalid="ignore"):
                unit = 1.0 / spread.error
                found = spread.covariance * unit[:, :, None] * unit[:, None, :]
            # a parameter grows with its unknown: their correlations are the same
            flat["correlation"][..., usable] = np.moveaxis(found, 0, -1)

    def _wanted(self, block: xr.Dataset) -> np.ndarray:
        """Which pixels of a block are to be fitted, of the image's shape."""
        shape = tuple(block.sizes[d] for d in self.dims)
        wanted = np.ones(shape, dtype=bool)
        for name in (MASK, self.settings["labels"]):
            if name is not None and name in block.variables:
                wanted &= block[name].transpose(*self.dims).values != 0
        return wanted

    def _stack(self, block: xr.Dataset) -> Stack | None:
        """What was measured at the pixels of a block; None where nothing was."""
        shape = tuple(block.sizes[d] for d in self.dims)
        angles = {name: _columns(block[name].variable, self.dims, shape, shared=True) for name in _ANGLES}
        for name in _ANGLES[:2]:
            shared = angles[name]
            if shared.shape[1] == 1 and not ((shared >= 0.0) & (shared < 0.5 * np.pi)).all():
                raise DataError(
                    f"{name} of a geometry that all pixels share is not in [0°, 90°): give radians, and leave the "
                    "geometry out where there is no direction"
                )
        wide = max(values.shape[1] for values in angles.values())
        if wide > 1:
            angles = {n: np.broadcast_to(v, (len(v), wide)) for n, v in angles.items()}
        columns = {
            name: _columns(block[name].variable, self.dims, shape)
            for name in map(str, block.data_vars)
            if name in _MEASURED
        }
        try:
            return Stack.from_columns(
                columns,
                angles,
                block.attrs["quantity"],
                block.attrs["illumination"],
                noise=self._given["noise"],
                objective=self._given["objective"],
                covariance=self._given["covariance"],
                group=block["group"].values,
                wavelength=block["wavelength"].values if "wavelength" in block.coords else None,
            )
        except FitError:
            if any(np.isfinite(columns[name]).any() for name in columns if name in VARIABLES):
                raise
            return None


def _columns(
    variable: xr.Variable, dims: Sequence[str], shape: tuple[int, ...], *, shared: bool = False
) -> np.ndarray:
    """Values of a variable with the geometries first and the pixels last, shape (…, G, B).

    With ``shared``, (G, 1) where all pixels share them.
    """
    here = [d for d in dims if d in variable.dims]
    front = [d for d in variable.dims if d not in (*dims, DIMENSION)]
    values = np.asarray(variable.transpose(*front, DIMENSION, *here).values)
    head = values.shape[: values.ndim - len(here)]
    if shared and not here:
        return values[..., None]
    if len(here) < len(dims):
        sizes = [n if d in here else 1 for d, n in zip(dims, shape, strict=True)]
        values = np.broadcast_to(values.reshape(*head, *sizes), (*head, *shape))
    return values.reshape(*head, -1)


def _image_dims(dataset: xr.Dataset, labels: str | None) -> tuple[str, ...]:
    """The dimensions beside ``geometry``; DataError where there are none, or variables do not go with them."""
    used = {str(d) for name in map(str, dataset.data_vars) if name in _MEASURED for d in dataset[name].dims}
    dims = tuple(str(d) for d in dataset.sizes if d in used and d not in (DIMENSION, *STOKES_AXES))
    if not dims:
        raise DataError(
            f"the data have no dimension beside {DIMENSION!r} along which to fit a map, such as y and x: fit a single "
            "data set with pbrdf.fit"
        )
    if labels is not None and labels not in dataset.variables:
        raise DataError(f"labels: the data set has no variable {labels!r}; it has {_listed(dataset)}")
    for name in (MASK, labels):
        if name is not None and name in dataset.variables:
            variable = dataset[name]
            if set(variable.dims) != set(dims) or variable.dtype.kind not in "biu":
                raise DataError(
                    f"{name} has the dimensions {variable.dims} and the type {variable.dtype}: it needs {dims} and "
                    "integers (0 leaves a pixel out)"
                )
    return dims


def _form(dataset: xr.Dataset, dims: Sequence[str]) -> xr.Dataset:
    """A data set of the same form for one pixel, every value 1; DataError where the schema has no such form."""
    import xarray as xr

    size = dataset.sizes.get(DIMENSION, 0)
    variables: dict[str, Any] = {}
    coords: dict[str, Any] = {}
    for name in map(str, dataset.variables):
        variable = dataset.variables[name]
        own = tuple(map(str, (d for d in variable.dims if d not in dims)))
        if name in _MEASURED:
            wanted = variable_dims(name)
            if set(own) != set(wanted):
                raise DataError(
                    f"{name} has the dimensions {variable.dims}: it needs {wanted} and some of {tuple(dims)}"
                )
            shape = [dataset.sizes[d] for d in wanted]
            ones = np.ones(shape, dtype=variable.dtype)
            if name == COVARIANCE:
                ones[:] = np.eye(4)
            variables[name] = (wanted, ones)
        elif name in _ANGLES and len(own) < len(variable.dims):
            if own != (DIMENSION,):
                raise DataError(
                    f"{name} has the dimensions {variable.dims}: it needs {DIMENSION!r} among them"
                )
            coords[name] = (DIMENSION, np.zeros(size, dtype=variable.dtype))
        elif name in COORDINATES:
            if own != variable.dims:
                raise DataError(
                    f"{name} has the dimensions {variable.dims}: all pixels share it, so it needs {DIMENSION!r} alone"
                )
            coords[name] = (variable.dims, variable.values)
        elif name in STOKES_AXES:
            coords[name] = (variable.dims, variable.values)
        elif name in dataset.data_vars and (own or (name != MASK and variable.dtype.kind not in "biu")):
            variables[name] = (variable.dims, np.empty([0] * variable.ndim))
    form = xr.Dataset(coords=coords, attrs=dataset.attrs)
    # beside each other, not aligned: the schema is to judge them
    for name, (at, values) in variables.items():
        form[name] = (at, values) if name in _MEASURED else ((), 0.0)
    validate(form)
    return form


def _listed(dataset: xr.Dataset) -> str:
    return ", ".join(map(str, dataset.variables))


def _in_memory(array: xr.DataArray) -> bool:
    """Whether a variable holds its values: small things beside the data are kept with the map, others not."""
    return isinstance(array.variable._data, np.ndarray)


def _words(
    noise: Noise | None, covariance: np.ndarray | None, like: Observations, dataset: xr.Dataset
) -> str:
    """Where the uncertainties come from."""
    if covariance is not None:
        return "stated: the covariance of the components"
    if noise is None and COVARIANCE in dataset.data_vars:
        return "covariances of the data set"
    return noise_in_words(noise, like)
