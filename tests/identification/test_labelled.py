"""Labelled measurements: a library calibrated with them, and judged by them as it is."""

from __future__ import annotations

import numpy as np
import pytest

import pbrdf
from pbrdf.errors import FitError
from pbrdf.identification.confusion import confusion
from pbrdf.identification.fitted_parameters import FittedParameters
from pbrdf.identification.identify import identify
from pbrdf.identification.identify_fit import identify_fit
from pbrdf.identification.labelled import calibrate_library, judge_labelled
from pbrdf.identification.library import Library, bundled_library

LIBRARY = bundled_library()
STRANGER = pbrdf.DoubleGauss(sigma=0.08, n=1.5, a=1.2, k=1.1, b=0.1, t=0.3)


def measurement(model, seed=1, noise=0.01, few=slice(0, 21, 5)):
    experiment = pbrdf.open_experiment("white").isel(geometry=few)
    angles = [experiment[name].values for name in ("theta_i", "theta_r", "phi")]
    stokes = model.stokes(*angles)
    random = np.random.default_rng(seed)
    std = noise * stokes[:, 0]
    values = {n: stokes[:, i] + std * random.standard_normal(len(std)) for i, n in enumerate("IQU")}
    return pbrdf.make_dataset(*angles, quantity="brdf", **values, std=dict.fromkeys(values, std))


def labelled(count, few=slice(0, 2), noise=0.05):
    rng = np.random.default_rng(7)
    pairs = [
        (m.name, measurement(m.space.build(values), seed, noise, few))
        for m in LIBRARY.materials
        for seed, values in enumerate(m.draw(count, rng))
    ]
    return [*pairs, ("gloss", measurement(STRANGER, 3, noise, few))]


@pytest.mark.slow
def test_calibrated_sets_hold_the_true_material_where_the_stated_noise_is_wrong():
    """Noise three times as large as stated: the sets by χ² lose the true paint, the calibrated ones do not."""
    paint = pbrdf.load_paint("matte-white-thin")
    library = Library((LIBRARY["matte-white-thin"],))

    def batch(begin, count):
        data = [measurement(paint, seed=s, noise=0.03) for s in range(begin, begin + count)]
        return [d.assign({f"{n}_std": d[f"{n}_std"] / 3.0 for n in "IQU"}) for d in data]

    calibrated = calibrate_library(library, [("matte-white-thin", d) for d in batch(0, 60)])
    test = batch(1000, 40)
    by_chi2 = np.mean([identify(d, library).materials != [] for d in test])
    held = np.mean([identify(d, calibrated).materials != [] for d in test])
    assert by_chi2 < 0.5
    assert held > 0.8


@pytest.mark.slow
@pytest.mark.parametrize("calibrated", [False, True])
def test_the_table_is_that_of_single_identifications(calibrated):
    """With priors, a stranger, and the calibration that the library has; nothing of it is changed."""
    library, pairs = LIBRARY, labelled(4)
    if calibrated:
        library = calibrate_library(LIBRARY, labelled(10)[:-1])
    options = {"confidence": 0.9, "prior": {"white": 0.6}, "gain": True}
    table = judge_labelled(library, pairs, **options)
    one_by_one = confusion([identify(d, library, **options) for _, d in pairs], [name for name, _ in pairs])
    assert table.truth == one_by_one.truth == (*LIBRARY.names, "gloss")
    assert table.counts.tolist() == one_by_one.counts.tolist()
    assert table.coverage == pytest.approx(one_by_one.coverage)
    assert table.set_size == pytest.approx(one_by_one.set_size)
    assert table.reliability.error == pytest.approx(one_by_one.reliability.error)


def test_all_forms_at_once():
    """Measurements of several numbers of geometries, and parameters of a fit."""
    paint = pbrdf.load_paint("white")
    free = [p.name for p in paint.parameters if p.fitted]
    values = np.array([paint.values[name] for name in free])
    fitted = FittedParameters(paint, tuple(free), values, 0.01 * values, np.eye(len(free)))
    calls = []
    table = judge_labelled(
        LIBRARY,
        [("white", measurement(paint)), ("white", fitted), ("white", measurement(paint, few=slice(0, 3)))],
        progress=lambda done, total: calls.append((done, total)),
    )
    assert table.counts[0, LIBRARY.names.index("white")] == 3
    assert calls[-1] == (3, 3)


@pytest.mark.slow
def test_a_fit_is_compared_as_identify_fit_does():
    fit = pbrdf.fit(measurement(pbrdf.load_paint("cd-back"), few=slice(0, 21)), starts=4)
    table = judge_labelled(LIBRARY, [("cd-back", fit)], confidence=0.9)
    found = identify_fit(fit, LIBRARY, confidence=0.9)
    assert table.set_size[0] == len(found.materials)
    (mean,) = table.reliability.confidence[table.reliability.count > 0]
    assert mean == pytest.approx(found.candidates[0].probability)


def test_what_cannot_be():
    with pytest.raises(FitError, match="no labelled measurements"):
        calibrate_library(LIBRARY, [])
    with pytest.raises(FitError, match="has no material 'gloss'"):
        calibrate_library(LIBRARY, [("gloss", measurement(STRANGER))])
    with pytest.raises(FitError, match="no labelled measurements"):
        judge_labelled(LIBRARY, [])
    with pytest.raises(FitError, match="confidence=95"):
        judge_labelled(LIBRARY, [("white", measurement(STRANGER))], confidence=95)
