"""Measured data for the page: which data set is shown, its points, and what a fit of them leaves out.

Values and standard uncertainties are those of the figures of ``pbrdf plot``; deviations from a model count in the
uncertainties that a fit weighs with, which are assumed where the data state none.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np

from pbrdf.data.origin import of_rows
from pbrdf.data.select import WAVELENGTH_TOLERANCE
from pbrdf.errors import PbrdfError
from pbrdf.explorer.fit_process import process_of
from pbrdf.explorer.session import Emit
from pbrdf.explorer.state import State, StateError, number, read_state
from pbrdf.explorer.workspace import Workspace
from pbrdf.inversion.holdout import HoldOut
from pbrdf.inversion.observations import Observations, noise_in_words
from pbrdf.optics.stokes import dolp
from pbrdf.report.dataset.cuts import in_plane_cuts
from pbrdf.report.dataset.points import Points, dolp_uncertainty, error_correlation, ratio_dolp
from pbrdf.report.dataset.quantities import Channel, polarised_quantities, quantity_label
from pbrdf.report.dataset.shown_cuts import ShownCuts

if TYPE_CHECKING:
    import xarray as xr

__all__ = [
    "Choice",
    "Measured",
    "answer",
    "chosen_data",
    "label_of",
    "modelled",
]

#: Names in the figures of the page's quantities that are called otherwise there.
_NAMES = {"q": "Q/I", "u": "U/I", "v": "V/I"}
#: Under natural light the first column of the Mueller matrix is the Stokes vector.
_FIRST_COLUMN = {"Q/I": "m10", "U/I": "m20", "V/I": "m30"}
#: Groups or angles that the page lists, at most.
_MOST_LISTED = 200
#: Points that a page has shown, by data set and wavelength.
_measured: WeakKeyDictionary[Workspace, dict[Any, Measured]] = WeakKeyDictionary()


def label_of(quantity: str) -> str:
    """What stands at the axis of one of the page's quantities."""
    if quantity in ("intensity", "m00"):
        return f"{quantity} (1/sr)"
    return "DoLP" if quantity == "dolp" else quantity_label(_NAMES.get(quantity, quantity))


def modelled(values: Mapping[str, np.ndarray], quantity: str) -> np.ndarray:
    """One of the page's quantities of Stokes parameters or Mueller elements by name, as the figures make it."""
    if quantity == "intensity":
        return values["I"]
    if quantity == "dolp":
        return np.asarray(dolp(np.stack([values[name] for name in "IQUV"], axis=-1)))
    name = _NAMES.get(quantity, quantity)
    made = polarised_quantities(values)
    return made[name].measured if name in made else np.full(next(iter(values.values())).shape, np.nan)


