"""``pbrdf library``: what it adds, lists, shows, removes and refuses."""

from __future__ import annotations

import numpy as np
import pytest

import pbrdf
from pbrdf.identification.library import Library, bundled_library, read_library

BRIEF = slice(0, 63, 4)


@pytest.fixture(scope="module")
def fits(tmp_path_factory):
    """Folders of fits of three panels of a paint."""
    folder = tmp_path_factory.mktemp("fits")
    data = pbrdf.open_experiment("matte-white-thick").isel(geometry=BRIEF)
    for number in range(3):
        panel = data.copy()
        panel["I"] = data["I"] * (1.0 + 0.01 * np.sin(np.arange(data.sizes["geometry"]) + number))
        pbrdf.fit(panel.assign_attrs(title=f"panel {number}"), starts=4).save(folder / f"panel-{number}")
    return [folder / f"panel-{number}" for number in range(3)]


@pytest.mark.slow
def test_one_specimen_shows_that_its_scatter_is_assumed(run, fits, tmp_path):
    result = run("library", "add", "thick", fits[0], "-l", "paints.json", "--scatter", "sigma=0.15,n=0.02")
    assert "Scatter between specimens: assumed (1 specimen)." in result.stdout
    assert "From: fit panel-0: panel 0" in result.stdout
    assert "Written: paints.json, 1 material" in result.stdout
    (made,) = read_library(tmp_path / "paints.json").materials
    assert (made.scatter, made.specimens, made.simulated) == ("assumed", 1, True)
    assert made.wavelength == pytest.approx(476.0)
    own = np.sqrt(np.diag(made.covariance))
    # the specimen's own uncertainty comes on top
    assert own[made.space.names.index("sigma")] == pytest.approx(0.15, rel=0.2)
    listed = " ".join(run("library", "list", "--library", "paints.json").stdout.split())
    assert "thick double-gauss 476 nm assumed (1 specimen) simulated" in listed
    assert "too few specimens" in listed
    assert "Not calibrated" in listed


@pytest.mark.slow
def test_several_specimens_show_their_scatter(run, fits, tmp_path):
    run("library", "add", "thick", *fits, "--library", "paints.json")
    shown = run("library", "show", "thick", "--library", "paints.json").stdout
    assert "estimated from 3 specimens" in shown
    assert "a guess" not in shown
    assert [line for line in shown.splitlines() if line.startswith("From")] == [
        f"From: fit panel-{n}: panel {n}" for n in range(3)
    ]


@pytest.mark.slow
def test_data_are_fitted_first(run, tmp_path):
    pbrdf.write(pbrdf.open_experiment("cd-back").isel(geometry=BRIEF), tmp_path / "back.nc")
    result = run("library", "add", "back", "back.nc", "--quiet")
    assert result.stdout == "library.json\n"
    (made,) = read_library(tmp_path / "library.json").materials
    assert made.provenance[0].startswith("fitted to back.nc")
    assert made.values["n"] == pytest.approx(pbrdf.load_paint("cd-back").values["n"], rel=0.2)


@pytest.mark.slow
def test_replacing_and_removing(run, refused, fits, tmp_path):
    run("library", "add", "a", fits[0], "-q")
    run("library", "add", "b", fits[1], "-q")
    assert "library.json: there is a material 'a' already" in refused("library", "add", "a", fits[2])
    run("library", "add", "a", fits[2], "--replace", "-q")
    assert read_library(tmp_path / "library.json")["a"].provenance == ("fit panel-2: panel 2",)
    assert "has no material 'c'; it has b, a" in refused("library", "remove", "a", "c")
    assert "1 material;" in run("library", "remove", "a").stdout
    assert read_library(tmp_path / "library.json").names == ["b"]


def test_a_calibration_goes_with_the_materials_that_it_was_of(run, tmp_path):
    from pbrdf.identification.conformal import Calibration

    materials = bundled_library().materials
    names = tuple(m.name for m in materials)
    calibration = Calibration(names, tuple(np.linspace(0.1, 0.9, 5) for _ in names), 1.5, "trial")
    Library(materials, calibration).write(tmp_path / "library.json")
    assert "Calibrated with trial" in " ".join(
        run("library", "list", "--library", "library.json").stdout.split()
    )
    assert "calibrate again" in run("library", "remove", "white").stdout
    assert read_library(tmp_path / "library.json").calibration is None


def test_the_bundled_paints_are_listed_and_shown(run):
    listed = run("library", "list").stdout
    assert listed.startswith("the bundled paints: 5 materials")
    assert listed.count("assumed") == 5
    assert run("library", "show").stdout.count("Scatter between specimens: assumed.") == 5


@pytest.mark.slow
def test_what_is_refused_of_a_fit(refused, fits):
    assert "--scatter: there is no free parameter 'x'" in refused(
        "library", "add", "a", fits[0], "--scatter", "x=1"
    )
    assert "leave --quantity out" in refused("library", "add", "a", fits[0], "--quantity", "brdf")


