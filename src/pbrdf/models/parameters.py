"""Named, bounded, documented model parameters."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Parameter"]


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
        Whether a fit leaves it free by default.
    logarithmic
        Whether starting values are spread evenly in its logarithm.
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
