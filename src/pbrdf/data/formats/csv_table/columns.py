"""Which column of a CSV file is which variable, and which are left over."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pbrdf.data.formats.csv_table.header import Header
from pbrdf.data.formats.csv_table.hints import comment_units, option_units, units_of_columns
from pbrdf.data.formats.csv_table.leftovers import (
    remark_on,
    require_no_lost_azimuth,
    require_one_illumination,
    require_one_polarization,
)
from pbrdf.data.formats.csv_table.names import (
    AZIMUTHS,
    CHANNELS,
    COLUMNS,
    COVARIANCES,
    ELEMENTS,
    GUESSED,
    MISSING,
    Name,
    parse_name,
)
from pbrdf.data.formats.csv_table.ratios import RATIO_ELEMENTS
from pbrdf.data.formats.csv_table.units import parse_unit
from pbrdf.data.schema import std_name
from pbrdf.errors import DataError
from pbrdf.files.delimited import Table

__all__ = ["ANGLE_COLUMNS", "CHANNELS", "COVARIANCES", "ELEMENTS", "Column", "Resolved", "resolve_columns"]

ANGLE_COLUMNS = ("theta_i", "theta_r", "phi", *AZIMUTHS, "aolp", "aolp_std")
#: Keys that mean the viewer beside theta_i, and the source beside theta_r: scattered, sun or sample.
_SIDE_BY_CONTEXT = {"thetas": "theta", "phis": "phi", "azimuths": "phi", "zeniths": "theta"}
#: Which of several uncertainties of one channel is taken: the least leaves least to compute.
_RANKS = {"standard": 0, "variance": 2, "expanded": 3}


@dataclass(frozen=True)
class Column:
    """A column of the data set: where it stands in the file, or the text of its constant value.

    Attributes
    ----------
    variable
        One of theta_i, theta_r, phi, phi_i, phi_r, wavelength, group, the channels, m00 … m33, a channel with _std, or
        cov_II … cov_VV.
    index
        Position in the file, from 0; None for a constant.
    constant
        Text of the constant.
    unit
        Text of its unit, where one is stated.
    name
        What its name says.
    """

    variable: str
    index: int | None
    constant: str = ""
    unit: str | None = None
    name: Name = field(default_factory=lambda: Name(""))

    @property
    def quantity(self) -> str | None:
        """Quantity that the column's name says, for I."""
        return self.name.quantity


@dataclass(frozen=True)
class Resolved:
    """What became of the columns of a file.

    Attributes
    ----------
    columns
        Those understood.
    unused
        Positions of those left over.
    remarks
        Sentences on those left over that should perhaps not be.
    assumptions
        Sentences on what a name left open.
    angles
        The text of the unit that all angles have by a comment; None if nothing says so.
    """

    columns: list[Column]
    unused: list[int]
    remarks: list[str]
    assumptions: list[str]
    angles: str | None = None


def resolve_columns(
    table: Table,
    header: Header,
    mapping: Mapping[str, str],
    units: Mapping[str, str] | None = None,
    ignore: Sequence[str] = (),
) -> Resolved:
    """Which column of the file is which variable.

    Parameters
    ----------
    table
        The file.
    header
        Its conventions.
    mapping
        What the user says: the file's name, or ``=constant``, by variable. It goes before the names.
    units
        Units that the user states, by variable or by the file's name.
    ignore
        Names of columns to leave out.

    Raises
    ------
    DataError
        If a name of the mapping is not known, two columns mean the same, an angle is missing, or names
        look as if they meant something that must not be ignored.
    """
    return _Resolution(table, header, mapping, units or {}, ignore).result()


