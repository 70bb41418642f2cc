"""A ball as a polarisation camera sees it: one distant lamp, an orthographic camera, interreflections none.

Frames, of docs/conventions.md and :mod:`pbrdf.instruments.pixel_geometry`:

* Stokes vectors of the picture refer to the camera's axes, x level to the right and y up, light along x × y.
* The state's light refers to (p, s) at the middle of the ball, which faces the camera: p lies in the plane of lamp and
  line of sight. At other places the same light is read in the (p, s) of that place.

The grid goes by the zenith angle of the camera (rows) and around the ball from the lamp's side (columns), so that light
without U and V, whose picture is its own mirror image, needs half of the directions.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np

from pbrdf.backend import get_backend
from pbrdf.errors import DataError
from pbrdf.explorer.evaluation import mueller_matrix, prepare, require_drawable
from pbrdf.explorer.state import Light, State, StateError, number
from pbrdf.explorer.workspace import Workspace
from pbrdf.instruments.goniometer.rays import UPRIGHT, across, angles_of
from pbrdf.instruments.pixel_geometry.camera import Lamp, PixelCamera
from pbrdf.instruments.pixel_geometry.geometry import plane_rotation
from pbrdf.models.base import Model
from pbrdf.optics.angles import within_turn
from pbrdf.optics.elements import diattenuator

__all__ = ["LAMP", "MODES", "POLARISERS", "draw", "picture"]

#: Angles of the lamp where the state names none, degrees: above on the left, as draughtsmen have it.
LAMP = (40.0, 120.0)
#: What is shown of each pixel's Stokes vector.
MODES = ("radiance", "polariser", "dolp", "aolp", "circular")
#: Rows and columns of half a turn, at rest and while a slider is dragged.
REST, DRAGGED = (121, 121), (91, 91)
#: Zenith angle of the outermost row and the largest angle of incidence that is evaluated, degrees: at 90° f is 0.
RIM = 89.5
#: Polarisers of the dial, each a row of four numbers whose product with a Stokes vector is what it lets pass; of
#: half a degree each, over half a turn and with its end.
POLARISERS = 361
#: Largest number of float16, about.
_MOST = 6.0e4
_MIRROR = (1.0, 1.0, -1.0, -1.0)


@dataclass(frozen=True)
class _Ball:
    """The grid under a lamp at the azimuth 0, shapes (rows, columns of a turn).

    Attributes
    ----------
    directions
        θ_i, θ_r, φ, radians.
    cosine
        Of the angle of incidence, 0 in the shadow.
    turn
        cos2χ and sin2χ of the turn from the camera's axes to (p, s).
    light_turn
        Those of the turn from the light's own (p, s) to that of the place.
    """

    directions: tuple[np.ndarray, ...]
    cosine: np.ndarray
    turn: tuple[np.ndarray, np.ndarray]
    light_turn: tuple[np.ndarray, np.ndarray]
    _uploaded: dict[int, list[Any]] = field(default_factory=dict)

    def angles(self, columns: int) -> list[Any]:
        """Directions of the first columns in Dr.Jit's memory, where they stay."""
        if columns not in self._uploaded:
            backend = get_backend()
            self._uploaded[columns] = [
                backend.upload(backend.Float32, x[:, :columns].ravel()) for x in self.directions
            ]
        return self._uploaded[columns]

    def incident(self, stokes: Sequence[float], columns: int) -> list[Any]:
        """The light in the (p, s) of the places of the first columns."""
        i, q, u, v = stokes
        cos, sin = (x[:, :columns] for x in self.light_turn)
        return [i, cos * q + sin * u, cos * u - sin * q, v]

    def to_camera(self, q: np.ndarray, u: np.ndarray, azimuth: float) -> tuple[np.ndarray, np.ndarray]:
        """Q and U of the places' (p, s) in the camera's axes, with the lamp at an azimuth."""
        c, s = (np.float32(f(2.0 * azimuth)) for f in (math.cos, math.sin))
        cos, sin = self.turn[0] * c - self.turn[1] * s, self.turn[1] * c + self.turn[0] * s
        return cos * q - sin * u, sin * q + cos * u


