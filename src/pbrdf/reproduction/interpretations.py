"""The interpretations of the paper's eqs (12)-(13) that are put side by side, and the paper's models under each."""

from __future__ import annotations

from dataclasses import dataclass

from pbrdf.data.paints import PAINTS
from pbrdf.models import DoubleGauss
from pbrdf.reproduction.paper import FIGURE_3_PARAMETERS

__all__ = ["DEFAULT", "INTERPRETATIONS", "LITERAL", "Interpretation"]


@dataclass(frozen=True)
class Interpretation:
    """One interpretation, called a reading on the page.

    Attributes
    ----------
    normalization, transmittance
        Options of :class:`pbrdf.models.DoubleGauss`.
    """

    normalization: str
    transmittance: str

    @property
    def name(self) -> str:
        """``weighted / flux`` and so on."""
        return f"{self.normalization} / {self.transmittance}"

    @property
    def options(self) -> dict[str, str]:
        """Options of the model."""
        return {"normalization": self.normalization, "transmittance": self.transmittance}

    def sample(self, number: int) -> DoubleGauss:
        """The model of sample 1 … 5 with the parameters of the paper's table 1."""
        return DoubleGauss(*list(PAINTS.values())[number - 1], **self.options)

    def samples(self) -> list[DoubleGauss]:
        """The models of all five samples."""
        return [self.sample(number) for number in range(1, len(PAINTS) + 1)]

    def figure_3(self) -> DoubleGauss:
        """The model of the paper's figure 3."""
        return DoubleGauss(*FIGURE_3_PARAMETERS, **self.options)


#: All interpretations, the default of the models first, the letter of the paper last.
INTERPRETATIONS = tuple(
    Interpretation(normalization, transmittance)
    for normalization in DoubleGauss.options["normalization"]
    for transmittance in DoubleGauss.options["transmittance"]
)
DEFAULT, LITERAL = INTERPRETATIONS[0], INTERPRETATIONS[-1]
