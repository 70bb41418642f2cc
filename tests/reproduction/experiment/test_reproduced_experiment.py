"""From the parameters of table 1 through frames to data sets, and back to the parameters."""

from __future__ import annotations

import numpy as np
import pytest

import pbrdf
from pbrdf.data.validation import validate
from pbrdf.errors import DataError
from pbrdf.instruments.goniometer.protocols import Protocol
from pbrdf.reproduction.experiment.measurement import Options, measured_samples
from pbrdf.reproduction.experiment.sample import SCALE, invert, sample_angles
from pbrdf.reproduction.page.tables import recovered
from pbrdf.reproduction.paper import SAMPLES, SIMULATED
from pbrdf.reproduction.statements.parameters import agreement

pytestmark = pytest.mark.slow

NOISELESS = Options(
    bits=16, linear=1e-6, circular=1e-6, read_noise=0.0, stability=1e-6, calibration_error="none", patch=4
)


def test_every_sample_has_the_papers_geometries_and_says_that_it_is_simulated():
    datasets = measured_samples(Options(patch=2))
    assert list(datasets) == list(SAMPLES)
    for name, dataset in datasets.items():
        validate(dataset)
        assert dataset.sizes["geometry"] == 63
        assert np.unique(dataset["group"].values, return_counts=True)[1].tolist() == [21, 21, 21]
        assert dataset.attrs["simulated"] == 1
        assert SIMULATED in dataset.attrs["title"]
        assert "SIMULATED" in dataset.attrs["source"]
        assert "12 bits" in dataset.attrs["source"]
        assert dataset["wavelength"].values[0] == 476.0
        assert name in dataset.attrs["title"]


def test_the_brightest_pixel_of_a_sample_fills_four_fifths_of_the_range():
    """Digital numbers of the page: the intensity is twice what passes the analyser of the paper's imager at most."""
    options = Options(patch=2)
    detector = options.instrument.detector
    W = options.instrument.polarimeter.analyzer
    for dataset in measured_samples(options).values():
        stokes = np.stack([dataset[c].values for c in "IQUV"]) * dataset.attrs[SCALE]
        assert (W @ stokes).max() == pytest.approx(0.8 * detector.range, rel=0.02)


def test_more_bits_resolve_the_same_light_more_finely():
    """The range in electrons stays: with more bits a digital number is worth less, the noise in electrons the same."""
    coarse, fine = (Options(bits=b).instrument.detector for b in (8, 14))
    assert coarse.gain * 2**8 == fine.gain * 2**14
    assert coarse.offset * coarse.gain == fine.offset * fine.gain
    assert coarse.read_noise == fine.read_noise


def test_without_noise_the_parameters_come_back():
    datasets = measured_samples(NOISELESS)
    for name in ("white", "pearl-white"):
        sample = invert(name, datasets[name], pbrdf.load_paint(name), starts=2, seed=0)
        for r in recovered(sample):
            # the diffuse light of sample 1 is a hundredth of its peak: shot noise is left of it
            assert r.value == pytest.approx(r.true, rel=0.1 if name == "white" else 0.02, abs=0.06), (name, r)
            assert r.name not in ("sigma", "n") or r.value == pytest.approx(r.true, rel=2e-3)


def test_errors_of_the_calibration_are_in_the_uncertainties():
    """Pulls of 30 parameters from the default noise: their rms is 1, within what 30 draws allow."""
    pulls = [
        r.pull
        for name, dataset in measured_samples(Options(patch=10, seed=5)).items()
        for r in recovered(invert(name, dataset, pbrdf.load_paint(name), starts=2, seed=0))
    ]
    assert len(pulls) == 30
    assert 0.6 < np.sqrt(np.mean(np.square(pulls))) < 1.5


def test_a_seed_fixes_everything_and_samples_have_noise_of_their_own():
    first, again, other = (measured_samples(Options(patch=8, seed=s)) for s in (1, 1, 2))
    for name in SAMPLES:
        np.testing.assert_array_equal(first[name]["I"], again[name]["I"])
        assert (first[name]["I"].values != other[name]["I"].values).any()
    truth = {n: pbrdf.load_paint(n).stokes(*angles(first[n]))[:, 0] for n in SAMPLES}
    noise = [
        first[n]["I"].values / (truth[n] * np.cos(first[n]["theta_i"].values)) - 1.0
        for n in ("matte-white-thin", "matte-white-thick")
    ]
    assert np.abs(noise[0] - noise[1]).max() > 1e-4


