"""Identifications that the report tests look at, made once."""

from __future__ import annotations

import pytest

import pbrdf
from pbrdf.identification.identify import identify
from pbrdf.identification.library import bundled_library
from pbrdf.report.identification.subject import Identified


@pytest.fixture(scope="session")
def identified():
    """White paint over three curves, the gain not known."""
    dataset = pbrdf.open_experiment("white")
    return Identified(identify(dataset, bundled_library()), dataset, "white", "the bundled paints")


@pytest.fixture(scope="session")
def scattered():
    """Three geometries that are on no curve, with noise that leaves several materials; the gain known."""
    dataset = pbrdf.open_experiment("cd-back").isel(geometry=slice(0, 63, 21))
    found = identify(dataset, bundled_library(), noise="5%,1%", gain=False)
    return Identified(found, dataset, "cd-back", "the bundled paints")
