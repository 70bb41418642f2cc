"""What is said of energy, realisability, bounds, lobe and extrapolation."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import pbrdf
from pbrdf.inversion.plausibility import Severity, plausibility
from pbrdf.models.reflectance import directional_hemispherical_reflectance


def measured(model, theta_i, theta_r, phi=0.0, group=1):
    """Noiseless Stokes data of all pairs of angles in degrees, uncertainties of 1 %."""
    ti, tr = (np.deg2rad(a).ravel() for a in np.meshgrid(theta_i, theta_r))
    angles = ti, np.abs(tr), np.where(tr < 0.0, np.pi, np.deg2rad(phi))
    stokes = model.stokes(*angles)
    std = dict.fromkeys("IQU", 0.01 * stokes[:, 0])
    values = dict(zip("IQU", stokes.T[:3], strict=True))
    return pbrdf.make_dataset(*angles, quantity="brdf", **values, std=std, group=np.full(len(ti), group))


def findings(result, dataset=None):
    """Findings by check."""
    by_check: dict[str, list] = {}
    for finding in plausibility(result, dataset):
        by_check.setdefault(finding.check, []).append(finding)
    return by_check


WELL = pbrdf.DoubleGauss(0.05, 1.6, 0.6, 1.1, 0.1, 0.6)


@pytest.fixture(scope="module")
def well_measured():
    dataset = measured(WELL, [20.0, 50.0], np.arange(-70.0, 75.0, 5.0))
    return pbrdf.fit(dataset, WELL, starts=2), dataset


@pytest.mark.slow
def test_a_plausible_fit_gets_no_objection(well_measured):
    result, dataset = well_measured
    found = findings(result, dataset)
    assert list(found) == ["energy", "realisability", "parameters", "lobe", "range"]
    assert {f.severity for check in found.values() for f in check} == {Severity.OK, Severity.NOTE}
    largest = directional_hemispherical_reflectance(result.model, np.deg2rad(np.arange(0, 90, 5))).max()
    assert f"reflects at most {largest:.3g} " in found["energy"][0].sentence
    assert "58 geometries: θ_i 20.0–50.0°, θ_r 0.0–70.0°, facet tilt 0.0–60.0°" in found["range"][0].sentence
    assert "everywhere out of the plane of incidence" in found["range"][0].sentence


@pytest.mark.slow
def test_energy_is_counted_at_the_wavelength_that_reflects_most():
    """The model of the first wavelength takes in much, that of the last gives out more than it gets."""
    parts = []
    for nm, a in ((450.0, 0.2), (650.0, 1.8)):
        part = measured(WELL.replace(a=a), [20.0, 50.0], np.arange(-70.0, 75.0, 10.0))
        parts.append(part.assign_coords(wavelength=("geometry", np.full(part.sizes["geometry"], nm))))
    dataset = xr.concat(parts, "geometry")
    held = {name: value for name, value in WELL.values.items() if name != "a"}
    result = pbrdf.fit(dataset, fix=held, split={"a": "wavelength"}, starts=2)
    (energy,) = findings(result, dataset)["energy"]
    assert energy.severity is Severity.VIOLATION and "°, 650 nm), more than it receives" in energy.sentence


@pytest.mark.slow
def test_a_surface_that_reflects_more_than_it_receives_is_a_violation():
    bright = WELL.replace(a=1.8)
    dataset = measured(bright, [20.0, 50.0], np.arange(-70.0, 75.0, 10.0))
    result = pbrdf.fit(dataset, bright, starts=2)
    (energy,) = findings(result, dataset)["energy"]
    assert energy.severity is Severity.VIOLATION and "more than it receives" in energy.sentence
    # on an unknown scale the same numbers say nothing
    for attributes in ({"scale": "arbitrary"}, {"quantity": "dn"}, {"quantity": "radiance"}):
        (energy,) = findings(result, dataset.assign_attrs(attributes))["energy"]
        assert energy.severity is Severity.NOTE and "says nothing about energy" in energy.sentence


def test_too_much_only_beyond_the_measured_incidence_is_a_warning():
    """k < 1 grows towards grazing: 1 is exceeded only where nothing was measured."""
    steep = WELL.replace(a=0.72, k=0.6)
    dataset = measured(steep, [5.0, 25.0], np.arange(-60.0, 65.0, 5.0))
    (energy,) = findings(pbrdf.fit(dataset, steep, starts=2), dataset)["energy"]
    assert energy.severity is Severity.WARNING and "beyond the measured angles" in energy.sentence


def test_a_fitted_gain_is_named_as_what_the_energy_rests_on():
    dataset = measured(WELL, [20.0, 50.0], np.arange(-70.0, 75.0, 10.0)).assign_attrs(scale="arbitrary")
    result = pbrdf.fit(dataset, WELL, starts=2, nuisances=["gain"])
    (energy,) = findings(result, dataset)["energy"]
    assert energy.severity is Severity.NOTE and "rests on the fitted gain" in energy.sentence


@pytest.mark.slow
def test_parameters_at_bounds_and_undetermined_ones_are_named():
    dataset = measured(WELL, [20.0, 50.0], np.arange(-70.0, 75.0, 10.0))
    at_bound = findings(pbrdf.fit(dataset, starts=4, bounds={"n": (1.2, 1.5)}))["parameters"]
    assert any(f.sentence.startswith("n = 1.5 stands at upper bound") for f in at_bound)
    assert {f.severity for f in at_bound} == {Severity.WARNING}
    intensity = measured(WELL, [5.0], [-30.0, -28.0, -25.0, -22.0, 25.0, 28.0, 30.0, 35.0]).drop_vars(
        ["Q", "U", "Q_std", "U_std"]
    )
    free = findings(pbrdf.fit(intensity, starts=8))["parameters"]
    assert any("is not determined by these data" in f.sentence for f in free)


@pytest.mark.slow
def test_an_unmeasured_lobe_is_a_warning():
    """σ and n then rest on the diffuse part alone."""
    away = measured(WELL, [20.0], [-60.0, -40.0, -20.0, 0.0, 60.0, 70.0])
    (lobe,) = findings(pbrdf.fit(away, WELL, starts=1, fix={"sigma": 0.05}))["lobe"]
    assert lobe.severity is Severity.WARNING and lobe.sentence.startswith(
        "No fitted point lies within 2σ (5.7°"
    )
    # 2σ of slope, 5.71° of facet tilt: 11.4° of view; one point at 31° is within, 32° is not
    for inside, count in ((31.0, 1), (32.0, 0)):
        near = measured(WELL, [20.0], [-60.0, -40.0, -20.0, 0.0, inside, 60.0, 70.0])
        (lobe,) = findings(pbrdf.fit(near, WELL, starts=1, fix={"sigma": 0.05}))["lobe"]
        assert lobe.severity is Severity.WARNING
        assert lobe.sentence.startswith("Only 1 fitted point lies" if count else "No fitted point")


@pytest.mark.slow
def test_held_out_points_beyond_the_fitted_range_are_counted():
    dataset = measured(WELL, [20.0, 40.0, 60.0], np.arange(0.0, 75.0, 10.0))
    inner = findings(pbrdf.fit(dataset, WELL, starts=1, hold_out="theta_i=40"))["range"]
    assert "they test interpolation" in inner[1].sentence
    outer = findings(pbrdf.fit(dataset, WELL, starts=1, hold_out="theta_i=60"))["range"]
    assert "Of the 8 held-out geometries some lie outside the fitted range: 8 in θ_i" in outer[1].sentence


def test_out_of_plane_data_state_their_azimuths():
    dataset = measured(WELL, [20.0, 50.0], np.arange(0.0, 75.0, 5.0), phi=40.0)
    (finding,) = findings(pbrdf.fit(dataset, WELL, starts=1, fix={"sigma": 0.05}))["range"]
    assert "|φ| 40–40°" in finding.sentence and "out of the plane" not in finding.sentence