def draw(state: State, workspace: Workspace, dragging: bool) -> tuple[dict[str, Any], list[bytes]]:
    """Radiance and Q/I, U/I, V/I in the camera's frame, shape (rows, columns, 4), float16.

    One field of the active model, a second one of the model to compare it with where there is one; then the polarisers
    of the dial, float32.
    """
    settings = state.settings.get("sphere", {})
    lamp = _lamp(settings.get("light", {}))
    _check_display(settings)
    layers = [state.shown] if state.compare is None else [state.shown, state.layers[state.compare]]
    shape = DRAGGED if dragging else REST
    accuracy = "fast" if dragging else "default"
    fields = [
        picture(layer.model.with_accuracy(accuracy), lamp, state.light, state.part, shape) for layer in layers
    ]
    if not dragging:
        prepare(state, ["ball"], lambda: draw(state, workspace, True))
    header = {
        "shape": list(fields[0].shape),
        "channels": ["radiance", "q", "u", "v"],
        "rim": math.radians(RIM),
        "ranges": _ranges(fields),
        "towards_lamp": lamp.direction.tolist(),
        "lamp": [math.degrees(lamp.polar), math.degrees(lamp.azimuth)],
        "models": [layer.name for layer in layers],
    }
    return header, [*(one.astype("<f2").tobytes() for one in fields), _polarisers()]


def picture(model: Model, lamp: Lamp, light: Light, part: str, shape: tuple[int, int]) -> np.ndarray:
    """Radiance for unit irradiance across the beam (1/sr) and Q/I, U/I, V/I of it in the camera's frame.

    Parameters
    ----------
    model
        What the ball is painted with.
    lamp
        Where the light comes from.
    light
        Its Stokes vector, see the module's text; the angle of incidence is that of each place of the ball.
    part
        Part of the model.
    shape
        Rows, from the middle of the ball to its rim at :data:`RIM`, and columns of half a turn.

    Returns
    -------
    ndarray
        Shape (rows, columns of a turn, 4). The columns go counterclockwise from the lamp's side, the last is the
        first. Where no light falls the radiance is 0.
    """
    ball = _ball(lamp.polar, *shape)
    halved = light.stokes[2] == light.stokes[3] == 0.0
    natural = halved and light.stokes[1] == 0.0
    columns = shape[1] if halved else 2 * shape[1] - 1
    theta_i, theta_r, phi = ball.angles(columns)
    M = mueller_matrix(model, theta_i, theta_r, phi, part, whole=not natural)
    size = shape[0] * columns
    rows = [[np.broadcast_to(x.numpy(), size).reshape(shape[0], columns) for x in row] for row in M]
    if natural:
        S = [light.stokes[0] * row[0] for row in rows]
    else:
        incident = ball.incident(light.stokes, columns)
        S = [sum(x * y for x, y in zip(row, incident, strict=True)) for row in rows]
    if halved:
        S = [np.concatenate([x, sign * x[:, -2::-1]], axis=1) for x, sign in zip(S, _MIRROR, strict=True)]
    inverse = 1.0 / np.maximum(S[0], 1e-30)
    radiance = np.minimum(S[0] * ball.cosine, _MOST)
    q, u, v = (x * inverse for x in S[1:])
    return np.stack([radiance, *ball.to_camera(q, u, lamp.azimuth), v], axis=-1)


