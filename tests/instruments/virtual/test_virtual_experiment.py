"""Virtual measurements: what goes in comes out, errors are of the stated size, and signs are the right way round."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import pbrdf
from pbrdf.data.paints import PAINTS, load_paint
from pbrdf.errors import DataError
from pbrdf.instruments.frames.frame_files import open_frames
from pbrdf.instruments.goniometer.angle_errors import AngleErrors
from pbrdf.instruments.goniometer.angle_table import read_angles
from pbrdf.instruments.goniometer.protocols import Protocol
from pbrdf.instruments.goniometer.source import Source
from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.polarimeter.instrument_files import load_instrument
from pbrdf.instruments.polarimeter.polarimeter import lcvr
from pbrdf.instruments.polarimeter.presets import preset
from pbrdf.instruments.polarimeter.retardance_sets import retardance_set
from pbrdf.instruments.reduction.goniometric_datasets import goniometric_datasets
from pbrdf.instruments.reduction.region_files import read_regions
from pbrdf.instruments.reduction.stokes_image import reduce_frames
from pbrdf.instruments.virtual.experiment import VirtualExperiment
from pbrdf.instruments.virtual.measurement_folder import write_measurement
from pbrdf.models.extended_source import stokes_under_disc
from pbrdf.optics.stokes import aolp

PAPER = replace(preset("paper"), detector=Detector(bits=12, gain=5.0, read_noise=20.0))
#: No noise worth the name, the best converter, a perfect calibration.
QUIET = replace(preset("paper"), detector=Detector(bits=16, gain=1e6, read_noise=0.0), stability=0.0)
THICK = load_paint("matte-white-thick")
OUT_OF_PLANE = Protocol.two_axes(
    np.deg2rad([50.0, 90.0]), np.deg2rad([30.0, 55.0, 75.0]), np.deg2rad([-10.0, 0.0, 20.0])
)


def stokes_of(dataset):
    return np.stack([dataset[name].values for name in "IQUV"], axis=-1)


def measured(experiment, name="thick", model=THICK):
    measurement = experiment.measure({name: model})
    return measurement, measurement.datasets()[name]


# What goes in comes out


@pytest.mark.parametrize("protocol", [Protocol.in_plane(), OUT_OF_PLANE], ids=["in plane", "two axes"])
def test_without_noise_the_data_are_the_model(protocol):
    """Stokes vectors of f·cosθ_i in (p, s), but for the steps of the converter; up to 1e-5 of I."""
    measurement, dataset = measured(VirtualExperiment(protocol, QUIET, calibration="none"))
    expected = (
        THICK.stokes(protocol.theta_i, protocol.theta_r, protocol.phi) * np.cos(protocol.theta_i)[:, None]
    )
    np.testing.assert_allclose(stokes_of(dataset) / expected[:, :1], expected / expected[:, :1], atol=2e-5)
    np.testing.assert_array_equal(measurement.exact("thick"), expected)
    assert dataset.attrs["quantity"] == "dn"
    assert dataset.attrs["simulated"]
    assert "SIMULATED" in dataset.attrs["source"]


@pytest.mark.slow
def test_samples_lie_side_by_side_and_share_the_exposure():
    samples = {name: load_paint(name) for name in PAINTS}
    measurement = VirtualExperiment(
        Protocol.in_plane(), QUIET, calibration="none", patch=5, margin=2
    ).measure(samples)
    assert measurement.frames.array.shape == (63, 4, 9, 5 * 7 + 2)
    brightest = measurement.frames.array.reshape(63, -1).max(axis=1)
    np.testing.assert_allclose(brightest / 65535.0, 0.8, atol=2e-3)
    for name, dataset in measurement.datasets().items():
        expected = measurement.exact(name)
        assert np.abs((stokes_of(dataset) - expected) / expected[:, :1]).max() < 1e-3, name


@pytest.mark.parametrize("exposure", ["common", 5000.0])
def test_one_exposure_for_all_geometries(exposure):
    experiment = VirtualExperiment(Protocol.in_plane(), QUIET, exposure=exposure, calibration="none")
    measurement, dataset = measured(experiment)
    assert np.ptp(measurement.angles.exposure) == 0.0
    assert measurement.frames.array.max() < 65535
    expected = measurement.exact("thick")
    # steps of one number in the intensity behind the analyser, through a condition number of √3
    assert np.abs(stokes_of(dataset) - expected).max() < 2.0 / measurement.angles.exposure[0]


def test_the_same_seed_gives_the_same_frames():
    first, second, other = (
        VirtualExperiment(OUT_OF_PLANE, PAPER, seed=seed).measure({"a": THICK}).frames.array
        for seed in (4, 4, 5)
    )
    assert np.array_equal(first, second)
    assert not np.array_equal(first, other)


# Errors are of the stated size


@pytest.mark.slow
def test_residuals_have_the_stated_covariance():
    """Mean χ² a degree of freedom over 20 measurements of 63 geometries: 1 ± 0.02."""
    total, count = 0.0, 0
    for seed in range(20):
        measurement, dataset = measured(VirtualExperiment(Protocol.in_plane(), PAPER, seed=seed, patch=8))
        residual = stokes_of(dataset) - measurement.exact("thick")
        covariance = dataset["covariance"].values
        total += np.einsum("gi,gij,gj->", residual, np.linalg.inv(covariance), residual)
        count += residual.size
    assert total / count == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / count))


def test_a_fixed_calibration_error_is_the_same_at_every_geometry():
    """One matrix takes the true Stokes vectors to those read; with errors at each reading none does."""
    for calibration, same in (("fixed", True), ("reading", False)):
        measurement, dataset = measured(
            VirtualExperiment(OUT_OF_PLANE, QUIET, calibration=calibration, seed=1)
        )
        true = measurement.radiance["thick"][:, :3]  # V is 0: natural light on a dielectric
        # in the axes of the camera, where the error is fixed
        turn = OUT_OF_PLANE.reference_angle
        c, s = np.cos(2.0 * turn), np.sin(2.0 * turn)
        read = stokes_of(dataset)
        true, read = (
            np.stack([x[:, 0], c * x[:, 1] + s * x[:, 2], c * x[:, 2] - s * x[:, 1]], axis=-1) / true[:, :1]
            for x in (true, read)
        )
        matrix = np.linalg.lstsq(true, read, rcond=None)[0]
        worst = np.abs(true @ matrix - read).max()
        assert (worst < 1e-4) == same
        assert np.abs(read - true).max() > 2e-3


def test_an_unsteady_source_scales_whole_stokes_vectors():
    experiment = VirtualExperiment(
        Protocol.in_plane(), QUIET, Source(stability=0.02), calibration="none", seed=2
    )
    measurement, dataset = measured(experiment)
    ratio = stokes_of(dataset)[:, 0] / measurement.exact("thick")[:, 0]
    assert ratio.std() == pytest.approx(0.02, rel=0.3)
    dolp = stokes_of(dataset)[:, 1] / stokes_of(dataset)[:, 0]
    expected = measurement.exact("thick")[:, 1] / measurement.exact("thick")[:, 0]
    np.testing.assert_allclose(dolp, expected, atol=5e-5)


# Source and mechanics


def test_an_extended_source_lowers_the_peaks_and_evens_them_out():
    """Peaks at β = 15° and 35° of the smooth white paint: F/cosβ for a point, F for a disc wider than the lobe."""
    protocol = Protocol.in_plane(np.deg2rad([30.0, 70.0]), [np.deg2rad([75.0]), np.deg2rad([55.0])])
    peaks = {}
    for radius in (0.0, 2.0):
        source = Source(np.deg2rad(radius))
        experiment = VirtualExperiment(protocol, QUIET, source, calibration="none")
        _, dataset = measured(experiment, "white", load_paint("white"))
        peaks[radius] = dataset["I"].values
        seen = stokes_under_disc(
            load_paint("white"), protocol.theta_i, protocol.theta_r, protocol.phi, np.deg2rad(radius)
        )
        np.testing.assert_allclose(peaks[radius], seen[:, 0] * np.cos(protocol.theta_i), rtol=1e-4)
    assert (peaks[2.0] < 0.25 * peaks[0.0]).all()
    assert peaks[0.0][1] / peaks[0.0][0] == pytest.approx(1.23, abs=0.01)
    assert peaks[2.0][1] / peaks[2.0][0] == pytest.approx(1.04, abs=0.01)


def test_a_polarised_source_is_polarised_along_the_axes_of_the_laboratory():
    """In the plane its x axis is p; a tilted sample sees it turned by the reference angle of the incident ray."""
    light = (0.03, 0.01, 0.0)
    experiment = VirtualExperiment(OUT_OF_PLANE, QUIET, Source(polarisation=light), calibration="none")
    _, dataset = measured(experiment)
    chi = OUT_OF_PLANE.source_reference_angle
    plane = np.abs(np.sin(OUT_OF_PLANE.phi)) < 1e-9
    assert plane.any()
    assert np.abs(np.sin(chi[plane])).max() < 1e-9
    # polarised along the x axis at angle χ from p: an ellipse azimuth of χ + ½ atan2(U, Q)
    size, azimuth = np.hypot(*light[:2]), chi + 0.5 * np.arctan2(light[1], light[0])
    incident = np.stack(
        [np.ones_like(chi), size * np.cos(2 * azimuth), size * np.sin(2 * azimuth), 0.0 * chi], axis=-1
    )
    angles = OUT_OF_PLANE.theta_i, OUT_OF_PLANE.theta_r, OUT_OF_PLANE.phi
    expected = THICK.stokes(*angles, incident=incident) * np.cos(angles[0])[:, None]
    np.testing.assert_allclose(stokes_of(dataset) / expected[:, :1], expected / expected[:, :1], atol=5e-5)


def test_angle_errors_put_the_light_elsewhere_but_not_the_table():
    errors = AngleErrors(sample=np.deg2rad(0.2))
    experiment = VirtualExperiment(
        Protocol.in_plane(), QUIET, angle_errors=errors, calibration="none", seed=3
    )
    measurement, dataset = measured(experiment)
    assert np.array_equal(dataset["theta_i"].values, Protocol.in_plane().theta_i)
    true = measurement.true
    assert (true.theta_i - Protocol.in_plane().theta_i).std() == pytest.approx(np.deg2rad(0.2), rel=0.3)
    expected = THICK.stokes(true.theta_i, true.theta_r, true.phi)[:, 0] * np.cos(true.theta_i)
    np.testing.assert_allclose(dataset["I"].values, expected, rtol=2e-4)
    assert np.abs(dataset["I"].values / measurement.exact("thick")[:, 0] - 1.0).max() > 0.02


@pytest.mark.slow
def test_a_wrong_zero_of_the_sample_angle_is_found_by_the_fit_with_the_sign_of_the_incidence():
    """The sample turned on by ε has θ_i − ε, the fit's nuisance term is what θ_i is larger by: −ε."""
    protocol = Protocol.in_plane()
    experiment = VirtualExperiment(protocol, PAPER, angle_errors=AngleErrors(zero=np.deg2rad(0.1)), seed=6)
    measurement, dataset = measured(experiment)
    result = pbrdf.fit(dataset, nuisances=["angle:group~none"], starts=8)
    assert 0.7 < result.goodness.reduced_chi2 < 1.4
    for position in (1, 2, 3):
        row = np.flatnonzero(protocol.group == position)[3]
        turned = protocol.theta_i[row] - measurement.true.theta_i[row]
        found = result.estimates[f"angle[{position}]"]
        assert abs(turned) > 5.0 * found.std
        assert abs(found.value + turned) < 4.0 * found.std


