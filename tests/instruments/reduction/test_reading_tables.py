"""Tables of readings behind an analyser become Stokes parameters with covariance, and say what they cannot tell.

The readings of these tests come from Jones vectors, not from the analyser vectors of the package. Convention in words:
fields turn as e^{+iωt}; a retarder's fast component leads, its phase is larger by the retardance; V = 2 Im(E_p E_s*) is
positive for light that turns from p towards s, anticlockwise for the receiver who looks into it: left circular.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import pbrdf
from pbrdf.data.paints import load_paint, open_experiment
from pbrdf.errors import DataError
from pbrdf.instruments.reduction import reading_tables
from pbrdf.instruments.reduction.reading_columns import holds_readings

RNG = np.random.default_rng(7)


def coherency(stokes):
    """<E E†> of (E_p, E_s)."""
    i, q, u, v = stokes
    # E_p E_s* has the real part U/2 and the imaginary part V/2
    return 0.5 * np.array([[i + q, u + 1j * v], [u - 1j * v, i - q]])


def turned(angle):
    """(E_p, E_s) to components along and across an axis at `angle` from p towards s, radians."""
    return np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])


def reading(stokes, polarizer, retarder=None, retardance=0.0):
    """What a detector reads behind a perfect polariser, perhaps with a retarder before it; degrees."""
    jones = np.eye(2)
    if retarder is not None:
        axes = turned(np.deg2rad(retarder))
        jones = axes.T @ np.diag(np.exp([1j * np.deg2rad(retardance), 0.0])) @ axes
    row = turned(np.deg2rad(polarizer))[0] @ jones
    return float((row @ coherency(stokes) @ row.conj()).real)


def circular(stokes, left):
    """What passes an analyser of left or right circular light."""
    field = np.array([1.0, -1j if left else 1j]) / np.sqrt(2.0)  # E_p E_s* = ±i/2
    return float((field.conj() @ coherency(stokes) @ field).real)


STOKES = np.array([[1.0, 0.3, -0.2, 0.1], [2.0, -0.6, 0.4, -0.5], [0.5, 0.05, 0.1, 0.2]])
VIEWS = (10.0, 20.0, 30.0)


def test_the_oracle_itself():
    """Malus, and left circular light passes what is called left: V > 0."""
    assert reading([1, 1, 0, 0], 30.0) == pytest.approx(np.cos(np.deg2rad(30.0)) ** 2)
    assert circular([1, 0, 0, 1], left=True) == pytest.approx(1.0)
    assert circular([1, 0, 0, 1], left=False) == pytest.approx(0.0)


def wide(states, *, header="", extra=("", ""), stokes=STOKES):
    """A table with a column for each state: names with functions of the Stokes vector."""
    lines = [*header.splitlines(), f"theta_i,theta_r,phi{extra[0]},{','.join(states)}"]
    for s, view in zip(stokes, VIEWS, strict=False):
        cells = ",".join(repr(value(s) if callable(value) else value) for value in states.values())
        lines.append(f"40,{view},15{extra[1]},{cells}")
    return "\n".join(lines) + "\n"


def linear(names, angles=(0, 45, 90, 135)):
    return {name: (lambda s, a=angle: reading(s, a)) for name, angle in zip(names, angles, strict=True)}


@pytest.fixture
def table(tmp_path):
    def written(text, name="readings.csv"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return written


def stokes_of(ds, names="IQU"):
    return np.stack([ds[name].values for name in names], axis=1)


def said(ds):
    return " | ".join(ds.attrs.get("assumptions", ()))


# --- names --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "names",
    [
        "I0 I45 I90 I135",
        "I_0 I_45 I_90 I_135",
        "I(0°) I(45°) I(90°) I(135°)",
        "I[0] I[45] I[90] I[135]",
        "0deg 45deg 90deg 135deg",
        "0 45 90 135",
        "0° 45° 90° 135°",
        "L0 L45 L90 L135",
        "P0 P45 P90 P135",
        "S0 S45 S90 S135",
        "DN_0 DN_45 DN_90 DN_135",
        "V_0_mV V_45_mV V_90_mV V_135_mV",
        "pd0 pd45 pd90 pd-45",
        "I-0 I-45 I-90 I-135",
        "I0 I45 I90 I-45",
        "I0 Ip45 I90 Im45",
        "signal_0 signal_+45 signal_90 signal_-45",
        "I_H I_P I_V I_M",
        "IH ID IV IA",
        "H D V A",
        "I_p I_45 I_s I_135",
        "I_TM I_45 I_TE I_135",
        "pol_0 pol_45 pol_90 pol_135",
        "I₀ I₄₅ I₉₀ I₁₃₅",
        "analyzer_0 analyzer_45 analyzer_90 analyzer_135",
        "i0_deg i45_deg i90_deg i135_deg",
        "I135 I90 I45 I180",
        "I_0deg_mean I_45deg_mean I_90deg_mean I_135deg_mean",
        "I_x I_45 I_y I_135",
        "signal@0 signal@45 signal@90 signal@135",
        "I_000 I_045 I_090 I_135",
        "Intensity_(0_deg)_[a.u.] Intensity_(45_deg)_[a.u.] Intensity_(90_deg)_[a.u.] Intensity_(135_deg)_[a.u.]",
        "I∥ I45 I⊥ I135",
    ],
)
def test_names_of_linear_states(table, names):
    angles = (135, 90, 45, 180) if names.startswith("I135") else (0, 45, 90, 135)
    ds = pbrdf.read(table(wide(linear(names.split(), angles))))
    assert_allclose(stokes_of(ds), STOKES[:, :3], atol=1e-12)
    assert "V" not in ds
    assert_allclose(np.rad2deg(ds["theta_r"]), VIEWS)
    assert ds.attrs["quantity"] == "dn"
    assert (ds.attrs.get("scale") == "arbitrary") != names.startswith("DN")
    assert "contradict" not in said(ds)


@pytest.mark.parametrize(("right", "left"), [("I_R", "I_L"), ("I_RCP", "I_LCP"), ("Irhc", "Ilhc")])
def test_six_named_states(table, right, left):
    states = linear(["I_H", "I_P", "I_V", "I_M"])
    states |= {right: lambda s: circular(s, left=False), left: lambda s: circular(s, left=True)}
    path = table(wide(states))
    ds = pbrdf.read(path)
    assert_allclose(stokes_of(ds, "IQUV"), STOKES, atol=1e-12)
    assert "right circular light was assumed to turn clockwise for the receiver" in said(ds)
    other = pbrdf.read(path, analyzer={"circular": "source"})
    assert_allclose(other["V"], -STOKES[:, 3], atol=1e-12)
    assert "right circular" not in said(other)


def test_a_quarter_wave_plate_that_turns_before_a_fixed_polariser(table):
    angles = (0.0, 22.5, 45.0, 67.5, 112.5)
    states = {f"qwp_{a:g}": (lambda s, a=a: reading(s, 0.0, a, 90.0)) for a in angles}
    ds = pbrdf.read(table(wide(states)))
    assert_allclose(stokes_of(ds, "IQUV"), STOKES, atol=1e-12)
    assert "behind the retarder was assumed to stand at 0" in said(ds)
    vertical = {f"qwp_{a:g}": (lambda s, a=a: reading(s, 90.0, a, 90.0)) for a in angles}
    ds = pbrdf.read(table(wide(vertical, header="# analyzer_polarizer: 90")))
    assert_allclose(stokes_of(ds, "IQUV"), STOKES, atol=1e-12)
    assert "behind the retarder was assumed" not in said(ds)


def test_any_retarder_in_the_names(table):
    sets = [(0, 0, 127), (0, 30, 127), (45, 30, 127), (90, 70, 127), (20, 100, 60)]
    states = {f"I_P{p}_R{r}_D{d}": (lambda s, p=p, r=r, d=d: reading(s, p, r, d)) for p, r, d in sets}
    assert_allclose(stokes_of(pbrdf.read(table(wide(states))), "IQUV"), STOKES, atol=1e-12)


def test_the_classic_four_readings(table):
    """I(θ, φ): polariser at θ behind a retarder of φ with its fast axis at 0; I(45, 90) = (I − V)/2."""
    header = "theta_i;theta_r;phi;I(0,0);I(45,0);I(90,0);I(45,90)\n"
    rows = "".join(
        f"40;{view};15;{reading(s, 0)};{reading(s, 45)};{reading(s, 90)};{(s[0] - s[3]) / 2}\n"
        for s, view in zip(STOKES, VIEWS, strict=True)
    )
    assert_allclose(stokes_of(pbrdf.read(table(header + rows)), "IQUV"), STOKES, atol=1e-12)


def test_states_that_the_header_names(table):
    header = (
        "# analyzer_states: A = polarizer 0; B = polarizer 60; C = polarizer 120; D = retarder 45 90, polarizer 0; "
        "E = 0.5 0 0 -0.5"
    )
    states = linear("ABC", (0, 60, 120)) | {
        "D": lambda s: reading(s, 0.0, 45.0, 90.0),
        "E": lambda s: float(0.5 * (s[0] - s[3])),
    }
    ds = pbrdf.read(table(wide(states, header=header)))
    assert_allclose(stokes_of(ds, "IQUV"), STOKES, atol=1e-12)
    assert not any("states" in key for key in ds.attrs)


@pytest.mark.parametrize("kind", ["csv", "toml"])
def test_states_of_a_file_of_an_instrument(table, tmp_path, kind):
    """Vectors in the instrument's axes, x turned from p by the file's reference angle."""
    angles = np.array([10.0, 50.0, 95.0])
    if kind == "toml":
        (tmp_path / "own.toml").write_text(
            "[polarimeter]\nkind = 'rotating_polarizer'\nangles = [10, 50, 95]\nstates = ['a', 'b', 'c']\n"
            "reference_angle = 25\n"
        )
        seen = angles + 25.0
    else:
        rows = [
            f"{n},0.5,{np.cos(2 * a) / 2},{np.sin(2 * a) / 2},0"
            for n, a in zip("abc", np.deg2rad(angles), strict=True)
        ]
        (tmp_path / "own.csv").write_text("state,w_I,w_Q,w_U,w_V\n" + "\n".join(rows) + "\n")
        seen = angles
    text = wide(linear(["I_a", "I_b", "I_c"], seen), header=f"# analyser_states: own.{kind}")
    assert_allclose(stokes_of(pbrdf.read(table(text))), STOKES[:, :3], atol=1e-9)


def test_states_of_an_instrument_that_are_called_as_stokes_parameters_often_are(table, tmp_path):
    """s1 … s4 of a tetrahedral set of retarders; the example of docs/instruments.md."""
    imager = pbrdf.lcvr(pbrdf.retardance_set("tetrahedron"))
    (tmp_path / "own.toml").write_text("[polarimeter]\nkind = 'lcvr'\nset = 'tetrahedron'\n")
    values = dict(zip(imager.states, imager.analyzer, strict=True))
    states = {name: (lambda s, w=w: float(w @ s)) for name, w in values.items()}
    assert list(states) == ["s1", "s2", "s3", "s4"]
    ds = pbrdf.read(table(wide(states, header="# analyzer_states: own.toml")))
    assert_allclose(stokes_of(ds, "IQUV"), STOKES, atol=1e-12)


# --- where the angles count from ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("header", "angle_from_p"),
    [
        ("# analyzer_zero: p", lambda a: a),
        ("# analyzer_zero: s", lambda a: a + 90.0),
        ("# stokes: s-p", lambda a: a + 90.0),
        ("# analyzer_zero: 12.5", lambda a: a + 12.5),
        ("# analyzer_zero: p\n# analyzer_sense: clockwise", lambda a: -a),
        ("# analyzer_zero: s\n# analyzer_sense: clockwise", lambda a: 90.0 - a),
    ],
)
def test_where_the_angle_counts_from(table, header, angle_from_p):
    names, angles = ("I0", "I60", "I120"), (0.0, 60.0, 120.0)
    text = wide(linear(names, [angle_from_p(a) for a in angles]), header=header)
    ds = pbrdf.read(table(text))
    assert_allclose(stokes_of(ds), STOKES[:, :3], atol=1e-12)
    assert "analyser's angle 0" not in said(ds)


def test_an_unstated_zero_is_said(table):
    assert "analyser's angle 0 (H) lies; p was assumed" in said(
        pbrdf.read(table(wide(linear(["I0", "I45", "I90"], (0, 45, 90)))))
    )


def test_s_and_p_need_no_zero_and_leave_u_open(table):
    ds = pbrdf.read(table(wide(linear(["I_s", "I_p"], (90, 0)))))
    assert_allclose(stokes_of(ds, "IQ"), STOKES[:, :2], atol=1e-12)
    assert "U" not in ds
    assert "do not determine U" in said(ds)
    assert "analyser's angle 0" not in said(ds)


def test_light_of_the_source_in_the_files_axes(table):
    text = wide(linear(["I0", "I45", "I90"], (90, 135, 0)), header="# stokes: s-p\n# illumination: 1,1,0,0")
    ds = pbrdf.read(table(text))
    assert_allclose(stokes_of(ds), STOKES[:, :3], atol=1e-12)
    assert ds.attrs["illumination"] == [1.0, -1.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("label", "light", "words"),
    [
        ("s", [1, -1, 0, 0], ""),
        ("p", [1, 1, 0, 0], ""),
        ("none", [1, 0, 0, 0], ""),
        ("45", [1, 0, 0, 0], "says '45' of the source, but natural light was assumed"),
    ],
)
def test_a_column_tells_the_light_of_the_source(table, label, light, words):
    text = wide(linear(["I0", "I45", "I90"], (0, 45, 90)), extra=(",psg", f",{label}"))
    ds = pbrdf.read(table(text))
    assert ds.attrs["illumination"] == light
    assert (words in said(ds)) if words else "of the source" not in said(ds)
    assert pbrdf.read(table(text), illumination="1,0,1,0").attrs["illumination"] == [1, 0, 1, 0]


def test_readings_of_unequal_exposures(table):
    """Long: each reading by its exposure, in units of the first; shot noise counts the electrons that were there."""
    lines = ["# analyzer_gain: 2", "theta_i,theta_r,phi,analyzer,exposure_ms,counts"]
    times = {0: 10.0, 45: 20.0, 90: 40.0}
    for s, view in zip(1000.0 * STOKES, VIEWS, strict=True):
        lines += [f"40,{view},15,{a},{t},{reading(s, a) * t / 10.0!r}" for a, t in times.items()]
    ds = pbrdf.read(table("\n".join(lines) + "\n"))
    assert_allclose(stokes_of(ds), 1000.0 * STOKES[:, :3], rtol=1e-12)
    assert "divided by the column 'exposure_ms'" in said(ds)
    assert "ignored_columns" not in ds.attrs
    # I = I0 + I90, each with the variance y/(2 t)
    variance = [reading(s, 0) / 2 + reading(s, 90) / 8 for s in 1000.0 * STOKES]
    assert_allclose(ds["I_std"], np.sqrt(variance), rtol=1e-9)


def test_a_monitor_that_is_not_used_is_said(table):
    ds = pbrdf.read(table(wide(linear(["I0", "I90"], (0, 90)) | {"monitor": 1.0})))
    assert "the column 'monitor' was not used" in said(ds)


# --- long tables -----------------------------------------------------------------------------------------

LONG = [(p, r) for p in (0.0, 45.0) for r in (None, 0.0, 30.0, 75.0)]


def long_rows():
    for s, view in zip(STOKES, VIEWS, strict=True):
        for polarizer, retarder in LONG:
            yield view, polarizer, retarder, reading(s, polarizer, retarder, 100.0)


def long_table(names="analyzer,retarder,retardance,signal", rows=None):
    body = [
        f"40,{view},15,{p},{'' if r is None else r},{'' if r is None else 100},{value!r}"
        for view, p, r, value in (long_rows() if rows is None else rows)
    ]
    return f"theta_i,theta_r,phi,{names}\n" + "\n".join(body) + "\n"


@pytest.mark.parametrize(
    "names",
    [
        "analyzer,retarder,retardance,signal",
        "polarizer_angle,waveplate_deg,retardance_deg,reading",
        "Analyser (deg),Compensator angle,Retardance (deg),Voltage (mV)",
        "polarizer,qwp,retardance,intensity",
    ],
)
def test_long_tables_in_any_order(table, names):
    rows = list(long_rows())
    ds = pbrdf.read(table(long_table(names, rows)))
    assert_allclose(stokes_of(ds, "IQUV"), STOKES, atol=1e-12)
    shuffled = [rows[i] for i in RNG.permutation(len(rows))]
    again = pbrdf.read(table(long_table(names, shuffled))).sortby("theta_r")
    assert_allclose(stokes_of(again, "IQUV"), STOKES, atol=1e-12)
    assert "polariser of the column" in said(ds) or "ol" not in names.split(",")[0].lower()


def test_whole_waves_and_whole_turns_do_nothing(table):
    """A retarder of a million waves more, and angles of ten turns more, are the same to the last digit."""

    def rows(turns, waves):
        yield "theta_i,theta_r,phi,analyzer,retarder,retardance_waves,signal"
        for s, view in zip(STOKES, VIEWS, strict=True):
            for polarizer, plate in LONG:
                quarter = "," if plate is None else f"{plate + 360 * turns},{waves}.25"
                yield f"40,{view},15,{polarizer + 360 * turns},{quarter},{reading(s, polarizer, plate, 90.0)!r}"

    plain, turned = (pbrdf.read(table("\n".join(rows(*more)) + "\n")) for more in ((0, 0), (10, 1_000_000)))
    assert_allclose(stokes_of(plain, "IQUV"), STOKES, atol=1e-12)
    assert_array_equal(stokes_of(turned, "IQUV"), stokes_of(plain, "IQUV"))


def test_wide_and_long_are_the_same(table):
    stated = {"I0": 0.01, "I45": 0.02, "I90": 0.03, "I135": 0.02}
    states = linear(stated)
    for name, u in stated.items():
        states[f"{name}_std"] = u
    one = pbrdf.read(table(wide(states)))
    lines = ["theta_i,theta_r,phi,state,reading,reading_std"]
    for s, view in zip(STOKES, VIEWS, strict=True):
        lines += [f"40,{view},15,{n[1:]},{reading(s, float(n[1:]))!r},{u}" for n, u in stated.items()]
    other = pbrdf.read(table("\n".join(lines) + "\n"))
    for name in ("I", "Q", "U", "covariance"):
        assert_allclose(one[name], other[name], atol=1e-14)


@pytest.mark.parametrize(
    ("unit", "factor"),
    [("analyzer_rad", np.pi / 180.0), ("analyzer [rad]", np.pi / 180.0), ("analyzer_deg", 1.0)],
)
def test_units_of_the_analysers_angle(table, unit, factor):
    rows = [
        f"40,{v},15,{a * factor!r},{reading(s, a)!r}"
        for s, v in zip(STOKES, VIEWS, strict=True)
        for a in (0, 50, 100)
    ]
    ds = pbrdf.read(table(f"theta_i,theta_r,phi,{unit},power\n" + "\n".join(rows) + "\n"))
    assert_allclose(stokes_of(ds), STOKES[:, :3], atol=1e-7)


def test_a_row_of_units(table, monkeypatch):
    """Units that a row under the names says, as files.delimited gives them."""
    units = ["deg", "deg", "deg", "rad", "%", "%"]
    read_table = reading_tables.read_table
    monkeypatch.setattr(
        reading_tables, "read_table", lambda path, sheet: replace(read_table(path, sheet), units=units)
    )
    rows = [
        f"40,{view},15,{float(np.deg2rad(a))!r},{100 * reading(s, a)!r},{1.0}"
        for s, view in zip(STOKES, VIEWS, strict=True)
        for a in (0, 50, 100)
    ]
    path = table("theta_i,theta_r,phi,analyzer,reading,reading_std\n" + "\n".join(rows) + "\n")
    ds = pbrdf.read(path, quantity="reflectance_factor")
    assert_allclose(stokes_of(ds), STOKES[:, :3], atol=1e-7)
    assert ds["I_std"].values.min() > 0.005


def test_columns_of_a_long_table_by_name(table):
    text = long_table("wheel,plate,wave,out")
    mapping = {"analyzer": "wheel", "retarder": "plate", "retardance": "wave", "reading": "out"}
    ds = pbrdf.read(table(text), format="readings", column=mapping)
    assert_allclose(stokes_of(ds, "IQUV"), STOKES, atol=1e-12)
    with pytest.raises(
        DataError, match="there is no column 'whel' for analyzer; the columns are theta_i, theta_r"
    ):
        pbrdf.read(table(text), format="readings", column={"analyzer": "whel"})


# --- uncertainties ---------------------------------------------------------------------------------------


def test_the_covariance_is_that_of_monte_carlo(table):
    """2000 noisy repetitions of one table of four readings with unequal errors, as groups of one file."""
    deviations, true = np.array([0.01, 0.03, 0.02, 0.005]), [1.0, 0.4, -0.2, 0.0]
    clean = np.array([reading(true, a) for a in (0, 45, 90, 135)])
    noisy = clean + deviations * RNG.standard_normal((2000, 4))
    head = "theta_i,theta_r,phi,group,I0,I45,I90,I135,I0_std,I45_std,I90_std,I135_std\n"
    stds = ",".join(map(str, deviations))
    rows = "".join(f"40,30,0,{k},{','.join(map(repr, row.tolist()))},{stds}\n" for k, row in enumerate(noisy))
    ds = pbrdf.read(table(head + rows))
    found = stokes_of(ds)
    assert_allclose(found.mean(axis=0), true[:3], atol=0.002)
    covariance = ds["covariance"].values[0, :3, :3]
    assert np.isnan(ds["covariance"].values[:, 3]).all()
    scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    assert_allclose(np.cov(found.T) / scale, covariance / scale, atol=0.08)
    assert abs(covariance[0, 1]) > 0.2 * scale[0, 1]
    assert "contradict" not in said(ds)


@pytest.mark.parametrize(
    ("name", "factor"),
    [
        ("{}_std", 1),
        ("{}_err", 1),
        ("u({})", 1),
        ("sigma_{}", 1),
        ("U({}) (k=2)", 2),
        ("{}_unc [mV]", 1),
        ("std_{}", 1),
    ],
)
def test_names_of_uncertainties(table, name, factor):
    names = ("I0", "I45", "I90", "I135")
    ds = pbrdf.read(table(wide(linear(names) | {name.format(n): 0.01 * factor for n in names})))
    # I is half the sum of four readings
    assert_allclose(ds["I_std"], 0.01, rtol=1e-9)
    assert_allclose(ds["Q_std"], 0.01 * np.sqrt(2.0), rtol=1e-9)
    assert ("coverage factor" in said(ds)) == (factor == 2)


@pytest.mark.parametrize(
    ("columns", "unit"),
    [
        ("reading,reading_std", ""),
        ("V (mV),u(V)", ""),
        ("signal,err (mV)", ""),
        ("power,std (%)", "%"),
        ("I,I_err", ""),
    ],
)
def test_names_of_uncertainties_of_a_long_table(table, columns, unit):
    rows = [
        f"40,{view},15,{a},{reading(s, a)!r},{100 * 0.01 / reading(s, a) if unit else 0.01!r}"
        for s, view in zip(STOKES, VIEWS, strict=True)
        for a in (0, 45, 90, 135)
    ]
    ds = pbrdf.read(table(f"theta_i,theta_r,phi,analyzer,{columns}\n" + "\n".join(rows) + "\n"))
    assert_allclose(stokes_of(ds), STOKES[:, :3], atol=1e-12)
    if not unit:
        assert_allclose(ds["I_std"], 0.01, rtol=1e-9)
    assert_allclose(ds["Q_std"], 0.01 * np.sqrt(2.0), rtol=1e-9)


def test_uncertainties_in_percent(table):
    names = ("I0", "I90")
    ds = pbrdf.read(table(wide(linear(names, (0, 90)) | {f"{n}_std (%)": 2.0 for n in names})))
    expected = [0.02 * np.hypot(reading(s, 0), reading(s, 90)) for s in STOKES]
    assert_allclose(ds["I_std"], expected, rtol=1e-9)


def test_one_missing_uncertainty_costs_that_of_its_geometry_alone(table):
    names = ("I0", "I45", "I90")
    text = wide(linear(names, (0, 45, 90)) | {f"{n}_std": 0.01 for n in names})
    lines = text.splitlines()
    lines[1] = lines[1].rsplit(",", 1)[0] + ","
    ds = pbrdf.read(table("\n".join(lines) + "\n"))
    assert_allclose(stokes_of(ds), STOKES[:, :3], atol=1e-12)
    assert np.isnan(ds["I_std"].values).tolist() == [True, False, False]


@pytest.mark.parametrize("layout", ["wide", "long"])
def test_repeats_give_the_noise(table, layout):
    """40 geometries, 6 repeats: the stated uncertainty of I is that of the means."""
    rows = []
    for k in range(40):
        for _ in range(6):
            values = [reading([1, 0.2, 0.1, 0], a) + 0.01 * RNG.standard_normal() for a in (0, 45, 90, 135)]
            if layout == "wide":
                rows.append(f"40,{k},15,{','.join(map(repr, values))}")
            else:
                rows += [f"40,{k},15,{a},{v!r}" for a, v in zip((0, 45, 90, 135), values, strict=True)]
    columns = "I0,I45,I90,I135" if layout == "wide" else "analyzer,reading"
    ds = pbrdf.read(table(f"theta_i,theta_r,phi,{columns}\n" + "\n".join(rows) + "\n"))
    assert ds.sizes["geometry"] == 40
    assert ds["I_std"].values.mean() == pytest.approx(0.01 / np.sqrt(6), rel=0.1)
    assert np.std(ds["I"].values) == pytest.approx(0.01 / np.sqrt(6), rel=0.35)
    assert "contradict" not in said(ds)


def test_shot_noise_by_the_gain(table):
    """With g electrons a count, I0 + I90 scatters by √((I0 + I90)/g)."""
    text = wide(linear(["I0", "I90"], (0, 90)), stokes=1000.0 * STOKES, header="# analyzer_gain: 2.5")
    ds = pbrdf.read(table(text))
    assert_allclose(ds["I_std"], np.sqrt(1000.0 * STOKES[:, 0] / 2.5), rtol=1e-9)


def test_nothing_is_known_of_the_noise_of_single_readings(table):
    ds = pbrdf.read(table(wide(linear(["I0", "I45", "I90", "I135"]))))
    assert "I_std" not in ds
    assert "covariance" not in ds


# --- dark, transmission, quantity ------------------------------------------------------------------------


def test_dark_readings(table):
    plain = linear(["I0", "I45", "I90"], (0, 45, 90))
    with_dark = {name: (lambda s, f=f: f(s) + 0.25) for name, f in plain.items()}
    for text in (
        wide(with_dark | {"dark": 0.25}),
        wide(with_dark | {"I_dark": 0.25}),
        wide(with_dark | {"background": 0.25}),
        wide(with_dark, header="# analyzer_dark: 0.25"),
    ):
        assert_allclose(stokes_of(pbrdf.read(table(text))), STOKES[:, :3], atol=1e-12)
    lines = ["theta_i,theta_r,phi,state,reading"]
    for k, (s, view) in enumerate(zip(STOKES, VIEWS, strict=True)):
        lines += [f"40,{view},15,{a},{reading(s, a) + 0.1 * k!r}" for a in (0, 45, 90)]
        lines += [f"40,{view},15,dark,{0.1 * k!r}"]
    assert_allclose(stokes_of(pbrdf.read(table("\n".join(lines) + "\n"))), STOKES[:, :3], atol=1e-12)
    one = [*(line for line in lines if "dark" not in line), ",,,dark,0.0"]
    assert pbrdf.read(table("\n".join(one) + "\n")).sizes["geometry"] == 3


def test_what_an_analyser_passes(table):
    text = wide(linear(["I0", "I45", "I90"], (0, 45, 90)), header="# quantity: brdf")
    ds = pbrdf.read(table(text))
    assert_allclose(ds["I"], STOKES[:, 0], atol=1e-12)
    assert "taken to pass half of natural light" in said(ds)
    assert "scale" not in ds.attrs
    ds = pbrdf.read(table(text), analyzer={"transmission": 1})
    assert_allclose(ds["I"], 0.5 * STOKES[:, 0], atol=1e-12)
    assert "half of natural light" not in said(ds)


def test_quantity_by_unit_and_cosine(table):
    names = [f"I{a} (1/sr)" for a in (0, 45, 90)]
    ds = pbrdf.read(table(wide(linear(names, (0, 45, 90)))), cosine_weighted=True)
    assert ds.attrs["quantity"] == "brdf"
    assert_allclose(stokes_of(ds), STOKES[:, :3] / np.cos(np.deg2rad(VIEWS))[:, None], rtol=1e-12)


def test_without_an_analyser(table):
    states = linear(["I0", "I45"], (0, 45)) | {"I_total": lambda s: float(s[0])}
    assert_allclose(stokes_of(pbrdf.read(table(wide(states)))), STOKES[:, :3], atol=1e-12)


# --- what is missing, what contradicts -------------------------------------------------------------------


def test_missing_states_are_said(table):
    lines = wide(linear(["I0", "I45", "I90"], (0, 45, 90))).splitlines()
    lines[1] = lines[1].rsplit(",", 2)[0] + ",,NaN"
    lines[2] = ",".join([*lines[2].split(",")[:4], "", lines[2].split(",")[-1]])
    ds = pbrdf.read(table("\n".join(lines) + "\n"))
    assert ds.sizes["geometry"] == 2
    assert "1 of 3 geometries were left out" in said(ds)
    assert "(line 2)" in said(ds)
    assert np.isnan(ds["U"].values).tolist() == [True, False]
    assert_allclose(ds["Q"], STOKES[1:, 1], atol=1e-12)
    assert "U is left open at 1 of 2 geometries" in said(ds)
    assert "line 3" in said(ds)


def test_readings_that_contradict_their_uncertainties_are_named(table):
    names = ("I0", "I45", "I90", "I135")
    states = linear(names) | {f"{n}_std": 0.002 for n in names}
    lines = wide(states).splitlines()
    assert "contradict" not in said(pbrdf.read(table("\n".join(lines))))
    cells = lines[2].split(",")
    cells[3] = repr(float(cells[3]) - 0.05)  # saturated
    lines[2] = ",".join(cells)
    ds = pbrdf.read(table("\n".join(lines) + "\n"))
    assert (
        "contradict each other beyond their uncertainties in line 3; at worst, in line 3 (I0 + I90 = 1.95"
        in said(ds)
    )
    # (I0 + I90 − I45 − I135)² over the sum of the variances
    assert f"χ² is {0.05**2 / (4 * 0.002**2):.3g} for 1 more" in said(ds)


def test_readings_without_uncertainties_that_contradict_each_other_are_named(table):
    lines = wide(linear(["I0", "I45", "I90", "I135"])).splitlines()
    cells = lines[3].split(",")
    cells[4] = repr(float(cells[4]) + 0.1)
    lines[3] = ",".join(cells)
    assert "contradict each other in line 4" in said(pbrdf.read(table("\n".join(lines) + "\n")))


def test_channels_of_unequal_gain_are_named(table):
    states = linear(["I0", "I45", "I90", "I135"])
    states["I45"] = lambda s: 1.1 * reading(s, 45)
    states["I135"] = lambda s: 1.1 * reading(s, 135)
    ds = pbrdf.read(table(wide(states)))
    assert "I45 + I135 is 10 % larger than I0 + I90 on the median of 3 geometries" in said(ds)


def test_a_detector_at_its_end_is_named(table):
    rows = "".join(f"40,{v},15,255,{200 - v},{180 + v},{100}\n" for v in (10, 20, 30))
    ds = pbrdf.read(table("theta_i,theta_r,phi,I0,I45,I90,I135\n" + rows))
    assert "the largest reading, 255, comes at 3 geometries (lines 2, 3, 4)" in said(ds)


# --- what is no table of readings, and what is wrong -----------------------------------------------------


@pytest.mark.parametrize(
    "names",
    [
        "theta_i,theta_r,I,Q,U",
        "theta_i,theta_r,S0,S1,S2,S3",
        "theta_i,theta_r,I0,I1,I2,I3",
        "theta_i,0,10,20,30,40,50,60,70",
        "theta_i,I_0,I_30,I_60",
        "theta_i,theta_r,I0_1,I0_2,I90_1,I90_2",
        "theta_i,theta_r,I_0_0,I_0_90,I_90_0,I_90_90",
        "theta_i,theta_r,p_x,p_y,p_z",
        "theta_i,theta_r,0,45,90,135,180",
        "theta_i,theta_r,400,450,500",
        "theta_i,theta_r,I_450,I_550,I_650",
        "theta_i,theta_r,R_s,R_p",
        "theta_i,theta_r,brdf_s,brdf_p",
        "theta_i,theta_r,I_par_s,dolp",
        "theta_i,theta_r,polarization,brdf",
        "theta_i,theta_r,m00,m01,m10,m11",
        "theta_i,theta_r,brdf,dark",
        "theta_i,theta_r,I0,I45,I90,I135,Q,U",
        "lambda,thetai,phi,f_r11,f_r12",
    ],
)
def test_other_tables_are_left_alone(names):
    assert not holds_readings(names.split(","))


def test_polarisation_that_was_computed_beside_the_readings_is_not_used(table):
    ds = pbrdf.read(table(wide(linear(["I0", "I45", "I90", "I135"]) | {"DoLP": 0.9, "AoLP": 12.0})))
    assert_allclose(stokes_of(ds), STOKES[:, :3], atol=1e-12)
    assert ds.attrs["ignored_columns"] == ["DoLP", "AoLP"]


@pytest.mark.parametrize(
    ("text", "options", "words"),
    [
        ("theta_i,theta_r,I0,I45,I90\n1,2,3,x,5\n", {}, r"line 2, column 'I45': 'x' is not a number"),
        ("theta_i,theta_r,I0,I45,I90\n1,95,3,4,5\n", {}, r"line 2"),
        ("theta_i,theta_r,I_P,I_R,I_L\n1,2,3,4,5\n", {}, "P may be the polariser at"),
        ("theta_i,theta_r,I0 (mV),I90 (V)\n1,2,3,4\n", {}, "different units"),
        ("theta_i,theta_r,I0,I_0,I90\n1,2,3,4,5\n", {}, "'I0' and 'I_0' both hold the same state"),
        ("theta_i,theta_r,I_R0,I_R45,I_R90\n1,2,3,4,5\n", {}, "retardance of the retarder is not stated"),
        ("theta_i,theta_r,I0,I45,I90\n1,2,3,4,5\n", {"analyzer": {"zeros": 1}}, "did you mean 'zero'"),
        (
            "theta_i,theta_r,I0,I45,I90\n1,2,3,4,5\n",
            {"analyzer": {"zero": "q"}},
            "analyzer zero is 'q'; use p, s",
        ),
        (
            "theta_i,theta_r,I0,I45,I90\n1,2,3,4,5\n",
            {"analyzer": {"gain": 0}},
            "gain is 0; give a number above 0",
        ),
        (
            "theta_i,theta_r,I0,I45,I90\n1,2,3,4,5\n",
            {"analyzer": {"states": "A=?;B=2"}},
            r"A = '\?' is not understood",
        ),
        (
            "theta_i,theta_r,I0,I45,I90\n1,2,3,4,5\n",
            {"analyzer": {"states": "I0=pol 0;B=pol 2"}},
            "no column 'b'",
        ),
        ("theta_i,theta_r,I0,I90,I180,I270\n1,2,3,4,5,6\n", {}, "analyser or for azimuths"),
        ("theta_i,theta_r,I0,I90\n1,2,3,4\n1,2,inf,4\n", {}, "line 3, column 'I0': 'inf' is no reading"),
        ("theta_i,theta_r,I0,I90\n1,2,1e308,1e308\n", {}, "line 2, column 'I0': '1e308' is no reading"),
        (
            "theta_i,theta_r,exposure,I0,I90\n1,2,0,3,4\n",
            {},
            "column 'exposure': an exposure is a number above 0",
        ),
        ("theta_i,theta_r,I0,I90,dark\n1,2,3,4,\n", {}, "column 'dark' is empty"),
        ("# analyzer_zer: s\ntheta_i,theta_r,I0,I90\n1,2,3,4\n", {}, "did you mean 'zero'"),
        ("theta_i,theta_r,brdf\n1,2,3\n", {"format": "readings"}, "no readings behind an analyser"),
        (
            "theta_i,theta_r,analyzer,reading\n1,2,0,3\n1,3,90,4\n",
            {},
            "at no geometry do the readings determine",
        ),
        (
            "theta_i,theta_r,analyzer,reading\n1,2,0,3\n1,2,inf,4\n",
            {},
            "line 3, column 'analyzer': inf is not an angle",
        ),
        (
            "theta_i,theta_r,state,reading\n1,2,0,3\n1,2,foo,4\n",
            {},
            "line 3, column 'state': 'foo' is no state",
        ),
        ("theta_i,theta_r,I0,I90,I0_std\n1,2,3,4,-1\n", {}, "column 'I0_std': an uncertainty is negative"),
        (
            "theta_i,theta_r,psg,I0,I90\n1,2,s,3,4\n1,2,p,3,4\n",
            {},
            "--where psg=p",
        ),
        (
            "theta_i,theta_r,sample,I0,I90\n1,2,red,3,4\n1,2,blue,3,4\n",
            {},
            "line 3: the same directions and state come with 'red' and 'blue' in the column 'sample'",
        ),
    ],
)
def test_what_is_wrong_is_said(table, text, options, words):
    with pytest.raises(DataError, match=words):
        pbrdf.read(table(text), **options)


def test_rows_can_be_selected_and_left_out(table):
    text = "theta_i,theta_r,sample,I0,I90\n1,2,red,3,4\n1,2,blue,5,6\n1,99,blue,5,6\n"
    ds = pbrdf.read(table(text), where={"sample": "blue"}, skip_invalid=True)
    assert_allclose(ds["I"], [11.0])
    assert ds.attrs["skipped_rows"] == 1


def test_a_full_turn_of_the_polariser(table):
    """0° to 360° in steps of 30°, once it is said that these are no azimuths."""
    angles = tuple(range(0, 361, 30))
    text = wide(linear([f"I{a}" for a in angles], angles)).replace(",phi,", ",").replace(",15,", ",")
    ds = pbrdf.read(table(text), analyzer={"zero": "p"})
    assert_allclose(stokes_of(ds), STOKES[:, :3], atol=1e-12)


def test_remarks_on_the_analyser_stay_attributes(table):
    header = "# analyzer_maker: Glan & Co\n# title: a wheel"
    ds = pbrdf.read(table(wide(linear(["I0", "I90"], (0, 90)), header=header)))
    assert ds.attrs["analyzer_maker"] == "Glan & Co"
    assert ds.attrs["title"] == "a wheel"
    path = table("# analyzer_zero: p\n# quantity: dn\ntheta_i,theta_r,I,Q\n1,2,3,1\n")
    assert_allclose(pbrdf.read(path)["Q"], 1.0)


@pytest.mark.slow
def test_fits_of_readings_and_of_stokes_parameters_are_the_same(table):
    """The paint's Stokes parameters under noise-free analysers at 0°, 45°, 90°, 135° lead to the same parameters."""
    experiment = open_experiment("white")
    ds = experiment.isel(geometry=experiment["group"].values == experiment["group"].values[0])
    mueller = load_paint("white").mueller(ds["theta_i"].values, ds["theta_r"].values, ds["phi"].values)
    stokes = np.asarray(mueller)[:, :, 0] * np.cos(ds["theta_i"].values)[:, None]
    geometry = np.rad2deg([ds["theta_i"].values, ds["theta_r"].values, ds["phi"].values]).T
    columns = {"I": stokes[:, 0], "Q": stokes[:, 1], "U": stokes[:, 2]}
    four = {f"I{a}": [reading(s, a) for s in stokes] for a in (0, 45, 90, 135)}
    results = []
    for name, values in (("stokes.csv", columns), ("four.csv", four)):
        rows = zip(*geometry.T.tolist(), *(np.asarray(v).tolist() for v in values.values()), strict=True)
        text = "\n".join(
            [
                "# quantity: dn",
                f"theta_i,theta_r,phi,{','.join(values)}",
                *(",".join(map(repr, r)) for r in rows),
            ]
        )
        results.append(pbrdf.fit(pbrdf.read(table(text + "\n", name)), starts=8))
    one, other = (np.array([e.value for e in found.estimates.values()]) for found in results)
    assert_allclose(one, other, rtol=1e-4)


