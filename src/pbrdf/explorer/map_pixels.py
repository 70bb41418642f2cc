"""What was measured at a pixel of a map, as a data set among the open ones: the curves show it, and it can be fitted.

Its name says which pixel it is, so that a state that names it finds it again.
"""

from __future__ import annotations

import json
import re
from contextlib import suppress
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np

from pbrdf.data.alignment import require_same_labels
from pbrdf.data.schema import COORDINATES, COVARIANCE, DIMENSION, STOKES_AXES, VARIABLES, std_name
from pbrdf.data.select import measured_channels
from pbrdf.data.validation import validate
from pbrdf.errors import DataError, PbrdfError
from pbrdf.explorer.catalogue import layer_of
from pbrdf.explorer.maps import chosen_map, dims_of, model_at
from pbrdf.explorer.session import Emit
from pbrdf.explorer.state import StateError, read_state
from pbrdf.explorer.workspace import Workspace
from pbrdf.inversion.map_store.made_from import MadeFrom
from pbrdf.inversion.map_store.picture_source import PictureSource

if TYPE_CHECKING:
    import xarray as xr

    from pbrdf.inversion.map_store import MapSource

__all__ = ["answer", "data_in_words", "open_pixel"]

#: Pixels whose data are open at once, at most; those that are opened first go first.
MOST_PIXELS = 16
_NAME = re.compile(r"(?P<map>.+) at (?P<place>\w+ \d{1,9}(?:, \w+ \d{1,9})*)", re.DOTALL)
#: Letters of such a name, at most.
_LONGEST = 500
#: The data of maps that say where these are, by the names of the maps.
_found: WeakKeyDictionary[Workspace, dict[str, MapSource]] = WeakKeyDictionary()


def _name_of(name: str, indices: dict[str, int]) -> str:
    return f"{name} at {', '.join(f'{dim} {index}' for dim, index in indices.items())}"


def _named(name: str, workspace: Workspace) -> tuple[str, dict[str, int]] | None:
    """The map and the indices that the name of a pixel's data says; None where it is no such name."""
    match = _NAME.fullmatch(name) if len(name) <= _LONGEST else None
    if match is None:
        return None
    dataset = dict(reversed(workspace.maps)).get(match["map"])
    if dataset is None:
        return None
    pairs = [part.rsplit(" ", 1) for part in match["place"].split(", ")]
    indices = {dim: int(index) for dim, index in pairs}
    if {*indices} != {*dims_of(dataset)} or any(at >= dataset.sizes[dim] for dim, at in indices.items()):
        return None
    return match["map"], indices


def open_pixel(name: Any, workspace: Workspace) -> None:
    """Open the data of a pixel if that is what a name says and they are not open.

    Raises
    ------
    StateError
        If they cannot be read.
    """
    if not isinstance(name, str) or name in dict(workspace.datasets):
        return
    named = _named(name, workspace)
    if named is None:
        return
    try:
        dataset = _measured_at(*named, workspace)
    except PbrdfError as error:
        raise StateError("settings.data.set", str(error)) from None
    opened = [i for i, (other, _) in enumerate(workspace.datasets) if _named(other, workspace) is not None]
    if len(opened) >= MOST_PIXELS:
        del workspace.datasets[opened[0]]
    workspace.add_dataset(name, dataset)


def data_in_words(name: str, workspace: Workspace) -> str:
    """Why the data of a map cannot be found; empty where they may be. They are not opened."""
    if _beside(name, workspace) is not None or _told(name, workspace) is not None:
        return ""
    if MadeFrom.of(dict(reversed(workspace.maps))[name].attrs) is not None:
        return (
            "What was measured here is found for a map that is opened by its name, pbrdf explore MAP, not for one that "
            "was dropped on the page."
        )
    return (
        "What was measured here is not known: the map does not say where its data are. Open them beside it, "
        "pbrdf explore MAP DATA."
    )


def _beside(name: str, workspace: Workspace) -> MapSource | None:
    """Data that were opened beside a map and have its pixels, which stand at the same places."""
    dataset = dict(reversed(workspace.maps))[name]
    wanted = {dim: dataset.sizes[dim] for dim in dims_of(dataset)}
    for _, source in workspace.pictures:
        if isinstance(source, PictureSource):
            sizes, places = source.sizes, source.places
        else:
            places = source.outline()
            sizes = {str(dim): size for dim, size in places.sizes.items()}
        if all(sizes.get(dim) == size for dim, size in wanted.items()):
            with suppress(DataError):
                require_same_labels(places, "the data", dataset, "the map", wanted)
                return source
    return None


def _told(name: str, workspace: Workspace) -> MadeFrom | None:
    """What a map says that it was made from; None of a map that was dropped: it may name no file of this machine."""
    if name not in dict(workspace.map_folders):
        return None
    return MadeFrom.of(dict(reversed(workspace.maps))[name].attrs)


