import json

import pytest

import pbrdf
from pbrdf.cli import doctor as doctor_module
from pbrdf.cli import selfcheck
from pbrdf.cli.selfcheck import Check


def test_paints_are_listed(run):
    table = run("paints").stdout
    for name, values in pbrdf.PAINTS.items():
        assert name in table
        assert f"{values[0]:.4f}" in table
    assert "Zhang" in table
    content = json.loads(run("paints", "--json").stdout)
    assert pbrdf.load_model(content["paints"]["cd-back"]) == pbrdf.load_paint("cd-back")


def test_models_are_listed(run):
    table = run("models").stdout
    assert "shadowing=v-cavity|smith|none" in table
    assert "with --free" in table
    content = json.loads(run("models", "--json").stdout)
    assert content["double-gauss"]["parameters"][0]["name"] == "sigma"
    assert "reciprocal-double-gauss" in content


@pytest.mark.slow
def test_the_doctor_finds_all_well(run):
    result = run("doctor")
    assert "Backend" in result.stdout
    assert result.stdout.count("✓") == 5
    assert "✗" not in result.stdout
    assert result.stdout.rstrip().endswith("All is well.")


def test_the_doctor_reports_a_failed_check(run, monkeypatch):
    monkeypatch.setattr(
        selfcheck, "run_checks", lambda: [Check("one", True, "ok"), Check("two", False, "bad")]
    )
    result = run("doctor", code=1)
    assert "✗ two: bad" in result.stdout
    assert "1 of 2 checks failed" in result.stderr
    assert doctor_module.BROKEN == 1


def test_a_model_that_is_wrong_fails_a_check(monkeypatch):
    class Wrong(selfcheck.DoubleGauss):
        def mueller(self, *args, **kwargs):
            return 1.001 * super().mueller(*args, **kwargs)

        def stokes(self, *args, **kwargs):
            return 1.001 * super().stokes(*args, **kwargs)

    assert all(check.passed for check in selfcheck.run_checks())
    monkeypatch.setattr(selfcheck, "DoubleGauss", Wrong)
    assert [check.passed for check in selfcheck.run_checks()] == [False, False, True, True, False]


def test_a_file_is_described(run):
    text = run("check", "white").stdout
    assert "63 geometries in 3 groups (1, 2, 3); 476 nm" in text
    assert "simulated I, Q, U, V (BRDF, 1/sr), natural light; standard uncertainties of I, Q, U, V" in text
    assert "incidence theta_i: 0° … 85°" in text
    assert "Nothing is wrong with it." in text


def test_what_is_suspicious_is_said(run, tmp_path):
    (tmp_path / "odd.csv").write_text(
        "theta_i,theta_r,brdf,dolp,colour\n10,20,0.3,1.5,red\n10,30,nan,nan,red\n"
    )
    text = run("check", "odd.csv", "--skip-invalid").stdout
    assert "warning: dolp" in text
    assert "azimuth" in text


def test_what_is_wrong_is_refused(run, tmp_path):
    (tmp_path / "bad.csv").write_text("theta_i,theta_r,brdf\n10,95,0.3\n")
    message = run("check", "bad.csv", code=2).stderr
    assert message.startswith("pbrdf: error: bad.csv does not follow the schema")
    assert "line 2" in message


@pytest.mark.slow
def test_a_file_is_converted(run, refused, tmp_path):
    assert run("convert", "white", "w.nc").stdout == "w.nc: 63 geometries\n"
    run("convert", "w.nc", "w.csv", "--select", "group=2")
    ds = pbrdf.read(tmp_path / "w.csv")
    assert set(ds["group"].values) == {2}
    assert "cannot be written; use .csv or .nc" in refused("convert", "w.nc", "w.xlsx")
    assert "there is no folder" in refused("convert", "w.nc", "nowhere/w.nc")


