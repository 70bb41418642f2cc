"""The tables of the page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pbrdf.report.numbers import brief, with_error
from pbrdf.report.page import holds, markup, table
from pbrdf.reproduction import paper
from pbrdf.reproduction.experiment.errors import error_numbers, position_errors
from pbrdf.reproduction.experiment.sample import Sample
from pbrdf.reproduction.interpretations import INTERPRETATIONS
from pbrdf.reproduction.page.tables import recovered
from pbrdf.reproduction.statements.catalogue import PRINTED, RECOVERED, Evaluated
from pbrdf.reproduction.statements.expected import Number
from pbrdf.reproduction.statements.statement import Outcome, signed

if TYPE_CHECKING:
    from markupsafe import Markup

__all__ = ["error_table", "number_table", "parameter_table", "statement_table", "strongest_table"]


def parameter_table(samples: Sequence[Sample]) -> Markup:
    """True and recovered parameters of the samples."""
    names = [r.symbol for r in recovered(samples[0])]
    rows: list[list[str | Markup]] = []
    classes = []
    for sample in samples:
        found = recovered(sample)
        rows.append([markup("<b>{}</b>", sample.label), "table 1", *(f"{r.true:.4f}" for r in found)])
        rows.append(["", "recovered ± standard error", *(with_error(r.value, r.std) for r in found)])
        rows.append(["", "pull", *(signed(r.pull, 1) for r in found)])
        classes += ["first", "", ""]
    return table(
        "Pull: (recovered − true)/standard error; about two of three lie within ±1 if the standard errors are right.",
        ["sample", "", *names],
        rows,
        numeric=range(2, 2 + len(names)),
        classes=classes,
    )


def error_table(samples: Sequence[Sample]) -> Markup:
    """Errors over all points beside the paper's."""
    rows = [
        [
            "Paper, sample 3 (measured)",
            f"{paper.INTENSITY_STD:g} DN",
            "",
            f"{paper.INTENSITY_MAX:.0%}, position 3".replace("%", " %"),
            f"{paper.DOP_STD:g}",
            "",
        ]
    ]
    for sample in samples:
        intensity, degree = error_numbers(sample)
        peak = float(np.nanmax(sample.intensity))
        rows.append(
            [
                sample.label,
                f"{brief(intensity.std, 3)} DN",
                f"{100.0 * intensity.std / peak:.2f} %",
                f"{signed(100.0 * intensity.share, 2)} %, position {intensity.position}",
                f"{degree.std:.4f}",
                f"{signed(degree.largest, 3)}, position {degree.position}",
            ]
        )
    return table(
        "Errors (model − measured) over all points. The paper's are errors against measured data and not comparable.",
        ["", "intensity: std", "… of the brightest", "largest, of the value there", "DoP: std", "largest"],
        rows,
        numeric=range(1, 6),
        classes=["theirs", *[""] * len(samples)],
    )


def strongest_table(samples: Sequence[Sample]) -> Markup:
    """Errors at the strongest points beside the paper's."""
    rows: list[list[str]] = []
    classes = []
    for position, (diffuse, specular) in enumerate(
        zip(paper.DIFFUSE_ERRORS, paper.SPECULAR_ERRORS, strict=True), start=1
    ):
        label = "Paper, sample 3 (measured)" if position == 1 else ""
        rows.append([label, f"{position}", f"{100 * diffuse:g} %", f"{100 * specular:g} %", "", ""])
        classes.append("theirs")
    for sample in samples:
        for errors in position_errors(sample):
            first = errors.position == 1
            rows.append(
                [
                    sample.label if first else "",
                    f"{errors.position}" + (" (predicted)" if errors.held_out else ""),
                    *(
                        f"{signed(100.0 * value, digits)} %"
                        for value, digits in (
                            (errors.dolp_diffuse, 1),
                            (errors.dolp_specular, 1),
                            (errors.intensity_diffuse, 2),
                            (errors.intensity_specular, 2),
                        )
                    ),
                ]
            )
            classes.append("first" if first else "")
    return table(
        "Relative errors at the strongest diffuse and specular points (strongest in the modelled quantity itself). The "
        "paper's stand in its paragraph on the degree of polarisation of sample 3; they are measured and not "
        "comparable.",
        ["", "position", "DoP, diffuse", "DoP, specular", "intensity, diffuse", "intensity, specular"],
        rows,
        numeric=range(2, 6),
        classes=classes,
    )


def statement_table(statements: Sequence[Evaluated]) -> Markup:
    """The statements with their outcomes under every interpretation."""
    rows: list[list[str | Markup | None]] = []
    for entry in statements:
        statement = entry.statement
        row: list[str | Markup | None] = [
            str(statement.number),
            markup('{}<br><span class="small">Test: {}</span>', statement.said, statement.tested)
            if entry.outcomes
            else statement.said,
        ]
        if not entry.outcomes:
            row += [markup('<span class="small">{}</span>', statement.tested), None, None, None]
        elif set(entry.outcomes) <= {PRINTED, RECOVERED}:
            row += [
                markup("<br>").join(
                    markup("{}: {}", name, _outcome(o)) for name, o in entry.outcomes.items()
                ),
                None,
                None,
                None,
            ]
        else:
            row += [
                _outcome(entry.outcomes[interpretation.name], markup("<br>"))
                for interpretation in INTERPRETATIONS
            ]
        rows.append(row)
    return table(
        "What the paper says, how it is tested, and what the model does in each reading.",
        ["#", "statement", *(interpretation.name for interpretation in INTERPRETATIONS)],
        rows,
    )


def _outcome(outcome: Outcome, between: str = " ") -> Markup:
    return markup('{}{}<span class="small">{}</span>', holds(outcome.passed), between, outcome.text)


def number_table(numbers: Sequence[Number]) -> Markup:
    """Numbers expected of the model."""

    def joined(values: Sequence[float]) -> str:
        return ", ".join("never" if math.isnan(v) else brief(v) for v in values)

    return table(
        "Worked out from the equations beforehand; no statement of the paper. The zeros of sample 3 (#18) were "
        "expected at 6° to 7°: left of the peak the model has 7.4°, which the tolerance does not cover. The zeros "
        "of figure 3 (#4) were worked out for a flat coating; facets of σ = 0.1 move them by 0.3°.",
        ["#", "quantity", "reading", "expected", "tolerance", "found", ""],
        [
            [
                str(n.statement),
                n.quantity,
                n.interpretation,
                joined(n.expected),
                f"± {n.tolerance:.2g}",
                joined(n.found),
                holds(n.within, "within", "outside"),
            ]
            for n in numbers
        ],
    )