class _Resolution:
    def __init__(
        self,
        table: Table,
        header: Header,
        mapping: Mapping[str, str],
        units: Mapping[str, str],
        ignore: Sequence[str],
    ) -> None:
        self.table, self.header, self.path = table, header, table.path
        self.names = [parse_name(name) for name in table.names]
        self.dropped = {table.column(name.strip()) for name in ignore}
        self.mapping = {("wavelength" if key == "wavelength_nm" else key): n for key, n in mapping.items()}
        comments, self.angles, _ = comment_units(table)
        stated = option_units(table, self.names, units, self.mapping)
        self.constant_units = {key: text for key, text in stated.items() if isinstance(key, str)}
        self.units = units_of_columns(table, self.names, stated, comments)
        self.columns: dict[str, Column] = {}
        self.remarks: list[str] = []
        self.assumptions: list[str] = []
        #: Positions of the columns on which all is said.
        self.said: set[int] = set()

    def result(self) -> Resolved:
        for variable, name in self.mapping.items():
            self.columns[variable] = self._mapped(variable, name)
        taken = {column.index for column in self.columns.values()} | self.dropped
        open_ = {i: n for i, n in enumerate(self.names) if i not in taken}
        open_ = self._in_context(open_)
        self._plain(open_)
        self._uncertainties({i: n for i, n in open_.items() if n.uncertainty})
        self._azimuths(open_)
        self._require_angles()
        used = {column.index for column in self.columns.values()}
        unused = [i for i in range(len(self.names)) if i not in used]
        looked_at = [i for i in unused if i not in self.dropped]
        require_no_lost_azimuth(
            self.table, self.names, looked_at, "phi" in self.columns or "phi_i" in self.columns
        )
        require_one_illumination(self.table, self.names, looked_at, self._measured())
        require_one_polarization(self.table, self.names, looked_at, self.header.illumination_stated)
        for index in looked_at:
            if index not in self.said and (
                sentence := remark_on(self.table, self.names[index], index, self._measured())
            ):
                self.remarks.append(sentence)
        return Resolved(list(self.columns.values()), unused, self.remarks, self.assumptions, self.angles)

    def _mapped(self, variable: str, name: str) -> Column:
        if variable not in COLUMNS:
            many = (*ELEMENTS, *RATIO_ELEMENTS, *COVARIANCES.values())
            plain = ", ".join(name for name in COLUMNS if name not in many and not name.endswith("_std"))
            raise DataError(
                f"{self.path}: no column is called {variable!r} here; use {plain}, m00 … m33, m01_over_m00 … "
                "m33_over_m00, a channel with _std, or cov_IQ … cov_UV"
            )
        if name.startswith("="):
            return Column(variable, None, name[1:].strip(), self.constant_units.get(variable))
        names = self.table.names
        if name not in names:
            raise DataError(
                f"{self.path}: there is no column {name!r} for {variable}; the columns are {', '.join(names)}"
            )
        index = names.index(name)
        said = self.names[index]
        if (
            variable.endswith("_std")
            and said.uncertainty is None
            and said.key == "u"
            and said.text.strip() == "U"
        ):
            said = Name(said.text, said.variable, said.unit, uncertainty="expanded")
        column = Column(variable, index, unit=self.units[index], name=said)
        if variable.endswith("_std"):
            self._require_coverage(column)
        return column

    def _in_context(self, names: dict[int, Name]) -> dict[int, Name]:
        """Names whose meaning depends on the others."""
        variables = {n.variable for n in names.values() if not n.uncertainty} | self.columns.keys()
        found = dict(names)
        for index, name in names.items():
            kind = _SIDE_BY_CONTEXT.get(name.key)
            if kind and not name.uncertainty:
                side = "r" if "theta_i" in variables else "i" if "theta_r" in variables else None
                if side:
                    found[index] = _renamed(name, f"{kind}_{side}")
            if self._is_no_stokes(name, names):
                found[index] = self._no_stokes(index, name)
        return self._elements(found)

    def _is_no_stokes(self, name: Name, names: Mapping[int, Name]) -> bool:
        """Whether u, U, v or V is not taken for a Stokes parameter: a coordinate, an uncertainty, a voltage."""
        text = _bare(name)
        if name.variable not in ("U", "V") or name.uncertainty or text not in ("u", "v", "U", "V"):
            return False
        others = {_bare(n) for n in names.values()} | self.columns.keys()
        if any(n.variable == "Q" and not n.uncertainty for n in names.values()) or "Q" in self.columns:
            return False
        return text.islower() or not others & {"I", "S0", "s0"} or "stokes" in self.header.unstated

    def _no_stokes(self, index: int, name: Name) -> Name:
        """What a column called u, U, v or V is in a file without Q; DataError where that is not clear."""
        text, unit = _bare(name), parse_unit(self.units[index] or "")
        if text == "u" and unit is not None and unit.kind in ("share", "per steradian"):
            return replace(name, variable=None, key="", uncertainty="standard")
        if text.islower():
            beside = (
                "" if text == "v" else f", or with column={{'I_std': {name.text!r}}} if it is an uncertainty"
            )
            self._say(
                index,
                f"the column {name.text!r} is not taken for the Stokes parameter {text.upper()}, as there is no Q; if "
                f"it is, say so with column={{{text.upper()!r}: {name.text!r}}}{beside}",
            )
            return _renamed(name, None)
        other = "an expanded uncertainty" if text == "U" else "a voltage"
        use = f" (then column={{'I_std': {name.text!r}}} with coverage=2 or what k is)" if text == "U" else ""
        raise DataError(
            f"{self.path}: the column {name.text!r} may be the Stokes parameter {text} or {other}{use}; say "
            f"column={{{text!r}: {name.text!r}}}, or leave it out with ignore=[{name.text!r}]"
        )

    def _elements(self, names: dict[int, Name]) -> dict[int, Name]:
        """Mueller elements counted from 0, if the file counts from 1."""
        elements = {i: n for i, n in names.items() if n.element}
        mapped = any(variable in ELEMENTS for variable in self.columns)
        beyond = [n for n in elements.values() if n.element and max(n.element) > 3]
        from_zero = mapped or any(n.element and min(n.element) == 0 for n in elements.values())
        if from_zero:
            if beyond and any(n.element and max(n.element) == 4 for n in beyond):
                raise DataError(
                    f"{self.path}: the column {beyond[0].text!r} counts Mueller elements from 1, here they count from "
                    "0, m00 … m33: rename them, or map them all with the option column"
                )
            return names
        if not elements or any(n.element and max(n.element) > 4 for n in beyond):
            return names
        if not beyond:
            first = min(elements.values(), key=lambda n: n.element or (9, 9))
            i, j = first.element or (1, 1)
            self.assumptions.append(
                f"no Mueller element has an index 0, so they were taken as counted from 1: {first.text} "
                f"as m{i - 1}{j - 1}"
            )
        moved = {}
        for index, n in elements.items():
            i, j = n.element or (1, 1)
            moved[index] = _renamed(n, f"m{i - 1}{j - 1}")
        return names | moved

    def _plain(self, names: Mapping[int, Name]) -> None:
        mapped = set(self.columns)
        for index, name in names.items():
            variable = name.variable
            if name.uncertainty or variable is None or variable in mapped:
                continue
            if variable in self.columns:
                self._both(variable, index)
            self.columns[variable] = Column(variable, index, unit=self.units[index], name=name)

    def _both(self, variable: str, index: int) -> None:
        other = self.table.names[self.columns[variable].index or 0]
        raise DataError(
            f"{self.path}: the columns {other!r} and {self.table.names[index]!r} both stand for "
            f"{variable}; choose with "
            f"column={{{variable!r}: …}}"
        )

    def _measured(self) -> list[str]:
        return [variable for variable in self.columns if variable in CHANNELS]

    def _uncertainties(self, names: Mapping[int, Name]) -> None:
        mapped = set(self.columns)
        measured = self._measured()
        ranks: dict[str, int] = {}
        for index, name in names.items():
            owner = name.variable
            if self.header.expanded and name.uncertainty == "standard" and _may_be_expanded(name):
                name = replace(name, uncertainty="expanded")
            if owner is None and not name.key and len(measured) == 1:
                owner = measured[0]
            if owner not in CHANNELS or name.uncertainty == "vague":
                continue
            variable = std_name(owner)
            if variable in mapped or (owner not in measured and not name.text.strip().endswith("_std")):
                continue
            column = Column(variable, index, unit=self.units[index], name=name)
            rank = _RANKS[name.uncertainty or "standard"] + name.relative
            if variable in self.columns:
                if rank == ranks[variable]:
                    self._both(variable, index)
                worst = self.columns[variable] if rank < ranks[variable] else column
                self.said.add(worst.index or 0)
                if rank > ranks[variable]:
                    continue
            self.columns[variable], ranks[variable] = column, rank
        for variable, column in self.columns.items():
            if variable.endswith("_std"):
                self._require_coverage(column)

    def _require_coverage(self, column: Column) -> None:
        if (
            column.name.uncertainty == "expanded"
            and column.name.coverage is None
            and self.header.coverage is None
        ):
            raise DataError(
                f"{self.path}: the column {column.name.text!r} is an expanded uncertainty: state its "
                "coverage factor k, "
                "for example coverage=2 (1 if it is a standard uncertainty), or leave the column out with "
                f"ignore=[{column.name.text!r}]"
            )

    def _azimuths(self, names: Mapping[int, Name]) -> None:
        pair = [self.columns.get(variable) for variable in AZIMUTHS]
        phi = self.columns.get("phi")
        if phi is None:
            if all(pair):
                return
            for column in (one for one in pair if one is not None):
                if column.index is None:
                    raise DataError(
                        f"{self.path}: phi_i and phi_r make phi together; name both with the option column"
                    )
                raise DataError(
                    f"{self.path}: the column {self.table.names[column.index]!r} looks like an azimuth, of one "
                    "of source and viewer alone; name the other with column={'phi_i': …} or column={'phi_r': …}, "
                    "or say that it is relative to the source with "
                    f"column={{'phi': {self.table.names[column.index]!r}}}, or "
                    "column={'phi': '=0'} if it does not matter"
                )
        if phi is None or not any(pair):
            return
        relative = "phi" in self.mapping or phi.name.key not in ("phi", "")
        for variable in AZIMUTHS:
            if variable not in self.columns:
                continue
            column = self.columns[variable]
            del self.columns[variable]
            if column.index is None:
                continue
            self.said.add(column.index)
            if variable == "phi_r" and relative:
                continue
            if relative and "phi" not in self.mapping:
                continue
            name = self.table.names[column.index]
            values = np.unique(self.table.numbers(column.index, MISSING))
            if values.size > 1:
                raise DataError(
                    f"{self.path}: the azimuth {name!r} is not constant and would not be used beside phi; give both "
                    "azimuths, of source and viewer, column={'phi_i': …, 'phi_r': …}, or say which is relative to the "
                    f"source with column={{'phi': …}} and leave out the other with ignore=[{name!r}]"
                )
            if values[0] != 0.0:
                self._say(
                    column.index,
                    f"the azimuth {name!r} is {values[0]:g} everywhere and is not used; phi was taken as "
                    "relative to the "
                    "source all the same",
                )

    def _say(self, index: int, sentence: str) -> None:
        self.said.add(index)
        self.remarks.append(sentence)

    def _require_angles(self) -> None:
        viewer = self.columns.get("theta_r")
        if "theta_i" not in self.columns and viewer is not None and viewer.index is not None:
            name = self.names[viewer.index]
            if name.variable == "theta_i" and not name.uncertainty:
                # the mirror configuration: one angle for both
                self.columns["theta_i"] = replace(viewer, variable="theta_i")
        # a remark with as many words as there are columns may pass for their names
        remark = (
            f", by the comment in line {self.table.names_line}; if that is a remark, put names above the numbers"
            if self.table.names_in_comment
            else ""
        )
        for variable in ("theta_i", "theta_r"):
            if variable not in self.columns:
                raise DataError(
                    f"{self.path}: there is no column {variable}; name it with column={{{variable!r}: …}}"
                    f"{', that of theta_i for the mirror direction' if variable == 'theta_r' else ''}. "
                    f"The columns are {', '.join(self.table.names)}{remark}"
                )
        self._small_letters()
        name = self.columns["I"].name if "I" in self.columns else Name("")
        if name.key in GUESSED and self.header.quantity is None:
            self.assumptions.append(
                f"the column {name.text!r} was taken for a reflectance factor, π times the BRDF; if it is something "
                "else, state the quantity"
            )

    def _small_letters(self) -> None:
        """Say that q and u beside I, which are often Q/I and U/I, were not taken for those."""
        intensity = self.columns.get("I")
        if intensity is None or _bare(intensity.name) in ("i", "s0") or "I" in self.mapping:
            return
        for variable in "QUV":
            column = self.columns.get(variable)
            if column is None:
                continue
            if _bare(column.name) in ("q", "u", "v", "s1", "s2", "s3") and variable not in self.mapping:
                self.remarks.append(
                    f"the column {column.name.text!r} was taken for {variable}, in the unit of I; if it is divided by "
                    f"the intensity, state column={{'{variable}_over_I': {column.name.text!r}}}"
                )


def _bare(name: Name) -> str:
    """A name without what stands in brackets or after a separator."""
    text = re.split(r"[\[({/,]", name.text)[0].strip()
    if len(name.key) == 1 and not name.uncertainty:  # "$U$", "U 1/sr"
        return next((letter for letter in text if letter.lower() == name.key), text)
    return text


def _may_be_expanded(name: Name) -> bool:
    """Whether the words for an uncertainty leave open of which kind it is."""
    text = name.text.lower()
    return name.coverage is None and "unc" in text and not re.search("std|standard|sigma", text)


def _renamed(name: Name, variable: str | None) -> Name:
    return replace(name, variable=variable)