# Signs


def test_an_instrument_with_x_along_s_sees_specular_light_at_0_and_the_data_say_90():
    """Reference angle 90°: specular reflection is polarised along s, which is the instrument's x axis."""
    instrument = replace(QUIET, reference_angle=np.deg2rad(90.0))
    protocol = Protocol.in_plane(np.deg2rad(100.0), np.deg2rad([40.0]))
    measurement, dataset = measured(VirtualExperiment(protocol, instrument, calibration="none"))
    raw = reduce_frames(measurement.frames.array[0], instrument.polarimeter, instrument.detector)
    middle = raw.stokes[:, 10, 10]
    assert np.rad2deg(aolp(middle)) == pytest.approx(0.0, abs=0.01)
    assert abs(np.rad2deg(aolp(stokes_of(dataset)[0]))) == pytest.approx(90.0, abs=0.01)


@pytest.mark.parametrize("mounted", [0.0, 30.0, -75.0])
@pytest.mark.parametrize("laboratory", ["meridian", "scattering", "level"])
def test_however_the_camera_is_held_the_data_are_in_p_and_s(mounted, laboratory):
    protocol = replace(OUT_OF_PLANE, laboratory=laboratory)
    instrument = replace(QUIET, reference_angle=np.deg2rad(mounted))
    rough = THICK.replace(sigma=0.3)
    measurement, dataset = measured(
        VirtualExperiment(protocol, instrument, calibration="none"), "rough", rough
    )
    expected = measurement.exact("rough")
    np.testing.assert_allclose(stokes_of(dataset) / expected[:, :1], expected / expected[:, :1], atol=2e-5)
    assert np.abs(expected[:, 2] / expected[:, 0]).max() > 0.01, "U must matter in this test"


