"""Columns of a CSV file as the variables of a data set, in the project's units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrdf.data import conventions
from pbrdf.data.build import group_labels
from pbrdf.data.formats.csv_table.columns import ANGLE_COLUMNS, CHANNELS, COVARIANCES, ELEMENTS, Column
from pbrdf.data.formats.csv_table.header import Header
from pbrdf.data.formats.csv_table.names import AZIMUTHS, GUESSED, MISSING
from pbrdf.data.formats.csv_table.ratios import signed_ratio
from pbrdf.data.formats.csv_table.units import SIGNALS, Unit, parse_unit
from pbrdf.data.schema import NORMALISED, QUANTITIES, is_ratio
from pbrdf.errors import DataError
from pbrdf.files.delimited import Table
from pbrdf.optics.stokes import STOKES

__all__ = ["Values", "values_of"]

#: A median of DoLP above this, of so many values, is no fraction; single values may be, of a noisy measurement.
_NO_FRACTION, _MANY = 1.5, 5
#: Degrees below which all angles of polarisation are rather radians, which end at π/2 or, counted from 0, at π.
_RADIANS = 3.2
#: A median reflectance factor above this is rather per cent.
_PER_CENT = 5.0
#: Wavelengths of light, nm.
_SHORTEST, _LONGEST = 10.0, 1e6


@dataclass(frozen=True)
class Values:
    """What the columns of a file hold.

    Attributes
    ----------
    arrays
        By variable, a value for each row: angles in radians, φ = 0 forward, wavelengths in nm, values in the unit of
        the quantity, uncertainties as standard ones.
    quantity
        What was measured.
    meanings
        What each variable was read as, in words: its name with the unit.
    remarks
        Sentences on values that look wrong.
    assumptions
        Sentences on what was assumed of the values.
    scale
        ``"arbitrary"`` where the values have arbitrary units; None where they say nothing.
    """

    arrays: dict[str, NDArray[Any]]
    quantity: str
    meanings: dict[str, str]
    remarks: list[str]
    assumptions: list[str]
    scale: str | None = None


def values_of(table: Table, columns: Sequence[Column], header: Header, angles: str | None = None) -> Values:
    """All columns as labels or numbers.

    Parameters
    ----------
    table
        The file's text.
    columns
        Which columns, or which constants.
    header
        The file's conventions.
    angles
        The text of a unit that all angles have, where their names do not say another; None if nothing says so.

    Raises
    ------
    DataError
        If a cell is not a number, a label is missing, a unit is not understood or cannot be that of its column, or the
        quantity is not stated.
    """
    return _Conversion(table, columns, header, angles).values()


class _Conversion:
    def __init__(self, table: Table, columns: Sequence[Column], header: Header, angles: str | None) -> None:
        self.table, self.header, self.angles = table, header, angles
        self.columns = {column.variable: column for column in columns}
        self.meanings: dict[str, str] = {}
        self.remarks: list[str] = []
        self.assumptions: list[str] = []
        #: Factor from the file's unit of each channel to the data set's.
        self.factors: dict[str, float] = {}
        self.arrays: dict[str, NDArray[Any]] = {}
        self.scale: str | None = None

    def values(self) -> Values:
        self.quantity = self._quantity()
        azimuths = {variable: self.columns[variable] for variable in AZIMUTHS if variable in self.columns}
        for variable, column in self.columns.items():
            if variable == "group":
                self.arrays[variable] = _labels(self.table, column)
                self.meanings[variable] = variable
            elif variable in azimuths:
                continue
            elif variable in ANGLE_COLUMNS and not variable.endswith("_std"):
                self.arrays[variable] = self._angle(column)
            elif variable == "wavelength":
                self.arrays[variable] = self._wavelength(column)
            elif variable in CHANNELS:
                self.arrays[variable] = self._channel(column)
        if azimuths:
            self.arrays["phi"] = self._relative(azimuths)
        # channels first: what is relative, or has no unit of its own, takes theirs
        for variable, column in self.columns.items():
            if variable in COVARIANCES.values():
                self.arrays[variable] = self._covariance(column)
            elif variable.endswith("_std") and variable not in self.arrays:
                self.arrays[variable] = self._uncertainty(column)
        arrays = {v: self.arrays[v] for v in [*self.columns, "phi"] if v in self.arrays}
        return Values(arrays, self.quantity, self.meanings, self.remarks, self.assumptions, self.scale)

    def _numbers(self, column: Column) -> NDArray[np.float64]:
        if column.index is not None:
            return self.table.numbers(column.index, MISSING)
        try:
            return np.full(len(self.table), float(column.constant))
        except ValueError:
            raise DataError(
                f"{self.table.path}: the constant {'=' + column.constant!r} for {column.variable} is not a number"
            ) from None

    def _unit(self, column: Column, kinds: Sequence[str], advice: str) -> Unit | None:
        """The unit of a column, which must be of one of these kinds; None where it has none."""
        if column.unit is None:
            return None
        unit = parse_unit(column.unit)
        if unit is None or unit.kind not in kinds:
            raise self._refusal(column, unit, advice)
        return unit

    def _refusal(self, column: Column, unit: Unit | None, advice: str) -> DataError:
        name = self._name(column)
        why = "is not understood" if unit is None else f"({column.unit}) cannot be that of {column.variable}"
        leave = "" if column.index is None else f", or leave the column out with ignore=[{name!r}]"
        return DataError(
            f"{self.table.path}: the unit of the column {name!r} {why}; use {advice}, or state it with "
            f"unit={{{column.variable!r}: …}}{leave}"
        )

    def _name(self, column: Column) -> str:
        return f"={column.constant}" if column.index is None else self.table.names[column.index]

    def _angle(self, column: Column) -> NDArray[np.float64]:
        values, degrees = self._raw_angle(column)
        if column.variable == "phi" and not self.header.forward_at_zero:
            # In the file's own unit, so that 180° becomes exactly 0.
            values = conventions.azimuth_forward_pi_to_zero(values, 180.0 if degrees else np.pi)
        return np.deg2rad(values) if degrees else values

    def _raw_angle(self, column: Column) -> tuple[NDArray[np.float64], bool]:
        """Degrees or radians, and whether degrees."""
        values = self._numbers(column)
        given = column.unit or self.angles
        unit = None
        if given is not None:
            unit = parse_unit(given)
            if unit is None or unit.kind not in ("degrees", "radians"):
                if column.unit is None:
                    raise DataError(
                        f"{self.table.path}: angles in {given!r} are not understood; use degrees or radians"
                    )
                raise self._refusal(column, unit, "deg or rad")
        degrees = self.header.degrees if unit is None else unit.kind == "degrees"
        if column.variable == "aolp" and unit is None and degrees:
            largest = float(np.nanmax(np.abs(values), initial=0.0))
            if 0.45 * np.pi < largest < _RADIANS and values.size >= _MANY:
                self.remarks.append(
                    f"all angles of polarisation are below {largest:.3g}°: were radians taken for degrees? "
                    "state unit={'aolp': 'rad'}, or unit={'aolp': 'deg'} if it is right"
                )
        text = "deg" if degrees else "rad"
        if unit is not None:
            text = unit.text
            if unit.factor != 1.0:
                values = values * unit.factor
        if column.name.elevation:
            values = (90.0 if degrees else np.pi / 2) - values
            text += " from the horizon"
        self.meanings[column.variable] = f"{column.variable} ({text})"
        return values, degrees

    def _relative(self, azimuths: dict[str, Column]) -> NDArray[np.float64]:
        """φ from the azimuths of source and viewer."""
        (source, a), (viewer, b) = (self._raw_angle(azimuths[variable]) for variable in AZIMUTHS)
        degrees = a and b
        if a != b:
            source, viewer = (np.deg2rad(x) if d else x for x, d in ((source, a), (viewer, b)))
        half = 180.0 if degrees else np.pi
        if "azimuth" in self.header.unstated or not self.header.forward_at_zero:
            phi = conventions.azimuth_forward_pi_to_zero(viewer - source, half)
        else:
            phi = conventions.azimuth_forward_pi_to_zero(viewer - source + half, half)
        return np.deg2rad(phi) if degrees else phi

    def _wavelength(self, column: Column) -> NDArray[np.float64]:
        values = self._numbers(column)
        unit = self._unit(column, ("length", "wavenumber"), "nm, um or cm^-1")
        if unit is None:
            text = "nm"
        elif unit.kind == "wavenumber":
            with np.errstate(divide="ignore"):
                values = np.where(values > 0.0, 1e7 / values, np.nan)
            text = unit.text
        else:
            text = unit.text
            # rounded as a product in decimals would be: 0.351 µm is 351 nm
            values = values if unit.factor == 1.0 else _times(values, unit.factor)
        self.meanings[column.variable] = f"wavelength ({text})"
        finite = values[np.isfinite(values)]
        if finite.size and (finite.min() < _SHORTEST or finite.max() > _LONGEST):
            odd = finite.min() if finite.min() < _SHORTEST else finite.max()
            why = ""
            if unit is None and 0.1 <= odd < _SHORTEST:
                why = " If the file has µm, state unit={'wavelength': 'um'}"
            elif unit is None and odd < 1e-4:
                why = " If the file has m, state unit={'wavelength': 'm'}"
            self.remarks.append(
                f"{odd:g} nm is no wavelength of light: was another unit taken for nm?{why or ' '}".strip()
            )
        return values

    def _quantity(self) -> str:
        column = next((c for c in self.columns.values() if c.quantity and c.variable == "I"), None)
        implied = column.quantity if column else None
        values = self.columns.get("I") or next((c for v, c in self.columns.items() if v in ELEMENTS), None)
        unit = parse_unit(values.unit) if values is not None and values.unit else None
        if (
            values is not None
            and unit is not None
            and unit.kind in ("degrees", "radians", "length", "wavenumber")
        ):
            raise self._refusal(values, unit, "1/sr, 1/msr, % or that of a signal")
        if implied is None and unit is not None:
            if unit.kind == "per steradian":
                implied = "brdf"
            elif (
                unit.kind == "share" and values is not None and values.variable == "I" and unit.factor != 1.0
            ):
                implied = "reflectance_factor"
                if self.header.quantity is None and values.name.key not in GUESSED:
                    self.assumptions.append(
                        f"the column {self._name(values)!r} is in {unit.text} and was taken for a "
                        "reflectance factor, π times "
                        "the BRDF; if it is something else, state the quantity"
                    )
        if implied is None and values is not None:
            implied = GUESSED.get(values.name.key)
        measured = [variable for variable in self.columns if variable in CHANNELS]
        if self.header.quantity is None and measured and all(map(is_ratio, measured)):
            return NORMALISED
        if self.header.quantity is None and implied is None:
            divided = "" if "I" in measured or "m00" in measured else " (divided by an intensity)"
            raise DataError(
                f"{self.table.path}: it does not say what was measured; add a line '# quantity: …' or the option "
                f"quantity, one of {', '.join(QUANTITIES)}{divided}"
            )
        return self.header.quantity or str(implied)

    def _channel(self, column: Column) -> NDArray[np.float64]:
        values = self._numbers(column)
        variable = column.variable
        if is_ratio(variable) and variable != "dolp":
            factor, text = self._share(column)
            values = signed_ratio(values, "" if column.index is None else self._name(column))
        elif variable == "dolp":
            factor, text = self._share(column)
            finite = np.abs(values[np.isfinite(values)])
            if column.unit is None and finite.size and finite.max() > _NO_FRACTION:
                sentence = (
                    f"the column {self._name(column)!r} was taken for a degree of polarisation from 0 to 1 and holds "
                    f"{finite.max():g}: if it is in per cent, state unit={{'dolp': '%'}}"
                )
                if finite.size >= _MANY and _median(finite) > _NO_FRACTION:
                    raise DataError(f"{self.table.path}: {sentence}, else unit={{'dolp': '1'}}")
                self.remarks.append(sentence)
        else:
            factor, text = self._radiometric(column)
            finite = values[np.isfinite(values)]
            suspicious = column.unit is None and variable == "I" and self.quantity == "reflectance_factor"
            if suspicious and finite.size and _median(finite) > _PER_CENT:
                self.remarks.append(
                    f"a reflectance factor of {_median(finite):g} is rather per cent: state unit={{'I': '%'}}, or "
                    "unit={'I': '1'} if it is right"
                )
        self.factors[variable] = factor
        self.meanings[variable] = f"{variable}{text}"
        return values if factor == 1.0 else _times(values, factor)

    def _share(self, column: Column) -> tuple[float, str]:
        unit = self._unit(column, ("share",), "1 or %")
        return (1.0, "") if unit is None else (unit.factor, f" ({unit.text})")

    def _radiometric(self, column: Column) -> tuple[float, str]:
        """Factor to the unit of the quantity, and the unit in words."""
        if self.quantity in ("brdf", "reflectance_factor") and parse_unit(column.unit or "") == parse_unit(
            "a.u."
        ):
            self.scale = "arbitrary"
            return 1.0, " (a.u.)"
        if self.quantity == NORMALISED:
            return self._share(column)
        if self.quantity == "brdf":
            unit = self._unit(
                column, ("per steradian",), "1/sr or 1/msr for a BRDF (% is that of a reflectance factor)"
            )
            shown = "1/sr" if unit is None else unit.text
            return (1.0 if unit is None else unit.factor), f" ({shown})"
        if self.quantity == "reflectance_factor":
            unit = self._unit(column, ("share",), "1 or % for a reflectance factor")
            return (1.0 if unit is None else unit.factor), f" ({'1' if unit is None else unit.text})"
        own = self._unit(column, (*SIGNALS, "share", "per steradian"), "that of a signal, the same for all")
        first = self.columns.get("I") or self.columns.get("m00") or column
        of_first = parse_unit(first.unit) if first.unit else None
        if (own.kind if own else None) != (of_first.kind if of_first else None) and column is not first:
            raise DataError(
                f"{self.table.path}: the column {self._name(column)!r} is in {column.unit or 'no unit'}, "
                f"{self._name(first)!r} in {first.unit or 'no unit'}: state the same with "
                f"unit={{{column.variable!r}: …}}, or "
                f"leave the column out with ignore=[{self._name(column)!r}]"
            )
        factor = 1.0 if own is None or of_first is None else own.factor / of_first.factor
        return factor, f" ({own.text})" if own else ""

    def _covariance(self, column: Column) -> NDArray[np.float64]:
        values = self._numbers(column)
        if column.unit is not None:
            raise self._refusal(
                column, parse_unit(column.unit), "no unit: covariances have the square of the values'"
            )
        i, j = next(at for at, name in COVARIANCES.items() if name == column.variable)
        default = self.factors.get("I", 1.0)
        factor = self.factors.get(STOKES[i], default) * self.factors.get(STOKES[j], default)
        self.meanings[column.variable] = column.variable
        return values if factor == 1.0 else _times(values, factor)

    def _uncertainty(self, column: Column) -> NDArray[np.float64]:
        owner = column.variable.removesuffix("_std")
        name = column.name
        if owner == "aolp":
            values, degrees = self._raw_angle(column)
            return self._divided(column, np.deg2rad(values) if degrees else values, [])
        values = self._numbers(column)
        own = parse_unit(column.unit) if column.unit else None
        base = self.columns.get(owner)
        of_base = parse_unit(base.unit) if base is not None and base.unit else None
        relative = name.relative
        if (
            own is not None
            and own.kind == "share"
            and own.factor != 1.0
            and not relative
            and not is_ratio(owner)
        ):
            # per cent of the value, unless the values themselves are in per cent
            relative = of_base is None or of_base.kind != "share" or of_base.factor == 1.0
        words = []
        if relative:
            if owner not in self.arrays:
                raise DataError(
                    f"{self.table.path}: the column {self._name(column)!r} is relative to {owner}, which is not there"
                )
            unit = self._unit(column, ("share",), "1 or % for a relative uncertainty")
            if name.uncertainty == "variance":
                raise self._refusal(column, own, "the square of the values' unit")
            factor = 1.0 if unit is None else unit.factor
            values = _times(values, factor) * np.abs(self.arrays[owner])
            words.append(f"relative, {'1' if unit is None else unit.text}")
        else:
            factor = self.factors.get(owner, 1.0)
            if name.uncertainty == "variance":
                if column.unit is not None:
                    raise self._refusal(column, own, "no unit: variances have the square of the values'")
                if np.any(values < 0.0):
                    row = int(np.flatnonzero(values < 0.0)[0])
                    raise DataError(
                        f"{self.table.place(row, column.index or 0)}: a variance must not be negative"
                    )
                values = np.sqrt(values)
                words.append("root of a variance")
            elif column.unit is not None:
                if is_ratio(owner):
                    factor, _ = self._share(column)
                elif base is not None:
                    factor, _ = self._radiometric(column)
            if factor != 1.0:
                values = _times(values, factor)
            self._doubt(column, values, name.uncertainty)
        return self._divided(column, values, words)

    def _doubt(self, column: Column, values: NDArray[np.float64], kind: str | None) -> None:
        """Say that an uncertainty of I without a unit, larger than I itself, is rather per cent."""
        intensity = self.arrays.get("I")
        if column.variable != "I_std" or column.unit is not None or kind == "variance" or intensity is None:
            return
        both = np.isfinite(values) & np.isfinite(intensity)
        if both.any() and _median(values[both]) > _median(np.abs(intensity[both])):
            name = self._name(column)
            self.remarks.append(
                f"the uncertainties of the column {name!r} are larger than the values: if they are relative, in per "
                f"cent, state unit={{{name!r}: '%'}}"
            )

    def _divided(self, column: Column, values: NDArray[np.float64], words: list[str]) -> NDArray[np.float64]:
        """The standard uncertainty, of an expanded one."""
        name = column.name
        if name.uncertainty == "expanded":
            coverage = name.coverage or self.header.coverage or 1.0
            values = values / coverage
            words.append(f"expanded, divided by k = {coverage:g}")
        self.meanings[column.variable] = column.variable + (f" ({'; '.join(words)})" if words else "")
        return values


def _median(values: NDArray[np.float64]) -> float:
    """The middle one, of two the larger: the mean of both may be too large a number."""
    return float(np.partition(values, values.size // 2)[values.size // 2])


def _times(values: NDArray[np.float64], factor: float) -> NDArray[np.float64]:
    """Values in another unit; a factor below 1 divides, so that 96 % is 0.96."""
    return values / round(1.0 / factor) if factor < 1.0 and (1.0 / factor) % 1 < 1e-9 else values * factor


def _labels(table: Table, column: Column) -> NDArray[Any]:
    if column.index is None:
        return np.full(len(table), group_labels(column.constant))
    cells = table.cells(column.index)
    if "" in cells:
        raise DataError(f"{table.place(cells.index(''), column.index)}: there is no group label")
    return group_labels(cells)
