"""What stood before the detector, from the name of a column or a label: ``I45``, ``I(0°)``, ``I_RCP``, ``qwp22.5``.

A state is a linear polariser at an angle, a retarder at an angle before a polariser, or one that has a name. Angles
are in degrees and count in the axes of the instrument; :mod:`pbrdf.instruments.reduction.reading_settings` says where
these lie and turns a state into an analyser vector.

=========================== ========================================================================================
name                        state
=========================== ========================================================================================
``I0 I_45 I-45 L(90°) 135deg pol60 I_m45``  polariser at the angle; ``P0`` too
``H V``; ``D P plus``, ``A M minus``        polariser at 0, 90; at 45; at −45
``p s``, ``TM TE``, ``par perp``            polariser along the plane of the ray and the normal, or across it
``R RCP RHC``, ``L LCP LHC``                passes right, left circular light
``qwp30``, ``P0_Q45``, ``I_P0_R45_D90``     quarter-wave plate at 30; with the polariser at 0; any retarder
``I(45,90)``                                polariser at 45 behind a retarder of 90° with its fast axis at 0, as in
                                            Collett, *Polarized Light*, and Goldstein's book of that name
``open total``; ``dark background``         no analyser; no light
=========================== ========================================================================================

``P`` is +45° beside H, V or M, and the plane of incidence beside s. A hyphen before a number is a minus, unless every
angle of the set has one.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from pbrdf.errors import DataError

__all__ = [
    "DARK",
    "LONGEST",
    "OPEN",
    "ReadingName",
    "State",
    "parse_label",
    "parse_name",
    "parse_state",
    "settle",
    "split_uncertainty",
    "words_of",
]

#: States without an analyser and without light.
OPEN, DARK = "open", "dark"


def words_of(text: str) -> frozenset[str]:
    """The words of a text."""
    return frozenset(text.split())


@dataclass(frozen=True)
class State:
    """A state of the analyser.

    Attributes
    ----------
    polarizer
        Angle of the polariser's axis, degrees; None where the name does not say it.
    retarder, retardance
        Angle of the fast axis of a retarder before it, and its retardance, degrees; None without one, or not said.
    named
        ``p``, ``s``, ``right``, ``left``, ``open``, ``dark``; while a set is not yet settled also ``P``, ``par``,
        ``perp``. None where angles say it all.
    vector
        The analyser vector itself, in the axes of the instrument, where it was stated.
    """

    polarizer: float | None = None
    retarder: float | None = None
    retardance: float | None = None
    named: str | None = None
    vector: tuple[float, float, float, float] | None = None


@dataclass(frozen=True)
class ReadingName:
    """What the name of a column of readings says.

    Attributes
    ----------
    state
        The state.
    deviation
        Whether the column holds uncertainties of the readings.
    coverage
        Coverage factor by which they are expanded; None where the name does not say.
    unit
        Unit of the column, in lower case, "" where none is said.
    quantity
        Quantity that the name says, None where it does not.
    bare
        Whether nothing but a number or a letter stands there, which alone is no sure sign of a reading.
    hyphen
        Whether a hyphen, and nothing else, stands between a word and the number.
    pair
        Whether two numbers without words say the state, I(45,90).
    """

    state: State
    deviation: bool = False
    coverage: float | None = None
    unit: str = ""
    quantity: str | None = None
    bare: bool = False
    hyphen: bool = False
    pair: bool = False


_UNITS = words_of(
    "v mv uv μv a ma ua μa na pa w mw uw μw nw pw counts count cts adu dn a.u. au arb arb. "
    "arbitrary % 1/sr sr^-1 sr-1 /sr e- electrons cps 1 -"
)
#: Units that may stand at the end of a name without brackets; a single letter there is a state.
_TRAILING_UNITS = words_of("mv uv μv ma ua μa na pa mw uw μw nw pw counts cts adu dn arb")
_ANGLE_UNITS = words_of("deg degs degree degrees °")

_PREFIXES = words_of(
    "i l s v r f p j int intens intensity radiance reading readings signal sig volt voltage pd "
    "photodiode diode photocurrent current det detector ch channel dn counts count adu power "
    "brdf fr refl reflectance reflectancefactor mean avg average cam camera image img value "
    "val state meas measured"
)
#: With these ``_s`` and ``_p`` mean the light of the source, not the analyser.
_REFLECTANCES = words_of("r f brdf fr refl reflectance reflectancefactor")
_FILLERS = words_of("angle axis at state the and fast analysis mean avg average")
_POLARIZERS = words_of("p pol polar polarizer polariser lp linear analyzer analyser ana an a psa wgp")
_RETARDERS = {
    **dict.fromkeys(words_of("q qwp qw quarterwave quarterwaveplate"), 90.0),
    **dict.fromkeys(words_of("hwp halfwave halfwaveplate"), 180.0),
    **dict.fromkeys(words_of("r ret retarder wp waveplate plate c comp compensator")),
}
_RETARDANCES = words_of("d delta δ retardance")
_MINUS, _PLUS = words_of("m minus neg n"), words_of("plus pos")

_NAMES = {
    **dict.fromkeys(words_of("h hor horiz horizontal x"), State(polarizer=0.0)),
    **dict.fromkeys(words_of("v ver vert vertical y"), State(polarizer=90.0)),
    **dict.fromkeys(words_of("d diag diagonal plus"), State(polarizer=45.0)),
    **dict.fromkeys(words_of("a m antidiag antidiagonal anti minus"), State(polarizer=-45.0)),
    **dict.fromkeys(words_of("r right rcp rhc rhcp rc"), State(named="right")),
    **dict.fromkeys(words_of("l left lcp lhc lhcp lc"), State(named="left")),
    **dict.fromkeys(words_of("s te spol"), State(named="s")),
    **dict.fromkeys(words_of("tm ppol"), State(named="p")),
    "p": State(named="P"),
    **dict.fromkeys(words_of("par parallel para"), State(named="par")),
    **dict.fromkeys(words_of("perp perpendicular"), State(named="perp")),
    **dict.fromkeys(words_of("open none total tot all nopol noanalyzer noanalyser"), State(named=OPEN)),
    **dict.fromkeys(words_of("dark background bg bkg bkgd black"), State(named=DARK)),
}
_QUANTITIES = {
    "brdf": "brdf",
    "fr": "brdf",
    "reflectancefactor": "reflectance_factor",
    "radiance": "radiance",
    "dn": "dn",
}

_DEVIATION = "standarduncertainty|uncertainty|unc|stdev|stddev|stderr|std|sd|sem|se|sigma|σ|error|err"
_WRAPPED = re.compile(rf"({_DEVIATION}|u|δ|delta)\s*[(\[](.+)[)\]]", re.IGNORECASE)
_BEFORE = re.compile(
    rf"({_DEVIATION}|u|δ|delta)(?:[\s_.]+|(?=\d))(.+)|(d|δ)([IL][\s_.(\[]*[-+]?\d.*)", re.IGNORECASE
)
_AFTER = re.compile(rf"(.*?)[\s_.]+({_DEVIATION}|u)|(.*?)({_DEVIATION})", re.IGNORECASE)
_COVERAGE = re.compile(r"[(\[,;]?\s*\bk\s*=\s*(\d+(?:\.\d+)?)\s*[)\]]?", re.IGNORECASE)
_BRACKETS = re.compile(r"[(\[{]([^()\[\]{}]*)[)\]}]")
#: Characters of the longest name that is looked into.
LONGEST = 200
#: A number above this many degrees is none of an angle, but a wavelength.
_FULL_TURN = 360.0
_TOKEN = re.compile(r"([+-]?\d+(?:\.\d+)?)|([^\W\d_]+|°)")


def split_uncertainty(name: str) -> tuple[str, bool, float | None]:
    """The name without what makes it one of uncertainties; whether it is one; the coverage factor, if it is stated.

    A capital ``U`` alone is that of an expanded uncertainty; without its factor it counts as k = 2.
    """
    if len(name) > LONGEST:
        return name, False, None
    text = re.sub(r"\bf_r(?=[\W_]|$)", "fr", _clean(name))
    coverage = None
    if stated := _COVERAGE.search(text):
        coverage = float(stated[1])
        text = (text[: stated.start()] + text[stated.end() :]).strip(" _-")
    wrapped = _WRAPPED.fullmatch(text)
    # std (mV) has a unit in its brackets; u(V) is the uncertainty of V, but U (V) is U in volts
    if wrapped and (wrapped[2].strip().lower() not in _UNITS or (wrapped[1], wrapped[2]) == ("u", "V")):
        sign, rest = wrapped[1], wrapped[2]
    elif found := _BEFORE.fullmatch(text):
        sign, rest = (found[1], found[2]) if found[1] else (found[3], found[4])
    elif found := _AFTER.fullmatch(_without_unit(text)[0]):
        rest, sign = (found[1], found[2]) if found[2] else (found[3], found[4])
        unit = _without_unit(text)[1]
        rest = f"{rest} [{unit}]" if unit else rest
    else:
        return text, coverage is not None, coverage
    return rest, True, 2.0 if sign == "U" and coverage is None else coverage


def parse_name(name: str) -> ReadingName | None:
    """What the name of a column says if it is one of readings; None if it is not."""
    text, deviation, coverage = split_uncertainty(name)
    text, unit = _without_unit(text)
    tokens, hyphen = _tokens(text)
    prefix = ""
    if tokens and isinstance(tokens[0], str) and len(tokens) > 1:
        first, second = tokens[0], tokens[1]
        # P0 is a polariser, P_H a power; R0 a reflectance, I_R45 a retarder; the last is asked for by parse_state
        if first in _PREFIXES and not (first == "p" and not isinstance(second, str)):
            prefix, tokens = first, tokens[1:]
    if not prefix and tokens and isinstance(tokens[0], str):
        head = tokens[0]
        if (
            head[0] in "il"
            and head[1:] in {*_NAMES, *_MINUS}
            and head not in _NAMES
            and head not in _POLARIZERS
        ):
            prefix, tokens = head[0], [head[1:], *tokens[1:]]
    if not tokens or (not prefix and tokens[0] in _MINUS | _PLUS):
        return None
    state = _state(tokens)
    if state is None or (prefix in _REFLECTANCES and (state.named or isinstance(tokens[0], str))):
        return None
    if {"x", "y"} & set(tokens) and prefix not in ("i", "int", "intensity", "signal"):
        return None  # a component of a vector
    alone = not prefix and len(tokens) == 1
    return ReadingName(
        state,
        deviation,
        coverage,
        unit,
        _QUANTITIES.get(prefix),
        bare=alone
        and (not isinstance(tokens[0], str) or len(tokens[0]) == 1 or state.named in (OPEN, "par", "perp")),
        hyphen=hyphen,
        pair=sum(not isinstance(token, str) for token in tokens) == 2 == len(tokens),
    )


def parse_label(text: str) -> State | None:
    """What a label in a cell says, where nothing but a state can stand: ``45``, ``H``, ``RCP``, ``qwp30 pol0``."""
    found = parse_name(text)
    if found is not None and len(text.strip()) != 1:
        return found.state
    tokens, _ = _tokens(_clean(text))
    return _state(tokens) if tokens else None


def parse_state(text: str) -> State | None:
    """A state in words: ``polarizer 45``, ``retarder 30 90, polarizer 0``, ``RCP``, or an analyser vector of 4 numbers.

    The second number after a retarder is its retardance.
    """
    parts = re.split(r"[\s,]+", _clean(text).strip(" ()[]"))
    try:
        numbers = [float(part) for part in parts]
    except ValueError:
        return parse_label(re.sub(r"(\d)[\s,]+([+-]?[\d.]+)(?![\d.]*\s*[°d])", r"\1 delta \2", _clean(text)))
    if len(numbers) == 4:
        return State(vector=(numbers[0], numbers[1], numbers[2], numbers[3]))
    return State(polarizer=numbers[0]) if len(numbers) == 1 else None


def settle(states: Sequence[State], where: str) -> tuple[list[State], list[str]]:
    """Decide what only the whole set tells: whether P is +45° or the plane of incidence.

    Parameters
    ----------
    states
        The set.
    where
        How a message begins.

    Returns
    -------
    states, assumptions
        The same states in the same order, and sentences on what was assumed.

    Raises
    ------
    DataError
        If the set does not tell.
    """
    named = {state.named for state in states}
    diagonal = any(state.polarizer in (0.0, 90.0, -45.0) and state.retarder is None for state in states)
    meaning: dict[str | None, State] = {}
    assumptions = []
    if "P" in named:
        if ("s" in named) == diagonal:
            raise DataError(
                f"{where}: P may be the polariser at +45° or along the plane of incidence (p), and the other states do "
                "not tell which; state it, '# analyzer_states: NAME = polarizer 45; …'"
            )
        meaning["P"] = State(named="p") if "s" in named else State(polarizer=45.0)
    if named & {"par", "perp"}:
        meaning |= {"par": State(named="p"), "perp": State(named="s")}
        assumptions.append(
            "parallel and perpendicular were taken as along and across the plane of the ray and the normal (p and s), "
            "not as along and across a polariser of the source"
        )
    return [meaning.get(state.named, state) for state in states], assumptions


def _clean(text: str) -> str:
    for sign, plain in (("º", "°"), ("−", "-"), ("–", "-"), ("∥", " par "), ("‖", " par "), ("⊥", " perp ")):
        text = text.replace(sign, plain)
    return unicodedata.normalize("NFKC", text).strip()


def _without_unit(text: str) -> tuple[str, str]:
    """The name without its unit, brackets that hold a state opened; and the unit."""
    unit = ""

    def opened(found: re.Match[str]) -> str:
        nonlocal unit
        content = found[1].strip().lower()
        if content in _UNITS and content != "1":
            unit = content
            return " "
        return " " if content in _ANGLE_UNITS else f" {found[1]} "

    text = _BRACKETS.sub(opened, text).strip()
    if (per := re.fullmatch(r"(.*\S)\s*/\s*(\S+)", text)) and per[2].lower() in _UNITS:
        text, unit = per[1], per[2].lower()
    words = re.split(r"[\s_]+", text)
    if len(words) > 1 and words[-1].lower() in _TRAILING_UNITS:
        unit = words[-1].lower()
        text = text[: -len(words[-1])].rstrip(" _")
    return text, unit


def _tokens(text: str) -> tuple[list[str | float], bool]:
    """Words in lower case and numbers; and whether a hyphen follows a word directly."""
    text = re.sub(r"(\d)p(\d)", r"\1.\2", text)  # 22p5
    hyphen = re.search(r"[^\W\d_]-\d", text) is not None
    text = re.sub(r"(\d)-(?=\d)", r"\1 ", text)
    found: list[str | float] = []
    rest = text
    for number, word in _TOKEN.findall(text):
        rest = rest.replace(number or word, " ", 1)
        if number:
            found.append(float(number))
        elif word.lower() not in _ANGLE_UNITS:
            found.append(word.lower())
    if any(isinstance(part, float) and abs(part) > _FULL_TURN for part in found):
        return [], hyphen
    # What stands there besides (a slash, an asterisk) is no name of a state.
    return ([] if re.search(r"[^\s_.,;:=+@()\[\]-]", rest) else found), hyphen


def _state(tokens: Iterable[str | float]) -> State | None:
    """The state that words and numbers say, None if they say none, or two."""
    state = State()
    pending = ""
    numbers = 0
    for token in tokens:
        if isinstance(token, str):
            if pending:
                return None
            if token in _FILLERS:
                continue
            pending = token
            continue
        word, pending = pending, ""
        if word in _MINUS:
            word, token = "", -token
        elif word in _PLUS:
            word = ""
        if word in _RETARDERS and state.retarder is None:
            state = replace(state, retarder=token, retardance=_RETARDERS[word])
        elif word in _RETARDANCES and state.retarder is not None:
            state = replace(state, retardance=token)
        elif word in _POLARIZERS or (not word and not numbers):
            if state.polarizer is not None:
                return None
            state = replace(state, polarizer=token)
        elif not word and numbers == 1 and state.retarder is None:
            state = replace(state, retarder=0.0, retardance=token)
        else:
            return None
        numbers += 1
    if pending:
        return _NAMES.get(pending) if state == State() else None
    return state if state != State() else None