# Pixels that must not be used


def test_saturated_geometries_are_left_out_and_named():
    protocol = Protocol.in_plane(np.deg2rad(80.0), np.deg2rad([20.0, 50.0, 80.0]))
    quiet = replace(QUIET, detector=Detector(bits=12, gain=1e5, read_noise=0.0))
    measurement, dataset = measured(VirtualExperiment(protocol, quiet, exposure=5000.0, calibration="none"))
    assert measurement.frames.array[1].max() == 4095
    assert dataset.sizes["geometry"] == 2
    assert list(dataset.attrs["series_without_good_pixels"]) == ["g002"]
    expected = measurement.exact("thick")[[0, 2]]
    np.testing.assert_allclose(dataset["I"].values, expected[:, 0], rtol=1e-3)


# The whole way


@pytest.mark.slow
@pytest.mark.parametrize("name", PAINTS)
def test_a_fit_of_the_virtual_data_finds_table_1(name):
    _, dataset = measured(VirtualExperiment(Protocol.in_plane(), PAPER, seed=11), name, load_paint(name))
    result = pbrdf.fit(dataset, starts=16)
    assert 0.7 < result.goodness.reduced_chi2 < 1.4
    for parameter, estimate in result.estimates.items():
        if parameter != "kappa":
            truth = load_paint(name).values[parameter]
            assert abs(estimate.value - truth) < 3.0 * estimate.std, parameter


