"""Curves of the models along one line of directions, with the measured points that lie on it.

The line is the viewing angle in the plane of incidence or in any other azimuth, the azimuth at a fixed viewing angle,
or one along which the data were taken: a fixed source, a fixed viewer, a turning sample, a viewer that follows the
source (:mod:`pbrdf.report.dataset.cuts`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pbrdf.explorer.points import Choice, chosen_data, label_of, modelled
from pbrdf.explorer.state import State, StateError, number
from pbrdf.explorer.workspace import Workspace
from pbrdf.models.base import Model
from pbrdf.optics.angles import within_half_turn
from pbrdf.optics.stokes import STOKES
from pbrdf.report.dataset.cuts import Cut
from pbrdf.report.dataset.quantities import is_element
from pbrdf.report.dataset.shown_cuts import ShownCuts

__all__ = ["Line", "draw", "half_turn_of", "line_of"]

ALONG = ("theta_r", "phi", "data")
#: Directions of a line, spread evenly, and around the mirror direction, where peaks are narrow.
_EVEN, _NEAR = 361, 81
#: Zenith angle up to which a line is drawn, and half the width of what is near the mirror direction, degrees.
_GRAZING, _PEAK = 89.0, 4.0
#: How far a point may be off the line: zenith angles and azimuths, degrees.
_NEARBY, _NEARBY_AZIMUTH = 0.3, 1.0
#: Points that are drawn of a line, at most: more are one black band, and slow.
_MOST_POINTS = 500
#: Where half a turn of angles of polarisation begins, degrees.
_STARTS = (-45.0, 45.0)
#: Where the mirror direction is on a line, in shares of what is constant there.
_MIRROR = {"theta_i": 1.0, "theta_r": 1.0, "bistatic": 0.5}


@dataclass(frozen=True)
class Line:
    """Directions along which curves are drawn.

    Attributes
    ----------
    title, axis
        What is constant, and what is along the axis.
    x
        The axis, degrees, shape (N,).
    angles
        θ_i, θ_r and φ there, radians, shape (N,) each.
    rows, at
        Points of the data on the line by their place among the shown ones, and where along the axis, shape (M,).
    """

    title: str
    axis: str
    x: np.ndarray
    angles: tuple[np.ndarray, np.ndarray, np.ndarray]
    rows: np.ndarray
    at: np.ndarray


def draw(state: State, workspace: Workspace, dragging: bool) -> tuple[dict[str, Any], list[bytes]]:
    """Curves and points.

    Buffers: the axis, float64 (N,); the curves, float32 (layers, quantities, N); the active model less the one that it
    is compared with, float32 (quantities, N), or nothing; the points' places along the axis, float64 (M,); the points,
    float64 (quantities, 4, M): measured value, its standard uncertainty, measured − active model in the uncertainties
    of a fit, and the weight, 1 over these uncertainties. NaN where there is nothing.
    """
    note = ""
    try:
        choice = chosen_data(state, workspace)
    except StateError as error:
        choice, note = None, str(error)
    cuts = ShownCuts([], [], 0) if choice is None else choice.measured.cuts
    line = line_of(state, choice, cuts)
    accuracy = "fast" if dragging else "default"
    shown = [i for i, layer in enumerate(state.layers) if layer.shown]
    wanted = {*shown, state.active, *(() if state.compare is None else (state.compare,))}
    if len(line.rows) > _MOST_POINTS:
        some = np.linspace(0, len(line.rows) - 1, _MOST_POINTS).round().astype(int)
        note = f"{_MOST_POINTS} of the {len(line.rows)} points on this line are drawn."
        line = replace(line, rows=line.rows[some], at=line.at[some])
    size, angles, light = len(line.x), line.angles, np.asarray(state.light.stokes)
    curves = {
        i: _curves(state.layers[i].model.with_accuracy(accuracy), state, angles, light)
        for i in wanted - {state.active}
    }
    if choice is not None and line.rows.size:
        # the active model at the points, too, in the light in which they were measured
        ds = choice.measured.dataset
        there = (ds[name].values[line.rows] for name in ("theta_i", "theta_r", "phi"))
        angles = tuple(np.concatenate(pair) for pair in zip(angles, there, strict=True))  # type: ignore[assignment]
        if not np.allclose(choice.measured.light, light, atol=1e-6):
            note = "The points were measured in other light than the curves are drawn for."
            light = np.where(np.arange(len(angles[0]))[:, None] < size, light, choice.measured.light)
        elif state.part != "total":
            note = f"The deviations of the points are those from the {state.part} part alone."
    both = _curves(state.shown.model.with_accuracy(accuracy), state, angles, light)
    curves[state.active] = both[:, :size]
    points = _points(state, choice, line, both[:, size:])
    if "aolp" in state.quantities:
        k = state.quantities.index("aolp")
        start = half_turn_of(curves[state.active][k])
        for angle in (*(curve[k] for curve in curves.values()), points[k, 0]):
            angle[:] = _within(angle, start)
    difference = np.empty((0,))
    if state.compare is not None:
        difference = curves[state.active] - curves[state.compare]
        for k, quantity in enumerate(state.quantities):
            if quantity == "aolp":
                difference[k] = within_half_turn(difference[k], 90.0)
    header = {
        "title": line.title,
        "axis": line.axis,
        "count": len(line.x),
        "quantities": [{"name": q, "label": label_of(q)} for q in state.quantities],
        "layers": shown,
        "data": None if choice is None else choice.measured.name,
        "rows": [] if choice is None else choice.measured.rows[line.rows].tolist(),
        "off": [] if choice is None else choice.off[line.rows].tolist(),
        "held_out": [] if choice is None else choice.is_held_out[line.rows].tolist(),
        "cuts": [
            {"label": cuts.label(cut), "kind": cut.kind, "constant": cut.constant, "group": cut.group}
            for cut in cuts.cuts
        ],
        "note": note,
        "dragging": dragging,
    }
    drawn = np.stack([curves[i] for i in shown]) if shown else np.empty((0,))
    return header, [
        line.x.astype("<f8").tobytes(),
        drawn.astype("<f4").tobytes(),
        difference.astype("<f4").tobytes(),
        line.at.astype("<f8").tobytes(),
        points.astype("<f8").tobytes(),
    ]


def line_of(state: State, choice: Choice | None, cuts: ShownCuts) -> Line:
    """The line that the settings ask for; by default that of the data which is nearest to the light.

    Raises
    ------
    StateError
        If the settings are none.
    """
    settings = state.settings.get("cuts", {})
    along = settings.get("along", "data")
    if along not in ALONG:
        raise StateError("settings.cuts.along", f"curves run along one of {', '.join(ALONG)}")
    if along == "data" and cuts.cuts:
        return _along_cut(_nearest(settings.get("cut"), cuts.cuts, state.light.theta_i), cuts)
    theta_i = state.light.theta_i
    if along == "phi":
        theta_r = number(settings.get("theta_r", theta_i), "settings.cuts.theta_r")
        if not 0.0 <= theta_r <= 90.0:
            raise StateError("settings.cuts.theta_r", "the viewing angle is within 0 … 90 degrees")
        x = _with_peak(-180.0, 180.0, [0.0])
        line = Line(
            f"θi = {theta_i:.4g}°, θr = {theta_r:.4g}°",
            "azimuth φ (°), 0 forward",
            x,
            _radians(theta_i, theta_r, x),
            *_no_points(),
        )
        return _with_points(line, choice, theta_i, theta_r=theta_r)
    phi = number(settings.get("phi", 0.0), "settings.cuts.phi")
    if not -180.0 <= phi <= 180.0:
        raise StateError("settings.cuts.phi", "the azimuth is within −180 … 180 degrees")
    x = _with_peak(-_GRAZING, _GRAZING, [theta_i if abs(phi) < 90.0 else -theta_i])
    where, beyond = "plane of incidence", "on the source's side"
    if phi != 0.0:
        where, beyond = f"φ = {phi:.4g}°", "beyond the normal"
    line = Line(
        f"θi = {theta_i:.4g}°, {where}".replace("-", "−"),
        f"viewing angle θr (°), − {beyond}",
        x,
        _radians(theta_i, np.abs(x), np.where(x < 0.0, phi + 180.0, phi)),
        *_no_points(),
    )
    return _with_points(line, choice, theta_i, phi=phi)


def _nearest(wish: Any, cuts: Sequence[Cut], theta_i: float) -> Cut:
    """The cut that the settings name, else the one nearest to the light, or the middle one."""
    place = "settings.cuts.cut"
    if wish is not None:
        if not isinstance(wish, Mapping):
            raise StateError(place, "a cut is named by {kind, constant, group}")
        constant = number(wish.get("constant"), f"{place}.constant")
        alike = [cut for cut in cuts if cut.kind == wish.get("kind")]
        alike = [cut for cut in alike if cut.group == wish.get("group")] or alike
        if alike:
            return min(alike, key=lambda cut: abs(cut.constant - constant))
    if cuts[0].kind == "theta_i":
        return min(cuts, key=lambda cut: abs(cut.constant - theta_i))
    return cuts[len(cuts) // 2]


def _along_cut(cut: Cut, cuts: ShownCuts) -> Line:
    low, high = float(cut.x.min()), float(cut.x.max())
    if cut.kind == "theta_i":
        low, high = -_GRAZING, _GRAZING
    mirrors = [abs(cut.constant) * _MIRROR[cut.kind]] if cut.kind in _MIRROR else []
    x = _with_peak(low, high, mirrors)
    if len(cut.x) <= _MOST_POINTS:
        x = np.unique(np.concatenate([x, cut.x]))
    along = replace(cut, path_x=x)
    axis = (
        "angle of incidence θi (°)" if cut.over_incidence else "viewing angle θr (°), − on the source's side"
    )
    return Line(cuts.label(cut), axis, x, along.path_angles(), cut.rows, cut.x)


def _with_peak(low: float, high: float, mirrors: Sequence[float]) -> np.ndarray:
    parts = [np.linspace(low, high, _EVEN)]
    parts += [mirror + np.linspace(-_PEAK, _PEAK, _NEAR) for mirror in mirrors]
    x = np.unique(np.round(np.concatenate(parts), 9))
    return x[(x >= low) & (x <= high)]


def _radians(theta_i: float, theta_r: Any, phi: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    a, b, c = np.broadcast_arrays(*(np.deg2rad(np.asarray(v, dtype=float)) for v in (theta_i, theta_r, phi)))
    return a, b, c


def _no_points() -> tuple[np.ndarray, np.ndarray]:
    return np.empty(0, dtype=int), np.empty(0)


def _with_points(
    line: Line,
    choice: Choice | None,
    theta_i: float,
    *,
    theta_r: float | None = None,
    phi: float | None = None,
) -> Line:
    """With the measured points on it."""
    if choice is None:
        return line
    points = choice.measured.points
    on = np.abs(points.theta_i - theta_i) <= _NEARBY
    at = points.phi
    if theta_r is not None:
        on &= np.abs(points.theta_r - theta_r) <= _NEARBY
    else:
        assert phi is not None
        off = np.abs(within_half_turn(points.phi - phi, 180.0))
        on &= (off <= _NEARBY_AZIMUTH) | (off >= 180.0 - _NEARBY_AZIMUTH) | (points.theta_r < _NEARBY)
        at = np.where(off > 90.0, -points.theta_r, points.theta_r)
    rows = np.flatnonzero(on)
    rows = rows[np.argsort(at[rows], kind="stable")]
    return replace(line, rows=rows, at=at[rows])


def _curves(
    model: Model,
    state: State,
    angles: tuple[np.ndarray, np.ndarray, np.ndarray],
    light: np.ndarray,
) -> np.ndarray:
    """The quantities of a model, shape (quantities, N)."""
    values: dict[str, np.ndarray] = {}
    elements: dict[str, np.ndarray] = {}
    if any(not is_element(q) for q in state.quantities):
        stokes = model.stokes(*angles, incident=light, part=state.part)
        values = {name: stokes[..., k] for k, name in enumerate(STOKES)}
    if any(is_element(q) for q in state.quantities):
        M = model.mueller(*angles, part=state.part)
        elements = {f"m{i}{j}": M[..., i, j] for i in range(4) for j in range(4)}
    return np.array([modelled(elements if is_element(q) else values, q) for q in state.quantities])


def _points(state: State, choice: Choice | None, line: Line, expected: np.ndarray) -> np.ndarray:
    """Measured value, uncertainty, deviation from what is expected and weight, shape (quantities, 4, M)."""
    rows = line.rows
    found = np.full((len(state.quantities), 4, len(rows)), np.nan)
    for k, quantity in enumerate(state.quantities):
        if choice is None or (known := choice.measured.channel(quantity)) is None:
            continue
        channel, spread = known
        value, weigh = channel.measured[rows], spread[rows]
        deviation = value - expected[k]
        if quantity == "aolp":
            deviation = within_half_turn(deviation, 90.0)
        found[k] = value, channel.std[rows], deviation / weigh, 1.0 / weigh
    return found


def half_turn_of(angle: np.ndarray) -> float:
    """Where the half turn begins within which angles of polarisation along a curve are drawn, degrees.

    It is that of the figures, −45 … 135, or 45 … 225 where the curve crosses the ends of that less often: light that is
    polarised at 135° would jump from end to end. Neither of p and s lies on an end.
    """
    known = angle[np.isfinite(angle)]

    def crossings(start: float) -> int:
        return int((np.abs(np.diff(_within(known, start))) > 90.0).sum())

    return min(_STARTS, key=crossings)


def _within(angle: np.ndarray, start: float) -> np.ndarray:
    return start + (angle - start) % 180.0
