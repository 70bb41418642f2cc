"""Planes over the hemisphere are the Mueller matrix and the Stokes vector of the models, in float16."""

import drjit as dr
import numpy as np
import pytest

import pbrdf
from every_model import EVERY, example
from pbrdf.backend import get_backend
from pbrdf.explorer import evaluation
from pbrdf.explorer.evaluation import DARK, Grid, described, fields, prepare
from pbrdf.explorer.state import QUANTITIES, Layer, Light, State, StateError
from pbrdf.explorer.views import hemisphere, mueller
from pbrdf.explorer.workspace import Workspace
from pbrdf.optics.stokes import aolp, dolp

GRID = Grid(10, 13)
THETA = np.deg2rad(np.linspace(0.0, 90.0, GRID.zeniths))[:, None]
PHI = np.deg2rad(np.linspace(0.0, 180.0, GRID.azimuths))
#: Polarised in every way.
CROSSWISE = (1.0, 0.3, -0.5, 0.4)


def state(*models, light=(1.0, 0.0, 0.0, 0.0), theta_i=40.0, **more):
    layers = tuple(Layer(f"model {i}", model) for i, model in enumerate(models))
    return State(layers, light=Light(theta_i, light), **more)


def whole(picture, planes):
    """A picture for φ ≥ 0 and for φ < 0."""
    return planes[picture.plane].astype(float), picture.sign * planes[picture.mirrored].astype(float)


def truth(model, shown, phi):
    """A function that gives quantities by the public functions, float64."""
    theta_i = np.deg2rad(shown.light.theta_i)
    M = model.mueller(theta_i, THETA, phi, part=shown.part)
    S = M @ np.asarray(shown.light.stokes)
    intensity, m00 = S[..., 0], M[..., 0, 0]

    def expected(quantity):
        if quantity == "intensity":
            return np.log10(np.maximum(intensity, DARK))
        if quantity == "m00":
            return np.log10(np.maximum(m00, DARK))
        with np.errstate(invalid="ignore", divide="ignore"):
            if quantity in ("dolp", "aolp"):
                found = dolp(S) if quantity == "dolp" else np.rad2deg(aolp(S))
            elif quantity in "quv":
                found = S[..., "iquv".index(quantity)] / intensity
            else:
                return np.where(m00 > DARK, M[..., int(quantity[1]), int(quantity[2])] / m00, 0.0)
        return np.where(intensity > DARK, found, 0.0)

    return expected


def assert_shown(found, wanted, quantity, polarised, tolerance=6e-4):
    if quantity == "aolp":
        # an axis; of light that is hardly polarised it may be any
        error = np.abs((found - wanted + 90.0) % 180.0 - 90.0)
        assert (error[polarised > 0.01] < 0.1).all()
        return
    np.testing.assert_allclose(found, wanted, rtol=tolerance, atol=tolerance, err_msg=quantity)


def compare(shown, quantities, dragging=False, tolerance=6e-4):
    pictures, planes = fields(shown, quantities, GRID, dragging)
    assert planes.dtype == np.float16
    assert [p.quantity for p in pictures] == list(quantities)
    truths = [truth(shown.shown.model, shown, phi) for phi in (PHI, -PHI)]
    for picture in pictures:
        for half, expected in zip(whole(picture, planes), truths, strict=True):
            assert_shown(half, expected(picture.quantity), picture.quantity, expected("dolp"), tolerance)
            inside = half[: int(0.95 * (GRID.zeniths - 1)) + 1]
            if picture.quantity != "aolp":
                assert picture.extent[0] <= inside.min()
                assert inside.max() <= picture.extent[1]


@pytest.mark.slow
@EVERY
def test_every_model_in_any_light(cls):
    for light in ((1.0, 0.0, 0.0, 0.0), CROSSWISE):
        compare(state(example(cls, 1), light=light), QUANTITIES)


@pytest.mark.parametrize("part", ["total", "specular", "diffuse"])
def test_parts(white, part):
    compare(state(white, part=part), ("intensity", "dolp", "u"))


@pytest.mark.parametrize("light", [(2.0, -0.5, 0.0, 0.0), (1.0, 0.0, 0.0, 0.7)])
def test_light_along_the_plane_of_incidence_and_circular_light(white, light):
    compare(state(white, light=light), ("intensity", "aolp", "q", "u", "v", "m12"))


def test_dragging_takes_little_off_the_accuracy(white):
    compare(state(white.replace(sigma=0.1)), ("intensity", "dolp", "q"), dragging=True, tolerance=3e-3)


def test_mirror_signs(white):
    # the mirror image of the experiment turns U and V round, and leaves I and Q
    pictures, _ = fields(state(white), QUANTITIES, GRID, False)
    signs = {p.quantity: p.sign for p in pictures}
    assert [signs[q] for q in ("intensity", "dolp", "aolp", "q", "u", "v")] == [1, 1, -1, 1, -1, -1]
    K = np.diag([1, 1, -1, -1])
    np.testing.assert_array_equal(
        [[signs[f"m{i}{j}"] for j in range(4)] for i in range(4)], K @ np.ones((4, 4)) @ K
    )
    assert all(p.plane == p.mirrored for p in pictures)
    # light with U or V has no mirror symmetry: only the matrix has
    pictures, _ = fields(state(white, light=CROSSWISE), QUANTITIES, GRID, False)
    assert all((p.plane == p.mirrored) == p.quantity.startswith("m") for p in pictures)