@dataclass(frozen=True)
class Measured:
    """The points of a data set, of one of its wavelengths where it has several.

    Attributes
    ----------
    name
        What the data set is called.
    whole
        All of it.
    wavelength
        The wavelength that is shown, nm; None for all.
    rows
        Rows of ``whole`` that are shown, shape (G,).
    dataset
        These rows.
    points
        The same as the figures draw them.
    spread
        What a fit divides deviations by, for the figures' quantities by name, shape (G,); NaN where it uses none.
    noise
        Where these come from, in words.
    """

    name: str
    whole: xr.Dataset
    wavelength: float | None
    rows: np.ndarray
    dataset: xr.Dataset
    points: Points
    spread: Mapping[str, np.ndarray]
    noise: str

    @classmethod
    def of(cls, name: str, whole: xr.Dataset, wavelength: float | None) -> Measured:
        """The points of a wavelength in nm; None for all."""
        rows = np.arange(whole.sizes["geometry"])
        if wavelength is not None:
            rows = np.flatnonzero(np.abs(whole["wavelength"].values - wavelength) <= WAVELENGTH_TOLERANCE)
        dataset = of_rows(whole, rows, whole.isel(geometry=rows)) if wavelength is not None else whole
        observations = Observations.from_dataset(dataset)
        return cls(
            name,
            whole,
            wavelength,
            rows,
            dataset,
            Points.from_dataset(dataset),
            _spread(dataset, observations),
            noise_in_words(None, observations),
        )

    @cached_property
    def cuts(self) -> ShownCuts:
        """Lines in the plane of incidence along which the data were taken; none where they are on no few."""
        found = in_plane_cuts(self.points)
        return ShownCuts(found, [], len(found))

    @property
    def light(self) -> tuple[float, ...]:
        """Stokes vector of the light that they were measured in."""
        return tuple(float(x) for x in self.dataset.attrs["illumination"])

    def channel(self, quantity: str) -> tuple[Channel, np.ndarray] | None:
        """One of the page's quantities and what a fit divides its deviations by; None where it was not measured."""
        name = _NAMES.get(quantity, quantity)
        for known in (name, _FIRST_COLUMN.get(name, "")):
            if known in self.points.channels or known in self.points.polarised:
                found = self.points.channel(known)
                nothing = np.full(self.rows.shape, np.nan)
                return (found, self.spread.get(known, nothing)) if np.isfinite(found.measured).any() else None
        return None

    def summary(self) -> dict[str, Any]:
        """What the page says of the data set."""
        groups = sorted({str(g) for g in self.points.group}, key=lambda g: (not g.isdigit(), g.zfill(20)))
        incidences = np.unique(np.round(self.points.theta_i, 1))
        # readers of hemispherical data call a group by its angle of incidence: once is enough
        by_angle = {str(g) for g in groups} == {f"{angle:.0f}" for angle in incidences}
        wavelengths = known_wavelengths(self.whole)
        named = {"intensity": "intensity", "dolp": "DoLP", "aolp": "AoLP"}
        measured = [named.get(n, n) for n in (*self.points.channels, *self.points.polarised)]
        return {
            "name": self.name,
            "title": str(self.whole.attrs.get("title", "")),
            "count": self.whole.sizes["geometry"],
            "shown": len(self.rows),
            "quantity": str(self.whole.attrs["quantity"]),
            "arbitrary": self.points.arbitrary_scale,
            "simulated": bool(self.whole.attrs.get("simulated", 0)),
            "light": list(self.light),
            "noise": self.noise,
            "measured": list(dict.fromkeys(measured)),
            "wavelengths": wavelengths,
            "wavelength": self.wavelength,
            "groups": groups if 1 < len(groups) <= _MOST_LISTED and not by_angle else [],
            "incidences": incidences.tolist() if len(incidences) <= _MOST_LISTED else [],
        }


def _spread(dataset: xr.Dataset, observations: Observations) -> dict[str, np.ndarray]:
    """Standard uncertainties that a fit takes, for the quantities of the figures."""
    present = np.isfinite(observations.std)
    values = dict(zip(observations.channels, np.where(present, observations.values, np.nan), strict=True))
    std = dict(zip(observations.channels, np.where(present, observations.std, np.nan), strict=True))
    found = {name: channel.std for name, channel in polarised_quantities(values, std).items()}
    for intensity in ("I", "m00"):
        if intensity in std:
            found["intensity"] = std[intensity]
    ratio = ratio_dolp({name: (values[name], std[name]) for name in values})
    if "dolp" in std and np.isfinite(std["dolp"]).any():
        found["dolp"] = std["dolp"]
    elif ratio is not None:
        found["dolp"] = ratio.std
    elif {"Q", "m10"} & values.keys() and {"I", "m00"} & values.keys():
        names = ("I", "Q", "U") if "Q" in values else ("m00", "m10", "m20")
        nothing = np.full(present.shape[1], np.nan)
        found["dolp"] = dolp_uncertainty(
            *(values.get(name, nothing) for name in names),
            *(std.get(name, nothing) for name in names),
            correlation=None if observations.correlation is None else error_correlation(dataset),
        )
    return found


def known_wavelengths(dataset: xr.Dataset) -> list[float]:
    """Wavelengths of a data set in nm, ascending; empty where none is stated."""
    if "wavelength" not in dataset.coords:
        return []
    values = np.unique(dataset["wavelength"].values)
    return [float(w) for w in values[np.isfinite(values)]]