def _source(name: str, workspace: Workspace) -> MapSource:
    """The data of a map.

    Raises
    ------
    DataError
        If they cannot be found, or are others.
    """
    beside = _beside(name, workspace)
    if beside is not None:
        return beside
    known = _found.setdefault(workspace, {})
    if name not in known:
        told = _told(name, workspace)
        if told is None:
            raise DataError(data_in_words(name, workspace))
        try:
            source = told.open(dict(workspace.map_folders)[name])
        except PbrdfError as error:
            raise DataError(f"The data of this map cannot be opened: {error}") from None
        if _are_others(dict(reversed(workspace.maps))[name], source):
            raise DataError(f"{told.files[0]} holds other data now than the map was made from.")
        known[name] = source
    return known[name]


def _are_others(dataset: xr.Dataset, source: MapSource) -> bool:
    """Whether data differ from those whose identity a store holds."""
    try:
        stored = json.loads(str(dataset.attrs["map_settings"]))["input"]["files"]
    except (KeyError, TypeError, ValueError):
        return False
    found = json.loads(json.dumps(source.identity()))["files"]
    if len(found) != len(stored):
        return True
    # what a map of a former version does not say of them cannot differ
    return any(
        own.get(key) != told for own, one in zip(found, stored, strict=True) for key, told in one.items()
    )


def _measured_at(name: str, indices: dict[str, int], workspace: Workspace) -> xr.Dataset:
    """What was measured at a pixel, as a data set of the schema.

    What a fit of the map leaves out there is left out: directions that are none, values and uncertainties that are not
    finite, or not above 0.
    """
    block = _source(name, workspace).block({dim: slice(at, at + 1) for dim, at in indices.items()})
    one = block.isel(dict.fromkeys(indices, 0)).load()
    known = {*VARIABLES, *map(std_name, VARIABLES), COVARIANCE, *COORDINATES, *STOKES_AXES}
    one = one.drop_vars([n for n in one.variables if n not in known]).transpose(DIMENSION, ...)
    angles = np.stack([one[n].values for n in ("theta_i", "theta_r", "phi")])
    is_direction = np.isfinite(angles).all(axis=0) & ((angles[:2] >= 0.0) & (angles[:2] < 0.5 * np.pi)).all(
        axis=0
    )
    one = one.isel({DIMENSION: np.flatnonzero(is_direction)})
    for n in map(str, one.data_vars):
        if n in VARIABLES:
            values = one[n].values.astype(float)
            good = np.isfinite(values)
            if std_name(n) in one:
                std = one[std_name(n)].values.astype(float)
                good &= np.isfinite(std) & (std > 0.0)
                one[std_name(n)] = one[std_name(n)].copy(data=np.where(good, std, np.nan))
            one[n] = one[n].copy(data=np.where(good, values, np.nan))
    measured = np.zeros(one.sizes[DIMENSION], dtype=bool)
    for n in measured_channels(one):
        measured |= np.isfinite(one[n].values).reshape(len(measured), -1).any(axis=1)
    if not measured.any():
        raise DataError("Nothing was measured at this pixel.")
    one = one.isel({DIMENSION: np.flatnonzero(measured)}).assign_attrs(title=_name_of(name, indices))
    validate(one, origin="what was measured at this pixel")
    return one


def answer(request: dict[str, Any], buffers: Any, workspace: Workspace, emit: Emit) -> None:
    """Answer ``{"type": "map_pixel", "state": …}`` with what the chosen pixel has: a model, and data that are open now.

    Raises
    ------
    StateError
        If no pixel is chosen, or it has neither.
    """
    state = read_state(request.get("state"))
    chosen = chosen_map(state, workspace)
    if chosen is None or chosen.pixel is None:
        raise StateError("settings.map.pixel", "choose a pixel of the map first")
    content: dict[str, Any] = {"type": "map_pixel", "id": request.get("id"), "layer": None, "data": None}
    name = _name_of(chosen.name, chosen.indices)
    said = []
    try:
        content["layer"] = layer_of(name[-80:], model_at(chosen, workspace))
    except PbrdfError as error:
        said.append(str(error))
    try:
        open_pixel(name, workspace)
        angles = np.rad2deg(dict(workspace.datasets)[name]["theta_i"].values)
        nearest = float(angles[np.abs(angles - state.light.theta_i).argmin()])
        content["data"] = {"set": name, "theta_i": round(nearest, 3)}
    except PbrdfError as error:
        said.append(str(error))
    if content["layer"] is None and content["data"] is None:
        raise StateError("settings.map.pixel", " ".join(said))
    emit({**content, "said": said}, [])
