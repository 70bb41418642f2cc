"""``pbrdf calibrate``: an instrument that is not what its file says, put right with frames of known light."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from PIL import Image

from pbrdf.instruments.calibration.analyzer_calibration import standard_inputs
from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.polarimeter.instrument_files import load_instrument, save_instrument
from pbrdf.instruments.polarimeter.polarimeter import division_of_focal_plane, lcvr, measured
from pbrdf.instruments.polarimeter.retardance_sets import retardance_set
from pbrdf.instruments.virtual.miscalibration import miscalibrated

DETECTOR = Detector(bits=12, gain=2.5, read_noise=6.0, offset=50.0)
NOMINAL = lcvr(retardance_set("tetrahedron"))
SIX = lcvr(retardance_set("six_states"))
LEVEL = 3000.0
ROWS, COLUMNS = 16, 24
ANGLES = range(0, 180, 15)
NAMES = (*(f"p{a:03d}" for a in ANGLES), "left", "right")
TABLE = ["series,angle_deg,handedness", *(f"p{a:03d},{a}," for a in ANGLES), "left,,left", "right,,right"]


def shoot(folder, polarimeter, stokes, names, rng, *, detector=DETECTOR, level=LEVEL):
    """Frames SERIES_STATE.png of even light with these Stokes vectors (4, K)."""
    folder.mkdir()
    for s, name in zip(stokes.T, names, strict=True):
        signal = polarimeter.intensities(level * s[:, None, None] * np.ones((4, ROWS, COLUMNS)))
        for state, frame in zip(polarimeter.states, detector.expose(signal, rng), strict=True):
            Image.fromarray(frame).save(folder / f"{name}_{state}.png")


def random_light(count, rng):
    """Stokes vectors (4, count) of intensity 1 and any polarisation."""
    direction = rng.standard_normal((3, count))
    direction /= np.linalg.norm(direction, axis=0)
    return np.concatenate([np.ones((1, count)), direction * rng.uniform(0.2, 1.0, count)])


def summary(path):
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def ratios(path):
    """Q/I, U/I, V/I of the series of a reduction, shape (3, M)."""
    rows = summary(path / "summary.csv")
    return np.array([[float(row[n]) / float(row["I"]) for row in rows] for n in "QUV"])


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.fixture
def setup(tmp_path):
    """nominal.toml (accuracy 1 % and 5 %), inputs.csv, known/ taken with what the instrument really is."""
    save_instrument(Instrument(NOMINAL.with_accuracy(0.01, 0.05), DETECTOR), tmp_path / "nominal.toml")
    (tmp_path / "inputs.csv").write_text("\n".join(TABLE) + "\n")
    truth = miscalibrated(NOMINAL, 0.02, 0.06, np.random.default_rng(1))
    shoot(tmp_path / "known", truth, standard_inputs(12), NAMES, np.random.default_rng(2))
    return truth


CALIBRATE = ("calibrate", "known", "-p", "nominal.toml", "-i", "inputs.csv")


@pytest.mark.slow
def test_calibrated_reductions_are_right_where_nominal_ones_are_not(run, tmp_path, setup):
    """Light of any polarisation: reduced as nominal it is wrong by what the instrument's errors make of it, calibrated
    it is right within the accuracy that the inputs held out have shown, which is the true one."""
    truth = setup
    result = run(*CALIBRATE, "-o", "imager.toml")
    rng = np.random.default_rng(3)
    light = random_light(30, rng)
    shoot(tmp_path / "run", truth, light, [f"{k:02d}" for k in range(30)], rng)
    for name in ("nominal", "imager"):
        run("reduce", "run", "-p", f"{name}.toml", "-o", name, "--maps", "none", "--no-pictures", "-q")
    wrong, right = (ratios(tmp_path / name) - light[1:] for name in ("nominal", "imager"))
    # what the nominal instrument makes of the light without any noise
    seen = np.linalg.pinv(NOMINAL.analyzer) @ truth.analyzer @ light
    expected = seen[1:] / seen[0] - light[1:]
    np.testing.assert_allclose(wrong, expected, atol=0.003)
    assert rms(expected[:2]) > 0.01 and rms(expected[2]) > 0.02
    accuracy = load_instrument(tmp_path / "imager.toml").polarimeter.accuracy
    # 28 and 14 errors have an rms that is known to 13 % and 19 %
    assert rms(right[:2]) == pytest.approx(accuracy[0], rel=0.45)
    assert rms(right[2]) == pytest.approx(accuracy[1], rel=0.6)
    assert rms(right) < 0.1 * rms(wrong)
    assert "14 inputs of 4 states; 384 of 384 pixels are good" in result.stdout
    assert "Written: imager.toml, imager_inputs.csv, imager.png" in result.stdout


@pytest.mark.slow
def test_table_of_the_inputs(run, tmp_path, setup):
    """Known light and what is found; the nominal instrument's errors are those of its analyser vectors."""
    run(*CALIBRATE, "-o", "imager.toml", "-q", "--no-picture")
    assert not (tmp_path / "imager.png").exists()
    rows = {row["series"]: row for row in summary(tmp_path / "imager_inputs.csv")}
    assert set(rows) == set(NAMES) and all(row["use"] == "verified" for row in rows.values())
    seen = np.linalg.pinv(NOMINAL.analyzer) @ setup.analyzer @ standard_inputs(12)
    for k, name in enumerate(NAMES):
        for i, component in enumerate("QUV", 1):
            assert float(rows[name][f"nominal_{component}"]) == pytest.approx(seen[i, k], abs=0.02)
            known = float(rows[name][f"known_{component}"])
            assert known == pytest.approx(standard_inputs(12)[i, k], abs=1e-12)
            assert float(rows[name][f"found_{component}"]) == pytest.approx(known, abs=0.004)
    assert float(rows["left"]["found_docp"]) == pytest.approx(1.0, abs=0.004)
    assert float(rows["p030"]["found_aolp_deg"]) == pytest.approx(30.0, abs=0.2)
    # the unit of the inputs: the calibrated vectors have the nominal mean transmittance
    found = load_instrument(tmp_path / "imager.toml").polarimeter
    assert found.analyzer[:, 0].mean() == pytest.approx(0.5)
    assert float(rows["p000"]["intensity_dn"]) == pytest.approx(LEVEL, rel=0.03)