@pytest.mark.parametrize("mark", ["[", "(", "_", " ", "1", "x", "[" + "1"])
@pytest.mark.parametrize(
    "text",
    [
        wide(linear(["I0", "I45", "I90", "I135"])),
        "theta_i,theta_r,phi,polarizer,reading\n40,10,15,0,1\n40,10,15,45,2\n40,10,15,90,3\n",
    ],
)
def test_very_long_names_of_columns_cost_no_time(table, text, mark):
    """A search from each of their characters to their end would take minutes; none of the others is misread."""
    names, *rows = text.splitlines()
    name = "a" + mark * (100_000 // len(mark)) + "b"
    longer = "\n".join([f"{names},{name}", *(f"{row},0.5" for row in rows)]) + "\n"
    ds = pbrdf.read(table(longer), format="readings")
    assert_allclose(stokes_of(ds), stokes_of(pbrdf.read(table(text), format="readings")))


def test_columns_of_angles_11_and_45_are_readings_and_those_of_a_matrix_not():
    assert holds_readings(["theta_i", "theta_r", "phi", "I_0", "I_45", "I_90"])
    assert holds_readings(["theta_i", "theta_r", "phi", "I_11", "I_56", "I_101"])
    assert not holds_readings(["theta_i", "theta_r", "phi", "S_11", "S_12", "S_21", "S_22"])
    assert not holds_readings(["theta_i", "theta_r", "phi", "S00", "S01", "S10", "S11"])


def test_uncertainties_of_readings_without_a_separator(tmp_path):
    path = tmp_path / "readings.csv"
    path.write_text(
        "# quantity: radiance\n# azimuth: forward=0\n# analyzer_zero: p\n"
        "theta_i,theta_r,phi,I0,I45,I90,I135,sigma0,sigma45,sigma90,sigma135\n"
        "30,20,0,1,.9,.8,.9,.03,.03,.03,.03\n"
    )
    # each pair of crossed readings gives I with the variance 2·0.03², their mean half of that
    assert_allclose(pbrdf.read(path)["I_std"], 0.03, rtol=1e-9)
