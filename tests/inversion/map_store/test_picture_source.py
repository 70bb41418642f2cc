"""Several files of a map are put together by their labels, or refused with what differs."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import pbrdf
from pbrdf.errors import DataError
from pbrdf.instruments.pixel_geometry.text_form import parse_pixel_geometry
from pbrdf.inversion.map_store.picture_source import PictureSource
from pbrdf.inversion.map_store.settings import differences
from pixel_helpers import blank

FLAT = parse_pixel_geometry("flat:theta_i=30,theta_r=40,phi=0,reference=0")


def matrices(order="IQUV", seed=0, dims=("stokes_out", "stokes_in")):
    """Mueller matrices of 2 geometries at 3 × 4 pixels, their rows and columns in an order of the components."""
    at = ["IQUV".index(name) for name in order]
    values = np.random.default_rng(seed).uniform(-0.1, 0.1, (2, 3, 4, 4, 4))
    values[..., 0, 0] = 1.0
    labels = {"stokes_out": list(order), "stokes_in": list(order)}
    found = xr.Dataset(
        {"mueller": (("geometry", "y", "x", "stokes_out", "stokes_in"), values[..., at, :][..., at])},
        {
            **{name: ("geometry", angle, {"units": "degree"}) for name, angle in
               (("theta_i", [10.0, 20.0]), ("theta_r", [30.0, 40.0]), ("phi", [180.0, 170.0]))},
            "y": range(3),
            "x": range(4),
            **labels,
        },
        {"quantity": "brdf", "stokes_convention": "p-s", "simulated": 0, "illumination": [1.0, 0.0, 0.0, 0.0]},
    )  # fmt: skip
    return found.transpose("geometry", "y", "x", *dims)


def stored(tmp_path, *datasets):
    paths = [tmp_path / f"{k}.nc" for k in range(len(datasets))]
    for path, dataset in zip(paths, datasets, strict=True):
        dataset.to_netcdf(path, engine="h5netcdf")
    return paths


@pytest.mark.parametrize("orders", [("IQUV", "IUQV"), ("VUQI", "IQUV"), ("IUQV", "VUQI")])
def test_components_in_another_order_are_the_same_data(tmp_path, orders):
    plain = PictureSource.open(stored(tmp_path, matrices(), matrices(seed=1))).block({})
    source = PictureSource.open(stored(tmp_path, *(matrices(o, seed=k) for k, o in enumerate(orders))))
    np.testing.assert_array_equal(source.block({})["mueller"], plain["mueller"])
    assert source.block({})["stokes_out"].values.tolist() == list("IQUV")
    # so does the fit take them
    pbrdf.MapFit.prepare(source.outline())


def test_other_names_of_components_are_refused_in_any_file(tmp_path):
    other = matrices(seed=1).assign_coords(stokes_in=["s0", "s1", "s2", "s3"])
    source = PictureSource.open(stored(tmp_path, matrices(), other))
    with pytest.raises(
        DataError, match=r"1\.nc: the coordinate stokes_in must be I, Q, U, V, not s0, s1, s2, s3"
    ):
        source.block({})


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        (
            lambda d: d.isel(y=slice(None, None, -1)),
            r"y is 2, 1, 0 in .*1\.nc, and 0, 1, 2 in .*0\.nc: these are not",
        ),
        (lambda d: d.assign_coords(x=d.x + 5), r"x is 5, 6, 7, 8 in .*1\.nc, and 0, 1, 2, 3 in .*0\.nc"),
        (
            lambda d: d.assign_attrs(quantity="radiance"),
            r"quantity is radiance in .*1\.nc, and brdf in .*0\.nc",
        ),
        (lambda d: d.assign_attrs(simulated=1), r"simulated is 1 in .*1\.nc, and 0 in .*0\.nc"),
        (
            lambda d: d.assign_attrs(scale="arbitrary"),
            r"scale is arbitrary in .*1\.nc, and not stated in .*0\.nc",
        ),
        (
            lambda d: d.assign_attrs(illumination=[1.0, 1.0, 0.0, 0.0]),
            r"illumination is 1, 1, 0, 0 in .*1\.nc, and 1, 0, 0, 0 in .*0\.nc",
        ),
        (
            lambda d: d.assign_coords(wavelength=("geometry", [650.0, 650.0])),
            r"wavelength is 650 in .*1\.nc, and not stated in .*0\.nc: a map has one set of",
        ),
        (
            lambda d: d.rename(mueller="mueller_over_m00"),
            r"1\.nc: holds mueller_over_m00, and .*0\.nc mueller: several files of a map hold the same components",
        ),
    ],
)
def test_what_is_labelled_otherwise_is_refused_with_both(tmp_path, changed, words):
    with pytest.raises(DataError, match=words):
        PictureSource.open(stored(tmp_path, matrices(), changed(matrices(seed=1))))


def test_several_wavelengths_go_together_where_each_file_has_them(tmp_path):
    both = [
        matrices(seed=k).assign_coords(wavelength=("geometry", [550.0, 650.0 + 0.1 * k])) for k in range(2)
    ]
    micrometres = both[1].assign_coords(wavelength=("geometry", [0.55, 0.6501], {"units": "um"}))
    assert PictureSource.open(stored(tmp_path, both[0], micrometres)).block({}).sizes["geometry"] == 4
    one = both[0].assign_coords(wavelength=("geometry", [550.0, 550.0]))
    with pytest.raises(DataError, match=r"wavelength is 550 in .*1\.nc, and 550, 650 in .*0\.nc"):
        PictureSource.open(stored(tmp_path, both[0], one))


def test_pictures_of_other_pixels_or_components_are_refused(tmp_path):
    pictures = blank(3, 4)
    for other, words in (
        (pictures.isel(y=slice(None, None, -1)), "y is 2, 1, 0 in"),
        (pictures.drop_vars("U"), r"holds I, Q, and .*0\.nc I, Q, U"),
    ):
        with pytest.raises(DataError, match=words):
            PictureSource.open(stored(tmp_path, pictures, other), [FLAT])
    assert PictureSource.open(stored(tmp_path, pictures, pictures), [FLAT]).block({}).sizes["geometry"] == 2


def test_a_map_is_not_gone_on_with_where_the_components_stand_in_another_order(tmp_path):
    """The store says which label, as it was and as it is."""
    first, other = (PictureSource.open([path]) for path in stored(tmp_path, matrices(), matrices("IUQV")))
    told = list(differences(first.identity(), other.identity()))
    assert 'files[0].labels.stokes_in[1]: "Q" in the store, "U" here' in told
    assert 'files[0].labels.stokes_out[2]: "U" in the store, "Q" here' in told


def test_a_pixel_that_one_file_leaves_out_is_left_out(tmp_path):
    masks = np.ones((2, 3, 4), dtype=np.int8)
    masks[0, 0, 0] = masks[1, 2, 3] = 0
    both = [matrices(seed=k).assign(mask=(("y", "x"), mask)) for k, mask in enumerate(masks)]
    for files in (both, [both[0], matrices(seed=1)], [matrices(), both[1]]):
        found = PictureSource.open(stored(tmp_path, *files)).block({})["mask"]
        expected = np.logical_and.reduce([f["mask"].values != 0 for f in files if "mask" in f])
        np.testing.assert_array_equal(found, expected)
