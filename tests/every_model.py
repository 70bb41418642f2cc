"""Every model there is, for tests of what holds for all: those of the package, and one that a user wrote."""

from __future__ import annotations

import numpy as np
import pytest

from own_model import LambertGGX
from pbrdf.models import MODELS

#: Runs a test over every model class.
EVERY = pytest.mark.parametrize("cls", [*MODELS.values(), LambertGGX], ids=lambda cls: cls.name)


def example(cls, seed=0, size=None):
    """A model with parameters drawn within the bounds of a fit: numbers, or arrays."""
    rng = np.random.default_rng(seed)
    values = {}
    for p in cls.parameters:
        share = 0.1 + 0.8 * rng.random(size)
        # an extinction of 0 half of the time: by structure where all are
        absent = 0.0 if p.vanishing and seed % 2 == 0 else 1.0
        if p.amplitude:
            values[p.name] = share
        elif p.logarithmic:
            values[p.name] = p.lower * (p.upper / p.lower) ** share
        else:
            values[p.name] = absent * (p.lower + share * (p.upper - p.lower))
    return cls(**values)
