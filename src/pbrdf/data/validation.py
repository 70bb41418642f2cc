"""Judging a data set against the schema.

:func:`check` returns what it finds as :class:`Issue` objects, errors and warnings; :func:`validate` raises
if there is an error. An error means that the numbers cannot be used as they stand (a viewer below the
horizon, a missing variable); a warning means that they can, but that a measurement should not look like
this (a degree of polarisation above 1, a negative intensity).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from pbrdf.data.covariance import covariance_problems
from pbrdf.data.origin import origin_of
from pbrdf.data.repeats import find_repeats, separating_column
from pbrdf.data.schema import (
    ATTRIBUTE_NAME,
    COORDINATES,
    COVARIANCE,
    DIMENSION,
    FILE_KEYS,
    FORMS,
    NORMALISED,
    QUANTITIES,
    RATIOS,
    STOKES_AXES,
    TEXT_ATTRIBUTES,
    VARIABLES,
    is_ratio,
    only_ratios,
    spells_integer,
    std_name,
    variable_dims,
    with_group,
)
from pbrdf.errors import DataError, visible
from pbrdf.optics.stokes import STOKES

__all__ = ["Issue", "check", "validate"]

#: How many standard uncertainties an unphysical value may stray before it is reported.
TOLERATED_DEVIATIONS = 5.0
#: Single precision rounds a degree of polarisation of 1 to a little more.
_ROUNDING = 1e-6
#: How far m00/m00 may be from 1: rounding.
_OWN_ELEMENT = 1e-3

_ROWS_NAMED = 5
_LOWER_CASE_ATTRIBUTES = frozenset(
    ("quantity", "stokes_convention", "illumination", "simulated", *TEXT_ATTRIBUTES, *FILE_KEYS)
)


@dataclass(frozen=True)
class Issue:
    """One thing wrong, or suspicious, in a data set.

    Attributes
    ----------
    severity
        ``"error"`` or ``"warning"``.
    variable
        The variable or attribute it concerns; empty if it concerns the whole data set.
    message
        One sentence: where, what value, and what to do.
    rows
        Indices (from 0) along ``geometry`` of all rows concerned; empty if it is not about rows.
    """

    severity: Literal["error", "warning"]
    variable: str
    message: str
    rows: tuple[int, ...] = ()

    def __str__(self) -> str:
        return visible(self.message)


@dataclass(frozen=True)
class _Labels:
    """How messages name rows and variables: as the file does, if there is one."""

    lines: Sequence[int] | None
    columns: Mapping[str, str]

    def rows(self, rows: NDArray[np.intp]) -> str:
        # One line of a file may hold several rows, for example one per wavelength.
        indices = rows.tolist()
        names = list(dict.fromkeys(indices if self.lines is None else map(self.lines.__getitem__, indices)))
        kind, several = ("index", "indices") if self.lines is None else ("line", "lines")
        more = f" and {len(names) - _ROWS_NAMED} more" if len(names) > _ROWS_NAMED else ""
        return f"{several if len(names) > 1 else kind} {', '.join(map(str, names[:_ROWS_NAMED]))}{more}"

    def variable(self, name: str) -> str:
        return f"{name} (column {self.columns[name]!r})" if name in self.columns else name


def check(
    ds: xr.Dataset, *, lines: Sequence[int] | None = None, columns: Mapping[str, str] | None = None
) -> list[Issue]:
    """Everything in `ds` that breaks the schema or that a measurement should not show.

    Parameters
    ----------
    ds
        The data set.
    lines
        Number of the file's line that each row came from, for messages; None asks the data set's origin
        (:mod:`pbrdf.data.origin`) and, where it knows none, names rows by their index along ``geometry``, from 0: as
        ``index 1``, whereas lines and rows of files are counted from 1.
    columns
        The file's column names by variable, for messages; None asks the data set's origin.

    Returns
    -------
    list of Issue
        Errors first; empty if there is nothing to say.
    """
    labels = _labels(ds, lines, columns)
    issues = _judged(ds, labels)
    origin = origin_of(ds)
    issues += [_warning("", sentence) for sentence in (origin.remarks if origin else ())]
    if not any(issue.severity == "error" for issue in issues):
        issues += _repeats(with_group(ds), labels)
    return sorted(issues, key=lambda issue: issue.severity != "error")


def _labels(ds: xr.Dataset, lines: Sequence[int] | None, columns: Mapping[str, str] | None) -> _Labels:
    origin = origin_of(ds)
    if origin is not None:
        lines = origin.lines or None if lines is None else lines
        columns = origin.columns if columns is None else columns
    return _Labels(lines, columns or {})


def _judged(ds: xr.Dataset, labels: _Labels) -> list[Issue]:
    if "group" not in ds.variables:
        ds = with_group(ds)
    issues = [*_attributes(ds), *_structure(ds)]
    # Values can only be judged where the arrays have the right shape and type.
    if not any(issue.severity == "error" for issue in issues):
        issues += [*_angles(ds, labels), *_groups(ds, labels), *_values(ds, labels), *_physics(ds, labels)]
        if COVARIANCE in ds.data_vars:
            issues += _covariance(ds, labels)
    return issues


def validate(
    ds: xr.Dataset,
    *,
    origin: str = "the data set",
    lines: Sequence[int] | None = None,
    columns: Mapping[str, str] | None = None,
) -> None:
    """Raise if `ds` breaks the schema; warnings of :func:`check` pass.

    Parameters
    ----------
    ds
        The data set.
    origin
        What the message calls it, for example a file name.
    lines, columns
        As for :func:`check`.

    Raises
    ------
    DataError
        Lists every error, one per line.
    """
    errors = [issue for issue in _judged(ds, _labels(ds, lines, columns)) if issue.severity == "error"]
    if errors:
        raise DataError(f"{origin} does not follow the schema: {'; '.join(map(str, errors))}")


def _error(variable: str, message: str, rows: NDArray[np.intp] | None = None) -> Issue:
    return Issue("error", variable, message, () if rows is None else tuple(rows.tolist()))


def _warning(variable: str, message: str, rows: NDArray[np.intp] | None = None) -> Issue:
    return Issue("warning", variable, message, () if rows is None else tuple(rows.tolist()))


def _attributes(ds: xr.Dataset) -> Iterator[Issue]:
    attrs = ds.attrs
    if attrs.get("quantity") not in QUANTITIES:
        yield _error(
            "quantity",
            f"the attribute quantity is {attrs.get('quantity')!r}; use one of {', '.join(QUANTITIES)}",
        )
    if attrs.get("stokes_convention") != "p-s":
        yield _error(
            "stokes_convention",
            f"the attribute stokes_convention is {attrs.get('stokes_convention')!r} but must be 'p-s'; "
            "convert with pbrdf.data.conventions",
        )
    if attrs.get("simulated") not in (0, 1):
        yield _error("simulated", f"the attribute simulated is {attrs.get('simulated')!r}; use 0 or 1")
    yield from _illumination(attrs.get("illumination"))
    for name in TEXT_ATTRIBUTES:
        if name in attrs and not isinstance(attrs[name], str):
            yield _error(name, f"the attribute {name} is {attrs[name]!r}, not text")
    for name, value in attrs.items():
        if re.fullmatch(ATTRIBUTE_NAME, str(name)) is None:
            yield _error(
                str(name), f"the attribute name {name!r} is not made of letters, digits, '_', '.', '-'"
            )
        elif str(name).lower() in FILE_KEYS:
            yield _error(
                str(name), f"an attribute must not be called {name!r}: files state conventions there"
            )
        elif name != str(name).lower() and str(name).lower() in _LOWER_CASE_ATTRIBUTES:
            yield _error(str(name), f"write the attribute {name!r} in lower case")
        elif not _is_storable(value):
            yield _error(
                str(name),
                f"the attribute {name} cannot be stored ({value!r}); use text, finite numbers or lists of "
                "these",
            )
    assumptions = attrs.get("assumptions", ())
    if isinstance(assumptions, list | tuple) and all(isinstance(sentence, str) for sentence in assumptions):
        for sentence in assumptions:
            yield _warning("assumptions", sentence)
    else:
        yield _error("assumptions", f"the attribute assumptions is {assumptions!r}, not a list of sentences")


def _illumination(value: Any) -> Iterator[Issue]:
    try:
        source = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        source = np.empty(0)
    if source.shape != (4,) or not np.all(np.isfinite(source)):
        yield _error("illumination", f"the attribute illumination is {value!r}; give four numbers, I Q U V")
    elif source[0] <= 0 or np.linalg.norm(source[1:]) > source[0] * (1 + 1e-9):
        yield _error(
            "illumination",
            f"the illumination {value!r} is no Stokes vector: I must be positive and √(Q²+U²+V²) at most I",
        )


def _is_storable(value: Any) -> bool:
    if isinstance(value, str):
        return True
    if isinstance(value, list | tuple):
        return all(isinstance(item, str) for item in value) or all(_is_number(item) for item in value)
    return _is_number(value)


def _is_number(value: Any) -> bool:
    if isinstance(value, int):
        return abs(value) < 2**63  # netCDF has no larger integers
    return isinstance(value, float) and math.isfinite(value)


def _structure(ds: xr.Dataset) -> Iterator[Issue]:
    if DIMENSION not in ds.sizes:
        yield _error("", f"there is no dimension {DIMENSION!r}; build data sets with pbrdf.data.make_dataset")
        return
    if ds.sizes[DIMENSION] == 0:
        yield _error("", "there are no rows")
    for name in ("theta_i", "theta_r", "phi"):
        if name not in ds.coords:
            yield _error(name, f"the coordinate {name} is missing")
    known = {*COORDINATES, *VARIABLES, *map(std_name, VARIABLES), COVARIANCE, *STOKES_AXES}
    for name in map(str, ds.variables):
        if name not in known:
            yield _error(
                name,
                f"the schema has no variable {name!r}; drop it, or use one of "
                f"{', '.join((*COORDINATES, *VARIABLES, COVARIANCE))}",
            )
        elif name in COORDINATES and name not in ds.coords:
            yield _error(name, f"{name} must be a coordinate, not a data variable")
    for name in map(str, ds.variables):
        if name in STOKES_AXES:
            if ds[name].values.tolist() != list(STOKES):
                yield _error(name, f"the coordinate {name} must be {', '.join(STOKES)} in this order")
        elif name in known:
            yield from _array(ds, name)
    yield from _forms(ds)


def _array(ds: xr.Dataset, name: str) -> Iterator[Issue]:
    array = ds[name]
    dims = variable_dims(name)
    if array.dims != dims:
        yield _error(name, f"{name} has the dimensions {array.dims}; {dims} is needed")
    elif len(dims) == 3 and array.shape[1:] != (4, 4):
        yield _error(name, f"{name} has the shape {array.shape}; (rows, 4, 4) is needed")
    kinds = "iU" if name == "group" else "f"
    if array.dtype.kind not in kinds:
        wanted = "integers or text" if name == "group" else "floating-point numbers"
        yield _error(name, f"{name} has the type {array.dtype}; {wanted} are needed")
    owner = name.removesuffix("_std")
    if owner != name and owner not in ds.data_vars:
        yield _error(name, f"{name} is there but {owner} is not")


def _forms(ds: xr.Dataset) -> Iterator[Issue]:
    present = [name for name in VARIABLES if name in ds.data_vars]
    if not any(set(cores) & set(present) and set(present) <= {*cores, *beside} for cores, beside in FORMS):
        yield _error(
            "",
            f"the variables are {', '.join(present) or 'none'}; give I with any of Q, U, V; or dolp, perhaps with "
            "aolp, V_over_I and I; or mueller alone; or any of Q_over_I, U_over_I, V_over_I, perhaps with I; or "
            "mueller_over_m00, perhaps with I",
        )
    elif COVARIANCE in ds.data_vars and not set(present) <= set(STOKES):
        other = next(name for name in present if name not in STOKES)
        yield _error(COVARIANCE, f"the covariance is that of I, Q, U, V and cannot stand beside {other}")
    if ds.attrs.get("quantity") == NORMALISED and not only_ratios(present):
        other = next(name for name in present if not is_ratio(name))
        yield _error(
            "quantity",
            f"the quantity is {NORMALISED!r}, for ratios alone, but there is {other}: state what {other} is, one of "
            f"{', '.join(name for name in QUANTITIES if name != NORMALISED)}",
        )


def _angles(ds: xr.Dataset, labels: _Labels) -> Iterator[Issue]:
    zenith = np.concatenate([ds["theta_i"].values, ds["theta_r"].values])
    with np.errstate(invalid="ignore"):
        in_degrees = np.nanmax(np.abs(zenith), initial=0.0) > np.pi
    hint = "; these look like degrees: convert with numpy.deg2rad" if in_degrees else ""
    for name in ("theta_i", "theta_r"):
        values = ds[name].values
        bad = np.flatnonzero(~((values >= 0) & (values < np.pi / 2)))
        if bad.size:
            yield _error(
                name,
                f"{labels.variable(name)}, {labels.rows(bad)}: {_angle(values[bad[0]])} is not in [0°, 90°)"
                f"{hint}",
                bad,
            )
    for name, limit in (("phi", 2 * np.pi), ("aolp", np.pi)):
        if name not in ds.variables:
            continue
        values = ds[name].values
        # A little slack: strangers' files round π.
        inside = np.abs(values) <= limit * (1 + 1e-5)
        bad = np.flatnonzero(~(inside | (np.isnan(values) if name == "aolp" else False)))
        if bad.size:
            yield _error(
                name,
                f"{labels.variable(name)}, {labels.rows(bad)}: {_angle(values[bad[0]])} is not within "
                f"±{math.degrees(limit):.0f}°; convert degrees with numpy.deg2rad",
                bad,
            )
    if 0 < np.nanmax(np.abs(zenith), initial=0.0) <= np.deg2rad(np.pi / 2):
        yield _warning(
            "theta_i",
            "all zenith angles are below 1.6°: were radians taken for degrees? Check the angle unit",
        )


def _angle(radians: float) -> str:
    return f"{radians:.6g} rad ({math.degrees(radians):.6g}°)"


def _groups(ds: xr.Dataset, labels: _Labels) -> Iterator[Issue]:
    group = ds["group"].values
    if group.dtype.kind == "i":
        return
    found = set(group.tolist())
    unusable = {label: not label or label != label.strip() or not label.isprintable() for label in found}
    if any(unusable.values()):
        bad = np.flatnonzero([unusable[label] for label in group.tolist()])
        yield _error(
            "group",
            f"{labels.variable('group')}, {labels.rows(bad)}: the label {str(group[bad[0]])!r} is empty, has "
            "white space around it or holds characters that cannot be printed",
            bad,
        )
    if all(map(spells_integer, unusable)):
        yield _error("group", "all group labels spell integers; store them as integers")


def _values(ds: xr.Dataset, labels: _Labels) -> Iterator[Issue]:
    measured = np.zeros(ds.sizes[DIMENSION], dtype=bool)
    for name in ("wavelength", *map(str, ds.data_vars)):
        if name not in ds.variables:
            continue
        values = ds[name].values.reshape(ds.sizes[DIMENSION], -1)
        infinite = np.flatnonzero(np.any(np.isinf(values), axis=1))
        if infinite.size:
            yield _error(
                name,
                f"{labels.variable(name)}, {labels.rows(infinite)}: infinite; use NaN where nothing was "
                "measured",
                infinite,
            )
        if name in VARIABLES:
            measured |= np.any(~np.isnan(values), axis=1)
        elif name != COVARIANCE:
            if name.endswith("_std") and COVARIANCE not in ds.data_vars:
                yield from _unstated(ds, name, labels)
            bad = np.flatnonzero(np.any(values <= 0, axis=1))
            if bad.size:
                what = "a wavelength" if name == "wavelength" else "a standard uncertainty"
                value = np.nanmin(values[bad[0]])
                yield _error(
                    name,
                    f"{labels.variable(name)}, {labels.rows(bad)}: {what} must be positive, not {value:.6g}; "
                    "use NaN if it is not known",
                    bad,
                )
    empty = np.flatnonzero(~measured)
    if empty.size:
        yield _warning("", f"{labels.rows(empty)}: nothing was measured there; drop the row", empty)


def _unstated(ds: xr.Dataset, name: str, labels: _Labels) -> Iterator[Issue]:
    """Values without a stated uncertainty beside others that have one."""
    rows = ds.sizes[DIMENSION]
    values = ds[name.removesuffix("_std")].values.reshape(rows, -1)
    unknown = np.isnan(ds[name].values.reshape(rows, -1))
    # an element or channel of which no uncertainty is known at all is another matter
    without = np.flatnonzero(np.any(unknown & ~np.isnan(values) & ~unknown.all(axis=0), axis=1))
    if without.size:
        yield _warning(
            name,
            f"{labels.variable(name)}, {labels.rows(without)}: no uncertainty is stated, though others "
            "are; a fit by the "
            "stated uncertainties leaves the value out",
            without,
        )


def _covariance(ds: xr.Dataset, labels: _Labels) -> Iterator[Issue]:
    for words, bad in covariance_problems(ds):
        yield _error(COVARIANCE, f"{COVARIANCE}, {labels.rows(bad)}: {words}", bad)


def _repeats(ds: xr.Dataset, labels: _Labels) -> Iterator[Issue]:
    found = find_repeats(ds)
    if found.copies.size:
        count = found.copies.size
        yield _warning(
            "",
            f"{count} row{'s are exact copies' if count > 1 else ' is an exact copy'} of others "
            f"({labels.rows(found.copies[:1])} of {labels.rows(found.originals[:1])}); each counts as one more "
            "measurement and makes the errors of a fit too small: leave them out",
            found.copies,
        )
    if found.disagreeing.size:
        origin = origin_of(ds)
        separating = separating_column(found, origin.unused) if origin and origin.unused else None
        advice = "two samples in one file are told apart by group"
        if separating is not None:
            name, values = separating
            shown = ", ".join(values[:_ROWS_NAMED]) + (" …" if len(values) > _ROWS_NAMED else "")
            advice = (
                f"the column {name!r} ({shown}) tells them apart: take one with where={{{name!r}: {values[0]!r}}}, or "
                f"keep them apart with column={{'group': {name!r}}}"
            )
        sets = len(np.unique(found.sets))
        one = found.disagreeing[found.sets == found.sets[0]]
        yield _warning(
            "",
            f"{sets} {'geometries were' if sets > 1 else 'geometry was'} measured more than once with "
            "values that disagree "
            f"({labels.rows(one)}); {advice}",
            found.disagreeing,
        )


def _physics(ds: xr.Dataset, labels: _Labels) -> Iterator[Issue]:
    mueller = "mueller" in ds
    name = "mueller" if mueller else "I"
    intensity = np.full(ds.sizes[DIMENSION], np.nan)
    if mueller or "I" in ds:
        intensity = ds["mueller"].values[:, 0, 0] if mueller else ds["I"].values
        dark = np.flatnonzero(intensity <= 0)
        if dark.size:
            yield _warning(
                name,
                f"{labels.variable(name)}, {labels.rows(dark)}: {'m00' if mueller else 'I'} = "
                f"{intensity[dark[0]]:.6g} is not positive, and a fit uses it as a measurement; leave the cell empty "
                "if nothing was measured there",
                dark,
            )
    divided = "the matrices" if mueller else ", ".join(n for n in ("Q", "U", "V") if n in ds)
    exact = std_name(name) not in ds
    if divided and exact and len(intensity) > 1 and np.all(intensity == 1.0):
        yield _warning(
            name,
            f"{labels.variable(name)}: {'m00' if mueller else 'I'} is 1 at every geometry, as if {divided} were "
            f"divided by it: then they are ratios (read the file with the quantity {NORMALISED})",
        )
    if "dolp" in ds:
        degree = ds["dolp"].values
        bad = np.flatnonzero((degree > 1) | (degree < 0))
        if bad.size:
            yield _warning(
                "dolp",
                f"{labels.variable('dolp')}, {labels.rows(bad)}: {degree[bad[0]]:.6g} is not in [0, 1]",
                bad,
            )
        return
    if "mueller_over_m00" in ds:
        yield from _own_element(ds, labels)
    # Values of any size may meet here; what overflows or divides by zero compares as not excessive.
    with np.errstate(all="ignore"):
        if "mueller_over_m00" in ds:
            name, what = "mueller_over_m00", "largest |m_ij|/m00"
            ratio, deviation = _largest_ratio(ds)
        elif mueller:
            what = "largest |m_ij|/m00"
            ratio, deviation = _largest_element(ds)
        else:
            name = next((n for n in RATIOS if n in ds), "I")
            what = "degree of polarisation"
            ratio, deviation = _degree_of_polarization(ds)
        excessive = ratio - TOLERATED_DEVIATIONS * deviation > 1 + _ROUNDING
        bad = np.flatnonzero(excessive if name in RATIOS else excessive & (intensity > 0))
    if bad.size:
        yield _warning(
            name,
            f"{labels.variable(name)}, {labels.rows(bad)}: the {what} = {ratio[bad[0]]:.6g} exceeds 1 by "
            f"more than {TOLERATED_DEVIATIONS:g} standard uncertainties",
            bad,
        )


def _own_element(ds: xr.Dataset, labels: _Labels) -> Iterator[Issue]:
    own = ds["mueller_over_m00"].values[:, 0, 0]
    bad = np.flatnonzero(np.abs(own - 1.0) > _OWN_ELEMENT)
    if bad.size:
        yield _error(
            "mueller_over_m00",
            f"{labels.variable('mueller_over_m00')}, {labels.rows(bad)}: the matrices are divided by m00, but their "
            f"own m00 is {own[bad[0]]:.6g}; put 1 or NaN there, and the intensity into I",
            bad,
        )


def _degree_of_polarization(ds: xr.Dataset) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """DoP from what was measured, a lower bound if a channel is missing, and its standard uncertainty."""
    normalised = any(name in ds for name in RATIOS)
    names = ("Q_over_I", "U_over_I", "V_over_I") if normalised else ("Q", "U", "V")
    if not any(name in ds for name in names):
        return np.zeros(ds.sizes[DIMENSION]), np.zeros(ds.sizes[DIMENSION])
    polarized = np.stack([_or_zero(ds, name) for name in names])
    deviations = np.stack([_or_zero(ds, std_name(name)) for name in names])
    length = np.linalg.norm(polarized, axis=0)
    along = np.linalg.norm(polarized * deviations, axis=0) / length
    if normalised:
        return length, np.nan_to_num(along)
    return _ratio(length, along, ds["I"].values, _or_zero(ds, "I_std"))


def _largest_ratio(ds: xr.Dataset) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Largest |m_ij|/m00 of matrices that are divided by m00, without m00 itself, and its standard uncertainty."""
    elements = np.abs(_or_zero(ds, "mueller_over_m00")).reshape(-1, 16)
    deviations = _or_zero(ds, "mueller_over_m00_std").reshape(-1, 16)
    rows = np.arange(len(elements))
    largest = 1 + np.argmax(elements[:, 1:], axis=1)
    return elements[rows, largest], deviations[rows, largest]


def _largest_element(ds: xr.Dataset) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Largest |m_ij|/m00 of each row and its standard uncertainty."""
    elements = np.abs(_or_zero(ds, "mueller")).reshape(-1, 16)
    deviations = _or_zero(ds, "mueller_std").reshape(-1, 16)
    rows = np.arange(len(elements))
    largest = 1 + np.argmax(elements[:, 1:], axis=1)
    return _ratio(elements[rows, largest], deviations[rows, largest], elements[:, 0], deviations[:, 0])


def _ratio(
    part: NDArray[np.float64],
    part_std: NDArray[np.float64],
    whole: NDArray[np.float64],
    whole_std: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A ratio and its standard uncertainty, to first order."""
    ratio = part / whole
    return ratio, np.hypot(part_std, ratio * whole_std) / np.abs(whole)


def _or_zero(ds: xr.Dataset, name: str) -> NDArray[np.float64]:
    """Values of a variable, 0 where it is missing or NaN."""
    if name in ds.data_vars:
        values: NDArray[np.float64] = np.nan_to_num(ds[name].values, nan=0.0)
        return values
    return np.zeros((ds.sizes[DIMENSION], *(4 for _ in variable_dims(name)[1:])))
