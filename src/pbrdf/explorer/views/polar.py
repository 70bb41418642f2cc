"""Polar surfaces, as the paper's figure 3: in every direction the distance from the origin is the value there.

All models that are shown have one scale, so that their sizes can be compared. Of values with a sign the distance is the
magnitude and the colour says the sign; angles of polarisation have no size, they colour a hemisphere.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from pbrdf.explorer.state import QUANTITIES, State, StateError, number
from pbrdf.explorer.workspace import Workspace
from pbrdf.models.base import Model
from pbrdf.optics.stokes import aolp, dolp

__all__ = ["DECADES", "RIM", "SCALES", "draw"]

#: How the distance follows from the value.
SCALES = ("linear", "logarithmic")
#: Of a logarithmic scale, from the origin to the largest value.
DECADES = 4.0
#: Rows, from the normal to the rim, and columns of half a turn, at rest and while a slider is dragged.
REST, DRAGGED = (91, 121), (61, 61)
#: Zenith angle of the rim, degrees: at 90° f is 0.
RIM = 89.5
#: From where one looks where the state does not say, degrees: azimuth and height, as the figures have it.
EYE = (-82.0, 28.0)
_SIGNED = frozenset({"q", "u", "v", *(f"m{i}{j}" for i in range(4) for j in range(4) if (i, j) != (0, 0))})


def draw(state: State, workspace: Workspace, dragging: bool) -> tuple[dict[str, Any], list[bytes]]:
    """Distance (0 … 1), place in the colour table (0 … 1), value over the largest, 1; (rows, columns, 4), float16.

    One field for each model that is shown, the active one first.
    """
    settings = state.settings.get("polar", {})
    quantity, scale = _checked(settings)
    others = [i for i, layer in enumerate(state.layers) if layer.shown and i != state.active]
    indices = [state.active, *others]
    rows, half = DRAGGED if dragging else REST
    # light without U and V is its own mirror image, and a matrix is what it is in any light
    halved = quantity[0] == "m" or state.light.stokes[2] == state.light.stokes[3] == 0.0
    theta_r = np.deg2rad(np.linspace(0.0, RIM, rows))[:, None]
    phi = np.linspace(0.0, np.pi, half) if halved else np.linspace(0.0, 2.0 * np.pi, 2 * half - 1)
    accuracy = "fast" if dragging else "default"
    values = [
        _values(state.layers[i].model.with_accuracy(accuracy), state, quantity, theta_r, phi) for i in indices
    ]
    most = max(float(np.abs(v).max()) for v in values)
    most = 0.5 * math.pi if quantity == "aolp" else most if most > 0.0 else 1.0
    header = {
        "shape": [rows, len(phi), 4],
        "halved": halved,
        "mirrored": halved and _is_odd(quantity),
        "rim": math.radians(RIM),
        "quantity": quantity,
        "scale": scale,
        "most": most,
        "decades": DECADES,
        "colours": "cyclic" if quantity == "aolp" else "signed" if quantity in _SIGNED else "sequential",
        "theta_i": state.light.theta_i,
        "layers": indices,
        "eye": list(EYE),
    }
    return header, [_field(v / most, quantity, scale).astype("<f2").tobytes() for v in values]


def _field(shares: np.ndarray, quantity: str, scale: str) -> np.ndarray:
    """Distance, colour and value of shares of the largest value."""
    size = np.abs(shares)
    if quantity == "aolp":
        distance, colour = np.ones_like(shares), 0.5 + 0.5 * shares
    else:
        distance = size
        if scale == "logarithmic":
            distance = np.clip(1.0 + np.log10(np.maximum(size, 1e-30)) / DECADES, 0.0, 1.0)
        colour = 0.5 + 0.5 * np.sign(shares) * distance if quantity in _SIGNED else distance
    return np.stack([distance, colour, shares, np.ones_like(shares)], axis=-1)


def _values(model: Model, state: State, quantity: str, theta_r: np.ndarray, phi: np.ndarray) -> np.ndarray:
    """The quantity in each direction; angles of polarisation within −π/2 … π/2."""
    theta_i = np.deg2rad(state.light.theta_i)
    if quantity[0] == "m":
        f = model.mueller(theta_i, theta_r, phi, part=state.part)
        return np.asarray(f[..., int(quantity[1]), int(quantity[2])])
    S = model.stokes(theta_i, theta_r, phi, incident=state.light.stokes, part=state.part)
    if quantity == "intensity":
        return np.asarray(S[..., 0])
    if quantity == "aolp":
        return np.asarray(aolp(S))
    if quantity == "dolp":
        return np.nan_to_num(dolp(S))
    return S[..., "iquv".index(quantity)] / np.maximum(S[..., 0], 1e-30)


def _is_odd(quantity: str) -> bool:
    """Whether the mirror image of a direction has the opposite value; see Mueller matrices in docs/conventions.md."""
    if quantity[0] == "m":
        return (int(quantity[1]) < 2) != (int(quantity[2]) < 2)
    return quantity in ("u", "v", "aolp")


def _checked(settings: Mapping[str, Any]) -> tuple[str, str]:
    quantity, scale = settings.get("quantity", "intensity"), settings.get("scale", SCALES[0])
    if quantity not in QUANTITIES:
        raise StateError("settings.polar.quantity", f"{quantity!r} is not one of {', '.join(QUANTITIES)}")
    if scale not in SCALES:
        raise StateError("settings.polar.scale", f"choose one of {', '.join(SCALES)}")
    for name in ("turn", "tilt"):
        number(settings.get(name, 0.0), f"settings.polar.{name}")
    return quantity, scale
