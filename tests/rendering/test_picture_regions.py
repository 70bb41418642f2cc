"""Stokes pictures as Mitsuba's own integrator writes them: signs, colours, regions, data sets."""

from __future__ import annotations

import numpy as np
import pytest

from pbrdf.data.readers import read
from pbrdf.errors import DataError
from pbrdf.rendering.picture import StokesPicture, read_exr, read_exr_colors, write_exr

pytest.importorskip("mitsuba", reason="OpenEXR files are written by mitsuba: pip install 'mitsuba>=3.9'")

LAYERS = [f"S{i}.{c}" for i in range(4) for c in "RGB"]


def mitsuba_exr(mi, path, stokes):
    """A file with the layers of Mitsuba's integrator; stokes has the shape (4, 3, rows, columns), Mitsuba's signs."""
    names = ["R", "G", "B", *LAYERS]
    values = np.concatenate([stokes[0], stokes.reshape(12, *stokes.shape[2:])])
    bitmap = mi.Bitmap(
        np.ascontiguousarray(np.moveaxis(values, 0, -1), dtype=np.float32),
        pixel_format=mi.Bitmap.PixelFormat.MultiChannel,
        channel_names=names,
    )
    bitmap.write(str(path))


def colored(rows=6, columns=8):
    light = np.array([[2.0, 3.0, 4.0], [0.4, 0.3, -0.8], [0.2, 0.0, 0.4], [0.1, -0.3, 0.2]])
    return light[:, :, None, None] * np.ones((rows, columns))


def test_layers_of_mitsuba(mitsuba, tmp_path):
    """Each colour apart; S3 changes its sign, as Mitsuba counts right circular light positive."""
    mitsuba_exr(mitsuba, tmp_path / "a.exr", colored())
    found = read_exr_colors(tmp_path / "a.exr")
    assert list(found) == ["R", "G", "B"]
    np.testing.assert_allclose(found["R"].stokes[:, 0, 0], [2.0, 0.4, 0.2, -0.1], rtol=1e-6)
    np.testing.assert_allclose(found["B"].stokes[:, 5, 7], [4.0, -0.8, 0.4, -0.2], rtol=1e-6)
    with pytest.raises(DataError, match="it has the colours R, G, B"):
        read_exr(tmp_path / "a.exr")
    # one wavelength in all three
    mitsuba_exr(mitsuba, tmp_path / "b.exr", np.repeat(colored()[:, :1], 3, axis=1))
    assert list(read_exr_colors(tmp_path / "b.exr")) == [""]
    np.testing.assert_allclose(read_exr(tmp_path / "b.exr").stokes[:, 0, 0], [2.0, 0.4, 0.2, -0.1], rtol=1e-6)


def test_what_mitsuba_itself_renders(mitsuba, tmp_path):
    """A dielectric sphere in even light, rendered and written by Mitsuba alone: the picture is that of our own
    renderer, and near its rim light is polarised along it, as reflection at the surface makes it."""
    from pbrdf.rendering.render import render_stokes

    scene = mitsuba.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "stokes", "nested": {"type": "path", "max_depth": 3}},
            "sensor": {
                "type": "perspective",
                "fov": 40,
                "to_world": mitsuba.ScalarTransform4f().look_at([0, -4, 0], [0, 0, 0], [0, 0, 1]),
                "film": {"type": "hdrfilm", "width": 16, "height": 16, "rfilter": {"type": "box"}},
                "sampler": {"type": "independent", "sample_count": 64},
            },
            "light": {"type": "constant"},
            "ball": {
                "type": "sphere",
                "bsdf": {"type": "pplastic", "diffuse_reflectance": 0.02, "alpha": 0.1},
            },
        }
    )
    mitsuba.render(scene, seed=1)
    scene.sensors()[0].film().bitmap().write(str(tmp_path / "ball.exr"))
    found = read_exr(tmp_path / "ball.exr")
    ours = render_stokes(scene, spp=64, depth=3)
    for i in range(4):
        assert found.stokes[i].mean() == pytest.approx(ours.stokes[i].mean(), abs=0.01)
    # Q > 0 is horizontal: the reflection at the right rim is vertical, that at the top horizontal
    assert found.stokes[1][7:9, 12:14].mean() < -0.01
    assert found.stokes[1][2:4, 7:9].mean() > 0.01


@pytest.mark.slow
def test_reduce_command(mitsuba, tmp_path):
    from typer.testing import CliRunner

    from pbrdf.cli.main import app

    rng = np.random.default_rng(0)
    stokes = colored() + rng.normal(0, 0.01, (4, 3, 6, 8))
    mitsuba_exr(mitsuba, tmp_path / "a.exr", stokes)
    (tmp_path / "angles.csv").write_text("series,theta_i,theta_r,reference_angle\na,30,40,90\n")
    done = CliRunner().invoke(
        app,
        ["reduce", str(tmp_path / "a.exr"), "--roi", "paint=1:7,1:5", "--angles", str(tmp_path / "angles.csv"),
         "-o", str(tmp_path / "r")],
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    ds = read(tmp_path / "r" / "paint.csv")
    assert ds.attrs["quantity"] == "radiance"
    red = ds.isel(geometry=ds["group"].values.tolist().index("R"))
    # the camera's x axis lies along s: Q and U change their signs, and Mitsuba's S3 too
    for name, value in (("I", 2.0), ("Q", -0.4), ("U", -0.2), ("V", -0.1)):
        assert float(red[name]) == pytest.approx(value, abs=0.01)
        assert 0.0005 < float(red[f"{name}_std"]) < 0.01
    # a picture of pbrdf render
    write_exr(StokesPicture(stokes[:, 0], np.full((4, 6, 8), 0.02)), tmp_path / "b.exr")
    done = CliRunner().invoke(app, ["reduce", str(tmp_path / "b.exr"), "-o", str(tmp_path / "s"), "-q"])
    assert done.exit_code == 0, done.output
    assert "b,(whole picture),48,48" in (tmp_path / "s" / "summary.csv").read_text()
    done = CliRunner().invoke(app, ["reduce", str(tmp_path / "angles.csv"), "-o", str(tmp_path / "t")])
    assert done.exit_code == 2 and "say what took the frames" in done.output
