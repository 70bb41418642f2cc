"""Models composed of parts: the sum of lobes of facets and of bodies, with the parameters of all."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from pbrdf.models.arrays import Matrix
from pbrdf.models.base import Model
from pbrdf.models.parts.part import Part, added
from pbrdf.optics.geometry import Geometry

__all__ = ["ComposedModel"]


class ComposedModel(Model):
    """A model that is the sum of its parts.

    A subclass gives a ``name`` and ``parts``; parameters and options are theirs, in the order of the parts. Parts that
    name the same parameter share it.

    Attributes
    ----------
    parts
        The parts.
    """

    parts: ClassVar[tuple[Part, ...]] = ()

    def __init_subclass__(cls, **kwargs: Any) -> None:
        if "parts" in cls.__dict__:
            parameters: dict[str, Any] = {}
            options: dict[str, Any] = {}
            for part in cls.parts:
                for known, declared in (
                    (parameters, {p.name: p for p in part.parameters}),
                    (options, dict(part.options)),
                ):
                    for name, one in declared.items():
                        if known.setdefault(name, one) != one:
                            raise TypeError(f"{cls.__name__}: two parts declare {name!r} differently")
            cls.parameters, cls.options = tuple(parameters.values()), options
        super().__init_subclass__(**kwargs)

    def kernel(self, geometry: Geometry, values: Mapping[str, Any], part: str = "total") -> Matrix:
        """Sum of the parts' Mueller matrices, over generic Dr.Jit floats."""
        total: Matrix = [[0.0] * 4 for _ in range(4)]
        for own in self.parts:
            if part in ("total", own.kind):
                total = added(total, own.matrix(geometry, values, self.chosen))
        return total

    def _check_together(self) -> None:
        for part in self.parts:
            part.check(self.values)

    def lobe_width(self, values: Mapping[str, Any] | None = None) -> Any:
        """That of the first part that has a lobe and knows its width; else measured."""
        given = self.values if values is None else values
        for part in self.parts:
            width = part.lobe_width(given)
            if width is not None:
                return width
        return super().lobe_width(values)

    def albedos(self, cos_theta: Any, values: Mapping[str, Any]) -> tuple[Any, Any]:
        """Sums of the parts' rough albedos, even shares where one of them does not know its own."""
        shares: dict[str, Any] = {"specular": 1e-3, "diffuse": 1e-3}
        for part in self.parts:
            albedo = part.albedo(cos_theta, values)
            if albedo is None:
                return super().albedos(cos_theta, values)
            shares[part.kind] = shares[part.kind] + albedo
        return shares["specular"], shares["diffuse"]
