"""What a reproduction finds, as the figures and the page show it."""

from __future__ import annotations

from dataclasses import dataclass

from pbrdf.reproduction.experiment.measurement import Options
from pbrdf.reproduction.experiment.sample import Sample
from pbrdf.reproduction.statements.catalogue import Evaluated
from pbrdf.reproduction.statements.expected import Number

__all__ = ["Reproduction"]


@dataclass(frozen=True)
class Reproduction:
    """Everything that was found.

    Attributes
    ----------
    options
        How the experiment was simulated and inverted.
    samples
        The five samples, measured and inverted.
    statements
        The paper's statements with what their tests found.
    numbers
        Numbers expected of the model.
    """

    options: Options
    samples: list[Sample]
    statements: list[Evaluated]
    numbers: list[Number]
