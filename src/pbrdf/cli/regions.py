"""Regions of a picture as ``--regions`` and ``--roi`` give them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pbrdf.cli.values import pairs
from pbrdf.errors import PbrdfError

if TYPE_CHECKING:
    from pbrdf.instruments.reduction.regions import Region

__all__ = ["open_regions"]


def open_regions(file: Path | None, texts: list[str]) -> dict[str, Region]:
    """Regions of --regions and --roi by name; raises PbrdfError if one is not understood or a name comes twice."""
    from pbrdf.instruments.reduction.region_files import read_regions, region_from_text

    found = {} if file is None else read_regions(file)
    for name, text in pairs(texts, "--roi", "paint=100:200,150:260").items():
        if name in found:
            raise PbrdfError(f"--roi {name}: {file} has a region of that name too")
        try:
            found[name] = region_from_text(text)
        except PbrdfError as error:
            raise PbrdfError(f"--roi {name}: {error}") from error
    return found