@pytest.mark.slow
def test_inputs_held_out_by_name(run, tmp_path, setup):
    """Series that only verify: with wrong light in the table they spoil the accuracy, not the vectors."""
    run(*CALIBRATE, "-o", "right.toml", "--hold-out", "p030,left", "-q")
    text = (tmp_path / "inputs.csv").read_text()
    (tmp_path / "inputs.csv").write_text(text.replace("p030,30", "p030,33").replace("left,,left", "left,0,"))
    run(*CALIBRATE, "-o", "wrong.toml", "--hold-out", "p030,left", "-q")
    right, wrong = (load_instrument(tmp_path / f"{name}.toml").polarimeter for name in ("right", "wrong"))
    np.testing.assert_allclose(wrong.analyzer, right.analyzer, rtol=0, atol=1e-12)
    assert right.accuracy[0] < 0.003 and wrong.accuracy[0] > 0.1 and wrong.accuracy[1] > 0.5
    use = {row["series"]: row["use"] for row in summary(tmp_path / "right_inputs.csv")}
    assert use["left"] == "verified" and use["right"] == "calibrated"


@pytest.mark.slow
def test_an_accuracy_that_nothing_verifies_is_not_claimed(run, tmp_path, setup):
    """Four inputs are all needed: the nominal accuracy stays, with a warning. With one circular input V is verified
    with light that has none, which is said too."""
    chosen = ["p000", "p045", "p090", "left"]
    (tmp_path / "few").mkdir()
    for path in (tmp_path / "known").iterdir():
        if path.name.rpartition("_")[0] in chosen:
            path.rename(tmp_path / "few" / path.name)
    lines = [TABLE[0], *(line for line in TABLE[1:] if line.partition(",")[0] in chosen)]
    (tmp_path / "few.csv").write_text("\n".join(lines) + "\n")
    result = run("calibrate", "few", "-p", "nominal.toml", "-i", "few.csv", "-o", "few.toml")
    assert "nothing verifies the calibration" in result.stderr
    assert load_instrument(tmp_path / "few.toml").polarimeter.accuracy == (0.01, 0.05)
    for path in (tmp_path / "known").glob("right_*"):
        path.unlink()
    for path in (tmp_path / "few").iterdir():
        path.rename(tmp_path / "known" / path.name)
    (tmp_path / "inputs.csv").write_text("\n".join(TABLE[:-1]) + "\n")
    result = run(*CALIBRATE, "-o", "one.toml", "-q")
    assert "no circular input was held out" in result.stderr


