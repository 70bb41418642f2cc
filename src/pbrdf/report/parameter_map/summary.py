"""What a map says, in numbers and sentences: how each parameter is spread, and for which pixels there is no result."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.instruments.pixel_geometry.labels import label_names
from pbrdf.report.numbers import brief, per_cent, with_error
from pbrdf.report.parameter_map.shown_map import GOOD, PENDING, WITHOUT, Label, ShownMap
from pbrdf.report.printing import plain_table, print_parts

if TYPE_CHECKING:
    import xarray as xr
    from rich.console import Console, RenderableType

__all__ = [
    "MapSummary",
    "ParameterSummary",
    "PartSummary",
    "count_states",
    "counted",
    "parameter_rows",
    "part_headings",
    "part_rows",
    "print_map",
]

#: Parts of the sample that are listed, at most.
_MOST_PARTS = 30
#: Pixels of a map whose states are counted at a time.
_AT_A_TIME = 4_000_000
#: Share of the measured pixels without a result, and χ² per degree of freedom, from which on a map is not called good,
#: and is called none.
_FEW, _MANY = 0.05, 0.5
_DESCRIBED, _MISSED = 2.0, 10.0


@dataclass(frozen=True)
class ParameterSummary:
    """One parameter over the pixels with a result, in shown units.

    Attributes
    ----------
    label
        Of the parameter.
    median, spread
        Middle, and half the range of the middle 68 %, of the pixels that determine it.
    standard_error
        Median of the pixels' own.
    at_bounds, undetermined
        Shares of the pixels.
    same
        Whether all pixels have one value: it was held, or shared.
    """

    label: Label
    median: float
    spread: float
    standard_error: float
    at_bounds: float
    undetermined: float
    same: bool


@dataclass(frozen=True)
class PartSummary:
    """One part of the sample, of those that labels tell apart.

    Attributes
    ----------
    name
        Of the part.
    fitted
        Shown pixels of it with a result.
    medians
        Of each parameter over its pixels that determine it, in shown units; NaN where none does.
    """

    name: str
    fitted: int
    medians: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class MapSummary:
    """What a map says.

    Attributes
    ----------
    states
        Numbers of pixels by state, all pixels of the map.
    parameters
        Their spread over the shown pixels.
    searched, several_optima
        Share of the shown pixels with a result that were searched from many starts, and of these the share that have
        more than one optimum; NaN if there are none.
    reduced_chi2
        Its median; NaN if there is none.
    shown, total
        Numbers of pixels.
    model, noise
        In words.
    held
        Sentences on held values that are a material's.
    parts
        Of the sample, in the order of their labels; empty without labels.
    """

    states: Mapping[str, int]
    parameters: tuple[ParameterSummary, ...]
    searched: float
    several_optima: float
    reduced_chi2: float
    shown: int
    total: int
    model: str
    noise: str
    held: tuple[str, ...] = ()
    parts: tuple[PartSummary, ...] = ()

    @classmethod
    def of(cls, dataset: xr.Dataset, shown: ShownMap, labels: xr.DataArray | None = None) -> MapSummary:
        """Of a map, whose states are counted here, its shown pixels, and the parts that these belong to."""
        good = shown.good
        count = max(int(good.sum()), 1)
        reduced = shown.reduced_chi2[good & np.isfinite(shown.reduced_chi2)]
        return cls(
            states=count_states(dataset, shown),
            parameters=tuple(_of_parameter(shown, k) for k in range(len(shown.labels))),
            searched=float(shown.searched.sum() / count),
            several_optima=float((shown.optima[shown.searched] > 1).mean())
            if shown.searched.any()
            else math.nan,
            reduced_chi2=float(np.median(reduced)) if reduced.size else math.nan,
            shown=shown.status.size,
            total=dataset["status"].size,
            model=_model_in_words(dataset.attrs),
            held=_held(dataset.attrs),
            noise=str(dataset.attrs.get("noise", "")),
            parts=() if labels is None else tuple(_parts_of(shown, labels)),
        )

    @property
    def measured(self) -> int:
        """Pixels that there was something to fit to."""
        return self.total - sum(self.states.get(name, 0) for name in (*WITHOUT, PENDING))

    @property
    def fitted(self) -> int:
        """Pixels with a result."""
        return self.states.get(GOOD, 0)

    @cached_property
    def level(self) -> str:
        """How good the map is: ``describes``, ``partly`` or ``not``."""
        missing = 1.0 - self.fitted / self.measured if self.measured else 1.0
        if missing >= _MANY or self.reduced_chi2 >= _MISSED:
            return "not"
        if missing >= _FEW or self.reduced_chi2 >= _DESCRIBED or self.states.get(PENDING):
            return "partly"
        return "describes"

    @property
    def sentence(self) -> str:
        """The verdict."""
        if not self.measured:
            return "No pixel was measured."
        share = per_cent(self.fitted / self.measured)
        return f"{counted(self.fitted)} of {counted(self.measured)} measured pixels have a result ({share})."

    @property
    def reasons(self) -> list[str]:
        """Sentences on it."""
        lines = []
        if math.isfinite(self.reduced_chi2):
            lines.append(
                f"χ² per degree of freedom: median {brief(self.reduced_chi2, 3)}{self._fit_in_words()}."
            )
        others = [
            f"{name.replace('_', ' ')} {counted(count)}"
            for name, count in self.states.items()
            if count and name not in (GOOD, *WITHOUT, PENDING)
        ]
        if others:
            lines.append(f"Without a result: {', '.join(others)}.")
        if self.states.get(PENDING):
            lines.append(f"Not yet fitted: {counted(self.states[PENDING])} pixels.")
        if math.isfinite(self.several_optima):
            words = self.optima_in_words()
            lines.append(f"{words[0].upper()}{words[1:]}.")
        worst = max(self.parameters, key=lambda p: p.at_bounds, default=None)
        if worst is not None and worst.at_bounds > 0.0:
            lines.append(f"{worst.label.text} is at a bound at {per_cent(worst.at_bounds)} of them.")
        return lines

    def optima_in_words(self) -> str:
        """How often there was more than one optimum."""
        if not math.isfinite(self.several_optima):
            return "no pixel was searched from many starts"
        return (
            f"of the pixels searched from many starts ({per_cent(self.searched)} of those with a result), "
            f"{per_cent(self.several_optima)} have more than one optimum"
        )

    def _fit_in_words(self) -> str:
        if self.reduced_chi2 >= _DESCRIBED:
            return "; the model misses the data by more than their uncertainty, or that is stated too small"
        return ""

    def sampled(self) -> str:
        """Which pixels medians and shares are of; empty if of all."""
        if self.shown == self.total:
            return ""
        return f"Medians and shares are those of {counted(self.shown)} evenly spread pixels of {counted(self.total)}."


def count_states(dataset: xr.Dataset, shown: ShownMap) -> dict[str, int]:
    """Number of pixels in each state, of the whole map, read some rows at a time."""
    status = dataset["status"]
    counts = dict.fromkeys(shown.states, 0)
    codes = dict(zip(shown.codes.tolist(), shown.states, strict=False))
    first = status.dims[0]
    # as many as the store's own pieces hold, so that none is read twice
    own = (status.encoding.get("shards") or status.encoding.get("chunks") or (1,))[0]
    rows = max(_AT_A_TIME // max(status.size // max(status.sizes[first], 1), 1), 1)
    rows = max(rows // own, 1) * own
    for start in range(0, status.sizes[first], rows):
        values, numbers = np.unique(
            status.isel({first: slice(start, start + rows)}).values, return_counts=True
        )
        for value, number in zip(values.tolist(), numbers.tolist(), strict=True):
            counts[codes.get(value, PENDING)] += number
    return counts


def _of_parameter(shown: ShownMap, k: int) -> ParameterSummary:
    determined = shown.determined(k)
    values = shown.estimate[k][determined]
    values = values[np.isfinite(values)]
    errors = shown.standard_error[k][determined]
    errors = errors[np.isfinite(errors)]
    low, middle, high = np.percentile(values, (16.0, 50.0, 84.0)) if values.size else (math.nan,) * 3
    count = max(int(shown.good.sum()), 1)
    return ParameterSummary(
        shown.labels[k],
        float(middle),
        0.5 * float(high - low),
        float(np.median(errors)) if errors.size else math.nan,
        float(shown.at_bounds[k].sum() / count),
        float(shown.flagged("undetermined")[k].sum() / count),
        not shown.varies(k),
    )


def _parts_of(shown: ShownMap, labels: xr.DataArray) -> Iterator[PartSummary]:
    """Medians by label, over the shown pixels."""
    window = shown.window
    steps = {d: slice(None, None, n) for d, n in zip(window.dims, window.steps, strict=True)}
    there = {d: at for d, at in {**steps, **window.others}.items() if d in labels.dims}
    part = labels.isel(there)
    # a label holds along dimensions that the picture of labels has not
    more = {d: n for d, n in zip(window.dims, window.shape, strict=True) if d not in part.dims}
    numbers = part.expand_dims(more).transpose(*window.dims).values
    for number, name in label_names(labels).items():
        inside = numbers == number
        values = (shown.estimate[k][shown.determined(k) & inside] for k in range(len(shown.labels)))
        medians = tuple(float(np.median(v)) if v.size else math.nan for v in values)
        yield PartSummary(name.replace("_", " "), int((shown.good & inside).sum()), medians)


def _model_in_words(attrs: Mapping[str, Any]) -> str:
    try:
        described = json.loads(str(attrs.get("model", "")))
        name = str(described["model"])
    except (ValueError, KeyError, TypeError):
        return str(attrs.get("model", ""))
    options = [f"{option} = {choice}" for option, choice in described.get("options", {}).items()]
    return f"{name} ({', '.join(options)})" if options else name


def _held(attrs: Mapping[str, Any]) -> tuple[str, ...]:
    try:
        return tuple(map(str, json.loads(str(attrs["model"]))["sources"].values()))
    except (ValueError, KeyError, TypeError, AttributeError):
        return ()


def counted(count: int) -> str:
    """A count with its thousands apart."""
    return f"{count:,}".replace(",", " ")


def parameter_rows(summary: MapSummary) -> Iterator[list[str]]:
    """Cells of a table: name, median, spread, standard error, unit, share at bounds, share undetermined."""
    for p in summary.parameters:
        if p.same:
            yield [p.label.text, with_error(p.median, p.standard_error), "the same", "", p.label.unit, "", ""]
            continue
        yield [
            p.label.text,
            brief(p.median),
            brief(p.spread, 2),
            brief(p.standard_error, 2),
            p.label.unit,
            per_cent(p.at_bounds),
            per_cent(p.undetermined),
        ]


def part_headings(summary: MapSummary) -> list[str]:
    """Columns of the table of parts: those parameters that are not the same everywhere."""
    return ["part", "pixels", *(p.label.with_unit for p in summary.parameters if not p.same)]


def part_rows(summary: MapSummary) -> Iterator[list[str]]:
    """Cells of a table of the parts below :func:`part_headings`: name, pixels with a result, medians."""
    varied = [k for k, p in enumerate(summary.parameters) if not p.same]
    for part in summary.parts[:_MOST_PARTS]:
        medians = (part.medians[k] for k in varied)
        yield [
            part.name,
            counted(part.fitted),
            *(brief(m) if math.isfinite(m) else "–" for m in medians),
        ]
    if len(summary.parts) > _MOST_PARTS:
        yield [f"{len(summary.parts) - _MOST_PARTS} more", *[""] * (1 + len(varied))]


def print_map(summary: MapSummary, console: Console) -> None:
    """Print what a map says."""
    print_parts(_parts(summary), console)


def _parts(summary: MapSummary) -> Iterator[RenderableType]:
    yield f"{summary.sentence} {' '.join(summary.reasons)}"
    table = plain_table(
        "parameters",
        "parameter",
        "median",
        "spread (68 %)",
        "standard error",
        "unit",
        "at a bound",
        "undetermined",
    )
    for row in parameter_rows(summary):
        table.add_row(*row)
    yield table
    yield from summary.held
    if summary.parts:
        parts = plain_table("medians by part of the sample", *part_headings(summary))
        for row in part_rows(summary):
            parts.add_row(*row)
        yield parts
    if summary.sampled():
        yield summary.sampled()
