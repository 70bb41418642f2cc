"""Errors name the parameter or angle, the value, the index and what to do."""

from __future__ import annotations

import numpy as np
import pytest

from pbrdf.backend import get_backend
from pbrdf.errors import ModelError, PbrdfError
from pbrdf.models import DoubleGauss, ReciprocalDoubleGauss

PAINT = {"sigma": 0.04, "n": 1.62, "a": 1.5, "k": 1.25, "b": 0.2, "t": 0.5}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"sigma": 0.0}, r"sigma=0 is outside its domain: .*slope.* must be within 0\.001 … 1"),
        ({"sigma": -0.1}, r"sigma=-0\.1 is outside"),
        ({"sigma": np.nan}, r"sigma=nan is outside"),
        ({"sigma": [0.1, 2.0]}, r"sigma=2 at index \(1,\)"),
        ({"sigma": np.array([[0.1, 0.2], [0.3, np.inf]])}, r"sigma=inf at index \(1, 1\)"),
        ({"sigma": "rough"}, r"sigma='rough' is not a number"),
        ({"sigma": None}, r"sigma=(None|nan)"),
        ({"n": 0.0}, r"n=0 is outside"),
        ({"n": 0.9}, r"n must be at least 1 where kappa is 0"),
        ({"n": 2 + 1.5j}, r"n − iκ with κ ≥ 0; give the conjugate"),
        ({"n": 2 - 1.5j, "kappa": 1.0}, r"extinction is given twice"),
        ({"kappa": -1.0}, r"kappa=-1 is outside its domain"),
        ({"a": -1.0}, r"a=-1 is outside its domain: .* must be 0 or more"),
        ({"a": np.inf}, r"a=inf is outside"),
        ({"k": -0.1}, r"k=-0\.1 is outside"),
        ({"b": 100.0}, r"b=100 is outside .* within -20 … 20"),
        ({"t": 1.2}, r"t=1\.2 is outside .* within 0 … 1"),
        ({"t": [0.1, 0.2, -0.1]}, r"t=-0\.1 at index \(2,\)"),
    ],
    ids=str,
)
@pytest.mark.parametrize("cls", [DoubleGauss, ReciprocalDoubleGauss])
def test_parameters_outside_their_domain(cls, changes, message):
    with pytest.raises(ModelError, match=message):
        cls(**{**PAINT, **changes})


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"normalization": "none"}, r"normalization='none': choose one of 'weighted', 'visible'"),
        ({"transmittance": "power"}, r"transmittance='power': choose one of 'flux', 'amplitude'"),
        ({"shadowing": "vcavity"}, r"shadowing='vcavity': choose one of 'v-cavity', 'smith', 'none'"),
        ({"accuracy": "best"}, r"accuracy='best': choose one of 'default', 'high'"),
    ],
)
def test_unknown_options(options, message):
    with pytest.raises(ModelError, match=message):
        DoubleGauss(**PAINT, **options)


def test_visible_needs_k_above_a_third():
    with pytest.raises(ModelError, match=r"k=0\.32: normalization='visible' needs k > 1/3"):
        DoubleGauss(**{**PAINT, "k": 0.32}, normalization="visible")
    DoubleGauss(**{**PAINT, "k": 0.34}, normalization="visible")


@pytest.mark.parametrize(
    ("angles", "message"),
    [
        ((35, 0.5, 0), r"theta_i=35 must be within \[0, π/2\] radians; is it in degrees\?"),
        ((0.5, 60.0, 0), r"theta_r=60 .*degrees"),
        ((-0.1, 0.5, 0), r"theta_i=-0\.1 must be within \[0, π/2\] radians$"),
        (([0.1, np.nan], 0.5, 0), r"theta_i=nan at index \(1,\)"),
        ((0.1, [[0.2, 0.3], [0.4, 2.0]], 0), r"theta_r=2 at index \(1, 1\)"),
        ((0.1, 0.5, np.inf), r"phi=inf must be a finite number"),
        (("a", 0.5, 0), r"theta_i is not a number or an array of numbers: 'a'"),
        (
            (np.zeros(3), np.zeros(4), 0),
            r"do not broadcast against each other: theta_i \(3,\), theta_r \(4,\)",
        ),
    ],
    ids=str,
)
def test_angles(angles, message):
    with pytest.raises(ModelError, match=message):
        DoubleGauss(**PAINT).mueller(*angles)
    with pytest.raises(ModelError, match=message):
        DoubleGauss(**PAINT).stokes(*angles)


