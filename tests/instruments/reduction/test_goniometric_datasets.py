"""Frames to goniometric data sets: averages joined with angles, in the frame of the surface."""

import numpy as np
import pytest

import pbrdf
from pbrdf.errors import DataError
from pbrdf.instruments.frames.frames import ArrayFrames
from pbrdf.instruments.goniometer.angle_table import AngleTable
from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.polarimeter.polarimeter import lcvr, rotating_polarizer
from pbrdf.instruments.polarimeter.retardance_sets import retardance_set
from pbrdf.instruments.reduction.goniometric_datasets import goniometric_datasets
from pbrdf.instruments.reduction.regions import Rectangle
from pbrdf.optics.elements import rotate_frame

FULL = lcvr(retardance_set("tetrahedron"))
LINEAR = rotating_polarizer(np.deg2rad([0.0, 45.0, 90.0, 135.0]))
ALL = {"all": Rectangle(0, 6, 0, 8)}


def frames_of(polarimeter, stokes, detector, seed=0):
    """Frames of 8 × 6 alike pixels; Stokes vectors (M, 4) in the instrument's axes."""
    light = np.einsum("nk,mk->mn", polarimeter.analyzer, stokes)[:, :, None, None]
    raw = detector.expose(np.broadcast_to(light, (*light.shape[:2], 8, 6)), np.random.default_rng(seed))
    return ArrayFrames(raw)


def angles(count=1, **columns):
    names = tuple(str(i + 1) for i in range(count))
    return AngleTable(names, np.full(count, 0.5), np.full(count, 0.6), **columns)


EXACT = Detector(bits=16, gain=1000.0, read_noise=0.0)


def test_an_instrument_that_lies_on_its_side():
    """An instrument whose x axis lies along s (reference angle 90°) sees specular reflection, which is polarised along
    s, at an AoLP of 0°. The data set says 90°: there Q = I_p − I_s < 0."""
    seen = np.array([[20000.0, 6000.0, 0.0, 0.0]])
    assert pbrdf.aolp(seen[0]) == 0.0
    instrument = Instrument(FULL, EXACT, reference_angle=np.pi / 2)
    ds = goniometric_datasets(frames_of(FULL, seen, EXACT), instrument, ALL, angles())["all"]
    assert ds["Q"].values[0] == pytest.approx(-6000.0, abs=1.0)
    assert abs(np.rad2deg(pbrdf.aolp([ds[n].values[0] for n in "IQUV"]))) == pytest.approx(90.0, abs=0.01)


def test_an_instrument_turned_from_p_towards_s():
    """Light polarised along p, in an instrument whose x axis is turned by 30° from p towards s, has an AoLP of −30°
    there, as the angle is counted from x; the data set says 0°."""
    seen = np.array([[20000.0, 6000.0 * np.cos(np.deg2rad(-60)), 6000.0 * np.sin(np.deg2rad(-60)), 900.0]])
    assert np.rad2deg(pbrdf.aolp(seen[0])) == pytest.approx(-30.0)
    instrument = Instrument(FULL, EXACT, reference_angle=np.deg2rad(30.0))
    ds = goniometric_datasets(frames_of(FULL, seen, EXACT), instrument, ALL, angles())["all"]
    np.testing.assert_allclose([ds[n].values[0] for n in "IQUV"], [20000.0, 6000.0, 0.0, 900.0], atol=1.5)


def test_the_tables_reference_angle_goes_before_the_instruments():
    seen = np.array([[20000.0, 6000.0, 0.0, 0.0]] * 2)
    instrument = Instrument(FULL, EXACT, reference_angle=np.pi / 2)
    table = angles(2, reference_angle=[0.0, np.nan])
    ds = goniometric_datasets(frames_of(FULL, seen, EXACT), instrument, ALL, table)["all"]
    np.testing.assert_allclose(ds["Q"].values, [6000.0, -6000.0], atol=1.0)


def test_covariance_is_turned_with_the_vector():
    detector = Detector(bits=12, gain=2.0, read_noise=8.0)
    seen = np.array([[1500.0, 500.0, 300.0, -100.0]])
    frames = frames_of(FULL, seen, detector)
    plain = goniometric_datasets(frames, Instrument(FULL, detector), ALL, angles())["all"]
    turned = goniometric_datasets(frames, Instrument(FULL, detector, reference_angle=0.4), ALL, angles())[
        "all"
    ]
    matrix = rotate_frame(-0.4)
    expected = matrix @ plain["covariance"].values[0] @ matrix.T
    np.testing.assert_allclose(turned["covariance"].values[0], expected, rtol=1e-9, atol=1e-12)
    assert abs(expected[1, 2]) > 0.0
    for k, name in enumerate("IQUV"):
        assert turned[f"{name}_std"].values[0] == pytest.approx(np.sqrt(expected[k, k]))


