"""``pbrdf plan`` and ``pbrdf measure``: files, numbers and refusals."""

from __future__ import annotations

import re
import shlex
from dataclasses import replace

import numpy as np
import pytest

import pbrdf
from pbrdf.data.paints import load_paint
from pbrdf.instruments.frames.frame_files import open_frames
from pbrdf.instruments.goniometer.angle_table import read_angles
from pbrdf.instruments.polarimeter.instrument_files import load_instrument, save_instrument
from pbrdf.instruments.polarimeter.presets import preset

FAST = ("--smallest-bistatic", 30, "--largest-zenith", 70, "--budget", 24)


@pytest.mark.slow
def test_a_plan_is_printed_and_written_with_a_picture(run, tmp_path):
    result = run("plan", "matte-white-thick", *FAST, "--angle-error", 0.05, "-o", "next.csv")
    assert "24 readings at 24 geometries, D-optimal" in result.stdout
    assert "sample angle ± 0.05°" in " ".join(result.stdout.split())
    rows = re.findall(r"^ +(sigma|n|a|k|b|t) +\S+ +(\S+) +(\S+) +(\S+) *$", result.stdout, re.MULTILINE)
    assert [row[0] for row in rows] == ["sigma", "n", "a", "k", "b", "t"]
    for _, own, other, ratio in rows:
        assert float(other) / float(own) == pytest.approx(float(ratio), rel=0.15)
    table = read_angles(tmp_path / "next.csv")
    assert len(table.names) == 24
    assert np.rad2deg(max(table.theta_i.max(), table.theta_r.max())) < 70.001
    assert (tmp_path / "next.png").stat().st_size > 20_000
    assert sorted(p.name for p in tmp_path.iterdir()) == ["next.csv", "next.png"]


@pytest.mark.slow
def test_a_plan_can_be_measured_and_fitted(run, tmp_path):
    """Out of plane, with a camera that is mounted askew: angles, reference angles and signs go through all files."""
    load_paint("matte-white-thick").to_json(tmp_path / "guess.json")
    imager = preset("paper")
    save_instrument(replace(imager, reference_angle=0.4), tmp_path / "askew.toml")
    run("plan", "guess.json", *FAST, "--out-of-plane", "--instrument", "askew.toml")
    run(
        *("measure", "guess.json", "--angles", "plan.csv", "--instrument", "askew.toml"),
        *("--bits", 12, "--seed", 3, "-o", "planned"),
    )
    result = pbrdf.fit(pbrdf.read(tmp_path / "planned" / "guess.nc"), starts=16)
    assert 0.5 < result.goodness.reduced_chi2 < 1.7
    for name, estimate in result.estimates.items():
        if name != "kappa":
            truth = load_paint("matte-white-thick").values[name]
            assert abs(estimate.value - truth) < 4.0 * estimate.std, name


@pytest.mark.slow
def test_a_measurement_is_a_folder_of_frames(run, tmp_path):
    result = run(
        *("measure", "white", "pearl-white", "--positions", "60,100", "--sample-angles", "20:70:25"),
        *("--bits", 10, "--source-radius", 0.5, "--patch", 6, "-o", "virtual"),
    )
    assert "virtual: 6 geometries, 4 states, 2 sample(s), simulated" in result.stdout
    folder = tmp_path / "virtual"
    instrument = load_instrument(folder / "polarimeter.toml")
    assert instrument.detector.bits == 10
    # the same electrons over four times as many numbers as the 8 bits of the paper's imager
    assert instrument.detector.gain == pytest.approx(preset("paper").detector.gain / 4.0)
    frames = open_frames(folder / "frames", instrument)
    assert frames.names == read_angles(folder / "angles.csv").names
    assert frames.read(0, 0, frames.rows).max() <= 1023
    dataset = pbrdf.read(folder / "white.nc")
    assert dataset.sizes["geometry"] == 6
    assert (dataset["wavelength"].values == 476.0).all()


@pytest.mark.slow
def test_reduce_gives_the_same_data_as_measure(run, tmp_path):
    here = tmp_path / "virtual run"
    told = run("measure", "white", "--positions", 70, "--sample-angles", "30,55", "--patch", 5, "-o", here)
    (command,) = (line for line in told.stdout.splitlines() if line.startswith("Reduce with: pbrdf "))
    run(*shlex.split(command.removeprefix("Reduce with: pbrdf ")), "-o", "reduced")
    (found,) = (tmp_path / "reduced").rglob("white.csv")
    again, once = pbrdf.read(found), pbrdf.read(here / "white.nc")
    for name in "IQUV":
        np.testing.assert_allclose(again[name].values, once[name].values, rtol=1e-9, atol=1e-15)


def test_geometries_below_the_horizon_are_told(run):
    result = run("measure", "white", "--positions", 140, "--sample-angles", "20,75,80", "--patch", 2)
    assert (
        "Left out, as source or camera would be hidden or below the horizon: 2 of 3 at position 1 (140°)"
        in result.stderr
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("plan", "nothing"), "nothing: there is no such file"),
        (("plan", "white", "-o", "plan.txt"), "the extension must be .csv"),
        (("plan", "white", "-o", "no/plan.csv"), "there is no folder no"),
        (("plan", "white", "-o", "taken.csv"), "taken.csv: this is a folder"),
        (("plan", "white", "-o", "drawn.csv"), "drawn.png: this is a folder"),
        (("plan", "white", "--angle-error", 60), "angle error 60°: it brings source or camera below"),
        (("plan", "white", "--criterion", "E"), "choose one of D, A"),
        (("plan", "white", "--instrument", "moon"), "no built-in instrument of that name"),
        (("plan", "white", "--instrument", "moon.toml"), "moon.toml"),
        (("plan", "white", "--instrument", "paper", "--noise", "0.02"), "exclude each other"),
        (("plan", "white", "--uncertainty", "much"), "--uncertainty: 'much' is not a number"),
        (("plan", "white", "--smallest-bistatic", 150, "--largest-zenith", 60), "leave no camera position"),
        (("plan", "white", "--budget", 2, "--fix", "n", "--fix", "sigma"), "2 readings do not determine"),
        (("measure", "white", "white"), "two samples are called 'white'"),
        (("measure", "white", "--calibration-error", "odd"), "choose one of reading, fixed, none"),
        (("measure", "white", "--exposure", "long"), "--exposure: 'long' is not a number"),
        (("measure", "white", "--positions", "0"), "above 0° and below 180°"),
        (("measure", "white", "--source-radius", "60"), "angular radius"),
        (("measure", "white", "--source-polarization", "1,2"), "three numbers"),
        (("measure", "white", "--angle-error", "8"), "sample is 8°"),
        (("measure", "white", "--wavelength", "-3"), "--wavelength -3: give a wavelength above 0"),
        (("measure", "white", "--wavelength", "nan"), "--wavelength nan: give a wavelength above 0"),
        (("measure", "white", "--angles", "none.csv"), "none.csv"),
        (("measure", "white", "--angles", "none.csv", "--positions", "60"), "leave --positions"),
        (("measure", "white", "-o", "no/such"), "there is no folder no"),
    ],
)
def test_mistakes_are_one_line_and_leave_nothing_behind(refused, tmp_path, arguments, message):
    for folder in ("taken.csv", "drawn.png"):
        (tmp_path / folder).mkdir()
    assert message in refused(*arguments)
