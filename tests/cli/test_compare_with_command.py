"""``pbrdf compare-with`` in this process."""

from __future__ import annotations

import numpy as np
import pytest

import pbrdf
from pbrdf.cli.compare_with import _PROGRAMS
from pbrdf.data.convention_comparison import flat_reflection

FLAT = ("--flat", "0.47,2.83", "--theta-i", "30,70")


@pytest.fixture
def gold(run, tmp_path):
    """Gold as pypolar gives it."""
    matrices = flat_reflection(np.radians([30.0, 70.0]), 0.47, 2.83)
    np.save(tmp_path / "gold.npy", pbrdf.convert.from_pypolar_mueller(matrices))


def test_a_flat_surface_in_its_convention(run, gold):
    text = run("compare-with", "gold.npy", *FLAT, "--convention", "pypolar").stdout
    assert "2 matrices, read as pypolar's: largest difference of M/M00 " in text
    assert "M00 of theirs is 1 times ours" in text
    assert "fits better" not in text


def test_another_convention_that_fits_better_is_named(run, gold):
    text = run("compare-with", "gold.npy", *FLAT, "--convention", "mitsuba").stdout
    assert "Another convention fits better: eradiate, katsu, polanalyser and pypolar (V reversed)" in text


def test_a_model_and_matrices_of_ours(run, gold, tmp_path):
    paint = pbrdf.load_paint("white")
    ours = paint.mueller(np.radians([20.0, 20.0]), np.radians([20.0, 50.0]), np.radians([40.0, 40.0]))
    theirs = pbrdf.convert.from_scatmech_mueller(ours) * np.pi
    np.save(tmp_path / "theirs.npy", theirs)
    np.save(tmp_path / "ours.npy", ours)
    angles = ("--theta-i", "20", "--theta-r", "20,50", "--phi", "40")
    by_model = run("compare-with", "theirs.npy", "white", *angles, "--convention", "scatmech").stdout
    by_file = run("compare-with", "theirs.npy", "ours.npy", "--convention", "scatmech").stdout
    assert by_model == by_file
    assert "M00 of theirs is 3.14159 times ours" in by_model


def test_what_is_refused(run, refused, gold, tmp_path):
    (tmp_path / "text.npy").write_text("no")
    assert "give either OURS or --flat" in refused("compare-with", "gold.npy", "--convention", "katsu")
    assert "cannot be read" in refused("compare-with", "text.npy", *FLAT, "--convention", "katsu")
    assert "cannot be read" in refused("compare-with", "nowhere.npy", *FLAT, "--convention", "katsu")
    assert "no program is called 'foo'" in refused("compare-with", "gold.npy", *FLAT, "--convention", "foo")
    assert "--phi" in refused("compare-with", "gold.npy", *FLAT, "--phi", "3", "--convention", "katsu")
    assert "--flat" in refused(
        "compare-with", "gold.npy", "--flat", "1.5,x", "--theta-i", "3", "--convention", "katsu"
    )


def test_the_help_names_every_program():
    assert _PROGRAMS.split("|") == sorted(pbrdf.convert.PROGRAMS)