def test_what_is_not_determined_is_not_in_the_data_set():
    """A rotating polariser is blind to V, at whatever angle it stands: Q and U are known all the same."""
    seen = np.array([[20000.0, 6000.0, 1000.0, 0.0]])
    instrument = Instrument(LINEAR, EXACT, reference_angle=0.3)
    ds = goniometric_datasets(frames_of(LINEAR, seen, EXACT), instrument, ALL, angles())["all"]
    assert "V" not in ds
    expected = rotate_frame(-0.3) @ seen[0]
    np.testing.assert_allclose([ds[n].values[0] for n in "IQU"], expected[:3], atol=1.5)


def test_exposure_divides_and_so_does_its_error():
    detector = Detector(bits=12, gain=2.0, read_noise=8.0)
    seen = np.array([[1000.0, 100.0, 0.0, 0.0], [2000.0, 200.0, 0.0, 0.0]])
    frames = frames_of(FULL, seen, detector)
    once = goniometric_datasets(frames, Instrument(FULL, detector), ALL, angles(2))["all"]
    ds = goniometric_datasets(frames, Instrument(FULL, detector), ALL, angles(2, exposure=[1.0, 2.0]))["all"]
    np.testing.assert_allclose(ds["I"].values, once["I"].values / [1.0, 2.0])
    np.testing.assert_allclose(ds["I_std"].values, once["I_std"].values / [1.0, 2.0])
    np.testing.assert_allclose(ds["covariance"].values[1], once["covariance"].values[1] / 4.0)


def test_rows_and_regions_are_told_apart():
    """Each region has its own data set, each series its own angles, whatever the order of the table."""
    stokes = np.array([[1000.0, 0.0, 0.0, 0.0], [2000.0, 0.0, 0.0, 0.0]])
    raw = frames_of(FULL, stokes, EXACT).array.copy()
    raw[:, :, :, 3:] //= 2
    table = AngleTable(
        ("b", "a"), [0.2, 0.1], [0.4, 0.3], phi=[1.0, 0.0], group=["g2", "g1"], wavelength=[500.0, 400.0]
    )
    regions = {"left": Rectangle(0, 3, 0, 8), "right": Rectangle(3, 6, 2, 4)}
    found = goniometric_datasets(
        ArrayFrames(raw, ("a", "b")),
        Instrument(FULL, EXACT),
        regions,
        table,
        simulated=True,
        attrs={"title": "x"},
    )
    assert list(found) == ["left", "right"]
    left, right = found["left"], found["right"]
    np.testing.assert_array_equal(left["theta_i"].values, [0.1, 0.2])
    np.testing.assert_array_equal(left["theta_r"].values, [0.3, 0.4])
    np.testing.assert_array_equal(left["phi"].values, [0.0, 1.0])
    assert left["group"].values.tolist() == ["g1", "g2"]
    np.testing.assert_array_equal(left["wavelength"].values, [400.0, 500.0])
    np.testing.assert_allclose(left["I"].values, [1000.0, 2000.0], atol=1.0)
    np.testing.assert_allclose(right["I"].values, [500.0, 1000.0], atol=1.0)
    assert left.attrs["quantity"] == "dn"
    assert left.attrs["simulated"] == 1
    assert left.attrs["title"] == "x"
    assert right.attrs["region"] == "right"
    pbrdf.validate(left)


def test_a_series_without_a_good_pixel_is_left_out_and_named():
    raw = frames_of(FULL, np.array([[1000.0, 0.0, 0.0, 0.0]] * 3), EXACT).array.copy()
    raw[1] = 65535
    found = goniometric_datasets(ArrayFrames(raw), Instrument(FULL, EXACT), ALL, angles(3))["all"]
    assert found.sizes["geometry"] == 2
    assert found.attrs["series_without_good_pixels"] == ["2"]
    assert found.attrs["masked_pixels"] == "saturated 48, dead 0, dark 0 of 144"
    with pytest.raises(DataError, match=r"region 'all' has no good pixel in any series: saturated 48"):
        goniometric_datasets(ArrayFrames(raw[1:2]), Instrument(FULL, EXACT), ALL, angles())


def test_frames_and_angles_of_other_series():
    frames = ArrayFrames(np.full((2, 4, 8, 6), 500, np.uint16), ("a", "b"))
    instrument = Instrument(FULL, EXACT)
    with pytest.raises(DataError, match="no row for the series 'b'; it has 'a'"):
        goniometric_datasets(frames, instrument, ALL, AngleTable(("a",), [0.1], [0.1]))
    with pytest.raises(DataError, match="rows for 'c', of which there are no frames"):
        goniometric_datasets(frames, instrument, ALL, AngleTable(("a", "b", "c"), [0.1] * 3, [0.1] * 3))
