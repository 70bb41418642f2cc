"""What labelled measurements, or pixels, were taken for: sentence, table and numbers."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pbrdf.identification.confusion import Confusion

__all__ = [
    "confusion_headings",
    "confusion_record",
    "confusion_rows",
    "confusion_sentence",
    "level_of_sets",
]


def confusion_headings(what: str) -> tuple[str, ...]:
    """Headings of :func:`confusion_rows`; ``what`` was labelled, ``"measurements"`` or ``"pixels"``."""
    return "material", what, "told as itself", "as another", "as none", "in the set"


def confusion_rows(table: Confusion) -> list[list[str]]:
    """True materials as texts below :func:`confusion_headings`."""
    rows = []
    for r, name in enumerate(table.truth):
        total, none = int(table.counts[r].sum()), int(table.counts[r, -1])
        if table.strangers[r]:
            rows.append([f"{name} (not in the library)", str(total), "–", str(total - none), str(none), "–"])
            continue
        own = int(table.taken_rightly[r])
        held = f"{100.0 * table.coverage[r]:.0f} %"
        rows.append([name, str(total), str(own), str(total - own - none), str(none), held])
    return rows


def confusion_sentence(table: Confusion, what: str) -> str:
    """How good sets and probabilities are, in one sentence."""
    unknown = int(table.counts[table.strangers].sum())
    parts = []
    if table.reliability is not None:
        parts.append(
            f"of {table.total - unknown} labelled {what} the {100.0 * table.confidence:g} % set held the true material "
            f"for {100.0 * table.held:.1f} %; the most probable was right for {100.0 * table.reliability.right:.1f} "
            f"%; expected calibration error {table.reliability.error:.3f}"
        )
    if unknown:
        empty = int(table.counts[table.strangers, -1].sum())
        parts.append(
            f"of {unknown} labelled {what} of materials that the library has not got {empty} were told as none"
        )
    return "; ".join(parts)


def level_of_sets(table: Confusion) -> str:
    """Whether sets held what they promise but for chance, in the words that give a verdict its colour."""
    known = int(table.counts[~table.strangers].sum())
    if not known:
        return "in part"
    error = math.sqrt(table.confidence * (1.0 - table.confidence) / known)
    return "describes" if table.held >= table.confidence - 2.0 * error else "not"


def confusion_record(table: Confusion) -> dict[str, Any]:
    """Everything as plain values."""
    found = table.reliability
    return {
        "materials": list(table.truth),
        "in_library": ~table.strangers,
        "measurements": table.counts.sum(axis=1),
        "coverage": table.coverage,
        "set_size": table.set_size,
        "confusion": table.counts,
        "confusion_columns": list(table.taken_for),
        "accuracy": None if found is None else found.right,
        "told_rightly": table.accuracy,
        "expected_calibration_error": None if found is None else found.error,
        "reliability": None
        if found is None
        else {
            "edges": found.edges,
            "confidence": np.where(found.count > 0, found.confidence, np.nan),
            "accuracy": found.accuracy,
            "count": found.count,
        },
    }
