"""``pbrdf render``."""

import json
import math

import numpy as np
import pytest

import pbrdf

pytest.importorskip("mitsuba", reason="rendering needs mitsuba: pip install 'mitsuba>=3.9'")

SMALL = ("--size", "24x16", "--spp", "32", "--quiet")
PAINT = {
    "model": "double-gauss",
    "parameters": {"sigma": 0.1, "n": 1.6, "a": 0.3, "k": 1.1, "b": 0.2, "t": 0.6},
}


@pytest.fixture
def paint(tmp_path):
    file = tmp_path / "paint.json"
    file.write_text(json.dumps(PAINT))
    return file.name


@pytest.mark.slow
def test_a_folder_holds_the_layers_and_the_pictures(run, tmp_path, paint):
    result = run("render", paint, *SMALL, "--polarizer", 90, "-o", "out")
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"stokes.exr", "stokes.png", "s0.png", "dolp.png", "aolp.png", "polarizer_90.png"}
    assert set(result.stdout.split("\n")[1:-1]) == {f"out/{name}" for name in names}
    assert "Standard error of S0" in result.stdout
    assert result.stderr == ""
    from pbrdf.rendering.picture import read_exr

    picture = read_exr(tmp_path / "out" / "stokes.exr")
    assert picture.shape == (16, 24)
    assert np.isfinite(picture.stokes).all()
    assert picture.attrs["models"] == "paint.json"
    assert picture.attrs["light"] == "sky"
    assert 0.0 < np.nanmax(picture.dolp) <= 1.0


@pytest.mark.slow
def test_one_file_has_one_figure_beside_it(run, tmp_path, paint):
    run("render", paint, paint, "--scene", "plate", "--light", "point", *SMALL, "-o", "row.exr")
    assert {path.name for path in tmp_path.iterdir()} == {"row.exr", "row.png", paint}


@pytest.mark.slow
def test_the_folder_of_a_fit_stands_for_its_model(run, tmp_path, paint):
    (tmp_path / "run").mkdir()
    (tmp_path / paint).rename(tmp_path / "run" / "model.json")
    run("render", "run", "--light", "constant", *SMALL, "-o", "fit.exr")
    assert (tmp_path / "fit.exr").is_file()


@pytest.mark.slow
def test_paints_on_a_cameras_scale_are_told(run):
    result = run("render", "white", "--light", "point", *SMALL)
    assert "white reflects 1.78 of the light it gets" in result.stderr
    assert "render white-scene, or give --albedo" in result.stderr
    assert "sphere-render/stokes.exr" in result.stdout
    for right in (("white-scene",), ("white", "--albedo", 0.6)):
        assert "reflects" not in run("render", *right, "--light", "point", *SMALL).stderr


@pytest.mark.slow
def test_the_light_comes_from_where_it_is_said_to(run, tmp_path, paint):
    """A lamp at azimuth 0° stands on the right of the picture: there the ball is bright, and on its left dark."""
    from pbrdf.rendering.picture import read_exr

    options = ("--light", "point", "--sun-zenith", 80, "--size", "40x40", "--spp", 16, "--quiet")
    brighter = {}
    for azimuth in (0, 180):
        run("render", paint, *options, "--sun-azimuth", azimuth, "-o", "a.exr")
        row = read_exr(tmp_path / "a.exr").stokes[0, 18:22]
        brighter[azimuth] = (
            row[:, 25:29].mean() > 3.0 * row[:, 11:15].mean(),
            row[:, 11:15].mean() > 3.0 * row[:, 25:29].mean(),
        )
    assert brighter == {0: (True, False), 180: (False, True)}


@pytest.mark.slow
def test_a_lamp_may_stand_behind_a_polariser_and_a_retarder(run, tmp_path, paint):
    """A panel, lit and seen at 42°, mirrors left circular light as right circular, V < 0, and less of light in the
    plane of incidence than of light across it."""
    from pbrdf.rendering.picture import read_exr

    options = ("--scene", "plate", "--light", "point", *SMALL, "-o", "a.exr")
    middle = {}
    for name, arguments in {
        "left": ("--lamp-polarizer", 0, "--lamp-retarder", "-45,90"),
        "across": ("--lamp-polarizer", 0),
        "along": ("--lamp-polarizer", 90),
    }.items():
        run("render", paint, *options, *arguments)
        picture = read_exr(tmp_path / "a.exr")
        middle[name] = picture.stokes[:, 7:9, 11:13].mean((1, 2))
    assert "polariser at 90 deg" in picture.attrs["before the lamp"]
    assert middle["left"][3] < -0.1 * middle["left"][0]
    assert middle["along"][0] < 0.7 * middle["across"][0]
    assert middle["across"][1] > 0.5 * middle["across"][0]


