"""How the readings of a table were taken: the lines ``# analyzer_KEY: VALUE`` of its header, or the option `analyzer`.

================ ============================================= ================================================
key              values                                        if it is not stated
================ ============================================= ================================================
``zero``         p, s, or degrees from p to the direction that the file's ``stokes``, else p is assumed: 0 lies in
                 the instrument counts as 0                    the plane of the ray and the normal
``sense``        counterclockwise or clockwise, seen by the    counterclockwise (from p towards s)
                 detector that looks into the light
``circular``     receiver or source: who sees *right* circular receiver is assumed where R or L is a state
                 light turn clockwise
``polarizer``    angle of the polariser behind a retarder      0 is assumed
``retardance``   of the retarder, degrees                      90 of a quarter-wave plate, else an error
``transmission`` share of natural light that an analyser       0.5, as of a perfect polariser: I0 + I90 = I
                 passes; 1 if I0 is I + Q
``dark``         what the detector reads without light         0, or what a column or rows called dark hold
``gain``         electrons per unit of the readings: their     no shot noise
                 shot noise is their uncertainty
``states``       ``NAME = STATE; NAME = STATE``, or a file of  the names themselves
                 analyser vectors or of an instrument
================ ============================================= ================================================

``STATE`` is said in the words of :mod:`pbrdf.instruments.reduction.reading_states`, for example ``retarder 30 90,
polarizer 0``. ``analyser_KEY`` is the same as ``analyzer_KEY``.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from pbrdf.errors import DataError
from pbrdf.instruments.polarimeter.analyzer_files import read_analyzer
from pbrdf.instruments.polarimeter.instrument_files import load_instrument
from pbrdf.instruments.reduction.reading_states import DARK, OPEN, State, parse_state
from pbrdf.optics.angles import radians_within_a_turn
from pbrdf.optics.elements import diattenuator, retarder, rotate_frame

__all__ = ["KEYS", "Settings", "is_setting", "settings_of"]

KEYS = (
    "zero",
    "sense",
    "circular",
    "polarizer",
    "retardance",
    "transmission",
    "dark",
    "gain",
    "states",
)
_KEY = re.compile(r"analy[sz]er_(\w+)", re.IGNORECASE)
_LINE = re.compile(rf"\s*#\s*analy[sz]er_({'|'.join(KEYS)})\s*:", re.IGNORECASE)


@dataclass(frozen=True)
class Settings:
    """How readings were taken; angles in degrees.

    Attributes
    ----------
    zero
        From p to the direction that counts as 0, in the sense from p towards s.
    clockwise
        Whether angles count the other way.
    right_is_left
        Whether *right* circular means what the source sees, which the receiver calls left.
    polarizer
        Angle of the fixed polariser behind a retarder.
    retardance
        Of the retarder, where its name does not say it; None if nobody said it.
    transmission
        Share of natural light that an analyser passes.
    dark
        Reading without light.
    gain
        Electrons per unit of the readings; None without shot noise.
    states
        States by the names of their columns.
    stated
        Keys that the file or the user states.
    """

    zero: float = 0.0
    clockwise: bool = False
    right_is_left: bool = False
    polarizer: float = 0.0
    retardance: float | None = None
    transmission: float = 0.5
    dark: float | None = None
    gain: float | None = None
    states: Mapping[str, State] = field(default_factory=dict)
    stated: frozenset[str] = frozenset()

    def vector(self, state: State) -> np.ndarray:
        """Analyser vector in the axes (p, s) of the surface, shape (4,); raises DataError without a retardance."""
        if state.named == DARK:
            return np.zeros(4)
        if state.named == OPEN:
            return np.array([1.0, 0.0, 0.0, 0.0])
        if state.named in ("p", "s"):
            return self.transmission * np.array([1.0, 1.0 if state.named == "p" else -1.0, 0.0, 0.0])
        if state.named in ("right", "left"):
            # V > 0 is left circular for the receiver.
            left = (state.named == "left") != self.right_is_left
            return self.transmission * np.array([1.0, 0.0, 0.0, 1.0 if left else -1.0])
        turn = rotate_frame(radians_within_a_turn(self.zero))
        if state.vector is not None:
            turned: np.ndarray = np.asarray(state.vector) @ turn
            return turned
        sign = -1.0 if self.clockwise else 1.0
        axis = self.polarizer if state.polarizer is None else state.polarizer
        row = 2.0 * self.transmission * diattenuator(sign * radians_within_a_turn(axis))[0]
        if state.retarder is not None:
            retardance = self.retardance if state.retardance is None else state.retardance
            if retardance is None:
                raise DataError(
                    "the retardance of the retarder is not stated; add a line '# analyzer_retardance: 90' or the "
                    "option analyzer retardance"
                )
            fast = sign * radians_within_a_turn(state.retarder)
            row = row @ retarder(fast, radians_within_a_turn(retardance))
        analyzer: np.ndarray = row @ turn
        return analyzer

    def assumptions(self, states: list[State], stokes_stated: bool) -> list[str]:
        """Sentences on what these states need that nobody stated."""
        said = []
        turned = [state for state in states if state.named is None]
        if turned and not {"zero"} & self.stated and not stokes_stated:
            said.append(
                "the file does not say where the analyser's angle 0 (H) lies; p was assumed, the plane of the viewing "
                "ray and the normal, with angles from p towards s (# analyzer_zero: p or s)"
            )
        if any(state.named in ("right", "left") for state in states) and "circular" not in self.stated:
            said.append(
                "right circular light was assumed to turn clockwise for the receiver, who looks into it (V < 0); "
                "# analyzer_circular: source means the opposite"
            )
        retarders = [state for state in states if state.retarder is not None]
        if any(state.polarizer is None for state in retarders) and "polarizer" not in self.stated:
            said.append(
                "the polariser behind the retarder was assumed to stand at 0 (# analyzer_polarizer: degrees)"
            )
        if retarders:
            said.append(
                "the retarder's angle was taken as that of its fast axis; that of the slow one is 90 further"
            )
        return said


def is_setting(line: str, key: str | None = None) -> bool:
    """Whether a comment line states how readings were taken, or this key of it."""
    found = _LINE.match(line)
    return found is not None and key in (None, found[1].lower())


def settings_of(
    path: Path, statements: dict[str, Any], option: Mapping[str, Any] | None
) -> tuple[Settings, dict[str, Any]]:
    """Settings, and the statements that are none.

    Parameters
    ----------
    path
        The file, for messages; names of files start from its folder.
    statements
        Key and value of the header.
    option
        Settings by their keys, which go before the header's.

    Raises
    ------
    DataError
        If a key is not known, or a value is not understood.
    """
    own: dict[str, Any] = {}
    rest: dict[str, Any] = {}
    for key, value in statements.items():
        found = _KEY.fullmatch(key)
        word = found[1].lower() if found else ""
        # a slip of the pen is told from a remark, '# analyzer_maker: …', which stays an attribute
        if word in KEYS or difflib.get_close_matches(word, KEYS, n=1, cutoff=0.75):
            own[word] = value
        else:
            rest[key] = value
    own |= option or {}
    for key in own:
        if key not in KEYS:
            near = difflib.get_close_matches(key, KEYS, n=1)
            hint = f"did you mean {near[0]!r}? " if near else ""
            raise DataError(f"{path}: analyzer {key}: there is no such key; {hint}use {', '.join(KEYS)}")

    def number(key: str, default: float | None, low: float = -math.inf) -> float | None:
        if key not in own:
            return default
        try:
            value = float(own[key])
        except (TypeError, ValueError):
            value = math.nan
        if not (math.isfinite(value) and value > low):
            need = "a number" if low == -math.inf else f"a number above {low:g}"
            raise DataError(f"{path}: analyzer {key} is {own[key]!r}; give {need}")
        return value

    def choice(key: str, choices: tuple[str, str]) -> bool:
        text = str(own.get(key, choices[0])).strip().lower()
        if text not in choices:
            raise DataError(f"{path}: analyzer {key} is {own[key]!r}; use {' or '.join(choices)}")
        return text == choices[1]

    sides = {"p": 0.0, "s": 90.0}
    if "zero" not in own:
        zero = 90.0 if str(statements.get("stokes", "p-s")).replace(" ", "").lower() == "s-p" else 0.0
    elif str(own["zero"]).strip().lower() in sides:
        zero = sides[str(own["zero"]).strip().lower()]
    else:
        try:
            zero = float(own["zero"])
        except (TypeError, ValueError):
            raise DataError(
                f"{path}: analyzer zero is {own['zero']!r}; use p, s, or degrees from p to the analyser's zero"
            ) from None
    states, turn = _states(path, own["states"]) if "states" in own else ({}, None)
    if turn is not None and "zero" not in own:
        zero = turn
        own["zero"] = turn
    transmission = number("transmission", 0.5, 0.0)
    assert transmission is not None
    return (
        Settings(
            zero=zero,
            clockwise=choice("sense", ("counterclockwise", "clockwise")),
            right_is_left=choice("circular", ("receiver", "source")),
            polarizer=number("polarizer", 0.0) or 0.0,
            retardance=number("retardance", None),
            transmission=transmission,
            dark=number("dark", None),
            gain=number("gain", None, 0.0),
            states=states,
            stated=frozenset(own),
        ),
        rest,
    )


def _states(path: Path, stated: Any) -> tuple[dict[str, State], float | None]:
    """States by name, and the angle from p to the axes of the instrument where its file says it, degrees."""
    if isinstance(stated, Mapping):
        parts = {str(name): str(text) for name, text in stated.items()}
    elif "=" in str(stated):
        pairs = [part.partition("=") for part in str(stated).split(";") if part.strip()]
        parts = {name.strip(): text.strip() for name, _, text in pairs}
    else:
        return _states_of_file(path.parent / str(stated))
    found = {}
    for name, text in parts.items():
        state = parse_state(text)
        if not name or state is None:
            raise DataError(
                f"{path}: analyzer states: {name} = {text!r} is not understood; say it as 'polarizer 45', "
                "'retarder 30 90, polarizer 0', 'RCP', 'open', 'dark', or as an analyser vector of four numbers"
            )
        found[name] = state
    return found, None


def _states_of_file(file: Path) -> tuple[dict[str, State], float | None]:
    turn = None
    if file.suffix.lower() == ".toml":
        instrument = load_instrument(file)
        polarimeter, turn = instrument.polarimeter, math.degrees(instrument.reference_angle)
    else:
        polarimeter = read_analyzer(file)
    if polarimeter.is_map:
        raise DataError(f"{file}: analyser vectors that vary over the picture do not fit single readings")
    vectors = [State(vector=(w[0], w[1], w[2], w[3])) for w in polarimeter.analyzer.tolist()]
    return dict(zip(polarimeter.states, vectors, strict=True)), turn
