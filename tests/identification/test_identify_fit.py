"""Identification of fits and of their folders."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import pbrdf
from pbrdf.errors import DataError
from pbrdf.identification.identify import identify
from pbrdf.identification.identify_fit import identify_fit
from pbrdf.identification.library import bundled_library

LIBRARY = bundled_library()


@pytest.fixture(scope="module")
def fit():
    data = pbrdf.open_experiment("cd-back").isel(geometry=slice(0, 42))
    return pbrdf.fit(data, starts=4)


@pytest.mark.slow
def test_a_fit_is_identified_by_its_data(fit):
    found = identify_fit(fit, LIBRARY)
    own = identify(fit.dataset, LIBRARY)
    assert found.materials == own.materials == ["cd-back"]
    assert found.gain == own.gain
    assert found["white"].distance == pytest.approx(own["white"].distance)
    assert found.noise == "of the fit"


@pytest.mark.slow
def test_a_folder_is_its_fit(fit, tmp_path):
    fit.save(tmp_path / "fit")
    stored, found = identify_fit(tmp_path / "fit", LIBRARY), identify_fit(fit, LIBRARY)
    assert [c.name for c in stored.candidates] == [c.name for c in found.candidates]
    assert stored["white"].distance == pytest.approx(found["white"].distance, rel=1e-9)
    with pytest.raises(DataError, match="no such file"):
        identify_fit(tmp_path / "nothing", LIBRARY)


@pytest.mark.slow
def test_assumed_uncertainties_are_scaled_to_what_the_fit_missed(fit):
    guessed = replace(fit, data=replace(fit.data, std_known=False))
    found = identify_fit(guessed, LIBRARY)
    scale = np.sqrt(fit.goodness.reduced_chi2)
    np.testing.assert_allclose(found.data.std, scale * fit.data.std)
    assert found.noise == "assumed, scaled to what the fit missed"