@pytest.mark.slow
def test_tables_that_cannot_be_true_are_doubted(run, tmp_path, setup):
    """Two series exchanged contradict the readings. Angles counted clockwise do not, nor does left for right: they make
    another instrument, which is said."""
    text = (tmp_path / "inputs.csv").read_text()
    (tmp_path / "inputs.csv").write_text(text.replace("p045,45", "p045,135").replace("p120,120", "p120,20"))
    assert "are series mixed up?" in run(*CALIBRATE, "-q").stderr
    clockwise = [TABLE[0], *(f"p{a:03d},{-a}," for a in ANGLES), *TABLE[-2:]]
    exchanged = [*TABLE[:-2], "left,,right", "right,,left"]
    for table in (clockwise, exchanged):
        (tmp_path / "inputs.csv").write_text("\n".join(table) + "\n")
        found = run(*CALIBRATE, "-q")
        assert "% of w_I away from the nominal ones" in found.stderr
        assert load_instrument(tmp_path / "known-calibrated.toml").polarimeter.accuracy[0] < 0.004
    (tmp_path / "inputs.csv").write_text(text)
    assert run(*CALIBRATE, "-q").stderr == ""


@pytest.mark.slow
def test_bad_pixels_and_regions(run, tmp_path, setup):
    """Half of the field is not lit evenly: only the region counts, and in it the saturated pixel does not."""
    for path in (tmp_path / "known").iterdir():
        picture = np.array(Image.open(path))
        picture[:, 12:] = np.arange(12) * 300
        if path.name == "p045_s2.png":
            picture[3, 4] = 4095
        Image.fromarray(picture).save(path)
    result = run(*CALIBRATE, "-o", "imager.toml", "--roi", "lit=0:10,0:16")
    assert "159 of 160 pixels are good at all of them (saturated 1)" in result.stdout
    found = load_instrument(tmp_path / "imager.toml").polarimeter
    scale = found.analyzer[:, 0].mean() / setup.analyzer[:, 0].mean()
    np.testing.assert_allclose(found.analyzer, scale * setup.analyzer, atol=0.003)


@pytest.mark.slow
@pytest.mark.parametrize("option", [("--grid", "4x6"), ("--per-pixel",)])
def test_maps_over_the_field(run, tmp_path, setup, option):
    """Retarders whose retardance changes over the field: the map reduces every corner right, nominal vectors do not."""
    y, x = np.mgrid[0:ROWS, 0:COLUMNS] / COLUMNS
    shift = np.deg2rad(8 * x - 6 * y)[..., None, None]
    cells = [lcvr(retardance_set("tetrahedron") + s).analyzer for s in shift.reshape(-1, 1, 1)]
    field = measured(np.array(cells).reshape(ROWS, COLUMNS, 4, 4))
    rng = np.random.default_rng(4)
    shoot(tmp_path / "field", field, standard_inputs(12), NAMES, rng)
    light = random_light(4, rng)
    shoot(tmp_path / "run", field, light, "abcd", rng)
    result = run("calibrate", "field", "-p", "nominal.toml", "-i", "inputs.csv", "-o", "map.toml", *option)
    assert f"Map of {'4 × 6' if option[0] == '--grid' else '16 × 24'} cells" in result.stdout
    assert (tmp_path / "map_analyzer.nc").exists()
    rois = [
        a
        for k, box in enumerate(("0:6,0:4", "18:24,0:4", "0:6,12:16", "18:24,12:16"))
        for a in ("--roi", f"c{k}={box}")
    ]
    errors = {}
    for name in ("nominal", "map"):
        run("reduce", "run", "-p", f"{name}.toml", "-o", name, "--maps", "none", "--no-pictures", "-q", *rois)
        rows = [row for row in summary(tmp_path / name / "summary.csv") if row["region"] != "(whole picture)"]
        found = np.array([[float(r[n]) / float(r["I"]) for n in "QUV"] for r in rows]).reshape(4, 4, 3)
        errors[name] = found - light[1:].T[:, None]
    assert rms(errors["map"]) < 0.005 and abs(errors["map"]).max() < 0.02
    assert abs(errors["nominal"]).max() > 0.04


