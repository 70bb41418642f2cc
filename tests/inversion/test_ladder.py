"""The ladder: readings, ablations, models that are the same by other words, variations, models of one's own."""

from __future__ import annotations

from typing import ClassVar

import pytest

import pbrdf
from own_model import LambertGGX
from pbrdf.errors import ModelError
from pbrdf.inversion.ladder import Rung, ladder, with_robust_loss, with_source
from pbrdf.models import MODELS, DoubleGauss, Model


def names(found):
    return [rung.name for rung in found.rungs]


def test_readings_and_ablations_of_the_double_gauss():
    found = ladder(["double-gauss", "reciprocal-double-gauss"])
    # without polarised body light the three readings are one model, which is fitted once
    assert names(found) == [
        "double-gauss, unpolarised body",
        "double-gauss",
        "double-gauss, visible",
        "reciprocal-double-gauss",
    ]
    ablated = found.rungs[0]
    assert ablated.fix == {"t": 0.0} and ablated.free == 5
    assert [(step.simple, step.rich) for step in found.steps] == [
        (ablated.name, "double-gauss"),
        (ablated.name, "double-gauss, visible"),
        (ablated.name, "reciprocal-double-gauss"),
    ]
    assert {step.assumption for step in found.steps} == {"unpolarised body (t = 0)"}


def test_every_registered_model_has_its_rung_and_the_simple_ones_come_first():
    found = ladder()
    assert {rung.cls.name for rung in found.rungs} == set(MODELS)
    free = [rung.free for rung in found.rungs]
    assert free == sorted(free)


def test_a_model_of_ones_own_by_class_by_file_and_with_values():
    assert names(ladder([LambertGGX])) == ["lambert-ggx"]
    given = LambertGGX(0.1, 1.5, 0.3)
    assert ladder([given]).rungs[0].model is given
    paint = pbrdf.load_paint("white").replace(normalization="visible")
    chosen = ladder([paint])
    assert [rung.model for rung in chosen.rungs] == [paint, paint]
    assert "double-gauss, visible" not in names(chosen)


class HalfGGX(LambertGGX):
    """The same facets; without its body it is another model than the one with a body of 0.5."""

    name = "half-ggx"
    ablations: ClassVar = {"half body": {"rho": 0.5}, "black body": {"rho": 0.0}}


def test_ablations_that_differ_stay_apart():
    assert names(ladder([HalfGGX])) == ["half-ggx, half body", "half-ggx, black body", "half-ggx"]


def test_a_rung_is_taken_as_it_is_and_only_once():
    rung = Rung("mine", DoubleGauss, {"shadowing": "smith"}, {"kappa": 0.1}, ("source",), "huber")
    assert ladder([rung, rung]).rungs == (rung,)


def test_variations():
    plain = Rung("x", DoubleGauss)
    robust, step = with_robust_loss(plain)
    assert (robust.name, robust.nuisances, robust.loss) == ("x + cauchy", (), "cauchy")
    assert (step.simple, step.rich) == ("x", "x + cauchy")
    wide, step = with_source(robust)
    assert (wide.name, wide.nuisances, wide.loss) == ("x + cauchy + source", ("source",), "cauchy")
    assert (step.simple, step.rich) == ("x + cauchy", "x + cauchy + source")
    assert with_robust_loss(wide) is None and with_source(wide) is None


def test_unknown_models_and_none():
    with pytest.raises(ModelError, match="unknown model 'phong': known are double-gauss"):
        ladder(["phong"])
    with pytest.raises(ModelError, match="no model to compare"):
        ladder([])


def test_declarations_are_checked():
    body = {"name": "wrong", "parameters": LambertGGX.parameters, "kernel": LambertGGX.kernel}
    with pytest.raises(TypeError, match="the ablation 'flat' cannot hold roughness at 0"):
        type("Wrong", (Model,), {**body, "ablations": {"flat": {"roughness": 0.0}}})
    with pytest.raises(TypeError, match="the ablation 'flat' cannot hold alpha at -1"):
        type("Wrong", (Model,), {**body, "ablations": {"flat": {"alpha": -1.0}}})
    with pytest.raises(TypeError, match="the reading 'other' has no choice shadowing='smith'"):
        type("Wrong", (Model,), {**body, "readings": {"other": {"shadowing": "smith"}}})
