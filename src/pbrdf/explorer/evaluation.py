"""Models over the hemisphere of viewing directions, as planes of float16 numbers for the views that draw them.

A picture is redrawn with every move of a slider, so that nothing is compiled or uploaded for a move: parameters and
angle of incidence are opaque to Dr.Jit, and the angles of a grid stay where they are. One kernel evaluates a model
(its first column in natural light, else the whole matrix), a small one makes the quantities of it and packs them, so
that other quantities, light or a model to compare with need no new kernel of the model. Single precision is more than
float16 holds (tests/explorer/test_evaluation.py, all models).

Only azimuths from 0 to 180° are evaluated. The other half follows from S(−φ) = K M(φ) K s with K = diag(1, 1, −1, −1),
the mirror symmetry of docs/conventions.md: by a sign where the incident light has no U and V, else as planes of their
own.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from pbrdf.backend import get_backend
from pbrdf.errors import PbrdfError
from pbrdf.explorer.state import State
from pbrdf.models.base import Model
from pbrdf.models.evaluation import kernel_from_angles

__all__ = ["Grid", "Picture", "described", "fields", "mueller_matrix", "prepare", "require_drawable"]

#: Radiance of unit irradiance and m00, 1/sr, below which there is no light: its logarithm ends and ratios are 0.
DARK = 1e-20
_K = (1.0, 1.0, -1.0, -1.0)


@dataclass(frozen=True)
class Grid:
    """Directions: zenith angles 0 … 90° by azimuths 0 … 180°, both ends included, evenly spaced."""

    zeniths: int
    azimuths: int

    @property
    def size(self) -> int:
        """Number of directions."""
        return self.zeniths * self.azimuths


@dataclass(frozen=True)
class Picture:
    """A quantity over the hemisphere.

    Attributes
    ----------
    quantity
        One of :data:`pbrdf.explorer.state.QUANTITIES`.
    plane
        Which plane holds it for φ ≥ 0. Intensity and m00 are decadic logarithms, AoLP is in degrees, −90 … 90; of two
        models it is the difference.
    mirrored, sign
        Which plane holds it for φ < 0, at −φ, and by what it is multiplied there.
    extent
        Least and largest value to a zenith angle of 85.5°, φ of both signs.
    """

    quantity: str
    plane: int
    mirrored: int
    sign: float
    extent: tuple[float, float]


#: Beside the quantities: DoLP, of two models the lower, which says where their angles of polarisation mean something.
POLARISED = "polarised"


@lru_cache(maxsize=8)
def _angles(grid: Grid, Float: Any) -> tuple[Any, Any]:
    """Zenith angles and azimuths of a grid in Dr.Jit's memory, radians."""
    zeniths = np.deg2rad(np.linspace(0.0, 90.0, grid.zeniths))
    azimuths = np.deg2rad(np.linspace(0.0, 180.0, grid.azimuths))
    both = np.meshgrid(zeniths, azimuths, indexing="ij")
    theta_r, phi = (get_backend().upload(Float, a.ravel()) for a in both)
    return theta_r, phi


def mueller_matrix(
    model: Model, theta_i: Any, theta_r: Any, phi: Any, part: str, whole: bool
) -> list[list[Any]]:
    """Mueller matrix in directions that are Dr.Jit Float32 in radians, evaluated.

    Parameters
    ----------
    model
        With plain numbers as parameters.
    theta_i, theta_r, phi
        Directions; one that is the same for all is a number.
    part
        Part of the model.
    whole
        Without it only the first column, which is all that natural light needs.

    Returns
    -------
    list of list
        Rows of Dr.Jit Float32; what is 0 by the model's structure has one entry.
    """
    import drjit as dr

    Float = get_backend().Float32
    theta_i, theta_r, phi = (
        dr.opaque(Float, x) if isinstance(x, float) else x for x in (theta_i, theta_r, phi)
    )
    # as in models/evaluation.py: an extinction of 0 has a kernel of its own, which is faster
    absent = {p.name for p in model.parameters if p.vanishing and not model.values[p.name]}
    values = {
        name: None if name in absent else dr.opaque(Float, value) for name, value in model.values.items()
    }
    f = kernel_from_angles(model, theta_i, theta_r, phi, values, part)
    columns = 4 if whole else 1
    # what is 0 by the model's structure is as long as the rest: one kernel for all that follows
    matrix = [[Float(x) for x in row[:columns]] for row in f]
    dr.eval(matrix)
    return matrix


