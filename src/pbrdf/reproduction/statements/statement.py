"""What a statement of the paper is, and what its test returns."""

from __future__ import annotations

import enum
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from pbrdf.reproduction.interpretations import Interpretation

__all__ = ["Kind", "Outcome", "Statement", "listed", "signed"]


class Outcome(NamedTuple):
    """What a test found.

    Attributes
    ----------
    value
        The numbers, in the order that the test's docstring gives.
    passed
        Whether the statement holds.
    text
        The numbers as a reader wants them.
    """

    value: tuple[float, ...]
    passed: bool
    text: str


class Kind(enum.StrEnum):
    """What a statement is about."""

    MODEL = "model"  # follows from the model, or does not: tested for every interpretation
    TABLE = "parameters"  # about table 1: tested on the printed and on the recovered parameters
    SHOWN = "shown"  # a figure or a protocol: nothing to test
    MEASURED = "measured data"  # about the paper's measured data only: not tested


@dataclass(frozen=True)
class Statement:
    """One statement of the paper.

    Attributes
    ----------
    number
        As in the table of `docs/reproduction.md`.
    said
        What the paper says, in plain words.
    tested
        The test in words; what stands in its place where there is none.
    kind
        What it is about.
    test
        From an interpretation and the bistatic angles of the camera positions (radians, ascending) to the outcome; None
        where the interpretation does not matter or there is no test.
    """

    number: int
    said: str
    tested: str
    kind: Kind
    test: Callable[[Interpretation, Sequence[float]], Outcome] | None = None


def listed(values: Sequence[float], form: str = ".2f", unit: str = "") -> str:
    """Numbers in a row, with true minus signs."""
    return ", ".join(f"{v:{form}}".replace("-", "−") for v in values) + unit


def signed(value: float, digits: int) -> str:
    """A number with its sign, a true minus; 0 has none, and NaN is a dash."""
    if math.isnan(value):
        return "–"
    rounded = round(value, digits)
    return f"{rounded:+.{digits}f}".replace("-", "−") if rounded else f"{0.0:.{digits}f}"
