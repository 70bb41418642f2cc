"""What is said of an identification, and what it rests on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrdf.identification.conformal import Calibration
from pbrdf.identification.identify import identify
from pbrdf.identification.library import Library, bundled_library
from pbrdf.identification.specimen_fits import SpecimenFits
from pbrdf.report.identification.subject import (
    level_of,
    nearest_rejected,
    p_value_in_words,
    probability_in_words,
    ranked,
    rests_on,
    rows_of,
    sentence,
)
from pbrdf.report.identification.summary import summary_text
from pbrdf.wording import joined


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


def test_probabilities_that_say_nothing_are_not_shown(identified):
    """Waves of 50 % over the intensity: no paint has them, and the ratios of tails are no probabilities."""
    waves = 1.0 + 0.5 * np.sin(np.arange(identified.dataset.sizes["geometry"]))
    dataset = identified.dataset.assign(I=identified.dataset["I"] * waves)
    report = replace(identified, found=identify(dataset, bundled_library()), dataset=dataset)
    assert report.found.far_from_all
    assert max(c.probability for c in report.found.candidates) > 0.999
    assert {row[1] for row in rows_of(report.found)} == {"–"}
    distances = [candidate.distance for candidate in ranked(report.found)]
    assert distances == sorted(distances)
    assert f"the least unlike is {ranked(report.found)[0].name} (which misses by" in sentence(report.found)
    assert "Probabilities: none" in summary_text(report)
    assert not identified.found.far_from_all


def test_an_empty_set_by_chance_keeps_its_probabilities(identified):
    """One in twenty misses its material; that one is not far from all."""
    none = with_set(identified, [])
    assert not none.far_from_all
    assert "p-value" in sentence(none)
    assert {row[1] for row in rows_of(none)} != {"–"}


def test_a_model_that_misses_its_own_specimens_is_a_caution(identified):
    first, *others = bundled_library().materials
    fits = SpecimenFits(25.0, 0.12, ("panel 1: The model describes the data in part.",))
    library = Library((replace(first, fits=fits), *others))
    report = replace(identified, found=replace(identified.found, library=library))
    model, doubt = (line for line in rests_on(report) if line.startswith("Caution: "))
    assert "misses its own specimens of white (by 5 times their uncertainty, 12 % of the signal)" in model
    # 9 % of the intensity and 9 % of its median are 12 % at the median
    assert "--noise 9%" in model
    assert "the fits behind white are not sound" in doubt
    # noise that covers what the model misses
    data = report.found.data
    wide = replace(data, std=np.abs(data.values) * 0.2)
    covered = replace(report, found=replace(report.found, data=wide))
    assert not [line for line in rests_on(covered) if "misses its own specimens" in line]


def test_a_material_that_calibration_can_never_leave_out(identified):
    materials = bundled_library().materials
    names = tuple(m.name for m in materials)
    scores = tuple(np.linspace(0.1, 0.9, 3 if n == "cd-back" else 30) for n in names)
    library = Library(materials, Calibration(names, scores, 1.0, "our panels"))
    report = replace(identified, found=replace(identified.found, library=library))
    assert "The set holds cd-back (3) whatever was measured: it takes 19 measurements" in "\n".join(
        rests_on(report)
    )


def test_an_identification_shows_itself(identified):
    found = identified.found
    assert str(found) == found.summary().rstrip()
    assert "white: the only material in the 95 % set" in str(found)
    assert repr(found) == "<Identification: white at 95 %, 5 candidates>"
    html = found._repr_html_()
    assert html.count("<tr>") == 6
    assert "&gt; 99.9 %" in html
    assert "all materials alike beforehand" in html
