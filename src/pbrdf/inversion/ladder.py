"""The models that a comparison fits, from simple to rich, and which assumption lies between two of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pbrdf.errors import ModelError
from pbrdf.models import MODELS, Model, find_model
from pbrdf.models.parameters import Parameter

__all__ = ["Ladder", "Rung", "Step", "ladder", "with_robust_loss", "with_source"]

#: Geometries at which two rungs that give the same matrices are one, radians: θ_i, θ_r, φ.
_PROBES = np.deg2rad(
    [[0.0, 30.0, 30.0, 50.0, 70.0], [20.0, 30.0, 45.0, 10.0, 75.0], [0.0, 0.0, 90.0, 180.0, 20.0]]
)
#: Places within the bounds at which they are compared.
_PLACES = (0.3, 0.6)
_SAME = 1e-9


@dataclass(frozen=True)
class Rung:
    """A model as it is fitted.

    Attributes
    ----------
    name
        What it is called in tables.
    model
        Class of the model, or a model whose values are one of the starts.
    options
        Options of the model.
    fix
        Parameters held at a value.
    nuisances
        What the instrument adds, as texts of :class:`~pbrdf.inversion.nuisance.Nuisance`.
    loss
        Loss of the residuals.
    """

    name: str
    model: type[Model] | Model
    options: Mapping[str, str] = field(default_factory=dict)
    fix: Mapping[str, float] = field(default_factory=dict)
    nuisances: tuple[str, ...] = ()
    loss: str = "linear"

    @property
    def cls(self) -> type[Model]:
        """Class of the model."""
        return self.model if isinstance(self.model, type) else type(self.model)

    @property
    def free(self) -> int:
        """Number of parameters that are fitted where none is free for each wavelength apart."""
        return sum(p.fitted and p.name not in self.fix for p in self.cls.parameters) + len(self.nuisances)


@dataclass(frozen=True)
class Step:
    """An assumption that one rung makes and another does without.

    Attributes
    ----------
    assumption
        In words.
    simple, rich
        Names of the rungs with and without it.
    """

    assumption: str
    simple: str
    rich: str


@dataclass(frozen=True)
class Ladder:
    """Rungs, the simple ones first, and the steps between them."""

    rungs: tuple[Rung, ...]
    steps: tuple[Step, ...] = ()


def ladder(models: Sequence[str | type[Model] | Model | Rung] | None = None) -> Ladder:
    """The rungs of some models: each in its readings, each of those also with its ablations.

    Rungs of the same name, and ablated ones that are the same model by other words, are one.

    Parameters
    ----------
    models
        Names, ``FILE.py:Class``, classes, models (their options count, their values are one of the starts), or rungs,
        which are taken as they are. None takes every registered model.

    Raises
    ------
    ModelError
        If a model is not known, or none is given.
    """
    rungs: dict[str, Rung] = {}
    steps: list[Step] = []
    for given in MODELS if models is None else models:
        if isinstance(given, Rung):
            rungs.setdefault(given.name, given)
            continue
        found = find_model(given) if isinstance(given, str) else given
        if isinstance(found, Model):
            readings = [Rung(found.name, found)]
        else:
            readings = [Rung(found.name, found)]
            readings += [
                Rung(f"{found.name}, {name}", found, options) for name, options in found.readings.items()
            ]
        for reading in readings:
            rungs.setdefault(reading.name, reading)
            for words, held in reading.cls.ablations.items():
                ablated = replace(reading, name=f"{reading.name}, {words}", fix={**reading.fix, **held})
                known = next((r for r in rungs.values() if r.fix and _same(r, ablated)), None)
                simple = rungs.setdefault(ablated.name, ablated) if known is None else known
                stated = ", ".join(f"{name} = {value:g}" for name, value in held.items())
                steps.append(Step(f"{words} ({stated})", simple.name, reading.name))
    if not rungs:
        raise ModelError("no model to compare: name at least one")
    return Ladder(tuple(sorted(rungs.values(), key=lambda rung: rung.free)), tuple(dict.fromkeys(steps)))


def with_robust_loss(rung: Rung) -> tuple[Rung, Step] | None:
    """The same rung with the loss ``cauchy``; None where its loss is robust already."""
    if rung.loss != "linear":
        return None
    robust = replace(rung, name=f"{rung.name} + cauchy", loss="cauchy")
    return robust, Step("no outliers (least squares)", rung.name, robust.name)


def with_source(rung: Rung) -> tuple[Rung, Step] | None:
    """The same rung with a source of finite size; None where it has nuisance terms already."""
    if rung.nuisances:
        return None
    wide = replace(rung, name=f"{rung.name} + source", nuisances=("source",))
    return wide, Step("a point source", rung.name, wide.name)


def _same(a: Rung, b: Rung) -> bool:
    """Whether two rungs are the same model: the same free parameters, and the same matrices wherever it was tried."""
    if {p.name: p for p in _free(a)} != {p.name: p for p in _free(b)}:
        return False
    for place in _PLACES:
        try:
            first, second = (
                rung.cls.from_values(_values(rung, place), **{**_chosen(rung), **rung.options}).mueller(
                    *_PROBES
                )
                for rung in (a, b)
            )
        except ModelError:
            return False
        if np.abs(first - second).max() > _SAME * np.abs(first).max():
            return False
    return True


def _chosen(rung: Rung) -> Mapping[str, str]:
    return rung.model.chosen if isinstance(rung.model, Model) else {}


def _free(rung: Rung) -> list[Parameter]:
    return [p for p in rung.cls.parameters if p.fitted and p.name not in rung.fix]


def _values(rung: Rung, place: float) -> dict[str, float]:
    """Parameters at a place between their bounds, those of the data's own scale and those held at their own."""
    values = {}
    for p in rung.cls.parameters:
        low, high = p.lower, p.upper
        if p.name in rung.fix:
            values[p.name] = rung.fix[p.name]
        elif not p.fitted or p.amplitude:
            values[p.name] = p.default
        elif p.logarithmic:
            values[p.name] = float(low ** (1.0 - place) * high**place)
        else:
            values[p.name] = low + place * (high - low)
    return values
