"""What every model shares: checked parameters, evaluation on any kind of array, JSON."""

from __future__ import annotations

import inspect
import json
import math
import os
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from pbrdf.errors import ModelError
from pbrdf.files.atomic import atomic_file
from pbrdf.models import evaluation
from pbrdf.models.arrays import Matrix, drjit_to_numpy, is_drjit, is_symbolic
from pbrdf.models.lobe import measured_lobe_width
from pbrdf.models.parameters import Option, Parameter
from pbrdf.optics.geometry import Geometry

__all__ = ["ACCURACIES", "PARTS", "Model"]

#: Parts of a model that can be evaluated alone.
PARTS = ("total", "specular", "diffuse")
#: Names that a parameter or option cannot have: arguments of the methods, keys of a renderer's description.
_RESERVED = ("theta_i", "theta_r", "phi", "incident", "part", "type", "id", "model", "paint", "model_file")
#: Accuracies that callers may ask a model for: searching, rendering, as a rule, reference values.
ACCURACIES = ("draft", "fast", "default", "high")


class Model:
    """Base of the pBRDF models.

    A subclass declares its ``name``, ``parameters`` and ``options`` and gives ``kernel``, its Mueller matrix over
    generic Dr.Jit floats. Constructor, signature and table of parameters in the docstring come from the declaration;
    evaluation, checks, printing and JSON from here. What fits, plans, plots and renderers ask of a model are methods
    whose defaults hold for any; a subclass that knows better overrides them (docs/own-model.md). Instances are
    immutable.

    Attributes
    ----------
    name
        Name of the model in files and on the command line.
    parameters
        The parameters, in the order of fits and tables.
    options
        Choices of the model by name (:class:`Option`), the default first.
    readings
        Options by the name of a reading beside that of the defaults, ``{"visible": {"normalization": "visible"}}``:
        each is a model of its own in a comparison.
    ablations
        Parameters held at a value by the name of the assumption that they then make,
        ``{"unpolarised body": {"t": 0.0}}``: a comparison tells what it costs.
    gaussian_slopes
        Whether the two slopes of the facets are normal variables with :meth:`lobe_width` as standard deviation; a
        renderer then draws the specular part from them alone.
    values
        Parameter values by name: float, NumPy array, xarray DataArray or Dr.Jit array.
    chosen
        The options chosen, by name.
    """

    name: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    options: ClassVar[Mapping[str, Option]] = {}
    readings: ClassVar[Mapping[str, Mapping[str, str]]] = {}
    ablations: ClassVar[Mapping[str, Mapping[str, float]]] = {}
    gaussian_slopes: ClassVar[bool] = False

    values: Mapping[str, Any]
    chosen: Mapping[str, str]

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        _check_declaration(cls)
        cls.__signature__ = _signature(cls)  # type: ignore[attr-defined]
        cls.__doc__ = (
            f"{inspect.cleandoc(cls.__dict__.get('__doc__') or cls.__name__)}\n\n{_documentation(cls)}"
        )

    def __init__(self, *given: Any, **named: Any) -> None:
        try:
            bound = inspect.signature(type(self)).bind(*given, **named)
        except TypeError as error:
            raise TypeError(f"{type(self).__name__}: {error}") from None
        bound.apply_defaults()
        values = {p.name: bound.arguments[p.name] for p in self.parameters}
        for p in self.parameters:
            if p.extinction_of is not None:
                index = p.extinction_of
                values[index], values[p.name] = _split_index(index, p.name, values[index], values[p.name])
        chosen = {option: bound.arguments[option] for option in self.options}
        for option, choice in chosen.items():
            if choice not in self.options[option]:
                raise ModelError(
                    f"{option}={choice!r}: choose one of {', '.join(map(repr, self.options[option]))}"
                )
        checked = {p.name: _checked_value(p, values[p.name]) for p in self.parameters}
        object.__setattr__(self, "values", checked)
        object.__setattr__(self, "chosen", chosen)
        self._check_together()

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"models are immutable: use replace({name}=…) for a changed copy")

    def _check_together(self) -> None:
        """Check conditions that tie several parameters or options; raises ModelError."""

    @classmethod
    def from_values(cls, values: Mapping[str, Any], **chosen: str) -> Self:
        """Build a model from parameter values by name, real and imaginary index apart, and options."""
        return cls(**values, **chosen)

    # What the rest of the package asks of a model. The defaults hold for any.

    def with_accuracy(self, accuracy: str) -> Self:
        """The same model, evaluated as exactly as one of :data:`ACCURACIES` says, where it has such an option."""
        return self.replace(accuracy=accuracy) if accuracy in self.options.get("accuracy", ()) else self

    def for_rendering(self) -> Self:
        """The same model, evaluated as a renderer does where a scene does not state the accuracy."""
        return self

    def lane_groups(
        self, scalars: Mapping[str, Any], floats: Mapping[str, Any], size: int, part: str
    ) -> Sequence[tuple[Self, Any]]:
        """Directions sorted so that those evaluated together take the same branches of the kernel.

        Parameters
        ----------
        scalars
            Angles and parameters by name: NumPy arrays of shape (size,), or single numbers.
        floats
            The same as Dr.Jit arrays, or single numbers.
        size
            Number of directions.
        part
            Part of the model that is evaluated.

        Returns
        -------
        sequence
            For each group the model that evaluates it, this one or a copy that knows which branch is taken, and the
            directions' indices (Dr.Jit uint32); None stands for all directions in their order.
        """
        return [(self, None)]

    @classmethod
    def fit_bounds(cls, parameter: Parameter, options: Mapping[str, str]) -> tuple[float, float]:
        """Default bounds of a parameter in a fit under these options."""
        return parameter.lower, parameter.upper

    def lobe_width(self, values: Mapping[str, Any] | None = None) -> Any:
        """Standard deviation of one slope component of the facets, by which the specular lobe is resolved.

        Parameters
        ----------
        values
            Parameters by name over generic floats, for a renderer; None for those of the model itself.

        Returns
        -------
        float
            The default measures the lobe of the model's own values, see
            :func:`~pbrdf.models.lobe.measured_lobe_width`; of a map those of its least and its largest values.
        """
        if "_lobe_width" not in self.__dict__:
            ends = {name: _ends(value) for name, value in self.values.items()}
            width = measured_lobe_width(self.from_values(ends, **self.chosen))
            object.__setattr__(self, "_lobe_width", width)
        return self.__dict__["_lobe_width"]

    def albedos(self, cos_theta: Any, values: Mapping[str, Any]) -> tuple[Any, Any]:
        """Rough shares of light from one direction that facets and body reflect, by which a renderer draws either.

        Parameters
        ----------
        cos_theta
            Cosine of the zenith angle of the ray, > 0, a generic float.
        values
            Parameters by name over generic floats.
        """
        even = 0.0 * cos_theta + 0.5
        return even, even

    def kernel(self, geometry: Geometry, values: Mapping[str, Any], part: str = "total") -> Matrix:
        """4 x 4 Mueller matrix (1/sr) over generic Dr.Jit floats; structural zeros are the Python number 0.

        Parameters
        ----------
        geometry
            Vectors of the geometry; both rays above the horizon.
        values
            Parameter values by name, Dr.Jit floats; None for one that is declared ``vanishing`` and is 0 everywhere.
        part
            ``"total"``, ``"specular"`` or ``"diffuse"``.
        """
        raise NotImplementedError

    def mueller(self, theta_i: Any, theta_r: Any, phi: Any = 0.0, *, part: str = "total") -> Any:
        """Mueller matrix of the BRDF.

        Parameters
        ----------
        theta_i, theta_r
            Zenith angles of source and viewer in radians, within [0, π/2]; at π/2 the BRDF is 0.
        phi
            Relative azimuth in radians, 0 in the forward (specular) half-plane, π in backscatter.
        part
            ``"total"``, ``"specular"`` or ``"diffuse"``.

        Returns
        -------
        array
            dL_r/dE_i in 1/sr for Stokes vectors (I, Q, U, V) with Q = I_p − I_s, see ``docs/conventions.md``.
            Angles and parameters broadcast against each other. Scalars and NumPy arrays give a NumPy array of
            shape (..., 4, 4); xarray arrays give a DataArray with the dimensions ``stokes_out`` and
            ``stokes_in`` appended; Dr.Jit arrays give a Dr.Jit ``Matrix4f64`` (tensors of shape (...) give a
            tensor of shape (..., 4, 4)), differentiable with respect to angles and parameters.

        Raises
        ------
        ModelError
            If an angle is not finite or out of range, the shapes do not broadcast, or the part is unknown.
        """
        return evaluation.mueller(self, theta_i, theta_r, phi, _checked_part(part))

    def stokes(
        self,
        theta_i: Any,
        theta_r: Any,
        phi: Any = 0.0,
        *,
        incident: Any = (1.0, 0.0, 0.0, 0.0),
        part: str = "total",
    ) -> Any:
        """Stokes vector of the reflected radiance for unit irradiance, 1/sr.

        Parameters
        ----------
        theta_i, theta_r, phi, part
            As in :meth:`mueller`.
        incident
            Stokes vector of the irradiance in the (p, s) frame of the incident ray; natural light of unit
            irradiance by default. Shape (4,) or (..., 4).

        Returns
        -------
        array
            Shape (..., 4), of the kind of :meth:`mueller` (``stokes_out`` appended for xarray, ``Array4f64``
            for Dr.Jit arrays).

        Raises
        ------
        ModelError
            As :meth:`mueller`, and if the incident Stokes vector is not finite, has no intensity or is more
            than fully polarised.
        """
        return evaluation.stokes(self, theta_i, theta_r, phi, incident, _checked_part(part))

    def replace(self, **changes: Any) -> Self:
        """Copy of the model with some parameters or options changed."""
        known = set(self.values) | set(self.chosen)
        for name in changes:
            if name not in known:
                raise ModelError(
                    f"{self.name} has no parameter or option {name!r}: {', '.join(sorted(known))}"
                )
        values = {k: changes.get(k, v) for k, v in self.values.items()}
        chosen = {k: changes.get(k, v) for k, v in self.chosen.items()}
        return self.from_values(values, **chosen)

    def to_dict(self) -> dict[str, Any]:
        """Describe the model with plain Python numbers, lists and strings."""
        return {
            "model": self.name,
            "parameters": {name: _plain(value) for name, value in self.values.items()},
            "options": dict(self.chosen),
        }

    def to_json(self, path: str | os.PathLike[str] | None = None) -> str:
        """Return the model as JSON text and, if a path is given, write it there."""
        text = json.dumps(self.to_dict(), indent=2, ensure_ascii=False, allow_nan=False) + "\n"
        if path is not None:
            with atomic_file(Path(path)) as target:
                target.write_text(text, encoding="utf-8")
        return text

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and self.to_dict() == other.to_dict()

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        shown = [f"{name}={_brief(value)}" for name, value in self.values.items()]
        shown += [f"{k}={v!r}" for k, v in self.chosen.items() if v != self.options[k][0]]
        return f"{type(self).__name__}({', '.join(shown)})"

    @classmethod
    def describe(cls) -> str:
        """Table of the parameters: meaning, unit, bounds for fitting, domain."""
        rows = [
            f"{p.name:8s} {p.description} [{p.unit}]; fit {p.lower:g} … {p.upper:g}; "
            f"domain {p.domain[0]:g} … {p.domain[1]:g}"
            for p in cls.parameters
        ]
        return "\n".join([f"model {cls.name}", *rows])


