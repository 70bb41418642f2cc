"""Which column of a CSV file is which variable: names, synonyms, units."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from pbrdf.data.formats.csv_table.ratios import RATIO_ELEMENTS, ratio_variable
from pbrdf.data.schema import VARIABLES, std_name
from pbrdf.errors import DataError
from pbrdf.optics.stokes import STOKES

__all__ = ["ANGLE_COLUMNS", "CHANNELS", "COVARIANCES", "ELEMENTS", "Column", "resolve_columns"]

ELEMENTS = tuple(f"m{i}{j}" for i in range(4) for j in range(4))
CHANNELS = (*(name for name in VARIABLES if not name.startswith("mueller")), *ELEMENTS, *RATIO_ELEMENTS)
#: Columns of the covariance by the position of their entry, the upper triangle with the diagonal.
COVARIANCES = {(i, j): f"cov_{STOKES[i]}{STOKES[j]}" for i in range(4) for j in range(i, 4)}
_COLUMNS = (
    *("theta_i", "theta_r", "phi", "wavelength", "group"),
    *CHANNELS,
    *map(std_name, CHANNELS),
    *COVARIANCES.values(),
)
ANGLE_COLUMNS = ("theta_i", "theta_r", "phi", "aolp", "aolp_std")

# Keys are lower case without separators. A name that could mean two things is not here: DoP is not DoLP,
# and "azimuth" may be relative or absolute. Such columns are left to the option `column`.
_SYNONYMS = {
    "theta_i": "thetain thetaincident incidence incidenceangle angleofincidence aoi zenithi zenithin",
    "theta_r": "thetao thetaout thetav thetaview thetareflected zenithr zenitho zenithv viewzenith viewangle",
    "phi": "relativeazimuth relazimuth raa dphi deltaphi",
    "wavelength": "lambda wl wvl",
    "group": "position cameraposition",
    "I": "s0 intensity brdf fr reflectancefactor radiance dn",
    "Q": "s1",
    "U": "s2",
    "V": "s3",
    "dolp": "degreeoflinearpolarization degreeoflinearpolarisation",
    "aolp": "angleoflinearpolarization angleoflinearpolarisation",
}
_VARIABLE_OF = {name.lower().replace("_", ""): name for name in _COLUMNS}
_VARIABLE_OF |= {synonym: name for name, synonyms in _SYNONYMS.items() for synonym in synonyms.split()}
# A covariance may name its two components in either order.
_VARIABLE_OF |= {f"cov{STOKES[j]}{STOKES[i]}".lower(): name for (i, j), name in COVARIANCES.items()}
_VARIABLE_OF |= {f"covs{a}s{b}": name for (i, j), name in COVARIANCES.items() for a, b in ((i, j), (j, i))}
_QUANTITY_OF = {
    "brdf": "brdf",
    "fr": "brdf",
    "reflectancefactor": "reflectance_factor",
    "radiance": "radiance",
    "dn": "dn",
}

_UNITS = {"deg": "deg", "degree": "deg", "degrees": "deg", "°": "deg", "rad": "rad", "radian": "rad"}
_UNITS |= {"radians": "rad", "nm": "nm", "um": "um", "µm": "um", "μm": "um", "micron": "um", "microns": "um"}
_ELEMENT_FROM_ONE = re.compile(r"m(4[1-4]|[1-4]4)")
_AZIMUTH = re.compile(r"(?<![a-z])phi(?![a-z]{2})|azim")


@dataclass(frozen=True)
class Column:
    """A column of the data set: where it stands in the file, or the text of its constant value.

    Attributes
    ----------
    variable
        One of theta_i, theta_r, phi, wavelength, group, the channels, m00 … m33, a channel with _std, or
        cov_II … cov_VV.
    index
        Position in the file, from 0; None for a constant.
    constant
        Text of the constant.
    unit
        Unit in the column's name: deg, rad, nm or um where understood, as it stands where not.
    quantity
        Quantity that the column's name says, for I.
    """

    variable: str
    index: int | None
    constant: str = ""
    unit: str | None = None
    quantity: str | None = None


def _parse_name(name: str) -> tuple[str | None, str | None, str | None]:
    """Variable, unit and quantity that a column name says, each None if it does not."""
    text = name.strip().lower()
    if (ratio := ratio_variable(text)) is not None:
        return ratio, None, None
    unit = None
    bracketed = re.search(r"[\[(]\s*([^\])]*?)\s*[\])]", text)
    if bracketed:
        unit = _UNITS.get(bracketed[1], bracketed[1])
        text = text.replace(bracketed[0], "")
    words = [word for word in re.split(r"[\s_.\-]+", text) if word]
    deviation = False
    while len(words) > 1 and (words[-1] in _UNITS or words[-1] == "std"):
        word = words.pop()
        deviation |= word == "std"
        unit = _UNITS.get(word, unit)
    if words[-2:] == ["per", "sr"]:
        words = words[:-2]
    key = "".join(words)
    variable = _VARIABLE_OF.get(key) or ratio_variable(key)
    if variable is not None and deviation:
        variable = std_name(variable)
    return (variable if variable in _COLUMNS else None), unit, _QUANTITY_OF.get(key)


def resolve_columns(
    path: Path, names: Sequence[str], mapping: Mapping[str, str]
) -> tuple[list[Column], list[str]]:
    """Which column of the file is which variable.

    Parameters
    ----------
    path
        The file, for messages.
    names
        Its column names, in order.
    mapping
        What the user says: the file's name, or ``=constant``, by variable. It goes before the names.

    Returns
    -------
    columns
        The columns understood.
    ignored
        The names of those left over.

    Raises
    ------
    DataError
        If a name of the mapping is not known, two columns mean the same, an angle is missing, or names
        look as if they meant something that must not be ignored.
    """
    columns = {}
    for key, name in mapping.items():
        variable = "wavelength" if key == "wavelength_nm" else key
        columns[variable] = _mapped_column(path, names, variable, name)
    mapped = set(columns)
    used = {column.index for column in columns.values()}

    ignored = []
    for index, name in enumerate(names):
        if index in used:
            continue
        found, unit, quantity = _parse_name(name)
        if found is None or found in mapped:
            ignored.append(name)
        elif found in columns:
            other = names[columns[found].index or 0]
            raise DataError(
                f"{path}: the columns {other!r} and {name!r} both stand for {found}; choose with "
                f"column={{{found!r}: …}}"
            )
        else:
            columns[found] = Column(found, index, unit=unit, quantity=quantity)
    viewer = columns.get("theta_r")
    if "theta_i" not in columns and viewer is not None and viewer.index in _named(names, "theta_i"):
        columns["theta_i"] = replace(
            viewer, variable="theta_i"
        )  # the mirror configuration: one angle for both
    for variable in ("theta_i", "theta_r"):
        if variable not in columns:
            raise DataError(
                f"{path}: there is no column {variable}; name it with column={{{variable!r}: …}}"
                f"{', that of theta_i for the mirror direction' if variable == 'theta_r' else ''}. "
                f"The columns are {', '.join(names)}"
            )
    _reject_suspicious(path, ignored, "phi" in columns)
    return list(columns.values()), ignored


def _named(names: Sequence[str], variable: str) -> list[int]:
    """Positions of the columns whose name says that they are a variable."""
    return [index for index, name in enumerate(names) if _parse_name(name)[0] == variable]


def _mapped_column(path: Path, names: Sequence[str], variable: str, name: str) -> Column:
    if variable not in _COLUMNS:
        many = (*ELEMENTS, *RATIO_ELEMENTS, *COVARIANCES.values())
        plain = ", ".join(name for name in _COLUMNS if name not in many and not name.endswith("_std"))
        raise DataError(
            f"{path}: no column is called {variable!r} here; use {plain}, m00 … m33, m01_over_m00 … "
            "m33_over_m00, a channel with _std, or cov_IQ … cov_UV"
        )
    if name.startswith("="):
        return Column(variable, None, constant=name[1:].strip())
    if name not in names:
        raise DataError(
            f"{path}: there is no column {name!r} for {variable}; the columns are {', '.join(names)}"
        )
    _, unit, quantity = _parse_name(name)
    return Column(variable, names.index(name), unit=unit, quantity=quantity)


def _reject_suspicious(path: Path, ignored: Sequence[str], has_azimuth: bool) -> None:
    for name in ignored:
        if _ELEMENT_FROM_ONE.fullmatch(name.strip().lower()):
            raise DataError(
                f"{path}: the column {name!r} counts Mueller elements from 1, here they count from 0, "
                "m00 … m33: rename them, or map them all with the option column"
            )
        # Without an azimuth the file would be taken as measured in plane.
        if not has_azimuth and _AZIMUTH.search(name.lower()):
            raise DataError(
                f"{path}: the column {name!r} looks like an azimuth; say which one is relative to the source "
                f"with column={{'phi': …}}, or column={{'phi': '=0'}} if it does not matter"
            )