def test_nothing_is_seen_along_the_horizon(white):
    pictures, planes = fields(state(white), ("intensity", "q", "aolp"), GRID, False)
    assert (planes[pictures[0].plane][-1] == np.log10(DARK)).all()
    assert (planes[1:, -1] == 0.0).all()
    assert pictures[0].extent[0] > -8.0


def test_difference_of_two_models(white):
    other = pbrdf.load_paint("pearl-white")
    quantities = ("intensity", "dolp", "aolp", "u", "m11", "m00")
    shown = state(white, other, compare=1, light=CROSSWISE)
    pictures, planes = fields(shown, quantities, GRID, False)
    truths = [[truth(model, shown, phi) for model in (white, other)] for phi in (PHI, -PHI)]
    for picture in pictures:
        for half, both in zip(whole(picture, planes), truths, strict=True):
            a, b = (expected(picture.quantity) for expected in both)
            if picture.quantity == "aolp":
                assert np.abs(half).max() <= 90.0
                np.testing.assert_allclose(
                    np.cos(np.deg2rad(2 * half)), np.cos(np.deg2rad(2 * (a - b))), atol=0.02
                )
            else:
                np.testing.assert_allclose(half, a - b, rtol=1e-3, atol=1e-4, err_msg=picture.quantity)


def test_axes_across_each_other_differ_by_plus_90_degrees():
    angles = np.array([[90.0, 0.0], [0.0, 90.0], [-45.0, 45.0], [45.0, -45.0], [80.0, -80.0]]).T
    found = evaluation._difference("aolp", *(get_backend().Float32(one) for one in angles)).numpy()
    np.testing.assert_allclose(found, [90.0, 90.0, 90.0, 90.0, -20.0], atol=1e-4)


def test_a_model_does_not_differ_from_itself(white):
    _, planes = fields(state(white, white, compare=1), QUANTITIES, GRID, False)
    assert (planes == 0.0).all()


def test_a_move_compiles_nothing(white):
    quantities = ("intensity", "dolp")

    def work():
        fields(state(white), quantities, GRID, True)

    thread = prepare(state(white), quantities, work)
    if thread is not None:
        thread.join()
    fields(state(white), quantities, GRID, False)
    dr.kernel_history_clear()
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        for sigma, theta_i in ((0.05, 20.0), (0.07, 60.0), (0.02, 0.0)):
            fields(state(white.replace(sigma=sigma, n=1.5 + sigma), theta_i=theta_i), quantities, GRID, True)
        kernels = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]
    assert len(kernels) == 6  # the model, then the quantities
    assert all(k["cache_hit"] for k in kernels)
    assert prepare(state(white), quantities, work) is None


def test_what_the_page_is_told(white):
    shown = state(
        white,
        quantities=("intensity", "aolp", "m21"),
        settings={"hemisphere": {"range": {"m21": [-0.5, 0.5]}}},
    )
    header, [buffer] = hemisphere.draw(shown, Workspace(), True)
    assert header["grid"] == [181, 181]
    # the last is DoLP, for the angles alone
    assert buffer.nbytes == 4 * 181 * 181 * 2
    assert [p.get("polarised") for p in header["pictures"]] == [None, [3, 3], None]
    strength = np.frombuffer(buffer, np.float16).reshape(4, 181, 181)[3]
    whole_dolp = fields(shown, ("dolp",), hemisphere.GRID, True)[1][0]
    np.testing.assert_allclose(strength.astype(float), whole_dolp.astype(float), atol=1e-3)
    assert [p["colours"] for p in header["pictures"]] == ["sequential", "cyclic", "signed"]
    assert [p["range"] for p in header["pictures"]] == [None, None, (-0.5, 0.5)]
    header, [buffer] = mueller.draw(shown, Workspace(), True)
    assert [p["quantity"] for p in header["pictures"]] == list(mueller.ELEMENTS)
    assert buffer.nbytes == 16 * 91 * 91 * 2


def test_differences_have_signed_colours(white):
    pictures, _ = fields(state(white, white, compare=0), ("intensity", "dolp", "aolp"), GRID, True)
    told = [described(p, True) for p in pictures]
    assert [t["colours"] for t in told] == ["signed", "signed", "cyclic"]
    assert not told[0]["logarithmic"]


@pytest.mark.parametrize(
    ("ranges", "place"),
    [
        ([0, 1], "settings.hemisphere.range"),
        ({"x": [0, 1]}, "settings.hemisphere.range"),
        ({"dolp": 1}, "settings.hemisphere.range.dolp"),
        ({"dolp": [0, "1"]}, "settings.hemisphere.range.dolp"),
        ({"dolp": [1, 0]}, "settings.hemisphere.range.dolp"),
        ({"intensity": [0, 1]}, "settings.hemisphere.range.intensity"),
    ],
)
def test_ranges_that_are_none(white, ranges, place):
    with pytest.raises(StateError) as error:
        hemisphere.draw(state(white, settings={"hemisphere": {"range": ranges}}), Workspace(), True)
    assert error.value.place == place
