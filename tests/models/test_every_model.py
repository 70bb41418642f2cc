"""What holds for every model: those of the package, and one that a user wrote."""

from __future__ import annotations

import copy
import inspect
import pickle

import drjit as dr
import numpy as np
import pytest
import xarray as xr

import independent as ref
from every_model import EVERY, example
from pbrdf.backend import get_backend
from pbrdf.errors import ModelError
from pbrdf.models import Model
from pbrdf.models.realisability import least_coherency
from pbrdf.models.reflectance import directional_hemispherical_reflectance

MIRROR = np.diag([1.0, 1.0, -1.0, -1.0])
ANGLES = (np.array([0.1, 0.5, 1.1, 1.4]), np.array([0.4, 0.5, 0.2, 1.3]), np.array([0.0, 2.1, -0.7, 0.1]))


def close(found, expected, tolerance=1e-12):
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance * np.abs(expected).max())


@EVERY
@pytest.mark.parametrize("seed", [0, 1])
def test_every_kind_of_array_gives_the_same_numbers(cls, seed):
    model, Float = example(cls, seed), get_backend().Float
    f = model.mueller(*ANGLES)
    assert f.shape == (4, 4, 4)
    for i in range(4):
        close(model.mueller(*(float(a[i]) for a in ANGLES)), f[i])
    labelled = model.mueller(*(xr.DataArray(a, dims="geometry") for a in ANGLES))
    assert labelled.dims == ("geometry", "stokes_out", "stokes_in")
    close(labelled.values, f)
    matrix = model.mueller(*(Float(a) for a in ANGLES))
    close(np.moveaxis(matrix.numpy(), -1, 0), f)


@EVERY
def test_a_map_of_parameters_equals_its_members(cls):
    paints = example(cls, 1, size=(3, 1))
    f = paints.mueller(*ANGLES)
    assert f.shape == (3, 4, 4, 4)
    for i in range(3):
        single = cls(**{name: float(value[i, 0]) for name, value in paints.values.items()})
        close(f[i], single.mueller(*ANGLES))


@EVERY
@pytest.mark.parametrize("seed", [0, 1])
def test_parts_add_up(cls, seed):
    model = example(cls, seed)
    specular, diffuse, total = (
        model.mueller(*ANGLES, part=part) for part in ("specular", "diffuse", "total")
    )
    close(specular + diffuse, total)


@EVERY
def test_derivatives_are_those_of_the_values(cls):
    """Forward mode against central differences, in every parameter that a fit may free."""
    model, Float = example(cls, 1), get_backend().Float
    for p in cls.parameters:
        value = model.values[p.name]
        step = 1e-5 * max(abs(value), 0.1)
        ends = [model.replace(**{p.name: value + s * step}).mueller(0.5, 0.7, 0.3) for s in (-1.0, 1.0)]
        x = Float(value)
        dr.enable_grad(x)
        matrix = model.replace(**{p.name: x}).mueller(Float(0.5), Float(0.7), Float(0.3))
        f00 = matrix[0, 0]
        dr.set_grad(x, 1.0)
        dr.forward_to(f00)
        expected = (ends[1] - ends[0])[0, 0] / (2.0 * step)
        assert dr.grad(f00)[0] == pytest.approx(expected, rel=2e-4, abs=1e-7 * abs(ends[0][0, 0])), p.name


@EVERY
def test_the_surface_has_no_handedness(cls):
    """f(θ_i, θ_r, −φ) = diag(1,1,−1,−1) f(θ_i, θ_r, φ) diag(1,1,−1,−1)."""
    model = example(cls, 1)
    theta_i, theta_r, phi = ANGLES
    close(MIRROR @ model.mueller(theta_i, theta_r, -phi) @ MIRROR, model.mueller(*ANGLES), 1e-10)


@EVERY
def test_specular_light_has_negative_q_and_the_horizon_is_dark(cls):
    """Sign in words: reflection at the mirror direction polarises along s, so Q = I_p − I_s < 0."""
    model = example(cls)
    intensity, q, *_ = model.stokes(0.9, 0.9, 0.0, part="specular")
    assert intensity > 0.0 and q < 0.0
    assert not model.mueller([np.pi / 2, 0.3], [0.3, np.pi / 2], 0.4).any()


@EVERY
@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_matrices_are_those_of_passive_surfaces(cls, seed):
    model = example(cls, seed)
    assert least_coherency(model)[0] >= -1e-12
    rng = np.random.default_rng(seed)
    f = model.mueller(*rng.uniform(0.0, 1.55, (2, 500)), rng.uniform(-np.pi, np.pi, 500))
    f00 = f[:, 0, 0]
    assert (f00 >= 0.0).all()
    assert ref.coherency_eigenvalues(f[f00 > 1e-200] / f00[f00 > 1e-200, None, None]).min() >= -1e-12


