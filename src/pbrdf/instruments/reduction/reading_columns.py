"""Which columns of a table hold readings behind an analyser, and what its state was.

*Wide*: a column for each state, ``I0, I45, I90, I135``, a row for each geometry. *Long*: one column of readings, a row
for each of them, and columns for the angle of the polariser (``analyzer``, ``polarizer_angle``), of a retarder before
it (``retarder``, ``qwp``), its ``retardance``, or the name of the ``state``. Where there is an ``analyzer`` and a
``polarizer``, the latter belongs to the source.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from pbrdf.errors import DataError
from pbrdf.instruments.reduction.reading_settings import Settings
from pbrdf.instruments.reduction.reading_states import (
    DARK,
    LONGEST,
    OPEN,
    ReadingName,
    State,
    parse_name,
    settle,
    split_uncertainty,
    words_of,
)

__all__ = [
    "LongColumns",
    "ReadingColumn",
    "WideColumns",
    "exposure_column",
    "holds_readings",
    "long_columns",
    "source_columns",
    "unused_factors",
    "wide_columns",
]

_WORD = re.compile(r"[^\W\d_]+|\d+(?:\.\d+)?", re.UNICODE)
_UNIT_WORDS = words_of("deg degree degrees rad radian radians angle")

_ANALYZERS = words_of("analyzer analyser psa")
_POLARIZERS = words_of("polarizer polariser pol lp linearpolarizer linearpolariser")
_RETARDERS = {
    **dict.fromkeys(("qwp", "quarterwaveplate"), 90.0),
    **dict.fromkeys(("hwp", "halfwaveplate"), 180.0),
    **dict.fromkeys(("retarder", "waveplate", "compensator")),
}
_STATES = words_of(
    "state analyzerstate analyserstate polarizerstate polariserstate psastate polstate polarizationstate "
    "polarisationstate detectorpolarization detectorpolarisation detectionpolarization detectionpolarisation "
    "receiverpolarization receiverpolarisation outputpolarization outputpolarisation"
)
_READINGS = {
    **dict.fromkeys(
        words_of(
            "i intensity reading readings signal voltage current photocurrent counts count power "
            "photodiode pd detector value adu measurement"
        )
    ),
    **dict.fromkeys(("brdf", "fr"), "brdf"),
    "reflectancefactor": "reflectance_factor",
    "radiance": "radiance",
    "dn": "dn",
}
#: Polarisation that somebody has computed already.
_STOKES = words_of("q u v s1 s2 s3 qi ui vi qoveri uoveri voveri s1s0 s2s0 s3s0")
_COMPUTED = _STOKES | words_of("dolp aolp dop aop docp dolppercent")
_SOURCE = words_of(
    "psg psgangle generator sourcepolarizer sourcepolariser sourcepolarization "
    "incidentpolarization illuminationpolarization illumination inputpolarization"
)


@dataclass(frozen=True)
class ReadingColumn:
    """A column of readings in one state.

    Attributes
    ----------
    index
        Position in the file.
    state
        The state.
    deviation
        Position of the column of its standard uncertainties, None without one.
    divisor
        What these are divided by: their coverage factor.
    relative
        Whether they are in percent of the reading.
    """

    index: int
    state: State
    deviation: int | None = None
    divisor: float = 1.0
    relative: bool = False


@dataclass(frozen=True)
class WideColumns:
    """A table with a column for each state.

    Attributes
    ----------
    readings
        Those columns.
    dark
        The column of readings without light, None without one.
    unit, quantity
        What the names say, "" and None where they do not.
    unused
        Columns of polarisation that has been computed from the readings.
    assumptions
        Sentences.
    """

    readings: tuple[ReadingColumn, ...]
    dark: int | None = None
    unit: str = ""
    quantity: str | None = None
    unused: tuple[int, ...] = ()
    assumptions: tuple[str, ...] = ()

    @property
    def used(self) -> frozenset[int]:
        """Positions of all columns that belong to the readings."""
        own = {column.index for column in self.readings}
        own |= {column.deviation for column in self.readings if column.deviation is not None}
        return frozenset(own | set(self.unused) | ({self.dark} if self.dark is not None else set()))


@dataclass(frozen=True)
class LongColumns:
    """A table with a row for each reading; positions of its columns, None for those that it does not have.

    Attributes
    ----------
    reading, deviation
        The readings and their standard uncertainties, to be divided by `divisor`, in percent where `relative`.
    analyzer, retarder, retardance, state
        Angle of the polariser, of the retarder before it, its retardance, the name of the state.
    plate
        Retardance that the name of the retarder's column says, degrees.
    unit, quantity, unused, assumptions
        As of :class:`WideColumns`.
    """

    reading: int
    deviation: int | None = None
    divisor: float = 1.0
    relative: bool = False
    analyzer: int | None = None
    retarder: int | None = None
    retardance: int | None = None
    state: int | None = None
    plate: float | None = None
    unit: str = ""
    quantity: str | None = None
    unused: tuple[int, ...] = ()
    assumptions: tuple[str, ...] = field(default=())

    @property
    def used(self) -> frozenset[int]:
        """Positions of all columns that belong to the readings."""
        own = (self.reading, self.deviation, self.analyzer, self.retarder, self.retardance, self.state)
        return frozenset({index for index in own if index is not None} | set(self.unused))


def holds_readings(names: Sequence[str], *, stated: bool = False) -> bool:
    """Whether these column names are surely those of readings behind an analyser, and not of Stokes parameters.

    Where the header states how readings were taken, any names are but those of Stokes parameters.
    """
    if any(len(name) > LONGEST for name in names):
        return False
    keys = {_key(name) for name in names if not split_uncertainty(name)[1]}
    if _STOKES & keys and not _horizontal_and_vertical(names):
        return False
    if stated:
        return True
    try:
        wide = wide_columns(names, Settings(), "", sure=True)
        return wide is not None or long_columns(names, {}, "") is not None
    except DataError:
        return True  # what is wrong is said where the file is read


def wide_columns(
    names: Sequence[str], settings: Settings, where: str, *, sure: bool = False
) -> WideColumns | None:
    """The columns of a table with one for each state; None if it is not such a table.

    Parameters
    ----------
    names
        Of all columns.
    settings
        Where names of states are stated, those count.
    where
        How a message begins.
    sure
        Take only what can hardly mean anything else: not a column for each viewing angle, azimuth or wavelength.

    Raises
    ------
    DataError
        If two columns hold the same state, units differ, or a name can mean two states.
    """
    found: dict[int, ReadingName] = {}
    if settings.states:
        found = _stated(names, settings, where)
    else:
        parsed = {index: parse_name(name) for index, name in enumerate(names)}
        found = {index: name for index, name in parsed.items() if name is not None}
        found = _without_lone_letters(found, names)
        found = _with_hyphens(_without_odd_pairs(found))
    values = {
        index: name
        for index, name in found.items()
        if not name.deviation and (name.state.named != DARK or settings.states)
    }
    distinct = {name.state for name in values.values() if name.state.named not in (OPEN, DARK)}
    if len(distinct) < 2 and not settings.states:
        return None
    if not settings.states and (_counts(distinct) or _are_elements(names[index] for index in values)):
        return None
    if sure and _may_be_views(values, names):
        return None
    if not sure and not settings.stated and _may_be_azimuths(values, names):
        raise DataError(
            f"{where}: the columns {names[min(values)]!r} … {names[max(values)]!r} may stand for angles of an analyser "
            "or for azimuths; for an analyser state where its angle 0 lies, '# analyzer_zero: p' (--analyzer zero=p), "
            "for azimuths give a row for each, with a column phi"
        )
    indices = [index for index in values if values[index].state.named != DARK]
    if not indices:
        return None
    states, assumptions = settle([values[index].state for index in indices], where)
    for position, state in enumerate(states):
        if state in states[:position]:
            other = names[indices[states.index(state)]]
            raise DataError(
                f"{where}: the columns {other!r} and {names[indices[position]]!r} both hold the same state; rename one "
                "so that it is not taken for a reading, or state them in '# analyzer_states: NAME = STATE; …'"
            )
    units = {values[index].unit for index in indices}
    if len(units) > 1:
        raise DataError(
            f"{where}: the readings have different units ({', '.join(sorted(map(repr, units)))}); bring them to one"
        )
    unit = units.pop()
    quantities = {values[index].quantity for index in indices} - {None}
    dark = [i for i, name in found.items() if name.state.named == DARK and not name.deviation]
    columns, expanded = [], False
    for index, state in zip(indices, states, strict=True):
        own = values[index].state
        beside = [i for i, name in found.items() if name.deviation and name.state == own]
        if len(beside) > 1:
            raise DataError(
                f"{where}: the columns {names[beside[0]]!r} and {names[beside[1]]!r} both are the "
                f"uncertainty of {names[index]!r}; rename one"
            )
        deviation = found[beside[0]] if beside else None
        divisor = 1.0 if deviation is None or deviation.coverage is None else deviation.coverage
        expanded |= divisor != 1.0
        relative = deviation is not None and deviation.unit == "%" and unit != "%"
        columns.append(ReadingColumn(index, state, beside[0] if beside else None, divisor, relative))
    if expanded:
        assumptions.append(_EXPANDED)
    return WideColumns(
        tuple(columns),
        dark[0] if dark else None,
        unit,
        quantities.pop() if len(quantities) == 1 else None,
        _computed(names, {*found}),
        tuple(assumptions),
    )


_EXPANDED = "expanded uncertainties of the readings were divided by their coverage factor (k = 2 where only U says so)"


def long_columns(names: Sequence[str], mapping: Mapping[str, str], where: str) -> LongColumns | None:
    """The columns of a table with a row for each reading; None if it is not such a table.

    Parameters
    ----------
    names
        Of all columns.
    mapping
        The file's names by ``reading``, ``reading_std``, ``analyzer``, ``retarder``, ``retardance``, ``state``.
    where
        How a message begins.

    Raises
    ------
    DataError
        If two columns may hold the readings.
    """
    keys = [_key(name) for name in names]

    def position(name: str, known: frozenset[str] | Mapping[str, object]) -> int | None:
        if name in mapping:
            return list(names).index(mapping[name])
        return next((index for index, key in enumerate(keys) if key in known), None)

    assumptions = []
    analyzer, polarizer = position("analyzer", _ANALYZERS), position("", _POLARIZERS)
    retarder, state = position("retarder", _RETARDERS), position("state", _STATES)
    retardance = position("retardance", words_of("retardance"))
    source = [index for index, key in enumerate(keys) if key in _SOURCE]
    if analyzer is None and polarizer is not None:
        analyzer = polarizer
        assumptions.append(
            f"the polariser of the column {names[polarizer]!r} was taken to stand before the detector"
        )
    elif polarizer is not None:
        source.append(polarizer)
    if analyzer is None and retarder is None and state is None:
        return None
    used = {analyzer, retarder, retardance, state, *source}
    candidates = [i for i, key in enumerate(keys) if key in _READINGS and i not in used]
    reading = position("reading", frozenset())
    if reading is None and len(candidates) > 1:
        raise DataError(
            f"{where}: the columns {names[candidates[0]]!r} and {names[candidates[1]]!r} may both hold the readings; "
            f"choose with column={{'reading': {names[candidates[0]]!r}}}"
        )
    if reading is None:
        if not candidates:
            return None
        reading = candidates[0]
    deviation, divisor, percent = position("reading_std", frozenset()), 1.0, False
    for index, name in enumerate(names):
        rest, is_deviation, coverage = split_uncertainty(name)
        own = _key(rest).replace("voltage", "v")
        if index == deviation or (
            deviation is None
            and is_deviation
            and index not in used
            and own in ("", "v", keys[reading], *_READINGS)
        ):
            deviation, divisor, percent = index, coverage or 1.0, "%" in name
        elif deviation is None and own in _LONE_DEVIATIONS:
            deviation, percent = index, "%" in name
    if divisor != 1.0:
        assumptions.append(_EXPANDED)
    unit = _unit(names[reading])
    return LongColumns(
        reading=reading,
        deviation=deviation,
        divisor=divisor,
        relative=percent and unit != "%",
        analyzer=analyzer,
        retarder=retarder,
        retardance=retardance,
        state=state,
        plate=None if retarder is None else _RETARDERS.get(keys[retarder]),
        unit=unit,
        quantity=_READINGS.get(keys[reading]),
        unused=_computed(names, used | {reading, deviation}),
        assumptions=tuple(assumptions),
    )


_LONE_DEVIATIONS = words_of("std sd stdev sigma uncertainty unc standarduncertainty error err")


def source_columns(names: Sequence[str]) -> list[int]:
    """Positions of the columns that say how the source is polarised."""
    keys = [_key(name) for name in names]
    beside = bool(_ANALYZERS & set(keys))
    return [i for i, key in enumerate(keys) if key in _SOURCE or (beside and key in _POLARIZERS)]


def exposure_column(names: Sequence[str]) -> int | None:
    """Position of the column of exposure times, by which readings are divided; None without one."""
    return next((i for i, name in enumerate(names) if _without_time(_key(name)) in _EXPOSURES), None)


def unused_factors(names: Sequence[str]) -> list[str]:
    """Columns that seem to say by what the readings should be divided, and that nothing here uses."""
    return [name for name in names if _key(name) in _FACTORS]


_EXPOSURES = words_of("exposure exposuretime integrationtime shutter exptime")
_FACTORS = words_of(
    "monitor reference ref iref referencesignal monitorsignal refsignal sensitivity gain attenuation filter nd od "
    "lamp laserpower sourcepower"
)


def _without_time(key: str) -> str:
    for unit in ("seconds", "ms", "us", "s"):
        if key.endswith(unit) and key.removesuffix(unit) in _EXPOSURES:
            return key.removesuffix(unit)
    return key


def _key(name: str) -> str:
    """The words of a name without units, in one; a V in volts is no Stokes V but a voltage. None of a very long one."""
    if len(name) > LONGEST:
        return ""
    if re.fullmatch(r"v[\s_]*[\[(]?[mµuμ]?v[\])]?", name.strip().lower()):
        return "voltage"
    text = re.sub(r"[\[(].*?[\])]", " ", name.lower())
    words = _WORD.findall(text)
    while len(words) > 1 and words[-1] in _UNIT_WORDS | {
        "mv",
        "v",
        "counts",
        "adu",
        "uw",
        "mw",
        "nw",
        "na",
        "waves",
    }:
        words.pop()
    return "".join(words)


def _unit(name: str) -> str:
    if len(name) > LONGEST:
        return ""
    bracketed = re.search(r"[\[(]\s*([^\])]*?)\s*[\])]", name)
    if bracketed:
        return bracketed[1].lower()
    words = _WORD.findall(name.lower())
    return (
        words[-1]
        if len(words) > 1 and words[-1] in ("mv", "v", "counts", "adu", "uw", "mw", "nw", "na")
        else ""
    )


def _stated(names: Sequence[str], settings: Settings, where: str) -> dict[int, ReadingName]:
    """The columns of states that are stated by name; one that is called I_NAME counts, too."""
    found: dict[int, ReadingName] = {}
    lowered = {name.lower(): state for name, state in settings.states.items()}
    missing = set(lowered)
    for index, name in enumerate(names):
        if len(name) > LONGEST:
            continue
        text, deviation, coverage = split_uncertainty(name)
        plain = re.sub(r"\s*[\[(].*?[\])]\s*$", "", text).strip().lower()
        for candidate in (name.lower(), plain, re.sub(r"^i_?", "", plain)):
            if candidate in lowered:
                found[index] = ReadingName(lowered[candidate], deviation, coverage, _unit(text))
                if not deviation:
                    missing.discard(candidate)
                break
    if missing == set(lowered):
        return {}
    if missing:
        raise DataError(
            f"{where}: there is no column {min(missing)!r} of the states that are stated; the columns are "
            f"{', '.join(names)}"
        )
    return found


def _horizontal_and_vertical(names: Sequence[str]) -> bool:
    return {"h", "v"} <= {name.strip().lower() for name in names}


def _without_lone_letters(found: dict[int, ReadingName], names: Sequence[str]) -> dict[int, ReadingName]:
    """Without what is bare, unless the whole set speaks for itself: H with V, or the angles of a usual set."""
    bare = {index: name for index, name in found.items() if name.bare}
    angles = {name.state.polarizer for name in bare.values() if name.state.retarder is None}
    letters = _horizontal_and_vertical(names)
    usual = angles in (
        {0.0, 45.0, 90.0, 135.0},
        {0.0, 45.0, 90.0, -45.0},
        {0.0, 60.0, 120.0},
        {0.0, 45.0, 90.0},
    )
    return found if letters or usual else {i: name for i, name in found.items() if i not in bare}


def _with_hyphens(found: dict[int, ReadingName]) -> dict[int, ReadingName]:
    """Angles after hyphens that are no signs, because all of them have one, turned positive."""
    angles = {index: name for index, name in found.items() if name.state.polarizer is not None}
    if not angles or not all(name.hyphen for name in angles.values()):
        return found
    return found | {
        index: ReadingName(
            State(abs(name.state.polarizer or 0.0), name.state.retarder, name.state.retardance),
            name.deviation,
            name.coverage,
            name.unit,
            name.quantity,
        )
        for index, name in angles.items()
    }


def _counts(states: set[State]) -> bool:
    """Whether the angles only count the columns, 0, 1, 2 … or 1, 2, 3 …, or cannot be angles of an analyser."""
    angles = [state.polarizer for state in states if state.polarizer is not None and state.retarder is None]
    if len(angles) < len(states):
        return False
    return max(map(abs, angles)) < 10.0 or max(map(abs, angles)) > 360.0 or min(map(abs, angles)) > 90.0


def _are_elements(names: Iterable[str]) -> bool:
    """Whether the columns are elements of a matrix, S_11, S_12 … S_33 or S00, S01 …, and not angles of 11°, 12° …"""
    found = [re.search(r"[A-Za-z][\s_(\[{]*(\d)[\s_,]*(\d)(?!\d)", name) for name in names]
    places = {match.groups() for match in found if match}
    first = "0" if ("0", "0") in places else "1"
    within = all(first <= digit <= str(int(first) + 3) for place in places for digit in place)
    return within and len(places) == len(found) and {(first, first), (first, str(int(first) + 1))} <= places


def _without_odd_pairs(found: dict[int, ReadingName]) -> dict[int, ReadingName]:
    """Without names of two numbers, unless all are those of the classic set I(0,0), I(45,0), I(90,0), I(45,90)."""
    pairs = {index: name.state for index, name in found.items() if name.pair}
    classic = all(
        state.retardance == 0.0 or (state.retardance == 90.0 and (state.polarizer or 0.0) % 90.0 == 45.0)
        for state in pairs.values()
    )
    return found if classic else {index: name for index, name in found.items() if index not in pairs}


def _plain_angles(values: Mapping[int, ReadingName]) -> list[float]:
    """The angles where all states are those of a polariser; none otherwise."""
    if any(name.state.named or name.state.retarder is not None for name in values.values()):
        return []
    return [name.state.polarizer or 0.0 for name in values.values()]


def _may_be_views(values: Mapping[int, ReadingName], names: Sequence[str]) -> bool:
    """Whether a column for each angle may be one for each viewing angle."""
    angles = _plain_angles(values)
    has_view = any(_key(name) in _VIEWS for name in names)
    return bool(angles) and max(map(abs, angles)) < 90.0 and not has_view


def _may_be_azimuths(values: Mapping[int, ReadingName], names: Sequence[str]) -> bool:
    """Whether a column for each angle may be one for each azimuth."""
    angles = _plain_angles(values)
    has_azimuth = any("phi" in _key(name) or "azim" in _key(name) for name in names)
    return bool(angles) and max(angles) - min(angles) >= 180.0 and not has_azimuth


_VIEWS = words_of(
    "thetar thetao thetaout thetav thetaview thetareflected zenithr zenitho zenithv viewzenith viewangle"
)


def _computed(names: Sequence[str], used: set[int | None] | set[int]) -> tuple[int, ...]:
    found = []
    for index, name in enumerate(names):
        key = _key(split_uncertainty(name)[0])
        if index not in used and (key in _COMPUTED or re.fullmatch(r"cov[iquvs\d]{2,4}", key)):
            found.append(index)
    return tuple(found)
