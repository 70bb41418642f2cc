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
    assert "M00 of theirs is 3.14159 (π) times ours" in by_model
    np.savez(tmp_path / "theirs.npz", theirs / np.pi * np.cos(np.radians([20, 50]))[:, None, None])
    by_archive = run("compare-with", "theirs.npz", "white", *angles, "--convention", "scatmech").stdout
    assert "M00 of theirs is 1 cosθ_r times ours" in by_archive
    np.save(tmp_path / "theirs.npy", ours / ours[:, :1, :1])
    divided = run("compare-with", "theirs.npy", "ours.npy", "--convention", "pyelli").stdout
    assert "M00 of theirs is 1 throughout: they are divided by M00" in divided


def test_rows_and_columns_exchanged_are_told(run, gold, tmp_path):
    np.save(tmp_path / "gold.npy", np.load(tmp_path / "gold.npy").swapaxes(1, 2))
    text = run("compare-with", "gold.npy", *FLAT, "--convention", "pypolar").stdout
    assert "Another convention fits better: pyelli (nothing reversed)" in text
    assert "With rows and columns exchanged they fit as well: eradiate, katsu" in text


def test_azimuths_from_the_side_of_the_source_are_told(run, tmp_path):
    paint = pbrdf.load_paint("white")
    theta_r, phi = (
        x.ravel() for x in np.meshgrid(np.radians([20, 40]), np.radians([0, 60, 120]), indexing="ij")
    )
    theirs = paint.mueller(np.full(6, 0.5), theta_r, phi + np.pi)
    np.save(tmp_path / "theirs.npy", pbrdf.convert.from_eradiate_mueller(theirs))
    grid = ("--theta-i", str(np.degrees(0.5)), "--theta-r", "20,40", "--phi", "0,60,120")
    text = run("compare-with", "theirs.npy", "white", *grid, "--convention", "eradiate").stdout
    assert "With φ half a turn further they fit better" in text
    right = paint.mueller(np.full(6, 0.5), theta_r, phi)
    np.save(tmp_path / "theirs.npy", pbrdf.convert.from_eradiate_mueller(right))
    assert (
        "half a turn"
        not in run("compare-with", "theirs.npy", "white", *grid, "--convention", "eradiate").stdout
    )


def test_a_grid_in_another_order_is_refused(run, refused, tmp_path):
    np.save(tmp_path / "theirs.npy", np.ones((3, 2, 1, 4, 4)))
    said = refused(
        "compare-with", "theirs.npy", "white", "--theta-i", "10", "--theta-r", "20,40", "--phi", "0,60,120",
        "--convention", "eradiate",
    )  # fmt: skip
    assert (
        "the axes of the file are (3, 2, 1); those of ours are θ_i (1), θ_r (2), φ (3), in this order" in said
    )


def test_what_is_refused(run, refused, gold, tmp_path):
    (tmp_path / "text.npy").write_text("no")
    assert "give either OURS or --flat" in refused("compare-with", "gold.npy", "--convention", "katsu")
    (tmp_path / "damaged.npy").write_bytes((tmp_path / "gold.npy").read_bytes()[:150])
    (tmp_path / "damaged.npz").write_bytes(b"PK\3\4 and nothing")
    np.savez(tmp_path / "two.npz", a=np.eye(4), b=np.eye(4))
    for name, said in {
        "text.npy": "this is not a file of NumPy",
        "nowhere.npy": "there is no such file",
        "damaged.npy": "cannot be read as a file of NumPy",
        "damaged.npz": "cannot be read as a file of NumPy",
        "two.npz": "one array is wanted, there are a, b",
        ".": "cannot be read as a file of NumPy",
    }.items():
        assert said in refused("compare-with", name, *FLAT, "--convention", "katsu")
    assert "no program is called 'foo'" in refused("compare-with", "gold.npy", *FLAT, "--convention", "foo")
    assert "--phi" in refused("compare-with", "gold.npy", *FLAT, "--phi", "3", "--convention", "katsu")
    assert "--flat" in refused(
        "compare-with", "gold.npy", "--flat", "1.5,x", "--theta-i", "3", "--convention", "katsu"
    )


def test_the_help_names_every_program():
    assert _PROGRAMS.split("|") == sorted(pbrdf.convert.PROGRAMS)
