"""Polar surfaces, as the paper's figure 3: in every direction the distance from the origin is the value there.

All models that are shown have one scale, so that their sizes can be compared. Of values with a sign the distance is the
magnitude and the colour says the sign; angles of polarisation have no size, they colour a hemisphere.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pbrdf.explorer.evaluation import Grid, described, fields, prepare
from pbrdf.explorer.state import QUANTITIES, State, StateError, number
from pbrdf.explorer.workspace import Workspace

__all__ = ["DECADES", "SCALES", "draw"]

#: How the distance follows from the value.
SCALES = ("linear", "logarithmic")
#: Of a logarithmic scale, from the origin to the largest value.
DECADES = 4.0
#: Share of the hemisphere above a tenth of the largest value from which on the scale is linear unless one is chosen.
NARROW = 0.002
#: Directions at rest and while a slider is dragged; the horizon, where f is 0, is left out.
REST, DRAGGED = Grid(91, 121), Grid(61, 61)
#: From where one looks where the state does not say, degrees: azimuth and height, as the figures have it.
EYE = (-82.0, 28.0)


def draw(state: State, workspace: Workspace, dragging: bool) -> tuple[dict[str, Any], list[bytes]]:
    """Distance (0 … 1), place in the colour table (0 … 1), value over the largest, 1; (rows, columns, 4), float16.

    One field for each model that is shown, the active one first.
    """
    settings = state.settings.get("polar", {})
    quantity, scale = _checked(settings)
    others = [i for i, layer in enumerate(state.layers) if layer.shown and i != state.active]
    indices = [state.active, *others]
    grid = DRAGGED if dragging else REST
    values = []
    for i in indices:
        [picture], planes = fields(replace(state, active=i, compare=None), [quantity], grid, dragging)
        shown = described(picture, False)
        # at the horizon there is no light
        plane, mirrored = (planes[j, :-1].astype(np.float32) for j in (picture.plane, picture.mirrored))
        halved = picture.plane == picture.mirrored
        value = plane if halved else np.concatenate([plane, picture.sign * mirrored[:, -2::-1]], axis=1)
        values.append(10.0**value if shown["logarithmic"] else value)
    if not dragging:
        prepare(state, ["polar", quantity], lambda: draw(state, workspace, True))
    most = max(float(np.abs(v).max()) for v in values)
    most = 90.0 if quantity == "aolp" else most if most > 0.0 else 1.0
    header = {
        "shape": [*values[0].shape, 4],
        "halved": halved,
        "mirrored": halved and picture.sign < 0.0,
        "rim": 0.5 * math.pi * (grid.zeniths - 2) / (grid.zeniths - 1),
        "title": shown["title"],
        "scale": scale or _suited(values, most, grid, shown["colours"]),
        "most": most,
        "decades": DECADES,
        "colours": shown["colours"],
        "theta_i": state.light.theta_i,
        "layers": indices,
        "eye": list(EYE),
    }
    return header, [
        _field(v / most, shown["colours"], header["scale"]).astype("<f2").tobytes() for v in values
    ]


def _suited(values: Sequence[np.ndarray], most: float, grid: Grid, colours: str) -> str:
    """The scale where none is chosen: linear, a narrow lobe would be a needle in an empty frame."""
    if colours == "cyclic":
        return SCALES[0]
    solid_angle = np.sin(np.linspace(0.0, 0.5 * math.pi, grid.zeniths)[:-1])
    shares = [solid_angle @ np.mean(np.abs(v) > 0.1 * most, axis=1) / solid_angle.sum() for v in values]
    return SCALES[0] if max(shares) > NARROW else SCALES[1]


def _field(shares: np.ndarray, colours: str, scale: str) -> np.ndarray:
    """Distance, colour and value of shares of the largest value."""
    size = np.abs(shares)
    if colours == "cyclic":
        distance, colour = np.ones_like(shares), 0.5 + 0.5 * shares
    else:
        distance = size
        if scale == "logarithmic":
            distance = np.clip(1.0 + np.log10(np.maximum(size, 1e-30)) / DECADES, 0.0, 1.0)
        colour = 0.5 + 0.5 * np.sign(shares) * distance if colours == "signed" else distance
    return np.stack([distance, colour, shares, np.ones_like(shares)], axis=-1)


def _checked(settings: Mapping[str, Any]) -> tuple[str, str | None]:
    quantity, scale = settings.get("quantity", "intensity"), settings.get("scale")
    if quantity not in QUANTITIES:
        raise StateError("settings.polar.quantity", f"{quantity!r} is not one of {', '.join(QUANTITIES)}")
    if scale is not None and scale not in SCALES:
        raise StateError("settings.polar.scale", f"choose one of {', '.join(SCALES)}")
    for name in ("turn", "tilt"):
        number(settings.get(name, 0.0), f"settings.polar.{name}")
    return quantity, scale
