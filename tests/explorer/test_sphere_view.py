"""The lit ball: radiances and frames of the picture against the Mueller matrix and vectors worked out here."""

import threading

import drjit as dr
import numpy as np
import pytest

from pbrdf import DoubleGauss
from pbrdf.explorer.state import Layer, Light, State, StateError
from pbrdf.explorer.views import sphere
from pbrdf.explorer.workspace import Workspace
from pbrdf.instruments.pixel_geometry.camera import Lamp

SHAPE = (31, 25)
VIEW = np.array([0.0, 0.0, 1.0])
#: Rows and columns of a turn.
PLACES = [(7, 3), (12, 20), (20, 29), (25, 46), (29, 11)]


@pytest.fixture(scope="module")
def paint():
    return DoubleGauss(0.2, 1.6, a=1.5, k=1.2, b=0.3, t=0.6, kappa=0.4)


def coherency(S):
    """⟨E E*⟩ of a Stokes vector, with V = 2 Im(E_x E_y*)."""
    i, q, u, v = S
    return 0.5 * np.array([[i + q, u + 1j * v], [u - 1j * v, i - q]])


def stokes(C):
    return np.array([C[0, 0] + C[1, 1], C[0, 0] - C[1, 1], 2.0 * C[0, 1].real, 2.0 * C[0, 1].imag]).real


def frame(k, normal):
    """(p, s) as docs/conventions.md writes them, rows."""
    s = np.cross(k, normal)
    s /= np.linalg.norm(s)
    return np.stack([np.cross(s, k), s])


def seen(model, lamp, light, row, column, part="total"):
    """Stokes radiance in the camera's axes by turning fields, not Stokes vectors."""
    theta_r = np.deg2rad(sphere.RIM) * row / (SHAPE[0] - 1)
    around = lamp.azimuth + 2.0 * np.pi * column / (2 * SHAPE[1] - 2)
    n = np.array([np.sin(theta_r) * np.cos(around), np.sin(theta_r) * np.sin(around), np.cos(theta_r)])
    source = lamp.direction
    cosine = n @ source
    if cosine <= 0.0:
        return np.zeros(4)
    flat_i, flat_r = -(source - cosine * n), VIEW - (VIEW @ n) * n
    phi = np.arctan2(np.cross(flat_i, flat_r) @ n, flat_i @ flat_r)
    there = frame(-source, n)
    turn = there @ frame(-source, VIEW).T
    incident = stokes(turn @ coherency(light) @ turn.T)
    S = model.mueller(np.arccos(cosine), theta_r, phi, part=part) @ incident
    back = np.eye(3)[:2] @ frame(VIEW, n).T
    return cosine * stokes(back @ coherency(S) @ back.T)


@pytest.mark.parametrize("polarised", [(1.0, 0.0, 0.0, 0.0), (1.0, 0.6, 0.0, 0.0), (1.0, 0.4, -0.5, 0.3)])
@pytest.mark.parametrize("lamp", [Lamp(0.7, 2.1), Lamp(1.9, -0.4)])
def test_pixels_are_the_matrix_in_the_cameras_frame(paint, lamp, polarised):
    field = sphere.picture(paint, lamp, Light(stokes=polarised), "total", SHAPE)
    for row, column in PLACES:
        expected = seen(paint, lamp, polarised, row, column)
        L, *shares = field[row, column]
        assert L * np.array([1.0, *shares]) == pytest.approx(expected, rel=2e-5, abs=2e-6)
    assert sum(seen(paint, lamp, polarised, *place)[0] > 0.0 for place in PLACES) >= 2


def test_half_of_the_directions_make_the_whole_picture(paint):
    lamp = Lamp(0.9, 4.0)
    half = sphere.picture(paint, lamp, Light(stokes=(1.0, 0.3, 0.0, 0.0)), "total", SHAPE)
    # any V asks for all directions
    whole = sphere.picture(paint, lamp, Light(stokes=(1.0, 0.3, 0.0, 1e-12)), "total", SHAPE)
    np.testing.assert_allclose(half, whole, rtol=0.0, atol=2e-6)


