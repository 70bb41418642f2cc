"""What is said of an identification, and what it rests on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrdf.identification.conformal import Calibration
from pbrdf.identification.library import Library, bundled_library
from pbrdf.report.identification.subject import (
    joined,
    level_of,
    nearest_rejected,
    p_value_in_words,
    probability_in_words,
    rests_on,
    sentence,
)
from pbrdf.report.identification.summary import summary_text


def with_set(report, names):
    """The same measurement with another set."""
    found = report.found
    candidates = tuple(replace(c, accepted=c.name in names) for c in found.candidates)
    return replace(found, candidates=candidates)


def test_one_several_none(identified):
    one, several, none = (with_set(identified, n) for n in (["white"], ["white", "cd-back"], []))
    assert sentence(one) == "white: the only material in the 95 % set"
    assert sentence(several) == "white or cd-back: at 95 % the measurement does not tell them apart"
    assert sentence(none).startswith("none of these: unlike every material of the library at 95 %; the least")
    assert [level_of(f) for f in (one, several, none)] == ["describes", "in part", "not"]
    assert nearest_rejected(none).name == "white"
    everything = with_set(identified, [c.name for c in none.candidates])
    assert nearest_rejected(everything) is None


def test_nothing_is_certain():
    assert [probability_in_words(p) for p in (1.0, 0.9988, 0.5, 0.0, np.nan)] == [
        "> 99.9 %", "99.9 %", "50.0 %", "< 0.1 %", "–",
    ]  # fmt: skip
    assert [p_value_in_words(p) for p in (0.0, 0.0123, 1.0)] == ["< 0.001", "0.012", "1"]
    assert joined(["a", "b", "c"], "or") == "a, b or c"


def test_a_calibration_and_estimated_scatter_are_named(identified):
    first, *others = bundled_library().materials
    materials = (replace(first, scatter="estimated", specimens=12), *others)
    names = tuple(m.name for m in materials)
    scores = tuple(np.linspace(0.1, 0.9, 30) if n != "cd-back" else np.empty(0) for n in names)
    library = Library(materials, Calibration(names, scores, 1.0, "our panels"))
    report = replace(identified, found=replace(identified.found, library=library), prior={"white": 0.5})
    text = "\n".join(rests_on(report))
    assert "calibrated with 120 measurements of known materials (our panels; none of cd-back" in text
    assert "assumed for matte-white-thin, matte-white-thick, pearl-white and cd-back" in text
    assert "beforehand white 50 %" in text
    printed = summary_text(report)
    assert "estimated from 12 specimens" in printed


@pytest.mark.parametrize("wavelength", [476.0, 480.0, 550.0])
def test_another_wavelength_is_a_caution(identified, wavelength):
    dataset = identified.dataset.assign_coords(
        wavelength=("geometry", np.full(identified.dataset.sizes["geometry"], wavelength))
    )
    said = [s for s in rests_on(replace(identified, dataset=dataset)) if s.startswith("Caution")]
    assert len(said) == (wavelength == 550.0)