@pytest.mark.slow
def test_a_scene_file_is_rendered_in_its_own_size(run, tmp_path, paint):
    (tmp_path / "scene.xml").write_text(
        """<scene version="3.0.0">
        <sensor type="perspective">
        <transform name="to_world"><lookat origin="0,-3,0" target="0,0,0" up="0,0,1"/></transform>
        <film type="hdrfilm"><integer name="width" value="9"/><integer name="height" value="7"/>
        <string name="pixel_format" value="luminance"/></film></sensor>
        <shape type="sphere"><bsdf type="diffuse" id="paint"/></shape><emitter type="constant"/></scene>"""
    )
    run("render", paint, "--scene", "scene.xml", "--spp", 16, "--quiet", "-o", "own.exr")
    from pbrdf.rendering.picture import read_exr

    assert read_exr(tmp_path / "own.exr").shape == (7, 9)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "name at least one model"),
        (("nothing.json",), "nothing.json: cannot be read as a model"),
        (("PAINT", "--size", "24"), "--size '24': give WIDTHxHEIGHT"),
        (("PAINT", "--size", "0x24"), "--size 0x24: width and height"),
        (("PAINT", "--scene", "teapot"), "choose sphere, plate, fender"),
        (("PAINT", "--scene", "car"), "it shows a fender, and is called so"),
        (("PAINT", "--scene", "missing.xml"), "missing.xml"),
        (("PAINT", "--light", "moon"), "choose one of point, area"),
        (("PAINT", "--light", "envmap:missing.exr"), "there is no file missing.exr"),
        (("PAINT", "--light", "point", "--max-dolp", "0.5"), "--max-dolp is for --light sky"),
        (("PAINT", "--light", "constant", "--sun-zenith", "30"), "constant has no direction"),
        (("PAINT", "--scene", "a.xml", "--light", "sky"), "brings its own lights: leave --light out"),
        (("PAINT", "--polarizer", "nan"), "--polarizer: give an angle"),
        (("PAINT", "--lamp-polarizer", "0"), "--lamp-polarizer is for --light point or area"),
        (("PAINT", "--light", "area", "--lamp-polarizer", "inf"), "--lamp-polarizer: give an angle"),
        (("PAINT", "--light", "area", "--lamp-retarder", "0,90"), "give --lamp-polarizer too"),
        (
            ("PAINT", "--light", "area", "--lamp-polarizer", "0", "--lamp-retarder", "45"),
            "--lamp-retarder 45: give the angle of its fast axis and its retardance",
        ),
        (
            ("PAINT", "--scene", "a.xml", "--lamp-polarizer", "0"),
            "its own lights: leave --lamp-polarizer out",
        ),
        (("PAINT", "--variant", "llvm_ad_rgb"), "only these carry polarisation"),
        (("PAINT", "--depth", "0"), "use 1 or more"),
        (("PAINT", "-o", "missing/out.exr"), "there is no folder missing"),
        (("PAINT", "-o", "PAINT"), "choose another folder with --output"),
        (("PAINT",) * 13, "1 to 12 models, not 13"),
    ],
)
def test_what_cannot_be_rendered_is_one_line(refused, paint, arguments, message):
    assert message in refused("render", *(paint if a == "PAINT" else a for a in arguments))


@pytest.mark.slow
def test_a_map_of_parameters_covers_the_surface(run, tmp_path):
    """A model whose parameters are pictures: the plugin spreads them over the surface."""
    maps = {**PAINT, "parameters": {**PAINT["parameters"], "a": [[0.02, 0.02], [0.6, 0.6]]}}
    (tmp_path / "maps.json").write_text(json.dumps(maps))
    run("render", "maps.json", "--scene", "plate", "--light", "constant", *SMALL, "-o", "maps.exr")
    from pbrdf.rendering.picture import read_exr

    column = read_exr(tmp_path / "maps.exr").stokes[0, :, 12]
    on_panel = column[4:12]
    assert math.isfinite(on_panel.sum())
    assert on_panel.max() > 3.0 * on_panel.min()


@pytest.mark.slow
def test_three_wavelengths_make_a_picture_in_colour(run, tmp_path):
    """Paints that reflect blue, green and red light more and more, under a sky whose air scatters blue most."""
    from pbrdf.rendering.picture import read_exr

    for nm, a in ((450, 0.1), (550, 0.2), (650, 0.4)):
        content = {**PAINT, "parameters": {**PAINT["parameters"], "a": a, "b": 0.1}}
        (tmp_path / f"{nm}.json").write_text(json.dumps(content))
    models = ("450.json", "550.json", "650.json")
    run("render", *models, *SMALL, "--wavelength", "450,550,650", "-o", "colour")
    folder = tmp_path / "colour"
    pictures = {nm: read_exr(folder / f"stokes_{nm}.exr") for nm in (450, 550, 650)}
    assert {p.name for p in folder.glob("*.png")} == {
        "stokes_450.png",
        "stokes_550.png",
        "stokes_650.png",
        "rgb.png",
    }
    assert [float(p.attrs["wavelength"]) for p in pictures.values()] == [450.0, 550.0, 650.0]
    top, middle = (
        [float(p.stokes[0][where].mean()) for p in pictures.values()]
        for where in (np.s_[0], np.s_[6:10, 9:15])
    )
    # near the horizon the light that is scattered most is weakened most on its way
    assert top[0] < 0.9 * top[1] < 0.9 * top[2]
    assert middle[0] < middle[2]
    # at 550 nm the sky is the one without a wavelength
    run("render", "550.json", *SMALL, "-o", "plain.exr")
    np.testing.assert_allclose(
        read_exr(tmp_path / "plain.exr").stokes[0][0], pictures[550].stokes[0][0], rtol=1e-4
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--wavelength", "450,550"), "give one in nm, or three different ones"),
        (("--wavelength", "450,450,650"), "three different ones"),
        (("--wavelength", "blue"), "not a number"),
        (("--wavelength", "450,550,650"), "each object needs 3 models, one for each wavelength"),
        (("PAINT", "PAINT", "--wavelength", "450,550,650", "-o", "x.exr"), "several files; give a folder"),
    ],
)
def test_wavelengths_that_do_not_fit_are_refused(refused, paint, arguments, message):
    assert message in refused("render", paint, *(paint if a == "PAINT" else a for a in arguments))