@pytest.mark.slow
def test_settings_are_found(run, tmp_path, setup):
    """--parametric: axes, retardances, diattenuation and black level of a six-state imager, put into its file."""
    real = lcvr(
        retardance_set("six_states") + np.deg2rad([2.0, -1.5]), np.deg2rad([0.7, 44.0]), diattenuation=0.98
    )
    save_instrument(Instrument(SIX, DETECTOR), tmp_path / "six.toml")
    black = Detector(bits=12, gain=2.5, read_noise=6.0, offset=53.0)
    rng = np.random.default_rng(5)
    inputs = np.concatenate([standard_inputs(12), np.zeros((4, 1)), 0.5 * standard_inputs(1)[:, :1]], axis=1)
    shoot(tmp_path / "six", real, inputs, [*NAMES, "shut", "half"], rng, detector=black)
    table = [f"{TABLE[0]},intensity", *(f"{line}," for line in TABLE[1:]), "shut,,,0", "half,0,,0.5"]
    (tmp_path / "six.csv").write_text("\n".join(table) + "\n")
    result = run("calibrate", "six", "-p", "six.toml", "-i", "six.csv", "-o", "fitted.toml", "--parametric")
    assert "held: fixed" in result.stdout
    found = load_instrument(tmp_path / "fitted.toml")
    assert found.polarimeter.details["kind"] == "lcvr" and not (tmp_path / "fitted_analyzer.csv").exists()
    details = found.polarimeter.details
    np.testing.assert_allclose(details["axes"], [0.7, 44.0], atol=0.05)
    expected = np.rad2deg(retardance_set("six_states")) + np.array([2.0, -1.5])
    np.testing.assert_allclose(details["retardances"], expected, atol=0.2)
    assert details["diattenuation"] == pytest.approx(0.98, abs=0.002)
    assert found.detector.offset == pytest.approx(53.0, abs=1.5)
    light = random_light(5, rng)
    shoot(tmp_path / "run", real, light, "abcde", rng, detector=black)
    run("reduce", "run", "-p", "fitted.toml", "-o", "out", "--maps", "none", "--no-pictures", "-q")
    assert abs(ratios(tmp_path / "out") - light[1:]).max() < 0.006
    # the same data without a model of the instrument
    run("calibrate", "six", "-p", "six.toml", "-i", "six.csv", "-o", "vectors.toml", "-q")
    vectors = load_instrument(tmp_path / "vectors.toml").polarimeter
    np.testing.assert_allclose(vectors.analyzer, found.polarimeter.analyzer, atol=0.006)


@pytest.mark.slow
def test_a_mosaic_with_a_flat_field_that_is_not_natural(run, tmp_path):
    """A flat field of partly polarised light makes every reduction wrong. A calibration made with it takes that back,
    and is used in the same way as it was made."""
    nominal = division_of_focal_plane(np.deg2rad([[90.0, 45.0], [135.0, 0.0]]))
    real = division_of_focal_plane(np.deg2rad([[91.0, 44.5], [134.0, 0.5]]), diattenuation=0.97)
    rng = np.random.default_rng(6)
    response = rng.uniform(0.8, 1.2, (2 * ROWS, 2 * COLUMNS))

    def picture(s):
        frame = np.empty((2 * ROWS, 2 * COLUMNS))
        for state, (y, x) in enumerate(((0, 0), (0, 1), (1, 0), (1, 1))):
            frame[y::2, x::2] = real.analyzer[state] @ s
        return DETECTOR.expose(frame * response, rng)

    flat = np.mean([picture(np.array([6000.0, 300.0, -150.0, 0.0])) for _ in range(100)], axis=0)
    Image.fromarray(np.rint(flat).astype(np.uint16)).save(tmp_path / "flat.png")
    frames = {"flat_field": "flat.png", "flat_exposures": 100}
    instrument = Instrument(nominal, DETECTOR, frames=frames, folder=tmp_path)
    save_instrument(instrument, tmp_path / "mosaic.toml")
    (tmp_path / "known").mkdir()
    for s, name in zip(standard_inputs(12, circular=False).T, NAMES[:12], strict=True):
        Image.fromarray(picture(LEVEL * s)).save(tmp_path / "known" / f"{name}.png")
    (tmp_path / "linear.csv").write_text("\n".join(TABLE[:13]) + "\n")
    run("calibrate", "known", "-p", "mosaic.toml", "-i", "linear.csv", "-o", "right.toml", "-q")
    light = random_light(4, rng)
    (tmp_path / "run").mkdir()
    for s, name in zip(light.T, "abcd", strict=True):
        Image.fromarray(picture(LEVEL * s)).save(tmp_path / "run" / f"{name}.png")
    errors = {}
    for name in ("mosaic", "right"):
        run("reduce", "run", "-p", f"{name}.toml", "-o", name, "--maps", "none", "--no-pictures", "-q")
        errors[name] = ratios(tmp_path / name)[:2] - light[1:3]
    assert rms(errors["mosaic"]) > 0.02
    assert abs(errors["right"]).max() < 0.004
    again = load_instrument(tmp_path / "right.toml")
    assert again.frames["flat_transmittance"] == [0.5] * 4
    # a second calibration starts from the first and finds it right
    run("calibrate", "known", "-p", "right.toml", "-i", "linear.csv", "-o", "again.toml", "-q")
    twice = load_instrument(tmp_path / "again.toml").polarimeter
    np.testing.assert_allclose(twice.analyzer, again.polarimeter.analyzer, atol=1e-9)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("-i", "none.csv"), "none.csv: cannot be read"),
        (("-p", "none.toml"), "none.toml: cannot be read"),
        (("--grid", "8"), "--grid '8': give rows and columns of cells, for example 8x8"),
        (("--grid", "40x4"), "cannot be divided into 40 × 4 cells"),
        (("--grid", "2x2", "--per-pixel"), "--grid and --per-pixel exclude each other"),
        (("--grid", "2x2", "--parametric"), "leave --grid and --per-pixel out"),
        (("--gain", "each"), "--gain and --fix belong to --parametric"),
        (("--parametric", "--gain", "odd"), "--gain 'odd': choose common or each"),
        (("--parametric", "--fix", "axle"), "no setting is called 'axle'; the settings are gain"),
        (("--components", "QU"), "--components 'QU': choose IQUV or IQU"),
        (("--hold-out", "p030,p031"), "held out: there is no series 'p031'; there are left, p000"),
        (("--hold-out", "left,right"), "without the inputs held out, the others do not determine V"),
        (("-i", "few.csv"), "the input table has no row for 'right'"),
        (("-i", "linear.csv"), "the 14 input states do not determine V: add inputs that differ in it"),
        (("-o", "imager.txt"), "--output imager.txt: the extension must be .toml"),
        (("-o", "nominal.toml"), "that is the nominal instrument; choose another name"),
        (("-o", "nowhere/imager.toml"), "there is no folder nowhere"),
        (("--dark-level", "5000"), "no pixel of the calibration frames is good"),
        (("--roi", "out=0:100,0:5"), "reaches beyond the picture"),
        (("-p", "eight.toml"), "a pixel reads"),
    ],
)
def test_mistakes_are_one_line_and_leave_nothing(refused, tmp_path, setup, options, message):
    (tmp_path / "few.csv").write_text("\n".join(TABLE[:-1]) + "\n")
    linear = [*TABLE[:13], "left,17,", "right,33,"]
    (tmp_path / "linear.csv").write_text("\n".join(linear) + "\n")
    eight = Instrument(NOMINAL, Detector(bits=8))
    save_instrument(eight, tmp_path / "eight.toml")
    arguments = ["calibrate", "known", *options]
    for option, default in (("-p", "nominal.toml"), ("-i", "inputs.csv")):
        if option not in options:
            arguments += [option, default]
    assert message in refused(*arguments)


