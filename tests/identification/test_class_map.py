"""Identification of every pixel: simulated images with known regions, against identify() pixel by pixel."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr

import pbrdf
from pbrdf.errors import DataError, FitError
from pbrdf.identification import class_map
from pbrdf.identification.class_map import NONE_OF_THESE, NOT_MEASURED, identify_map
from pbrdf.identification.conformal import calibrate
from pbrdf.identification.identify import identify
from pbrdf.identification.library import Library, bundled_library
from pbrdf.identification.material import material_from_model
from pbrdf.inversion.parameter_map import PENDING

ANGLES = [
    np.radians([30.0, 30.0, 30.0, 50.0, 50.0, 50.0, 65.0, 65.0, 65.0]),
    np.radians([20.0, 30.0, 45.0, 35.0, 50.0, 65.0, 50.0, 65.0, 75.0]),
    np.zeros(9),
]
LIBRARY = bundled_library()
#: Another paint, as unlike the others as they are unlike each other.
STRANGER = material_from_model(
    "unseen",
    pbrdf.DoubleGauss(sigma=0.08, n=1.5, a=1.2, k=1.1, b=0.1, t=0.3),
    scatter=dict(
        zip(
            LIBRARY.materials[0].space.names,
            map(float, np.sqrt(np.diag(LIBRARY.materials[0].covariance))),
            strict=True,
        )
    ),
)


def regions(shape):
    """Number of the material of each pixel: bands of the library's and of the stranger, 5."""
    return np.broadcast_to((np.arange(shape[1]) * 6) // shape[1], shape)


def specimens(truth, rng):
    """Parameters of each pixel's specimen, (P, …)."""
    drawn = np.empty((len(LIBRARY.materials[0].mean), *truth.shape))
    for number, material in enumerate((*LIBRARY.materials, STRANGER)):
        own = truth == number
        drawn[:, own] = material.draw(int(own.sum()), rng).T
    return drawn


def parameter_map(shape=(12, 36), seed=1, relative=0.1):
    """A map as fit_map makes it, errors a part of the scatter between specimens; and the truth."""
    rng = np.random.default_rng(seed)
    truth = regions(shape)
    material = LIBRARY.materials[0]
    names = material.space.names
    true = np.moveaxis(specimens(truth, rng), 0, -1)
    spread = relative * np.sqrt(np.diag(material.covariance))
    unknowns = material.space.to_unknowns(true) + spread * rng.standard_normal(true.shape)
    estimate = material.space.to_parameters(unknowns)
    error = spread * material.space.derivative(estimate)
    over = ("parameter", "y", "x")
    ds = xr.Dataset(
        {
            "estimate": (over, np.moveaxis(estimate, -1, 0)),
            "standard_error": (over, np.moveaxis(error, -1, 0)),
            "flags": (over, np.zeros((len(names), *shape), dtype=np.uint8)),
            "status": (("y", "x"), np.zeros(shape, dtype=np.int8)),
        },
        coords={"parameter": names, "x": np.arange(shape[1]) * 0.5},
        attrs={"model": json.dumps({"model": material.space.model.name, "options": {}, "fixed": {}})},
    )
    return ds, truth


def cube(shape=(8, 30), seed=2, noise=0.01, gain=False):
    """Stokes parameters of specimens, a specimen for each pixel; and the truth."""
    rng = np.random.default_rng(seed)
    truth = regions(shape)
    space = LIBRARY.materials[0].space
    drawn = specimens(truth, rng)
    named = {p.name: drawn[i][..., None] for i, p in enumerate(space.free)} | dict(space.fixed)
    model = space.model.from_values(named, **space.options)
    stokes = model.stokes(*(angle[None, None] for angle in ANGLES))
    if gain:
        stokes = stokes * np.exp(rng.standard_normal(shape))[..., None, None]
    std = noise * stokes[..., :1]
    variables = {}
    for i, name in enumerate("IQU"):
        value = stokes[..., i] + std[..., 0] * rng.standard_normal(std[..., 0].shape)
        variables[name] = (("y", "x", "geometry"), value, {"units": "1/sr"})
        variables[f"{name}_std"] = (("y", "x", "geometry"), std[..., 0].copy(), {"units": "1/sr"})
    coords = {
        name: ("geometry", angle, {"units": "rad"})
        for name, angle in zip(("theta_i", "theta_r", "phi"), ANGLES, strict=True)
    }
    coords["group"] = ("geometry", np.zeros(9, dtype=int))
    like = pbrdf.open_experiment("white")
    attrs = {**like.attrs, "quantity": "brdf"}
    return xr.Dataset(variables, coords, attrs), truth


def test_parameter_map():
    ds, truth = parameter_map()
    known = truth < 5
    wide = identify_map(ds, LIBRARY, confidence=0.99)
    assert (wide["material"].values[known] == truth[known]).mean() >= 0.95
    found = identify_map(ds, LIBRARY)
    best = found["probability"].values.argmax(axis=0)
    assert (best[known] == truth[known]).mean() >= 0.95
    assert (found["material"].values[~known] == NONE_OF_THESE).mean() >= 0.95
    inside = np.take_along_axis(found["in_set"].values, np.minimum(truth, 4)[None], axis=0)[0]
    assert inside[known].mean() == pytest.approx(0.95, abs=0.03)
    assert found["probability"].dims == ("material_name", "y", "x")
    assert found["probability"].dtype == found["p_value"].dtype == found["confidence"].dtype == np.float32
    assert found["material"].dtype == np.int16
    assert np.array_equal(found["x"], ds["x"])
    assert found["material"].attrs["flag_values"].tolist() == [-2, -1, 0, 1, 2, 3, 4]
    assert found["material"].attrs["flag_meanings"].split() == [
        "not_measured",
        "none_of_these",
        *LIBRARY.names,
    ]
    assert np.isnan(found["confidence"].values[found["material"].values < 0]).all()


def test_pixels_that_are_not_measured():
    ds, _ = parameter_map((2, 6))
    ds["status"][0, :4] = [1, 2, 3, 5]
    ds["estimate"][:, 0, 4] = np.nan
    ds["mask"] = (("y", "x"), np.ones((2, 6), dtype=bool))
    ds["mask"][0, 5] = False
    found = identify_map(ds, LIBRARY)
    assert (found["material"].values[0] == NOT_MEASURED).all()
    assert (found["material"].values[1] != NOT_MEASURED).all()
    assert np.isnan(found["probability"].values[:, 0]).all()
    assert not found["in_set"].values[:, 0].any()


def test_pixels_that_are_not_yet_fitted_are_not_taken_for_pixels_without_data():
    ds, _ = parameter_map((2, 6))
    whole = identify_map(ds, LIBRARY)
    ds["status"][1, 2] = PENDING
    ds["estimate"][:, 1, 2] = np.nan
    with pytest.raises(DataError, match=r"this map is not complete: .* not yet fitted .* by a variable mask"):
        identify_map(ds, LIBRARY)
    done = ds["status"] != PENDING
    found = identify_map(ds.assign(mask=done), LIBRARY)["material"]
    np.testing.assert_array_equal(found, whole["material"].where(done, NOT_MEASURED))


def test_a_parameter_on_a_bound_says_nothing():
    """Whatever its value and error, and as if its standard error were NaN."""
    ds, _ = parameter_map((2, 12))
    flagged, other = ds.copy(deep=True), ds.copy(deep=True)
    flagged["flags"][2] = 1
    flagged["estimate"][2] = 7.0
    other["standard_error"][2] = np.nan
    found, expected = identify_map(flagged, LIBRARY), identify_map(other, LIBRARY)
    assert found["p_value"].values == pytest.approx(expected["p_value"].values, abs=1e-4)
    assert found["probability"].values == pytest.approx(expected["probability"].values, abs=1e-4)


def test_all_parameters_undetermined_leave_every_material():
    ds, _ = parameter_map((1, 6))
    ds["flags"][:] = 4
    found = identify_map(ds, LIBRARY)
    assert found["in_set"].values.all()
    assert found["probability"].values == pytest.approx(0.2, abs=1e-3)


def test_correlations_count():
    """A covariance along the correlation: the distance of SciPy's normal distribution."""
    ds, _ = parameter_map((1, 6), relative=0.5)
    size = ds.sizes["parameter"]
    correlation = np.full((size, size), 0.4) + 0.6 * np.eye(size)
    ds["correlation"] = (
        ("parameter", "other", "y", "x"),
        np.broadcast_to(correlation[..., None, None], (size, size, 1, 6)),
    )
    found = identify_map(ds, LIBRARY)
    from scipy.stats import chi2

    for x in range(6):
        material = LIBRARY.materials[1]
        values = ds["estimate"].values[:, 0, x]
        spread = ds["standard_error"].values[:, 0, x] / material.space.derivative(values)
        off = material.space.to_unknowns(values) - material.mean
        total = material.covariance + correlation * np.outer(spread, spread)
        expected = chi2.sf(off @ np.linalg.solve(total, off), size)
        assert found["p_value"].values[1, 0, x] == pytest.approx(expected, rel=1e-3, abs=1e-6)


@pytest.mark.parametrize("gain", [False, True])
def test_stokes_as_pixel_by_pixel(gain):
    """Probabilities within 0.02, p-values within 0.05, of what identify finds with the model itself."""
    ds, truth = cube((2, 18), gain=gain)
    ds["Q"][0, 3, 2:5] = np.nan
    ds["I_std"][1, 1, 0] = np.nan
    found = identify_map(ds, LIBRARY, gain=gain)
    for y, x in np.ndindex(truth.shape):
        one = identify(ds.isel(y=y, x=x), LIBRARY, gain=gain)
        p = np.array([one[name].p_value for name in LIBRARY.names])
        share = np.array([one[name].probability for name in LIBRARY.names])
        assert found["p_value"].values[:, y, x] == pytest.approx(p, abs=0.05)
        if p.max() > 1e-6:
            assert found["probability"].values[:, y, x] == pytest.approx(share, abs=0.02)


def test_stokes_regions_and_pixels_without_data():
    ds, truth = cube()
    for name in ("I", "Q", "U"):
        ds[name][0, :5] = np.nan
    calls = []
    found = identify_map(ds, LIBRARY, progress=lambda *of: calls.append(of))
    material = found["material"].values
    assert (material[0, :5] == NOT_MEASURED).all()
    rest = material[1:], truth[1:]
    known = rest[1] < 5
    assert (found["probability"].values.argmax(axis=0)[1:][known] == rest[1][known]).mean() >= 0.95
    assert (rest[0][~known] == NONE_OF_THESE).mean() >= 0.95
    assert calls[-1] == (truth.size, truth.size)


def test_order_of_dimensions_and_scale_of_the_data():
    """Reflectance factors over (geometry, x, y) are the same light."""
    ds, _ = cube((2, 12))
    turned = ds.transpose("geometry", "x", "y").assign_attrs(quantity="reflectance_factor")
    for name in turned.data_vars:
        turned[name] = turned[name] * np.pi
    found, expected = identify_map(turned, LIBRARY), identify_map(ds, LIBRARY)
    assert found["p_value"].transpose("material_name", "y", "x").values == pytest.approx(
        expected["p_value"].values, abs=1e-3
    )


def test_blocks_do_not_change_the_result(monkeypatch):
    for ds in (parameter_map((6, 18))[0], cube((4, 18))[0]):
        whole = identify_map(ds, LIBRARY)
        monkeypatch.setattr(class_map, "PIXELS", 25)
        calls = []
        parts = identify_map(ds, LIBRARY, progress=lambda *of: calls.append(of))  # noqa: B023
        monkeypatch.undo()
        assert len(calls) > 1
        assert np.array_equal(parts["material"], whole["material"])
        assert parts["p_value"].values == pytest.approx(whole["p_value"].values, abs=2e-3)
        assert parts["probability"].values == pytest.approx(whole["probability"].values, abs=2e-3)


def test_blocks_cover_an_image_once():
    for shape, pixels in (((7, 5), 1), ((7, 5), 5), ((7, 5), 12), ((3, 4, 5), 7), ((6,), 4), ((4, 4), 100)):
        count = np.zeros(shape, dtype=int)
        for place in class_map._blocks(shape, pixels):
            count[place] += 1
            assert count[place].size <= pixels
        assert (count == 1).all()


def test_geometries_of_each_pixel():
    """Angles over the image too: the models are evaluated, the result is that of shared angles."""
    ds, _ = cube((2, 6))
    own = ds.assign_coords(
        theta_r=(("y", "x", "geometry"), np.broadcast_to(ANGLES[1], (2, 6, 9)).copy(), {"units": "rad"})
    )
    found, expected = identify_map(own, LIBRARY), identify_map(ds, LIBRARY)
    assert found["p_value"].values == pytest.approx(expected["p_value"].values, abs=0.05)
    assert np.array_equal(found["in_set"], expected["in_set"])


def test_degree_and_angle_of_polarisation():
    """Quantities that are no Stokes components are read pixel by pixel, as identify does."""
    ds, _ = cube((1, 4))
    intensity = ds["I"].values
    dolp = np.hypot(ds["Q"].values, ds["U"].values) / intensity
    aolp = np.mod(0.5 * np.arctan2(ds["U"].values, ds["Q"].values), np.pi)
    over = ("y", "x", "geometry")
    ratios = ds[["I", "I_std"]].assign(
        dolp=(over, dolp, {"units": "1"}),
        dolp_std=(over, np.full_like(dolp, 0.01), {"units": "1"}),
        aolp=(over, aolp, {"units": "rad"}),
    )
    ratios["I"][0, 3], ratios["dolp"][0, 3], ratios["aolp"][0, 3] = np.nan, np.nan, np.nan
    found = identify_map(ratios, LIBRARY)
    for x in range(3):
        one = identify(ratios.isel(y=0, x=x), LIBRARY)
        p = [one[name].p_value for name in LIBRARY.names]
        assert found["p_value"].values[:, 0, x] == pytest.approx(p, abs=1e-5)
    assert found["material"].values[0, 3] == NOT_MEASURED


def test_a_stated_noise():
    ds, _ = cube((1, 6))
    bare = ds[["I", "Q", "U"]]
    for noise in ("instrument:linear=2%", "3%,1%"):
        found = identify_map(bare, LIBRARY, noise=noise)
        for x in range(6):
            one = identify(bare.isel(y=0, x=x), LIBRARY, noise=noise)
            p = [one[name].p_value for name in LIBRARY.names]
            assert found["p_value"].values[:, 0, x] == pytest.approx(p, abs=0.03)


def test_smoothing_removes_stray_pixels_and_leaves_the_unlike():
    """Few data of much noise: neighbours tell what a pixel does not. None of these stays as it was."""
    ds, truth = cube((24, 60), noise=0.3)
    rough, smooth = identify_map(ds, LIBRARY), identify_map(ds, LIBRARY, smoothing=1.5)
    known = truth < 5
    wrong = [(found["probability"].values.argmax(axis=0) != truth)[known].mean() for found in (rough, smooth)]
    assert wrong[0] > 0.05
    assert wrong[1] < 0.5 * wrong[0]
    assert np.array_equal(rough["in_set"], smooth["in_set"])
    nothing = rough["material"].values == NONE_OF_THESE
    assert np.array_equal(smooth["material"].values == NONE_OF_THESE, nothing)


def test_a_calibration_keeps_what_is_far_by_chi_square():
    """Specimens that scatter more than stated: the calibrated sets hold them, and the first look lets them."""
    wide = Library(
        tuple(
            material_from_model(
                m.name,
                m.model,
                scatter=dict(
                    zip(m.space.names, map(float, 0.1 * np.sqrt(np.diag(m.covariance))), strict=True)
                ),
            )
            for m in LIBRARY.materials
        )
    )
    ds, truth = cube((10, 60), seed=3, noise=0.02)
    known = truth < 5
    first = identify_map(ds, wide)
    own = np.take_along_axis(first["in_set"].values, np.minimum(truth, 4)[None], axis=0)[0]
    assert own[known].mean() < 0.5
    none = calibrate(wide.names, np.zeros((5, 5)), np.full((5, 5), 1e-300), np.arange(5), "all far away")
    kept = identify_map(ds, wide, calibration=none)
    assert kept.attrs["calibration"] == "all far away"
    own = np.take_along_axis(kept["in_set"].values, np.minimum(truth, 4)[None], axis=0)[0]
    assert own[known].mean() > 0.95


def test_read_from_a_store_block_by_block(tmp_path, monkeypatch):
    pytest.importorskip("zarr")
    ds, _ = cube((4, 12))
    ds.to_zarr(tmp_path / "cube.zarr", consolidated=False)
    with xr.open_zarr(tmp_path / "cube.zarr", chunks=None, consolidated=False) as opened:
        monkeypatch.setattr(class_map, "PIXELS", 24)
        found = identify_map(opened, LIBRARY)
        assert not isinstance(opened["I"].variable._data, np.ndarray)
    monkeypatch.undo()
    assert np.array_equal(found["material"], identify_map(ds, LIBRARY)["material"])


def test_no_more_than_a_block_is_read_at_a_time(monkeypatch):
    """Numbers that are read, by block, of data that are not in memory: none more than once."""
    from xarray.backends import BackendArray
    from xarray.core import indexing

    ds, _ = cube((6, 12))
    read = []

    class Counted(BackendArray):
        def __init__(self, values):
            self.values, self.shape, self.dtype = values, values.shape, values.dtype

        def __getitem__(self, key):
            def get(inner):
                read.append(self.values[inner].size)
                return self.values[inner]

            return indexing.explicit_indexing_adapter(key, self.shape, indexing.IndexingSupport.BASIC, get)

    lazy = ds.copy()
    for name in ds.data_vars:
        array = indexing.LazilyIndexedArray(Counted(ds[name].values))
        lazy[name] = xr.Variable(ds[name].dims, array, ds[name].attrs)
    monkeypatch.setattr(class_map, "PIXELS", 24)
    found = identify_map(lazy, LIBRARY)
    monkeypatch.undo()
    assert max(read) == 24 * 9
    assert sum(read) == sum(ds[name].size for name in ds.data_vars)
    assert np.array_equal(found["material"], identify_map(ds, LIBRARY)["material"])


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["parameters", "stokes", "gain"])
def test_coverage_of_the_sets(kind):
    """95 % sets hold the true material of 93 to 97 % of the pixels of every region."""
    shape = (80, 180)
    ds, truth = parameter_map(shape, 5) if kind == "parameters" else cube(shape, 5, 0.01, kind == "gain")
    found = identify_map(ds, LIBRARY, gain=kind == "gain")
    for number in range(5):
        inside = found["in_set"].values[number][truth == number]
        assert 0.93 <= inside.mean() <= 0.97
    right = found["probability"].values.argmax(axis=0) == truth
    assert right[truth < 5].mean() >= 0.95
    assert (found["material"].values[truth == 5] == NONE_OF_THESE).mean() >= 0.95


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda ds: ds.assign_attrs(model="lambert"), "map is of the model lambert"),
        (lambda ds: ds.isel(parameter=slice(1, None)), "map has no parameter sigma"),
        (lambda ds: ds.drop_vars("standard_error"), "standard_error"),
    ],
)
def test_errors_of_parameter_maps(change, message):
    ds, _ = parameter_map((1, 6))
    with pytest.raises((FitError, DataError), match=message):
        identify_map(change(ds), LIBRARY)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda ds: ds.isel(y=0, x=0), "no dimension of an image"),
        (lambda ds: ds[[]], "nothing to identify"),
        (lambda ds: ds.assign(Q=ds["Q"].isel(y=0)), "Q has the dimensions"),
        (lambda ds: ds.drop_vars("phi"), "no phi"),
        (lambda ds: ds.assign(mask=("x", np.ones(6, dtype=bool))), "mask has the dimensions"),
    ],
)
def test_errors_of_data(change, message):
    ds, _ = cube((1, 6))
    with pytest.raises((FitError, DataError), match=message):
        identify_map(change(ds), LIBRARY)


def test_errors_of_options():
    ds, _ = parameter_map((1, 6))
    with pytest.raises(FitError, match="smoothing"):
        identify_map(ds, LIBRARY, smoothing=-1.0)
    with pytest.raises(FitError, match="confidence"):
        identify_map(ds, LIBRARY, confidence=1.0)
    with pytest.raises(FitError, match="no material"):
        identify_map(ds, Library(()))
