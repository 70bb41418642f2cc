"""Maps against single fits of their pixels, in every way in which both can be asked for."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr
from map_helpers import assert_same, directions, measured, pixel, varied

import pbrdf
from pbrdf.inversion.parameter_map import FLAGS, PENDING, PixelStatus

#: Fewer unknowns and starts: the same code, sooner.
FEW = {"fix": {"k": 1.2504, "b": 0.1827}, "starts": 8}


@pytest.fixture(scope="module")
def data():
    return measured(varied((2, 2)), directions())


def compare(dataset, single=None, tolerance=1e-4, **options):
    """A map against four fits."""
    found = pbrdf.fit_map(dataset, **options)
    for y, x in np.ndindex(2, 2):
        one = pixel(dataset, y=y, x=x)
        result = pbrdf.fit(one if single is None else single(one), **options)
        assert_same(found.isel(y=y, x=x), result, tolerance)
    return found


WAYS = {
    "plain": {},
    "robust loss": {"loss": "huber"},
    "priors": {"priors": {"t": (0.6, 0.01)}},
    "stated noise": {"noise": "0.02,0.01"},
    "equal noise": {"noise": "equal"},
    "instrument": {"noise": "instrument:linear=1%,read=0.001"},
    "bounds": {"bounds": {"n": (1.4, 1.55)}},
    "paper": {"objective": "paper"},
    "start": {"start": {"n": 1.5}},
}


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
def test_a_map_is_as_many_single_fits(data, way):
    # the steps of a robust loss shrink less from one to the next
    compare(data, tolerance=2e-3 if way == "robust loss" else 1e-4, **FEW, **WAYS[way])


@pytest.mark.slow
def test_all_parameters_with_their_correlations(data):
    found = pbrdf.fit_map(data, correlation=True)
    for y, x in np.ndindex(2, 2):
        result = pbrdf.fit(pixel(data, y=y, x=x))
        own = found.isel(y=y, x=x)
        assert_same(own, result)
        np.testing.assert_allclose(own["correlation"].values, result.correlation.values, atol=1e-5)
    assert found["estimate"].dims == ("parameter", "y", "x")
    assert found["correlation"].dims == ("parameter", "other", "y", "x")


@pytest.mark.slow
@pytest.mark.parametrize("terms", [["gain"], ["gain:group"], ["angle"], ["dark"]], ids=lambda t: t[0])
def test_nuisance_terms(data, terms):
    dataset = data.assign(I=3.0 * data["I"], Q=3.0 * data["Q"], U=3.0 * data["U"])
    for name in ("I_std", "Q_std", "U_std"):
        dataset[name] = 3.0 * data[name]
    dataset.attrs["quantity"] = "radiance"
    # the gain and a are hardly told apart: both ends are as good, to what the last step leaves
    compare(dataset, nuisances=terms, tolerance=1e-3, **FEW)


def test_values_that_were_not_measured_are_left_out(data):
    holes = np.random.default_rng(3).random(data["I"].shape) < 0.3
    dataset = data.assign({n: data[n].where(~np.roll(holes, k, 0)) for k, n in enumerate("IQU")})
    found = compare(dataset, **FEW)
    assert len(np.unique(found["degrees_of_freedom"])) > 1


@pytest.mark.slow
def test_uncertainties_that_nobody_states_scale_with_the_residuals(data):
    compare(data.drop_vars(["I_std", "Q_std", "U_std"]), **FEW)
    # at one pixel only
    unknown = data.assign({f"{n}_std": data[f"{n}_std"].where(data["x"] > 0) for n in "IQU"})
    compare(unknown, **FEW)
    # of some values only: these are left out
    some = data.assign(I_std=data["I_std"].where(np.arange(data.sizes["geometry"])[:, None, None] % 3 > 0))
    compare(some, **FEW)


@pytest.mark.slow
def test_every_pixel_has_directions_of_its_own(data):
    theta_i, theta_r, phi = directions()
    shift = np.deg2rad(np.array([[0.0, 1.0], [2.0, 0.5]]))
    angles = (
        theta_i[:, None, None] + shift,
        theta_r[:, None, None] + 0.5 * shift,
        phi[:, None, None] + 0 * shift,
    )
    dataset = measured(varied((2, 2)), angles)
    compare(dataset, **FEW)
    # one angle of each pixel, two that they share
    partly = dataset.assign_coords(phi=("geometry", phi))
    compare(partly, **FEW)


@pytest.mark.slow
def test_directions_below_the_horizon_are_left_out():
    theta_i, theta_r, phi = (np.repeat(a[:, None], 4, axis=1).reshape(-1, 2, 2) for a in directions())
    dataset = measured(varied((2, 2)), (theta_i, theta_r, phi))
    theta_r = theta_r.copy()
    theta_r[:5, 0, 0], theta_r[3:9, 1, 1] = 1.7, np.nan
    over = ("geometry", "y", "x")
    dataset = dataset.assign_coords(theta_r=(over, theta_r))
    found = compare(dataset, lambda one: one.isel(geometry=one["theta_r"].values < 1.57), **FEW)
    assert found["degrees_of_freedom"].values.ravel().tolist() == [44, 59, 59, 41]


def covariances(data, correlation):
    std = np.stack([data[f"{n}_std"].values for n in "IQU"])
    matrix = np.full((data.sizes["geometry"], 2, 2, 4, 4), np.nan)
    for i, j in np.ndindex(3, 3):
        matrix[..., i, j] = std[i] * std[j] * (1.0 if i == j else correlation)
    return matrix


@pytest.mark.slow
def test_covariances(data):
    axes = {name: list("IQUV") for name in ("stokes_row", "stokes_column")}
    over = ("geometry", "y", "x", "stokes_row", "stokes_column")
    matrix = covariances(data, 0.4)
    for name, i in zip("IQU", range(3), strict=True):
        matrix[..., i, i] = data[f"{name}_std"].values * data[f"{name}_std"].values
    dataset = data.assign(covariance=(over, matrix)).assign_coords(axes)
    found = compare(dataset, **FEW)
    assert found.attrs["noise"] == "covariances of the data set"
    without = pbrdf.fit_map(data, **FEW)
    assert abs(found["chi2"] / without["chi2"] - 1.0).min() > 1e-3
    # of a geometry whose matrix is none nothing is left, and no other pixel is touched
    broken = matrix.copy()
    broken[2, 0, 0] = np.where(np.isnan(broken[2, 0, 0]), np.nan, broken[2, 0, 0, 0, 0])
    again = pbrdf.fit_map(dataset.assign(covariance=(over, broken)), **FEW)
    changed = again["chi2"].values != found["chi2"].values
    assert changed.ravel().tolist() == [True, False, False, False]
    assert int(again["degrees_of_freedom"][0, 0]) == int(found["degrees_of_freedom"][0, 0]) - 3


@pytest.mark.slow
def test_one_stated_covariance_for_all_pixels(data):
    matrix = covariances(data, -0.3)[:, 0, 0, :3, :3]
    found = compare(data, covariance=matrix, **FEW)
    assert found.attrs["noise"].startswith("stated")
    # a block in which one component was not measured
    without = data.assign(U=data["U"].where(data["y"] > 0.0))
    part = pbrdf.fit_map(without, covariance=matrix, block={"y": 1}, **FEW)
    np.testing.assert_allclose(part["chi2"][1], found["chi2"][1], rtol=1e-6)
    assert part["degrees_of_freedom"].values.tolist() == [[38, 38], [59, 59]]
    with pytest.raises(pbrdf.FitError, match=r"covariance has shape \(3, 3\)"):
        pbrdf.fit_map(data, covariance=matrix[0], **FEW)
    with pytest.raises(pbrdf.FitError, match=r"covariance at index 0 is not symmetric and positive definite"):
        pbrdf.fit_map(data, covariance=-matrix, **FEW)


@pytest.mark.slow
def test_ratios_and_degrees_of_polarisation(data):
    ratios = xr.Dataset(coords=data.coords, attrs=data.attrs | {"quantity": "normalised"})
    for name in "QU":
        ratios[f"{name}_over_I"] = data[name] / data["I"]
        ratios[f"{name}_over_I_std"] = 0.01 + 0.0 * data["I"]
    fix = FEW["fix"] | {"n": 1.6}
    compare(ratios, fix=fix, starts=8)
    degrees = xr.Dataset(coords=data.coords, attrs=data.attrs)
    degrees["I"], degrees["I_std"] = data["I"], data["I_std"]
    degrees["dolp"] = np.hypot(ratios["Q_over_I"], ratios["U_over_I"])
    degrees["aolp"] = 0.5 * np.arctan2(data["U"], data["Q"])
    degrees["dolp_std"], degrees["aolp_std"] = 0.01 + 0.0 * data["I"], 0.1 + 0.0 * data["I"]
    compare(degrees, fix=fix, starts=8)


@pytest.mark.slow
def test_mueller_matrices_of_single_precision_of_another_quantity():
    values, angles = varied((2, 2)), directions(4)
    paint = pbrdf.load_paint("matte-white-thick").replace(**values)
    matrices = np.stack(
        [paint.mueller(*(np.full((2, 2), a[g]) for a in angles)) for g in range(len(angles[0]))], axis=2
    )
    data = measured(values, angles)
    matrices = np.pi * matrices.astype(np.float32)
    noise = 0.01 * matrices[..., :1, :1]
    matrices = matrices + noise * np.random.default_rng(2).standard_normal(matrices.shape).astype(np.float32)
    over = ("y", "x", "geometry", "stokes_out", "stokes_in")
    dataset = xr.Dataset(
        {"mueller": (over, matrices), "mueller_std": (over, np.broadcast_to(noise, matrices.shape).copy())},
        {n: data[n] for n in data.coords} | {n: list("IQUV") for n in over[3:]},
        data.attrs | {"quantity": "reflectance_factor"},
    )
    compare(dataset, **FEW)


@pytest.mark.slow
def test_dimensions_in_any_order_and_number(data):
    found = pbrdf.fit_map(data, **FEW)
    turned = data.transpose("x", "geometry", "y")
    turned["Q"] = turned["Q"].transpose("y", "x", "geometry")
    again = pbrdf.fit_map(turned, **FEW)
    xr.testing.assert_equal(again.transpose(*found["estimate"].dims).drop_attrs(), found.drop_attrs())
    line = pbrdf.fit_map(data.isel(x=0, drop=True).rename(y="sample"), **FEW)
    np.testing.assert_allclose(line["estimate"].values, found["estimate"].values[:, :, 0], rtol=1e-7)
    deep = pbrdf.fit_map(data.expand_dims(time=[5.0, 6.0, 7.0]), **FEW)
    assert deep["status"].dims == ("time", "y", "x") and deep["time"].values.tolist() == [5.0, 6.0, 7.0]
    np.testing.assert_allclose(deep["estimate"].values[:, 2], found["estimate"].values, rtol=1e-5)


def test_a_pixel_never_breaks_a_block():
    data = measured(varied((3, 3)), directions())
    values = data["I"].values.copy()
    dataset = data.copy(deep=True)
    for name in "IQU":
        dataset[name].values[:, 0, 0] = np.nan
        dataset[name].values[1:, 0, 1] = np.nan
        dataset[name].values[:, 1, 1] = 1e9 * (-1.0) ** np.arange(len(values))
        dataset[f"{name}_std"].values[4:8, 2, 2] = [0.0, -1.0, np.inf, 0.0]
    dataset["I"].values[3, 2, 0] = np.inf
    mask = np.ones((3, 3), dtype=bool)
    mask[0, 2] = False
    found = pbrdf.fit_map(dataset.assign_coords(mask=(("y", "x"), mask)), **FEW)
    status = found["status"].values
    assert status[0, 0] == PixelStatus.NOT_MEASURED
    assert status[0, 1] == PixelStatus.TOO_FEW_VALUES
    assert status[0, 2] == PixelStatus.MASKED
    assert (status[[1, 1, 2, 2, 2], [0, 2, 0, 1, 2]] == PixelStatus.CONVERGED).all()
    alone = pbrdf.fit_map(data, **FEW)
    for y, x in ((1, 0), (1, 2), (2, 1)):
        np.testing.assert_allclose(
            found["estimate"][:, y, x],
            alone["estimate"][:, y, x],
            atol=1e-4 * float(alone["standard_error"].min()),
        )
    assert np.isnan(found["estimate"].values[:, 0]).all() and np.isnan(found["chi2"].values[0]).all()
    freedom = found["degrees_of_freedom"].values
    assert freedom[2].tolist() == [58, 59, 59 - 12] and freedom[0].tolist() == [0, 0, 0]


def test_repeated_readings_of_one_geometry_are_too_few(data):
    one = data.isel(geometry=[0] * 12)
    assert (pbrdf.fit_map(one, **FEW)["status"] == PixelStatus.TOO_FEW_VALUES).all()


def test_a_map_of_nothing(data):
    dataset = data.assign({name: data[name] * np.nan for name in "IQU"})
    assert (pbrdf.fit_map(dataset, **FEW)["status"] == PixelStatus.NOT_MEASURED).all()


def test_uncertainties_that_are_nowhere_above_0_are_refused(data):
    """At some values they are left out, see above; nowhere at all is a mistake."""
    for wrong in (0.0, -1.0):
        with pytest.raises(
            pbrdf.DataError, match=r"Q_std is 0 or less at \d+ of \d+ pixels, and nowhere above 0"
        ):
            pbrdf.fit_map(data.assign(Q_std=0.0 * data["Q_std"] + wrong), **FEW)


def test_what_a_map_says_of_itself(data):
    reports = []
    found = pbrdf.fit_map(data, progress=lambda *n: reports.append(n), **FEW)
    assert reports[-1] == (4, 4) and reports == sorted(reports)
    assert json.loads(found.attrs["model"])["fixed"]["k"] == 1.2504
    assert json.loads(found.attrs["settings"])["free"] == found["parameter"].values.tolist()
    assert found.attrs["pixels_fitted"] == 4 and found.attrs["seconds"] > 0.0
    assert 0.0 <= found.attrs["share_of_several_optima"] <= 1.0
    assert found["unit"].values.tolist() == ["1"] * 4
    assert found["status"].attrs["flag_meanings"].split()[PixelStatus.MASKED] == "masked"
    assert found["flags"].attrs["flag_masks"].tolist() == list(FLAGS.values())
    assert found["y"].values.tolist() == [0.0, 0.5]


def test_a_template_takes_no_memory(data):
    prepared = pbrdf.MapFit.prepare(data, **FEW)
    form = prepared.template()
    blank = {
        "degrees_of_freedom": -1,
        "optima": -1,
        "starts": -1,
        "flags": FLAGS["not_yet_fitted"],
        "status": PENDING,
    }
    for name, variable in form.data_vars.items():
        assert (variable == blank[name]).all() if name in blank else np.isnan(variable).all()
    assert form["estimate"].variable.values.strides == (0, 0, 0)
    json.dumps(prepared.settings)


def test_only_labelled_pixels_are_fitted(data):
    found = pbrdf.fit_map(data, labels=np.array([[1, 0], [2, 3]]), **FEW)
    assert (found["status"].values == PixelStatus.MASKED).tolist() == [[False, True], [False, False]]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"share": ["q"]}, "share: 'q' is not a free parameter; free are sigma, n, a, t"),
        ({"labels": "region"}, "labels: the data set has no variable 'region'"),
        (
            {"labels": np.ones(3, int)},
            r"labels has the shape \(3,\): it needs that of the image, \(2, 2\) along y, x",
        ),
        ({"labels": np.ones((2, 2))}, "label has the dimensions"),
        ({"block": {"z": 3}}, "block: 'z' is no dimension of the image; these are y, x"),
        ({"block": 0}, "block: 0 pixels along y"),
        ({"starts": 0}, "starts=0: at least one start is needed"),
        ({"loss": "l1"}, "loss='l1': choose one of"),
        ({"objective": "?"}, "objective='\\?': choose one of"),
        ({"model": "no-model"}, "no-model"),
        ({"fix": {"x": 1.0}}, "fix: double-gauss has no parameter 'x'"),
    ],
)
def test_options_that_allow_no_map(data, options, message):
    with pytest.raises(pbrdf.PbrdfError, match=message):
        pbrdf.fit_map(data, **{**FEW, **options})


def test_data_that_allow_no_map(data):
    with pytest.raises(pbrdf.DataError, match=r"no dimension beside 'geometry'.*pbrdf.fit"):
        pbrdf.fit_map(pixel(data, y=0, x=0), **FEW)
    with pytest.raises(pbrdf.DataError, match="no variable 'W'"):
        pbrdf.fit_map(data.rename(U="W"), **FEW)
    with pytest.raises(pbrdf.DataError, match=r"group has the dimensions .* needs 'geometry' alone"):
        pbrdf.fit_map(data.assign_coords(group=data["I"].astype(int)), **FEW)
    with pytest.raises(pbrdf.DataError, match="theta_i, indices 0, 1"):
        pbrdf.fit_map(data.assign_coords(theta_i=data["theta_i"] + 1.6), **FEW)
    with pytest.raises(pbrdf.DataError, match="floating-point numbers are needed"):
        pbrdf.fit_map(data.assign(I=data["I"].astype(int)), **FEW)
    with pytest.raises(pbrdf.FitError, match="3 measured values cannot determine 4 parameters"):
        pbrdf.fit_map(data.isel(geometry=[0]), **FEW)
