"""Maps for the page: the picture of one of their variables, as large as the screen needs it, and what a pixel says.

``settings.map`` of the state names the map and the variable, the ``pixel`` as row and column, the ``region`` that is
shown as first row, first column, rows and columns, and the ``place`` along dimensions that the picture does not have.
A picture is read with strides, a pixel alone: a map that lies in a store is never held as a whole.
"""

from __future__ import annotations

import json
import math
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np

from pbrdf.errors import PbrdfError
from pbrdf.explorer.messages import error_answer
from pbrdf.explorer.session import Emit
from pbrdf.explorer.state import State, StateError, read_state
from pbrdf.explorer.workspace import Workspace, model_name
from pbrdf.identification.class_map import NONE_OF_THESE, NOT_MEASURED
from pbrdf.models.base import Model
from pbrdf.models.registry import find_model
from pbrdf.report.numbers import brief, per_cent, with_error
from pbrdf.report.parameter_map.colours import (
    MASKED,
    NO_RESULT,
    NOT_YET,
    ON_BOUND,
    UNDETERMINED,
    WIDE,
    colours_of_states,
    scale_of,
)
from pbrdf.report.parameter_map.shown_map import GOOD, MOST_PIXELS, PENDING, WITHOUT, Label, labels_of

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["ChosenMap", "Picture", "Variable", "answer", "chosen_map", "dims_of", "model_at", "variables_of"]

#: Colours of what limits a parameter, by the names of the flags.
_LIMITS = {"at_lower_bound": "#0072B2", "at_upper_bound": "#E69F00", "undetermined": UNDETERMINED}
#: What became of a pixel, in words.
_STATES = {
    GOOD: "The fit converged.",
    "not_converged": "The fit did not converge: the values are where it stopped and have no standard errors.",
    "too_few_values": "Too few values were measured for the free parameters: not fitted.",
    "failed": "The fit failed.",
    "not_measured": "Nothing was measured here.",
    "masked": "The pixel was left out.",
    PENDING: "Nobody has fitted it yet.",
}
#: What limits a parameter, in words.
_FLAGS = {
    "at_lower_bound": "on its lower bound",
    "at_upper_bound": "on its upper bound",
    "undetermined": "the data do not determine it",
}
#: Variables of a pixel that are read; correlations are not.
_OF_A_PIXEL = (
    *("estimate", "standard_error", "flags", "status", "chi2", "degrees_of_freedom", "optima"),
    *("material", "confidence"),
)
#: The pixel that each page has shown last, as its numbers do not change with every move of a slider.
_said: WeakKeyDictionary[Workspace, tuple[str, xr.Dataset]] = WeakKeyDictionary()
#: Pictures are read one after the other.
_reading = threading.Lock()


@dataclass(frozen=True)
class Variable:
    """What a picture shows: its name in the state, what it is listed under, what it is called, its unit."""

    name: str
    group: str
    text: str
    unit: str = ""


@dataclass(frozen=True, eq=False)
class Picture:
    """A variable of the shown pixels.

    Attributes
    ----------
    header
        Title, range of the colours, and the kinds of pixels that have no value or a class: text, colour, share.
    values
        As they are shown, float32, shape (rows, columns); NaN where there is none.
    kinds
        0 where a pixel has the colour of its value, else the place in the kinds, counted from 1, same shape.
    """

    header: dict[str, Any]
    values: np.ndarray
    kinds: np.ndarray