def _ratio(x: Any, whole: Any) -> Any:
    import drjit as dr

    return dr.select(whole > DARK, x / dr.maximum(whole, DARK), 0.0)


def _log10(x: Any) -> Any:
    import drjit as dr

    return dr.log(dr.maximum(x, DARK)) * (1.0 / math.log(10.0))


def _angle(q: Any, u: Any) -> Any:
    """Half the angle of (q, u), degrees within (−90, 90]; 0 where there is none."""
    import drjit as dr

    turn = dr.atan2(u, q)
    turn = dr.select(turn <= -dr.pi, dr.pi, turn)
    return dr.select((q != 0.0) | (u != 0.0), turn * (90.0 / math.pi), 0.0)


def _value(quantity: str, S: Sequence[Any], M: Sequence[Sequence[Any]]) -> Any:
    """What the plane of a quantity holds, of Stokes vectors and Mueller matrices."""
    import drjit as dr

    if quantity == "intensity":
        return _log10(S[0])
    if quantity in ("dolp", POLARISED):
        q, u = _ratio(S[1], S[0]), _ratio(S[2], S[0])
        return dr.sqrt(q * q + u * u)
    if quantity == "aolp":
        return _angle(_ratio(S[1], S[0]), _ratio(S[2], S[0]))
    if quantity in "quv":
        return _ratio(S["iquv".index(quantity)], S[0])
    i, j = int(quantity[1]), int(quantity[2])
    return _log10(M[0][0]) if i == j == 0 else _ratio(M[i][j], M[0][0])


def _sign(quantity: str) -> float:
    """By what a quantity is multiplied at −φ, where the incident light has no U and V."""
    if quantity == "aolp":
        return -1.0
    if quantity in "quv":
        return _K["iquv".index(quantity)]
    if quantity.startswith("m"):
        return _K[int(quantity[1])] * _K[int(quantity[2])]
    return 1.0


def _difference(quantity: str, first: Any, second: Any) -> Any:
    import drjit as dr

    if quantity == POLARISED:
        return dr.minimum(first, second)
    difference = first - second
    # axes differ by a right angle at most, and that is +90° either way
    return difference - 180.0 * dr.ceil((difference - 90.0) / 180.0) if quantity == "aolp" else difference


def fields(
    state: State, quantities: Sequence[str], grid: Grid, dragging: bool
) -> tuple[list[Picture], np.ndarray]:
    """Quantities of the active model over a grid, less those of the model compared with, if there is one.

    Parameters
    ----------
    state
        Models, light, part.
    quantities
        What is asked for.
    grid
        The directions.
    dragging
        Whether accuracy ``fast`` is enough.

    Returns
    -------
    pictures
        Where each quantity is found.
    planes
        float16, shape (planes, zeniths, azimuths).

    Raises
    ------
    PbrdfError
        If they are too large to be drawn.
    """
    import drjit as dr

    backend = get_backend()
    Float, Float16 = backend.Float32, backend.module.Float16
    s = state.light.stokes
    crosswise = bool(s[2] or s[3])
    natural = not any(s[1:]) and not any(q.startswith("m") and q != "m00" for q in quantities)
    models = [state.shown.model]
    if state.compare is not None:
        models.append(state.layers[state.compare].model)
    accuracy = "fast" if dragging else "default"
    directions = (math.radians(state.light.theta_i), *_angles(grid, Float))
    matrices = [
        mueller_matrix(model.with_accuracy(accuracy), *directions, state.part, not natural)
        for model in models
    ]
    light = [dr.opaque(Float, x) for x in (s[:1] if natural else s)]
    mirrored_light = [k * x for k, x in zip(_K, light, strict=False)]

    def stokes(M: Sequence[Sequence[Any]], incident: Sequence[Any]) -> list[Any]:
        return [sum((x * y for x, y in zip(row, incident, strict=True)), Float(0.0)) for row in M]

    # K M K s is what K s gives, turned over by K
    halves = [[stokes(M, light) for M in matrices]]
    if crosswise:
        halves.append([[k * x for k, x in zip(_K, stokes(M, mirrored_light), strict=True)] for M in matrices])

    planes: list[Any] = []
    places: list[tuple[int, ...]] = []
    for quantity in quantities:
        own = halves[:1] if quantity.startswith("m") else halves
        places.append(tuple(range(len(planes), len(planes) + len(own))))
        for half in own:
            values = [_value(quantity, S, M) for S, M in zip(half, matrices, strict=True)]
            planes.append(Float16(values[0] if len(values) == 1 else _difference(quantity, *values)))
    dr.eval(planes)
    packed = np.stack([p.numpy() for p in planes]).reshape(len(planes), grid.zeniths, grid.azimuths)
    pictures = []
    for quantity, place in zip(quantities, places, strict=True):
        # a plane of its own for φ < 0 has its signs already
        sign = 1.0 if len(place) == 2 else _sign(quantity)
        low, high = _extent(packed[place[0]])
        low2, high2 = sorted(
            sign * end for end in (_extent(packed[place[1]]) if len(place) == 2 else (low, high))
        )
        require_drawable(low, high, low2, high2)
        pictures.append(Picture(quantity, place[0], place[-1], sign, (min(low, low2), max(high, high2))))
    return pictures, packed


