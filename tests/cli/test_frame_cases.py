"""``pbrdf reduce`` and ``pbrdf calibrate`` on strangers' frames: the cases H1, L1, L3 and M1 of the issue, made here
anew, and dual rotating retarders."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest
from PIL import Image

import pbrdf
from pbrdf.data.readers import read
from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.polarimeter.mueller_polarimeter import dual_rotating_retarder
from pbrdf.optics.elements import rotate_frame

CELL = np.array([[90, 45], [135, 0]])


@pytest.fixture
def instrument(tmp_path):
    def write(text, name="i.toml"):
        (tmp_path / name).write_text(text, encoding="utf-8")
        return str(tmp_path / name)

    return write


def rows(path):
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def mosaic(rng, signal, noise):
    cell = 0.5 * signal * (1.0 + 0.6 * np.cos(2.0 * np.deg2rad(CELL)))
    even = np.tile(cell, (8, 8))
    return np.clip(np.round(even + rng.normal(0, noise, even.shape)), 0, 4095).astype(np.uint16)


def sony(bits, more=""):
    return f'[polarimeter]\nkind = "preset"\npreset = "sony_imx250mzr"\n[detector]\nbits = {bits}\n{more}\n'


def test_twelve_bits_left_aligned(run, tmp_path, instrument):
    """H1: read as 12 bits, all cells saturated; as 16 bits refused with the reason."""
    Image.fromarray(mosaic(np.random.default_rng(1), 5600, 8) << 4).save(tmp_path / "f.png")
    common = ("reduce", str(tmp_path / "f.png"), "--maps", "none", "--no-pictures")
    done = run(*common, "-p", instrument(sony(12)), "-o", str(tmp_path / "r"))
    assert "read as 12 bits in the upper end of 16" in done.stderr
    (row,) = rows(tmp_path / "r" / "summary.csv")
    assert (row["good"], row["saturated"]) == ("0", "64")
    done = run(*common, "-p", instrument(sony(16)), "-o", str(tmp_path / "r16"), code=2)
    assert "65520 = 4095 · 16" in done.stderr and "set bits = 12" in done.stderr
    # dim enough, the light is measured
    Image.fromarray(mosaic(np.random.default_rng(1), 3000, 8) << 4).save(tmp_path / "f.png")
    run(*common, "-p", instrument(sony(12)), "-o", str(tmp_path / "dim"))
    (row,) = rows(tmp_path / "dim" / "summary.csv")
    assert float(row["dolp"]) == pytest.approx(0.6, abs=0.005)
    assert float(row["I"]) == pytest.approx(3000, rel=0.002)


def test_a_pile_below_the_end_is_a_warning(run, tmp_path, instrument):
    """Numbers of 12 bits called 16, and 8 bits stretched to 12: saturation is not where the table says."""
    numbers = mosaic(np.random.default_rng(1), 5600, 8)
    Image.fromarray(numbers).save(tmp_path / "f.png")
    done = run(
        "reduce", str(tmp_path / "f.png"), "-p", instrument(sony(16)), "-o", str(tmp_path / "r"), "--maps", "none",
        "--no-pictures", "-q",
    )  # fmt: skip
    assert "64 pixels (25.00%) read exactly 4095" in done.stderr and "set bits = 12" in done.stderr


def test_averaged_frames_in_floats(run, tmp_path, instrument):
    """L1: I 3000, DoLP 0.316, the noise divided by the root of the number of exposures."""
    rng = np.random.default_rng(0)
    t = np.deg2rad([0, 45, 90, 135])
    mean = 0.5 * (3000 + 900 * np.cos(2 * t) + 300 * np.sin(2 * t))
    shots = [np.round(mean[:, None, None] + rng.normal(0, 20, (4, 8, 8))) for _ in range(100)]
    np.save(tmp_path / "f.npy", np.mean(shots, axis=0).astype(np.float32)[None])
    text = (
        '[polarimeter]\nkind = "rotating_polarizer"\nangles = [0, 45, 90, 135]\n[detector]\nbits = 12\n'
        "read_noise = 4\n[frames]\n"
    )
    common = ("reduce", str(tmp_path / "f.npy"), "--maps", "none", "--no-pictures", "-o", str(tmp_path / "r"))
    assert "exposures = 100" in run(*common, "-p", instrument(text), code=2).stderr
    found = {}
    for count in (1, 100):
        run(*common, "-p", instrument(f"{text}exposures = {count}\n"))
        (found[count],) = rows(tmp_path / "r" / "summary.csv")
    assert float(found[100]["I"]) == pytest.approx(3000, abs=1.0)
    assert float(found[100]["dolp"]) == pytest.approx(0.316, abs=0.001)
    assert float(found[1]["I_std"]) == pytest.approx(10 * float(found[100]["I_std"]), rel=1e-6)


@pytest.mark.slow
def test_colour_polarisation_mosaic(run, tmp_path, instrument):
    """L3: three series, R 0.4, G 0.2, B 0.6, and a data set of them; the grey preset says what it sees."""
    rng = np.random.default_rng(1)
    cell = np.zeros((4, 4))
    for r, c, level, dolp in ((0, 0, 1200, 0.4), (0, 1, 2000, 0.2), (1, 0, 2000, 0.2), (1, 1, 700, 0.6)):
        cell[2 * r : 2 * r + 2, 2 * c : 2 * c + 2] = (
            0.5 * level * (1 + dolp * np.cos(2 * np.deg2rad(CELL - 30)))
        )
    numbers = np.round(np.tile(cell, (8, 8)) + rng.normal(0, 2, (32, 32))).astype(np.uint16)
    Image.fromarray(numbers).save(tmp_path / "f.png")
    common = ("reduce", str(tmp_path / "f.png"), "--maps", "none", "--no-pictures")
    done = run(*common, "-p", instrument(sony(12)), "-o", str(tmp_path / "grey"))
    assert "neighbouring cells of polarisers alternate in brightness" in done.stderr
    color = (
        sony(12)
        .replace("mzr", "myr")
        .replace("[detector]", "wavelengths = { R = 610, G = 540, B = 460 }\n[detector]")
    )
    (tmp_path / "angles.csv").write_text("series,theta_i,theta_r\nf,30,40\n")
    done = run(
        *common, "-p", instrument(color), "-o", str(tmp_path / "c"), "--angles", str(tmp_path / "angles.csv"),
        "--roi", "all=0:8,0:8",
    )  # fmt: skip
    assert done.stderr == ""
    found = {row["series"]: row for row in rows(tmp_path / "c" / "summary.csv") if row["region"] == "all"}
    for name, dolp in (("f_R", 0.4), ("f_G", 0.2), ("f_B", 0.6)):
        assert float(found[name]["dolp"]) == pytest.approx(dolp, abs=0.002)
        assert float(found[name]["aolp_deg"]) == pytest.approx(30, abs=0.5)
    ds = read(tmp_path / "c" / "all.csv")
    assert sorted(ds["wavelength"].values.tolist()) == [460, 540, 610]


@pytest.mark.slow
def test_uncertain_angle_of_the_generator(run, tmp_path, instrument):
    """M1: 1.5° of the generator is 3.7 % of Q and U in the accuracy written; without it, a warning."""
    rng = np.random.default_rng(1)
    (tmp_path / "known").mkdir()
    off = np.deg2rad(1.5)
    for angle in range(0, 180, 30):
        turned = 2 * (np.deg2rad(angle) + off)
        for state in (0, 45, 90, 135):
            t = 2 * np.deg2rad(state)
            level = 1500 * (1 + np.cos(t) * np.cos(turned) + np.sin(t) * np.sin(turned))
            numbers = np.round(100 + level + rng.normal(0, 4, (8, 8))).astype(np.uint16)
            Image.fromarray(numbers).save(tmp_path / "known" / f"a{angle:03d}_{state}.png")
    nominal = instrument(
        '[polarimeter]\nkind = "rotating_polarizer"\nangles = [0, 45, 90, 135]\n[detector]\nbits = 12\noffset = 100\n'
        'read_noise = 4\n[frames]\npattern = "{series}_{state}.png"\n',
        "nominal.toml",
    )
    for column, warned in (("", True), (",angle_std_deg", False)):
        lines = [f"a{a:03d},{a}{',1.5' if column else ''}" for a in range(0, 180, 30)]
        (tmp_path / "inputs.csv").write_text("\n".join([f"series,angle_deg{column}", *lines]) + "\n")
        done = run(
            "calibrate", str(tmp_path / "known"), "-p", nominal, "-i", str(tmp_path / "inputs.csv"), "-o",
            str(tmp_path / "c.toml"), "--no-picture",
        )  # fmt: skip
        assert ("turned by" in done.stderr) == warned
        line = next(x for x in (tmp_path / "c.toml").read_text().splitlines() if x.startswith("accuracy"))
        linear = float(line.split("linear = ")[1].split(",")[0])
        assert linear == pytest.approx(
            0.0006 if warned else 2 * off / np.sqrt(2), rel=0.2 if warned else 0.01
        )


SAMPLE = np.array([[1, -0.2, 0, 0], [-0.2, 1, 0, 0], [0, 0, -0.9, 0.35], [0, 0, -0.35, -0.9]])
DRR = '[polarimeter]\nkind = "dual_rotating_retarder"\nsteps = 30\nretardance = 92\n'


def drr():
    t = np.deg2rad(np.arange(30) * 6.0)
    return dual_rotating_retarder(
        t, 5 * t, generator_retardance=np.deg2rad(92), analyzer_retardance=np.deg2rad(92)
    )


def test_readings_of_a_dual_rotating_retarder(run, tmp_path, instrument):
    """A table with the geometry in it, rows in any order: two Mueller matrices within their errors."""
    polarimeter, generator = drr()
    readings = 1000 * np.einsum("ni,ij,nj->n", polarimeter.analyzer, SAMPLE, generator.stokes)
    rng = np.random.default_rng(0)
    lines = [
        f"{theta},{theta},{6 * k},{30 * k},{readings[k] * scale + rng.normal(0, 0.5):.4f},0.5"
        for theta, scale in ((30, 1.0), (50, 2.0))
        for k in range(30)
    ]
    rng.shuffle(lines)
    header = "theta_i_deg,theta_r_deg,generator_deg,analyzer_deg,intensity,intensity_std"
    (tmp_path / "readings.csv").write_text("\n".join([header, *lines]) + "\n")
    done = run("reduce", str(tmp_path / "readings.csv"), "-p", instrument(DRR), "-o", str(tmp_path / "r"))
    assert done.stderr == ""
    ds = read(tmp_path / "r" / "readings.csv").sortby("theta_i")
    for k, scale in enumerate((1000.0, 2000.0)):
        M, std = ds["mueller"].values[k], ds["mueller_std"].values[k]
        assert (np.abs(M - scale * SAMPLE) < 4.5 * std).all()
        assert (std < 1.5).all()
    # r_p/r_s of ψ and Δ: diattenuation |cos 2ψ|, retardance |Δ|
    retardance = np.rad2deg(np.arctan2(0.35, -0.9))
    for row in rows(tmp_path / "r" / "summary.csv"):
        for name, exact in (("diattenuation", 0.2), ("polarizance", 0.2), ("retardance_deg", retardance)):
            assert abs(float(row[name]) - exact) < 4.5 * float(row[f"{name}_std"])
        assert float(row["retardance_deg_std"]) < 0.1
    assert "retardance 158.7" in done.stdout and "fast axis" in done.stdout
    assert (tmp_path / "r" / "properties.png").exists()
    # a wrong retardance makes a matrix that no sample has, and fits; a wrong order of readings does not fit
    done = run(
        "reduce", str(tmp_path / "readings.csv"), "-p", instrument(DRR.replace("92", "110")), "-o",
        str(tmp_path / "w"), "--no-pictures",
    )  # fmt: skip
    assert not (tmp_path / "w" / "properties.png").exists()
    assert "no sample has this Mueller matrix" in done.stderr
    assert "order of the states" not in done.stderr
    rolled = [f"a,{value:.3f}" for value in np.roll(readings, 1)]
    (tmp_path / "rolled.csv").write_text("\n".join(["series,reading", *rolled]) + "\n")
    done = run("reduce", str(tmp_path / "rolled.csv"), "-p", instrument(DRR), "-o", str(tmp_path / "o"))
    assert "is the order of the states right" in done.stderr
    missing = "\n".join([header, *lines[:10]]) + "\n"
    (tmp_path / "few.csv").write_text(missing)
    done = run("reduce", str(tmp_path / "few.csv"), "-p", instrument(DRR), "-o", str(tmp_path / "f"), code=2)
    assert "of the 16" in done.stderr


@pytest.mark.slow
def test_frames_of_a_dual_rotating_retarder(run, tmp_path, instrument):
    """Frames called by the two angles: the matrix of a region, and the same from repeats in a stack."""
    polarimeter, generator = drr()
    signal = 1500 * np.einsum("ni,ij,nj->n", polarimeter.analyzer, SAMPLE, generator.stokes)
    detector = Detector(bits=12, gain=2.5, read_noise=6.0, offset=50.0)
    raw = detector.expose(np.broadcast_to(signal[:, None, None], (4, 30, 8, 8)), np.random.default_rng(0))
    raw[:, 3, 0, 0] = 4095
    (tmp_path / "run").mkdir()
    for n in range(30):
        Image.fromarray(raw[0, n]).save(tmp_path / "run" / f"p1_{6 * n}_{30 * n}.png")
    np.save(tmp_path / "p1.npy", raw)
    (tmp_path / "angles.csv").write_text("series,theta_i,theta_r\np1,30,30\n")
    table = f"{DRR}[detector]\nbits = 12\ngain = 2.5\nread_noise = 6\noffset = 50\n"
    common = ("--angles", str(tmp_path / "angles.csv"), "--roi", "paint=0:8,0:8", "-o", str(tmp_path / "r"))
    found = {}
    for name, more in (("run", ""), ("p1.npy", '[frames]\npages = "repeat, state"\n')):
        run("reduce", str(tmp_path / name), "-p", instrument(table + more), *common)
        ds = found[name] = read(tmp_path / "r" / "paint.csv")
        M, std = ds["mueller"].values[0], ds["mueller_std"].values[0]
        assert (np.abs(M - 1500 * SAMPLE) < 4.5 * std).all()
        (row,) = rows(tmp_path / "r" / "summary.csv")
        assert (row["good"], row["saturated"]) == ("63", "1")
    ratio = found["run"]["mueller_std"].values.mean() / found["p1.npy"]["mueller_std"].values.mean()
    assert ratio == pytest.approx(2.0, rel=0.1)
    # other commands say what this instrument is
    assert "measures Mueller matrices" in run("polarimeter", instrument(table), code=2).stderr


@pytest.mark.slow
def test_a_paint_behind_a_dual_rotating_retarder(run, tmp_path, instrument):
    """Readings of a bundled paint by an instrument whose generator and analyser are turned: reduced and fitted, the
    paint's parameters come back within their errors."""
    paint = pbrdf.load_paint("matte-white-thick")
    polarimeter, generator = drr()
    turn_g, turn_a = np.pi / 2, np.pi / 4
    rng = np.random.default_rng(0)
    lines = []
    for theta_i in (30, 45, 60):
        for theta_r in range(0, 80, 8):
            angles = np.deg2rad([theta_i, theta_r, 0.0])
            M = np.cos(angles[0]) * np.asarray(paint.mueller(*angles)).reshape(4, 4)
            seen = rotate_frame(turn_a) @ M @ rotate_frame(-turn_g)
            exact = 5000 * np.einsum("ni,ij,nj->n", polarimeter.analyzer, seen, generator.stokes)
            std = 0.002 * np.abs(exact) + 0.05
            for k, value in enumerate(exact + std * rng.normal(size=30)):
                lines.append(f"{theta_i},{theta_r},0,{6 * k},{30 * k},{value:.5f},{std[k]:.5f}")
    header = "theta_i_deg,theta_r_deg,phi_deg,generator_deg,analyzer_deg,intensity,intensity_std"
    (tmp_path / "paint.csv").write_text("\n".join([header, *lines]) + "\n")
    table = f"{DRR}generator_reference_angle = 90\nreference_angle = 45\n"
    run("reduce", str(tmp_path / "paint.csv"), "-p", instrument(table), "-o", str(tmp_path / "r"), "-q")
    run(
        "fit", str(tmp_path / "r" / "paint.csv"), "--nuisance", "gain", "--starts", "8", "-q", "-o",
        str(tmp_path / "fit"),
    )  # fmt: skip
    record = json.loads((tmp_path / "fit" / "fit.json").read_text(encoding="utf-8"))
    truth = dict(zip(("sigma", "n", "a", "k", "b", "t"), pbrdf.PAINTS["matte-white-thick"], strict=True))
    for name, value in truth.items():
        found = record["estimates"][name]
        assert abs(found["value"] - value) < 4 * found["standard_error"] < 0.1 * abs(value), name
    assert 0.7 < record["goodness"]["reduced_chi2"] < 1.4


