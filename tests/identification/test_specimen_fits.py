"""What a library keeps of its specimens' fits, and when a model misses its own specimens."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

import pbrdf
from pbrdf.identification.library import Library, bundled_library, read_library
from pbrdf.identification.material import material_from_fits
from pbrdf.identification.specimen_fits import SpecimenFits, relative_noise


@pytest.fixture(scope="module")
def bent_fit():
    """A paint whose intensity no double-Gauss has: waves of 30 % over it, with stated uncertainties of 1 %."""
    data = pbrdf.open_experiment("white").isel(geometry=slice(0, 63, 4))
    waves = 1.0 + 0.3 * np.sin(np.arange(data.sizes["geometry"]))
    bent = data.assign({name: data[name] * waves for name in "IQU"})
    return pbrdf.fit(bent, fix={"n": 1.6}, starts=2, max_iterations=30)


def test_a_model_that_misses_its_specimens_is_told(bent_fit, tmp_path):
    made = material_from_fits("bent", [bent_fit], labels=["the fit of bent.csv"])
    assert made.fits.reduced_chi2 == bent_fit.goodness.reduced_chi2
    # noise so large would explain the misfit; that of the data is 1 % of the intensity
    assert relative_noise(bent_fit.data) == pytest.approx(0.01, rel=0.35)
    wide = replace(bent_fit.data, std=bent_fit.data.std * np.sqrt(bent_fit.goodness.reduced_chi2))
    assert made.fits.missed == pytest.approx(relative_noise(wide))
    assert made.fits.misfits()
    assert made.fits.misfits(0.5 * made.fits.missed)
    assert not made.fits.misfits(1.1 * made.fits.missed)
    (caution,) = made.fits.cautions
    assert caution == f"the fit of bent.csv: {bent_fit.verdict().sentence}"
    Library((made,)).write(tmp_path / "library.json")
    assert read_library(tmp_path / "library.json")["bent"].fits == made.fits


def test_nothing_known_is_no_misfit():
    assert math.isnan(SpecimenFits().reduced_chi2)
    assert not SpecimenFits().misfits()
    assert not SpecimenFits(1.5, 0.1).misfits()
    assert SpecimenFits(3.0).misfits(0.1)


def test_a_library_without_the_fits_is_read(tmp_path):
    """Files that were written before fits were kept."""
    bundled_library().write(tmp_path / "library.json")
    content = json.loads((tmp_path / "library.json").read_text(encoding="utf-8"))
    for material in content["materials"]:
        assert material.pop("fits") == {"reduced_chi2": None, "missed": None, "cautions": []}
    (tmp_path / "library.json").write_text(json.dumps(content), encoding="utf-8")
    assert not read_library(tmp_path / "library.json")["white"].fits.misfits()


def test_noise_of_ratios_and_of_nothing_known(bent_fit):
    data = bent_fit.data
    ratios = replace(data, channels=("dolp",), values=data.values[:1], std=np.full_like(data.std[:1], 0.02))
    assert relative_noise(ratios) == pytest.approx(0.02)
    unknown = replace(data, std=np.full_like(data.std, np.nan))
    assert math.isnan(relative_noise(unknown))
