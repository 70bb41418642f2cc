"""A comparison that the tests of its report look at, made once."""

from __future__ import annotations

import pytest

import pbrdf
from own_model import LambertGGX
from pbrdf.inversion.ladder import Rung
from pbrdf.inversion.model_comparison import compare_models
from pbrdf.report.comparison.subject import Compared


class Silent(LambertGGX):
    """A model that cannot be evaluated."""

    name = "silent"

    def kernel(self, geometry, values, part="total"):
        raise ValueError("no formula [yet]")


@pytest.fixture(scope="session")
def compared():
    """Two readings of a bundled paint's model, an ablation, facets with long tails, and one that fails."""
    rungs = ["double-gauss", LambertGGX, Silent, Rung("no facets [0]", LambertGGX, fix={"index": 1.0})]
    data = pbrdf.open_experiment("matte-white-thick")
    return Compared(
        compare_models(data, rungs, hold_out="group=3", vary=0, starts=2), "matte-white-thick", {"starts": 2}
    )
