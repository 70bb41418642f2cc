"""The real picture of four film polarisers before a window (see tests/instruments/reduction/test_dofp_picture.py), as a
flat scene: its pixels in the axes of a panel, and each polariser as one geometry.

It is a picture in transmitted light, so no paint is to be had from it; what can be said is that the polarisers keep
their angles through pixels, axes and labels, and that no ball or cylinder is found among them without being one.
"""

import math

import numpy as np
import pytest
import xarray as xr

from pbrdf.errors import DataError
from pbrdf.instruments.frames.frame_files import open_frames
from pbrdf.instruments.pixel_geometry.geometries import as_geometries
from pbrdf.instruments.pixel_geometry.labels import label_map
from pbrdf.instruments.pixel_geometry.map_dataset import map_dataset
from pbrdf.instruments.pixel_geometry.text_form import parse_pixel_geometry
from pbrdf.instruments.polarimeter.presets import preset
from pbrdf.instruments.reduction.map_files import MapWriter
from pbrdf.instruments.reduction.reduce import reduce
from pbrdf.instruments.reduction.regions import Ellipse

#: Within each polariser, and its AoLP in the picture, degrees.
POLARIZERS = {
    "first": (Ellipse(195, 548, 85, 85), 83.0),
    "second": (Ellipse(505, 548, 85, 85), 44.0),
    "third": (Ellipse(780, 550, 85, 85), -5.0),
    "fourth": (Ellipse(1055, 557, 85, 85), -45.0),
}


@pytest.fixture(scope="module")
def pictures(measured, tmp_path_factory):
    path = measured("dofp-polarizers/polarizer_IMX250MZR.png")
    camera = preset("sony_imx250mzr")
    frames = open_frames(path, camera)
    target = tmp_path_factory.mktemp("dofp") / "stokes.nc"
    reduce(frames, camera, [MapWriter(target, frames, camera)], weighted=False)
    with xr.open_dataset(target, engine="h5netcdf") as file:
        return file.load()


@pytest.mark.slow
@pytest.mark.parametrize("reference", [0.0, 90.0, 30.0])
def test_each_polariser_keeps_its_angle(pictures, reference):
    """The AoLP of (p, s) is that of the picture plus the reference angle, from p to the picture's horizontal."""
    labels = label_map({name: region for name, (region, _) in POLARIZERS.items()}, 1024, 1224)
    rows = {"y": slice(450, 660)}
    flat = parse_pixel_geometry(f"flat:theta_i=20,theta_r=20,phi=0,reference={reference}")
    data = map_dataset(pictures.isel(rows), flat)
    found = as_geometries(data, labels.isel(rows))
    assert list(found) == list(POLARIZERS)
    for name, (_, known) in POLARIZERS.items():
        (value,), (q,), (u,) = (found[name][c].values for c in "IQU")
        angle = math.degrees(0.5 * math.atan2(u, q))
        assert (angle - known - reference + 90.0) % 180.0 - 90.0 == pytest.approx(0.0, abs=1.3)
        assert 0.35 < math.hypot(q, u) / value < 0.6
        assert found[name].attrs["pixels"] > 20_000
        assert 0.0 < float(found[name].I_std[0]) < 0.01 * value


@pytest.mark.slow
def test_the_perspective_of_its_lens_turns_the_axes_little(pictures):
    """With a field of view of 20° the angle of view of a panel at 20° runs over the picture from about 10° to 30°, and
    p turns by some degrees towards its corners: the same light, but for the axes."""
    rows = {"y": slice(450, 660)}
    flat = parse_pixel_geometry("flat:theta_i=20,theta_r=20,phi=0,reference=0,fov=20").located(pictures)
    geometry = flat.pixels(pictures.x.values, pictures.y.values[rows["y"]])
    assert math.degrees(float(geometry.theta_r.min())) == pytest.approx(10.0, abs=0.5)
    assert math.degrees(float(geometry.theta_r.max())) == pytest.approx(30.0, abs=0.5)
    part = pictures.isel(rows)
    data = map_dataset(part, geometry)
    np.testing.assert_allclose(data.I.values[0], part.I.values[0], rtol=1e-6)
    linear = np.hypot(part.Q.values[0], part.U.values[0])
    np.testing.assert_allclose(np.hypot(data.Q.values[0], data.U.values[0]), linear, rtol=1e-5)


@pytest.mark.slow
def test_no_ball_and_no_cylinder_is_in_it(pictures):
    for kind in ("sphere", "cylinder"):
        with pytest.raises(DataError, match=r"round outline|edges"):
            parse_pixel_geometry(f"{kind}:light=10@0").located(pictures)