@pytest.fixture(scope="module")
def fit_of_colours(tmp_path_factory):
    """Folder of a fit at 450, 550 and 650 nm, whose amplitude is free and whose index is held at each."""
    paint = pbrdf.load_paint("white")
    theta_r = np.tile(np.deg2rad(np.arange(0.0, 80.0, 8.0)), 3)
    nm = np.repeat([450.0, 550.0, 650.0], 10)
    stokes = np.asarray(paint.stokes(0.6, theta_r, 0.0)) * (nm / 550.0)[:, None]
    ds = pbrdf.make_dataset(
        0.6, theta_r, 0.0, quantity="brdf", I=stokes[:, 0], Q=stokes[:, 1], U=stokes[:, 2], wavelength=nm
    )
    held = {name: value for name, value in paint.values.items() if name != "a"}
    held["n"] = {w: paint.values["n"] + (550.0 - w) / 1e4 for w in (450.0, 550.0, 650.0)}
    folder = tmp_path_factory.mktemp("fits") / "f"
    pbrdf.fit(ds, fix=held, split={"a": "wavelength"}, starts=2).save(folder)
    return folder


@pytest.mark.slow
def test_a_fit_with_parameters_of_each_wavelength_paints_in_colour(fit_of_colours):
    from pbrdf.cli.wavelengths import painted_with
    from pbrdf.errors import PbrdfError

    paint = pbrdf.load_paint("white")
    source = str(fit_of_colours)
    ((name, models),) = painted_with([source], [450.0, 550.0, 650.0])
    assert name == source
    np.testing.assert_allclose(
        [m.values["a"] / paint.values["a"] for m in models], [450 / 550, 1.0, 650 / 550], rtol=0.02
    )
    np.testing.assert_allclose(
        [m.values["n"] - paint.values["n"] for m in models], [0.01, 0.0, -0.01], atol=1e-9
    )
    with pytest.raises(PbrdfError, match="has parameters at 450, 550, 650 nm"):
        painted_with([source], [470.0])


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    [
        ("render", "FIT", "-o", "r"),
        ("simulate", "FIT", "--theta-i", "30", "-o", "s.csv"),
        ("export", "FIT", "-o", "e.pbsdf"),
        ("export", "FIT", "-o", "e.binary"),
        ("measure", "FIT", "-o", "m"),
        ("plan", "FIT", "-o", "p"),
        ("plot", "FIT", "--kind", "curves"),
    ],
)
def test_no_command_takes_the_first_wavelength_of_a_fit_for_all(refused, fit_of_colours, arguments):
    command, _, *rest = arguments
    assert (
        "this fit has a model of each of 3 wavelengths, 450, 550, 650 nm: choose one with --wavelength"
        in (refused(command, str(fit_of_colours), *rest))
    )


@pytest.mark.slow
def test_a_command_takes_the_wavelength_of_a_fit_that_is_asked_for(run, tmp_path, fit_of_colours):
    where = ("--theta-i", "30", "--theta-r", "40", "--phi", "10")
    run("simulate", str(fit_of_colours), "--wavelength", "650", *where, "--mueller", "-o", "s.csv")
    run("export", str(fit_of_colours), "--wavelength", "650", "--wavelength", "450", *where, "-o", "e.csv")
    alone, both = pbrdf.read(tmp_path / "s.csv"), pbrdf.read(tmp_path / "e.csv")
    assert both.wavelength.values.tolist() == [650.0, 450.0]
    f00 = both["mueller"].values[:, 0, 0]
    assert f00[0] == alone["mueller"].values[0, 0, 0] > 1.2 * f00[1]


def test_an_albedo_is_of_one_wavelength(refused):
    colours = ("white", "white", "white", "--wavelength", "450,550,650", "--albedo", 0.6)
    assert "--albedo would make every colour alike" in refused("render", *colours)
    assert "give a share above 0" in refused("render", "white", "--albedo", 2)
