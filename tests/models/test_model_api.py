"""Arrays in and out, parts, incident light, copies: what a user of the models relies on."""

from __future__ import annotations

import copy
import pickle

import drjit as dr
import numpy as np
import pytest
import xarray as xr

from pbrdf.backend import get_backend
from pbrdf.models import MODELS, DoubleGauss, Model, Parameter, ReciprocalDoubleGauss

BOTH = pytest.mark.parametrize("cls", [DoubleGauss, ReciprocalDoubleGauss])
PAINT = {"sigma": 0.0398, "n": 1.6207, "a": 1.5174, "k": 1.2504, "b": 0.1827, "t": 0.6717}
ANGLES = (0.5, 0.9, 0.7)


@pytest.fixture(scope="module")
def f_paint():
    return DoubleGauss(**PAINT).mueller(*ANGLES)


def close(a, b, tolerance=1e-12):
    np.testing.assert_allclose(a, b, atol=tolerance * np.max(np.abs(b)), rtol=0)


# --- NumPy ---


def test_scalars_give_one_matrix(f_paint):
    assert isinstance(f_paint, np.ndarray) and f_paint.shape == (4, 4) and f_paint.dtype == np.float64
    assert DoubleGauss(**PAINT).stokes(*ANGLES).shape == (4,)


@BOTH
def test_angles_broadcast(cls):
    m = cls(**PAINT)
    theta_i, theta_r, phi = (
        np.linspace(0, 1.2, 3)[:, None, None],
        np.linspace(0, 1.5, 4)[:, None],
        np.array([0.0, 1.0]),
    )
    f = m.mueller(theta_i, theta_r, phi)
    assert f.shape == (3, 4, 2, 4, 4)
    close(f[2, 1, 1], m.mueller(theta_i[2, 0, 0], theta_r[1, 0], phi[1]))


def test_lists_and_integers_are_accepted():
    m = DoubleGauss(**PAINT)
    close(m.mueller([0, 1], 1, 0)[1], m.mueller(1.0, 1.0, 0.0))


def test_phi_defaults_to_forward():
    m = DoubleGauss(**PAINT)
    close(m.mueller(0.4, 0.8), m.mueller(0.4, 0.8, 0.0))


def test_no_directions_give_an_empty_array():
    assert DoubleGauss(**PAINT).mueller(np.empty(0), 0.5, 0.0).shape == (0, 4, 4)
    assert DoubleGauss(**PAINT).stokes(np.empty((2, 0)), 0.5, 0.0).shape == (2, 0, 4)


@BOTH
def test_parameters_broadcast_against_angles(cls):
    """Every parameter may be an array: a map of paints against a list of directions."""
    sigma, n = np.array([0.02, 0.1, 0.3])[:, None], np.array([1.4, 1.6, 1.8])[:, None]
    kappa = np.array([0.0, 0.5, 0.0])[:, None]
    t = np.array([0.2, 0.5])
    f = cls(sigma, n, 1.3, 1.1, 0.2, t, kappa=kappa).mueller(0.3, np.array([0.4, 1.4]), 0.5)
    assert f.shape == (3, 2, 4, 4)
    for i in range(3):
        for j in range(2):
            single = cls(sigma[i, 0], n[i, 0], 1.3, 1.1, 0.2, t[j], kappa=kappa[i, 0])
            close(f[i, j], single.mueller(0.3, [0.4, 1.4][j], 0.5))


def test_parameter_arrays_with_scalar_angles():
    f = DoubleGauss(np.array([0.02, 0.1]), 1.5, 1, 1, 0, 0.5).mueller(0.3, 0.3, 0.0)
    assert f.shape == (2, 4, 4) and f[0, 0, 0] > f[1, 0, 0]


def test_a_batch_equals_its_members():
    """Paints and rough surfaces, near and far from grazing, in one batch: each lane has its own rule."""
    rng = np.random.default_rng(0)
    theta_i, theta_r, phi = [*rng.uniform(0, 1.5, (2, 30)).tolist(), rng.uniform(-3, 3, 30)]
    sigma = np.geomspace(0.002, 0.6, 30)
    f = DoubleGauss(sigma, 1.5, 1, 1.3, 0.2, 0.5).mueller(theta_i, theta_r, phi)
    for j in range(0, 30, 5):
        close(f[j], DoubleGauss(sigma[j], 1.5, 1, 1.3, 0.2, 0.5).mueller(theta_i[j], theta_r[j], phi[j]))


