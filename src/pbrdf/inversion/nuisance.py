"""What the instrument adds: terms of a fit that describe the measurement, not the coating.

======== ============================================================== ====== ===========================
kind     meaning                                                        unit   bounds, prior by default
======== ============================================================== ====== ===========================
gain     data = gain × model                                            1      1/1000 … 1000, none
dark     offset added to the intensity, on the data's own scale         data   ± median intensity, none
angle    sample turned by δ in the plane of incidence (θ_i + δ, θ_r − δ deg    ± 2, 0 ± 0.2
         with θ_r signed): the bistatic angle stays
source   angular radius of a uniform round source (or of source and     deg    0 … 5, none
         detector together, their variances added), over which the
         specular lobe is averaged
======== ============================================================== ====== ===========================

Each is one unknown for all data or one for each group, with an optional Gaussian prior. Gain and a are told
apart only by the specular part, whose height the model knows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from pbrdf.errors import FitError
from pbrdf.files.plain_numbers import number_from_text
from pbrdf.models.parameters import Parameter

__all__ = ["KINDS", "Nuisance", "parse_prior"]

_DEGREE = math.pi / 180.0

#: Kinds of nuisance terms by name; angles in radians.
KINDS: dict[str, Parameter] = {
    "gain": Parameter(
        "gain", "g", "1", "gain of the instrument", 1e-3, 1e3, (0.0, math.inf), 1.0, logarithmic=True
    ),
    "dark": Parameter(
        "dark", "d", "data", "dark offset of the intensity", -1.0, 1.0, (-math.inf, math.inf), 0.0
    ),
    "angle": Parameter(
        "angle", "δ", "rad", "offset of the sample's angle", -2.0 * _DEGREE, 2.0 * _DEGREE, (-1.0, 1.0), 0.0
    ),
    "source": Parameter(
        "source", "ρ", "rad", "angular radius of the source", 0.0, 5.0 * _DEGREE, (0.0, 1.0), 0.0, even=True
    ),
}
_DEFAULT_PRIORS = {"angle": (0.0, 0.2 * _DEGREE)}


@dataclass(frozen=True)
class Nuisance:
    """One kind of nuisance term in a fit.

    Attributes
    ----------
    kind
        A name of ``KINDS``.
    per_group
        Whether each group has its own; else one for all data.
    prior
        Mean and standard deviation of a Gaussian prior, angles in radians; None for none.
    """

    kind: str
    per_group: bool = False
    prior: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise FitError(f"nuisance {self.kind!r}: choose one of {', '.join(KINDS)}")
        check_prior(f"nuisance {self.kind}", self.prior)

    @classmethod
    def parse(cls, text: str) -> Nuisance:
        """Read ``KIND[:group][~MEAN,STD]``, angles in degrees, for example ``gain`` or ``angle:group~0,0.1``.

        Without ``~`` the kind's default prior counts; ``~none`` is no prior.

        Raises
        ------
        FitError
            If the text has another form.
        """
        head, tilde, prior_text = text.partition("~")
        kind, colon, per = head.strip().partition(":")
        if colon and per != "group":
            raise FitError(f"nuisance {text!r}: after the colon only 'group' is understood")
        if kind not in KINDS:
            raise FitError(f"nuisance {text!r}: choose one of {', '.join(KINDS)}")
        prior = _DEFAULT_PRIORS.get(kind)
        if tilde:
            prior = None if prior_text.strip() == "none" else parse_prior(f"nuisance {text!r}", prior_text)
            if prior is not None and KINDS[kind].unit == "rad":
                prior = (prior[0] * _DEGREE, prior[1] * _DEGREE)
        return cls(kind, bool(colon), prior)


def parse_prior(where: str, text: str) -> tuple[float, float]:
    """Read ``MEAN,STD``.

    Raises
    ------
    FitError
        If the text is not two numbers, the second above 0.
    """
    try:
        mean, std = (number_from_text(part) for part in text.split(","))
    except ValueError:
        raise FitError(f"{where}: a prior is MEAN,STD, for example 1.5,0.05") from None
    check_prior(where, (mean, std))
    return mean, std


def check_prior(where: str, prior: tuple[float, float] | None) -> None:
    """Check a prior; raises FitError naming ``where`` it was given."""
    if prior is None:
        return
    mean, std = prior
    if not (math.isfinite(mean) and math.isfinite(std) and std > 0.0):
        raise FitError(
            f"{where}: a prior needs a finite mean and a standard deviation above 0, got {mean}, {std}"
        )
