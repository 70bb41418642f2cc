"""What is drawn together with others: a model, measured data, or a fit, which is both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pbrdf.data.schema import NATURAL_LIGHT
from pbrdf.errors import DataError, ModelError
from pbrdf.models.evaluation import check_incident
from pbrdf.optics.stokes import STOKES, dolp
from pbrdf.report.dataset.cuts import Cut, in_plane_cuts
from pbrdf.report.dataset.points import Points
from pbrdf.report.dataset.quantities import Channel, is_element, polarised_quantities

if TYPE_CHECKING:
    import xarray as xr

    from pbrdf.models import Model

__all__ = [
    "DEFAULT_INCIDENCE",
    "Plane",
    "Source",
    "incidence_of",
    "light_note",
    "light_of",
    "measured_names",
    "planes_of",
]

#: Constants of cuts nearer than this are one panel, degrees.
_SAME = 0.5
#: What a model alone is drawn at, degrees.
DEFAULT_INCIDENCE = 35.0
#: Zenith angle up to which models are drawn in the plane of incidence, degrees.
_GRAZING = 85.0
_STEP = 0.25
#: Share of the largest number of points from which on an angle of incidence has many.
_FULL = 0.75
_FIRST_COLUMN = {"m00": "intensity", "m10": "Q/I", "m20": "U/I", "m30": "V/I"}


@dataclass(frozen=True)
class Source:
    """One of the things that are drawn.

    Attributes
    ----------
    name
        What to call it.
    model
        A model with single numbers as parameters; None for data alone.
    dataset
        The data; None for a model alone. A fit has both, and its model is drawn without what the instrument adds.
    """

    name: str
    model: Model | None = None
    dataset: xr.Dataset | None = None

    def __post_init__(self) -> None:
        if self.model is not None and any(np.ndim(value) for value in self.model.values.values()):
            raise ModelError(
                f"{self.name}: its parameters are arrays; a figure shows one set of single numbers"
            )

    @property
    def points(self) -> Points | None:
        """The measured points; None without data."""
        return None if self.dataset is None else Points.from_dataset(self.dataset)

    def channel(self, name: str) -> Channel | None:
        """A quantity of the measured points by name; None where it was not measured."""
        points, dataset = self.points, self.dataset
        if points is None or dataset is None:
            return None
        natural = tuple(dataset.attrs["illumination"]) == NATURAL_LIGHT
        # under natural light the first column of the matrix is the Stokes vector
        for known in (name, _FIRST_COLUMN.get(name, "") if natural else ""):
            if known in points.channels or known in points.polarised:
                found = points.channel(known)
                return found if np.isfinite(found.measured).any() else None
        return None

    def modelled(
        self,
        names: Sequence[str],
        light: Sequence[float],
        theta_i: np.ndarray,
        theta_r: np.ndarray,
        phi: np.ndarray,
    ) -> dict[str, np.ndarray]:
        """Quantities of the model by name, under light of this Stokes vector; angles in radians, which broadcast."""
        assert self.model is not None
        if any(is_element(name) for name in names):
            M = self.model.mueller(theta_i, theta_r, phi)
            columns = {f"m{i}{j}": M[..., i, j] for i in range(4) for j in range(4)}
        else:
            stokes = self.model.stokes(theta_i, theta_r, phi, incident=light)
            columns = {name: stokes[..., i] for i, name in enumerate(STOKES)}
            found = {"intensity": stokes[..., 0], "dolp": dolp(stokes)}
        polarised = {n: c.measured for n, c in polarised_quantities(columns).items()}
        found = polarised if "m00" in columns else {**found, **polarised}
        return {name: found[name] for name in names if name in found}


@dataclass(frozen=True)
class Plane:
    """A panel's worth of the plane of incidence: what is constant there, and which data it holds.

    Attributes
    ----------
    kind, constant
        As of :class:`~pbrdf.report.dataset.cuts.Cut`.
    cuts
        The cuts of each source by its position among the sources.
    """

    kind: str
    constant: float
    cuts: dict[int, list[Cut]]

    @property
    def title(self) -> str:
        """What is constant, in a formula."""
        left = {"theta_i": "θi", "theta_r": "θr", "bistatic": "θi + θr", "mirror": "θr − θi"}[self.kind]
        return f"{left} = {round(self.constant, 1) + 0.0:g}°"

    def path(self) -> Cut:
        """The line along which models are drawn: through the data, or where there are none, all of it."""
        ends = [x for cuts in self.cuts.values() for cut in cuts for x in (cut.x.min(), cut.x.max())]
        low, high = (min(ends), max(ends)) if ends else (-_GRAZING, _GRAZING)
        fine = np.arange(low, high + _STEP / 2.0, _STEP)
        # the mirror direction is a point of the curve: a narrow peak has its top there
        mirror = {"theta_i": self.constant, "theta_r": abs(self.constant), "bistatic": self.constant / 2.0}
        x = fine
        if self.kind in mirror:  # a viewer that follows the source is always or never there
            x = np.unique(np.append(fine, np.clip(mirror[self.kind], low, high)))
        return Cut(self.kind, self.constant, "", np.empty(0, dtype=int), x, x)


def planes_of(sources: Sequence[Source], theta_i: float | None, most: int) -> tuple[list[Plane], int]:
    """The panels that a figure of the plane of incidence has.

    Parameters
    ----------
    sources
        What is drawn.
    theta_i
        Angle of incidence in degrees that is asked for: of data, the nearest that was measured. None for what was
        measured, and 35° without data.
    most
        Panels beyond this number are left out, evenly.

    Returns
    -------
    planes, found
        The panels, and how many there would be.

    Raises
    ------
    DataError
        If the data do not lie on few lines in the plane of incidence, or on lines of another kind than is asked for.
    """
    found: list[Plane] = []
    for i, source in enumerate(sources):
        points = source.points
        if points is None:
            continue
        cuts = in_plane_cuts(points)
        if not cuts:
            raise DataError(
                f"{source.name}: its points lie on no few lines in the plane of incidence; draw it with "
                "--kind hemisphere"
            )
        for cut in cuts:
            for plane in found:
                if plane.kind == cut.kind and abs(plane.constant - cut.constant) < _SAME:
                    plane.cuts.setdefault(i, []).append(cut)
                    break
            else:
                found.append(Plane(cut.kind, cut.constant, {i: [cut]}))
    if not found:
        return [Plane("theta_i", DEFAULT_INCIDENCE if theta_i is None else theta_i, {})], 1
    found.sort(key=lambda plane: plane.constant)
    if theta_i is not None:
        of_incidence = [plane for plane in found if plane.kind == "theta_i"]
        if not of_incidence:
            raise DataError(
                f"--theta-i {theta_i:g}: the angle of incidence is not constant along these data; leave it out"
            )
        return [min(of_incidence, key=lambda plane: abs(plane.constant - theta_i))], 1
    if len(found) <= most:
        return found, len(found)
    return [found[k] for k in np.linspace(0, len(found) - 1, most).round().astype(int)], len(found)


def incidence_of(sources: Sequence[Source], theta_i: float | None) -> float:
    """Angle of incidence at which hemispheres are drawn, degrees: the measured one nearest to what is asked for.

    Without a wish it is the middle one of those with many points; without data 35°.
    """
    measured = [np.round(points.theta_i, 1) for s in sources if (points := s.points) is not None]
    if not measured:
        return DEFAULT_INCIDENCE if theta_i is None else theta_i
    angles, counts = np.unique(measured[0], return_counts=True)
    if theta_i is not None:
        return float(angles[np.abs(angles - theta_i).argmin()])
    full = angles[counts >= _FULL * counts.max()]
    return float(full[np.abs(full - np.median(measured[0])).argmin()])


def measured_names(sources: Sequence[Source], light: Sequence[float]) -> list[str]:
    """Quantities of Stokes vectors that are drawn: those that were measured, or without data what a model has.

    In the plane of incidence natural light gets neither U nor V.

    Raises
    ------
    DataError
        If none of them was measured.
    """
    wanted = ("intensity", "Q/I", "U/I", "V/I", "dolp", "aolp")
    if all(source.dataset is None for source in sources):
        natural = tuple(light) == NATURAL_LIGHT
        return ["intensity", "Q/I", "dolp"] if natural else ["intensity", "Q/I", "U/I", "V/I", "dolp"]
    names = [name for name in wanted if any(source.channel(name) is not None for source in sources)]
    if not names:
        listed = ", ".join(source.name for source in sources)
        raise DataError(
            f"{listed}: there are elements of Mueller matrices alone; draw them with --kind mueller"
        )
    return names


def light_of(sources: Sequence[Source], incident: Sequence[float] | None = None) -> tuple[float, ...]:
    """Stokes vector of the light of all data; without data the ``incident`` one, natural light if None.

    Raises
    ------
    DataError
        If the data were measured under different light, or under another than is asked for.
    ModelError
        If ``incident`` is the Stokes vector of no light.
    """
    asked = None if incident is None else tuple(check_incident(incident))
    lights = {
        source.name: tuple(float(x) for x in source.dataset.attrs["illumination"])
        for source in sources
        if source.dataset is not None
    }
    if len(set(lights.values())) > 1:
        raise DataError(f"{', '.join(lights)} were measured under different light: draw them one by one")
    found = next(iter(lights.values()), NATURAL_LIGHT if asked is None else asked)
    if asked is not None and not np.allclose(found, asked):
        raise DataError(f"{next(iter(lights))} was measured under light of the Stokes vector {found}")
    return found


def light_note(light: Sequence[float]) -> str:
    """What a title says of the light, nothing of natural light."""
    return "" if tuple(light) == NATURAL_LIGHT else f", light {', '.join(f'{s:.3g}' for s in light)}"
