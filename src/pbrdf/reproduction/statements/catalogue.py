"""The paper's statements in its order, and their evaluation.

The numbers are those of `docs/reproduction.md`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from pbrdf.data.paints import PAINTS
from pbrdf.reproduction.experiment.sample import Sample
from pbrdf.reproduction.interpretations import INTERPRETATIONS
from pbrdf.reproduction.statements.intensity import (
    diffuse_intensity_falls,
    local_incidence_grows,
    narrow_peaks,
    peaks_alike,
)
from pbrdf.reproduction.statements.limits import lambertian, rough_and_smooth
from pbrdf.reproduction.statements.parameters import polarised_shares, roughnesses, starts_agree
from pbrdf.reproduction.statements.polarisation import (
    crossed_and_growing,
    diffuse_dop,
    equal_view_equal_dop,
    falls_off_the_peak,
    falls_to_zero_and_rises,
    maximum_grows,
    zeros_beside_the_peak,
)
from pbrdf.reproduction.statements.statement import Kind, Outcome, Statement
from pbrdf.reproduction.statements.wide_source import wide_source_explains_the_peaks

__all__ = ["PRINTED", "RECOVERED", "STATEMENTS", "Evaluated", "evaluate"]

#: What the outcomes of a statement on parameters are called: those of table 1, and those that the inversion found.
PRINTED, RECOVERED = "table 1", "recovered"
_MEASURED = "About the paper's measured data only."

STATEMENTS = (
    Statement(
        1,
        "Some paints reflect diffuse light that is polarised, by up to about 10 %.",
        "The diffuse part alone reaches 10 % at an angle of view between 50° and 75° for at least one sample (θi = "
        "10°).",
        Kind.MODEL,
        diffuse_dop,
    ),
    Statement(
        2,
        "A very rough surface becomes Lambertian; without roughness it is a mirror with Fresnel's reflectance.",
        "Over a Lambertian body f varies less and less within ±60° as σ grows, at σ = 1 by less than a factor 1.1; at "
        "σ = 0.002 the facets reflect Fresnel's share to 1e-4.",
        Kind.MODEL,
        rough_and_smooth,
    ),
    Statement(
        3,
        "For a Lambertian surface k = 1 and b = 0.",
        "f_rpv = a/π to 1e-12 in every direction.",
        Kind.MODEL,
        lambertian,
    ),
    Statement(
        4,
        "Figure 3: away from the mirror direction the degree of polarisation (DoP) falls to 0 and then rises.",
        "In the plane of incidence Q/I passes through 0 once on each side of its largest value; the DoP falls on "
        "the way there and exceeds 1 % beyond.",
        Kind.MODEL,
        falls_to_zero_and_rises,
    ),
    Statement(
        5,
        "Figure 3 shows intensity and DoP as surfaces whose distance from the origin is the value.",
        "Drawn: figure 3.",
        Kind.SHOWN,
    ),
    Statement(
        6,
        "The intensity is strong in the mirror direction and falls off fast: the roughness is small.",
        "Half the width at half the peak is less than 5° of turn, every sample and position.",
        Kind.MODEL,
        narrow_peaks,
    ),
    Statement(
        7,
        "The white paint without matting agent is the smoothest; the thin matte coat is smoother than the thick one.",
        "σ of sample 1 below all others, σ of sample 2 below that of sample 3.",
        Kind.TABLE,
    ),
    Statement(
        8,
        "The polarised share of the diffuse light is larger for samples 1 and 3 than for the others.",
        "t of samples 1 and 3 above t of samples 2, 4 and 5.",
        Kind.TABLE,
    ),
    Statement(
        9,
        "From position 1 to 3 the local incidence at the intensity's maximum grows.",
        "The maximum lies within 1° of turn of the mirror direction, where β = Ψ/2, and Ψ grows.",
        Kind.MODEL,
        local_incidence_grows,
    ),
    Statement(
        10,
        "The maxima of the intensity are about the same at the three positions: Fresnel's gain makes up for the "
        "cosine's loss.",
        "Largest over smallest maximum at most 1.25, every sample, source without extent. The paper does not print "
        "its Ψ: at 30°, 50°, 70° the ratio of sample 3 would be 1.15.",
        Kind.MODEL,
        peaks_alike,
    ),
    Statement(
        11,
        "Right of the peak, at the same sample angle, the diffuse intensity falls from position 1 to 3.",
        "Diffuse intensity at θr = 60° over that at 20°, both at θi = 10°, below 1, every sample.",
        Kind.MODEL,
        diffuse_intensity_falls,
    ),
    Statement(
        12,
        "The diffuse intensity fits very well; the specular maxima deviate, but by less than 20 DN.",
        _MEASURED,
        Kind.MEASURED,
    ),
    Statement(
        13,
        "But for sample 1 the modelled peaks are too low at position 1, too high at 2 and more so at 3; the "
        "authors suspect the cosine correction or the shadowing.",
        "The measured data cannot be tested; another cause can. Data made with a source of 5° radius and fitted "
        "with a point source err at the peaks of samples 2 to 5 with just these signs. (Not with the paper's size: "
        "a source wider than 1.2° would have made sample 1 look rougher than its σ of 0.006, and 1.2° err by 1 % "
        "only.)",
        Kind.MODEL,
        wide_source_explains_the_peaks,
    ),
    Statement(
        14,
        "Sample 3: the intensity errs with a standard deviation of 4 DN, at most by about 17 % (at position 3's "
        "maximum).",
        _MEASURED,
        Kind.MEASURED,
    ),
    Statement(
        15,
        "The DoP has a specular peak and a diffuse slope; off the peak it falls quickly.",
        "15° of turn off the peak at most half of its DoP is left, every sample and position.",
        Kind.MODEL,
        falls_off_the_peak,
    ),
    Statement(
        16,
        "The largest DoP grows from position 1 to 3, as the local incidence stays below Brewster's angle.",
        "It grows for every sample, and the last Ψ/2 is below arctan n.",
        Kind.MODEL,
        maximum_grows,
    ),
    Statement(
        17,
        "For every sample and position the DoP at large θr is not 0 and grows with θr; its angle is that of "
        "transmitted light.",
        "From 17° off the mirror direction to θr = 78°: DoP above 1 % and growing, its plane at right angles to "
        "that of the peak (the paper's 90° counts from an axis of its instrument).",
        Kind.MODEL,
        crossed_and_growing,
    ),
    Statement(
        18,
        "The DoP passes through 0 on both sides of the peak.",
        "Q/I changes sign within 16° of turn on both sides, every sample and position.",
        Kind.MODEL,
        zeros_beside_the_peak,
    ),
    Statement(
        19,
        "Right of the peak the DoP curves of the positions are shifted copies: equal θr, equal diffuse DoP.",
        "The diffuse DoP at θr = 40°, 60°, 70° varies by at most 0.01 (the imager's accuracy) over θi = 0° … 60°, "
        "every sample.",
        Kind.MODEL,
        equal_view_equal_dop,
    ),
    Statement(
        20,
        "The DoP fits better than the intensity; right of the peak the modelled DoP is always below the measured one.",
        _MEASURED,
        Kind.MEASURED,
    ),
    Statement(
        21,
        "Sample 4 fits badly at 10° to 30°, where little light is reflected and quantisation matters.",
        _MEASURED + " What quantisation does to simulated data can be seen with --bits.",
        Kind.MEASURED,
    ),
    Statement(
        22,
        "Sample 3: the DoP errs with a standard deviation of 0.028, most where it passes through 0.",
        _MEASURED,
        Kind.MEASURED,
    ),
    Statement(23, "Errors at the strongest diffuse point: 20 %, 13 %, 38 %.", _MEASURED, Kind.MEASURED),
    Statement(24, "Errors at the strongest specular point: 0.1 %, 1.6 %, 3 %.", _MEASURED, Kind.MEASURED),
    Statement(
        25,
        "Inversions from many initial values agree: the optimum is the only one.",
        "Every start, spread over the whole range of all parameters, ends at the best optimum, every sample.",
        Kind.TABLE,
    ),
    Statement(
        26,
        "Positions 1 and 2 serve the inversion, position 3 the validation.",
        "Done so here: figures 5 to 8.",
        Kind.SHOWN,
    ),
    Statement(
        27,
        "The errors grow for the smooth white paint and at large local incidence.",
        _MEASURED,
        Kind.MEASURED,
    ),
    Statement(
        28,
        "Source stable to 0.001, imager accurate to 1 % (linear) and 5 % (circular), 476 nm.",
        "Taken over for the simulated instrument.",
        Kind.SHOWN,
    ),
)


@dataclass(frozen=True)
class Evaluated:
    """A statement and what its tests found.

    Attributes
    ----------
    statement
        The statement.
    outcomes
        By the name of the interpretation; for statements on parameters by :data:`PRINTED` and :data:`RECOVERED`; empty
        where nothing was tested.
    """

    statement: Statement
    outcomes: Mapping[str, Outcome]


def evaluate(
    positions: Sequence[float], samples: Sequence[Sample], progress: Callable[[int, int], None] | None = None
) -> list[Evaluated]:
    """Test every statement that can be tested.

    Parameters
    ----------
    positions
        Bistatic angles of the camera positions, radians, ascending.
    samples
        The five inverted samples.
    progress
        Called with the number of evaluated statements and of all.
    """
    found = []
    if progress is not None:
        progress(0, len(STATEMENTS))
    for done, statement in enumerate(STATEMENTS, start=1):
        outcomes: dict[str, Outcome] = {}
        if statement.test is not None:
            outcomes = {each.name: statement.test(each, positions) for each in INTERPRETATIONS}
        elif statement.number in _ON_PARAMETERS:
            test, name = _ON_PARAMETERS[statement.number]
            column = ("sigma", "n", "a", "k", "b", "t").index(name)
            outcomes = {
                PRINTED: test([values[column] for values in PAINTS.values()]),
                RECOVERED: test(
                    [s.result.estimates[name].value for s in samples],
                    [s.result.estimates[name].std for s in samples],
                ),
            }
        elif statement.kind is Kind.TABLE:
            outcomes = {RECOVERED: starts_agree(samples)}
        found.append(Evaluated(statement, outcomes))
        if progress is not None:
            progress(done, len(STATEMENTS))
    return found


#: Tests of parameters by the number of the statement, with the parameter that they look at.
_ON_PARAMETERS: dict[int, tuple[Callable[..., Outcome], str]] = {
    7: (roughnesses, "sigma"),
    8: (polarised_shares, "t"),
}