def angles(dataset):
    return tuple(dataset[name].values for name in ("theta_i", "theta_r", "phi"))


def test_dark_pixels_are_averaged_in():
    """Leaving out pixels that noise has made darker than black would make the mean too bright."""
    options = Options(patch=30, calibration_error="none", stability=0.0)
    dataset = measured_samples(options)["white"]
    dark = np.rad2deg(dataset["theta_i"].values) > 80.0
    truth = pbrdf.load_paint("white").stokes(*angles(dataset))[:, 0] * np.cos(dataset["theta_i"].values)
    pull = (dataset["I"].values - truth)[dark] / dataset["I_std"].values[dark]
    assert (truth[dark] * dataset.attrs[SCALE] < options.instrument.detector.read_noise / 5.0).all()
    assert np.abs(pull).max() < 4.0
    assert dataset.attrs["masked_pixels"].startswith("saturated 0, dead 0, dark 0")


def test_sample_angles_are_those_of_the_goniometer():
    """Angle_S_I = 90° − θ_i, beyond 90° where the source has crossed the normal; on both sides of every change."""
    given = np.deg2rad(np.arange(12.0, 118.0, 3.5))
    protocol = Protocol.in_plane(np.deg2rad([60.0, 80.0, 100.0]), given)
    dataset = pbrdf.make_dataset(protocol.theta_i, protocol.theta_r, protocol.phi, quantity="dn", I=1.0)
    assert (protocol.sample_angle > 0.5 * np.pi).any()
    np.testing.assert_allclose(sample_angles(dataset), protocol.sample_angle, atol=1e-12)


def test_the_curve_passes_through_the_modelled_points(samples, positions):
    for sample in samples:
        for number, psi in enumerate(positions, start=1):
            there = sample.position == number
            intensity, degree = sample.curve(psi, sample.angle[there])
            np.testing.assert_allclose(intensity, sample.modelled_intensity[there], rtol=1e-9)
            np.testing.assert_allclose(degree, sample.modelled_dolp[there], rtol=1e-6, atol=1e-9)


def test_positions_1_and_2_are_fitted_and_3_is_predicted(samples):
    for number, sample in enumerate(samples, start=1):
        assert sample.number == number
        np.testing.assert_array_equal(sample.held_out, sample.position == 3)
        assert [stage.name for stage in sample.result.stages][-1] == "joint"
        assert {stage.name for stage in sample.result.stages} == {"diffuse", "specular", "joint"}
        assert agreement(sample).starts == 8


def test_settings_are_told_in_words():
    text = Options(bits=8, source_radius=np.deg2rad(2.0), calibration_error="fixed", seed=4).in_words()
    for part in (
        "Ψ = 60°, 80°, 100°",
        "8 bits",
        "1 % (linear)",
        "5 % (circular)",
        "2° radius",
        "once for all",
        "seed 4",
    ):
        assert part in text
    assert "point source" in Options().in_words()
    assert "an exposure for each geometry" in Options(exposure="each").in_words()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"positions": tuple(np.deg2rad([60.0, 80.0]))}, "three bistatic angles that ascend, not 60°, 80°"),
        ({"positions": tuple(np.deg2rad([80.0, 60.0, 100.0]))}, "ascend"),
        ({"positions": tuple(np.deg2rad([10.0, 60.0, 100.0]))}, "from 20° to 140°"),
        ({"positions": tuple(np.deg2rad([60.0, 80.0, 150.0]))}, "from 20° to 140°"),
        ({"starts": 0}, "at least one start"),
        ({"calibration_error": "sometimes"}, "reading, fixed, none"),
        ({"exposure": "long"}, "each, common"),
    ],
)
def test_impossible_options_are_refused(change, message):
    with pytest.raises(DataError, match=message):
        Options(**change)
