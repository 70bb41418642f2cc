"""What a part of a model is: parameters, options, and its share of the Mueller matrix."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

from pbrdf.models.arrays import Matrix, is_zero
from pbrdf.models.parameters import Option, Parameter
from pbrdf.optics.geometry import Geometry

__all__ = ["Part", "Renamed", "added", "depolarising"]


class Part:
    """Base of the parts of a :class:`~pbrdf.models.composed.ComposedModel`.

    Attributes
    ----------
    kind
        ``"specular"`` (the facets' reflection) or ``"diffuse"`` (the body).
    parameters, options
        As those of a model. Parts that name the same parameter share it; it must then be declared alike.
    """

    kind: ClassVar[Literal["specular", "diffuse"]]
    parameters: tuple[Parameter, ...] = ()
    options: Mapping[str, Option] = {}

    def matrix(self, geometry: Geometry, values: Mapping[str, Any], chosen: Mapping[str, str]) -> Matrix:
        """Its 4 x 4 Mueller matrix in 1/sr over generic Dr.Jit floats; structural zeros are the Python number 0."""
        raise NotImplementedError

    def check(self, values: Mapping[str, Any]) -> None:
        """Check conditions that tie several parameters; raises ModelError."""

    def lobe_width(self, values: Mapping[str, Any]) -> Any:
        """Standard deviation of one slope component of its facets; None where it has no lobe of known width."""
        return None

    def albedo(self, cos_theta: Any, values: Mapping[str, Any]) -> Any:
        """Rough share of light that it reflects, by which a renderer draws it; None where that is not known."""
        return None


class Renamed(Part):
    """A part under other names of its parameters, so that a model can hold two of a kind.

    Parameters
    ----------
    part
        The part.
    names
        New names by old ones, with symbols: ``{"sigma": ("sigma2", "σ₂")}``; the others stay and are shared.
    """

    def __init__(self, part: Part, names: Mapping[str, tuple[str, str]]) -> None:
        from dataclasses import replace

        self.kind = part.kind  # type: ignore[misc]
        self._part = part
        self._old = {new: old for old, (new, _) in names.items()}
        self.options = part.options
        self.parameters = tuple(
            replace(
                p,
                name=names.get(p.name, (p.name, p.symbol))[0],
                symbol=names.get(p.name, (p.name, p.symbol))[1],
                extinction_of=None
                if p.extinction_of is None
                else names.get(p.extinction_of, (p.extinction_of, ""))[0],
            )
            for p in part.parameters
        )

    def _named(self, values: Mapping[str, Any]) -> dict[str, Any]:
        return {**values, **{old: values[new] for new, old in self._old.items()}}

    def matrix(self, geometry: Geometry, values: Mapping[str, Any], chosen: Mapping[str, str]) -> Matrix:
        return self._part.matrix(geometry, self._named(values), chosen)

    def check(self, values: Mapping[str, Any]) -> None:
        self._part.check(self._named(values))

    def lobe_width(self, values: Mapping[str, Any]) -> Any:
        return self._part.lobe_width(self._named(values))

    def albedo(self, cos_theta: Any, values: Mapping[str, Any]) -> Any:
        return self._part.albedo(cos_theta, self._named(values))


def added(a: Matrix, b: Matrix) -> Matrix:
    """Sum of two matrices; what is zero by structure in one is taken from the other."""
    return [
        [y if is_zero(x) else x if is_zero(y) else x + y for x, y in zip(row, other, strict=True)]
        for row, other in zip(a, b, strict=True)
    ]


def depolarising(value: Any) -> Matrix:
    """The ideal depolariser diag(1, 0, 0, 0) times a BRDF."""
    matrix: Matrix = [[0.0] * 4 for _ in range(4)]
    matrix[0][0] = value
    return matrix