@dataclass(frozen=True, eq=False)
class ChosenMap:
    """What a state shows of a map.

    Attributes
    ----------
    name, dataset
        The map.
    dims
        Dimensions of the picture, (down, across), or a single one across.
    place
        Index along each dimension that the picture does not have.
    region
        First row, first column, rows and columns that are shown.
    variable
        What is shown of them.
    pixel
        Row and column, or None.
    """

    name: str
    dataset: xr.Dataset
    dims: tuple[str, ...]
    place: Mapping[str, int]
    region: tuple[int, int, int, int]
    variable: Variable
    pixel: tuple[int, int] | None

    @property
    def size(self) -> tuple[int, int]:
        """Rows and columns of the whole map."""
        return _size(self.dataset, self.dims)

    @property
    def step(self) -> int:
        """Every so many pixels are shown, in both directions."""
        return max(math.ceil(max(self.region[2:]) / MOST_PIXELS), 1)

    @property
    def key(self) -> str:
        """Tells pictures apart."""
        return json.dumps([self.name, self.variable.name, self.place, self.region], ensure_ascii=False)

    @property
    def left(self) -> int:
        """Parts of the map that were not fitted when it was opened."""
        return int(self.dataset.attrs.get("units_missing", 0))

    @property
    def is_of_parameters(self) -> bool:
        """Whether it is a map of parameters, and not of materials."""
        return "estimate" in self.dataset

    @property
    def indices(self) -> dict[str, int]:
        """Index of the pixel along every dimension of the map, in their order."""
        assert self.pixel is not None
        at = dict(zip(self.dims, self.pixel[-len(self.dims) :], strict=True)) | dict(self.place)
        return {dim: at[dim] for dim in dims_of(self.dataset)}

    def _read(self, name: str, parameter: int | None = None) -> np.ndarray:
        """A variable at the shown pixels, shape (rows, columns)."""
        top, left, rows, columns = self.region
        slices = [slice(top, top + rows, self.step), slice(left, left + columns, self.step)]
        where: dict[str, Any] = {
            **self.place,
            **dict(zip(self.dims, slices[-len(self.dims) :], strict=True)),
        }
        if parameter is not None:
            where["parameter"] = parameter
        values = np.asarray(self.dataset[name].isel(where).transpose(*self.dims).values)
        return values.reshape((1, -1) if len(self.dims) == 1 else values.shape)

    def picture(self) -> Picture:
        """Read what is shown."""
        kind, _, name = self.variable.name.partition(":")
        _, _, rows, columns = self.region
        kinds = _Kinds((math.ceil(rows / self.step), math.ceil(columns / self.step)))
        scale: tuple[float, float, bool] | None = None
        if kind == "material":
            values = self._read("material").astype(float)
            self._put_materials(kinds, values)
        elif kind == "confidence":
            values = self._read("confidence").astype(float)
            self._put_materials(kinds, np.where(np.isfinite(values), np.nan, self._read("material")))
            known = values[np.isfinite(values)]
            low = float(known.min()) if known.size else 0.0
            scale = min(math.floor(10.0 * low) / 10.0, 0.9), 1.0, False
        elif kind == "status":
            values, words = self._states()
            for k, (state, colour) in enumerate(zip(words, colours_of_states(words), strict=True)):
                kinds.put(values == k, state.replace("_", " "), colour)
        else:
            values, scale = self._of_parameters(kinds, kind, name)
        values = np.where(np.isfinite(values), values, np.nan).astype(np.float32)
        header = {
            "title": self.variable.text,
            "unit": self.variable.unit,
            "range": scale and list(scale[:2]),
            "logarithmic": bool(scale and scale[2]),
            "kinds": kinds.told,
            "rows": values.shape[0],
            "columns": values.shape[1],
            "step": self.step,
            "region": list(self.region),
            "key": self.key,
        }
        return Picture(header, values, kinds.numbers)

    def _of_parameters(
        self, kinds: _Kinds, kind: str, name: str
    ) -> tuple[np.ndarray, tuple[float, float, bool] | None]:
        """Values of a map of parameters that are numbers, or flags, and the scale of the former."""
        codes, words = self._states()
        good = codes == words.index(GOOD) if GOOD in words else np.zeros(codes.shape, bool)
        without = np.isin(codes, [k for k, word in enumerate(words) if word in WITHOUT])
        pending = codes == words.index(PENDING)
        labels = labels_of(self.dataset)
        if kind == "reduced_chi2":
            freedom = np.nan_to_num(self._read("degrees_of_freedom"))
            values = self._read("chi2") / np.where(freedom > 0, freedom, np.nan)
        else:
            k = [label.name for label in labels].index(name)
            flags, masks = np.nan_to_num(self._read("flags", k)).astype(int), _masks(self.dataset)
            undetermined = good & (flags & masks.get("undetermined", 0) != 0)
            if kind == "limits":
                values = np.where(good, flags, np.nan).astype(float)
                for flag, bit in masks.items():
                    kinds.put(good & (flags & bit != 0), _FLAGS.get(flag, flag), _LIMITS.get(flag, "#000000"))
                kinds.put(good & (flags == 0), "determined", colours_of_states([GOOD])[0])
            else:
                values = labels[k].factor * self._read(kind, k)
                kinds.put(undetermined, _FLAGS["undetermined"], UNDETERMINED)
                if kind == "standard_error":
                    kinds.put(
                        good & ~undetermined & ~np.isfinite(values),
                        "on a bound: no standard error",
                        ON_BOUND,
                    )
        kinds.put(without, "not measured or left out", MASKED)
        kinds.put(pending, "not yet fitted", NOT_YET)
        kinds.put(~(good | without | pending) | ~np.isfinite(values), "no result", NO_RESULT)
        if kind == "limits":
            return values, None
        shown = values[kinds.numbers == 0]
        low, high = scale_of(shown)
        if kind == "estimate":
            return values, (low, high, False)
        wide = low > 0.0 and high / low > WIDE
        return values, (low if wide else 0.0, high, wide)

    def _states(self) -> tuple[np.ndarray, list[str]]:
        """What became of the pixels, as places in a list of names, the last of which is that nobody came yet."""
        codes, (words, known) = self._read("status"), _meanings(self.dataset["status"], "flag_values")
        known = [code for word, code in zip(words, known, strict=True) if word != PENDING]
        words = [word for word in words if word != PENDING]
        found = np.full(codes.shape, float(len(words)))
        for k, code in enumerate(known):
            found[codes == code] = k
        return found, [*words, PENDING]

    def _put_materials(self, kinds: _Kinds, values: np.ndarray) -> None:
        from matplotlib.colors import to_hex

        from pbrdf.report.identification.class_figure import NONE, WITHOUT, colours_of_materials

        names = [str(name) for name in self.dataset["material_name"].values]
        for k, (name, colour) in enumerate(zip(names, colours_of_materials(len(names)), strict=True)):
            kinds.put(values == k, name, to_hex(colour))
        kinds.put(values == NONE_OF_THESE, "none of these", NONE)
        kinds.put(values == NOT_MEASURED, "not measured", WITHOUT)

    def at_pixel(self, workspace: Workspace) -> xr.Dataset:
        """All that the map says of the chosen pixel, in memory."""
        key = json.dumps([self.name, self.indices])
        known = _said.get(workspace)
        # what is not all fitted goes on changing
        if known is None or known[0] != key or self.left:
            names = [name for name in _OF_A_PIXEL if name in self.dataset]
            known = _said[workspace] = key, self.dataset[names].isel(self.indices).load()
        return known[1]

    def described_pixel(self, workspace: Workspace) -> dict[str, Any]:
        """The chosen pixel for the page: where it is, what became of it, its numbers."""
        found = self.at_pixel(workspace)
        content: dict[str, Any] = {"at": self.pixel, "where": self._where(), "rows": [], "facts": []}
        if not self.is_of_parameters:
            number, confidence = int(found["material"]), float(found["confidence"])
            names = {k: str(name) for k, name in enumerate(self.dataset["material_name"].values)}
            names |= {NONE_OF_THESE: "None of the materials.", NOT_MEASURED: "Nothing was measured here."}
            content["status"] = names.get(number, "–")
            if number >= 0:
                content["facts"] = [["probability, given that it is one of them", per_cent(confidence)]]
            return content
        words, codes = _meanings(self.dataset["status"], "flag_values")
        state = dict(zip(codes, words, strict=True)).get(int(found["status"]), PENDING)
        content["status"] = _STATES.get(state, state.replace("_", " "))
        masks = _masks(self.dataset)
        for k, label in enumerate(labels_of(self.dataset)):
            value, error = (
                label.factor * float(found[name].values[k]) for name in ("estimate", "standard_error")
            )
            flags = int(np.nan_to_num(found["flags"].values[k]))
            notes = [_FLAGS.get(flag, flag) for flag, bit in masks.items() if flags & bit]
            content["rows"].append(
                {
                    "text": label.text,
                    "about": label.description,
                    "written": with_error(value, error) if math.isfinite(value) else "–",
                    "unit": label.unit,
                    "note": "; ".join(notes),
                }
            )
        chi2 = float(found["chi2"])
        if math.isfinite(chi2):
            freedom = int(found["degrees_of_freedom"])
            reduced = f" = {brief(chi2 / freedom, 3)}" if freedom else ""
            content["facts"] = [["χ² / degrees of freedom", f"{brief(chi2)} / {freedom}{reduced}"]]
        return content

    def _where(self) -> str:
        """The chosen pixel in words, with its coordinates where the map has some."""
        told = []
        sides = ("rows from the top", "columns from the left") if len(self.dims) == 2 else ("from the left",)
        for dim, index in self.indices.items():
            side = f" ({sides[self.dims.index(dim)]})" if dim in self.dims else ""
            value = ""
            if dim in self.dataset.coords and self.dataset[dim].dtype.kind in "iuf":
                unit = str(self.dataset[dim].attrs.get("units", ""))
                if unit not in ("", "1"):
                    value = f", {brief(float(self.dataset[dim].values[index]))} {unit}"
            told.append(f"{dim} {index}{side}{value}")
        return ", ".join(told)


