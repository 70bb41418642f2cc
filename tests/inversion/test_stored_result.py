"""A fit that was saved comes back as it was."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import pbrdf
from own_model import LambertGGX
from pbrdf.errors import DataError, ModelError
from pbrdf.inversion.stored_result import read_result, write_result
from pbrdf.models import MODELS


def same(a, b) -> bool:
    """Equal to the last bit, in whatever the fields of a fit are made of."""
    if isinstance(a, np.ndarray):
        return a.dtype.kind == b.dtype.kind and np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
    if hasattr(a, "identical"):
        return a.identical(b)
    if dataclasses.is_dataclass(a):
        return type(a) is type(b) and all(
            same(getattr(a, f.name), getattr(b, f.name)) for f in dataclasses.fields(a)
        )
    if isinstance(a, dict):
        return list(a) == list(b) and all(same(a[k], b[k]) for k in a)
    if isinstance(a, list | tuple):
        return type(a) is type(b) and len(a) == len(b) and all(map(same, a, b))
    return a == b or (a != a and b != b)


ARGUMENTS = {
    "held out": {"hold_out": "group=3"},
    "stepwise with angles and a prior": {
        "strategy": "stepwise",
        "nuisances": ["angle:group"],
        "priors": {"n": (1.6, 0.1)},
    },
    "free for each group": {"split": {"a": "group"}, "loss": "cauchy", "noise": "0.02,0.01"},
}


@pytest.fixture(scope="module", params=ARGUMENTS, ids=lambda name: name.replace(" ", "-"))
def result(request):
    return pbrdf.fit(pbrdf.open_experiment("matte-white-thick"), starts=4, **ARGUMENTS[request.param])


@pytest.mark.slow
def test_every_field_comes_back_bit_for_bit(result, tmp_path):
    write_result(result, tmp_path / "fit.nc")
    again = read_result(tmp_path / "fit.nc")
    for f in dataclasses.fields(result):
        assert same(getattr(result, f.name), getattr(again, f.name)), f.name


@pytest.mark.slow
def test_a_saved_fit_can_be_taken_up_again(tmp_path):
    result = pbrdf.fit(pbrdf.open_experiment("white"), starts=4, hold_out="group=3")
    written = result.save(tmp_path / "white")
    assert {path.name for path in written} >= {"summary.txt", "model.json", "fit.nc"}
    for place in (tmp_path / "white", tmp_path / "white" / "fit.nc"):
        again = pbrdf.load_fit(place)
        assert str(again) == str(result)
        assert again.profile(["n"], points=5).intervals == result.profile(["n"], points=5).intervals


@pytest.mark.slow
def test_a_model_of_ones_own_must_be_known_before(tmp_path):
    paint = LambertGGX(0.1, 1.5, 0.3)
    theta = np.deg2rad(np.arange(0.0, 80.0, 5.0))
    stokes = paint.stokes(theta, theta[::-1], 0.0)
    data = pbrdf.make_dataset(
        theta, theta[::-1], np.zeros(16), quantity="brdf", I=stokes[:, 0], Q=stokes[:, 1]
    )
    write_result(pbrdf.fit(data, LambertGGX, starts=2), tmp_path / "fit.nc")
    known = MODELS._classes.pop(LambertGGX.name, None)
    try:
        with pytest.raises(ModelError, match=r"fit.nc: unknown model 'lambert-ggx'"):
            read_result(tmp_path / "fit.nc")
        pbrdf.register(LambertGGX)
        assert read_result(tmp_path / "fit.nc").model.values["alpha"] == pytest.approx(0.1, rel=1e-3)
    finally:
        MODELS._classes.pop(LambertGGX.name, None)
        if known is not None:
            pbrdf.register(known)


def test_what_is_no_fit_is_refused(tmp_path):
    with pytest.raises(DataError, match="there is no such file"):
        pbrdf.load_fit(tmp_path)
    (tmp_path / "fit.nc").write_text("theta_i,I\n", encoding="utf-8")
    with pytest.raises(DataError, match=r"fit.nc: "):
        pbrdf.load_fit(tmp_path)
    pbrdf.write(pbrdf.open_experiment("white"), tmp_path / "data.nc")
    with pytest.raises(DataError, match=r"not the file of a fit|cannot be read as a fit"):
        pbrdf.load_fit(tmp_path / "data.nc")
