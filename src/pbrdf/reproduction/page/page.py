"""The report as one page."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pbrdf.report.numbers import brief
from pbrdf.report.page import (
    Section,
    bullets,
    embedded_picture,
    figure,
    markup,
    paragraph,
    render_page,
)
from pbrdf.reproduction import paper
from pbrdf.reproduction.experiment.sample import Sample
from pbrdf.reproduction.interpretations import DEFAULT, LITERAL
from pbrdf.reproduction.page.page_tables import (
    error_table,
    number_table,
    parameter_table,
    statement_table,
    strongest_table,
)
from pbrdf.reproduction.page.tables import recovered
from pbrdf.reproduction.result import Reproduction
from pbrdf.reproduction.statements.catalogue import Evaluated
from pbrdf.reproduction.statements.parameters import agreement
from pbrdf.reproduction.statements.statement import Kind
from pbrdf.version import __version__

if TYPE_CHECKING:
    from markupsafe import Markup

__all__ = ["page_text", "verdicts_in_words"]

#: Pull that one of thirty parameters hardly reaches by noise.
_SYSTEMATIC = 4.0


def page_text(reproduction: Reproduction, folder: Path) -> str:
    """The page as HTML; pictures are taken from `folder` into the page itself."""
    return render_page(
        "The double-Gauss pBRDF paper, reproduced",
        _sections(reproduction, folder),
        banner=f"{paper.SIMULATED}. Everything here but the paper's own numbers, in grey, was computed from its model "
        "and its table 1.",
    )


def verdicts_in_words(statements: Sequence[Evaluated]) -> list[str]:
    """How many statements hold under the default interpretation, which fail, and how the letter of the paper does."""
    lines = []
    for interpretation, what in ((DEFAULT, "default reading"), (LITERAL, "letter of eqs (12), (13)")):
        tested = [e for e in statements if interpretation.name in e.outcomes]
        failed = [e.statement.number for e in tested if not e.outcomes[interpretation.name].passed]
        shown = ", ".join(f"#{n}" for n in failed)
        lines.append(
            f"{interpretation.name} ({what}): {len(tested) - len(failed)} of {len(tested)} statements about the model "
            "hold" + (f"; {shown} fail{'s' if len(failed) == 1 else ''}." if failed else ".")
        )
    on_parameters = [
        (e.statement.number, name, outcome)
        for e in statements
        if e.statement.kind is Kind.TABLE
        for name, outcome in e.outcomes.items()
    ]
    broken = ", ".join(f"#{n} ({name})" for n, name, outcome in on_parameters if not outcome.passed)
    good = sum(outcome.passed for _, _, outcome in on_parameters)
    lines.append(
        f"Parameters: {good} of {len(on_parameters)} tests hold" + (f"; fails: {broken}." if broken else ".")
    )
    return lines


def _sections(reproduction: Reproduction, folder: Path) -> Iterator[Section]:
    samples, options = reproduction.samples, reproduction.options

    def picture(name: str, alternative: str, caption: str) -> Markup:
        files = [f"figures/{name}.{kind}" for kind in ("png", "svg")]
        return figure(embedded_picture(folder / files[0], alternative), caption, files)

    yield Section(
        "",
        [
            paragraph(
                f"{paper.PAPER} describes a polarimetric BRDF of painted surfaces, measures five paints with an "
                "imaging polarimeter, and fits the model to two camera positions to predict a third. Here the five "
                "paints of its table 1 are measured in a simulation (frames of the imager, reduced to Stokes vectors), "
                "inverted the paper's way, and each of its statements that follows from the model is tested."
            ),
            paragraph(f"Settings: {options.in_words()}. pbrdf {__version__}."),
            bullets(verdicts_in_words(reproduction.statements)),
        ],
    )
    yield Section(
        "Figure 3: the model over the hemisphere",
        [
            picture(
                "figure-3",
                "Polar surfaces of intensity and degree of polarisation, and cuts through the plane of incidence",
                "Left: distance from the origin is the value, as in the paper; φ = 0° is forward. Right: the plane of "
                "incidence in all readings of eqs (12), (13).",
            )
        ],
    )
    largest = _largest_pull(samples)
    yield Section(
        "Table 1: parameters, true and recovered",
        [
            parameter_table(samples),
            *map(paragraph, _starts_in_words(samples)),
            *([paragraph(largest)] if largest else []),
        ],
    )
    yield Section(
        "Figures 5 and 7: measurement and model",
        [
            paragraph(
                "Points are the simulated measurement, lines the model fitted to positions 1 and 2; position 3 (open, "
                "broken) was not fitted: it is predicted. Intensities are the first Stokes parameter in digital "
                "numbers (DN) at the sample's exposure; the frames themselves, behind the analyser, stay below 80 % of "
                "the range."
            ),
            *(
                picture(
                    name, f"{what} of five samples against the sample's angle", f"{what}; {paper.SIMULATED}."
                )
                for name, what in (("figure-5", "Intensity"), ("figure-7", "Degree of polarisation"))
            ),
        ],
    )
    yield Section(
        "Figures 6 and 8: errors",
        [
            *(
                picture(name, f"{what} of sample 3", f"{what}; {paper.SIMULATED}.")
                for name, what in (
                    ("figure-6", "Errors of the intensity"),
                    ("figure-8", "Errors of the degree of polarisation"),
                )
            ),
            error_table(samples),
            paragraph(
                "Where a sample sends no more than a few DN the measured DoP is noise, and noise polarises: the points "
                "far above the curves of figure 7 at small Angle_S_I, and the large standard deviations that they "
                "make. The paper reports the same of its sample 4 at 10° to 30° (#21)."
            ),
            strongest_table(samples),
            paragraph(
                "The paper's numbers are errors of the model against real paint; ours are the noise of a simulated "
                "measurement against the model that made it. They cannot be compared, but one thing can be seen: where "
                "the diffuse light is polarised by a few per cent, the imager's stated accuracy of 0.01 alone makes "
                "relative errors of 10 % and more."
            ),
            paragraph(
                'The paper names neither its camera nor its scale. Its 17 % at the maximum of position 3 and its "less '
                'than 20 DN" put that maximum below 120 DN, which suits a camera of eight bits (--bits 8).'
            ),
        ],
    )
    yield Section(
        "The paper's statements",
        [
            paragraph(
                "Readings: eq. (13) normalises the diffuse light of the facets, weighted by how many there are of each "
                "(weighted) or over all that are visible, all alike (visible); M_t holds transmittances of the flux or "
                "the squared amplitudes that the text literally asks for. "
                f"{DEFAULT.name} is the default of this software, {LITERAL.name} the letter of the paper. Where a "
                "column fails, that reading contradicts what the paper reports."
            ),
            statement_table(reproduction.statements),
        ],
    )
    yield Section("Numbers expected of the model", [number_table(reproduction.numbers)])
    yield Section("What is the paper's and what is ours", _provenance())
    yield Section(
        "Files",
        [
            markup(
                "<p><code>data/</code> the simulated measurements (read by <code>pbrdf fit</code>), "
                "<code>models/</code> the fitted models, <code>tables/</code> every number on this page, "
                "<code>figures/</code> the pictures as PNG and SVG.</p>"
            )
        ],
    )


def _starts_in_words(samples: Sequence[Sample]) -> list[str]:
    found = [agreement(sample) for sample in samples]
    lines = [
        "Starts that ended at the best optimum: "
        + ", ".join(
            f"sample {s.number} {a.reached} of {a.starts}" for s, a in zip(samples, found, strict=True)
        )
        + "."
    ]
    for sample, a in zip(samples, found, strict=True):
        if a.reached < a.starts:
            lines.append(
                f"Sample {sample.number} has {a.optima} optima. Every start that reached the best one began at σ ≤ "
                f"{brief(a.reached_sigma, 2)}; the others began at σ ≥ {brief(a.missed_sigma, 2)}."
            )
    return lines


def _largest_pull(samples: Sequence[Sample]) -> str:
    """A sentence if a pull is larger than noise explains."""
    pulls = [(abs(r.pull), r, s) for s in samples for r in recovered(s) if math.isfinite(r.pull)]
    size, worst, sample = max(pulls, key=lambda entry: entry[0], default=(0.0, None, None))
    if worst is None or sample is None or size <= _SYSTEMATIC:
        return ""
    return (
        f"{worst.symbol} of sample {sample.number} is off by {size:.0f} standard errors. These describe noise; "
        "what errs the same way at every angle (rounding to few bits, a source wider than a point, a fixed error "
        "of the calibration) they do not cover."
    )


def _provenance() -> list[Markup]:
    theirs = (
        "the model's equations, table 1, the parameters of figure 3",
        "the protocol: a fixed bistatic angle for each of three camera positions, 21 sample angles, positions 1 "
        "and 2 fitted in steps (diffuse, then specular), position 3 predicted",
        "the imager's accuracy, 1 % linear and 5 % circular, and the source's stability, 0.001",
    )
    ours = (
        "the camera positions, the 21 angles, the retardances of the imager, the detector and its number of bits: "
        "the paper prints none of them",
        "every measured value: simulated frames with the noise stated under Settings",
        "the last step of the inversion, in which all parameters are fitted together, and the standard errors",
        "the tests of the statements and their tolerances",
    )

    return [
        paragraph("The paper's:"),
        bullets(theirs),
        paragraph("Ours:"),
        bullets(ours),
        paragraph(
            "Simulated data follow the model exactly. That the parameters come back and position 3 is predicted shows "
            "that the inversion works and what the noise does to it, not that real paint obeys the model."
        ),
    ]
