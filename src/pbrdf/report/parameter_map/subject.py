"""What a report on a map is about."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["MapReport"]


@dataclass(frozen=True, eq=False)
class MapReport:
    """A map with what is known of how it came about.

    Attributes
    ----------
    dataset
        The map as :func:`pbrdf.fit_map` gives it; its values may be lazy.
    path
        The file or store that it is in.
    sources
        Names of what was fitted.
    settings
        What the command was given, by name.
    command
        The line that repeats it; empty if there is none.
    simulated
        Whether the data are no measurement.
    labels
        Parts of the sample, as of :func:`pbrdf.instruments.pixel_geometry.labels.read_labels`; None where pixels have
        none.
    """

    dataset: xr.Dataset
    path: Path
    sources: Sequence[str] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)
    command: str = ""
    simulated: bool = False
    labels: xr.DataArray | None = None