def test_complex_index():
    """n = 2 − 1.5i is n = 2, kappa = 1.5; complex arrays too; a zero imaginary part is a dielectric."""
    a, b = DoubleGauss(0.1, 2 - 1.5j, 1, 1, 0, 0.5), DoubleGauss(0.1, 2, 1, 1, 0, 0.5, kappa=1.5)
    assert a == b and a.values["n"] == 2.0 and a.values["kappa"] == 1.5
    close(a.mueller(*ANGLES), b.mueller(*ANGLES))
    f = DoubleGauss(0.1, np.array([2 - 1.5j, 1.6 + 0j]), 1, 1, 0, 0.5).mueller(*ANGLES)
    close(f[0], a.mueller(*ANGLES))
    close(f[1], DoubleGauss(0.1, 1.6, 1, 1, 0, 0.5).mueller(*ANGLES))
    assert DoubleGauss(0.1, 1.6 + 0j, 1, 1, 0, 0.5) == DoubleGauss(0.1, 1.6, 1, 1, 0, 0.5)


def test_horizon():
    """At exactly π/2 (source or viewer) the BRDF is 0; just above it is finite."""
    for cls in MODELS.values():
        m = cls(**{p.name: PAINT.get(p.name, p.default) for p in cls.parameters})
        f = m.mueller([np.pi / 2, 0.3, np.pi / 2, 0.0], [0.3, np.pi / 2, np.pi / 2, np.pi / 2], 0.4)
        assert not f.any()
        f = m.mueller([np.pi / 2 - 1e-9, 0.3], [0.3, np.pi / 2 - 1e-9], 0.4)
        assert np.isfinite(f).all() and (f[:, 0, 0] > 0).all()


# --- parts and incident light ---


@BOTH
@pytest.mark.parametrize("kappa", [0.0, 1.2])
def test_parts_add_up(cls, kappa):
    m = cls(**PAINT, kappa=kappa)
    theta = np.linspace(0, 1.5, 9)
    parts = [m.mueller(theta, theta[::-1], 0.7, part=p) for p in ("specular", "diffuse", "total")]
    close(parts[0] + parts[1], parts[2])


@BOTH
def test_stokes_is_mueller_times_incident(cls):
    """Natural light by default; polarised incident light as one vector, one per direction, or a list."""
    m = cls(**PAINT, kappa=0.8)
    theta = np.linspace(0, 1.5, 5)
    f = m.mueller(theta, 0.6, 1.0)
    close(m.stokes(theta, 0.6, 1.0), f[..., 0])
    for S in ((1, 1, 0, 0), (1, 0, 0, -1), [2.0, 0.5, -0.3, 0.1], np.array([1.0, 0.1, 0.2, 0.3])):
        close(m.stokes(theta, 0.6, 1.0, incident=S), f @ np.asarray(S, dtype=float))
    S = np.random.default_rng(1).uniform(-1, 1, size=(5, 4))
    S[:, 0] = 2.0
    close(m.stokes(theta, 0.6, 1.0, incident=S), np.einsum("nij,nj->ni", f, S))
    assert m.stokes(theta, 0.6, 1.0, part="diffuse").shape == (5, 4)


# --- xarray ---


def test_xarray_in_labelled_xarray_out():
    theta_i = xr.DataArray([0.2, 0.5], dims="theta_i", coords={"theta_i": [0.2, 0.5]})
    theta_r = xr.DataArray([0.1, 0.6, 1.0], dims="theta_r", coords={"theta_r": [0.1, 0.6, 1.0]})
    m = DoubleGauss(**PAINT)
    f = m.mueller(theta_i, theta_r, 0.3)
    assert f.dims == ("theta_i", "theta_r", "stokes_out", "stokes_in")
    assert list(f.stokes_out.values) == list("IQUV") == list(f.stokes_in.values)
    assert f.attrs["units"] == "1/sr" and f.name == "mueller"
    close(f.sel(theta_i=0.5, theta_r=1.0).values, m.mueller(0.5, 1.0, 0.3))
    S = m.stokes(theta_i, theta_r, 0.3)
    assert S.dims == ("theta_i", "theta_r", "stokes_out") and S.name == "stokes"
    close(S.values, f.sel(stokes_in="I").values)


