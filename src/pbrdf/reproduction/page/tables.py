"""Every number of the reproduction as rows of tables, for files and for the page."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pbrdf.reproduction.experiment.errors import error_numbers, position_errors
from pbrdf.reproduction.experiment.sample import Sample
from pbrdf.reproduction.paper import PAPER, SIMULATED
from pbrdf.reproduction.statements.catalogue import Evaluated
from pbrdf.reproduction.statements.expected import Number
from pbrdf.reproduction.statements.parameters import agreement

__all__ = ["Recovered", "csv_text", "recovered", "tables"]

Row = dict[str, object]


@dataclass(frozen=True)
class Recovered:
    """One parameter of one sample.

    Attributes
    ----------
    name, symbol
        The parameter.
    true, value, std
        Table 1, the inversion's value and its standard error (NaN if it has none).
    verdict
        As in :class:`pbrdf.inversion.fit.Estimate`.
    """

    name: str
    symbol: str
    true: float
    value: float
    std: float
    verdict: str

    @property
    def pull(self) -> float:
        """(value − true)/standard error."""
        return (self.value - self.true) / self.std if self.std > 0.0 else math.nan


def recovered(sample: Sample) -> list[Recovered]:
    """The free parameters of a sample, in the order of table 1."""
    return [
        Recovered(name, e.parameter.symbol, float(sample.truth.values[name]), e.value, e.std, e.verdict)
        for name, e in sample.result.estimates.items()
        if e.verdict != "fixed"
    ]


def tables(
    samples: Sequence[Sample], evaluated: Sequence[Evaluated], numbers: Sequence[Number]
) -> dict[str, list[Row]]:
    """All tables by the name of their file, each a list of rows."""
    return {
        "table1": [row for sample in samples for row in _parameters(sample)],
        "starts": [_starts(sample) for sample in samples],
        "points": [row for sample in samples for row in _points(sample)],
        "errors": [_errors(sample) for sample in samples],
        "errors-at-strongest-points": [row for sample in samples for row in _strongest(sample)],
        "statements": [row for entry in evaluated for row in _statement(entry)],
        "expected-numbers": [_number(number) for number in numbers],
    }


def csv_text(rows: Sequence[Mapping[str, object]], settings: str) -> str:
    """A table as CSV under lines of comment that say that it is simulated, and how."""
    text = io.StringIO()
    text.write(f"# {SIMULATED}\n# {settings}\n# paper: {PAPER}\n")
    writer = csv.DictWriter(text, fieldnames=list(rows[0]), lineterminator="\n")
    writer.writeheader()
    for row in rows:
        writer.writerow({key: _cell(value) for key, value in row.items()})
    return text.getvalue()


def _cell(value: object) -> object:
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{value:.6g}"
    return int(value) if isinstance(value, bool) else value


def _parameters(sample: Sample) -> list[Row]:
    return [
        {
            "sample": sample.number,
            "paint": sample.name,
            "parameter": r.name,
            "true": r.true,
            "recovered": r.value,
            "standard_error": r.std,
            "pull": r.pull,
            "verdict": r.verdict,
        }
        for r in recovered(sample)
    ]


def _starts(sample: Sample) -> Row:
    found = agreement(sample)
    return {
        "sample": sample.number,
        "paint": sample.name,
        "starts": found.starts,
        "at_best_optimum": found.reached,
        "optima": found.optima,
        "largest_starting_sigma_that_reached_it": found.reached_sigma,
        "smallest_starting_sigma_that_missed_it": found.missed_sigma,
        "reduced_chi2": sample.result.goodness.reduced_chi2,
    }


def _points(sample: Sample) -> list[Row]:
    columns = {
        "sample_angle_deg": np.rad2deg(sample.angle),
        "theta_i_deg": np.rad2deg(sample.dataset["theta_i"].values),
        "theta_r_deg": np.rad2deg(sample.dataset["theta_r"].values),
        "phi_deg": np.rad2deg(sample.dataset["phi"].values),
        "intensity_measured_dn": sample.intensity,
        "intensity_model_dn": sample.modelled_intensity,
        "dop_measured": sample.dolp,
        "dop_model": sample.modelled_dolp,
    }
    return [
        {
            "sample": sample.number,
            "paint": sample.name,
            "position": int(sample.position[i]),
            "predicted": bool(sample.held_out[i]),
            **{name: float(np.round(column[i], 9)) for name, column in columns.items()},
        }
        for i in range(len(sample.position))
    ]


def _errors(sample: Sample) -> Row:
    intensity, degree = error_numbers(sample)
    return {
        "sample": sample.number,
        "paint": sample.name,
        "intensity_std_dn": intensity.std,
        "intensity_largest_dn": intensity.largest,
        "intensity_largest_relative": intensity.share,
        "intensity_largest_at_position": intensity.position,
        "intensity_largest_at_sample_angle_deg": intensity.angle,
        "largest_intensity_dn": float(np.nanmax(sample.intensity)),
        "dop_std": degree.std,
        "dop_largest": degree.largest,
        "dop_largest_at_position": degree.position,
        "dop_largest_at_sample_angle_deg": degree.angle,
    }


def _strongest(sample: Sample) -> list[Row]:
    return [
        {
            "sample": sample.number,
            "paint": sample.name,
            "position": errors.position,
            "predicted": errors.held_out,
            "dop_diffuse": errors.dolp_diffuse,
            "dop_specular": errors.dolp_specular,
            "intensity_diffuse": errors.intensity_diffuse,
            "intensity_specular": errors.intensity_specular,
        }
        for errors in position_errors(sample)
    ]


def _statement(entry: Evaluated) -> list[Row]:
    statement = entry.statement
    row: Row = {
        "number": statement.number,
        "about": str(statement.kind),
        "statement": statement.said,
        "test": statement.tested,
    }
    if not entry.outcomes:
        return [{**row, "for": "", "result": "not tested", "numbers": ""}]
    return [
        {**row, "for": name, "result": "holds" if outcome.passed else "FAILS", "numbers": outcome.text}
        for name, outcome in entry.outcomes.items()
    ]


def _number(number: Number) -> Row:
    def joined(values: Sequence[float]) -> str:
        return " ".join("never" if math.isnan(v) else f"{v:.5g}" for v in values)

    return {
        "statement": number.statement,
        "quantity": number.quantity,
        "reading": number.interpretation,
        "expected": joined(number.expected),
        "tolerance": number.tolerance,
        "found": joined(number.found),
        "within": number.within,
    }