def _check_declaration(cls: type[Model]) -> None:
    """Check what a subclass says of itself; raises TypeError, as it is an error of the program."""
    names = [*(p.name for p in cls.parameters), *cls.options]
    for name in names:
        if not name.isidentifier():
            raise TypeError(f"{cls.__name__}: {name!r} cannot be the name of a parameter or option")
        if names.count(name) > 1 or name in _RESERVED:
            raise TypeError(
                f"{cls.__name__}: the name {name!r} is taken: give the parameter or option another"
            )
    for p in cls.parameters:
        if p.extinction_of is not None and p.extinction_of not in names:
            raise TypeError(
                f"{cls.__name__}: {p.name} is the extinction of {p.extinction_of!r}, which is missing"
            )
    for reading, chosen in cls.readings.items():
        for option, choice in chosen.items():
            if choice not in cls.options.get(option, ()):
                raise TypeError(f"{cls.__name__}: the reading {reading!r} has no choice {option}={choice!r}")
    domains = {p.name: p.domain for p in cls.parameters}
    for ablation, held in cls.ablations.items():
        for name, value in held.items():
            if name not in domains or not domains[name][0] <= value <= domains[name][1]:
                raise TypeError(f"{cls.__name__}: the ablation {ablation!r} cannot hold {name} at {value:g}")


