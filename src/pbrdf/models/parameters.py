"""What a model declares of itself: named, bounded, documented parameters, and options."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, Self

__all__ = ["Option", "Parameter", "shown_unit"]


@dataclass(frozen=True)
class Parameter:
    """One parameter of a model.

    Attributes
    ----------
    name, symbol
        Name in Python and in files; symbol for figures and tables.
    unit
        ``"1"`` for pure numbers.
    description
        What it means, in a few words.
    lower, upper
        Default bounds for fitting (docs/model.md, section 5).
    domain
        Closed interval outside of which the model is not defined: a value there is an error.
    default
        Value where nothing is said: where a parameter is left out, and where a fit holds it.
    fitted
        Whether a fit leaves it free by default; those that it does not are given to the constructor by name only.
    logarithmic
        Whether starting values are spread evenly in its logarithm.
    even
        Whether everything depends on its square: that is then the unknown of a fit, as the derivative by itself
        vanishes at 0.
    part
        Part of the model that it shapes: ``"specular"``, ``"diffuse"`` or ``"both"``. The stepwise strategy fits those
        of the diffuse part by themselves.
    amplitude
        Whether it is a factor on the data's own scale: a fit takes its bounds from the data.
    vanishing
        Whether the kernel takes None for it where it is 0 everywhere, and leaves out what depends on it.
    refractive_index
        Whether it is the real refractive index of a material: a fit takes it from a page of optical constants.
    extinction_of
        Name of the refractive index n whose extinction κ it is: a complex n − iκ given for that one is split into both.
    """

    name: str
    symbol: str
    unit: str
    description: str
    lower: float
    upper: float
    domain: tuple[float, float]
    default: float
    fitted: bool = True
    logarithmic: bool = False
    even: bool = False
    part: Literal["specular", "diffuse", "both"] = "both"
    amplitude: bool = False
    vanishing: bool = False
    refractive_index: bool = False
    extinction_of: str | None = None

    def shown(self, value: float, form: str = ".4g") -> str:
        """A value of it in a sentence: angles in degrees, with their unit."""
        factor, unit = shown_unit(self)
        return f"{factor * value:{form}}{unit if unit == '°' else ''}"

    def documentation(self) -> str:
        """One sentence on what to give, for the docstring of a model."""
        low, high = self.domain
        limits = f"{low:g} or more" if math.isinf(high) else f"{low:g} … {high:g}"
        kept = f"a fit keeps within {self.lower:g} … {self.upper:g}"
        if self.amplitude:
            kept = "a fit takes its bounds from the data"
        held = "" if self.fitted else f", held at {self.default:g} unless set free"
        return f"{self.description}; unit {self.unit}; {limits}; {kept}{held}."


def shown_unit(parameter: Parameter) -> tuple[float, str]:
    """Factor and unit in which people and files see a parameter: angles in degrees."""
    return (180.0 / math.pi, "°") if parameter.unit == "rad" else (1.0, parameter.unit)


class Option(tuple[str, ...]):
    """The choices that an option of a model has, the default first, and what it is about.

    A tuple of the choices, with the attribute ``description``.
    """

    description: str

    def __new__(cls, *choices: str, description: str = "") -> Self:
        option = super().__new__(cls, choices)
        option.description = description
        return option

    def documentation(self) -> str:
        """One sentence on what to give, for the docstring of a model."""
        first, *others = (f'``"{choice}"``' for choice in self)
        listed = ", ".join([f"{first} (default)", *others])
        return f"{self.description}: {listed}." if self.description else f"{listed}."
