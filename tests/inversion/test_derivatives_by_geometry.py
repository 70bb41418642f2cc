"""Derivatives by what moves the geometry, an angle offset and the radius of a source, against finite differences.

They pass through loops within the solver's loops (averages over facets and over the source), where Dr.Jit drops the
derivatives of some kinds of state without a word.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

import pbrdf
from pbrdf.inversion.noise import NoiseModel
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.problem import derivatives, predict
from pbrdf.inversion.unknowns import space_of, with_terms

DEGREE = math.pi / 180.0
#: θ_i and signed θ_r: near and off the lobe, across the normal for an offset of −0.2°, and grazing.
PLACES = (
    np.array([[10, 9.5], [25, 26], [40, 40.2], [60, 59], [60, 75], [10, 0.1], [10, -60], [0.1, 30]]) * DEGREE
)


def problem(model, terms, channels="I"):
    theta_i, signed = PLACES.T
    columns = {c: np.full(len(signed), 0.3 if c == "I" else 0.01) for c in channels}
    ds = pbrdf.make_dataset(
        theta_i, np.abs(signed), np.where(signed < 0.0, np.pi, 0.0), quantity="brdf", **columns
    )
    data = Observations.from_dataset(ds, NoiseModel(0.02, 0.02))
    space, _ = space_of(model, {}, {}, (), {}, {}, data)
    return with_terms(space, data, {}, {}, terms, {}, "linear"), data


@pytest.mark.slow
@pytest.mark.parametrize("terms", [["angle"], ["source"], ["angle", "source"]])
@pytest.mark.parametrize(
    "model", ["double-gauss", "reciprocal-double-gauss", "visible", "hyde-type", "ggx-lambert", "baek-2018"]
)
def test_derivatives_by_the_terms_of_the_instrument(model, terms):
    kind = {"visible": pbrdf.DoubleGauss(0.04, 1.6, 1.0, 1.2, 0.0, 0.5, normalization="visible")}.get(
        model, model
    )
    space, data = problem(kind, terms, "IQU")
    values = {p.name: math.sqrt(low * high) if p.logarithmic else 0.6 * low + 0.4 * high
              for p, low, high in zip(space.free, space.lower, space.upper, strict=True)}  # fmt: skip
    narrow = {p.name: 0.007 for p in space.free if p.name == "sigma"}
    values |= {**narrow, "angle": -0.2 * DEGREE, "source": 0.7 * DEGREE}
    u = space.to_unknowns(np.array([values[name] for name in space.names]))
    _, exact = derivatives(space, u[None], data, data.channels)
    for i, p in enumerate(space.free):
        step = np.zeros(len(u))
        step[i] = 1e-5 * (1e-3 if p.even else 1e-2 if p.name == "angle" else 1.0)
        up, down = (predict(space, v, data, data.channels) for v in (u + step, u - step))
        for c, channel in enumerate(data.channels):
            expected = (up[channel] - down[channel]) / (2.0 * step[i])
            scale = np.abs(up["I"] - down["I"]).max() / (2.0 * step[i]) + 1e-6
            np.testing.assert_allclose(
                exact[0, :, c, i], expected, atol=2e-5 * scale, rtol=2e-4, err_msg=f"{channel} by {p.name}"
            )


def test_a_source_at_0_still_tells_which_way_to_go():
    """The radius is even: its square is the unknown, whose derivative at a point source is that of the variance."""
    space, data = problem("double-gauss", ["source"])
    values = np.array([0.02, 1.5, 0.9, 1.1, 0.05, 0.8, 0.0])
    u = space.to_unknowns(values)
    assert u[-1] == 0.0 and space.to_parameters(u)[-1] == 0.0
    _, exact = derivatives(space, u[None], data, ["I"])
    wide = u.copy()
    wide[-1] = (0.05 * DEGREE) ** 2
    slope = (predict(space, wide, data, ["I"])["I"] - predict(space, u, data, ["I"])["I"]) / wide[-1]
    lobe = [1, 2, 3]  # the facet tilts by less than a degree
    np.testing.assert_allclose(exact[0, lobe, 0, -1], slope[lobe], rtol=0.01)
    assert (np.abs(slope[lobe]) > 100.0).all()
