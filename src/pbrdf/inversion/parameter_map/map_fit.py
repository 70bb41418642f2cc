"""The settings of a map of parameters, checked once, and the fit of a block of its pixels."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from pbrdf.data.formats.attributes import plain_attributes
from pbrdf.data.schema import (
    COORDINATES,
    COVARIANCE,
    DIMENSION,
    STOKES_AXES,
    std_name,
    variable_dims,
)
from pbrdf.data.validation import validate
from pbrdf.errors import DataError, FitError
from pbrdf.inversion.held_values import Held
from pbrdf.inversion.noise import Noise, parse_noise
from pbrdf.inversion.nuisance import Nuisance
from pbrdf.inversion.observations import Observations, noise_in_words
from pbrdf.inversion.parameter_map.block_stack import ANGLES, MEASURED, stack_of_block
from pbrdf.inversion.parameter_map.ends import Ends, Pixels
from pbrdf.inversion.parameter_map.layout import PixelStatus, broadcast_map, empty_map, template
from pbrdf.inversion.parameter_map.search import fit_pixels
from pbrdf.inversion.parameter_map.shared import Shared, Sums, described, newton, sums_of, with_priors
from pbrdf.inversion.parameter_map.spread import spread_of
from pbrdf.inversion.problem import Space
from pbrdf.inversion.solver import on_bounds
from pbrdf.inversion.stack import Stack
from pbrdf.inversion.starts import sobol_starts
from pbrdf.inversion.unknowns import bounds_of_each, check_choices, space_of, with_terms
from pbrdf.models import DoubleGauss, Model
from pbrdf.optics.stokes import STOKES
from pbrdf.version import __version__

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["LABEL", "MASK", "MapFit"]

#: Variables over the image that are no measurement: which pixels are fitted, the part of the sample each belongs to.
MASK, LABEL = "mask", "label"
#: Changes whenever the same settings would give other numbers or another form.
LAYOUT = 1
#: Pixels of a label from which the shared parameters' starting values are found, and values between their bounds that
#: are tried where single pixels tell nothing.
FEW, BEGINNINGS = 24, 16


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
    shared
        What :meth:`solve_shared` found of the parameters that pixels share; None before, or where there are none.
    """

    dims: tuple[str, ...]
    settings: dict[str, Any]
    space: Space
    _sizes: dict[str, int]
    _coords: dict[str, Any]
    _given: dict[str, Any]
    shared: Shared | None = None

    @classmethod
    def prepare(
        cls,
        dataset: xr.Dataset,
        model: type[Model] | Model | str = DoubleGauss,
        *,
        options: Mapping[str, str] | None = None,
        fix: Mapping[str, Held] | None = None,
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
        share = [share] if isinstance(share, str) else list(dict.fromkeys(share))
        for name in share:
            if name not in space.names:
                raise FitError(f"share: {name!r} is not a free parameter; free are {', '.join(space.names)}")
        own = len(space.free) - len(share)
        if like.count <= own:
            raise FitError(
                f"{like.count} measured values cannot determine {own} parameters of a pixel: measure more, or fix "
                "parameters"
            )
        shown = space.build(0.5 * (space.lower + space.upper))
        settings = {
            "layout": LAYOUT,
            "version": __version__,
            "model": space.model.name,
            "options": dict(shown.chosen),
            "fixed": dict(space.fixed),
            **_by_wavelength(space),
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
            "share": share,
            "labels": labels,
            "correlation": bool(correlation),
        }
        given = {
            "begin": begin,
            "start": dict(start or {}),
            "bounds": dict(bounds or {}),
            "noise": noise,
            "objective": objective,
            "covariance": None if covariance is None else (like.channels, covariance),
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
            **_by_wavelength(self.space),
        }
        if self.space.sources:
            described["sources"] = dict(self.space.sources)
        found = {
            "model": json.dumps(described, ensure_ascii=False),
            "settings": json.dumps(self.settings, ensure_ascii=False),
            "noise": self._given["words"],
        }
        if self.shared is not None:
            found["shared"] = json.dumps(self._told(self.shared), ensure_ascii=False)
        return found

    def _told(self, shared: Shared) -> Mapping[str, Any]:
        """What was found of the shared parameters, for the attributes."""
        own = self._shared_space
        values = own.to_parameters(shared.unknowns)
        spread = np.sqrt(np.einsum("lss->ls", shared.covariance * self._scale(shared)[:, None, None]))
        errors = np.where(spread > 0.0, spread * own.derivative(values), np.nan)
        return described(shared, own.names, values, errors)

    def _scale(self, shared: Shared) -> np.ndarray:
        """What covariances are multiplied with: the reduced χ² of a label, where the uncertainties are a guess."""
        return np.where(shared.std_known, 1.0, shared.chi2 / np.maximum(shared.freedom, 1))

    def template(self) -> xr.Dataset:
        """The map before any pixel was fitted: its form, coordinates and attributes, in no memory.

        Every value is NaN, every count -1, and ``status`` and ``flags`` say that nobody has come yet.
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
        if self.settings["share"] and self.shared is None:
            raise FitError(
                "share: what pixels share must be found first, from all of them: see MapFit.solve_shared"
            )
        shape = [block.sizes[d] for d in self.dims]
        arrays = empty_map(len(self.space.free), shape, self.settings["correlation"])
        flat = {n: v.reshape(*v.shape[: v.ndim - len(shape)], -1) for n, v in arrays.items()}
        part = self._part(block, flat)
        if part is not None:
            total, left = flat["status"].size, flat["status"].size - len(part.usable)
            report = None if progress is None else lambda done: progress(left + done, total)
            pixels = self._pixels(part, None if self.shared is None else self.shared.unknowns)
            ends = fit_pixels(pixels, shape, part.places, part.freedom, part.stack.std_known, report)
            self._store(ends, pixels, part, flat)
        if progress is not None:
            progress(flat["status"].size, flat["status"].size)
        return self._assembled(arrays, {n: block.coords[n] for n in self._coords if n in block.coords})

    def solve_shared(self, blocks: Iterable[xr.Dataset]) -> MapFit:
        """Find what pixels share, from all of them; what is returned fits blocks with it.

        Parameters
        ----------
        blocks
            The blocks of the image, gone through several times; one is held at a time.

        Raises
        ------
        FitError
            If no pixel can be fitted.
        """
        if not self.settings["share"]:
            return self
        few, labels, low, high = self._first_pass(blocks)
        columns = self._shared_columns
        priors = self._shared_space

        def evaluate(theta: np.ndarray, parts: Iterable[_Part]) -> Sums:
            total = Sums.zero(len(labels), len(columns))
            for part in parts:
                pixels = self._pixels(part, theta, labels)
                ends = fit_pixels(pixels, part.shape, part.places, part.freedom, part.stack.std_known)
                inside = ~np.logical_or(*on_bounds(ends.u, pixels.low, pixels.high))
                total = total + sums_of(
                    np.searchsorted(labels, part.label),
                    len(labels),
                    columns,
                    ends.cost,
                    ends.gradient,
                    ends.information,
                    inside,
                    part.freedom + self._own,
                    part.stack.std_known,
                )
            return with_priors(total, priors, theta)

        middle, said = self._middle(few, labels, columns, low, high)
        candidates = [middle]
        if not said:
            # pixels that alone tell nothing: the best of some values between the bounds
            spread = sobol_starts(
                np.zeros(len(columns)), np.ones(len(columns)), BEGINNINGS, self.settings["seed"]
            )
            candidates += [low + one * (high - low) for one in spread]
        begin = middle
        if len(candidates) > 1:
            tried = [evaluate(candidate, few).cost for candidate in candidates]
            best = np.argmin(np.where(np.isfinite(tried), tried, np.inf), axis=0)
            begin = np.stack(candidates)[best, np.arange(len(labels))]
        theta, sums, converged, passes = newton(
            lambda at: evaluate(at, (p for p in map(self._part, blocks) if p is not None)), begin, low, high
        )
        inside = ~np.logical_or(*on_bounds(theta, low, high))
        shared = Shared(
            columns=columns,
            labels=labels,
            unknowns=theta,
            low=low,
            high=high,
            covariance=spread_of(theta, sums.curvature, low, high, np.ones(len(labels))).covariance,
            chi2=2.0 * sums.cost,
            freedom=(sums.values - sums.own - inside.sum(axis=1)).astype(int),
            std_known=sums.guessed == 0,
            converged=converged,
            passes=passes,
        )
        return self.with_shared(shared)

    def with_shared(self, shared: Shared) -> MapFit:
        """The same with what :meth:`solve_shared` has found before."""
        values = self._shared_space.to_parameters(shared.unknowns).tolist()
        found = {str(label): row for label, row in zip(shared.labels.tolist(), values, strict=True)}
        return replace(self, settings={**self.settings, "shared": found}, shared=shared)

    def _first_pass(
        self, blocks: Iterable[xr.Dataset]
    ) -> tuple[list[_Part], np.ndarray, np.ndarray, np.ndarray]:
        """Some pixels of each label; the labels; and the bounds of the shared unknowns, shape (L, S)."""
        columns = self._shared_columns
        limits: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        held: dict[int, int] = {}
        few = []
        for block in blocks:
            part = self._part(block)
            if part is None:
                continue
            pixels, chosen = self._pixels(part), []
            for label in np.unique(part.label).tolist():
                here = np.flatnonzero(part.label == label)
                low, high = (
                    pixels.low[here][:, columns].min(axis=0),
                    pixels.high[here][:, columns].max(axis=0),
                )
                known = limits.get(label, (low, high))
                limits[label] = np.minimum(low, known[0]), np.maximum(high, known[1])
                wanted = min(FEW - held.get(label, 0), len(here))
                if wanted > 0:
                    chosen.append(here[(np.arange(wanted) * len(here)) // wanted])
                    held[label] = held.get(label, 0) + wanted
            if chosen:
                few.append(part.take(np.sort(np.concatenate(chosen))))
        if not limits:
            raise FitError("share: no pixel has enough measured values to be fitted")
        labels = np.array(sorted(limits))
        low, high = (np.stack([limits[label][k] for label in labels.tolist()]) for k in (0, 1))
        return few, labels, low, high

    def _middle(
        self, few: list[_Part], labels: np.ndarray, columns: np.ndarray, low: np.ndarray, high: np.ndarray
    ) -> tuple[np.ndarray, bool]:
        """Median of what single pixels say of the shared unknowns, shape (L, S), and whether they do for each label."""
        said: dict[int, list[np.ndarray]] = {label: [] for label in labels.tolist()}
        for part in few:
            enough = np.flatnonzero(part.freedom + self._own > len(self.space.free))
            if len(enough):
                ends = self._pixels(part).from_many(enough)
                for label, u in zip(part.label[enough].tolist(), ends.u[:, columns], strict=True):
                    said[label].append(u)
        middle = 0.5 * (low + high)
        for row, label in enumerate(labels.tolist()):
            if said[label]:
                middle[row] = np.nanmedian(said[label], axis=0)
        return np.clip(middle, low, high), all(said.values())

    @property
    def _own(self) -> int:
        """Number of parameters that each pixel has of its own."""
        return len(self.space.free) - len(self.settings["share"])

    @property
    def _shared_columns(self) -> np.ndarray:
        """Which of the free parameters pixels share."""
        return np.array([self.space.names.index(name) for name in self.settings["share"]], dtype=int)

    @property
    def _shared_space(self) -> Space:
        """The shared parameters alone, with their priors."""
        columns = self._shared_columns
        return replace(
            self.space,
            free=tuple(self.space.free[c] for c in columns),
            terms=tuple(self.space.terms[c] for c in columns),
            lower=self.space.lower[columns],
            upper=self.space.upper[columns],
        )

    def _part(self, block: xr.Dataset, flat: Mapping[str, np.ndarray] | None = None) -> _Part | None:
        """The pixels of a block that can be fitted, loaded; what the others are, into the arrays of a block."""
        shape = [block.sizes[d] for d in self.dims]
        label = self._labels(block).ravel()
        wanted = label != 0
        stack = None
        if wanted.any():
            given = {name: self._given[name] for name in ("noise", "objective", "covariance")}
            stack = stack_of_block(block, self.dims, **given)
        count = np.zeros(len(label), dtype=int) if stack is None else stack.count
        freedom = count - self._own
        few = wanted & (count > 0) & (freedom <= 0)
        if stack is not None:
            few |= wanted & (count > 0) & (stack.different_values() < self._own)
        if flat is not None:
            status = np.where(wanted, int(PixelStatus.NOT_MEASURED), int(PixelStatus.MASKED))
            flat["status"][:] = np.where(few, int(PixelStatus.TOO_FEW_VALUES), status)
            flat["degrees_of_freedom"][:] = np.where(wanted, np.maximum(freedom, 0), 0)
        usable = np.flatnonzero(wanted & (count > 0) & ~few)
        if stack is None or not len(usable):
            return None
        places = np.stack(np.unravel_index(usable, shape), axis=1)
        stack = stack if len(usable) == len(stack) else stack.take(usable)
        return _Part(stack, shape, usable, places, freedom[usable], label[usable])

    def _pixels(
        self, part: _Part, theta: np.ndarray | None = None, labels: np.ndarray | None = None
    ) -> Pixels:
        """The fits of some pixels, with shared unknowns held at ``theta``, (L, S), where there are some."""
        lower, upper = bounds_of_each(self.space, part.stack, self._given["bounds"])
        low, high = self.space.to_unknowns(lower), self.space.to_unknowns(upper)
        space, starts = self.space, self.settings["starts"]
        if theta is not None:
            known = labels if labels is not None else self.shared.labels  # type: ignore[union-attr]
            columns = self._shared_columns
            low[:, columns] = high[:, columns] = theta[np.searchsorted(known, part.label)]
            # a prior of what is shared counts once, not for each pixel
            terms = [replace(t, prior=None) if c in columns else t for c, t in enumerate(space.terms)]
            space = replace(space, terms=tuple(terms))
            starts = starts if self._own else 1
        return Pixels(
            space,
            part.stack,
            low,
            high,
            self._given["begin"],
            self._given["start"],
            starts,
            self.settings["seed"],
            self.settings["max_iterations"],
        )

    def _store(self, ends: Ends, pixels: Pixels, part: _Part, flat: Mapping[str, np.ndarray]) -> None:
        """Estimates and all that is said of them, into the arrays of a block."""
        space, reached, usable = self.space, ends.reached, part.usable
        converged = ends.converged
        chi2 = 2.0 * ends.cost
        low, high, common = pixels.low, pixels.high, None
        scale = np.where(part.stack.std_known, 1.0, chi2 / part.freedom)
        if self.shared is not None:
            row = np.searchsorted(self.shared.labels, part.label)
            columns = self.shared.columns
            low, high = low.copy(), high.copy()
            low[:, columns], high[:, columns] = self.shared.low[row], self.shared.high[row]
            scale = self._scale(self.shared)[row]
            common = columns, self.shared.covariance[row]
            converged &= self.shared.converged[row]
        spread = spread_of(ends.u, ends.information, low, high, scale, common)
        lower, upper = space.to_parameters(low), space.to_parameters(high)
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

    def _labels(self, block: xr.Dataset) -> np.ndarray:
        """Label of each pixel of a block, of the image's shape: 0 where it is left out, 1 where there are none."""
        shape = tuple(block.sizes[d] for d in self.dims)
        name = self.settings["labels"]
        label = np.ones(shape, dtype=np.int64)
        if name is not None:
            label = block[name].transpose(*self.dims).values.astype(np.int64)
        if MASK in block.variables:
            label = np.where(block[MASK].transpose(*self.dims).values != 0, label, 0)
        return label


@dataclass(frozen=True, eq=False)
class _Part:
    """The pixels of a block that can be fitted.

    Attributes
    ----------
    stack
        What was measured at them.
    shape
        Of the block.
    usable, places
        Their numbers and places in it, shapes (B,) and (B, N).
    freedom, label
        Degrees of freedom and label of each, shape (B,).
    """

    stack: Stack
    shape: Sequence[int]
    usable: np.ndarray
    places: np.ndarray
    freedom: np.ndarray
    label: np.ndarray

    def take(self, chosen: np.ndarray) -> _Part:
        """Only some pixels."""
        return _Part(
            self.stack.take(chosen),
            self.shape,
            self.usable[chosen],
            self.places[chosen],
            self.freedom[chosen],
            self.label[chosen],
        )


def _image_dims(dataset: xr.Dataset, labels: str | None) -> tuple[str, ...]:
    """The dimensions beside ``geometry``; DataError where there are none, or variables do not go with them."""
    used = {str(d) for name in map(str, dataset.data_vars) if name in MEASURED for d in dataset[name].dims}
    dims = tuple(str(d) for d in dataset.sizes if d in used and d not in (DIMENSION, *STOKES_AXES))
    if not dims:
        raise DataError(
            f"the data have no dimension beside {DIMENSION!r} along which to fit a map, such as y and x: fit a single "
            "data set with pbrdf.fit"
        )
    if any(dataset.sizes[dim] == 0 for dim in dims):
        raise DataError(
            f"the data have no pixels: {', '.join(f'{dim}: {dataset.sizes[dim]}' for dim in dims)}"
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
        if name in MEASURED:
            wanted = variable_dims(name)
            if set(own) != set(wanted):
                raise DataError(
                    f"{name} has the dimensions {variable.dims}: it needs {wanted} and some of {tuple(dims)}"
                )
            shape = [dataset.sizes[d] for d in wanted]
            ones = np.ones(shape, dtype=variable.dtype)
            if name == COVARIANCE:
                known = [n in dataset.data_vars and std_name(n) in dataset.data_vars for n in STOKES]
                ones[:] = np.where(np.outer(known, known), np.eye(4), np.nan)
            variables[name] = (wanted, ones)
        elif name in ANGLES and len(own) < len(variable.dims):
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
    form = xr.Dataset(coords=coords, attrs=plain_attributes(dataset.attrs))
    # beside each other, not aligned: the schema is to judge them
    for name, (at, values) in variables.items():
        form[name] = (at, values) if name in MEASURED else ((), 0.0)
    validate(form)
    return form


def _listed(dataset: xr.Dataset) -> str:
    return ", ".join(map(str, dataset.variables))


def _in_memory(array: xr.DataArray) -> bool:
    """Whether a variable holds its values: small things beside the data are kept with the map, others not."""
    return isinstance(array.variable._data, np.ndarray)


def _by_wavelength(space: Space) -> dict[str, Any]:
    """What is held at a value of each wavelength, as JSON holds it; nothing where nothing is."""
    held = {name: list(map(list, table.items())) for name, table in space.by_wavelength.items()}
    return {"by_wavelength": held} if held else {}


def _words(
    noise: Noise | None, covariance: np.ndarray | None, like: Observations, dataset: xr.Dataset
) -> str:
    """Where the uncertainties come from."""
    if covariance is not None:
        return "stated: the covariance of the components"
    if noise is None and COVARIANCE in dataset.data_vars:
        return "covariances of the data set"
    return noise_in_words(noise, like)
