"""What every model shares: checked parameters, evaluation on any kind of array, JSON."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from pbrdf.errors import ModelError
from pbrdf.models import evaluation
from pbrdf.models.parameters import Parameter
from pbrdf.optics.geometry import Geometry

__all__ = ["PARTS", "Model", "load_model"]

#: Parts of a model that can be evaluated alone.
PARTS = ("total", "specular", "diffuse")

Matrix = list[list[Any]]


class Model:
    """Base of the pBRDF models.

    A subclass names its ``parameters`` and ``options`` and gives ``kernel``, its Mueller matrix over generic
    Dr.Jit floats; evaluation, checks, printing and JSON come from here. Instances are immutable.

    Attributes
    ----------
    name
        Name of the model in files and on the command line.
    parameters
        The parameters, in the order of fits and tables.
    options
        Choices of the model by name, the default first.
    values
        Parameter values by name: float, NumPy array, xarray DataArray or Dr.Jit array.
    chosen
        The options chosen, by name.
    """

    name: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]]
    options: ClassVar[Mapping[str, tuple[str, ...]]]

    values: Mapping[str, Any]
    chosen: Mapping[str, str]

    def __init__(self, values: Mapping[str, Any], chosen: Mapping[str, str]) -> None:
        checked = {p.name: _checked_value(p, values[p.name]) for p in self.parameters}
        for option, choice in chosen.items():
            if choice not in self.options[option]:
                raise ModelError(
                    f"{option}={choice!r}: choose one of {', '.join(map(repr, self.options[option]))}"
                )
        object.__setattr__(self, "values", checked)
        object.__setattr__(self, "chosen", dict(chosen))
        self._check_together()

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"models are immutable: use replace({name}=…) for a changed copy")

    def _check_together(self) -> None:
        """Check conditions that tie several parameters or options; raises ModelError."""

    @classmethod
    def from_values(cls, values: Mapping[str, Any], **chosen: str) -> Self:
        """Build a model from parameter values by name, real and imaginary index apart, and options."""
        raise NotImplementedError

    def kernel(self, geometry: Geometry, values: Mapping[str, Any], part: str = "total") -> Matrix:
        """4 x 4 Mueller matrix (1/sr) over generic Dr.Jit floats; structural zeros are the Python number 0.

        Parameters
        ----------
        geometry
            Vectors of the geometry; both rays above the horizon.
        values
            Parameter values by name, Dr.Jit floats; ``kappa`` may be None for a dielectric.
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
            target = Path(path)
            temporary = target.with_name(target.name + ".part")
            temporary.write_text(text, encoding="utf-8")
            temporary.replace(target)
        return text

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and self.to_dict() == other.to_dict()  # type: ignore[attr-defined]

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


def load_model(source: str | os.PathLike[str] | Mapping[str, Any]) -> Model:
    """Load a model from a JSON file, JSON text or the dictionary of :meth:`Model.to_dict`.

    Raises
    ------
    ModelError
        If the text is not JSON, or names an unknown model, parameter or option; the file is named.
    """
    from pbrdf.models import MODELS

    where = ""
    if isinstance(source, Mapping):
        content: Any = source
    else:
        text = os.fspath(source)
        if not text.lstrip().startswith("{"):
            where = f"{text}: "
            try:
                text = Path(text).read_text(encoding="utf-8")
            except (OSError, UnicodeDecodeError) as error:
                raise ModelError(f"{where}cannot be read as a model: {error}") from error
        try:
            content = json.loads(text)
        except json.JSONDecodeError as error:
            raise ModelError(
                f"{where}not JSON, line {error.lineno} column {error.colno}: {error.msg}"
            ) from error
    if not isinstance(content, Mapping) or "model" not in content:
        raise ModelError(f'{where}not a model: the key "model" is missing')
    cls = MODELS.get(content["model"]) if isinstance(content["model"], str) else None
    if cls is None:
        raise ModelError(f"{where}unknown model {content['model']!r}: known are {', '.join(MODELS)}")
    parameters, options = content.get("parameters"), content.get("options", {})
    if not isinstance(parameters, Mapping) or not isinstance(options, Mapping):
        raise ModelError(f'{where}"parameters" and "options" must be tables of name and value')
    names = [p.name for p in cls.parameters]
    for kind, given, known in (("parameter", parameters, names), ("option", options, list(cls.options))):
        for name in given:
            if name not in known:
                raise ModelError(
                    f"{where}unknown {kind} {name!r} of {cls.name}: known are {', '.join(known)}"
                )
    missing = [p.name for p in cls.parameters if p.fitted and p.name not in parameters]
    if missing:
        raise ModelError(f"{where}parameter {missing[0]!r} of {cls.name} is missing")
    values = {p.name: parameters.get(p.name, p.default) for p in cls.parameters}
    try:
        return cls.from_values(values, **options)
    except ModelError as error:
        raise ModelError(f"{where}{error}") from error


def _checked_part(part: str) -> str:
    if part not in PARTS:
        raise ModelError(f"part={part!r}: choose one of {', '.join(map(repr, PARTS))}")
    return part


def _checked_value(parameter: Parameter, value: Any) -> Any:
    """Return the value, floats for scalars, or raise ModelError naming the parameter and its domain."""
    kept = value
    if evaluation.is_drjit(value):
        if evaluation.is_symbolic(value):
            return value
        numbers = evaluation.drjit_to_numpy(value)
    else:
        try:
            numbers = np.asarray(value, dtype=float)
        except (TypeError, ValueError) as error:
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


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        return value
    if evaluation.is_drjit(value):
        return evaluation.drjit_to_numpy(value).tolist()
    return np.asarray(value).tolist()


def _brief(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:g}"
    numbers = evaluation.drjit_to_numpy(value) if evaluation.is_drjit(value) else np.asarray(value)
    return f"<{'x'.join(map(str, numbers.shape))} in {numbers.min():g} … {numbers.max():g}>"
