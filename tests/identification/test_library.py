"""Libraries of materials in files."""

from __future__ import annotations

import json

import numpy as np
import pytest

import pbrdf
from pbrdf.errors import DataError, FitError
from pbrdf.identification.conformal import Calibration
from pbrdf.identification.library import Library, bundled_library, read_library
from pbrdf.identification.material import material_from_model


def test_the_bundled_library_says_that_it_is_simulated():
    library = bundled_library()
    assert library.names == list(pbrdf.PAINTS)
    assert all(material.simulated and material.scatter == "assumed" for material in library.materials)
    assert all("assumed, not measured" in material.provenance[0] for material in library.materials)


def test_a_library_comes_back_as_it_was(tmp_path):
    library = bundled_library()
    scores = tuple(np.sort(np.random.default_rng(i).random(5)) for i in range(5))
    library = Library(library.materials, Calibration(tuple(library.names), scores, 1.5, "by hand"))
    library.write(tmp_path / "paints.json")
    again = read_library(tmp_path / "paints.json")
    assert again.names == library.names
    for one, other in zip(library.materials, again.materials, strict=True):
        assert np.array_equal(one.mean, other.mean)
        assert np.array_equal(one.covariance, other.covariance)
        assert (one.form, one.wavelength, one.provenance) == (other.form, other.wavelength, other.provenance)
    assert again.calibration is not None
    assert again.calibration.temperature == 1.5
    assert all(np.array_equal(a, b) for a, b in zip(again.calibration.scores, scores, strict=True))


def test_materials_come_and_go():
    library = Library(())
    paint = material_from_model("paint", pbrdf.load_paint("white"))
    library = library.with_material(paint)
    with pytest.raises(FitError, match="has a material 'paint' already"):
        library.with_material(paint)
    assert library.with_material(paint, overwrite=True).names == ["paint"]
    assert library.without("paint").names == []
    with pytest.raises(FitError, match="has no material 'gloss'; it has paint"):
        library.without("gloss")


def damaged(tmp_path, change):
    bundled_library().write(tmp_path / "lib.json")
    content = json.loads((tmp_path / "lib.json").read_text())
    change(content)
    (tmp_path / "lib.json").write_text(json.dumps(content))
    return tmp_path / "lib.json"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda c: c.update(format="other"), "not a library of materials"),
        (lambda c: c.update(version=7), "version 7 of the format"),
        (lambda c: c.pop("materials"), "no list of materials"),
        (lambda c: c["materials"][1].pop("mean"), "material matte-white-thin is damaged: 'mean' is missing"),
        (lambda c: c["materials"][1].update(model="gloss"), "material matte-white-thin: .*gloss"),
        (lambda c: c["materials"][1].update(mean=[1.0]), "material matte-white-thin: .*6 rows"),
        (
            lambda c: c["materials"][0]["covariance"].__setitem__(0, [0.0] * 6),
            "material white: the covariance is not",
        ),
        (lambda c: c["materials"][0].update(unknowns=["x"] * 6), "no unknown 'x'"),
        (lambda c: c["materials"][1].update(name="white"), "two materials called 'white'"),
    ],
)
def test_a_damaged_file_is_named_with_its_material(tmp_path, change, said):
    file = damaged(tmp_path, change)
    with pytest.raises(DataError, match=said) as error:
        read_library(file)
    assert str(file) in str(error.value)


def test_what_is_no_library(tmp_path):
    (tmp_path / "text.json").write_text("white, 1.5")
    with pytest.raises(DataError, match="not JSON"):
        read_library(tmp_path / "text.json")
    with pytest.raises(DataError, match=r"none\.json: cannot be read"):
        read_library(tmp_path / "none.json")
