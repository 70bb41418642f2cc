"""Geometries in words."""

import math
import pickle
from pathlib import Path

import numpy as np
import pytest

from pbrdf.errors import DataError
from pbrdf.instruments.pixel_geometry.camera import Lamp, PixelCamera
from pbrdf.instruments.pixel_geometry.cylinder import Cylinder
from pbrdf.instruments.pixel_geometry.normal_map import AngleMaps, NormalMap
from pbrdf.instruments.pixel_geometry.panel import Panel
from pbrdf.instruments.pixel_geometry.sphere import Sphere
from pbrdf.instruments.pixel_geometry.text_form import GEOMETRY_KINDS, parse_pixel_geometry
from pixel_helpers import blank

R = math.radians
LAMP = Lamp(R(30.0), R(90.0))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("flat", Panel()),
        (
            "flat:theta_i=30,theta_r=40,phi=0,reference=90,fov=20",
            Panel((R(30.0),), (R(40.0),), (0.0,), (R(90.0),), camera=PixelCamera(field_of_view=R(20.0))),
        ),
        (
            "flat:theta_i=30;50,x=3,y=4,focal=900,cx=1,cy=2,distance=1.5,lamp=0.8",
            Panel(
                (R(30.0), R(50.0)),
                at=(3.0, 4.0),
                camera=PixelCamera(900.0, None, (1.0, 2.0)),
                distance=1.5,
                lamp_distance=0.8,
            ),
        ),
        ("sphere:light=30@90", Sphere(lamps=(LAMP,))),
        (
            "sphere:x=1,y=2,r=3,light=30@90;60,lamp=4;5,size=0.5,max=70",
            Sphere(
                x=1.0,
                y=2.0,
                r=3.0,
                lamps=(Lamp(R(30.0), R(90.0), 4.0), Lamp(R(60.0), 0.0, 5.0)),
                size=0.5,
                max_zenith=R(70.0),
            ),
        ),
        (
            "cylinder:x=1,y=2,r=3,angle=80,tilt=5,length=9,light=30@90",
            Cylinder(x=1.0, y=2.0, r=3.0, angle=R(80.0), tilt=R(5.0), length=9.0, lamps=(LAMP,)),
        ),
        ("normals:a/b c.npy,light=30@90", NormalMap(normals=Path("a/b c.npy"), lamps=(LAMP,))),
        ("angles:maps.nc", AngleMaps(Path("maps.nc"))),
    ],
)
def test_words_and_geometries(text, expected):
    assert parse_pixel_geometry(text) == expected


def test_a_mesh_comes_from_the_renderer():
    pytest.importorskip("mitsuba")
    mesh = parse_pixel_geometry("mesh:part.ply,camera=0/-3/1,target=0/0/0.5,fov=20,light=30@90,smooth=no")
    assert (mesh.mesh, mesh.origin, mesh.target) == (Path("part.ply"), (0.0, -3.0, 1.0), (0.0, 0.0, 0.5))
    assert (mesh.lamps, mesh.smooth, mesh.camera.field_of_view) == ((LAMP,), False, R(20.0))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "begin with one of flat, sphere, cylinder, normals, angles, mesh"),
        ("plane:x=1", "begin with one of"),
        ("flat:theta=3", "'theta' is not known; it takes"),
        ("flat:theta_i", "is not KEY=VALUE"),
        ("flat:theta_i=3,theta_i=4", "given twice"),
        ("flat:theta_i=x", "not a number"),
        ("flat:theta_i=inf", "finite"),
        ("flat:x=3", "give x and y, or neither"),
        ("sphere", "name the direction of the light"),
        ("sphere:light=30@90,cx=3", "give cx and cy"),
        ("sphere:light=200@0", "give 0 to 180"),
        ("sphere:light=10;20,lamp=1;2;3", "3 lamp distances for 2 lights"),
        ("normals:light=30@90", "name the file"),
        ("angles", "name the file, angles:FILE"),
        ("angles:a.nc,light=3", "is not known"),
        ("mesh:a.ply,light=3,camera=1/2", "give X/Y/Z"),
        ("mesh:a.ply,light=3", "camera=X/Y/Z"),
        ("mesh:a.ply,light=3,camera=1/2/3,smooth=maybe", "give yes or no"),
    ],
)
def test_mistakes_are_named(text, words):
    if text.startswith("mesh"):
        pytest.importorskip("mitsuba")
    with pytest.raises(DataError, match=words):
        parse_pixel_geometry(text)


@pytest.mark.parametrize(
    "text", ["flat:theta_i=30,theta_r=40,phi=0,reference=90", "sphere:x=1,y=2,r=3,light=30@90"]
)
def test_a_located_geometry_travels_to_other_processes(text):
    geometry = parse_pixel_geometry(text).located(blank(4, 5))
    again = pickle.loads(pickle.dumps(geometry))
    assert again == geometry
    assert again.pixels(np.arange(5), np.arange(4)).identical(geometry.pixels(np.arange(5), np.arange(4)))


def test_kinds_are_listed():
    assert GEOMETRY_KINDS == ("flat", "sphere", "cylinder", "normals", "angles", "mesh")
