"""``pbrdf identify``: single measurements, fits, maps, calibration; what it prints, writes and refuses."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr

import pbrdf
from pbrdf.identification.library import bundled_library, read_library

FEW = [2, 14, 25, 37]


def measured(model, seed=0):
    """A few geometries of a specimen with noise of 1 %."""
    few = pbrdf.open_experiment("white").isel(geometry=FEW)
    angles = [few[name].values for name in ("theta_i", "theta_r", "phi")]
    stokes = model.stokes(*angles)
    random = np.random.default_rng(seed)
    std = 0.01 * stokes[:, 0]
    values = {n: stokes[:, i] + std * random.standard_normal(len(std)) for i, n in enumerate("IQU")}
    return pbrdf.make_dataset(
        *angles, quantity="brdf", **values, std=dict.fromkeys(values, std), wavelength=550.0
    )


@pytest.fixture
def stranger(tmp_path):
    pbrdf.write(
        measured(pbrdf.DoubleGauss(sigma=0.08, n=1.5, a=1.2, k=1.1, b=0.1, t=0.3)), tmp_path / "stranger.nc"
    )


@pytest.fixture
def picture(tmp_path):
    """A map of parameters, four rows: two paints, another paint, nothing measured."""
    library = bundled_library()
    space = library.materials[0].space
    random = np.random.default_rng(1)
    rows = [library["white"].draw(5, random), library["cd-back"].draw(5, random)]
    rows += [np.tile([0.08, 1.5, 1.2, 1.1, 0.1, 0.3], (5, 1)), np.full((5, 6), np.nan)]
    estimate = np.stack(rows)
    made = xr.Dataset(
        {
            "estimate": (("y", "x", "parameter"), estimate),
            "standard_error": (("y", "x", "parameter"), 0.01 * np.abs(estimate)),
        },
        coords={"parameter": space.names},
        attrs={"model": "double-gauss"},
    )
    made.transpose("parameter", "y", "x").to_netcdf(tmp_path / "map.nc", engine="h5netcdf")
    return tmp_path / "map.nc"


def test_a_bundled_measurement(run):
    printed = " ".join(run("identify", "white").stdout.split())
    assert printed.startswith("white, 476 nm: white: the only material in the 95 % set")
    for text in (
        "white > 99.9 %",
        "Sets: not calibrated",
        "Scatter between specimens: assumed for every material",
        "Gain: a common factor of the intensities was taken as not known",
        "Noise: of the data set.",
        "all materials alike beforehand",
    ):
        assert text in printed, text


def test_several_and_quietly(run, stranger):
    result = run("identify", "cd-back", "stranger.nc", "-q")
    assert result.output == "cd-back: cd-back\nstranger.nc: none of these\n"


def test_none_of_these_and_another_wavelength(run, stranger):
    printed = " ".join(run("identify", "stranger.nc", "--confidence", 0.9).stdout.split())
    assert "none of these: unlike every material of the library at 90 %" in printed
    assert "Caution: the data are of 550 nm, other than white (476 nm)" in printed
    assert "Gain: known" in printed


@pytest.mark.slow
def test_options_reach_the_identification(run, stranger):
    printed = run(
        "identify",
        "stranger.nc",
        "--gain",
        "unknown",
        "--angle",
        0.1,
        "--noise",
        "5%",
        "--prior",
        "white=0.5",
    ).stdout
    printed = " ".join(printed.split())
    assert "Gain: a common factor" in printed
    assert "Angle: an offset of the sample of 0.1°" in printed
    assert "Noise: stated." in printed
    assert "beforehand white 50 %, the others share the rest" in printed


@pytest.mark.slow
def test_a_fit_stands_for_its_data(run, tmp_path):
    pbrdf.fit(pbrdf.open_experiment("white").isel(geometry=slice(0, 63, 4)), starts=4).save(
        tmp_path / "white-fit"
    )
    assert run("identify", "white-fit", "-q").output == "white-fit: white\n"
    assert run("identify", "white-fit/fit.nc", "-q").output == "white-fit/fit.nc: white\n"


@pytest.mark.slow
def test_the_folder(run, tmp_path):
    result = run("identify", "white", "-o", "out")
    assert "Written to out/: index.html, summary.txt, identification.json, bands.png" in result.stdout
    record = json.loads((tmp_path / "out" / "identification.json").read_text(encoding="utf-8"))
    assert record["set"] == ["white"]
    assert record["candidates"][0]["scatter"] == "assumed"
    assert record["settings"]["confidence"] == 0.95
    page = (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    assert "the only material in the 95 % set" in page
    assert "pbrdf identify white -o out" in page
    assert (tmp_path / "out" / "bands.png").stat().st_size > 10_000


@pytest.mark.slow
def test_folders_of_several(run, tmp_path):
    run("identify", "white", "cd-back", "-o", "out", "--no-figures", "-q")
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["cd-back", "white"]
    assert not list(tmp_path.rglob("*.png"))


def test_a_map_of_parameters(run, picture, tmp_path):
    result = run("identify", "map.nc", "-o", "out")
    assert "5 more were not measured" in " ".join(result.stdout.split())
    with xr.open_dataset(tmp_path / "out" / "materials.nc", engine="h5netcdf") as found:
        names = [str(name) for name in found["material_name"].values]
        told = found["material"].values
    assert (told[3] == -2).all()
    assert (told[2] == -1).all()
    assert (told[0] == names.index("white")).sum() >= 4
    assert (told[1] == names.index("cd-back")).sum() >= 4
    record = json.loads((tmp_path / "out" / "classes.json").read_text(encoding="utf-8"))
    assert sum(c["pixels"] for c in record["classes"]) == 20


def test_a_map_is_not_kept_without_a_folder(run, picture):
    result = run("identify", "map.nc")
    assert "the map of materials is not kept; --output FOLDER writes it" in result.stderr
    assert run("identify", "map.nc", "-q").stdout.startswith("map.nc: ")


@pytest.fixture
def labelled(tmp_path):
    """Three measurements of each of the bundled paints, and the table that says so."""
    random = np.random.default_rng(2)
    lines = ["file, material"]
    (tmp_path / "data").mkdir()
    for material in bundled_library().materials:
        for number, values in enumerate(material.draw(3, random)):
            file = f"{material.name}-{number}.nc"
            pbrdf.write(measured(material.space.build(values), number), tmp_path / "data" / file)
            lines.append(f"{file}, {material.name}")
    (tmp_path / "data" / "labelled.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


@pytest.mark.slow
def test_calibration_of_the_bundled_paints_goes_to_the_folder(run, labelled, tmp_path):
    result = run("identify", "--calibrate", "data/labelled.csv", "-o", "out")
    printed = " ".join(result.stdout.split())
    assert "of 15 labelled measurements the 95 % set held the true material" in printed
    assert "Too few of white (3)" in printed
    made = read_library(tmp_path / "out" / "library.json")
    assert [len(scores) for scores in made.calibration.scores] == [3] * 5
    assert {"index.html", "calibration.json", "confusion.png", "reliability.png"} <= {
        p.name for p in (tmp_path / "out").iterdir()
    }
    told = " ".join(run("identify", "white", "--library", "out/library.json").stdout.split())
    assert "Sets: calibrated with 15 measurements of known materials (15 of labelled.csv)" in told


@pytest.mark.slow
def test_calibration_goes_into_the_librarys_file(run, labelled, tmp_path):
    bundled_library().write(tmp_path / "paints.json")
    result = run(
        "identify", "--calibrate", "data/labelled.csv", "--library", "paints.json", "--no-figures", "--quiet"
    )
    assert result.output == "paints.json\n"
    assert read_library(tmp_path / "paints.json").calibration is not None
    assert not (tmp_path / "labelled-calibration" / "library.json").exists()


@pytest.mark.slow
def test_labelled_measurements_judge_the_library_as_it_is(run, labelled, stranger, tmp_path):
    bundled_library().write(tmp_path / "paints.json")
    before = (tmp_path / "paints.json").read_bytes()
    with (tmp_path / "data" / "labelled.csv").open("a", encoding="utf-8") as file:
        file.write("../stranger.nc, gloss\n")
    asked = ("identify", "--labelled", "data/labelled.csv", "--library", "paints.json")
    printed = " ".join(run(*asked, "-o", "out").stdout.split())
    assert "of 15 labelled measurements the 95 % set held the true material" in printed
    assert "gloss (not in the library) 1" in printed
    assert "left unchanged" in printed
    assert (tmp_path / "paints.json").read_bytes() == before
    assert {"index.html", "labelled.json", "confusion.png", "reliability.png"} <= {
        p.name for p in (tmp_path / "out").iterdir()
    }
    assert run(*asked, "-q").stdout.startswith("data/labelled.csv: of 15 labelled measurements")


def test_labels_of_pixels(run, picture, tmp_path):
    """Two rows told rightly, a stranger, and a row that was not measured."""
    names = np.array([["white"] * 5, ["cd-back"] * 5, ["gloss"] * 5, ["white"] * 5])
    np.save(tmp_path / "names.npy", names)
    printed = " ".join(
        run("identify", "map.nc", "--labelled", "names.npy", "-o", "out", "--no-figures").stdout.split()
    )
    assert "names.npy: of 10 labelled pixels the 95 % set held the true material" in printed
    assert "of 5 labelled pixels of materials that the library has not got 5 were told as none" in printed
    record = json.loads((tmp_path / "out" / "classes.json").read_text(encoding="utf-8"))
    assert record["labelled"]["materials"] == ["white", "cd-back", "gloss"]


@pytest.mark.slow
def test_a_fit_without_its_data(run, refused, tmp_path):
    data = pbrdf.open_experiment("white").isel(geometry=slice(0, 63, 4)).assign_attrs(scale="absolute")
    pbrdf.fit(data, starts=4).save(tmp_path / "white-fit")
    (tmp_path / "white-fit" / "fit.nc").unlink()
    for source in ("white-fit", "white-fit/fit.json"):
        printed = " ".join(run("identify", source).stdout.split())
        assert "white: the only material in the 95 % set" in printed
        assert "From fitted parameters, as the data were not at hand" in printed
    assert "--gain: white-fit holds fitted parameters" in refused("identify", "white-fit", "--gain", "known")
    assert "leave --quantity out" in refused("identify", "white-fit", "--quantity", "brdf")
    assert "a model without standard errors" in refused("identify", "white-fit/model.json")
    assert "without its fit.nc" in refused("library", "add", "white", "white-fit")


def test_what_is_refused(refused, tmp_path, picture):
    assert "name the data to identify" in refused("identify")
    assert "leave white out" in refused("identify", "white", "--calibrate", "labelled.csv")
    assert "--gain 'yes': choose known or unknown" in refused("identify", "white", "--gain", "yes")
    assert "--confidence 1.5" in refused("identify", "white", "--confidence", 1.5)
    assert "--prior: the library has no material 'gloss'" in refused(
        "identify", "white", "--prior", "gloss=0.5"
    )
    assert "--prior: white=2 must be within" in refused("identify", "white", "--prior", "white=2")
    assert "--prior white: 'much' is not a number" in refused("identify", "white", "--prior", "white=much")
    assert "--angle 0" in refused("identify", "white", "--angle", 0)
    assert "--smoothing is for maps" in refused("identify", "white", "--smoothing", 2)
    assert "choose one of png, pdf, svg" in refused("identify", "white", "--figure-format", "gif")
    assert "absent.json: cannot be read" in refused("identify", "white", "--library", "absent.json")
    assert "absent.csv: there is no such file" in refused("identify", "absent.csv")
    assert "two data sets are called 'white'" in refused("identify", "white", "a/white", "-o", "out")
    assert "holds fitted parameters" in refused("identify", "map.nc", "--gain", "known")
    assert "leave it out" in refused("identify", "map.nc", "--quantity", "brdf")
    assert "white is one measurement" in refused("identify", "white", "--labelled", "labels.csv")
    assert "is of one map" in refused("identify", "map.nc", "white", "--labelled", "labels.npy")
    assert "--calibrate judges its own" in refused("identify", "--labelled", "a.csv", "--calibrate", "a.csv")
    assert "--labelled labels.npy: there is no such file" in refused(
        "identify", "map.nc", "--labelled", "labels.npy"
    )


def test_tables_of_labels_that_are_refused(refused, tmp_path):
    def table(text):
        (tmp_path / "labels.csv").write_text(text, encoding="utf-8")
        return refused("identify", "--calibrate", "labels.csv")

    assert "its columns must be file,material; they are name, paint" in table("name,paint\na,b\n")
    assert "no row below" in table("file,material\n")
    assert "line 2: file or material is missing" in table("file,material\nwhite\n")
    assert "line 3: the library has no material 'gloss'" in table("file,material\nwhite,white\nwhite,gloss\n")
    assert "line 2: absent.csv: there is no such file" in table("material,file\nwhite,absent.csv\n")
    assert "--labelled labels.csv: line 2: absent.csv" in refused("identify", "--labelled", "labels.csv")
    (tmp_path / "labels.csv").unlink()
    assert "labels.csv: cannot be read" in refused("identify", "--calibrate", "labels.csv")


@pytest.mark.slow
def test_many_wavelengths_are_a_choice(refused, run, tmp_path):
    few = pbrdf.open_experiment("white").isel(geometry=FEW * 2)
    many = few.assign_coords(wavelength=("geometry", 400.0 + 50.0 * np.arange(8)))
    pbrdf.write(many, tmp_path / "many.nc")
    text = refused("identify", "many.nc")
    assert "there are 8 wavelengths, 400 … 750 nm, and each material of the library is of one" in text
    assert "--wavelength 600" in text
    assert "--select wavelength=400:750" in text
    assert run("identify", "many.nc", "--wavelength", 450, "-q").output.startswith("many.nc: ")
    (tmp_path / "labels.csv").write_text("file,material\nmany.nc,white\n", encoding="utf-8")
    assert "there are 8 wavelengths" in refused("identify", "--calibrate", "labels.csv")


@pytest.mark.slow
def test_unfinished_maps_and_pictures_are_not_identified(refused, tmp_path):
    """A map whose units are not all done, as an interrupted `pbrdf map` leaves it; pictures of `pbrdf reduce`."""
    from pbrdf.inversion.map_store import DatasetSource, prepare_store
    from pbrdf.inversion.parameter_map import MapFit

    one = measured(bundled_library()["white"].model)
    data = one.map(
        lambda values: values.expand_dims(y=2, x=2).transpose("geometry", "y", "x"), keep_attrs=True
    )
    prepare_store(tmp_path / "half.zarr", MapFit.prepare(data), DatasetSource(data))
    assert "half.zarr: this map is not complete: 1 of 1 units are missing" in refused("identify", "half.zarr")
    pictures = xr.Dataset({"I": (("series", "y", "x"), np.ones((2, 3, 4)))})
    pictures.to_netcdf(tmp_path / "stokes.nc", engine="h5netcdf")
    text = refused("identify", "stokes.nc")
    assert "Stokes pictures, whose pixels have no geometry yet: `pbrdf map stokes.nc -g flat:…`" in text
    assert "pbrdf.map_dataset" in text


def test_what_to_measure_next(run, tmp_path):
    """One reading leaves several materials: the answer says which reading would tell them apart."""
    pbrdf.write(measured(pbrdf.load_paint("cd-back")).isel(geometry=[1]), tmp_path / "one.nc")
    printed = " ".join(run("identify", "one.nc", "--gain", "unknown", "--noise", "5%").stdout.split())
    assert "Next measurement: I, Q, U at θi" in printed
    assert "bits that are open" in printed
    without = run("identify", "one.nc", "--gain", "unknown", "--noise", "5%", "--no-next").stdout
    assert "Next measurement" not in without
    assert "Next measurement" not in run("identify", "white").stdout  # nothing to tell apart


@pytest.mark.slow
def test_what_to_measure_next_in_the_folder(run, tmp_path):
    pbrdf.write(measured(pbrdf.load_paint("cd-back")).isel(geometry=[1]), tmp_path / "one.nc")
    run("identify", "one.nc", "--gain", "unknown", "-o", "out", "-q")
    record = json.loads((tmp_path / "out" / "identification.json").read_text(encoding="utf-8"))
    best = record["next_measurement"]["geometries"][0]
    assert 0.0 < best["expected_bits"] <= record["next_measurement"]["open_bits"]
    assert (tmp_path / "out" / "next.png").stat().st_size > 10_000