def test_a_broken_picture_leaves_nothing(refused, tmp_path, setup):
    broken = tmp_path / "known" / "p045_s2.png"
    broken.write_bytes(broken.read_bytes()[:-200])
    assert "p045_s2.png: cannot be read as a picture" in refused(*CALIBRATE, "-o", "imager.toml")


def test_a_polarimeter_described(run):
    """The paper's imager in numbers: √3, √20 and 10, accuracy and detector; a linear camera is said to be one."""
    shown = run("polarimeter", "paper").stdout
    assert "4 states, measures I, Q, U, V" in shown
    assert "1.732" in shown and "4.472" in shown
    assert "linear 1.0 %, circular 5.0 %" in shown and "8 bits" in shown
    shown = run("polarimeter", "sony_imx250mzr").stdout
    assert "measures I, Q, U\n" in shown and "1.414" in shown and "3-dimensional" in shown


def test_best_retardances_within_limits(run, tmp_path):
    """Two retarders of 0 … 180° reach a variance of 12, not 10 (Peinado et al., half of the Poincaré sphere)."""
    shown = run("polarimeter", "--search", 4, "--limits", "0:180", "--starts", 8, "-o", "best.toml").stdout
    assert "2.484" in shown and "12 " in shown and "Written: best.toml" in shown
    table = np.array(load_instrument(tmp_path / "best.toml").polarimeter.details["retardances"])
    assert table.shape == (4, 2) and table.min() >= 0.0 and table.max() <= 180.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "give an instrument, or --search"),
        (("paper", "--search", 4), "give an instrument, or --search"),
        (("paper", "-o", "x.toml"), "--output belongs to --search"),
        (("--search", 4, "--limits", "180"), "--limits '180': give LEAST:LARGEST"),
        (("--search", 4, "-o", "x.csv"), "the extension must be .toml"),
        (("--search", 4, "--axes", "0", "--starts", 2), "do not measure the whole Stokes vector"),
        (("papers",), "there is no such file, and no built-in instrument"),
    ],
)
def test_mistakes_about_a_polarimeter(refused, arguments, message):
    assert message in refused("polarimeter", *arguments)