def test_xarray_parameters_and_incident_light():
    paint = xr.DataArray([0.02, 0.1], dims="paint", coords={"paint": ["a", "b"]})
    m = DoubleGauss(**{**PAINT, "sigma": paint})
    view = xr.DataArray([0.3, 0.6, 0.9], dims="view")
    f = m.mueller(0.4, view, 0.0)
    assert set(f.dims[:2]) == {"paint", "view"}
    close(
        f.sel(paint="b").isel(view=2).values,
        DoubleGauss(**{**PAINT, "sigma": 0.1}).mueller(0.4, 0.9, 0.0),
    )
    light = xr.DataArray(
        [[1, 0.5, 0, 0], [1, 0, 0, 0.5]], dims=("light", "stokes_in"), coords={"stokes_in": list("IQUV")}
    )
    S = m.stokes(0.4, view, 0.0, incident=light)
    assert set(S.dims) == {"paint", "view", "light", "stokes_out"}
    close(
        S.sel(paint="b").isel(view=2, light=1).values,
        f.sel(paint="b").isel(view=2).values @ [1, 0, 0, 0.5],
    )


# --- Dr.Jit ---


def test_drjit_arrays(f_paint):
    Float = get_backend().Float
    m = DoubleGauss(**PAINT)
    f = m.mueller(Float([0.5, 0.6]), Float(0.9), 0.7)
    assert type(f) is get_backend().module.Matrix4f64
    close(np.array([[f[i, j].numpy()[0] for j in range(4)] for i in range(4)]), f_paint)
    S = m.stokes(Float([0.5, 0.6]), 0.9, 0.7)
    assert type(S) is get_backend().module.Array4f64
    close(S.numpy()[:, 0] if S.numpy().shape[0] == 4 else S.numpy()[0], f_paint[:, 0])


def test_drjit_incident_light():
    Float, module = get_backend().Float, get_backend().module
    m = DoubleGauss(**PAINT)
    S = m.stokes(Float([0.5, 0.6]), 0.9, 0.7, incident=module.Array4f64(1.0, 0.2, 0.3, 0.0))
    expected = m.stokes(np.array([0.5, 0.6]), 0.9, 0.7, incident=(1.0, 0.2, 0.3, 0.0))
    close(np.stack([S[i].numpy() for i in range(4)], -1), expected)


def test_drjit_single_precision(f_paint):
    """float32, as a renderer has it: the same numbers to single precision."""
    Float32 = get_backend().module.Float
    f = DoubleGauss(**PAINT).mueller(Float32([0.5, 0.6]), Float32(0.9), Float32(0.7))
    assert type(f) is get_backend().module.Matrix4f
    found = np.array([[f[i, j].numpy()[0] for j in range(4)] for i in range(4)])
    close(found, f_paint, 2e-4)  # the Gaussian lobe's exponent amplifies the angles' rounding


def test_drjit_tensors():
    """Tensors of shape (2, 3) and (3,) broadcast and give a tensor of shape (2, 3, 4, 4)."""
    Tensor = get_backend().module.TensorXf64
    theta_i, theta_r = np.array([[0.2], [0.5]]), np.array([0.1, 0.6, 1.0])
    m = DoubleGauss(**PAINT)
    f = m.mueller(Tensor(theta_i), Tensor(theta_r), 0.3)
    assert type(f) is Tensor and f.shape == (2, 3, 4, 4)
    close(f.numpy(), m.mueller(theta_i, theta_r, 0.3))
    assert m.stokes(Tensor(theta_i), Tensor(theta_r), 0.3).shape == (2, 3, 4)