@lru_cache(maxsize=4)
def _ball(polar: float, rows: int, half: int) -> _Ball:
    """The grid under a lamp; kept, as sliders of a model leave the lamp where it is."""
    theta_r = np.deg2rad(np.linspace(0.0, RIM, rows))[:, None]
    around = np.linspace(0.0, np.pi, half)
    across_view = np.sin(theta_r)
    normal = np.empty((rows, half, 3))
    normal[..., 0], normal[..., 1] = across_view * np.cos(around), across_view * np.sin(around)
    normal[..., 2] = np.cos(theta_r)
    view = PixelCamera().view(np.zeros(1), np.zeros(1))
    source = Lamp(polar).direction
    theta_i, _, phi = angles_of(normal, source, view)
    rotation = plane_rotation(normal, view, source)
    # the light's own p is that of the middle of the ball, also where the lamp is beside the camera
    p = np.array([-math.cos(polar), 0.0, math.sin(polar)])
    s = np.cross(p, source)  # p×s = k = −source
    there = across(normal, source)
    # lit along the normal φ is 0 and p points to the side of the camera; seen along it too that is p itself
    lit_along = np.linalg.norm(there, axis=-1, keepdims=True) < UPRIGHT
    to_place = np.arctan2(*(np.where(lit_along, p, there) @ axis for axis in (s, p)))

    def whole(values: np.ndarray, sign: float = 1.0) -> np.ndarray:
        return np.concatenate([values, sign * values[:, -2::-1]], axis=1)

    def turn(angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        double = (2.0 * angle).astype(np.float32)
        return whole(np.cos(double)), whole(np.sin(double), -1.0)

    directions = (
        whole(np.minimum(theta_i, math.radians(RIM))),
        np.broadcast_to(theta_r, (rows, 2 * half - 1)),
        whole(phi, -1.0),
    )
    cosine = whole(np.cos(theta_i).clip(0.0)).astype(np.float32)
    return _Ball(directions, cosine, turn(rotation), turn(to_place))


def _ranges(fields: list[np.ndarray]) -> dict[str, float]:
    """Largest values that the colours of each mode stand for, in steps of 1, 2, 5."""
    # where one of two models is dark there is nothing to compare
    bright = np.all([one[..., 0] > 0.0 for one in fields], axis=0)
    found = []
    for one in fields:
        L, q, u, v = np.moveaxis(one, -1, 0)
        found.append([L, np.sqrt(q * q + u * u), v])
    values = found[0] if len(found) == 1 else [a - b for a, b in zip(*found, strict=True)]
    most = [float((np.abs(v) * bright).max()) for v in values]
    require_drawable(*most)
    return dict(zip(("radiance", "dolp", "circular"), map(_round_up, most), strict=True))


def _round_up(value: float) -> float:
    """The next number of the row …, 0.1, 0.2, 0.5, 1, …"""
    power = 10.0 ** math.floor(math.log10(max(value, 1e-3)))
    return next((step * power for step in (1.0, 2.0, 5.0) if value <= step * power), 10.0 * power)


@lru_cache(maxsize=1)
def _polarisers() -> bytes:
    angles = np.linspace(0.0, np.pi, POLARISERS)
    return diattenuator(angles)[:, 0].astype("<f4").tobytes()


def _lamp(content: Any) -> Lamp:
    if not isinstance(content, dict):
        raise StateError("settings.sphere.light", "the lamp should be a JSON object")
    polar = number(content.get("polar", LAMP[0]), "settings.sphere.light.polar")
    azimuth = number(content.get("azimuth", LAMP[1]), "settings.sphere.light.azimuth")
    try:
        return Lamp(math.radians(polar), math.radians(float(within_turn(azimuth, 360.0))))
    except DataError as error:
        raise StateError("settings.sphere.light.polar", str(error)) from None


def _check_display(settings: Any) -> None:
    """Settings that the page alone uses come from addresses and files too."""
    mode = settings.get("mode", MODES[0])
    if mode not in MODES:
        raise StateError("settings.sphere.mode", f"choose one of {', '.join(MODES)}")
    for name in ("polariser", "exposure"):
        number(settings.get(name, 0.0), f"settings.sphere.{name}")
