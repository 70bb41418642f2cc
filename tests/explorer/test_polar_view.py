"""Polar surfaces: distances and colours of vertices against the Mueller matrix."""

import numpy as np
import pytest

from pbrdf import DoubleGauss, load_paint
from pbrdf.explorer.state import Layer, Light, State, StateError
from pbrdf.explorer.views import polar
from pbrdf.explorer.workspace import Workspace


@pytest.fixture(scope="module")
def paint():
    return DoubleGauss(0.2, 1.6, a=1.5, k=1.2, b=0.3, t=0.6, kappa=0.4)


def drawn(*models, quantity="intensity", scale="linear", light=None, active=0):
    state = State(
        tuple(Layer(str(i), model) for i, model in enumerate(models)),
        active=active,
        light=light or Light(40.0),
        settings={"polar": {"quantity": quantity, "scale": scale}},
    )
    header, buffers = polar.draw(state, Workspace(), dragging=False)
    return header, [np.frombuffer(b, "<f2").reshape(header["shape"]).astype(float) for b in buffers]


def angles(header, row, column):
    rows, columns, _ = header["shape"]
    turn = np.pi if header["halved"] else 2.0 * np.pi
    return header["rim"] * row / (rows - 1), turn * column / (columns - 1)


@pytest.mark.parametrize(
    ("quantity", "value"),
    [
        ("intensity", lambda f, S: S[0]),
        ("dolp", lambda f, S: np.hypot(S[1], S[2]) / S[0]),
        ("u", lambda f, S: S[2] / S[0]),
        ("m23", lambda f, S: f[2, 3] / f[0, 0]),
        ("m11", lambda f, S: f[1, 1] / f[0, 0]),
    ],
)
@pytest.mark.parametrize("stokes", [(1.0, 0.0, 0.0, 0.0), (1.0, 0.3, 0.4, 0.5)])
def test_vertices_are_the_matrix(paint, quantity, value, stokes):
    other = paint.replace(sigma=0.1, t=0.3)
    header, fields = drawn(paint, other, quantity=quantity, light=Light(40.0, stokes))
    for model, field in zip((paint, other), fields, strict=True):
        for row, column in [(10, 7), (45, 33), (60, 100)]:
            f = model.mueller(np.deg2rad(40.0), *angles(header, row, column))
            expected = value(f, f @ np.array(stokes))
            distance, colour, share, _ = field[row, column]
            assert share * header["most"] == pytest.approx(expected, rel=2e-3, abs=1e-3 * header["most"])
            assert distance == abs(share)
            if header["colours"] == "signed":
                assert 2.0 * colour - 1.0 == pytest.approx(share, abs=1e-3)
            else:
                assert colour == distance
    assert max(np.abs(field[..., 0]).max() for field in fields) == 1.0


@pytest.mark.parametrize("quantity", ["intensity", "aolp", "u", "v", "m11", "m02", "m31"])
def test_the_half_that_is_not_sent_is_mirrored(paint, quantity):
    header, [field] = drawn(paint, quantity=quantity, light=Light(40.0, (1.0, 0.3, 0.0, 0.0)))
    whole, [full] = drawn(paint, quantity=quantity, light=Light(40.0, (1.0, 0.3, 0.0, 1e-12)))
    if quantity[0] == "m":
        f = paint.mueller(np.deg2rad(40.0), 0.8, np.array([0.7, -0.7]))[:, int(quantity[1]), int(quantity[2])]
        assert f[1] == pytest.approx(-f[0] if header["mirrored"] else f[0], abs=1e-14)
        assert header["halved"] and whole["halved"]
        return
    assert header["halved"] and not whole["halved"]
    columns = header["shape"][1]
    colour = field[:, -2::-1, 1]
    expected = 1.0 - colour if header["mirrored"] else colour
    found = full[:, columns:, 1]
    difference = np.abs(found - expected)
    if quantity == "aolp":
        difference = np.minimum(difference, 1.0 - difference)
        # only where light is polarised has it an angle
        difference = difference[3:-3]
    assert difference.max() < 4e-3


def test_a_logarithmic_scale_ends_at_its_decades(paint):
    _, [field] = drawn(paint, scale="logarithmic")
    share, distance = field[..., 2], field[..., 0]
    assert distance.max() == 1.0
    lit = share > 10.0**-polar.DECADES
    np.testing.assert_allclose(10.0 ** (polar.DECADES * (distance[lit] - 1.0)), share[lit], rtol=1e-2)


def test_a_narrow_lobe_is_logarithmic_until_a_scale_is_chosen(paint):
    narrow = load_paint("white")

    def scales(model, **settings):
        state = State((Layer("a", model),), light=Light(40.0), settings={"polar": settings})
        return [polar.draw(state, Workspace(), dragging)[0]["scale"] for dragging in (False, True)]

    assert scales(paint) == ["linear"] * 2
    assert scales(narrow) == ["logarithmic"] * 2
    assert scales(narrow, scale="linear") == ["linear"] * 2
    assert scales(narrow, quantity="dolp") == scales(narrow, quantity="aolp") == ["linear"] * 2


def test_what_is_hidden_is_left_out_and_the_active_model_comes_first(paint):
    state = State(
        (Layer("a", paint), Layer("b", paint, shown=False), Layer("c", paint.replace(t=0.2))), active=2
    )
    header, buffers = polar.draw(state, Workspace(), dragging=True)
    assert header["layers"] == [2, 0]
    assert len(buffers) == 2


def test_dark_models_are_drawn(paint):
    header, [field] = drawn(paint, quantity="m03")
    assert np.isfinite(field).all()
    assert header["most"] > 0.0


@pytest.mark.parametrize(
    ("settings", "place"),
    [
        ({"quantity": "colour"}, "settings.polar.quantity"),
        ({"quantity": ["q"]}, "settings.polar.quantity"),
        ({"scale": "cubic"}, "settings.polar.scale"),
        ({"turn": "left"}, "settings.polar.turn"),
    ],
)
def test_errors_name_their_place(paint, settings, place):
    with pytest.raises(StateError) as caught:
        polar.draw(State((Layer("a", paint),), settings={"polar": settings}), Workspace(), False)
    assert caught.value.place == place