def _signature(cls: type[Model]) -> inspect.Signature:
    """The parameters in their order, then by name those that a fit holds, and the options."""
    by_name = inspect.Parameter.KEYWORD_ONLY
    fitted = [
        inspect.Parameter(p.name, inspect.Parameter.POSITIONAL_OR_KEYWORD) for p in cls.parameters if p.fitted
    ]
    held = [inspect.Parameter(p.name, by_name, default=p.default) for p in cls.parameters if not p.fitted]
    options = [inspect.Parameter(name, by_name, default=choices[0]) for name, choices in cls.options.items()]
    return inspect.Signature([*fitted, *held, *options])


def _documentation(cls: type[Model]) -> str:
    """Sections of the docstring that the declaration gives."""
    complex_ones = {p.extinction_of: p.name for p in cls.parameters if p.extinction_of is not None}
    stated = {p.name: p.documentation() for p in sorted(cls.parameters, key=lambda p: not p.fitted)}
    for index, extinction in complex_ones.items():
        stated[index] += f" A complex number {index} − i·{extinction} is taken apart."
    stated |= {name: choices.documentation() for name, choices in cls.options.items()}
    lines = ["Every parameter may be an array (a map of paints) that broadcasts against the angles."]
    lines += ["", "Parameters", "----------"]
    for name, sentence in stated.items():
        lines += [name, textwrap.indent(textwrap.fill(f"{sentence[0].upper()}{sentence[1:]}", 100), "    ")]
    lines += ["", "Raises", "------", "ModelError"]
    lines += ["    If a parameter is not finite or outside its domain, or an option is unknown."]
    return "\n".join(lines)