class _Kinds:
    """Pixels that have a colour of their own; what was put first stays."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.numbers = np.zeros(shape, dtype=np.uint16)
        self.told: list[dict[str, Any]] = []

    def put(self, where: np.ndarray, text: str, colour: str) -> None:
        where = where & (self.numbers == 0)
        if where.any():
            self.told.append({"text": text, "colour": colour, "share": per_cent(float(where.mean()))})
            self.numbers[where] = len(self.told)


def dims_of(dataset: xr.Dataset) -> tuple[str, ...]:
    """Dimensions of a map."""
    return tuple(str(d) for d in dataset["status" if "status" in dataset else "material"].dims)


def _size(dataset: xr.Dataset, dims: tuple[str, ...]) -> tuple[int, int]:
    sizes = [dataset.sizes[d] for d in dims]
    return (1, sizes[0]) if len(sizes) == 1 else (sizes[0], sizes[1])


def _meanings(array: xr.DataArray, numbers: str) -> tuple[list[str], list[int]]:
    """Names of the values of a variable, and the values."""
    try:
        words = str(array.attrs["flag_meanings"]).split()
        values = [int(v) for v in np.asarray(array.attrs[numbers]).ravel()]
    except (KeyError, TypeError, ValueError):
        words, values = [], [0]
    if len(words) != len(values):
        raise PbrdfError(f"this map does not say what the values of {array.name} mean: it is damaged")
    return words, values


def _masks(dataset: xr.Dataset) -> dict[str, int]:
    """Bits of what limits a parameter, by name."""
    found = dict(zip(*_meanings(dataset["flags"], "flag_masks"), strict=True))
    found.pop(PENDING, None)
    return found


def variables_of(dataset: xr.Dataset) -> list[Variable]:
    """What a picture of a map can show."""
    if "estimate" not in dataset:
        return [
            Variable("material", "", "material"),
            Variable("confidence", "", "probability of the material"),
        ]
    labels = labels_of(dataset)

    def of_each(
        kind: str, group: str, text: Callable[[Label], str], with_unit: bool = True
    ) -> list[Variable]:
        return [
            Variable(f"{kind}:{label.name}", group, text(label), label.unit if with_unit else "")
            for label in labels
        ]

    return [
        *of_each("estimate", "Values", lambda label: label.text),
        *of_each("standard_error", "Standard errors", lambda label: f"standard error of {label.text}"),
        *of_each("limits", "What limits the values", lambda label: f"limits of {label.text}", False),
        Variable("reduced_chi2", "Quality", "χ² per degree of freedom"),
        Variable("status", "Quality", "what became of the pixel"),
    ]


def chosen_map(state: State, workspace: Workspace) -> ChosenMap | None:
    """The map that a state shows: the one it names, else the first that is open; None where there are none.

    Raises
    ------
    StateError
        If the settings are none, or name what is not there.
    """
    settings = state.settings.get("map", {})
    name = settings.get("name")
    if not workspace.maps and name is None:
        return None
    by_name = dict(reversed(workspace.maps))
    if name is None:
        name = workspace.maps[0][0]
    if not isinstance(name, str) or name not in by_name:
        raise StateError("settings.map.name", f"no map called {str(name)[:80]!r} is open here: open it first")
    dataset = by_name[name]
    every = dims_of(dataset)
    long = [d for d in every if dataset.sizes[d] > 1] or list(every[-1:])
    dims = ("y", "x") if {"y", "x"} <= {*every} else tuple(long[-2:])
    variables = {variable.name: variable for variable in variables_of(dataset)}
    wanted = settings.get("variable")
    # of another map, perhaps of another model
    variable = variables.get(wanted) if isinstance(wanted, str) else None
    size = _size(dataset, dims)
    return ChosenMap(
        name,
        dataset,
        dims,
        _place(settings.get("place", {}), {d: dataset.sizes[d] for d in every if d not in dims}),
        _region(settings.get("region"), size),
        variable or next(iter(variables.values())),
        _pixel(settings.get("pixel"), size),
    )


def _whole_numbers(given: Any, place: str, count: int) -> list[int]:
    numbers = given if isinstance(given, list) else []
    if len(numbers) != count or any(isinstance(n, bool) or not isinstance(n, int) for n in numbers):
        raise StateError(place, f"{place} should be {count} whole numbers")
    return numbers


def _pixel(given: Any, size: tuple[int, int]) -> tuple[int, int] | None:
    if given is None:
        return None
    row, column = _whole_numbers(given, "settings.map.pixel", 2)
    if not (0 <= row < size[0] and 0 <= column < size[1]):
        raise StateError(
            "settings.map.pixel", f"the map has {size[0]} rows and {size[1]} columns, counted from 0"
        )
    return row, column


def _region(given: Any, size: tuple[int, int]) -> tuple[int, int, int, int]:
    if given is None:
        return 0, 0, *size
    top, left, rows, columns = _whole_numbers(given, "settings.map.region", 4)
    if not (0 <= top < top + rows <= size[0] and 0 <= left < left + columns <= size[1]):
        raise StateError("settings.map.region", "the region that is shown lies within the map")
    return top, left, rows, columns


def _place(given: Any, sizes: Mapping[str, int]) -> dict[str, int]:
    place = "settings.map.place"
    if not isinstance(given, Mapping):
        raise StateError(place, "the place should be a JSON object: an index by dimension")
    found = dict.fromkeys(sizes, 0)
    for dim, index in given.items():
        if dim not in sizes:
            continue  # of another map
        if isinstance(index, bool) or not isinstance(index, int) or not 0 <= index < sizes[dim]:
            raise StateError(f"{place}.{dim}", f"{dim} is a whole number from 0 to {sizes[dim] - 1}")
        found[dim] = index
    return found


def model_at(chosen: ChosenMap, workspace: Workspace) -> Model:
    """The model with the parameters of the chosen pixel.

    Raises
    ------
    PbrdfError
        If there is no result.
    """
    if not chosen.is_of_parameters:
        raise PbrdfError("this is a map of materials: it holds no parameters of models")
    kind = find_model(model_name(chosen.dataset))
    described = json.loads(str(chosen.dataset.attrs["model"]))
    found = chosen.at_pixel(workspace)
    names = [str(name) for name in chosen.dataset["parameter"].values]
    estimates = dict(zip(names, found["estimate"].values.tolist(), strict=True))
    values = {p.name: p.default for p in kind.parameters}
    values |= {n: float(v) for n, v in described.get("fixed", {}).items() if n in values}
    # of those that are held at a value of each wavelength the first, as the model of a fit
    values |= {n: table[0][1] for n, table in described.get("by_wavelength", {}).items() if n in values}
    values |= {n: v for n, v in estimates.items() if n in values}
    if not all(map(math.isfinite, values.values())):
        raise PbrdfError("this pixel has no result: there is no model to show")
    return kind.from_values(values, **described.get("options", {}))


def answer(request: dict[str, Any], buffers: Any, workspace: Workspace, emit: Emit) -> None:
    """Answer ``{"type": "map_picture", "state": …}`` with a picture, when it is read: values, then kinds.

    Raises
    ------
    StateError
        If there is no map.
    """
    chosen = chosen_map(read_state(request.get("state")), workspace)
    if chosen is None:
        raise StateError("settings.map.name", "no map is open")
    # a map of 10⁸ pixels takes its time: sliders go on moving
    threading.Thread(
        target=_send, args=(request, chosen, emit), daemon=True, name="pbrdf map picture"
    ).start()


def _send(request: dict[str, Any], chosen: ChosenMap, emit: Emit) -> None:
    try:
        with _reading:
            picture = chosen.picture()
    except PbrdfError as error:
        emit(error_answer(request, str(error), "settings.map"), [])
    except Exception as error:
        emit(
            error_answer(request, f"{chosen.name}: cannot be read: {type(error).__name__}", "settings.map"),
            [],
        )
        raise
    else:
        content = {"type": "map_picture", "id": error_answer(request, "")["id"], **picture.header}
        emit(content, [picture.values.data.cast("B"), picture.kinds.data.cast("B")])