@pytest.mark.parametrize(
    ("azimuth", "q"),
    [(90.0, 1.0), (270.0, 1.0), (0.0, -1.0), (180.0, -1.0)],
)
def test_what_the_surface_mirrors_is_polarised_tangentially(paint, azimuth, q):
    """A lamp above: the highlight lies above the middle, and its s polarisation is level there; beside, upright."""
    lamp = Lamp(np.deg2rad(100.0), np.deg2rad(azimuth))
    glass = paint.replace(kappa=0.0)
    field = sphere.picture(glass, lamp, Light(), "specular", (180, 25))
    highlight = field[100, 0]  # a normal 50° from the line of sight, on the lamp's side
    assert highlight[1] * q > 0.8
    assert abs(highlight[2]) < 1e-5


def test_a_lamp_beside_the_camera_gives_the_middle_of_the_hemisphere(paint):
    """Lit and seen along the normal the picture does not depend on where the lamp came from."""
    light = Light(stokes=(1.0, 0.5, 0.2, 0.1))
    middle = [sphere.picture(paint, Lamp(polar, 0.0), light, "total", SHAPE)[0, 5] for polar in (0.0, 1e-7)]
    np.testing.assert_allclose(middle[0], middle[1], rtol=1e-4)


def test_polarisers_of_the_dial():
    rows = np.frombuffer(sphere._polarisers(), "<f4").reshape(sphere.POLARISERS, 4)
    np.testing.assert_allclose(rows[0] + rows[180], [1.0, 0.0, 0.0, 0.0], atol=1e-7)
    np.testing.assert_allclose(rows[90], [0.5, 0.0, 0.5, 0.0], atol=1e-7)  # 45°
    np.testing.assert_allclose(rows[-1], rows[0], atol=1e-6)


@pytest.mark.slow
def test_buffers(paint):
    state = State((Layer("a", paint), Layer("b", paint.replace(sigma=0.1))), compare=1)
    header, buffers = sphere.draw(state, Workspace(), dragging=False)
    rows, columns, channels = header["shape"]
    assert channels == 4
    assert header["models"] == ["a", "b"]
    assert [len(b) for b in buffers] == [2 * rows * columns * 4] * 2 + [sphere.POLARISERS * 16]
    first, second = (np.frombuffer(b, "<f2").reshape(header["shape"]).astype(float) for b in buffers[:2])
    lamp = Lamp(*np.deg2rad(header["lamp"]))
    exact = sphere.picture(paint, lamp, Light(), "total", sphere.REST)
    np.testing.assert_allclose(first, exact, rtol=1e-3, atol=1e-3)
    largest = np.abs(first - second)[..., 0].max()
    assert largest <= header["ranges"]["radiance"] < 3.0 * largest
    np.testing.assert_allclose(first[:, 0], first[:, -1], rtol=1e-3, atol=1e-6)


@pytest.mark.slow
def test_a_move_compiles_nothing(paint):
    def drawn(dragging, **changes):
        lamp = {"light": {"polar": changes.pop("polar", 40.0), "azimuth": 10.0}}
        return sphere.draw(
            State((Layer("a", paint.replace(**changes)),), settings={"sphere": lamp}), Workspace(), dragging
        )

    drawn(False)
    for thread in threading.enumerate():
        if thread.name == "pbrdf compiles":
            thread.join()
    dr.kernel_history_clear()
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        for sigma, polar in ((0.1, 20.0), (0.3, 100.0)):
            drawn(True, sigma=sigma, polar=polar)
        kernels = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]
    assert len(kernels) == 2
    assert all(k["cache_hit"] for k in kernels)


@pytest.mark.parametrize(
    ("settings", "place"),
    [
        ({"light": 3}, "settings.sphere.light"),
        ({"light": {"polar": "high"}}, "settings.sphere.light.polar"),
        ({"light": {"polar": 200}}, "settings.sphere.light.polar"),
        ({"mode": "x-ray"}, "settings.sphere.mode"),
        ({"exposure": None}, "settings.sphere.exposure"),
        ({"polariser": [1]}, "settings.sphere.polariser"),
    ],
)
def test_errors_name_their_place(paint, settings, place):
    with pytest.raises(StateError) as caught:
        sphere.draw(State((Layer("a", paint),), settings={"sphere": settings}), Workspace(), False)
    assert caught.value.place == place