def _split_index(index: str, extinction: str, n: Any, kappa: Any) -> tuple[Any, Any]:
    """Split a complex index n − iκ into (n, κ); a real one keeps the κ given apart."""
    if is_drjit(n) or not _is_complex(n):
        return n, kappa
    if np.any(np.imag(n) != 0.0) and np.any(np.asarray(kappa) != 0.0):
        raise ModelError(
            f"the extinction is given twice: as the imaginary part of {index} and as {extinction}"
        )
    if np.any(np.imag(n) > 0.0):
        raise ModelError(
            f"{index}={n}: the imaginary part must be ≤ 0, the convention is n − iκ with κ ≥ 0; give the conjugate"
        )
    return n.real, (-n.imag if np.any(np.imag(n) != 0.0) else kappa)


def _is_complex(value: Any) -> bool:
    try:
        return np.iscomplexobj(value)
    except ValueError:  # rows of different lengths, which are refused where values are checked
        return False


def _checked_part(part: str) -> str:
    if part not in PARTS:
        raise ModelError(f"part={part!r}: choose one of {', '.join(map(repr, PARTS))}")
    return part


def _checked_value(parameter: Parameter, value: Any) -> Any:
    """Return the value, floats for scalars, or raise ModelError naming the parameter and its domain."""
    kept = value
    if is_drjit(value):
        if is_symbolic(value):
            return value
        numbers = drjit_to_numpy(value)
    else:
        try:
            if np.asarray(value).dtype.kind in "bSU":  # NumPy would make numbers of true, and of "1_0"
                raise TypeError
            numbers = np.asarray(value, dtype=float)
        except (TypeError, ValueError, OverflowError) as error:
            raise ModelError(f"{parameter.name}={value!r} is not a number") from error
        if numbers.size == 0:
            raise ModelError(f"{parameter.name} is an empty array: give a number or an array of numbers")
        if numbers.ndim == 0:
            kept = float(numbers)
        elif isinstance(value, np.ndarray | Sequence):
            kept = numbers.copy()
            kept.flags.writeable = False
    low, high = parameter.domain
    bad = ~(np.isfinite(numbers) & (numbers >= low) & (numbers <= high))
    if bad.any():
        where = f" at index {tuple(int(i[0]) for i in np.nonzero(bad))}" if numbers.ndim else ""
        worst = numbers[bad].flat[0] if numbers.ndim else float(numbers)
        limits = f"{low:g} or more" if math.isinf(high) else f"within {low:g} … {high:g}"
        raise ModelError(
            f"{parameter.name}={worst:g}{where} is outside its domain: {parameter.description} must be "
            f"{limits}"
        )
    return kept


def _ends(value: Any) -> Any:
    """A number, or the least and the largest value of an array."""
    if isinstance(value, float):
        return value
    numbers = drjit_to_numpy(value) if is_drjit(value) else np.asarray(value)
    return np.array([numbers.min(), numbers.max()])


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        return value
    if is_drjit(value):
        return drjit_to_numpy(value).tolist()
    return np.asarray(value).tolist()


def _brief(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:g}"
    numbers = drjit_to_numpy(value) if is_drjit(value) else np.asarray(value)
    return f"<{'x'.join(map(str, numbers.shape))} in {numbers.min():g} … {numbers.max():g}>"
