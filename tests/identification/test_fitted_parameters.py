"""Fits without their data: closed forms against SciPy, the record of a fit, and what is refused."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

import pbrdf
from every_model import example
from pbrdf.errors import DataError, FitError, ModelError
from pbrdf.identification.fitted_parameters import (
    FittedParameters,
    parameters_explained,
    read_fitted_parameters,
)
from pbrdf.identification.identify_fit import identify_fit
from pbrdf.identification.library import Library, bundled_library
from pbrdf.identification.material import material_from_model
from pbrdf.identification.telling_apart import next_measurement
from pbrdf.models import MODELS

LIBRARY = bundled_library()
SPACE = LIBRARY.materials[0].space


def fitted(name="white", relative=0.03, seed=1, **changes):
    """Estimates about a paint, with correlated errors."""
    paint = pbrdf.load_paint(name)
    values = np.array([paint.values[n] for n in SPACE.names])
    root = np.random.default_rng(seed).standard_normal((6, 6))
    covariance = root @ root.T + 2.0 * np.eye(6)
    scale = np.sqrt(np.diag(covariance))
    made = FittedParameters(
        paint, tuple(SPACE.names), values, relative * values, covariance / np.outer(scale, scale)
    )
    return replace(made, **changes)


def covariance_of(one, rows):
    """Of the unknowns with these numbers."""
    spread = one.standard_error / SPACE.derivative(one.estimate)
    return (one.correlation * np.outer(spread, spread))[np.ix_(rows, rows)]


def test_the_closed_form_is_that_of_scipy():
    one = fitted()
    found = parameters_explained(LIBRARY.materials, one)
    u = SPACE.to_unknowns(one.estimate)
    C = covariance_of(one, range(6))
    expected = [multivariate_normal.logpdf(u, m.mean, m.covariance + C) for m in LIBRARY.materials]
    told = found.log_evidence[0]
    # but for a constant of the measurement; single precision of numbers that are large
    assert told - told[0] == pytest.approx(np.array(expected) - expected[0], rel=1e-4)
    assert found.degrees_of_freedom.tolist() == [6]


def test_a_parameter_that_the_fit_does_not_determine_says_nothing():
    error = fitted().standard_error.copy()
    error[2] = math.nan
    one = fitted(standard_error=error)
    found = parameters_explained(LIBRARY.materials, one)
    rows = [0, 1, 3, 4, 5]
    u = SPACE.to_unknowns(one.estimate)[rows]
    for c, material in enumerate(LIBRARY.materials):
        total = material.covariance[np.ix_(rows, rows)] + covariance_of(one, rows)
        off = u - material.mean[rows]
        assert found.distance[0, c] == pytest.approx(off @ np.linalg.solve(total, off), rel=1e-4)
    assert found.degrees_of_freedom.tolist() == [5]


def test_the_most_likely_specimen():
    """Between the material's mean and the estimate, by their covariances: the normal equations."""
    one = fitted("cd-back")
    material = LIBRARY["white"]
    C = covariance_of(one, range(6))
    weights = np.linalg.inv(material.covariance), np.linalg.inv(C)
    mean = np.linalg.solve(
        weights[0] + weights[1],
        weights[0] @ material.mean + weights[1] @ SPACE.to_unknowns(one.estimate),
    )
    found = parameters_explained([material], one).values[0][0]
    assert found == pytest.approx(material.space.to_parameters(mean), rel=1e-6)


def test_an_identification():
    found = identify_fit(fitted("matte-white-thin"), LIBRARY, confidence=0.9)
    assert found.materials == ["matte-white-thin"]
    assert found.data is None
    with pytest.raises(FitError, match="where the data are at hand"):
        next_measurement(found)
    for option in ({"gain": True}, {"angle": 0.01}, {"noise": "1%"}):
        with pytest.raises(FitError, match=f"{next(iter(option))}: fitted parameters without their data"):
            identify_fit(fitted(), LIBRARY, **option)