@dataclass(frozen=True)
class Choice:
    """What the page shows of the data, and what a fit is to use of them.

    Attributes
    ----------
    measured
        The points.
    off
        Which of them are switched off, shape (G,).
    held_out
        What a fit leaves out and then predicts; None for nothing.
    """

    measured: Measured
    off: np.ndarray
    held_out: HoldOut | None

    @property
    def used(self) -> xr.Dataset:
        """The points that are not switched off.

        Raises
        ------
        StateError
            If none is left.
        """
        if not self.off.any():
            return self.measured.dataset
        if self.off.all():
            raise StateError("settings.data.off", "every point is switched off: switch some on again")
        keep = np.flatnonzero(~self.off)
        return of_rows(self.measured.dataset, keep, self.measured.dataset.isel(geometry=keep))

    @property
    def is_held_out(self) -> np.ndarray:
        """Which points a fit leaves out and then predicts, shape (G,)."""
        if self.held_out is None:
            return np.zeros(self.off.shape, dtype=bool)
        return self.held_out.mask(self.measured.dataset)


def chosen_data(state: State, workspace: Workspace) -> Choice | None:
    """The data that a state shows: those it names, else the first that are open; None where there are none.

    Raises
    ------
    StateError
        If the settings are none, or name what is not there.
    """
    settings = state.settings.get("data", {})
    if workspace.maps:
        from pbrdf.explorer.map_pixels import open_pixel

        open_pixel(settings.get("set"), workspace)
    if not workspace.datasets:
        return None
    by_name = dict(reversed(workspace.datasets))
    name = settings.get("set") or workspace.datasets[0][0]
    if not isinstance(name, str) or name not in by_name:
        raise StateError("settings.data.set", f"no data called {name!r} are open here: choose others")
    whole = by_name[name]
    wavelengths = known_wavelengths(whole)
    wavelength = settings.get("wavelength")
    if wavelength is None:
        wavelength = wavelengths[0] if len(wavelengths) > 1 else None
    else:
        wavelength = number(wavelength, "settings.data.wavelength")
        if not any(abs(w - wavelength) <= WAVELENGTH_TOLERANCE for w in wavelengths):
            listed = ", ".join(f"{w:g}" for w in wavelengths[:20]) or "none"
            raise StateError(
                "settings.data.wavelength", f"{wavelength:g} nm was not measured; there are {listed}"
            )
    known = _measured.setdefault(workspace, {})
    measured = known.get((name, wavelength))
    if measured is None or measured.whole is not whole:
        measured = known[name, wavelength] = Measured.of(name, whole, wavelength)
    return Choice(
        measured,
        np.isin(measured.rows, _rows(settings.get("off", []), whole.sizes["geometry"])),
        _held_out(settings.get("held_out"), measured.dataset),
    )


def _rows(given: Any, count: int) -> list[int]:
    place = "settings.data.off"
    if not isinstance(given, list) or len(given) > count:
        raise StateError(place, "the points that are switched off should be a list of rows")
    for row in given:
        if isinstance(row, bool) or not isinstance(row, int) or not 0 <= row < count:
            raise StateError(
                place, f"there is no row {row!r} in the data: rows are counted from 0 to {count - 1}"
            )
    return given


def _held_out(given: Any, dataset: xr.Dataset) -> HoldOut | None:
    place = "settings.data.held_out"
    if given is None:
        return None
    if not isinstance(given, Mapping) or given.get("kind") not in ("group", "theta_i"):
        raise StateError(place, "hold out groups or angles of incidence: {kind, values}")
    values = given.get("values")
    if not isinstance(values, list) or len(values) > dataset.sizes["geometry"]:
        raise StateError(place, "the values to hold out should be a list")
    if not values:
        return None
    held_out = HoldOut(given["kind"], tuple(str(v) for v in values))
    try:
        held_out.mask(dataset)
    except PbrdfError as error:
        raise StateError(place, str(error)) from None
    return held_out


def answer(request: dict[str, Any], buffers: Any, workspace: Workspace, emit: Emit) -> None:
    """Answer ``{"type": "data", "state": …}`` with what the page lists of the open data, the chosen one in detail."""
    # pixels of maps have data that are opened when a state names them
    some = workspace.datasets or workspace.maps
    chosen = chosen_data(read_state(request.get("state")), workspace) if some else None
    names = [name for name, _ in workspace.datasets]
    content = {"type": "data", "id": request.get("id"), "sets": names, "chosen": None}
    if chosen is not None:
        content["chosen"] = chosen.measured.summary()
        process_of(workspace).warm()  # a fit may come
    emit(content, [])
