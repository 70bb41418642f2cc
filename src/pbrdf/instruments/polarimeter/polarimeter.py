"""Polarimeters as what they are to the data: a set of analyser vectors.

The intensity of state j is I_j = W_j · S with the analyser vector W_j, the first row of the Mueller matrix of all that
stands between the light and the detector. S = (I, Q, U, V) in the instrument's axes, see :mod:`pbrdf.optics.elements`.
Equations: Tyo et al., Applied Optics 45, 5453 (2006), eqs. (12)-(15); the two-retarder form I_j = ½ [I + Q cos δ2 +
U sin δ1 sin δ2 + V cos δ1 sin δ2] is theirs with the sign of V of this project.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pbrdf.errors import DataError
from pbrdf.instruments.polarimeter.color_filters import ColorFilters
from pbrdf.instruments.polarimeter.stokes_solution import BLOCK, determined_components, row_space
from pbrdf.optics.elements import diattenuator, retarder, rotate_frame

__all__ = [
    "Polarimeter",
    "division_of_focal_plane",
    "from_settings",
    "lcvr",
    "measured",
    "rotating_polarizer",
    "rotating_retarder",
]


@dataclass(frozen=True, eq=False)
class Polarimeter:
    """Analyser vectors of an instrument, the same everywhere or a map of them over the field of view.

    Attributes
    ----------
    analyzer
        Shape (N, 4), or (rows, columns, N, 4) for a map: each cell serves its share of the image. Read-only.
    states
        Names of the N states, as files and tables call them.
    name
        What the instrument is, for people.
    mosaic
        For a division of focal plane: which state (index) stands at each pixel of the repeated cell, shape (2, 2).
    accuracy
        Standard uncertainties (linear, circular) of the calibration, relative to the intensity: what remains of
        Q/I, U/I and of V/I when noise has been averaged away.
    details
        What it was made from, for reports and files: the kind and its settings as :func:`from_settings` takes them
        (angles in degrees), and notes of what happened to it since.
    filters
        For a mosaic: the colours over its cells, if the camera is one for colours.

    Raises
    ------
    DataError
        If shapes, names or numbers do not fit.
    """

    analyzer: np.ndarray
    states: tuple[str, ...]
    name: str = "polarimeter"
    mosaic: np.ndarray | None = None
    accuracy: tuple[float, float] = (0.0, 0.0)
    details: dict[str, Any] = field(default_factory=dict)
    filters: ColorFilters | None = None

    def __post_init__(self) -> None:
        analyzer = np.asarray(self.analyzer, dtype=float)
        if analyzer.flags.writeable:
            analyzer = analyzer.copy()
            analyzer.flags.writeable = False
        object.__setattr__(self, "analyzer", analyzer)
        object.__setattr__(self, "states", tuple(str(s) for s in self.states))
        if analyzer.ndim not in (2, 4) or analyzer.shape[-1] != 4 or 0 in analyzer.shape:
            raise DataError(
                f"analyser vectors have the shape {analyzer.shape}: give (states, 4), or (rows, columns, states, 4) "
                "for a map"
            )
        if not np.isfinite(analyzer).all():
            raise DataError("an analyser vector holds a number that is not finite")
        if len(self.states) != analyzer.shape[-2]:
            raise DataError(f"{len(self.states)} names for {analyzer.shape[-2]} polarimeter states")
        if len(set(self.states)) != len(self.states):
            raise DataError(f"two polarimeter states have the same name: {', '.join(self.states)}")
        if self.mosaic is not None:
            mosaic = np.array(self.mosaic, dtype=int)
            object.__setattr__(self, "mosaic", mosaic)
            if mosaic.ndim != 2 or sorted(mosaic.ravel().tolist()) != list(range(len(self.states))):
                raise DataError(
                    "the mosaic is a table that holds each state of the polarimeter (0, 1, …) once"
                )
        if self.filters is not None and self.mosaic is None:
            raise DataError("colours stand over the cells of a mosaic, and this polarimeter has none")
        accuracy = tuple(float(a) for a in self.accuracy)
        object.__setattr__(self, "accuracy", accuracy)
        if len(accuracy) != 2 or not all(np.isfinite(a) and a >= 0.0 for a in accuracy):
            raise DataError("the accuracy of a polarimeter is two numbers of 0 or more, linear and circular")

    @property
    def size(self) -> int:
        """Number of states."""
        return len(self.states)

    @property
    def is_map(self) -> bool:
        """Whether the analyser vectors vary over the field of view."""
        return self.analyzer.ndim == 4

    @property
    def mean_analyzer(self) -> np.ndarray:
        """Analyser vectors on the mean over the field of view, shape (N, 4)."""
        return self.analyzer.mean(axis=(0, 1)) if self.is_map else self.analyzer

    @cached_property
    def determined(self) -> np.ndarray:
        """Which of I, Q, U, V the states determine everywhere in the field of view, shape (4,), bool."""
        known = determined_components(row_space(self.analyzer)).reshape(-1, 4)
        return np.asarray(known.all(axis=0))

    def require_intensity(self) -> None:
        """Check that the states determine I, without which there is nothing to reduce; raises DataError.

        A map may have blind spots: their pixels are NaN.
        """
        if not (self.is_map or self.determined[0]):
            raise DataError(
                f"{self.name}: its {self.size} state(s) {', '.join(self.states)} do not determine the intensity: add "
                "states"
            )

    @property
    def is_described(self) -> bool:
        """Whether `details` are settings that give these analyser vectors: not after a calibration, for example."""
        if self.details.get("kind") not in _MAKERS:
            return False
        again = from_settings(self.details)
        return (
            again.analyzer.shape == self.analyzer.shape
            and np.allclose(again.analyzer, self.analyzer, rtol=0.0, atol=1e-10)
            and np.array_equal(np.asarray(again.mosaic), np.asarray(self.mosaic))
        )

    def with_accuracy(self, linear: float, circular: float) -> Polarimeter:
        """The same instrument with another stated accuracy of its calibration."""
        return replace(self, accuracy=(linear, circular))

    def turned(self, angle: float) -> Polarimeter:
        """The instrument turned as a whole about its axis by `angle` (radians, from x towards y)."""
        turn = self.details.get("turned", 0.0) + np.rad2deg(angle)
        return replace(
            self,
            analyzer=self.analyzer @ rotate_frame(angle),
            details={**self.details, "turned": float(turn)},
        )

    def intensities(self, stokes: ArrayLike) -> np.ndarray:
        """Noiseless intensities W·S.

        Parameters
        ----------
        stokes
            Shape (4, ...); for a map (4, rows, columns) of an image that the map is spread over.

        Returns
        -------
        ndarray
            Shape (N, ...).

        Raises
        ------
        DataError
            If the shape does not fit.
        """
        stokes = np.asarray(stokes, dtype=float)
        if stokes.shape[:1] != (4,) or (self.is_map and stokes.ndim != 3):
            need = "(4, rows, columns) for a map of analyser vectors" if self.is_map else "(4, …)"
            raise DataError(f"Stokes vectors have the shape {stokes.shape}: give {need}")
        if not self.is_map:
            return np.tensordot(self.analyzer, stokes, axes=(1, 0))
        rows, columns = stokes.shape[1:]
        found = np.empty((self.size, rows, columns))
        step = max(1, BLOCK // max(columns, 1))
        for first in range(0, rows, step):
            W = self.spread(rows, columns, first, min(first + step, rows))
            np.einsum("yxnk,kyx->nyx", W, stokes[:, first : first + step], out=found[:, first : first + step])
        return found

    def spread(self, rows: int, columns: int, first_row: int = 0, last_row: int | None = None) -> np.ndarray:
        """Analyser vectors of the pixels of an image, shape (last_row − first_row, columns, N, 4).

        Parameters
        ----------
        rows, columns
            Size of the whole image.
        first_row, last_row
            Which rows are wanted; all by default.

        Raises
        ------
        DataError
            If the polarimeter has no map.
        """
        if not self.is_map:
            raise DataError("this polarimeter has one set of analyser vectors: there is no map to spread")
        y = np.arange(first_row, rows if last_row is None else last_row) * self.analyzer.shape[0] // rows
        x = np.arange(columns) * self.analyzer.shape[1] // columns
        values: np.ndarray = self.analyzer[y[:, None], x]
        return values


def lcvr(
    retardances: ArrayLike,
    axes: Sequence[float] = (0.0, np.pi / 4),
    analyzer: float = 0.0,
    *,
    diattenuation: float = 1.0,
    name: str = "liquid-crystal variable retarders",
) -> Polarimeter:
    """Liquid-crystal variable retarders before a fixed analyser.

    Parameters
    ----------
    retardances
        Radians, shape (N, K): of each of the K retarders in each of the N states, in the order the light meets them.
    axes
        Fast axes of the K retarders, radians.
    analyzer
        Axis of the analyser, radians.
    diattenuation
        Of the analyser.

    Raises
    ------
    DataError
        If the shapes do not fit.
    """
    delta = np.asarray(retardances, dtype=float)
    if delta.ndim != 2 or delta.shape[1] != len(axes):
        raise DataError(
            f"retardances have the shape {delta.shape}: give one row a state with {len(axes)} numbers, one for each "
            "axis"
        )
    matrix = diattenuator(analyzer, diattenuation)
    for k in reversed(range(len(axes))):
        matrix = matrix @ retarder(axes[k], delta[:, k])
    details = {
        "kind": "lcvr",
        "axes": _degrees(axes),
        "analyzer": _degrees(analyzer),
        "diattenuation": float(diattenuation),
        "retardances": _degrees(delta),
    }
    return Polarimeter(matrix[:, 0, :], tuple(f"s{j + 1}" for j in range(len(delta))), name, details=details)


def rotating_retarder(
    angles: ArrayLike,
    retardance: float = np.pi / 2,
    analyzer: float = 0.0,
    *,
    diattenuation: float = 1.0,
) -> Polarimeter:
    """A fixed retarder at several angles (radians, shape (N,)) before a fixed analyser."""
    angles = np.atleast_1d(np.asarray(angles, dtype=float))
    matrix = diattenuator(analyzer, diattenuation) @ retarder(angles, retardance)
    details = {
        "kind": "rotating_retarder",
        "angles": _degrees(angles),
        "retardance": _degrees(retardance),
        "analyzer": _degrees(analyzer),
        "diattenuation": float(diattenuation),
    }
    return Polarimeter(matrix[:, 0, :], _angle_names(angles), "rotating retarder", details=details)


def rotating_polarizer(angles: ArrayLike, *, diattenuation: float = 1.0) -> Polarimeter:
    """A linear polariser at several angles (radians, shape (N,)) before the detector; blind to V."""
    angles = np.atleast_1d(np.asarray(angles, dtype=float))
    matrix = diattenuator(angles, diattenuation)
    details = {
        "kind": "rotating_polarizer",
        "angles": _degrees(angles),
        "diattenuation": float(diattenuation),
    }
    return Polarimeter(matrix[:, 0, :], _angle_names(angles), "rotating polariser", details=details)


def division_of_focal_plane(layout: ArrayLike, *, diattenuation: float = 1.0) -> Polarimeter:
    """A mosaic of linear polarisers on the pixels.

    Parameters
    ----------
    layout
        Polariser angles (radians) of the repeated cell, rows from top to bottom, for example
        ``np.deg2rad([[90, 45], [135, 0]])`` of the Sony IMX250MZR.
    diattenuation
        Of the pixels' polarisers.
    """
    layout = np.atleast_2d(np.asarray(layout, dtype=float))
    flat = layout.ravel()
    matrix = diattenuator(flat, diattenuation)
    details = {
        "kind": "division_of_focal_plane",
        "layout": _degrees(layout),
        "diattenuation": float(diattenuation),
    }
    return Polarimeter(
        matrix[:, 0, :],
        _angle_names(flat),
        "division of focal plane",
        mosaic=np.arange(flat.size).reshape(layout.shape),
        details=details,
    )


def measured(
    analyzer: ArrayLike, states: Sequence[str] | None = None, name: str = "measured polarimeter"
) -> Polarimeter:
    """A polarimeter known by its calibrated analyser vectors; shape (N, 4) or (rows, columns, N, 4)."""
    analyzer = np.asarray(analyzer, dtype=float)
    count = analyzer.shape[-2] if analyzer.ndim >= 2 else 0
    names = tuple(states) if states is not None else tuple(f"s{j + 1}" for j in range(count))
    return Polarimeter(analyzer, names, name, details={"kind": "measured"})


def from_settings(settings: Mapping[str, Any]) -> Polarimeter:
    """A polarimeter from its kind and its settings, angles in degrees.

    Parameters
    ----------
    settings
        ``kind`` (``lcvr``, ``rotating_retarder``, ``rotating_polarizer`` or ``division_of_focal_plane``), the
        arguments of the function of that name, and ``turned`` if it is turned as a whole. Others are ignored: the
        `details` of a polarimeter can be given.

    Raises
    ------
    DataError
        If there is no such kind.
    """
    kind = settings.get("kind")
    if kind not in _MAKERS:
        raise DataError(
            f"no polarimeter is made from settings of the kind {kind!r}; use one of {', '.join(_MAKERS)}"
        )
    maker, angles = _MAKERS[kind]
    arguments = {key: np.deg2rad(settings[key]) for key in angles if key in settings}
    if "axes" in arguments:
        arguments["axes"] = arguments["axes"].tolist()
    polarimeter = maker(**arguments, diattenuation=float(settings.get("diattenuation", 1.0)))
    return polarimeter.turned(np.deg2rad(settings["turned"])) if "turned" in settings else polarimeter


_MAKERS: dict[str, tuple[Callable[..., Polarimeter], tuple[str, ...]]] = {
    "lcvr": (lcvr, ("retardances", "axes", "analyzer")),
    "rotating_retarder": (rotating_retarder, ("angles", "retardance", "analyzer")),
    "rotating_polarizer": (rotating_polarizer, ("angles",)),
    "division_of_focal_plane": (division_of_focal_plane, ("layout",)),
}


def _degrees(angles: ArrayLike) -> Any:
    # ten decimals: 135° comes back as 135.0
    return np.round(np.rad2deg(angles), 10).tolist()


def _angle_names(angles: np.ndarray) -> tuple[str, ...]:
    """The angles in degrees, repeated ones told apart by a number."""
    names = [f"{a:g}" for a in np.round(np.rad2deg(angles), 4)]
    return tuple(n if names.count(n) == 1 else f"{n}#{names[: i + 1].count(n)}" for i, n in enumerate(names))
