"""Identification of single measurements."""

from __future__ import annotations

import numpy as np
import pytest

import pbrdf
from pbrdf.errors import FitError
from pbrdf.identification.identify import identify, unknown_gain
from pbrdf.identification.library import Library, bundled_library

LIBRARY = bundled_library()


@pytest.mark.parametrize("name", list(pbrdf.PAINTS))
def test_the_bundled_measurements_are_recognised(name):
    found = identify(pbrdf.open_experiment(name), LIBRARY)
    assert found.materials == [name]
    assert found.candidates[0].name == name
    assert found[name].probability > 0.99
    assert found.gain  # radiances: their scale is arbitrary


def measurement(model, seed=1, noise=0.01, few=slice(0, 21, 5), **attributes):
    experiment = pbrdf.open_experiment("white").isel(geometry=few)
    angles = [experiment[name].values for name in ("theta_i", "theta_r", "phi")]
    stokes = model.stokes(*angles)
    random = np.random.default_rng(seed)
    std = noise * stokes[:, 0]
    values = {n: stokes[:, i] + std * random.standard_normal(len(std)) for i, n in enumerate("IQU")}
    data = pbrdf.make_dataset(*angles, quantity="brdf", **values, std=dict.fromkeys(values, std))
    return data.assign_attrs(attributes)


def test_another_paint_is_none_of_these():
    stranger = pbrdf.DoubleGauss(sigma=0.08, n=1.5, a=1.2, k=1.1, b=0.1, t=0.3)
    found = identify(measurement(stranger), LIBRARY)
    assert found.none_of_these
    assert found.materials == []
    # probabilities are those given that it is one of them: they do not tell
    assert sum(candidate.probability for candidate in found.candidates) == pytest.approx(1.0)


def test_a_set_grows_with_its_confidence():
    data = measurement(pbrdf.load_paint("cd-back"), few=slice(0, 2), noise=0.05)
    sizes = [len(identify(data, LIBRARY, confidence=c).materials) for c in (0.5, 0.95, 0.999)]
    assert sizes == sorted(sizes)
    assert sizes[-1] > 1


def test_prior_probabilities():
    data = measurement(pbrdf.load_paint("cd-back"), few=slice(0, 1), noise=0.3)
    alike, sure = identify(data, LIBRARY), identify(data, LIBRARY, prior={"cd-back": 1.0})
    assert sure["cd-back"].probability == pytest.approx(1.0)
    assert alike["cd-back"].probability < 0.9
    with pytest.raises(FitError, match="no material 'gloss'"):
        identify(data, LIBRARY, prior={"gloss": 0.5})
    with pytest.raises(FitError, match=r"add up to 1\.5"):
        identify(data, LIBRARY, prior={"cd-back": 0.8, "white": 0.7})


def test_scale_of_the_data():
    data = measurement(pbrdf.load_paint("white"))
    assert not unknown_gain(data)
    assert unknown_gain(data.assign_attrs(scale="arbitrary"))
    assert unknown_gain(pbrdf.open_experiment("white"))


def test_what_cannot_be():
    data = measurement(pbrdf.load_paint("white"))
    with pytest.raises(FitError, match="the library has no material"):
        identify(data, Library(()))
    with pytest.raises(FitError, match="confidence=95"):
        identify(data, LIBRARY, confidence=95)