@pytest.mark.slow
@pytest.mark.parametrize(
    "instrument",
    [PAPER, preset("sony_imx250mzr"), replace(PAPER, polarimeter=lcvr(retardance_set("six_states")))],
    ids=["imager", "mosaic", "six states"],
)
def test_a_folder_reduces_to_the_same_data(instrument, tmp_path):
    samples = {"thick": THICK, "white": load_paint("white")}
    measurement = VirtualExperiment(OUT_OF_PLANE, instrument, patch=6, seed=9).measure(samples)
    folder = tmp_path / "virtual"
    written = write_measurement(measurement, folder)
    assert [path.name for path in written] == [
        *("angles.csv", "frames", "polarimeter.toml", "regions.toml", "thick.nc", "truth", "white.nc")
    ]
    read = load_instrument(folder / "polarimeter.toml")
    again = goniometric_datasets(
        open_frames(folder / "frames", read),
        read,
        read_regions(folder / "regions.toml"),
        read_angles(folder / "angles.csv"),
    )
    for name, dataset in measurement.datasets().items():
        for variable in dataset.data_vars:
            np.testing.assert_allclose(
                again[name][variable].values, dataset[variable].values, rtol=1e-9, atol=1e-15
            )
        assert ("V" in dataset) == (instrument.polarimeter.mosaic is None)
        stored = pbrdf.read(folder / f"{name}.nc")
        assert np.array_equal(stored["I"].values, dataset["I"].values)
        assert pbrdf.load_model(folder / "truth" / f"{name}.json") == samples[name]


def test_a_folder_with_something_in_it_is_left_alone(tmp_path):
    measurement = VirtualExperiment(OUT_OF_PLANE, PAPER, patch=2).measure({"a": THICK})
    (tmp_path / "old.png").write_text("old")
    with pytest.raises(DataError, match="already"):
        write_measurement(measurement, tmp_path)
    with pytest.raises(DataError, match="there is no folder"):
        write_measurement(measurement, tmp_path / "no" / "such")
    bad = VirtualExperiment(OUT_OF_PLANE, PAPER, patch=2).measure({"a/b": THICK})
    with pytest.raises(DataError, match="cannot be the name of a file"):
        write_measurement(bad, tmp_path / "new")
    assert [path.name for path in tmp_path.iterdir()] == ["old.png"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"calibration": "sometimes"}, "choose one of reading, fixed, none"),
        ({"exposure": "long"}, "give each or common"),
        ({"exposure": 0.0}, "a number above 0"),
        ({"patch": 0}, "at least one pixel"),
    ],
)
def test_options_out_of_range_are_refused(options, message):
    with pytest.raises(DataError, match=message):
        VirtualExperiment(Protocol.in_plane(), PAPER, **options)


def test_samples_that_cannot_be_measured_are_refused():
    experiment = VirtualExperiment(Protocol.in_plane(), PAPER)
    with pytest.raises(DataError, match="no sample"):
        experiment.measure({})
    with pytest.raises(DataError, match="single numbers"):
        experiment.measure({"map": THICK.replace(n=np.array([1.5, 1.6]))})
    grazing = Protocol.in_plane(np.deg2rad(60.0), np.deg2rad([0.01] * 8))
    wrong = VirtualExperiment(grazing, PAPER, angle_errors=AngleErrors(sample=0.02), seed=0)
    with pytest.raises(DataError, match="below 90°"):
        wrong.measure({"a": THICK})
