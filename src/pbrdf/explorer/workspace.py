"""What is open beside the models: measured data, fits, maps, the state that the page begins with."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.errors import PbrdfError
from pbrdf.explorer.catalogue import layer_of, state_of
from pbrdf.explorer.state import MOST_LAYERS, QUANTITIES
from pbrdf.models.base import Model
from pbrdf.models.registry import find_model

if TYPE_CHECKING:
    import xarray as xr

    from pbrdf.inversion.map_store import MapSource
    from pbrdf.inversion.result import FitResult

__all__ = ["MOST_OPEN", "Workspace", "beginning"]

#: Data sets that are open at once, at most.
MOST_OPEN = 64
#: What the page calls single ratios, and how many quantities are drawn first of data that hold nothing else.
_RATIOS = {"aolp": "aolp", "Q_over_I": "q", "U_over_I": "u", "V_over_I": "v"}
_MOST_FIRST = 4
#: Model that is shown with data alone, as it is what ``pbrdf.fit`` fits if it is not told another.
_MODEL = "double-gauss"
#: Views that stand on the page at first where a map is open.
_VIEWS_OF_MAPS = ("cuts", "map")


class Workspace:
    """What one page works with.

    The lists are kept as they are: pages whose workspaces are given the same lists see what any of them opens, so that
    a page that is loaded again still has the files that were dropped on it.

    Parameters
    ----------
    models, datasets, fits, maps
        Pairs of a name and what is open. A fit's data stand among the data sets, too, see :meth:`add_fit`.
    pictures
        Data that were measured at every pixel of an image, by name.
    map_folders
        By the names of maps that lie in a file of this machine, the folders of these: what they were made from can be
        found there. A map that was dropped on the page has none.

    Attributes
    ----------
    at_close
        Called when the page is closed: what runs for it ends there.
    """

    def __init__(
        self,
        models: list[tuple[str, Model]] | None = None,
        datasets: list[tuple[str, xr.Dataset]] | None = None,
        fits: list[tuple[str, FitResult]] | None = None,
        maps: list[tuple[str, xr.Dataset]] | None = None,
        pictures: list[tuple[str, MapSource]] | None = None,
        map_folders: list[tuple[str, Path]] | None = None,
    ) -> None:
        self.models = [] if models is None else models
        self.datasets = [] if datasets is None else datasets
        self.fits = [] if fits is None else fits
        self.maps = [] if maps is None else maps
        self.pictures = [] if pictures is None else pictures
        self.map_folders = [] if map_folders is None else map_folders
        self.at_close: list[Callable[[], None]] = []

    def again(self) -> Workspace:
        """A workspace of the same things for another page."""
        return Workspace(self.models, self.datasets, self.fits, self.maps, self.pictures, self.map_folders)

    def add_model(self, name: str, model: Model) -> None:
        """Show a model from the beginning.

        Raises
        ------
        PbrdfError
            If its parameters are maps, or there are too many models.
        """
        if any(np.ndim(value) for value in model.values.values()):
            raise PbrdfError(f"{name}: its parameters are arrays; give a model with single numbers")
        if len(self.models) == MOST_LAYERS:
            raise PbrdfError(f"{name}: the explorer shows {MOST_LAYERS} models at once; leave some out")
        self.models.append((_free(name, self.models), model))

    def add_dataset(self, name: str, dataset: xr.Dataset) -> str:
        """Open measured data; returns the name that they have here, that of no others.

        Raises
        ------
        PbrdfError
            If nothing is measured in them, or too many are open.
        """
        from pbrdf.data.select import (
            measured_channels,  # xarray takes as long to load as all else that a page needs
        )

        if not measured_channels(dataset):
            raise PbrdfError(f"{name}: there is no measured value in it")
        if len(self.datasets) >= MOST_OPEN:
            raise PbrdfError(
                f"{name}: {MOST_OPEN} data sets are open, more cannot be: start the explorer again"
            )
        free = _free(name, self.datasets)
        self.datasets.append((free, dataset))
        return free

    def add_fit(self, name: str, result: FitResult) -> None:
        """Open a fit: its model, of several wavelengths that of the first, and its data, too."""
        first = next(iter(result.models), None)
        self.add_model(name if first is None else f"{name} at {first:g} nm", result.model)
        self.add_dataset(name, result.dataset)
        self.fits.append((_free(name, self.fits), result))

    def add_map(self, name: str, dataset: xr.Dataset, folder: Path | None = None) -> str:
        """Open a map; returns the name that it has here, that of no others.

        Parameters
        ----------
        folder
            That it lies in, if what it was made from may be looked for there.
        """
        if len(self.maps) >= MOST_OPEN:
            raise PbrdfError(f"{name}: {MOST_OPEN} maps are open, more cannot be: start the explorer again")
        free = _free(name, self.maps)
        self.maps.append((free, dataset))
        if folder is not None:
            self.map_folders.append((free, folder))
        return free

    def state(self) -> dict[str, Any] | None:
        """The state to begin with, None where nothing was given that has one."""
        layers = [layer_of(name, model) for name, model in self.models]
        if not layers and (self.datasets or self.maps):
            kind = find_model(_MODEL)
            if self.maps and not self.datasets:
                # the sliders of the map's own model
                with suppress(PbrdfError):
                    kind = find_model(model_name(self.maps[0][1]))
            layers = [layer_of(kind.name, kind.from_values({p.name: p.default for p in kind.parameters}))]
        if not layers:
            return None
        state = state_of(layers)
        if self.maps:
            state["settings"]["page"] = {"views": list(_VIEWS_OF_MAPS)}
        if self.datasets:
            first = beginning(self.datasets[0][1])
            state["light"]["theta_i"] = first["theta_i"]
            state["quantities"] = first["quantities"] or state["quantities"]
        return state

    def close(self) -> None:
        """Give up what runs for the page."""
        while self.at_close:
            with suppress(Exception):
                self.at_close.pop()()


def beginning(dataset: xr.Dataset) -> dict[str, Any]:
    """What is shown first of measured data.

    Returns
    -------
    dict
        ``theta_i``, the measured angle of incidence in the middle of all, degrees; ``quantities``, empty where those
        of a new page suit them.
    """
    measured = np.rad2deg(dataset["theta_i"].values)
    middle = np.percentile(measured, 50.0, method="lower")
    return {"theta_i": round(float(middle), 3), "quantities": _quantities(dataset)}


def model_name(dataset: xr.Dataset) -> str:
    """Name of the model of a map of parameters.

    Raises
    ------
    PbrdfError
        If the map does not say.
    """
    try:
        return str(json.loads(str(dataset.attrs["model"]))["model"])
    except (KeyError, TypeError, ValueError):
        raise PbrdfError("this map does not say of which model its parameters are") from None


def _free(name: str, taken: list[tuple[str, Any]]) -> str:
    """A name that none has yet: "paint.csv (2)" after "paint.csv"."""
    names = {other for other, _ in taken}
    number, free = 1, name
    while free in names:
        number += 1
        free = f"{name} ({number})"
    return free


def _quantities(dataset: xr.Dataset) -> list[str]:
    """What is drawn first of data without intensity and degree of polarisation; empty for others."""
    from pbrdf.data.select import measured_channels

    channels = set(measured_channels(dataset))
    if channels & {"I", "dolp", "mueller"} or channels >= {"Q_over_I", "U_over_I"}:
        return []
    known = {_RATIOS.get(name, "") for name in channels}
    if "mueller_over_m00" in channels:
        measured = np.isfinite(dataset["mueller_over_m00"].values).any(axis=0)
        known |= {f"m{i}{j}" for i, j in np.argwhere(measured) if i or j}
    return [quantity for quantity in QUANTITIES if quantity in known][:_MOST_FIRST]