def test_drjit_parameters():
    Float = get_backend().Float
    f = DoubleGauss(**{**PAINT, "sigma": Float([0.02, 0.1])}).mueller(*ANGLES)
    close(f[0, 0].numpy(), DoubleGauss(**{**PAINT, "sigma": np.array([0.02, 0.1])}).mueller(*ANGLES)[:, 0, 0])


def test_drjit_horizon():
    Float = get_backend().Float
    f = DoubleGauss(**PAINT).mueller(Float([np.pi / 2, 0.3]), Float([0.3, np.pi / 2]), 0.0)
    assert all(not f[i, j].numpy().any() for i in range(4) for j in range(4))


# --- the model as an object ---


def test_replace_returns_a_changed_copy():
    m = DoubleGauss(**PAINT)
    other = m.replace(sigma=0.1, normalization="visible")
    assert other.values["sigma"] == 0.1 and other.chosen["normalization"] == "visible"
    assert m.values["sigma"] == PAINT["sigma"] and m.chosen["normalization"] == "weighted"
    assert other.values["t"] == m.values["t"] and type(other) is DoubleGauss
    assert m.replace() == m and other != m


def test_models_are_immutable():
    values = np.array([0.02, 0.1])
    m = DoubleGauss(**{**PAINT, "sigma": values})
    with pytest.raises(AttributeError, match=r"replace\(sigma"):
        m.sigma = 0.2
    with pytest.raises(AttributeError, match="immutable"):
        m.values = {}
    with pytest.raises(ValueError, match="read-only"):
        m.values["sigma"][0] = 5.0
    values[0] = 5.0  # the caller's own array is not the model's
    assert m.values["sigma"][0] == 0.02


def test_repr_and_equality():
    m = DoubleGauss(**PAINT)
    assert repr(m) == "DoubleGauss(sigma=0.0398, n=1.6207, kappa=0, a=1.5174, k=1.2504, b=0.1827, t=0.6717)"
    assert eval(repr(m)) == m
    assert "normalization='visible'" in repr(m.replace(normalization="visible"))
    assert "<3 in 0.01 … 0.03>" in repr(m.replace(sigma=np.array([0.01, 0.02, 0.03])))
    assert m != ReciprocalDoubleGauss(**PAINT) and m != "paint"
    with pytest.raises(TypeError):
        hash(m)


def test_copies():
    m = DoubleGauss(**PAINT, shadowing="smith")
    assert copy.copy(m) == m and copy.deepcopy(m) == m and pickle.loads(pickle.dumps(m)) == m


def test_catalogue():
    """Every model names and describes its parameters; bounds for fitting lie inside the domain."""
    assert {"double-gauss", "reciprocal-double-gauss"} < set(MODELS)
    for name, cls in MODELS.items():
        assert issubclass(cls, Model) and cls.name == name
        for p in cls.parameters:
            assert isinstance(p, Parameter)
            assert p.domain[0] <= p.lower < p.upper <= p.domain[1] and p.lower <= p.default <= p.upper
            assert p.description in cls.describe() and p.unit
    for cls in (DoubleGauss, ReciprocalDoubleGauss):
        assert [p.name for p in cls.parameters] == ["sigma", "n", "kappa", "a", "k", "b", "t"]
        assert [p.name for p in cls.parameters if not p.fitted] == ["kappa"]


def test_bounds_are_those_of_the_model_document():
    bounds = {p.name: (p.lower, p.upper) for p in DoubleGauss.parameters}
    assert bounds["sigma"] == (0.002, 0.6) and bounds["n"] == (1.2, 2.6) and bounds["k"] == (0.3, 4.0)
    assert bounds["b"] == (-3.0, 4.0) and bounds["t"] == (0.0, 1.0) and bounds["a"][0] > 0


def test_new_values_do_not_compile_new_kernels():
    """Scalars are opaque: a loop over parameter values runs one kernel."""
    theta = np.linspace(0, 1, 7)
    DoubleGauss(**PAINT).mueller(theta, 0.5, 0.0)
    dr.kernel_history_clear()
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        for sigma in (0.021, 0.022, 0.023):
            DoubleGauss(**{**PAINT, "sigma": sigma}).mueller(theta, 0.51, 0.1)
        history = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]
    assert history and all(k["cache_hit"] for k in history)
    dr.kernel_history_clear()
