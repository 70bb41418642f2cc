"""What the page shows, as one JSON object: it stands in the address, in files and in every request for a picture.

It comes from a browser, so everything in it is checked.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pbrdf.errors import ModelError, PbrdfError
from pbrdf.models.base import PARTS, Model
from pbrdf.models.evaluation import check_incident
from pbrdf.models.registry import MODELS

__all__ = [
    "MOST_LAYERS",
    "QUANTITIES",
    "VERSION",
    "Layer",
    "Light",
    "State",
    "StateError",
    "read_state",
]

#: Of the layout of the object; one of another version is refused in words.
VERSION = 1
#: Models shown at once, at most.
MOST_LAYERS = 6
#: What is drawn over the directions: of the reflected Stokes vector, and elements of the Mueller matrix.
QUANTITIES = (
    *("intensity", "dolp", "aolp", "q", "u", "v"),
    *(f"m{i}{j}" for i in range(4) for j in range(4)),
)


class StateError(PbrdfError):
    """A state that cannot be shown; ``place`` is the path of what is at fault, ``layers.0.parameters.sigma``."""

    def __init__(self, place: str, message: str) -> None:
        super().__init__(message)
        self.place = place


@dataclass(frozen=True)
class Light:
    """The incident light: zenith angle in degrees, Stokes vector in its (p, s) frame."""

    theta_i: float = 35.0
    stokes: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Layer:
    """One of the models that are shown together."""

    name: str
    model: Model
    shown: bool = True

    def to_dict(self) -> dict[str, Any]:
        """The layer as JSON, complete."""
        return {"name": self.name, "shown": self.shown, **self.model.to_dict()}


@dataclass(frozen=True)
class State:
    """What the page shows.

    Attributes
    ----------
    layers
        The models.
    active
        Index of the model whose sliders are shown and that pictures of one model draw.
    compare
        Index of the model that is taken off the active one; None for no difference.
    light
        The incident light.
    quantities
        What is drawn over the directions, see :data:`QUANTITIES`.
    part
        Part of the models, see :data:`pbrdf.models.base.PARTS`.
    settings
        Settings of the single views by the view's name, checked by the view.
    """

    layers: tuple[Layer, ...]
    active: int = 0
    compare: int | None = None
    light: Light = field(default_factory=Light)
    quantities: tuple[str, ...] = ("intensity", "dolp")
    part: str = "total"
    settings: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """The state as JSON, complete: parameters and options that were left out have their defaults."""
        return {
            "version": VERSION,
            "layers": [layer.to_dict() for layer in self.layers],
            "active": self.active,
            "compare": self.compare,
            "light": {"theta_i": self.light.theta_i, "stokes": list(self.light.stokes)},
            "quantities": list(self.quantities),
            "part": self.part,
            "settings": {name: dict(value) for name, value in self.settings.items()},
        }

    @property
    def shown(self) -> Layer:
        """The active layer."""
        return self.layers[self.active]


def read_state(content: Any) -> State:
    """Check a JSON object that should be a state.

    Raises
    ------
    StateError
        If something is missing, out of its domain or of another version; says where and what to do.
    """
    state = _mapping(content, "", "the state")
    if state.get("version") != VERSION:
        raise StateError("version", f"this state is of another version than {VERSION}: begin anew")
    given = _sequence(state.get("layers"), "layers", MOST_LAYERS)
    if not given:
        raise StateError("layers", "no model is shown: choose one")
    layers = tuple(_layer(layer, f"layers.{i}") for i, layer in enumerate(given))
    compare = state.get("compare")
    quantities = _sequence(state.get("quantities", ["intensity"]), "quantities", len(QUANTITIES))
    for quantity in quantities:
        if quantity not in QUANTITIES:
            raise StateError("quantities", f"{quantity!r} is not one of {', '.join(QUANTITIES)}")
    if not quantities:
        raise StateError("quantities", "no quantity is drawn: choose one")
    if state.get("part", "total") not in PARTS:
        raise StateError("part", f"choose one of {', '.join(PARTS)}")
    settings = _mapping(state.get("settings", {}), "settings", "settings")
    return State(
        layers,
        _index(state.get("active", 0), "active", len(layers)),
        None if compare is None else _index(compare, "compare", len(layers)),
        _light(state.get("light", {})),
        tuple(dict.fromkeys(quantities)),
        state.get("part", "total"),
        {name: _mapping(value, f"settings.{name}", "settings") for name, value in settings.items()},
    )


def _layer(content: Any, place: str) -> Layer:
    layer = _mapping(content, place, "a model")
    name = layer.get("model")
    if not isinstance(name, str) or name not in MODELS:
        raise StateError(f"{place}.model", f"there is no model {name!r} here")
    model = MODELS[name]
    parameters = _mapping(layer.get("parameters", {}), f"{place}.parameters", "parameters")
    options = _mapping(layer.get("options", {}), f"{place}.options", "options")
    values = {p.name: p.default for p in model.parameters}
    for key, value in parameters.items():
        if key not in values:
            raise StateError(f"{place}.parameters.{key}", f"{name} has no parameter {key}")
        values[key] = number(value, f"{place}.parameters.{key}")
        try:
            model.from_values({**{p.name: p.default for p in model.parameters}, key: values[key]})
        except ModelError as error:
            raise StateError(f"{place}.parameters.{key}", str(error)) from None
    for key in options:
        if key not in model.options:
            raise StateError(f"{place}.options.{key}", f"{name} has no option {key}")
    try:
        built = model.from_values(values, **options)
    except (ModelError, TypeError) as error:
        raise StateError(place, str(error)) from None
    return Layer(str(layer.get("name", name))[:80], built, bool(layer.get("shown", True)))


def _light(content: Any) -> Light:
    light = _mapping(content, "light", "light")
    theta_i = number(light.get("theta_i", 35.0), "light.theta_i")
    if not 0.0 <= theta_i <= 90.0:
        raise StateError("light.theta_i", "the angle of incidence is within 0 … 90 degrees")
    stokes = _sequence(light.get("stokes", [1.0, 0.0, 0.0, 0.0]), "light.stokes", 4)
    try:
        S = check_incident([number(s, "light.stokes") for s in stokes])
    except (PbrdfError, TypeError, ValueError):
        raise StateError(
            "light.stokes",
            "light has four numbers I, Q, U, V, with I > 0 and √(Q² + U² + V²) no larger than I",
        ) from None
    return Light(theta_i, (S[0], S[1], S[2], S[3]))


def _mapping(value: Any, place: str, what: str) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise StateError(place, f"{what} should be a JSON object")
    return value


def _sequence(value: Any, place: str, most: int) -> Sequence[Any]:
    if not isinstance(value, Sequence) or isinstance(value, str):
        raise StateError(place, f"{place} should be a list")
    if len(value) > most:
        raise StateError(place, f"{place} has {len(value)} entries, {most} at most")
    return value


def _index(value: Any, place: str, size: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < size:
        raise StateError(place, f"{place} should be a whole number from 0 to {size - 1}")
    return value


def number(value: Any, place: str) -> float:
    """A finite number, or StateError naming the place."""
    try:
        found = float(value) if isinstance(value, int | float) and not isinstance(value, bool) else math.nan
    except OverflowError:  # JSON's whole numbers have no end
        found = math.inf
    if not math.isfinite(found):
        raise StateError(place, f"{place} should be a number")
    return found