def test_parameters_that_do_not_broadcast_are_named():
    with pytest.raises(ModelError, match=r"theta_i \(3,\), sigma \(2,\)"):
        DoubleGauss(**{**PAINT, "sigma": [0.1, 0.2]}).mueller(np.zeros(3), 0.1)


def test_drjit_angles_are_checked():
    Float = get_backend().Float
    with pytest.raises(ModelError, match=r"theta_r=2 at index \(1,\)"):
        DoubleGauss(**PAINT).mueller(Float(0.1), Float([0.2, 2.0]), 0.0)
    with pytest.raises(ModelError, match="sigma=5"):
        DoubleGauss(**{**PAINT, "sigma": Float(5.0)})


def test_part():
    with pytest.raises(ModelError, match=r"part='mirror': choose one of 'total', 'specular', 'diffuse'"):
        DoubleGauss(**PAINT).mueller(0.1, 0.1, part="mirror")


@pytest.mark.parametrize(
    ("incident", "message"),
    [
        ((1, 2, 0, 0), r"not the Stokes vector of any light"),
        ((0, 0, 0, 0), r"not the Stokes vector"),
        ((-1, 0, 0, 0), r"not the Stokes vector"),
        ((1, np.nan, 0, 0), r"not the Stokes vector"),
        ((1, 0, 0), r"shape \(3,\): a Stokes vector has four numbers"),
        ("natural", r"incident='natural'"),
        (np.array([[1, 0, 0, 0], [1, 1, 1, 0.0]]), r"not the Stokes vector"),
    ],
    ids=str,
)
def test_incident_light(incident, message):
    with pytest.raises(ModelError, match=message):
        DoubleGauss(**PAINT).stokes(0.1, [0.1, 0.2], incident=incident)


@pytest.mark.parametrize(
    ("evaluate", "message"),
    [
        (
            lambda m, F: m.stokes([0.1, 0.2], 0.3, incident=np.eye(4)[[0, 0, 0]]),
            r"incident of shape \(3, 4\) does not broadcast against Mueller matrices of shape \(2, 4, 4\)",
        ),
        (
            lambda m, F: m.mueller(F([0.1, 0.2]), F([0.1, 0.2, 0.3]), 0.0),
            r"arrays of different widths do not broadcast: \{'theta_i': 2, 'theta_r': 3\}",
        ),
        (
            lambda m, F: m.mueller(F([0.1, 0.2]), np.array([0.1, 0.2]), 0.0),
            r"theta_r is not a Dr\.Jit array beside others that are: convert it",
        ),
    ],
    ids=["incident-of-wrong-length", "drjit-widths", "drjit-with-numpy"],
)
def test_shapes_that_do_not_fit(evaluate, message):
    with pytest.raises(ModelError, match=message):
        evaluate(DoubleGauss(**PAINT), get_backend().Float)


def test_incident_light_as_a_nested_list_is_one_vector_for_each_direction():
    model = DoubleGauss(**PAINT)
    found = model.stokes([0.1, 0.2], 0.3, incident=[[1, 0, 0, 0], [1, 1, 0, 0]])
    expected = [model.stokes(0.1, 0.3), model.stokes(0.2, 0.3, incident=[1, 1, 0, 0])]
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_replace_names_what_it_does_not_know():
    with pytest.raises(ModelError, match=r"double-gauss has no parameter or option 'roughness': .*sigma"):
        DoubleGauss(**PAINT).replace(roughness=0.1)


def test_errors_are_value_errors_of_one_family():
    assert issubclass(ModelError, PbrdfError) and issubclass(PbrdfError, ValueError)