@pytest.mark.slow
@pytest.mark.parametrize("extension", ["png", "svg"])
def test_a_model_and_data_are_drawn(run, tmp_path, extension):
    assert run("plot", "white", "--theta-i", "50", "-o", f"m.{extension}").stdout == f"m.{extension}\n"
    run("convert", "white", "data.csv")
    run("plot", "data.csv", "--select", "group=1", "-o", f"d.{extension}")
    assert (tmp_path / f"m.{extension}").stat().st_size > 10_000
    assert (tmp_path / f"d.{extension}").stat().st_size > 10_000


@pytest.mark.slow
def test_models_data_and_fits_are_drawn_together(run, tmp_path):
    run("convert", "white", "data.csv")
    run("fit", "white", "--starts", 1, "-q", "--no-figures", "-o", "found")
    assert run("plot", "found").stdout == "found.png\n"
    for kind in ("curves", "hemisphere", "surface", "mueller"):
        sources = ["data.csv", "found", "cd-back"] if kind != "surface" else ["found"]
        assert run("plot", *sources, "--kind", kind, "-o", f"{kind}.png").stdout == f"{kind}.png\n"
        assert (tmp_path / f"{kind}.png").stat().st_size > 10_000
    run("plot", "found", "cd-back", "-o", "several.png")
    assert (tmp_path / "several.png").read_bytes() == _drawn(
        run, tmp_path, "found", "cd-back", "--kind", "curves"
    )
    run(
        "plot", "data.csv", "white", "--select", "group=1", "-o", "selected.png"
    )  # reading options are for the data


def _drawn(run, folder, *arguments):
    run("plot", *arguments, "-o", "again.png")
    return (folder / "again.png").read_bytes()


@pytest.mark.slow
def test_a_figure_is_named_after_what_it_shows(run, tmp_path):
    pbrdf.load_paint("white").to_json(tmp_path / "paint.json")
    assert run("plot", "paint.json").stdout == "paint.png\n"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nothing.json"], "nothing.json: cannot be read as a model"),
        (["nothing.csv"], "there is no such file"),
        (["white", "-o", "x.jpg"], "figures are written as .png, .pdf, .svg"),
        (["white", "-o", "nowhere/x.png"], "there is no folder nowhere"),
        (["white", "--theta-i", "90"], "must be at least 0° and below 90°"),
        (["white", "--quantity", "brdf"], "white is a model: --quantity is for files"),
        (["white", "cd-back", "--quantity", "brdf"], "white, cd-back are models: --quantity is for files"),
        (["white", "--theta-i", "95", "--kind", "surface"], "--theta-i 95: the angle must be at least 0°"),
        (["white", "nothing.csv"], "there is no such file"),
    ],
)
def test_mistakes_in_plots_are_explained(refused, arguments, message):
    assert message in refused("plot", *arguments)


def test_the_angle_of_a_model_is_not_for_data(run, refused, tmp_path):
    run("convert", "white", "data.csv")
    assert "--theta-i is for models" in refused("plot", "data.csv", "--theta-i", "20")
    assert "this is the file to draw" in refused("plot", "data.csv", "-o", "data.csv")


@pytest.mark.parametrize(
    "given", [["--starts", "1_0"], ["--starts=٣"], ["--wavelength", "55_0"], ["--seed", "１"]]
)
def test_an_option_that_is_a_number_takes_no_other_spelling(refused, given):
    assert "is not a number" in refused("fit", "data.csv", *given)


def test_control_characters_of_a_title_do_not_reach_the_terminal(run, tmp_path):
    import pbrdf

    title = "white\x1b]0;mine\x07 \x1b[2J"
    data = pbrdf.make_dataset(0.1, 0.2, 0.0, quantity="brdf", I=1.0, attrs={"title": title})
    pbrdf.write(data, tmp_path / "data.nc")
    shown = run("check", "data.nc").stdout
    assert "\x1b" not in shown
    assert shown.startswith("white\\x1b]0;mine\\x07 \\x1b[2J\n")
    assert pbrdf.read(tmp_path / "data.nc").attrs["title"] == title