@pytest.mark.slow
@EVERY
def test_reflectance_agrees_with_brute_force(cls):
    """∫ f00 cosθ_r dω_r over a fine grid of directions, which knows nothing of lobes."""
    model = example(cls, 3)
    theta = ((np.arange(1200) + 0.5) * 0.5 * np.pi / 1200)[:, None]
    phi = (np.arange(720) + 0.5) * np.pi / 720
    for theta_i in (0.0, 0.6, 1.0):
        f = model.stokes(theta_i, theta, phi)[..., 0]
        brute = (f * np.cos(theta) * np.sin(theta)).sum() * (0.5 * np.pi / 1200) * (2.0 * np.pi / 720)
        assert directional_hemispherical_reflectance(model, theta_i) == pytest.approx(brute, rel=2e-3)


@EVERY
def test_the_declaration_makes_constructor_docstring_and_json(cls):
    model = example(cls, 1)
    signature = inspect.signature(cls)
    assert list(signature.parameters) == [
        *(p.name for p in cls.parameters if p.fitted),
        *(p.name for p in cls.parameters if not p.fitted),
        *cls.options,
    ]
    positional = cls(*(model.values[p.name] for p in cls.parameters if p.fitted))
    assert all(positional.values[p.name] == model.values[p.name] for p in cls.parameters if p.fitted)
    for name in signature.parameters:
        assert f"\n{name}\n    " in cls.__doc__
    assert eval(repr(model), {cls.__name__: cls}).values.keys() == model.values.keys()
    again = Model.from_values.__func__(cls, model.to_dict()["parameters"], **model.to_dict()["options"])
    assert again == model
    with pytest.raises(TypeError, match=f"{cls.__name__}: missing"):
        cls()
    with pytest.raises(TypeError, match="unknown_one"):
        cls(**model.values, unknown_one=1.0)


@EVERY
def test_nothing_couples_i_q_with_u_v_in_the_plane_of_incidence(cls):
    """At φ = 0 and π the matrix is block-diagonal, and the azimuth has the period 2π."""
    model = example(cls, 1)
    theta = np.array([0.1, 0.6, 1.2])
    for phi in (0.0, np.pi):
        f = model.mueller(theta[:, None], theta, phi)
        f = f / np.maximum(f[..., :1, :1], 1e-250)
        assert abs(f[..., :2, 2:]).max() < 1e-9 and abs(f[..., 2:, :2]).max() < 1e-9
    close(model.mueller(0.5, 0.7, 0.3 + 2.0 * np.pi), model.mueller(0.5, 0.7, 0.3), 1e-9)


@EVERY
def test_stokes_is_the_matrix_times_the_incident_light(cls):
    model = example(cls, 1)
    light = np.array([1.0, 0.3, -0.4, 0.2])
    close(model.stokes(*ANGLES, incident=light), model.mueller(*ANGLES) @ light)


@EVERY
def test_copies_are_equal_and_models_are_immutable(cls):
    model = example(cls, 1)
    for made in (copy.deepcopy(model), pickle.loads(pickle.dumps(model)), model.replace()):
        assert made == model
    name = cls.parameters[0].name
    with pytest.raises(AttributeError, match="immutable"):
        setattr(model, name, 1.0)
    assert model.replace(**{name: cls.parameters[0].default}) != model


@EVERY
def test_values_outside_of_a_domain_are_named(cls):
    model = example(cls, 1)
    for p in cls.parameters:
        for wrong in (np.nan, p.domain[0] - 1.0, *([p.domain[1] + 1.0] if np.isfinite(p.domain[1]) else [])):
            with pytest.raises(ModelError, match=rf"^{p.name}=.* is outside its domain"):
                model.replace(**{p.name: wrong})
    with pytest.raises(ModelError, match="has no parameter or option"):
        model.replace(no_such_parameter=1.0)


@EVERY
def test_single_precision_is_near_double(cls):
    """The kernel of a renderer: float32 within 1e-4 of f00 away from grazing, or of 1e-3/sr where it is darker."""
    model = example(cls, 3)
    Float32 = dr.float32_array_t(get_backend().Float)
    rng = np.random.default_rng(2)
    angles = (*rng.uniform(0.0, 1.2, (2, 200)), rng.uniform(-np.pi, np.pi, 200))
    matrix = model.mueller(*(Float32(a.astype(np.float32)) for a in angles))
    exact = model.mueller(*(a.astype(np.float32).astype(float) for a in angles))
    found = np.moveaxis(matrix.numpy(), -1, 0)
    assert (np.abs(found - exact).max((1, 2)) / np.maximum(exact[:, 0, 0], 1e-3)).max() < 1e-4
