"""A fit together with what it was made of: what every part of a report starts from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr

    from pbrdf.inversion.result import FitResult
    from pbrdf.report.fit.checks import Checks

__all__ = ["Report"]


@dataclass(frozen=True)
class Report:
    """What is reported on.

    Attributes
    ----------
    result
        What the fit found.
    dataset
        The data it was made on.
    name
        What to call the data: a file or a bundled paint.
    settings
        How the fit was asked for, in plain values; kept with the numbers so that they can be had again.
    checks
        What else was looked at; None if nothing.
    command
        The line for a shell that asked for the fit; empty where none did.
    sha256
        Of the file of data, hexadecimal; empty where there is no single file.
    """

    result: FitResult
    dataset: xr.Dataset
    name: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    checks: Checks | None = None
    command: str = ""
    sha256: str = ""
