"""Meshes made by formulas."""

import numpy as np
import pytest

from pbrdf.rendering.meshes import WHEEL_CENTRE, WHEEL_RADIUS, body_panel, hills


@pytest.fixture(scope="module")
def panel():
    return body_panel(columns=300, rows=240)


def face_normals(mesh):
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    return np.cross(b - a, c - a)


@pytest.mark.parametrize("make", [lambda: body_panel(300, 240), lambda: hills(columns=200)])
def test_normals_have_unit_length_and_agree_with_the_triangles(make):
    mesh = make()
    assert np.linalg.norm(mesh.normals, axis=1) == pytest.approx(1.0)
    flat = face_normals(mesh)
    area = np.linalg.norm(flat, axis=1)
    assert (area > 0.0).all()
    agree = (flat[:, None, :] * mesh.normals[mesh.faces]).sum(-1) / area[:, None]
    # at gaps and sharp lines a triangle may turn away from the average of its neighbours
    assert (agree > 0.0).mean() > 0.999
    assert np.median(agree) > 0.999


def test_the_side_of_the_car_faces_minus_y_and_its_bonnet_up(panel):
    height = panel.vertices[:, 2]
    side = height < 0.6
    bonnet = panel.vertices[:, 1] > 0.4
    assert panel.normals[side, 1].mean() < -0.9
    assert panel.normals[bonnet, 2].mean() > 0.95
    assert panel.vertices[:, 2].min() > 0.1
    assert 0.85 < panel.vertices[:, 2].max() < 1.2


def test_hills_are_seen_from_inside():
    mesh = hills(columns=200)
    inwards = -(mesh.normals[:, :2] * mesh.vertices[:, :2]).sum(1)
    assert (inwards > 0.0).mean() > 0.9
    assert (mesh.vertices[mesh.faces.max(axis=1), 2] >= 0.0).all()


def test_the_wheel_arch_is_open(panel):
    """No triangle lies before the tyre."""
    middle = panel.vertices[panel.faces].mean(axis=1)
    rho = np.hypot(middle[:, 0] - WHEEL_CENTRE[0], middle[:, 2] - WHEEL_CENTRE[1])
    assert rho.min() > WHEEL_RADIUS


@pytest.mark.slow
def test_pieces_of_the_panel_make_up_the_whole(panel):
    pieces = panel.split_along_x(3, -2.0, 1.6)
    assert sum(len(piece.faces) for piece in pieces) == len(panel.faces)
    ends = [piece.vertices[piece.faces].mean(axis=1)[:, 0] for piece in pieces]
    assert [end.max() < 1.0 for end in ends] == [True, True, False]
    assert ends[0].max() == pytest.approx(-0.8, abs=0.02)
    assert ends[1].min() == pytest.approx(-0.8, abs=0.02)
    whole = np.sort(np.linalg.norm(face_normals(panel), axis=1))
    parts = np.sort(np.concatenate([np.linalg.norm(face_normals(piece), axis=1) for piece in pieces]))
    assert parts == pytest.approx(whole)


@pytest.mark.slow
def test_mitsuba_gets_the_same_mesh(mitsuba, panel):
    bsdf = mitsuba.load_dict({"type": "diffuse"})
    shape = panel.to_mitsuba("panel", bsdf)
    params = mitsuba.traverse(shape)
    assert np.array(params["vertex_positions"]).reshape(-1, 3) == pytest.approx(panel.vertices, abs=1e-6)
    assert np.array(params["vertex_normals"]).reshape(-1, 3) == pytest.approx(panel.normals, abs=1e-6)
    assert (np.array(params["faces"]).reshape(-1, 3) == panel.faces).all()
    ray = mitsuba.Ray3f([1.5, -3.0, 0.5], [0.0, 1.0, 0.0])
    hit = mitsuba.load_dict({"type": "scene", "panel": shape}).ray_intersect(ray)
    assert bool(hit.is_valid()[0])
    assert float(hit.sh_frame.n.y[0]) < -0.9