def test_what_cannot_be_compared():
    other = material_from_model("other", example(MODELS["ggx-lambert"]))
    with pytest.raises(
        FitError, match="the fit is of the model double-gauss, the material other of ggx-lambert"
    ):
        parameters_explained([other], fitted())
    with pytest.raises(FitError, match="no free parameter n, which differs"):
        kept = [0, 2, 3, 4, 5]
        one = fitted()
        few = replace(
            one, names=tuple(one.names[i] for i in kept), estimate=one.estimate[kept],
            standard_error=one.standard_error[kept], correlation=one.correlation[np.ix_(kept, kept)],
        )  # fmt: skip
        parameters_explained(LIBRARY.materials, few)
    with pytest.raises(FitError, match="scale of the fitted data is arbitrary"):
        parameters_explained(LIBRARY.materials, fitted(arbitrary=True))
    with pytest.raises(FitError, match="determines none of the parameters"):
        parameters_explained(LIBRARY.materials, fitted(standard_error=np.full(6, math.nan)))
    options = {name: choices[-1] for name, choices in pbrdf.DoubleGauss.options.items()}
    turned = pbrdf.DoubleGauss(**pbrdf.load_paint("white").values, **options)
    with pytest.raises(FitError, match="without its data they cannot be compared"):
        parameters_explained(LIBRARY.materials, fitted(model=turned))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A fit of data of a known scale, without its fit.nc."""
    data = pbrdf.open_experiment("cd-back").isel(geometry=slice(0, 63, 3)).assign_attrs(scale="absolute")
    fit = pbrdf.fit(data, starts=4)
    place = tmp_path_factory.mktemp("fits") / "cd-back-fit"
    fit.save(place)
    found = identify_fit(place, LIBRARY)
    assert found.data is not None  # the data count where they are there
    (place / "fit.nc").unlink()
    return place, fit, found


@pytest.mark.slow
def test_the_record_of_a_fit(folder):
    place, fit, by_data = folder
    one = read_fitted_parameters(place / "fit.json")
    assert list(one.names) == fit.space.names
    assert one.estimate == pytest.approx(fit.space.to_parameters(fit.unknowns))
    errors = [fit.estimates[name].std for name in one.names]
    assert one.standard_error == pytest.approx(errors, nan_ok=True)
    assert one.simulated and not one.arbitrary
    found = identify_fit(place, LIBRARY)
    assert found.data is None
    assert found.materials == by_data.materials == ["cd-back"]
    assert identify_fit(place / "fit.json", LIBRARY).candidates[0] == found.candidates[0]


@pytest.mark.slow
def test_records_that_are_refused(folder, tmp_path):
    place, *_ = folder
    record = json.loads((place / "fit.json").read_text(encoding="utf-8"))

    def read(**changes):
        path = tmp_path / "fit.json"
        path.write_text(json.dumps({**record, **changes}), encoding="utf-8")
        return read_fitted_parameters(path)

    assert read(data={**record["data"], "scale": "arbitrary"}).arbitrary
    assert read(data={"name": "x", "quantity": "radiance"}).arbitrary
    with pytest.raises(DataError, match=r"model\.json: a model without standard errors"):
        read_fitted_parameters(place / "model.json")
    with pytest.raises(FitError, match="stands at no minimum"):
        read(settled=False)
    with pytest.raises(ModelError, match=r"fit\.json: .*unheard-of"):
        read(model={**record["model"], "model": "unheard-of"})
    with pytest.raises(DataError, match="damaged: 'verdict' is missing"):
        read(estimates={"n": {"value": 1.5}})
    (tmp_path / "fit.json").write_text("[]", encoding="utf-8")
    with pytest.raises(DataError, match="not the record of a fit"):
        read_fitted_parameters(tmp_path / "fit.json")
    (tmp_path / "fit.json").write_text("{", encoding="utf-8")
    with pytest.raises(DataError, match="not JSON"):
        read_fitted_parameters(tmp_path / "fit.json")


def test_one_material_is_enough():
    assert identify_fit(fitted(), Library((LIBRARY["white"],))).materials == ["white"]
