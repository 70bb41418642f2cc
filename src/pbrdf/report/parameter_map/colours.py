"""Colours of the pixels of a map that have no value, and the scale of those that have one.

None of these colours is in viridis or cividis, which the values have, and readers who do not tell red from green tell
them apart.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pbrdf.report.parameter_map.shown_map import GOOD, PENDING, WITHOUT

__all__ = [
    "LEFT_OUT",
    "MASKED",
    "NOT_YET",
    "NO_RESULT",
    "ON_BOUND",
    "UNDETERMINED",
    "WIDE",
    "colours_of_states",
    "scale_of",
]

#: Percentages of the pixels that a scale leaves out at each end.
LEFT_OUT = 1.0
#: Pixels that were not measured or left out, those without a result, those that nobody has come to.
MASKED, NO_RESULT, NOT_YET = "#D9D9D9", "#D55E00", "#FFFFFF"
#: A parameter that the data of a pixel do not determine, and one on a bound in the map of standard errors.
UNDETERMINED, ON_BOUND = "#CC79A7", "#009E73"
#: Colours of the states of a pixel, those of other names after them.
_STATES = {
    GOOD: "#56B4E9",
    "not_converged": "#E69F00",
    "too_few_values": "#F0E442",
    "failed": NO_RESULT,
    **dict.fromkeys(WITHOUT, MASKED),
    PENDING: NOT_YET,
}
_OTHER_STATES = ("#009E73", "#000000")
#: Errors whose scale spans more than this factor are shown in their logarithm.
WIDE = 20.0


def colours_of_states(states: Sequence[str]) -> list[str]:
    """A colour for each state that a pixel can be in."""
    others = iter(_OTHER_STATES)
    return [_STATES.get(name) or next(others, "#000000") for name in states]


def scale_of(values: np.ndarray) -> tuple[float, float]:
    """Ends of a scale that holds nearly all of these numbers."""
    values = values[np.isfinite(values)]
    if values.size == 0:
        return 0.0, 1.0
    low, high = (float(v) for v in np.percentile(values, (LEFT_OUT, 100.0 - LEFT_OUT)))
    if high - low <= 1e-9 * max(abs(low), abs(high)):
        wide = 0.05 * max(abs(low), abs(high)) or 0.5
        low, high = low - wide, high + wide
    return low, high