def test_commands_that_mean_one_colour_say_so(run):
    assert (
        "a camera of several colours" in run("plan", "white", "--instrument", "sony_imx250myr", code=2).stderr
    )
    assert "division of focal plane in colours" in run("polarimeter", "sony_imx250myr").stdout


@pytest.mark.slow
def test_the_files_of_the_cases(run, tmp_path, measured, instrument):
    """The strangers' files themselves, where they are."""
    left = measured("../cases/H1-twelve-bits-left-aligned/f.png")
    run("reduce", left, "-p", left.with_name("imx12.toml"), "-o", "h", "--maps", "none", "--no-pictures")
    assert rows(tmp_path / "h" / "summary.csv")[0]["saturated"] == "64"
    run("reduce", left, "-p", left.with_name("imx16.toml"), "-o", "h16", code=2)
    means = measured("../cases/L1-averaged-frames-in-floats/f.npy")
    text = means.with_name("rp.toml").read_text(encoding="utf-8")
    assert "exposures = 100" in run("reduce", means, "-p", means.with_name("rp.toml"), code=2).stderr
    run(
        "reduce",
        means,
        "-p",
        instrument(f"{text}\nexposures = 100\n"),
        "-o",
        "l",
        "--maps",
        "none",
        "--no-pictures",
    )
    (row,) = rows(tmp_path / "l" / "summary.csv")
    assert (float(row["I"]), float(row["dolp"])) == (
        pytest.approx(3000, abs=1),
        pytest.approx(0.316, abs=1e-3),
    )
    color = measured("../cases/L3-colour-polarisation-mosaic/f.png")
    for name in ("imx12.toml", "myr.toml"):
        done = run(
            "reduce", color, "-p", color.with_name(name), "-o", name[:-5], "--maps", "none", "--no-pictures"
        )
        assert "neighbouring cells of polarisers alternate" in done.stderr
    preset = color.with_name("imx12.toml").read_text(encoding="utf-8").replace("mzr", "myr")
    run("reduce", color, "-p", instrument(preset), "-o", "c", "--maps", "none", "--no-pictures")
    found = [float(row["dolp"]) for row in rows(tmp_path / "c" / "summary.csv")]
    assert found == pytest.approx([0.4, 0.2, 0.6], abs=2e-3)