def require_drawable(*values: float) -> None:
    """Refuse what is beyond single precision.

    Raises
    ------
    PbrdfError
        If a value is not finite.
    """
    if not all(map(math.isfinite, values)):
        raise PbrdfError("the numbers are too large to be drawn: choose weaker light, or a smaller amplitude")


def _extent(plane: np.ndarray) -> tuple[float, float]:
    """Least and largest number of a plane to 85.5°: along the horizon there is no light."""
    seen = plane[: int(0.95 * (len(plane) - 1)) + 1].astype(np.float32)
    return float(np.fmin.reduce(seen, axis=None)), float(np.fmax.reduce(seen, axis=None))


_LABELS = {
    "intensity": "Intensity, 1/sr",
    "dolp": "DoLP",
    "aolp": "AoLP, °",
    "q": "Q/I",
    "u": "U/I",
    "v": "V/I",
    "m00": "m₀₀, 1/sr",
    **{f"m{i}{j}": f"m{'₀₁₂₃'[i]}{'₀₁₂₃'[j]}/m₀₀" for i in range(4) for j in range(4) if i or j},
}
_LOGARITHMIC = ("intensity", "m00")


def described(picture: Picture, difference: bool) -> dict[str, Any]:
    """A picture as the page draws it: its planes, what they mean and which colours suit them."""
    logarithmic = picture.quantity in _LOGARITHMIC
    if picture.quantity == "aolp":
        colours = "cyclic"
    else:
        colours = "sequential" if (logarithmic or picture.quantity == "dolp") and not difference else "signed"
    title = _LABELS[picture.quantity]
    symbol = title.split(",")[0]
    if difference:
        title = f"Δ log₁₀ {symbol}" if logarithmic else f"Δ {title}"
    return {
        "quantity": picture.quantity,
        "symbol": symbol.split("/m")[0],
        "title": title,
        "plane": picture.plane,
        "mirrored": picture.mirrored,
        "sign": picture.sign,
        "extent": picture.extent,
        "colours": colours,
        "logarithmic": logarithmic and not difference,
    }


_compiled: set[Any] = set()
#: Seconds after a picture at rest until what a drag needs is compiled.
_LATER = 0.3


def _kernel(state: State, quantities: Sequence[str], dragging: bool) -> Any:
    """What the kernels of a request depend on."""
    models = [state.shown] + ([] if state.compare is None else [state.layers[state.compare]])
    accuracy = "fast" if dragging else "default"
    kinds = [
        (
            m.name,
            tuple(m.with_accuracy(accuracy).chosen.items()),
            tuple(p.name for p in m.parameters if p.vanishing and not m.values[p.name]),
        )
        for m in (layer.model for layer in models)
    ]
    s = state.light.stokes
    return tuple(kinds), state.part, tuple(quantities), any(s[1:]), any(s[2:])


def prepare(state: State, quantities: Sequence[str], work: Callable[[], Any]) -> threading.Timer | None:
    """Compile in a thread what the first drag of a slider needs.

    Parameters
    ----------
    state
        What has been drawn at rest.
    quantities
        What was drawn of it; other views name their own.
    work
        Draws the same as while a slider is dragged.

    Returns
    -------
    threading.Timer
        At work in a moment; None where it is compiled already.
    """
    _compiled.add(_kernel(state, quantities, False))
    wanted = _kernel(state, quantities, True)
    if wanted in _compiled:
        return None
    _compiled.add(wanted)

    def quietly() -> None:
        # what cannot be drawn is said of the picture at rest
        with suppress(PbrdfError), np.errstate(all="ignore"):
            work()

    # not before the picture at rest is on the screen
    thread = threading.Timer(_LATER, quietly)
    thread.name = "pbrdf compiles"
    thread.start()
    return thread
