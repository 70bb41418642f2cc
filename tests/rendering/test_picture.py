"""Pictures of Stokes vectors and their OpenEXR files."""

import math

import numpy as np
import pytest

from pbrdf.errors import DataError
from pbrdf.rendering.picture import StokesPicture, read_exr, write_exr

pytest.importorskip("mitsuba", reason="OpenEXR files are written by mitsuba: pip install 'mitsuba>=3.9'")


@pytest.fixture
def picture(mitsuba):
    rng = np.random.default_rng(4)
    stokes = rng.uniform(-0.4, 0.4, (4, 5, 7))
    stokes[0] = 1.0
    stokes[:, 0, 0] = 0.0
    return StokesPicture(stokes, rng.uniform(0.0, 0.1, (4, 5, 7)), {"spp": 64.0, "title": "a test"})


def test_layers_are_named_and_come_back(mitsuba, picture, tmp_path):
    file = tmp_path / "p.exr"
    write_exr(picture, file, [math.radians(30.0)])
    bitmap = mitsuba.Bitmap(str(file))
    names = {channel.name for channel in bitmap.struct_()}
    assert names == {
        *(f"S{i}.{kind}" for i in range(4) for kind in ("Y", "std")),
        "DoLP.Y",
        "AoLP.Y",
        "polarizer_30.Y",
    }
    values = np.array(bitmap)
    layers = {channel.name.removesuffix(".Y"): values[..., i] for i, channel in enumerate(bitmap.struct_())}
    assert layers["DoLP"] == pytest.approx(picture.dolp, abs=1e-6, nan_ok=True)
    assert layers["AoLP"] == pytest.approx(np.rad2deg(picture.aolp), abs=1e-4, nan_ok=True)
    expected = 0.5 * (
        picture.stokes[0]
        + picture.stokes[1] * math.cos(math.radians(60.0))
        + picture.stokes[2] * math.sin(math.radians(60.0))
    )
    assert layers["polarizer_30"] == pytest.approx(expected, abs=1e-6)
    back = read_exr(file)
    assert back.stokes == pytest.approx(picture.stokes, abs=1e-6)
    assert back.std == pytest.approx(picture.std, abs=1e-7)
    assert back.attrs["title"] == "a test"
    assert back.attrs["spp"] == 64.0
    assert "left circular" in back.attrs["convention"]


def test_bright_light_and_weak_polarisation_are_kept(mitsuba, tmp_path):
    """Channels of 32 bits: halves end at 65504 and know degrees of polarisation in steps of 5e-4 alone."""
    stokes = np.array([1e6, 1.0, -1.0, 0.5])[:, None, None] * np.array([[1.0, 1e-6, 2e5]])
    write_exr(StokesPicture(stokes, np.full_like(stokes, np.nan)), tmp_path / "p.exr")
    channels = mitsuba.Bitmap(str(tmp_path / "p.exr")).struct_()
    assert {c.type for c in channels} == {mitsuba.Struct.Type.Float32}
    assert {c.name for c in channels} == {"S0.Y", "S1.Y", "S2.Y", "S3.Y", "DoLP.Y", "AoLP.Y"}
    back = read_exr(tmp_path / "p.exr")
    assert back.stokes == pytest.approx(stokes, rel=1e-7, abs=0.0)
    assert back.dolp == pytest.approx(math.sqrt(2.0) * 1e-6, rel=1e-6)


def test_unknown_errors_have_no_layer(picture, tmp_path):
    file = tmp_path / "p.exr"
    write_exr(StokesPicture(picture.stokes, np.full_like(picture.std, np.nan)), file)
    assert np.isnan(read_exr(file).std).all()


def test_dolp_and_aolp():
    """Level light has the angle 0°, light that rises to the right +45°, upright light 90°."""
    stokes = np.zeros((4, 1, 4))
    stokes[0] = 2.0
    stokes[1, 0] = [1.0, 0.0, -1.0, 0.0]
    stokes[2, 0] = [0.0, 2.0, 0.0, -2.0]
    picture = StokesPicture(stokes, np.full_like(stokes, np.nan))
    assert picture.dolp[0] == pytest.approx([0.5, 1.0, 0.5, 1.0])
    assert np.rad2deg(picture.aolp[0]) == pytest.approx([0.0, 45.0, 90.0, -45.0])


def test_angles_beside_minus_90_degrees_are_not_rounded_to_it(mitsuba, picture, tmp_path):
    """Single precision has no number between −90° and what U = −1e-10 makes of it: it is the other end."""
    picture.stokes[:, 0, 1] = [1.0, -1.0, -1e-10, 0.0]
    write_exr(picture, tmp_path / "p.exr")
    bitmap = mitsuba.Bitmap(str(tmp_path / "p.exr"))
    layer = [channel.name for channel in bitmap.struct_()].index("AoLP.Y")
    assert np.array(bitmap)[0, 1, layer] == 90.0


def test_where_there_is_no_light_there_is_no_polarisation(picture):
    assert np.isnan(picture.dolp[0, 0])
    assert np.isnan(picture.aolp[0, 0])


def test_a_file_that_cannot_be_written_leaves_nothing_behind(picture, tmp_path):
    with pytest.raises(DataError, match="cannot be written"):
        write_exr(picture, tmp_path / "missing" / "p.exr")
    assert list(tmp_path.iterdir()) == []


def test_a_file_without_the_layers_is_refused(mitsuba, tmp_path):
    file = tmp_path / "rgb.exr"
    mitsuba.Bitmap(np.zeros((2, 2, 3), dtype=np.float32)).write(str(file))
    with pytest.raises(DataError, match=r"no layer S0\.Y"):
        read_exr(file)
    with pytest.raises(DataError, match="cannot be read"):
        read_exr(tmp_path / "nothing.exr")


def test_a_header_that_is_no_text_is_refused(picture, tmp_path):
    """Names of layers and texts of a header are UTF-8; what damage has made of them is told."""
    write_exr(picture, tmp_path / "p.exr")
    whole = (tmp_path / "p.exr").read_bytes()
    for word in (b"a test", b"title", b"S1.Y"):
        damaged = whole.replace(word, b"\xff" + word[1:], 1)
        assert damaged != whole
        (tmp_path / "d.exr").write_bytes(damaged)
        with pytest.raises(DataError, match=r"d\.exr: a name or a text in its header is damaged"):
            read_exr(tmp_path / "d.exr")


def test_standard_errors_of_some_layers_alone_are_not_taken(picture, tmp_path):
    write_exr(picture, tmp_path / "p.exr")
    (tmp_path / "d.exr").write_bytes((tmp_path / "p.exr").read_bytes().replace(b"S1.std", b"S1.sxd", 1))
    found = read_exr(tmp_path / "d.exr")
    np.testing.assert_allclose(found.stokes, picture.stokes, atol=1e-6)
    assert np.isnan(found.std).all()