def test_what_is_refused(refused, tmp_path):
    assert "--scatter 'sigma': give NAME=VALUE" in refused(
        "library", "add", "a", "white", "--scatter", "sigma"
    )
    assert "absent.csv: there is no such file" in refused("library", "add", "a", "absent.csv")
    assert "there is no folder none" in refused("library", "add", "a", "white", "-l", "none/paints.json")
    assert "paints.json: cannot be read" in refused("library", "list", "--library", "paints.json")
    assert "the bundled paints: the library has no material 'gloss'" in refused("library", "show", "gloss")
    (tmp_path / "text.json").write_text("[]", encoding="utf-8")
    assert "text.json: not a library of materials" in refused(
        "library", "remove", "a", "--library", "text.json"
    )


def test_specimens_of_two_wavelengths_are_no_material(refused, tmp_path):
    data = pbrdf.open_experiment("white").isel(geometry=BRIEF)
    other = data.assign_coords(wavelength=("geometry", np.full(data.sizes["geometry"], 550.0)))
    pbrdf.write(data, tmp_path / "a.nc")
    pbrdf.write(other, tmp_path / "b.nc")
    assert "measured at 476 … 550 nm" in refused("library", "add", "white", "a.nc", "b.nc")


def test_a_number_that_only_python_knows_is_refused_in_a_group_too(refused):
    assert "--wavelength: '4_76' is not a number" in refused(
        "library", "add", "a", "white", "--wavelength", "4_76"
    )


@pytest.mark.slow
def test_one_rule_says_which_library_is_meant(run, refused, tmp_path):
    """A file that is named first or with --library, else library.json of this folder, else the bundled paints."""
    Library(bundled_library().materials[:2]).write(tmp_path / "paints.json")
    listed = run("library", "list", "paints.json").stdout
    assert listed.startswith("paints.json: 2 materials")
    assert run("library", "list", "--library", "paints.json").stdout == listed
    assert run("library", "show", "paints.json", "white").stdout.startswith("white: double-gauss")
    assert "there is no library.json in this folder" in refused("library", "remove", "white")
    assert run("library", "list").stdout.startswith("the bundled paints: 5")
    (tmp_path / "paints.json").rename(tmp_path / "library.json")
    assert run("library", "list").stdout.startswith("library.json: 2 materials")
    assert "Library: library.json, 2 materials." in run("identify", "white").stdout
    run("library", "remove", "library.json", "white")
    assert read_library(tmp_path / "library.json").names == ["matte-white-thin"]
    assert "two libraries are named" in refused("library", "list", "a.json", "-l", "b.json")
    assert "a library's file ends in .json" in refused("library", "list", "white")
    assert "name its specimens as well" in refused("library", "add", "paints.json", "white")


@pytest.mark.slow
def test_a_model_is_named_and_how_data_were_read_is_kept(run, refused, fits, tmp_path):
    pbrdf.write(pbrdf.open_experiment("cd-back").isel(geometry=BRIEF), tmp_path / "back.nc")
    run(
        "library",
        "add",
        "back",
        "back.nc",
        "--select",
        "theta_i=0:80",
        "--model",
        "reciprocal-double-gauss",
        "-q",
    )
    (made,) = read_library(tmp_path / "library.json").materials
    assert made.space.model.name == "reciprocal-double-gauss"
    assert made.provenance[0].endswith("(--select theta_i=0:80 --model reciprocal-double-gauss)")
    assert "is a fit, of a model already" in refused(
        "library", "add", "a", fits[0], "--model", "double-gauss"
    )


@pytest.mark.slow
def test_fits_that_are_not_sound(run, refused, tmp_path):
    """A cosine of the intensity is described in part, alternating intensities not at all."""
    data = pbrdf.open_experiment("white").isel(geometry=BRIEF)
    number = np.arange(data.sizes["geometry"])
    for name, factor in (("bent", 1.0 + 0.6 * np.sin(number)), ("wild", 8.0 ** (number % 3 - 1))):
        bent = data.assign({channel: data[channel] * factor for channel in "IQU"})
        pbrdf.fit(bent, starts=2).save(tmp_path / f"{name}-fit")
    said = run("library", "add", "bent", "bent-fit").stderr
    assert "bent: 1 of 1 fits is not sound" in said
    assert "Caution: the fits behind bent are not sound" in " ".join(run("library", "list").stdout.split())
    shown = " ".join(run("library", "show", "bent").stdout.split())
    assert "Caution: the fit of bent-fit: The model describes the data in part" in shown
    assert "What to do: find a model" in shown
    assert "Caution: the model misses its own specimens" in shown
    assert "Caution: the fits behind bent are not sound" in " ".join(run("identify", "white").stdout.split())
    assert "No material can be made of them" in refused("library", "add", "wild", "wild-fit")
