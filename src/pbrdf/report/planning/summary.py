"""A plan in words and numbers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from pbrdf.report.numbers import brief
from pbrdf.report.printing import plain_table, print_parts

if TYPE_CHECKING:
    from rich.console import Console, RenderableType

    from pbrdf.planning.plan import Plan

__all__ = ["print_plan", "reading_list"]


def print_plan(plan: Plan, console: Console, *, reference: str = "3 × 21") -> None:
    """Print the expected standard errors beside those of the reference, and what is read where.

    Parameters
    ----------
    plan
        The plan.
    console
        Where to.
    reference
        What the protocol that it is compared with is called.
    """
    print_parts(_parts(plan, reference), console)


def _parts(plan: Plan, reference: str) -> Iterator[RenderableType]:
    readings = len(plan.protocol)
    yield (
        f"{readings} readings at {int((plan.counts > 0).sum())} geometries, {plan.criterion}-optimal among "
        f"{len(plan.candidates)}, for {plan.model!r}"
    )
    yield f"Uncertainties: {plan.noise}"
    if not plan.angle_error:
        yield "The angles are taken as exact, which for a narrow lobe no goniometer is."
    table = plain_table(
        "expected standard errors", "parameter", "guess", "this plan", f"plan {reference}", "ratio"
    )
    rows = zip(plan.names, plan.values, plan.std, plan.reference_std, strict=True)
    for name, value, own, other in rows:
        table.add_row(name, brief(value), brief(own, 2), brief(other, 2), f"{other / own:.2f}")
    yield table
    yield (
        f"By this criterion a reading of the plan tells as much as {brief(plan.gain, 3)} of the plan {reference} "
        f"({len(plan.reference)} readings)."
    )
    yield (
        f"No plan of as many readings of these candidates, with any repetition, is better by more than "
        f"{100.0 * (1.0 / plan.efficiency - 1.0):.0f} % in variance."
    )
    yield ""
    yield from reading_list(plan)


def reading_list(plan: Plan) -> list[str]:
    """What is read at each camera position, one line each."""
    protocol = plan.protocol
    lines = []
    for number in np.unique(protocol.group):
        rows = protocol.group == number
        psi = float(np.rad2deg(protocol.bistatic[rows].mean()))
        in_plane = (np.abs(np.sin(protocol.phi[rows])) < 1e-9).all()
        if np.isnan(protocol.sample_angle[rows]).any() or not in_plane:
            lines.append(f"position {number} ({psi:.4g}°): {int(rows.sum())} readings, see the table")
            continue
        angles, counts = np.unique(np.round(np.rad2deg(protocol.sample_angle[rows]), 6), return_counts=True)
        shown = [f"{a:g}" + (f" (×{n})" if n > 1 else "") for a, n in zip(angles, counts, strict=True)]
        lines.append(f"position {number}, source to camera {psi:.4g}°: sample at {', '.join(shown)}")
    return lines
